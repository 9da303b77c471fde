"""Is a finished solid sound? Asked in full by :func:`verify_shape`, and quickly of every blend by :func:`check_solid`.

``BRepCheck`` alone does not know: it calls solids valid that are inside out, whose blend bulges outside, or that fall
apart when cut or sent through STEP. So everything is tried that a user will do next, and measured with OCCT's own
means. Like :mod:`cqblend.brep.verification.edge_continuity`, this module reads finished shapes of whatever origin and
must not know how cqblend makes them.

Volumes are OCCT's, by Gauss-Kronrod integration over knot spans from a skew plane: measured on solids of known
volume, it is as accurate as it says. OCCT's default is off by 1e-4 on freeform bodies and by 1 % on a screw, its
adaptive Gauss integration by 15 % on an extruded spline while it reports 1e-16, and Gauss-Kronrod from a point does
not end when a planar face passes through that point. Between different planes, it agrees within 1e-6 on clean solids
and 1e-5 on STEP bodies with sloppy pcurves.
"""

import math
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepCheck import (
    BRepCheck_Analyzer,
    BRepCheck_ListOfStatus,
    BRepCheck_NoError,
    BRepCheck_Result,
    BRepCheck_Shell,
    BRepCheck_Status,
)
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.GeomAbs import GeomAbs_C0, GeomAbs_C3, GeomAbs_G1
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.gp import gp_Ax2, gp_Dir, gp_Pln, gp_Pnt, gp_Pnt2d
from OCP.GProp import GProp_GProps
from OCP.LocalAnalysis import LocalAnalysis_SurfaceContinuity
from OCP.Standard import Standard_Failure, Standard_NoSuchObject
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_IN,
    TopAbs_OUT,
    TopAbs_REVERSED,
    TopAbs_ShapeEnum,
    TopAbs_SHELL,
    TopAbs_SOLID,
    TopAbs_VERTEX,
    TopAbs_WIRE,
)
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.step_files import read_step, write_step
from cqblend.brep.topology import AncestorMap, ShapeIndex, make_compound
from cqblend.brep.verification.edge_continuity import (
    EdgeSide,
    choose_sample_parameters,
    evaluate_face_normals,
    find_sides_on_face,
    require_shape,
    sample_edge_side,
)
from cqblend.brep.verification.measuring_places import find_knot_lines
from cqblend.errors import CqblendError, InputError, SelectionError

Array = NDArray[np.float64]

VOLUME_ACCURACY = 1e-6
"""Relative accuracy asked of OCCT's volume integration, and of volumes that are to add up."""

SMOOTH_EDGE_ANGLE = 1e-4
"""Largest normal angle (radians) of an edge that is flagged smooth: native fillets on freeform faces reach 4e-5."""

_CONFUSION = 1e-7
"""OCCT's own tolerance, mm."""

_CHANGE_ACCURACIES = (1e-5, 1e-8)
"""The same for the volume between a few faces and those that replaced them: the second if the first leaves a doubt."""

_EDGE_SAMPLES = 200
"""Along an edge, for OCCT's own analysis of continuity."""

_ANALYSIS_EPSILONS = (1e-12, 1e-12, 1e-12, 1e-12, 1e-12)
"""Null vector, C0, C1, C2, G1: OCCT's defaults of 1e-3 would decide for us what is small."""

_STEP_SLACK = 1e-7
"""How much worse (mm, radians) a smooth edge may come back from STEP, beside a tenth of what it was."""

_CHECKED_KINDS = (TopAbs_VERTEX, TopAbs_EDGE, TopAbs_WIRE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID)
"""Kinds of sub-shapes, parts before wholes."""


@dataclass(frozen=True)
class EdgeCheck:
    """An edge as OCCT's ``LocalAnalysis_SurfaceContinuity`` sees it.

    Attributes
    ----------
    index : int
        Number of the edge in the shape's edge map (``TopExp.MapShapes``), from 1.
    smooth : bool
        Whether the shape promises a smooth joint: the edge is flagged at least G1.
    gap : float
        Largest ``C0Value``, mm.
    angle : float
        Largest ``G1Angle``, radians; orientation does not count.
    """

    index: int
    smooth: bool
    gap: float
    angle: float

    def __str__(self) -> str:
        kind = "smooth" if self.smooth else "end   "
        return f"edge {self.index:<5d} {kind}  gap {self.gap:.1e} mm  angle {self.angle:.1e} rad"


@dataclass(frozen=True)
class BoxCheck:
    """The solid minus and common with a box through the middle of the faces.

    ``cut`` and ``common`` are volumes in mm^3, ``mismatch`` is |cut + common - volume| / volume, ``valid`` says
    whether BRepCheck accepts both.
    """

    valid: bool
    cut: float
    common: float
    mismatch: float


