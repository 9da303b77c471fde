"""Real edges on which OCCT's native fillet fails or returns an invalid solid: they come back valid at the same radius.

The STEP files stand beside the project where they are at hand; elsewhere these tests are skipped.
"""

import pytest
from OCP.TopoDS import TopoDS
from places import CASES
from real_parts import PART, SCREW, listed, part
from solid_problems import list_problems

import cqblend
from cqblend.brep.verification.brep_check import is_valid

FREEFORM = [(SCREW, n) for n in (30, 37, 40, 47, 51, 54)] + [
    (PART, n) for n in (113, 127, 131, 139, 306, 310, 320, 323)
]
OTHERS = [(SCREW, n) for n in (2, 9, 21, 43)] + [(PART, 264)]

pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="the STEP cases are not at hand")


@pytest.mark.parametrize(("name", "number"), [*FREEFORM, *OTHERS])
def test_an_edge_on_which_native_fillet_fails(name, number):
    shape, edges = part(name)
    edge = listed(name, number)
    radius = next(trial["radius"] for trial in edge["trials"] if trial["native"] != "ok")
    assert ("BSplineSurface" in edge["faces"]) == ((name, number) in FREEFORM)
    result = cqblend.blend_edges(shape, TopoDS.Edge_s(edges.FindKey(number)), radius, ends="flat", chain=False)
    assert is_valid(result.shape)
    assert list_problems(shape, result.shape, result.faces, tolerance=0.1) == []
    assert result.certificate.angle < 1e-6
    assert result.certificate.gap < 1e-7
