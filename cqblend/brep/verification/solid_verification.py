"""Verifies finished solids and shells: in full (`verify_shape`), or only what is new after a blend (`check_solid`).

``BRepCheck`` alone does not tell: it calls solids valid that are inside out, whose blend bulges outside, or that fall
apart when cut or sent through STEP. So everything is tried that a user will do next, and measured with OCCT's own
means. Works on shapes of whatever origin, and depends on nothing that makes blends.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.bodies import is_solid, list_bodies
from cqblend.brep.measurement.edge_sides import require_shape
from cqblend.brep.topology import ShapeIndex, make_compound
from cqblend.brep.verification.blend_sides import find_wrong_sides
from cqblend.brep.verification.boolean_trial import BoxCheck, check_box
from cqblend.brep.verification.brep_check import describe_flaws, find_flaws, find_shell_problems, find_turned_faces
from cqblend.brep.verification.changed_faces import find_invalid_parts
from cqblend.brep.verification.collisions import find_collisions
from cqblend.brep.verification.content import measure_content
from cqblend.brep.verification.face_boxes import FaceBoxes
from cqblend.brep.verification.face_folds import find_folds
from cqblend.brep.verification.new_edges import find_deviations, find_loose_edges, find_missing_curves
from cqblend.brep.verification.replaced_faces import Check, ReplacedFaces, ReplacementProblem
from cqblend.brep.verification.shell_checks import find_new_inversions, find_new_shell_problems
from cqblend.brep.verification.smooth_edges import EdgeCheck, check_edges
from cqblend.brep.verification.step_round_trip import StepCheck, check_step
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.brep.verification.volumes import find_inverted_solids
from cqblend.errors import InputError, SelectionError


@dataclass(frozen=True)
class Verification:
    """What :func:`verify_shape` found; ``ok`` if nothing is wrong, else ``problems`` says what.

    Attributes
    ----------
    valid : bool
        ``BRepCheck_Analyzer`` accepts the whole shape, in its ordinary mode (which ``isValid()`` asks) and in the exact
        one.
    closed : bool
        Every shell is closed and consistently oriented. Shells that bound no solid may be open.
    volume : float
        mm^3, all solids together; 0 if the faces in question bound none.
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
    shape: TopoDS_Shape,
    faces: Iterable[TopoDS_Face] | None = None,
    *,
    angular_tolerance: float = VERIFICATION_TOLERANCES.flagged_smooth_angle,
) -> Verification:
    """Check a solid, or a shell that bounds none, harder than ``BRepCheck`` does.

    Parameters
    ----------
    shape : TopoDS_Shape
        Solids, shells, faces, or a compound of them.
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
        ``shape`` is not a shape or holds no face, or ``faces`` is empty or holds something else.
    SelectionError
        A face is not a face of the shape.

    Notes
    -----
    An edge is *smooth* if the shape says so: its continuity flag is at least G1. With ``faces``, every edge they
    share with another face is measured, without, the smooth ones. Gaps may be twice the edge's tolerance, as each
    face may be off by it. Volumes must agree to 1e-6 plus OCCT's own estimate of the integration errors. If the faces
    bound no solid, their shells may be open, and the volumes are those between them and some plane.
    """
    require_shape(shape, "shape")
    body = make_compound(ShapeIndex(shape, TopAbs_SOLID))
    of_solids, all_faces = ShapeIndex(body, TopAbs_FACE), ShapeIndex(shape, TopAbs_FACE)
    if not len(all_faces):
        raise InputError("shape holds no face: there is nothing to verify")
    chosen = list(of_solids) or list(all_faces) if faces is None else _locate_faces(shape, faces)
    content = measure_content(shape, of_solids=any(face in of_solids for face in chosen))
    flaw_lines = [
        line for exact in (False, True) for line in describe_flaws(shape, find_flaws(shape, exact=exact), exact=exact)
    ]
    shell_lines, open_shells = find_shell_problems(body), [one for one in list_bodies(shape) if not is_solid(one)]
    edges, edge_lines = check_edges(shape, chosen, everything=faces is not None, angular_tolerance=angular_tolerance)
    box, box_lines = check_box(content.parts, [face for face in chosen if face in content.faces], content)
    step, step_lines = check_step(shape, edges, content)
    problems = [
        *_abbreviate_lines(flaw_lines),
        *shell_lines,
        *find_turned_faces(open_shells),
        *find_inverted_solids(body),
        *_abbreviate_lines(edge_lines),
        *_abbreviate_lines([line for face in chosen for line in find_folds(face)]),
        *box_lines,
        *_abbreviate_lines(step_lines),
    ]
    smooth = [edge for edge in edges if edge.smooth]
    return Verification(
        valid=not flaw_lines,
        closed=not shell_lines and all(map(BRep_Tool.IsClosed_s, open_shells)),
        volume=content.whole if content.of_solids else 0.0,
        gap=max((edge.gap for edge in smooth), default=0.0),
        angle=max((edge.angle for edge in smooth), default=0.0),
        edges=tuple(edges),
        box=box,
        step=step,
        problems=tuple(problems),
    )