@dataclass(frozen=True)
class StepCheck:
    """The solid after a round trip through STEP.

    ``faces`` is their number, ``volume`` in mm^3, ``mismatch`` is relative to the volume before; ``gap`` (mm) and
    ``angle`` (radians) are the largest over the edges that were smooth before.
    """

    valid: bool
    faces: int
    volume: float
    mismatch: float
    gap: float
    angle: float


@dataclass(frozen=True)
class Verification:
    """What :func:`verify_shape` found; ``ok`` if nothing is wrong, else ``problems`` says what.

    Attributes
    ----------
    valid : bool
        ``BRepCheck_Analyzer`` accepts the whole shape, in its ordinary mode (which ``isValid()`` asks) and in the exact
        one.
    closed : bool
        Every shell of a solid is closed and consistently oriented.
    volume : float
        mm^3, all solids together.
    gap, angle : float
        Largest over the smooth edges, by OCCT's own analysis, mm and radians.
    edges : tuple of EdgeCheck
        Every edge that was looked at: smooth ones are promises, at the others a face merely ends.
    box : BoxCheck or None
        None if OCCT failed to compute cut or common.
    step : StepCheck or None
        None if the shape did not survive the round trip.
    problems : tuple of str
        One line each.
    """

    valid: bool
    closed: bool
    volume: float
    gap: float
    angle: float
    edges: tuple[EdgeCheck, ...]
    box: BoxCheck | None
    step: StepCheck | None
    problems: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong."""
        return not self.problems

    def __str__(self) -> str:
        box, step = self.box, self.step
        rows = [
            ("verification", "ok" if self.ok else f"{len(self.problems)} problem{'s' * (len(self.problems) > 1)}"),
            ("exactly valid", _format_bool(self.valid)),
            ("closed", _format_bool(self.closed)),
            ("volume", f"{self.volume:.9g} mm^3"),
            ("smooth edges", f"{sum(edge.smooth for edge in self.edges)} of {len(self.edges)} looked at"),
            ("gap", f"{self.gap:.1e} mm"),
            ("angle", f"{self.angle:.1e} rad"),
            ("box", f"{_format_bool(box.valid)}, off by {box.mismatch:.1e}" if box else "failed"),
            (
                "STEP",
                f"{_format_bool(step.valid)}, off by {step.mismatch:.1e}, angle {step.angle:.1e} rad"
                if step
                else "failed",
            ),
        ]
        return "\n".join([*(f"{name:<14s}{value}" for name, value in rows), *(f"- {line}" for line in self.problems)])


def verify_shape(
    shape: TopoDS_Shape, faces: Iterable[TopoDS_Face] | None = None, *, angular_tolerance: float = SMOOTH_EDGE_ANGLE
) -> Verification:
    """Check a solid harder than ``BRepCheck`` does.

    Parameters
    ----------
    shape : TopoDS_Shape
        A solid, or anything that contains solids.
    faces : iterable of TopoDS_Face, optional
        The faces in question, such as the blends of a ``BlendResult``; all faces if None. Their edges are measured,
        and the box goes through the middle of one of them.
    angular_tolerance : float
        Largest angle in radians allowed on an edge that is flagged smooth.

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        ``shape`` is not a shape or holds no solid, or ``faces`` is empty or holds something else.
    SelectionError
        A face is not a face of the shape.

    Notes
    -----
    An edge is *smooth* if the shape says so: its continuity flag is at least G1. With ``faces``, every edge they
    share with another face is measured, without, the smooth ones. Gaps may be twice the edge's tolerance, as each
    face may be off by it. Volumes must agree within :data:`VOLUME_ACCURACY` plus OCCT's own estimate of the
    integration errors.
    """
    require_shape(shape, "shape")
    solids = list_subshapes(shape, TopAbs_SOLID)
    if not solids:
        raise InputError("shape holds no solid: there is nothing to verify")
    body = make_compound(solids)
    chosen = list_subshapes(body, TopAbs_FACE) if faces is None else _locate_faces(shape, faces)
    complaints = [
        line for exact in (False, True) for line in _describe_flaws(shape, find_flaws(shape, exact=exact), exact=exact)
    ]
    shells = _find_shell_problems(body)
    edges, bad_edges = _check_edges(shape, chosen, everything=faces is not None, angular_tolerance=angular_tolerance)
    plane = make_skew_plane(body)
    volume, error = measure_volume(body, plane)
    box, bad_box = _check_box(body, chosen, plane, volume, error)
    step, bad_step = _check_step(shape, edges, plane, volume, error)
    problems = [
        *_abbreviate_lines(complaints),
        *shells,
        *_find_inverted_solids(body),
        *_abbreviate_lines(bad_edges),
        *_abbreviate_lines([line for face in chosen for line in _find_folds(face)]),
        *bad_box,
        *_abbreviate_lines(bad_step),
    ]
    smooth = [edge for edge in edges if edge.smooth]
    return Verification(
        valid=not complaints,
        closed=not shells,
        volume=volume,
        gap=max((edge.gap for edge in smooth), default=0.0),
        angle=max((edge.angle for edge in smooth), default=0.0),
        edges=tuple(edges),
        box=box,
        step=step,
        problems=tuple(problems),
    )


def check_solid(
    before: TopoDS_Shape,
    after: TopoDS_Shape,
    new_faces: Sequence[TopoDS_Face],
    *,
    grows: bool | None = None,
    tolerance: float = 1e-5,
) -> list[str]:
    """Look for anything wrong with a solid that was made from another by replacing a few faces.

    Fast, because faces that both have in common are not looked at again: a flaw that the input brought along and that
    nobody touched is not the result's fault. All that is new must be valid in both modes of ``BRepCheck``: the
    ordinary one, which is what a user's ``isValid()`` asks, and the exact one. A face in place of one that failed a
    mode may fail that mode for the same reason, but not the other.

    Parameters
    ----------
    before, after : TopoDS_Shape
        The solids. What ``after`` took over from ``before`` must be the same topological objects.
    new_faces : sequence of TopoDS_Face
        The faces that were added, the blends; they must not fold over.
    grows : bool, optional
        Whether material was added (concave edges) or removed; None if that is not known.
    tolerance : float
        Largest tolerance in mm that a new edge or vertex may have.

    Returns
    -------
    list of str
        One line for every problem; empty if there is none.
    """
    index_before, index_after = (ShapeIndex(solid, TopAbs_FACE) for solid in (before, after))
    old = [face for face in list_subshapes(before, TopAbs_FACE) if face not in index_after]
    new = [face for face in list_subshapes(after, TopAbs_FACE) if face not in index_before]
    missing = [i for i, face in enumerate(new_faces, 1) if face not in index_after]
    problems = [f"new face {i} is not in the result" for i in missing]
    for exact in (False, True):
        found = find_flaws(make_compound(new), exact=exact)
        if found:
            problems += _abbreviate_lines(
                _describe_flaws(
                    after, _drop_inherited_flaws(found, find_flaws(make_compound(old), exact=exact)), exact=exact
                )
            )
    known = set(_find_shell_problems(before))
    problems += [line for line in _find_shell_problems(after) if line not in known]
    if not problems:
        problems += _find_inverted_solids(after)
    problems += _find_loose_edges(old, new, after, tolerance)
    problems += [line for face in new_faces for line in _find_folds(face)]
    problems += [line for face in new_faces if face in index_after for line in _find_collisions(face, after)]
    if grows is not None and not _is_on_wanted_side(before, new_faces, grows):
        problems += _check_volume_change(old, new, grows)
    return problems


def list_subshapes(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> list[TopoDS_Shape]:
    """Return the distinct sub-shapes of a kind, in the order of ``TopExp.MapShapes``, oriented as first met."""
    return list(ShapeIndex(shape, kind))


def measure_volume(
    shape: TopoDS_Shape, plane: gp_Pln | None = None, accuracy: float = VOLUME_ACCURACY
) -> tuple[float, float]:
    """Return the volume inside a shape, mm^3, negative if it is inside out, and OCCT's estimate of its error.

    ``plane`` is what OCCT integrates from; where edges have gaps, only volumes from the same plane compare.
    """
    properties = GProp_GProps()
    relative = BRepGProp.VolumePropertiesGK_s(
        shape, properties, plane or make_skew_plane(shape), accuracy, False, True, False, False, False
    )
    volume = float(properties.Mass())
    return volume, abs(relative * volume)


def _estimate_volume_error(shape: TopoDS_Shape, volume: float) -> float:
    """Return by how much another integration of OCCT's differs, mm^3.

    On trimmed faces of many and uneven spans the error of either can be a hundred times what it says.
    """
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, VOLUME_ACCURACY / 10, False, False)
    return abs(float(properties.Mass()) - volume)


def make_skew_plane(shape: TopoDS_Shape) -> gp_Pln:
    """Return a plane near the middle of a shape, askew to whatever people make: no face measures zero from there."""
    low, high = _compute_bounds(shape)
    normal = np.array([0.3826, 0.5217, 0.7625])
    point = (low + high) / 2 - 0.0719 * float(np.linalg.norm(high - low)) * normal
    return gp_Pln(gp_Pnt(*point.tolist()), gp_Dir(*normal.tolist()))


# ------------------------------------------------------------------------------------------------------------- validity


@dataclass(frozen=True)
class Flaw:
    """A complaint of ``BRepCheck`` about a sub-shape, and the shape in whose context it arose (itself if in none)."""

    shape: TopoDS_Shape
    context: TopoDS_Shape
    status: BRepCheck_Status


def is_valid(shape: TopoDS_Shape) -> bool:
    """Whether ordinary BRepCheck accepts a shape: what ``isValid()`` of CadQuery and ``is_valid`` of build123d ask."""
    return bool(BRepCheck_Analyzer(shape).IsValid())


def find_flaws(shape: TopoDS_Shape, *, exact: bool = True) -> list[Flaw]:
    """Return what BRepCheck complains about, in exact mode or in the ordinary one."""
    analyzer = BRepCheck_Analyzer(shape, True, False, exact)
    if analyzer.IsValid():
        return []
    found: dict[tuple[TopoDS_Shape, TopoDS_Shape, BRepCheck_Status], Flaw] = {}
    for kind in _CHECKED_KINDS:
        for part in list_subshapes(shape, kind):
            for use in (part.Oriented(TopAbs_FORWARD), part.Oriented(TopAbs_REVERSED)):
                try:
                    result = analyzer.Result(use)  # there is one for each orientation that the shape uses
                except Standard_NoSuchObject:
                    continue
                for flaw in _list_subshape_flaws(result, part):
                    found.setdefault((flaw.shape, flaw.context.Oriented(TopAbs_FORWARD), flaw.status), flaw)
    return list(found.values())


def _list_subshape_flaws(result: BRepCheck_Result, part: TopoDS_Shape) -> list[Flaw]:
    """Return the complaints about one sub-shape: in whatever it belongs to, or by itself if in nothing."""
    found = []
    result.InitContextIterator()
    while result.MoreShapeInContext():
        found += [Flaw(part, result.ContextualShape(), status) for status in _list_errors(result.StatusOnShape())]
        result.NextShapeInContext()
    heard = {flaw.status for flaw in found}
    return found + [Flaw(part, part, status) for status in _list_errors(result.Status()) if status not in heard]


def _list_errors(statuses: BRepCheck_ListOfStatus) -> list[BRepCheck_Status]:
    """Return the errors in a list of statuses; "no error" stands alone, and OCP takes long to iterate."""
    return [] if statuses.IsEmpty() or statuses.First() == BRepCheck_NoError else list(statuses)


def _drop_inherited_flaws(found: list[Flaw], before: list[Flaw]) -> list[Flaw]:
    """Drop complaints heard before, about the same sub-shape or one on the same curve or surface."""
    known = [(flaw, _get_shared_geometry(flaw)) for flaw in before]
    return [
        flaw for flaw in found if not any(_is_same_flaw(flaw, _get_shared_geometry(flaw), *other) for other in known)
    ]


def _is_same_flaw(flaw: Flaw, geometry: object, other: Flaw, other_geometry: object) -> bool:
    """Whether a complaint repeats another."""
    if flaw.status != other.status or flaw.shape.ShapeType() != other.shape.ShapeType():
        return False
    return bool(flaw.shape.IsSame(other.shape)) or (geometry is not None and geometry is other_geometry)


def _get_shared_geometry(flaw: Flaw) -> object:
    """Return what a sub-shape shares with trimmed copies of itself: edges their curve, faces and wires the surface."""
    bearer = flaw.context if flaw.shape.ShapeType() == TopAbs_WIRE else flaw.shape
    if bearer.ShapeType() == TopAbs_FACE:
        return BRep_Tool.Surface_s(TopoDS.Face_s(bearer), TopLoc_Location())
    return _get_curve(TopoDS.Edge_s(bearer)) if bearer.ShapeType() == TopAbs_EDGE else None


def _describe_flaws(shape: TopoDS_Shape, found: list[Flaw], *, exact: bool = True) -> list[str]:
    """Name every flaw once."""
    lines, state = [], "exactly valid" if exact else "valid"
    for flaw in found:
        kind = flaw.shape.ShapeType()
        name = f"{kind.name.removeprefix('TopAbs_').lower()} {ShapeIndex(shape, kind).find_number(flaw.shape)}"
        lines.append(f"{name} is not {state}: {flaw.status.name.removeprefix('BRepCheck_')}")
    return list(dict.fromkeys(lines))


def _find_shell_problems(shape: TopoDS_Shape) -> list[str]:
    """Name shells that are open, or whose faces disagree about the outside."""
    lines = []
    for i, shell in enumerate(list_subshapes(shape, TopAbs_SHELL), 1):
        check = BRepCheck_Shell(shell)
        if check.Closed(False) != BRepCheck_NoError:
            lines.append(f"shell {i} is not closed")
        elif check.Orientation(False) != BRepCheck_NoError:
            lines.append(f"shell {i} is not consistently oriented")
    return lines


def _find_inverted_solids(shape: TopoDS_Shape) -> list[str]:
    """Name solids that reach to infinity."""
    lines = []
    for i, solid in enumerate(list_subshapes(shape, TopAbs_SOLID), 1):
        classifier = BRepClass3d_SolidClassifier(solid)
        classifier.PerformInfinitePoint(1e-7)
        if classifier.State() == TopAbs_IN:
            lines.append(f"solid {i} is inside out")
    return lines


def _find_loose_edges(
    old: list[TopoDS_Shape], new: list[TopoDS_Shape], after: TopoDS_Shape, tolerance: float
) -> list[str]:
    """Name new edges whose tolerance is above the limit; a piece of an old edge is as far off its faces as that was."""
    inherited = {_get_curve(edge) for edge in list_subshapes(make_compound(old), TopAbs_EDGE)}
    loose = [
        edge
        for edge in list_subshapes(make_compound(new), TopAbs_EDGE)
        if BRep_Tool.Tolerance_s(edge) > tolerance and _get_curve(edge) not in inherited
    ]
    index = ShapeIndex(after, TopAbs_EDGE)
    return [
        f"edge {index.find_number(edge)} has tolerance {BRep_Tool.Tolerance_s(edge):.2g} mm, above {tolerance:.2g}"
        for edge in loose
    ]


def _find_collisions(face: TopoDS_Face, solid: TopoDS_Shape) -> list[str]:
    """Say which faces of the solid, of those that share no vertex with a face, it touches or cuts through."""
    own, box = ShapeIndex(face, TopAbs_VERTEX), _make_bounding_box(face)
    lines = []
    for number, other in enumerate(ShapeIndex(solid, TopAbs_FACE), 1):
        if any(vertex in own for vertex in ShapeIndex(other, TopAbs_VERTEX)) or box.IsOut(_make_bounding_box(other)):
            continue
        if BRepExtrema_DistShapeShape(face, other).Value() <= _CONFUSION:
            lines.append(f"a new face cuts through face {number}")
    return lines


def _make_bounding_box(shape: TopoDS_Shape) -> Bnd_Box:
    """Return a bounding box that is quick rather than tight."""
    box = Bnd_Box()
    BRepBndLib.AddClose_s(shape, box)
    box.Enlarge(2 * _CONFUSION)
    return box


def _is_on_wanted_side(before: TopoDS_Shape, new_faces: Sequence[TopoDS_Face], grows: bool) -> bool:
    """Whether the middle lines of the new faces clearly lie outside the old solid, if it was to grow, or inside it."""
    wanted = TopAbs_OUT if grows else TopAbs_IN
    classifier = BRepClass3d_SolidClassifier(before)
    for face in new_faces:
        u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
        surface = BRep_Tool.Surface_s(face)
        for share, across in ((0.15, 0.3), (0.15, 0.7), (0.5, 0.5), (0.85, 0.3), (0.85, 0.7)):
            point = surface.Value(u0 + share * (u1 - u0), v0 + across * (v1 - v0))
            classifier.Perform(point, _CONFUSION)
            if classifier.State() != wanted:
                return False
    return bool(new_faces)


def _check_volume_change(old: list[TopoDS_Shape], new: list[TopoDS_Shape], grows: bool) -> list[str]:
    """Say so if replacing faces changed the volume in the wrong direction, by more than integration may err.

    The new faces and the old ones, reversed, enclose what changed, but for gaps along edges that lie on their faces to
    a tolerance only.
    """
    between = make_compound([*new, *(face.Reversed() for face in old)])
    low, high = _compute_bounds(between)
    gaps = float(np.linalg.norm(high - low)) * sum(map(_estimate_gap_area, list_subshapes(between, TopAbs_EDGE)))
    for accuracy in _CHANGE_ACCURACIES:
        change, error = measure_volume(between, accuracy=accuracy)
        if abs(change) > gaps + 3 * error + 10 * accuracy * float((high - low).prod()):
            break
    else:
        return []
    if (change > 0) == grows:
        return []
    verb, kind = ("fell", "add") if grows else ("rose", "remove")
    return [f"the volume {verb} by {abs(change):.3g} mm^3, but the blend was to {kind} material"]


def _estimate_gap_area(edge: TopoDS_Shape) -> float:
    """Return the area, mm^2, by which faces may miss each other along an edge of more than OCCT's own tolerance."""
    tolerance = BRep_Tool.Tolerance_s(TopoDS.Edge_s(edge))
    if tolerance <= 2 * _CONFUSION:
        return 0.0
    properties = GProp_GProps()
    BRepGProp.LinearProperties_s(edge, properties)
    return float(tolerance * properties.Mass())


