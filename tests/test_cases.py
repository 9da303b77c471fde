"""Real edges on which OCCT's native fillet fails or returns an invalid solid: they come back valid at the same radius.

The STEP files stand beside the project where they are at hand; elsewhere these tests are skipped.
"""

import json
from functools import cache
from pathlib import Path

import pytest
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape

import cqblend
from cqblend.brep.step_files import read_step
from cqblend.brep.verification.soundness import check_solid, is_valid

CASES = Path(__file__).parents[2] / "shared" / "cases"
SCREW, PART = "bd__M6-1x12-countersunk-screw.step", "nist__nist_ctc_05_asme1_ap242-e1.stp"
FREEFORM = [(SCREW, n) for n in (30, 37, 40, 47, 51, 54)] + [
    (PART, n) for n in (113, 127, 131, 139, 306, 310, 320, 323)
]
OTHERS = [(SCREW, n) for n in (2, 9, 21, 43)] + [(PART, 264)]

pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="the STEP cases are not at hand")


@cache
def part(name):
    shape = read_step(CASES / name)
    edges = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, TopAbs_EDGE, edges)
    return shape, edges


@cache
def listed(name, number):
    (edge,) = (edge for edge in json.loads((CASES / "edges.json").read_text())[name] if edge["edge"] == number)
    return edge


@pytest.mark.parametrize(("name", "number"), [*FREEFORM, *OTHERS])
def test_an_edge_on_which_native_fillet_fails(name, number):
    shape, edges = part(name)
    edge = listed(name, number)
    radius = next(trial["radius"] for trial in edge["trials"] if trial["native"] != "ok")
    assert ("BSplineSurface" in edge["faces"]) == ((name, number) in FREEFORM)
    result = cqblend.blend_edges(shape, TopoDS.Edge_s(edges.FindKey(number)), radius, ends="flat")
    assert is_valid(result.shape)
    assert check_solid(shape, result.shape, result.faces, tolerance=0.1) == []
    assert result.certificate.angle < 1e-6
    assert result.certificate.gap < 1e-7
