"""The largest size that an edge takes: where the first interval of sizes from 0 ends in which all blends succeed."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

from cqblend.blend_options import BlendRequest
from cqblend.errors import CqblendError
from cqblend.solid_blends import size_limits
from cqblend.solid_blends.edge_blend import blend_shape, make_cheap_trial

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape

FALLBACK_RATIO = 1e-2  # of the solid's size: tried where nothing promises to work, for the sake of what is said


def find_largest_size(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], request: BlendRequest, tolerance: float
) -> float:
    """Return the largest factor on the size of a request with which edges are blended, and so with all smaller ones.

    Raises
    ------
    CqblendError
        As :func:`cqblend.solid_blends.edge_blend.blend_shape`, where none succeeds.
    """
    promising, extent = make_cheap_trial(shape, edges, request)
    refusals: list[tuple[float, CqblendError]] = []

    def is_working_factor(factor: float) -> bool:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                blend_shape(shape, edges, request.with_scaled_lengths(factor), hints=False)
        except CqblendError as error:
            refusals.append((factor, error))
            return False
        return True

    size = max(request.lengths)
    end = size_limits.find_working_limit(is_working_factor, promising, extent / size, tolerance)
    if not end and not refusals and is_working_factor(FALLBACK_RATIO * extent / size):
        return FALLBACK_RATIO * extent / size
    if not end:
        factor, error = min(refusals, key=lambda refusal: refusal[0])
        raise error.with_details(
            before=f"no size was found that works; with the smallest that was tried, {factor * size:.3g}: "
        )
    return end
