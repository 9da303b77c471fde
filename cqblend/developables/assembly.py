"""From patches to pieces: strips are divided, flattened and trimmed, and their borders become seams.

Exists to keep one promise: both sides of every seam have the same length, to rounding. The length of a seam is that of
the curve in space it stands for, the longer of the two where a strip is stretched; a side whose chord is shorter is
bowed to it. Holds the order of the steps, and what is known of every piece. Must not know OCCT, tabs, sheets or files.
"""

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cqblend.developables.carrying import Draft, Edges, Laid, carried
from cqblend.developables.developability import twist_between
from cqblend.developables.division import Direction, divide
from cqblend.developables.layings import DividedPatch, Laying, Wishes, narrowed
from cqblend.developables.overlap import covers
from cqblend.developables.patches import Patch, Skin, Trim
from cqblend.developables.paths import Path
from cqblend.developables.pieces import Piece, Pieces, Place, Run, Seam
from cqblend.errors import CqblendError, GeometryError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array

Progress = Callable[[float, str], object]
"""Is told the part of the work that is done, and what is done next."""

_CUTS = 32
"""A strip is cut across so often at most."""

_BOW = 1.1
"""Length to chord of an arc of 86 degrees. Samples of edges are closer."""

_FINER, _FINEST = 4.0, 64.0
"""Where bows make a piece cover itself, its face is divided with tolerances finer by this, and by that at most."""


@dataclass(frozen=True, slots=True)
class Record:
    """What is known of a piece.

    Attributes
    ----------
    name
        Of the piece.
    faces
        Numbers of the faces it comes from.
    kind
        Of the strip: plane, cylinder, cone, tangent (developable), twisted.
    bound
        Distance between the face and the strip in space, both ways, mm.
    proven
        Whether the bound is certified; a strip whose rulings were paired anew is measured.
    error
        Distance between the strip in space and the flat piece folded, mm.
    twist
        Proven bound of the angle by which the normal turns along a ruling, rad, see
        :func:`cqblend.developables.developability.twist`; 0 if the strip is developable.
    ruling
        Largest change in length of a ruling, relative.
    strain
        By how much lengths inside the strip change, relative, at most; 0 if it is developable. Rails and rulings keep
        theirs.
    area, flat_area
        Of the whole strip before it was trimmed, in space and flat, mm^2.
    """

    name: str
    faces: tuple[int, ...]
    kind: str
    bound: float
    proven: bool
    error: float
    twist: float
    ruling: float
    strain: float
    area: float
    flat_area: float


@dataclass(frozen=True, slots=True)
class Failure:
    """A face that could not be done, and why."""

    faces: tuple[int, ...]
    error: CqblendError


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """What a piece was before it was laid flat.

    Attributes
    ----------
    patch
        The face, or faces of one plane, that it is of.
    laying
        The strip; None on a plane.
    upward
        Whether R_t x R_w of the strip points to the outer side.
    loops
        Its boundary, run by run, as a curve or as points (n + 1, 2) on the ruled strip, (t, w), or in the plane.
    """

    patch: Patch
    laying: Laying | None
    upward: bool
    loops: tuple[tuple[Array | Curve, ...], ...]

    def trim(self) -> Trim:
        """Return the piece in space: a ruled surface or a plane, and what is kept of it."""
        if self.laying is None:
            return Trim(self.patch.surface, self.loops, self.patch.outward)
        return Trim(self.laying.ruled(), self.loops, self.upward)

    def fold(self, points: Array) -> Array:
        """Return where points (.., 2) of the flat piece are in space, (.., 3)."""
        if self.laying is not None:
            return self.laying.flat.fold(points)
        assert self.patch.frame is not None
        return self.patch.frame.space(points)

    def on_face(self, points: Array) -> Array:
        """Return the points of the face, (n, 3), for which points (n, 2) of the flat piece stand."""
        return self.fold(points) if self.laying is None else self.laying.on_surface(points)


@dataclass(frozen=True, slots=True, eq=False)
class Unrolled:
    """Pieces with their seams, a record and a source for each, and what could not be done.

    Attributes
    ----------
    stretch
        By how much a seam is longer than the edge that it stands for, relative, at most.
    strips
        Number of strips, N, a plane being one; trimming may part a strip into several pieces, or leave nothing of it.
    elber
        The same by Elber's algorithm 1, in the same directions.
    ideal
        N*, summed over the faces.
    """

    pieces: Pieces
    records: tuple[Record, ...]
    sources: tuple[Source, ...]
    failures: tuple[Failure, ...]
    stretch: float
    strips: int
    elber: int
    ideal: float


