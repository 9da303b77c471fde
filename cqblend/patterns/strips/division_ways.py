"""Ways to divide a face, and which of them is taken.

Exists because a way may fail late, when its strips are laid flat or cover themselves; then the next one is tried, and
what was wrong with the first is remembered. Holds what is tried and in which order. Must not know edges, nor seams.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from cqblend.errors import CqblendError, GeometryError
from cqblend.patterns.flatten.flat_face import DividedPatch, UnrollOptions, UnrollStrategy, bound_strain, narrow_strips
from cqblend.patterns.strips.division import SurfaceDivision, divide_surface, fit_single_strip, rank_directions
from cqblend.patterns.strips.ruled_strip import RuledStrip
from cqblend.patterns.trim.trimmed_patch import Patch

REFINE_FACTOR, MAX_REFINE_FACTOR = 4.0, 64.0
"""A face is divided again with tolerances finer by this factor, and by that at most."""

_MAX_CUTS = 32
"""A strip is cut across so often at most."""

_EQUAL_STRAIN = 1e-6
"""Strains that differ by less are the same."""


def divide_patch(patch: Patch, wishes: UnrollOptions, finer: float = 1.0) -> DividedPatch:
    """Divide a patch the best way there is: with the fewest strips, of equally many with the least strain.

    Parameters
    ----------
    finer
        By how much tolerances are finer than asked.

    Raises
    ------
    GeometryError
        No way works; the message says why the first one does not, and what else was tried.
    """
    if patch.kind == "plane":
        return DividedPatch(patch, finer=finer)
    first, spare = _list_strategies(patch, wishes)
    divisions: list[tuple[UnrollStrategy, _StripsOfStrategy]] = []
    failed: list[tuple[UnrollStrategy, CqblendError]] = []
    for way in first:
        try:
            divisions.append((way, _divide_to_width(patch, wishes, way, finer)))
        except GeometryError as error:
            failed.append((way, error))
    divisions.sort(key=lambda pair: len(pair[1].strips))
    found: list[DividedPatch] = []
    others: list[UnrollStrategy] = []
    for way, division in divisions:
        if found and len(division.strips) > len(divisions[0][1].strips):
            others.append(way)
            continue
        try:
            found.append(_divide_with_strategy(patch, wishes, way, finer, division))
        except GeometryError as error:
            failed.append((way, error))
    if not found:
        return _divide_first_working(patch, wishes, finer, spare, failed)
    best = _pick_least_strained(found)
    others = [*(face.way for face in found if face is not best and face.way is not None), *others]
    return replace(best, ways=(*others, *spare), failed=tuple(failed))


def _pick_least_strained(faces: Sequence[DividedPatch]) -> DividedPatch:
    """Return what has the fewest strips, of equally many with the least strain, of equally strained the first."""
    least = min(len(face.strips) for face in faces)
    equal = [face for face in faces if len(face.strips) == least]
    if len(equal) == 1:
        return equal[0]
    strains = [bound_strain(face.strips) for face in equal]
    return next(face for face, strain in zip(equal, strains, strict=True) if strain <= min(strains) + _EQUAL_STRAIN)


def divide_other_way(face: DividedPatch, wishes: UnrollOptions, error: CqblendError) -> DividedPatch:
    """Divide a patch another way than one that has failed.

    Raises
    ------
    CqblendError
        There is none: the error of the first way, with what else was tried.
    """
    if face.way is None:
        raise error
    return _divide_first_working(face.patch, wishes, 1.0, face.ways, [*face.failed, (face.way, error)])


def divide_finer(
    face: DividedPatch, wishes: UnrollOptions, error: CqblendError, factor: float = REFINE_FACTOR
) -> DividedPatch:
    """Divide a patch again for the reason that an error tells: finer, at last another way.

    Parameters
    ----------
    factor
        By how much tolerances are to be finer than they were, at most four times.

    Raises
    ------
    CqblendError
        It cannot be divided finer, and there is no other way.
    """
    if face.way is None and face.finer < MAX_REFINE_FACTOR:  # a plane, whose borders get more vertices
        return replace(face, finer=min(factor, REFINE_FACTOR) * face.finer)
    if face.way is not None and face.finer < MAX_REFINE_FACTOR:
        try:
            return replace(
                _divide_with_strategy(face.patch, wishes, face.way, min(factor, REFINE_FACTOR) * face.finer),
                ways=face.ways,
                failed=face.failed,
            )
        except GeometryError:
            return divide_other_way(face, wishes, error)
    return divide_other_way(face, wishes, error)


def cut_strips_across(face: DividedPatch, rows: Iterable[tuple[int, float]]) -> DividedPatch:
    """Cut strips across, each at a given parameter."""
    for row, value in rows:
        if len(face.cuts.get(row, ())) >= _MAX_CUTS:
            raise GeometryError(f"a strip still covers itself after {_MAX_CUTS} cuts; divide it in the other direction")
        face.add_cut(row, value)
    return face


def merge_thin_strips(face: DividedPatch, rows: Iterable[int], wishes: UnrollOptions) -> DividedPatch | None:
    """Return a face some of whose strips are one with a neighbour within the tolerance; None if none can be."""
    surface = face.patch.surface.transpose() if face.transposed else face.patch.surface
    strips: list[RuledStrip | None] = list(face.strips)
    taken: set[int] = set()
    for row in rows:
        for one, other in ((row - 1, row), (row, row + 1)):
            if one < 0 or other >= len(strips) or {one, other} & taken:
                continue
            span = face.strips[one].span[0], face.strips[other].span[1]
            union = fit_single_strip(surface, span, wishes.tolerance / face.finer, transposed=face.transposed)
            if union is not None and (wishes.method == "elber" or bound_strain([union]) <= wishes.strain):
                strips[one], strips[other] = union, None
                taken |= {one, other}
                break
    if not taken:
        return None
    return replace(face, strips=tuple(strip for strip in strips if strip is not None), cuts={})


def _list_strategies(patch: Patch, wishes: UnrollOptions) -> tuple[list[UnrollStrategy], list[UnrollStrategy]]:
    """Return the ways that are compared, and those that are tried if none of these works."""
    ruled = patch.kind in ("cylinder", "cone", "extrusion")
    first = [
        UnrollStrategy(direction, layout=wishes.layout)
        for direction in rank_directions(patch.surface, "v" if ruled else wishes.direction)
    ]
    if wishes.direction != "auto":
        return first, []
    spare = [replace(way, narrower=True) for way in first] if wishes.method != "elber" else []
    if wishes.layout == "smooth":
        spare += [replace(way, layout="triangles") for way in first]
    return first, spare


def _divide_first_working(
    patch: Patch,
    wishes: UnrollOptions,
    fine: float,
    ways: Sequence[UnrollStrategy],
    failed: list[tuple[UnrollStrategy, CqblendError]],
) -> DividedPatch:
    """Divide a patch the first way that works."""
    failed = list(failed)
    for i, way in enumerate(ways):
        try:
            return replace(
                _divide_with_strategy(patch, wishes, way, fine), ways=tuple(ways[i + 1 :]), failed=tuple(failed)
            )
        except GeometryError as error:
            failed.append((way, error))
    cause = failed[0][1]
    tried = {str(other): str(way) for way, other in reversed(failed[1:]) if str(other) != str(cause)}
    rest = "".join(f"; {way}: {text}" for text, way in reversed(tried.items()))
    raise cause.with_details(after=rest)


def _divide_with_strategy(
    patch: Patch, wishes: UnrollOptions, way: UnrollStrategy, fine: float, division: "_StripsOfStrategy | None" = None
) -> DividedPatch:
    """Divide a patch one way, whose division may be known."""
    division = division or _divide_to_width(patch, wishes, way, fine)
    strips = division.strips
    if wishes.method != "elber" and way.layout == wishes.layout:
        strips = narrow_strips(strips, wishes, fine, at_any_price=way.narrower)
    return DividedPatch(
        patch,
        strips,
        transposed=way.direction == "u",
        elber=division.elber,
        ideal=max(division.ideal, 1.0),
        finer=fine,
        way=way,
        refusal=division.refusal,
    )


@dataclass(frozen=True, slots=True)
class _StripsOfStrategy:
    """Strips and their figures; and why they are not as wide as asked, if they are not."""

    strips: tuple[RuledStrip, ...]
    elber: int
    ideal: float
    refusal: GeometryError | None


def _divide_to_width(patch: Patch, wishes: UnrollOptions, way: UnrollStrategy, fine: float) -> _StripsOfStrategy:
    """Divide a patch into strips of the least width; if that cannot be held, into even ones."""

    def try_division(least_width: float | None, even: bool) -> SurfaceDivision:
        return divide_surface(
            patch.surface,
            wishes.tolerance / fine,
            direction=way.direction,
            method=wishes.method,
            even=even,
            least_width=least_width,
        )

    refusal: GeometryError | None = None
    try:
        found = try_division(wishes.least_width, wishes.even)
    except GeometryError as error:
        if wishes.least_width is None:
            raise
        refusal = error
        found = try_division(None, even=wishes.method != "elber")
    return _StripsOfStrategy(found.strips, found.elber, found.ideal, refusal)
