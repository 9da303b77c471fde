"""Real parts from STEP files and what is known of their edges; the files stand beside the project, or are absent."""

import json
from functools import cache

from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp
from OCP.TopTools import TopTools_IndexedMapOfShape
from places import CASES

from cqblend.brep.step_files import read_step

SCREW, PART = "bd__M6-1x12-countersunk-screw.step", "nist__nist_ctc_05_asme1_ap242-e1.stp"


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
