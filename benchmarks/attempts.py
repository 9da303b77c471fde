"""One attempt at one edge, guarded: a worker process makes it, times it and measures what came out.

Native fillets hang and crash, so every attempt runs in a process of its own that can be killed; cqblend's run the same
way, so that times compare: CPU times, medians of several runs. What is measured is the same for both and asks only the
finished shapes: validity relative to the input (many STEP bodies fail BRepCheck's exact mode before anything is done to
them), change of volume, normal angle, edge tolerance.
"""

from __future__ import annotations

import math
import multiprocessing
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from multiprocessing.connection import Connection
from typing import NamedTuple

from OCP.BRep import BRep_Tool
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from benchmarks.blend_scores import Score
from benchmarks.timing import run_timed
from cqblend.blend_options import BLEND_DEFAULTS, BlendOptions
from cqblend.brep.measurement.edge_continuity import measure_continuity_between
from cqblend.brep.measurement.edge_sides import find_edge_sides
from cqblend.brep.topology import AncestorMap, ShapeIndex
from cqblend.brep.verification.solid_verification import check_solid
from cqblend.brep.verification.volumes import make_skew_plane, measure_volume
from cqblend.errors import CqblendError, CqblendWarning
from cqblend.solid_blends.blend_pipeline import blend_shape

EXACT = 1e-8
"""rad: the angle of joints that blends of exact form promise on imported bodies."""
SMOOTH = 0.1  # rad: an edge of the new face that meets its neighbour at less is a rail, at more an end


class Made(NamedTuple):
    """What came of an operation: the shape, the blend faces in it, and what angle of their joints it promises, rad."""

    shape: TopoDS_Shape
    faces: Sequence[TopoDS_Face]
    promise: float


Operation = Callable[[], Made]
Judge = Callable[[Made], Score]


@dataclass(frozen=True)
class Outcome:
    """What became of an attempt: ``status`` is "ok", "invalid", or the name of what went wrong, told by ``message``.

    The time is that of the operation, CPU ms, and also told of one that failed, but not of one that crashed.
    """

    status: str
    message: str = ""
    change: float = math.nan  # of the volume, mm^3
    angle: float = math.nan  # rad, largest along the rails
    tolerance: float = math.nan  # mm, largest of a new edge
    ms: float = math.nan
    verdict: str = ""  # of a judge, if there is one; "refused" if the library raised an error of its own, else "failed"
    faults: str = ""  # what the judge found
    joint_gap: float = math.nan  # mm, of smooth joints, as the judge measured them
    joint_angle: float = math.nan  # rad
    score: Score | None = None  # all that the judge said

    @property
    def reason(self) -> str:
        """Why the verdict is what it is, in words."""
        return self.faults if self.made else f"{self.status}: {self.message}"

    @property
    def made(self) -> bool:
        """Whether a solid came out, valid or not."""
        return self.status in ("ok", "invalid")

    @property
    def ok(self) -> bool:
        """Whether a valid solid came out."""
        return self.status == "ok"


def native(shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], radius: float) -> Operation:
    """Return the operation of rounding edges by OCCT's own fillet."""

    def run() -> Made:
        maker = BRepFilletAPI_MakeFillet(shape)
        for edge in edges:
            maker.Add(radius, edge)
        maker.Build()
        if not maker.IsDone():
            raise ArithmeticError("not done")
        faces = [TopoDS.Face_s(face) for edge in edges for face in maker.Generated(edge)]
        return Made(maker.Shape(), faces, math.inf)

    return run


def blended(shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], radius: float, form: str = "auto") -> Operation:
    """Return the operation of rounding edges by cqblend."""

    def run() -> Made:
        result = blend_shape(shape, edges, BlendOptions(radius, form=form).to_request())
        exact = result.certificate.form == "exact"
        return Made(result.shape, result.faces, EXACT if exact else BLEND_DEFAULTS.angular_tolerance)

    return run