def unroll(skin: Skin, wishes: Wishes, progress: Progress | None = None) -> Unrolled:
    """Unroll patches to pieces.

    A patch that cannot be done is left out, its neighbours are not; see ``Unrolled.failures``.
    """
    tell = progress or _silent
    faces: list[DividedPatch] = []
    failures = [Failure((face,), error) for face, error in skin.refused.items()]
    for i, patch in enumerate(skin.patches):
        tell(0.6 * i / len(skin.patches), f"dividing face {patch.index}")
        try:
            faces.append(_divided(patch, wishes))
        except CqblendError as error:
            failures.append(_failure(patch, error))
    while True:
        edges = Edges(skin, faces, wishes)
        laid: list[Laid] = []
        for i, face in enumerate(tuple(faces)):
            tell(0.6 + 0.4 * i / len(faces), f"laying face {face.patch.index} flat")
            try:
                laid += carried(face, edges, wishes)
            except CqblendError as error:
                failures.append(_failure(face.patch, error))
                faces.remove(face)
        result = _joined(skin, laid, tuple(failures), wishes)
        covering = _covering(result, laid)
        if not covering:
            return result
        for face in {id(one.face): one.face for one, _ in covering}.values():
            rows = [(one.row, sum(one.span) / 2) for one, bent in covering if one.face is face and not bent]
            place = faces.index(face)
            try:
                faces[place] = _cut(face, rows) if rows else _finer(face, wishes)
            except CqblendError as error:
                failures.append(_failure(face.patch, error))
                faces.remove(face)


def _failure(patch: Patch, error: CqblendError) -> Failure:
    """Name the face in an error, unless it is named already."""
    text = str(error)
    named = text.startswith("face ")
    return Failure(patch.faces, error if named else type(error)(f"face {patch.index}: {text}"))


def _silent(part: float, what: str) -> None:
    """Take no notice."""


def _divided(patch: Patch, wishes: Wishes, finer: float = 1.0, direction: Direction | None = None) -> DividedPatch:
    """Divide a patch with tolerances finer than asked by a factor, in the direction asked or another one."""
    if patch.kind == "plane":
        return DividedPatch(patch, finer=finer)
    ruled = patch.kind in ("cylinder", "cone", "extrusion")
    division = divide(
        patch.surface,
        wishes.tolerance / finer,
        direction="v" if ruled else direction or wishes.direction,
        method=wishes.method,
        even=wishes.even,
        least_width=wishes.least_width,
    )
    ideal = max(division.ideal, 1.0)
    strips = division.strips
    if wishes.method != "elber":
        strips = narrowed(strips, wishes, finer)
    turned = ruled or wishes.direction != "auto" or direction is not None
    transposed = division.direction == "u"
    return DividedPatch(patch, strips, transposed, division.elber, ideal, finer=finer, turned=turned)


def _finer(face: DividedPatch, wishes: Wishes) -> DividedPatch:
    """Divide a patch again, since bows make a piece cover itself: finer, at last in the other direction."""
    direction: Direction = "u" if face.transposed else "v"
    if face.finer < _FINEST:
        return _divided(face.patch, wishes, _FINER * face.finer, direction if face.turned else None)
    if face.turned:
        raise GeometryError("a piece would cover itself, however narrow its strips; divide it in the other direction")
    return _divided(face.patch, wishes, 1.0, "v" if face.transposed else "u")


def _cut(face: DividedPatch, rows: Sequence[tuple[int, float]]) -> DividedPatch:
    """Cut strips across, each at a given parameter."""
    for row, value in rows:
        if len(face.cuts.get(row, ())) >= _CUTS:
            raise GeometryError(f"a strip still covers itself after {_CUTS} cuts; divide it in the other direction")
        face.cut(row, value)
    return face


def _joined(skin: Skin, laid: Sequence[Laid], failures: tuple[Failure, ...], wishes: Wishes) -> Unrolled:
    """Bow the runs to the lengths of their seams, and make the pieces."""
    members: dict[Hashable, list[tuple[Place, Draft]]] = defaultdict(list)
    for i, one in enumerate(laid):
        for j, loop in enumerate(one.loops):
            for k, draft in enumerate(_runs(loop)):
                members[draft.key].append((Place(i, j, k), draft))
    seams: list[Seam] = []
    numbers: dict[Hashable, int] = {}
    stretch = 0.0
    for key, sides in members.items():
        if wishes.layout == "triangles":
            for _, draft in sides:
                draft.lengths = draft.chords
        elif isinstance(key, tuple) and key[0] == "edge":
            stretch = max(stretch, _agree([draft for _, draft in sides]))
        if len(sides) == 2:
            numbers[key] = len(seams)
            (first, here), (second, there) = sides
            there.inward = here.kind == there.kind == "end"
            angle = _turn(skin, key, laid[first.piece], laid[second.piece])
            seams.append(Seam(str(len(seams) + 1), (first, second), here.rising != there.rising, angle))
    counts: dict[int, int] = defaultdict(int)
    for one in laid:
        counts[id(one.face)] += 1
    pieces, records = [], []
    ordinals: dict[int, int] = defaultdict(int)
    for one in laid:
        ordinals[id(one.face)] += 1
        index = one.face.patch.index
        name = f"{index}.{ordinals[id(one.face)]}" if counts[id(one.face)] > 1 else str(index)
        loops = [tuple(_run(draft, numbers.get(draft.key)) for draft in _runs(loop)) for loop in one.loops]
        piece = Piece(name, tuple(loops))
        pieces.append(piece)
        records.append(_record(one, piece))
    faces = {id(one.face): one.face for one in laid}.values()
    return Unrolled(
        Pieces(tuple(pieces), tuple(seams)),
        tuple(records),
        tuple(_source(one) for one in laid),
        failures,
        stretch,
        sum(max(len(face.strips), 1) for face in faces),
        sum(face.elber for face in faces),
        sum(face.ideal for face in faces),
    )


