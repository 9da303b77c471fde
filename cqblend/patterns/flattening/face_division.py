"""Strategies to divide a face, tried in turn until one works.

A strategy may fail late, when its strips are laid flat or their pieces overlap themselves. Then the face is divided
again: finer, cut across, or by the next strategy, and the reasons why others failed are kept for the report.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from cqblend.errors import CqblendError, GeometryError
from cqblend.patterns.flattening.flat_face import DividedPatch, UnrollStrategy, bound_strain, narrow_strips
from cqblend.patterns.strips.ruled_strip import RuledStrip
from cqblend.patterns.strips.surface_division import (
    SurfaceDivision,
    divide_along_rulings,
    fit_single_strip,
    rank_directions,
)
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.patterns.trimming.trimmed_patch import Patch
from cqblend.unroll_options import UnrollOptions

StrategyFailure = tuple[UnrollStrategy, CqblendError]
"""A strategy that has failed, and why."""


def divide_patches(
    patches: Sequence[Patch], options: UnrollOptions, tell: Callable[[int], object]
) -> list[DividedPatch | CqblendError]:
    """Divide patches, each with the strategy that needs the fewest strips; of equally many, with the least strain.

    Parameters
    ----------
    patches
        The patches; a plane has no strips.
    options
        What is asked of the pattern.
    tell
        Is called with the index of every patch before it is done.

    Returns
    -------
    list
        For every patch its division, or an error if no strategy works; the message says why the first one does not, and
        what else was tried.
    """
    strategies = {i: _list_strategies(one, options) for i, one in enumerate(patches) if one.kind != "plane"}
    jobs = [(i, strategy) for i, (compared, _) in strategies.items() for strategy in compared]
    found = _divide_to_width([(patches[i], strategy) for i, strategy in jobs], options, 1.0)
    results: list[DividedPatch | CqblendError] = []
    for i, patch in enumerate(patches):
        tell(i)
        if patch.kind == "plane":
            results.append(DividedPatch(patch))
            continue
        own = [(strategy, one) for (j, strategy), one in zip(jobs, found, strict=True) if j == i]
        try:
            results.append(_choose_division(patch, options, own, strategies[i][1]))
        except CqblendError as error:
            results.append(error)
    return results


def _choose_division(
    patch: Patch,
    options: UnrollOptions,
    compared: Sequence[tuple[UnrollStrategy, "_WidthLimitedDivision | GeometryError"]],
    spare: Sequence[UnrollStrategy],
) -> DividedPatch:
    """Return the best division by the compared strategies; by a spare one if none of them works."""
    divisions: list[tuple[UnrollStrategy, _WidthLimitedDivision]] = []
    failures: list[StrategyFailure] = []
    for strategy, division in compared:
        if isinstance(division, GeometryError):
            failures.append((strategy, division))
        else:
            divisions.append((strategy, division))
    divisions.sort(key=lambda pair: len(pair[1].strips))
    found: list[DividedPatch] = []
    others: list[UnrollStrategy] = []
    for strategy, division in divisions:
        if found and len(division.strips) > len(divisions[0][1].strips):
            others.append(strategy)
            continue
        try:
            found.append(_make_divided_patch(patch, options, strategy, 1.0, division))
        except GeometryError as error:
            failures.append((strategy, error))
    if not found:
        return _divide_first_working(patch, options, spare, failures)
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
    return _divide_first_working(face.patch, options, face.untried, failures)


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
    strategies: Sequence[UnrollStrategy],
    failures: Sequence[StrategyFailure],
) -> DividedPatch:
    """Divide a patch with the first strategy that works; else raise the first failure, with those of the others."""
    failures = list(failures)
    for i, strategy in enumerate(strategies):
        try:
            found = _divide_with_strategy(patch, options, strategy, 1.0)
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
    patch: Patch, options: UnrollOptions, strategy: UnrollStrategy, refinement: float
) -> DividedPatch:
    """Divide a patch with a strategy."""
    (division,) = _divide_to_width([(patch, strategy)], options, refinement)
    if isinstance(division, GeometryError):
        raise division
    return _make_divided_patch(patch, options, strategy, refinement, division)


def _make_divided_patch(
    patch: Patch,
    options: UnrollOptions,
    strategy: UnrollStrategy,
    refinement: float,
    division: "_WidthLimitedDivision",
) -> DividedPatch:
    """Return a patch as it was divided with a strategy, its strips so narrow that they can be laid flat."""
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
    jobs: Sequence[tuple[Patch, UnrollStrategy]], options: UnrollOptions, refinement: float
) -> list[_WidthLimitedDivision | GeometryError]:
    """Divide patches, with a strategy each, into strips of the least width; if that cannot be held, into even ones."""
    found = _divide_along_strategies(jobs, options, refinement, options.least_width, even=options.even)
    width_errors: list[GeometryError | None] = [None] * len(jobs)
    if options.least_width is not None:
        failed = [i for i, one in enumerate(found) if isinstance(one, GeometryError)]
        even = options.method != "elber"
        again = _divide_along_strategies([jobs[i] for i in failed], options, refinement, None, even=even)
        for i, one in zip(failed, again, strict=True):
            error = found[i]
            width_errors[i] = error if isinstance(error, GeometryError) else None
            found[i] = one
    return [
        one
        if isinstance(one, GeometryError)
        else _WidthLimitedDivision(one.strips, one.elber_count, one.ideal_count, width_error)
        for one, width_error in zip(found, width_errors, strict=True)
    ]


def _divide_along_strategies(
    jobs: Sequence[tuple[Patch, UnrollStrategy]],
    options: UnrollOptions,
    refinement: float,
    least_width: float | None,
    *,
    even: bool,
) -> list[SurfaceDivision | GeometryError]:
    return divide_along_rulings(
        [(patch.surface, strategy.direction) for patch, strategy in jobs],
        options.tolerance / refinement,
        method=options.method,
        even=even,
        least_width=least_width,
    )