@cache
def _load_modules() -> None:
    """Run both operations once in this process, so that no attempt has the time of loading modules on it."""
    box = BRepPrimAPI_MakeBox(3.0, 2.0, 1.0).Shape()
    edge = ShapeIndex(box, TopAbs_EDGE)[1]
    for make in (native, blended):
        make(box, [edge], 0.1)()


def attempt(shape: TopoDS_Shape, operation: Operation, timeout: float, judge: Judge | None = None) -> Outcome:
    """Run an operation on a shape in a process of its own, and measure what it makes, or ask a judge about it.

    With a judge the operation runs once: its time is a rough one.
    """
    _load_modules()
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    worker = context.Process(target=_work, args=(sender, shape, operation, judge))
    worker.start()
    sender.close()
    try:
        if receiver.poll(timeout):
            return receiver.recv()
    except EOFError:
        worker.join()
        return Outcome("crash", f"exit code {worker.exitcode}", verdict="failed")
    finally:
        worker.kill()
        worker.join()
    return Outcome("timeout", f"after {timeout:g} s", verdict="failed")


def _work(sender: Connection, shape: TopoDS_Shape, operation: Operation, judge: Judge | None) -> None:
    warnings.simplefilter("ignore", CqblendWarning)  # the outcome tells
    start = time.process_time()
    try:
        made, ms = run_timed(operation, repeats=5 if judge is None else 0)
    except Exception as error:  # noqa: BLE001 - OCCT throws anything
        status = "not done" if type(error) is ArithmeticError else type(error).__name__
        verdict = "refused" if isinstance(error, CqblendError) else "failed"
        outcome = Outcome(status, str(error), ms=1e3 * (time.process_time() - start), verdict=verdict)
    else:
        outcome = _measure_made(shape, made.shape, made.faces, ms) if judge is None else _ask(judge, made, ms)
    sender.send(outcome)


def _ask(judge: Judge, made: Made, ms: float) -> Outcome:
    score = judge(made)
    status = "invalid" if score.verdict == "unsound" else "ok"
    joints = {"joint_gap": score.gap, "joint_angle": score.angle}
    return Outcome(status, ms=ms, verdict=score.verdict, faults=score.message, score=score, **joints)


def _measure_made(before: TopoDS_Shape, after: TopoDS_Shape, faces: Sequence[TopoDS_Face], ms: float) -> Outcome:
    known = ShapeIndex(before, TopAbs_EDGE)
    fresh = [edge for edge in ShapeIndex(after, TopAbs_EDGE) if edge not in known]
    problems = [] if faces else ["no face was made"]
    faces_at = AncestorMap(after, TopAbs_EDGE, TopAbs_FACE)
    own = (edge for face in faces for edge in ShapeIndex(face, TopAbs_EDGE))
    free = [edge for edge in own if len(faces_at(edge)) == 1]  # ends in the border of an open shell, or seams
    problems += check_solid(before, after, faces, tolerance=math.inf, free_edges=free).problems
    plane = make_skew_plane(before)
    change = measure_volume(after, plane)[0] - measure_volume(before, plane)[0]
    angles = [0.0]
    present = ShapeIndex(after, TopAbs_FACE)
    for face in faces:
        for edge in ShapeIndex(face, TopAbs_EDGE) if face in present else []:
            if not BRep_Tool.Degenerated_s(edge):
                angle = _angle(after, edge)
                angles += [angle] if angle < SMOOTH else []
    tolerance = max((BRep_Tool.Tolerance_s(edge) for edge in fresh), default=math.nan)
    return Outcome("invalid" if problems else "ok", "; ".join(problems), change, max(angles), tolerance, ms)


def _angle(shape: TopoDS_Shape, edge: TopoDS_Edge) -> float:
    try:
        return measure_continuity_between(find_edge_sides(shape, edge), 200).angle
    except CqblendError:
        return math.nan  # an open or singular edge: the validity tells
