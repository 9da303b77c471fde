"""A blend that was made between two surfaces, brought to the place of a joint between faces on these surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.selection.joint import Joint
from cqblend.errors import InputError
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES
from cqblend.surfaces.tensor_surface import TensorSurface


def align_to_joint(joint: Joint, blend: BlendSurface) -> BlendSurface:
    """Return a blend whose sides, and whose sense along the edge, are those of a joint.

    Its ribbons are on the joint's own surfaces.

    Raises
    ------
    InputError
        If its rails do not lie on the two support faces.
    """
    extent = joint.extent
    for swapped in (False, True):
        ribbons = blend.ribbons[::-1] if swapped else blend.ribbons
        if all(_is_on_face(ribbon, side, extent) for ribbon, side in zip(ribbons, joint.sides, strict=True)):
            break
    else:
        raise InputError(
            "the blend's rails do not lie on the two faces in their own parameters: make it between "
            "cqblend.to_surface(face) of both, and of faces on splines (.toNURBS() of a CadQuery shape has no others)"
        )
    first, second = (replace(ribbon, primary=side.primary) for ribbon, side in zip(ribbons, joint.sides, strict=True))
    surface = blend.surface.reverse(1) if swapped else blend.surface
    t = np.linspace(*first.c.domain, 257)
    point, rate = dehomogenise_jets(first.primary.compose_position(first.c).jet(t, 1))
    stations = joint.locate_stations(np.linspace(0.02, 0.98, 33))
    nearest = np.linalg.norm(stations.points[:, None] - point, axis=2).argmin(axis=1)
    if (rate[nearest] * stations.tangents).sum() < 0:
        first, second = (
            replace(
                one,
                c=one.c.reverse(),
                directions=tuple(direction.reverse() for direction in one.directions),
                uv=one.uv[::-1],
            )
            for one in (first, second)
        )
        surface = surface.reverse(0)
    return replace(blend, surface=surface, ribbons=(first, second))


def _is_on_face(ribbon: Ribbon, side: SupportFace, extent: float) -> bool:
    """Whether a ribbon runs on the surface of a face of a solid of an ``extent`` (mm), in the face's own parameters."""
    if (
        not isinstance(ribbon.primary, TensorSurface)
        or not isinstance(side.primary, TensorSurface)
        or not side.face_primary.has_exact_pcurves()
    ):
        return False
    t = np.linspace(*ribbon.c.domain, 33)
    uv = ribbon.find_native_parameters(t)
    distance = np.abs(side.primary.jet(uv)[0] - ribbon.primary.jet(uv)[0]).max()
    return bool(distance <= SOLID_BLEND_TOLERANCES.same_surface * extent)