def _run(draft: Draft, seam: int | None) -> Run:
    final = draft.straightened() if draft.kind == "end" else draft
    return Run(final.path(), final.space, final.kind, seam)


def _runs(loop: Sequence[Draft]) -> list[Draft]:
    """Return the drafts of a loop that are more than a pole."""
    return [draft for draft in loop if draft.key is not None]


def _agree(drafts: Sequence[Draft]) -> float:
    """Give a run along an edge one length on all sides: that of the edge, or of the longest chords.

    Returns by how much that is longer than the edge, relative to it. A segment becomes as long as its part of the
    edge, where that is not much longer than its chord; where a strip is much shorter than the face, as next to a
    pole, it would be a balloon. What is missing then is shared by all.
    """
    natural = [np.clip(draft.lengths, draft.chords, _BOW * draft.chords) for draft in drafts]
    edge = float(drafts[0].lengths.sum())
    total = max(edge, *(float(lengths.sum()) for lengths in natural))
    for draft, lengths in zip(drafts, natural, strict=True):
        whole = float(lengths.sum())
        draft.lengths = lengths * (total / whole) if whole > 0 else lengths
    return total / edge - 1 if edge > 0 else 0.0


def _turn(skin: Skin, key: Hashable, first: Laid, second: Laid) -> float:
    """Return the angle by which the outer normal turns across the middle of a seam, positive if convex."""
    assert isinstance(key, tuple)
    if key[0] == "edge":
        return skin.edges[key[1]].angle
    if first.row == second.row:
        return 0.0
    lower, upper = sorted((first, second), key=lambda one: one.row)
    t = (key[4] + key[5]) / 2
    below, above = lower.face.strips[lower.row].rails, upper.face.strips[upper.row].rails
    tangent = above[0](t, 1)
    down, up = below[1](t) - below[0](t), above[1](t) - above[0](t)
    sign = 1.0 if lower.face.upward else -1.0
    normals = [sign * np.cross(tangent, ruling) for ruling in (down, up)]
    before, after = (n / max(float(np.linalg.norm(n)), 1e-300) for n in normals)
    angle = float(np.arctan2(np.linalg.norm(np.cross(before, after)), before @ after))
    return angle if (after - before) @ up > 0 else -angle


def _record(one: Laid, piece: Piece) -> Record:
    faces, laying = one.face.patch.faces, one.laying
    if laying is None:
        return Record(piece.name, faces, "plane", 0.0, True, 0.0, 0.0, 0.0, 0.0, piece.area, piece.area)
    flat = laying.flat
    return Record(
        name=piece.name,
        faces=faces,
        kind=flat.kind,
        bound=laying.bound,
        proven=laying.proven,
        error=flat.error,
        twist=twist_between(laying.rails) if flat.kind == "twisted" else 0.0,
        ruling=flat.ruling,
        strain=flat.strain,
        area=flat.area_space,
        flat_area=flat.area_flat,
    )


def _source(one: Laid) -> Source:
    loops = tuple(tuple(draft.trim() for draft in loop) for loop in one.loops)
    return Source(one.face.patch, one.laying, one.face.upward, loops)


def _covering(result: Unrolled, laid: Sequence[Laid]) -> list[tuple[Laid, bool]]:
    """Return what has become pieces that cover themselves, and whether they do so only because of their bows."""
    pieces = zip(laid, result.pieces.pieces, strict=True)
    return [(one, not covers(_unbowed(piece))) for one, piece in pieces if covers(piece)]


def _unbowed(piece: Piece) -> Piece:
    """Return a piece with straight segments between its vertices."""
    loops = [[replace(run, path=Path.straight(run.path.points)) for run in loop] for loop in piece.loops]
    return replace(piece, loops=tuple(map(tuple, loops)))
