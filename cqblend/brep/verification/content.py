"""What must not get lost when a body is cut in two or sent through a file: its volume, or that under open shells.

Faces that bound no solid have a volume too: that between them and a plane, negative where they face it. It is additive
and as accurate as that of solids, while areas, as OCCT integrates them, are off by 1e-3 on an extruded spline.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from OCP.gp import gp_Pln
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS_Compound, TopoDS_Shape

from cqblend.brep.topology import ShapeIndex, make_compound
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.brep.verification.volumes import estimate_volume_error, make_skew_plane, measure_volume


@dataclass(frozen=True)
class Content:
    """The volume of the solids of a shape, or, if ``of_solids`` is not set, that under its other faces, mm^3.

    ``whole`` is the volume, ``error`` OCCT's estimate of its error; differences are relative to ``scale``, which is the
    volume of solids, and of faces the sum of the sizes of theirs. All are integrated from ``plane``. ``parts`` are the
    solids, or the faces.
    """

    of_solids: bool
    parts: TopoDS_Compound
    plane: gp_Pln
    whole: float
    error: float
    scale: float

    @cached_property
    def faces(self) -> ShapeIndex:
        """The faces of its parts."""
        return ShapeIndex(self.parts, TopAbs_FACE)

    def measure(self, shape: TopoDS_Shape) -> tuple[float, float]:
        """Return the content of some shape, and OCCT's estimate of its error."""
        return _measure(_collect_parts(shape, of_solids=self.of_solids), self.plane, of_solids=self.of_solids)

    def estimate_error(self, shape: TopoDS_Shape, value: float) -> float:
        """Estimate the error of a volume by another of OCCT's integrations, if that has one."""
        return estimate_volume_error(shape, value) if self.of_solids else 0.0

    def is_nothing(self, value: float) -> bool:
        """Whether the volume of a part of solids shows that there is no part; that of faces may be of any sign."""
        return self.of_solids and value <= 0.0

    def measure_mismatch(self, value: float) -> float:
        """Return the difference of a value from the whole, relative to the scale."""
        return abs(value - self.whole) / self.scale if self.scale else math.inf

    def differs(self, value: float, slack: float) -> bool:
        """Whether a value differs from the whole by more than integration may err, and a slack (mm^3)."""
        return abs(value - self.whole) > VERIFICATION_TOLERANCES.volume * self.scale + self.error + slack


def measure_content(shape: TopoDS_Shape, *, of_solids: bool) -> Content:
    """Measure the solids of a shape, or its other faces."""
    parts = _collect_parts(shape, of_solids=of_solids)
    plane = make_skew_plane(parts)
    whole, error = _measure(parts, plane, of_solids=of_solids)
    pieces = [parts] if of_solids else ShapeIndex(parts, TopAbs_FACE)
    return Content(of_solids, parts, plane, whole, error, sum(abs(measure_volume(piece, plane)[0]) for piece in pieces))


def _measure(parts: TopoDS_Compound, plane: gp_Pln, *, of_solids: bool) -> tuple[float, float]:
    """Return a volume and its error; that of faces ten times as accurate, for they may cancel each other."""
    accuracy = VERIFICATION_TOLERANCES.volume * (1.0 if of_solids else 0.1)
    return measure_volume(parts, plane, accuracy)


def _collect_parts(shape: TopoDS_Shape, *, of_solids: bool) -> TopoDS_Compound:
    """Return the solids of a shape, or the faces outside of them."""
    if of_solids:
        return make_compound(ShapeIndex(shape, TopAbs_SOLID))
    found, explorer = [], TopExp_Explorer(shape, TopAbs_FACE, TopAbs_SOLID)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return make_compound(found)