def _find_folds(face: TopoDS_Face) -> list[str]:
    """Say so if a face folds over itself: its normal flips between neighbours of a grid, and not by turning fast."""
    lines = find_knot_lines(GeomAdaptor_Surface(BRep_Tool.Surface_s(face), *BRepTools.UVBounds_s(face)), GeomAbs_C3)
    uv = np.stack(np.meshgrid(*(_sample_intervals(ends) for ends in lines), indexing="ij"), axis=-1)
    _, normals = evaluate_face_normals(face, uv.reshape(-1, 2))
    normals = normals.reshape(*uv.shape[:2], 3)
    pairs = np.concatenate(
        [_find_opposed_normals(uv, normals), _find_opposed_normals(uv.swapaxes(0, 1), normals.swapaxes(0, 1))]
    )
    if not len(pairs):
        return []
    boundary = BRepTopAdaptor_FClass2d(face, 1e-9)
    within = [all(boundary.Perform(gp_Pnt2d(*end)) != TopAbs_OUT for end in pair) for pair in pairs.tolist()]
    first, last = pairs[within][:, :1], pairs[within][:, 1:]
    path = first + np.linspace(0.0, 1.0, 9)[:, None] * (last - first)
    points, normals = (array.reshape(*path.shape[:2], 3) for array in evaluate_face_normals(face, path.reshape(-1, 2)))
    flips = np.argwhere(np.einsum("ijk,ijk->ij", normals[:, 1:], normals[:, :-1]) < 0.0)
    if not len(flips):
        return []
    x, y, z = points[tuple(flips[0])].tolist()
    return [f"a face folds over near ({x:.4g}, {y:.4g}, {z:.4g}): its normal flips"]


