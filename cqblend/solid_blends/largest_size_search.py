"""The largest size with which edges can be blended: the end of the first interval of sizes from 0 that all work."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

from cqblend.blend_options import BlendRequest
from cqblend.errors import CqblendError
from cqblend.solid_blends import size_feasibility
from cqblend.solid_blends.blend_pipeline import blend_shape, make_cheap_trial
from cqblend.solid_blends.section_methods import choose_section_method
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape


def find_largest_size(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], request: BlendRequest, tolerance: float
) -> float:
    """Return the largest factor on the size of a request with which edges are blended, and so with all smaller ones.

    Raises
    ------
    CqblendError
        As :func:`cqblend.solid_blends.blend_pipeline.blend_shape`, where none succeeds.
    """
    is_promising, extent = make_cheap_trial(shape, edges, request)
    method = choose_section_method(request)
    refusals: list[tuple[float, CqblendError]] = []

    def is_working_factor(factor: float) -> bool:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                blend_shape(shape, edges, method.scale(factor).request, hints=False)
        except CqblendError as error:
            refusals.append((factor, error))
            return False
        return True

    size = method.size
    largest = size_feasibility.find_working_limit(is_working_factor, is_promising, extent / size, tolerance)
    fallback = SOLID_BLEND_TOLERANCES.fallback_size * extent / size
    if not largest and not refusals and is_working_factor(fallback):
        return fallback
    if not largest:
        factor, error = min(refusals, key=lambda refusal: refusal[0])
        raise error.with_details(
            before=f"no size was found that works; with the smallest that was tried, {factor * size:.3g}: "
        )
    return largest
