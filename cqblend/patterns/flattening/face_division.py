"""Strategies to divide a face, tried in turn until one works.

A strategy may fail late, when its strips are laid flat or their pieces overlap themselves. Then the face is divided
again: finer, cut across, or by the next strategy, and the reasons why others failed are kept for the report.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from cqblend.errors import CqblendError, GeometryError
from cqblend.patterns.flattening.flat_face import DividedPatch, UnrollStrategy, bound_strain, narrow_strips
from cqblend.patterns.strips.ruled_strip import RuledStrip
from cqblend.patterns.strips.surface_division import SurfaceDivision, divide_surface, fit_single_strip, rank_directions
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.patterns.trimming.trimmed_patch import Patch
from cqblend.unroll_options import UnrollOptions

StrategyFailure = tuple[UnrollStrategy, CqblendError]
"""A strategy that has failed, and why."""


def divide_patch(patch: Patch, options: UnrollOptions, refinement: float = 1.0) -> DividedPatch:
    """Divide a patch with the strategy that needs the fewest strips; of equally many, with the least strain.

    Parameters
    ----------
    patch
        The patch; a plane has no strips.
    options
        What is asked of the pattern.
    refinement
        Factor by which all tolerances are divided.

    Raises
    ------
    GeometryError
        If no strategy works; the message says why the first one does not, and what else was tried.
    """
    if patch.kind == "plane":
        return DividedPatch(patch, refinement=refinement)
    compared, spare = _list_strategies(patch, options)
    divisions: list[tuple[UnrollStrategy, _WidthLimitedDivision]] = []
    failures: list[StrategyFailure] = []
    for strategy in compared:
        try:
            divisions.append((strategy, _divide_to_width(patch, options, strategy, refinement)))
        except GeometryError as error:
            failures.append((strategy, error))
    divisions.sort(key=lambda pair: len(pair[1].strips))
    found: list[DividedPatch] = []
    others: list[UnrollStrategy] = []
    for strategy, division in divisions:
        if found and len(division.strips) > len(divisions[0][1].strips):
            others.append(strategy)
            continue
        try:
            found.append(_divide_with_strategy(patch, options, strategy, refinement, division))
        except GeometryError as error:
            failures.append((strategy, error))
    if not found:
        return _divide_first_working(patch, options, refinement, spare, failures)
    best = _pick_least_strained(found)
    others = [*(face.strategy for face in found if face is not best and face.strategy is not None), *others]
    return replace(best, untried=(*others, *spare), failures=tuple(failures))


def _pick_least_strained(faces: Sequence[DividedPatch]) -> DividedPatch:
    """Return the face with the fewest strips; of equally many with the least strain, of equally strained the first."""
    least = min(len(face.strips) for face in faces)
    equal = [face for face in faces if len(face.strips) == least]
    if len(equal) == 1:
        return equal[0]
    strains = [bound_strain(face.strips) for face in equal]
    limit = min(strains) + STRIP_TOLERANCES.equal_strain
    return next(face for face, strain in zip(equal, strains, strict=True) if strain <= limit)


def divide_other_way(face: DividedPatch, options: UnrollOptions, error: CqblendError) -> DividedPatch:
    """Divide a patch with another strategy than that which has failed with an error.

    Raises
    ------
    CqblendError
        If there is none: the error of the first strategy, with what else was tried.
    """
    if face.strategy is None:
        raise error
    failures = [*face.failures, (face.strategy, error)]
    return _divide_first_working(face.patch, options, 1.0, face.untried, failures)


def divide_finer(
    face: DividedPatch,
    options: UnrollOptions,
    error: CqblendError,
    factor: float = STRIP_TOLERANCES.max_refinement_step,
) -> DividedPatch:
    """Divide a patch again because of an error: with smaller tolerances, or else with another strategy.

    Parameters
    ----------
    face
        As it was divided; a plane gets more vertices on its borders.
    options
        What is asked of the pattern.
    error
        What was wrong.
    factor
        By which its tolerances are divided, at most four.

    Raises
    ------
    CqblendError
        If it cannot be divided finer, and there is no other strategy.
    """
    if face.refinement >= STRIP_TOLERANCES.max_refinement:
        return divide_other_way(face, options, error)
    refinement = min(factor, STRIP_TOLERANCES.max_refinement_step) * face.refinement
    if face.strategy is None:
        return replace(face, refinement=refinement)
    try:
        finer = _divide_with_strategy(face.patch, options, face.strategy, refinement)
    except GeometryError:
        return divide_other_way(face, options, error)
    return replace(finer, untried=face.untried, failures=face.failures)


def cut_strips_across(face: DividedPatch, cuts: Iterable[tuple[int, float]]) -> DividedPatch:
    """Cut strips across: each cut is the index of a strip, and the parameter t along its rails.

    Raises
    ------
    GeometryError
        If a strip has been cut too often.
    """
    for strip_index, t in cuts:
        if len(face.cross_cuts.get(strip_index, ())) >= STRIP_TOLERANCES.max_cross_cuts:
            raise GeometryError(
                f"a strip still covers itself after {STRIP_TOLERANCES.max_cross_cuts} cuts; divide it in the other "
                "direction"
            )
        face = face.cut_across(strip_index, t)
    return face


def merge_thin_strips(face: DividedPatch, thin: Iterable[int], options: UnrollOptions) -> DividedPatch | None:
    """Return a face whose thin strips, given by index, are merged with a neighbour each where the tolerance allows it.

    None if no strip can be merged.
    """
    surface = face.patch.surface.transpose() if face.transposed else face.patch.surface
    strips: list[RuledStrip | None] = list(face.strips)
    merged: set[int] = set()
    for i in thin:
        for lower, upper in ((i - 1, i), (i, i + 1)):
            if lower < 0 or upper >= len(strips) or {lower, upper} & merged:
                continue
            span = face.strips[lower].span[0], face.strips[upper].span[1]
            union = fit_single_strip(surface, span, options.tolerance / face.refinement, transposed=face.transposed)
            if union is not None and (options.method == "elber" or bound_strain([union]) <= options.strain):
                strips[lower], strips[upper] = union, None
                merged |= {lower, upper}
                break
    if not merged:
        return None
    return replace(face, strips=tuple(strip for strip in strips if strip is not None), cross_cuts={})


def _list_strategies(patch: Patch, options: UnrollOptions) -> tuple[list[UnrollStrategy], list[UnrollStrategy]]:
    """Return the strategies that are compared, and those that are tried if none of these works."""
    is_ruled = patch.kind in ("cylinder", "cone", "extrusion")
    directions = rank_directions(patch.surface, "v" if is_ruled else options.direction)
    compared = [UnrollStrategy(direction, layout=options.layout) for direction in directions]
    if options.direction != "auto":
        return compared, []
    spare: list[UnrollStrategy] = []
    if options.method != "elber":
        spare += [replace(strategy, split_right_angles=True) for strategy in compared]
    if options.layout == "smooth":
        spare += [replace(strategy, layout="triangles") for strategy in compared]
    return compared, spare


def _divide_first_working(
    patch: Patch,
    options: UnrollOptions,
    refinement: float,
    strategies: Sequence[UnrollStrategy],
    failures: Sequence[StrategyFailure],
) -> DividedPatch:
    """Divide a patch with the first strategy that works; else raise the first failure, with those of the others."""
    failures = list(failures)
    for i, strategy in enumerate(strategies):
        try:
            found = _divide_with_strategy(patch, options, strategy, refinement)
        except GeometryError as error:
            failures.append((strategy, error))
        else:
            return replace(found, untried=tuple(strategies[i + 1 :]), failures=tuple(failures))
    cause = failures[0][1]
    # of equal messages the first one counts
    tried = {str(other): str(strategy) for strategy, other in reversed(failures[1:]) if str(other) != str(cause)}
    rest = "".join(f"; {strategy}: {text}" for text, strategy in reversed(tried.items()))
    raise cause.with_details(after=rest)


def _divide_with_strategy(
    patch: Patch,
    options: UnrollOptions,
    strategy: UnrollStrategy,
    refinement: float,
    division: "_WidthLimitedDivision | None" = None,
) -> DividedPatch:
    """Divide a patch with a strategy; its division may be known already."""
    division = division or _divide_to_width(patch, options, strategy, refinement)
    strips = division.strips
    if options.method != "elber" and strategy.layout == options.layout:
        strips = narrow_strips(strips, options, refinement, split_right_angles=strategy.split_right_angles)
    return DividedPatch(
        patch,
        strips,
        transposed=strategy.direction == "u",
        elber_count=division.elber_count,
        ideal_count=max(division.ideal_count, 1.0),
        refinement=refinement,
        strategy=strategy,
        width_error=division.width_error,
    )


@dataclass(frozen=True, slots=True)
class _WidthLimitedDivision:
    """Strips, their numbers by Elber's algorithm and ideally, and why they are less wide than asked, if they are."""

    strips: tuple[RuledStrip, ...]
    elber_count: int
    ideal_count: float
    width_error: GeometryError | None


def _divide_to_width(
    patch: Patch, options: UnrollOptions, strategy: UnrollStrategy, refinement: float
) -> _WidthLimitedDivision:
    """Divide a patch into strips of the least width; if that cannot be held, into even ones."""

    def try_division(least_width: float | None, even: bool) -> SurfaceDivision:
        return divide_surface(
            patch.surface,
            options.tolerance / refinement,
            direction=strategy.direction,
            method=options.method,
            even=even,
            least_width=least_width,
        )

    width_error: GeometryError | None = None
    try:
        found = try_division(options.least_width, options.even)
    except GeometryError as error:
        if options.least_width is None:
            raise
        width_error = error
        found = try_division(None, even=options.method != "elber")
    return _WidthLimitedDivision(found.strips, found.elber_count, found.ideal_count, width_error)