def _find_opposed_normals(uv: Array, normals: Array) -> Array:
    """Return the parameters (n, 2, 2) of neighbours along the first axis whose normals point apart."""
    apart = np.einsum("ijk,ijk->ij", normals[1:], normals[:-1]) < 0.0
    return np.stack((uv[:-1][apart], uv[1:][apart]), axis=1)


def _sample_intervals(ends: Array) -> Array:
    """Parameters inside intervals, equally many in each, about 25 to 129 in all, none on an end or in the middle."""
    count = ends.size - 1
    each = max(1, min(math.ceil(25 / count), 129 // count))
    inner = (ends[:-1, None] + np.diff(ends)[:, None] * ((np.arange(each) + 0.41) / each)).ravel()
    return np.asarray(inner[:: math.ceil(inner.size / 129)])


# ----------------------------------------------------------------------------------------------------------- continuity


def _check_edges(
    shape: TopoDS_Shape, faces: list[TopoDS_Face], *, everything: bool, angular_tolerance: float
) -> tuple[list[EdgeCheck], list[str]]:
    """Measure the smooth edges of faces, or every one they share with another face; return what is wrong with them."""
    index = ShapeIndex(shape, TopAbs_EDGE)
    faces_of = AncestorMap(shape, TopAbs_EDGE, TopAbs_FACE)
    checks, lines = [], []
    for edge in list_subshapes(make_compound(faces), TopAbs_EDGE):
        sides = _get_edge_sides(edge, faces_of)
        if sides is None:
            continue
        smooth = BRep_Tool.Continuity_s(edge, sides[0][0], sides[1][0]) != GeomAbs_C0
        if not smooth and (not everything or sides[0][0].IsSame(sides[1][0])):
            continue
        gap, angle, folded = _analyse_continuity(sides)
        check = EdgeCheck(index.find_number(edge), smooth, gap, angle)
        checks.append(check)
        tolerance = BRep_Tool.Tolerance_s(edge)
        if gap > 2 * tolerance:
            lines.append(f"edge {check.index}: its faces are {gap:.2g} mm apart, its tolerance is {tolerance:.2g} mm")
        if smooth and angle > angular_tolerance:
            lines.append(f"edge {check.index} is flagged smooth, but its faces meet at {angle:.2g} rad")
        elif smooth and folded:
            lines.append(f"edge {check.index} is flagged smooth, but its faces fold back on each other")
    return checks, lines


def _analyse_continuity(sides: tuple[EdgeSide, EdgeSide]) -> tuple[float, float, bool]:
    """Return OCCT's largest gap and angle along an edge, and whether the outward normals ever oppose each other."""
    ts = choose_sample_parameters(sides, _EDGE_SAMPLES)
    one, two = (sample_edge_side(use, face, ts) for face, use in sides)
    surfaces = [BRep_Tool.Surface_s(face) for face, _ in sides]
    gap = angle = 0.0
    for (u1, v1), (u2, v2) in zip(one.parameters.tolist(), two.parameters.tolist(), strict=True):
        local = LocalAnalysis_SurfaceContinuity(
            surfaces[0], u1, v1, surfaces[1], u2, v2, GeomAbs_G1, *_ANALYSIS_EPSILONS
        )
        if local.IsDone():
            gap, angle = max(gap, local.C0Value()), max(angle, local.G1Angle())
    return gap, angle, bool((np.einsum("ni,ni->n", one.normals, two.normals) < 0.0).any())


def _get_edge_sides(edge: TopoDS_Edge, faces_of: AncestorMap) -> tuple[EdgeSide, EdgeSide] | None:
    """Return the two sides of an edge; None if it is degenerate or has not two."""
    if BRep_Tool.Degenerated_s(edge):
        return None
    sides = [use for face in faces_of(edge) for use in find_sides_on_face(face, edge)]
    return (sides[0], sides[1]) if len(sides) == 2 else None


# --------------------------------------------------------------------------------------------------- what users do next


def _check_box(
    shape: TopoDS_Shape, faces: list[TopoDS_Face], plane: gp_Pln, volume: float, error: float
) -> tuple[BoxCheck | None, list[str]]:
    """Cut the solid in two with a box, one side of which runs through the middle of a face."""
    box = _make_splitting_box(shape, faces)
    try:
        parts = [operation(shape, box) for operation in (BRepAlgoAPI_Cut, BRepAlgoAPI_Common)]
        if not all(part.IsDone() for part in parts):
            return None, ["OCCT cannot cut the solid with a box"]
    except Standard_Failure as failure:
        return None, [f"OCCT cannot cut the solid with a box: {failure}"]
    valid = all(is_valid(part.Shape()) for part in parts)
    (cut, cut_error), (common, common_error) = (measure_volume(part.Shape(), plane) for part in parts)
    off = abs(cut + common - volume)
    slack = error + cut_error + common_error
    if off > VOLUME_ACCURACY * abs(volume) + slack:
        slack += sum(
            _estimate_volume_error(part.Shape(), found) for part, found in zip(parts, (cut, common), strict=True)
        )
    check = BoxCheck(valid, cut, common, off / abs(volume) if volume else math.inf)
    lines = [] if valid else ["cut or common with a box is not valid"]
    if min(cut, common) <= 0.0 or off > VOLUME_ACCURACY * abs(volume) + slack:
        lines.append(f"cut and common with a box do not add up: {cut:.9g} + {common:.9g} against {volume:.9g} mm^3")
    return check, lines


def _make_splitting_box(shape: TopoDS_Shape, faces: list[TopoDS_Face]) -> TopoDS_Shape:
    """Make a large box with one side through the middle of the middlemost face, askew to it and to everything else."""
    middles = [_evaluate_face_middle(face) for face in faces]
    points = np.array([point for point, _ in middles])
    nearest = int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmin())
    point, normal = middles[nearest]
    frame = gp_Ax2(gp_Pnt(*point.tolist()), gp_Dir(*normal.tolist()))
    x, y = (np.array(axis.Coord()) for axis in (frame.XDirection(), frame.YDirection()))
    out = math.cos(0.6) * x + math.sin(0.6) * y + 0.2 * normal
    along = y * math.cos(0.6) - x * math.sin(0.6)
    low, high = _compute_bounds(shape)
    size = 4.0 * float(np.linalg.norm(high - low))
    out /= np.linalg.norm(out)
    corner = point - 0.5 * size * (along + np.cross(out, along))
    placed = gp_Ax2(gp_Pnt(*corner.tolist()), gp_Dir(*out.tolist()), gp_Dir(*along.tolist()))
    return BRepPrimAPI_MakeBox(placed, size, size, size).Shape()


def _evaluate_face_middle(face: TopoDS_Face) -> tuple[Array, Array]:
    """Return the point in the middle of a face's parameters, and a normal there."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    points, normals = evaluate_face_normals(face, np.array([[(u0 + u1) / 2, (v0 + v1) / 2]]))
    return points[0], normals[0] if np.isfinite(normals).all() else np.array([0.36, 0.48, 0.8])


def _check_step(
    shape: TopoDS_Shape, edges: list[EdgeCheck], plane: gp_Pln, volume: float, error: float
) -> tuple[StepCheck | None, list[str]]:
    """Send the shape through a STEP file and measure it again."""
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "verify.step"
            write_step(shape, path)
            again = read_step(path)
    except CqblendError as failure:
        return None, [f"the shape does not survive STEP: {failure}"]
    volume_again, error_again = measure_volume(make_compound(list_subshapes(again, TopAbs_SOLID)), plane)
    counts = [len(list_subshapes(one, TopAbs_FACE)) for one in (shape, again)]
    off = abs(volume_again - volume)
    gap, angle, lines = _remeasure_edges(shape, again, [edge for edge in edges if edge.smooth])
    valid = is_valid(again)
    if not valid:
        lines.append("the shape read back from STEP is not valid")
    if off > VOLUME_ACCURACY * abs(volume) + error + error_again:
        lines.append(f"the volume read back from STEP is {volume_again:.9g} mm^3 instead of {volume:.9g}")
    if counts[0] != counts[1]:
        lines.append(f"{counts[1]} faces are read back from STEP instead of {counts[0]}")
    return StepCheck(valid, counts[1], volume_again, off / abs(volume) if volume else math.inf, gap, angle), lines


def _remeasure_edges(
    shape: TopoDS_Shape, again: TopoDS_Shape, smooth: list[EdgeCheck]
) -> tuple[float, float, list[str]]:
    """Find the smooth edges, by their middles, in a shape read back, and measure them there: largest gap and angle."""
    before = list_subshapes(shape, TopAbs_EDGE)
    after = [edge for edge in list_subshapes(again, TopAbs_EDGE) if not BRep_Tool.Degenerated_s(edge)]
    middles = np.array([_evaluate_edge_middle(edge) for edge in after]).reshape(-1, 3)
    faces_of = AncestorMap(again, TopAbs_EDGE, TopAbs_FACE)
    gap = angle = 0.0
    lines = []
    for check in smooth:
        edge = before[check.index - 1]
        away = np.linalg.norm(middles - _evaluate_edge_middle(edge), axis=1)
        near = int(away.argmin()) if away.size else -1
        sides = (
            _get_edge_sides(after[near], faces_of)
            if near >= 0 and away[near] <= 10 * BRep_Tool.Tolerance_s(edge)
            else None
        )
        if sides is None:
            lines.append(f"edge {check.index} is not read back from STEP with two faces")
            continue
        gap_again, angle_again, _ = _analyse_continuity(sides)
        if gap_again > 1.1 * check.gap + _STEP_SLACK or angle_again > 1.1 * check.angle + _STEP_SLACK:
            lines.append(
                f"edge {check.index} comes back from STEP with gap {gap_again:.2g} mm and angle {angle_again:.2g} rad "
                f"instead of {check.gap:.2g} and {check.angle:.2g}"
            )
        gap, angle = max(gap, gap_again), max(angle, angle_again)
    return gap, angle, lines


def _evaluate_edge_middle(edge: TopoDS_Edge) -> tuple[float, float, float]:
    """Return the point in the middle of an edge's parameters."""
    curve = BRepAdaptor_Curve(edge)
    x, y, z = curve.Value((curve.FirstParameter() + curve.LastParameter()) / 2).Coord()
    return x, y, z


# --------------------------------------------------------------------------------------------------------------- shapes


def _locate_faces(shape: TopoDS_Shape, faces: Iterable[TopoDS_Face]) -> list[TopoDS_Face]:
    """Return the faces in question, oriented as in the shape."""
    index = ShapeIndex(shape, TopAbs_FACE)
    if isinstance(faces, TopoDS_Shape) or not isinstance(faces, Iterable):
        raise InputError(f"faces is of type {type(faces).__name__}: an iterable of faces is needed")
    numbers = [index.find_number(require_shape(face, f"faces[{i}]", TopAbs_FACE)) for i, face in enumerate(faces)]
    if not numbers:
        raise InputError("faces is empty: pass None for all faces of the shape")
    if 0 in numbers:
        raise SelectionError(f"faces[{numbers.index(0)}] is not a face of the shape: pick it from the shape itself")
    return [index[number] for number in numbers]


def _get_curve(edge: TopoDS_Edge) -> object:
    """Return the 3D curve, shared with trimmed copies of the edge; None if it has none."""
    return BRep_Tool.Curve_s(edge, TopLoc_Location(), 0.0, 0.0)


def _compute_bounds(shape: TopoDS_Shape) -> tuple[Array, Array]:
    """Return the corners of a shape's bounding box."""
    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    if box.IsVoid():
        return np.zeros(3), np.zeros(3)
    return np.array(box.CornerMin().Coord()), np.array(box.CornerMax().Coord())


def _abbreviate_lines(lines: list[str]) -> list[str]:
    """Keep a handful of lines, and say how many more there are."""
    return lines if len(lines) <= 6 else [*lines[:5], f"{len(lines) - 5} more like this"]


def _format_bool(value: bool) -> str:
    """Return a truth value for a table."""
    return "yes" if value else "NO"