@dataclass(frozen=True)
class ReplacementCheck:
    """What is wrong with a solid in which faces were replaced.

    Attributes
    ----------
    records
        What was found, with the new faces that it concerns.
    """

    records: tuple[ReplacementProblem, ...]

    @property
    def problems(self) -> tuple[str, ...]:
        """One line for every problem, of one check at most six."""
        lines = [[record.line for record in self.records if record.check == check] for check in Check]
        return tuple(line for group in lines for line in _abbreviate_lines(group))

    @property
    def crosses(self) -> bool:
        """Whether the boundary of a face crosses itself, or a new face another one: the blend is too large."""
        return any(record.crosses for record in self.records)


def check_solid(
    before: TopoDS_Shape,
    after: TopoDS_Shape,
    new_faces: Sequence[TopoDS_Face],
    *,
    grows: bool | Sequence[bool | None] | None = None,
    tolerance: float = 1e-5,
    index_before: ShapeIndex | None = None,
    free_edges: Sequence[TopoDS_Edge] = (),
) -> ReplacementCheck:
    """Look for anything wrong with a solid that was made from another by replacing some faces.

    Only what changed is looked at: a flaw that the input brought along and that nobody touched is not the result's
    fault, nor is one of an old face that its successor has again. A solid without problems passes ordinary
    ``BRepCheck`` as a whole, which a user's ``isValid()`` asks, if the solid before did. A shell that bounds no solid
    is not asked for volume and inside, but for its border: what was free, less what is gone, and ``free_edges``.

    Parameters
    ----------
    before, after : TopoDS_Shape
        The solids, or shells. What ``after`` took over from ``before`` must be the same topological objects.
    new_faces : sequence of TopoDS_Face
        The faces that were added, the blends: of all blended edges at once.
    grows : bool or sequence of bool or None, optional
        Whether material was added (concave edges) or removed, by all new faces or by each; None if that is not known.
    tolerance : float
        Largest tolerance in mm that a new edge or vertex may have.
    index_before : ShapeIndex, optional
        The faces of ``before``, if they are numbered already.
    free_edges : sequence of TopoDS_Edge
        New edges that may be in the border of an open shell.

    Returns
    -------
    ReplacementCheck
        Every problem, with the new faces that it concerns.
    """
    replaced = ReplacedFaces(before, after, new_faces, index_before)
    records = [
        ReplacementProblem(f"new face {i + 1} is not in the result", Check.PRESENCE, (i,), (face,))
        for i, face in enumerate(replaced.new_faces)
        if face not in replaced.index_after
    ]
    records += find_missing_curves(replaced)
    if records:
        return ReplacementCheck(tuple(records))
    records += find_invalid_parts(replaced)
    records += find_new_shell_problems(replaced, free_edges)
    records += find_loose_edges(replaced, tolerance)
    records += find_deviations(replaced)
    boxes = FaceBoxes(replaced.index_after)
    if not records and replaced.bounds_solid:
        records += find_new_inversions(replaced, boxes)
    records += [
        ReplacementProblem(line, Check.FOLDS, (i,), (face,))
        for i, face in enumerate(replaced.new_faces)
        for line in find_folds(face)
    ]
    records += find_collisions(replaced, boxes)
    if grows is not None:
        records += find_wrong_sides(replaced, grows)
    return ReplacementCheck(tuple(records))


def _locate_faces(shape: TopoDS_Shape, faces: Iterable[TopoDS_Face]) -> list[TopoDS_Face]:
    """Return faces of a shape, oriented as in the shape.

    Raises
    ------
    InputError
        ``faces`` is empty, or not an iterable of faces.
    SelectionError
        One is not a face of the shape.
    """
    index = ShapeIndex(shape, TopAbs_FACE)
    if isinstance(faces, TopoDS_Shape) or not isinstance(faces, Iterable):
        raise InputError(f"faces is of type {type(faces).__name__}: an iterable of faces is needed")
    numbers = [index.find_number(require_shape(face, f"faces[{i}]", TopAbs_FACE)) for i, face in enumerate(faces)]
    if not numbers:
        raise InputError("faces is empty: pass None for all faces of the shape")
    if 0 in numbers:
        raise SelectionError(f"faces[{numbers.index(0)}] is not a face of the shape: pick it from the shape itself")
    return [index[number] for number in numbers]


def _abbreviate_lines(lines: list[str]) -> list[str]:
    """Return lines, of more than six the first five and how many more there are."""
    return lines if len(lines) <= 6 else [*lines[:5], f"{len(lines) - 5} more like this"]


def _format_bool(value: bool) -> str:
    """Return a truth value for a table."""
    return "yes" if value else "NO"
