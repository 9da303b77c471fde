"""Neighbouring faces of one plane made one patch.

Exists because what lies in one plane is cut in one piece, whatever faces booleans have left of it. Works on loops and
vertices alone: nothing is intersected, and no distance decides which edge follows which. Must not know OCCT, nor
surfaces that are not planes.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from cqblend.patterns.trim.trimmed_patch import CurveFunction, EdgeUse, Loop, Patch, PatchEdge, PatchShell, PlaneFrame
from cqblend.splines.bernstein import Array

COPLANAR_ANGLE = 1e-9
"""Largest angle between the normals of faces of one plane (rad)."""

COPLANAR_DISTANCE = 1e-7
"""Largest distance of one face's edges from the other's plane (mm)."""

_SAMPLE_FRACTIONS = np.arange(8) / 8
_WINDOW_MARGIN = 0.1
"""By how much a plane's window is larger than the polygon of its outer loop, which may bulge."""

_VERTEX_SHARE = 1e-4
"""Part of an edge's first or last piece by which its direction at a vertex is told."""


def merge_coplanar_patches(skin: PatchShell) -> PatchShell:
    """Return a skin in which planar patches of one plane that share edges are one patch; those edges are dropped.

    The patch keeps the frame of its first face. Where its boundary touches itself at a vertex, loops touch there, but
    none runs through a vertex twice if it can be helped.
    """
    group = list(range(len(skin.patches)))
    inner = set()
    for number, found in skin.locate_edge_uses().items():
        if len(found) == 2 and _is_plane_continued(skin, found):
            inner.add(number)
            low, high = sorted(_find_root(group, at[0]) for at in found)
            group[high] = low
    members: dict[int, list[Patch]] = {}
    for i, patch in enumerate(skin.patches):
        members.setdefault(_find_root(group, i), []).append(patch)
    return replace(
        skin,
        patches=tuple(_join_patches(patches, inner, skin.edges) for patches in members.values()),
        edges={number: edge for number, edge in skin.edges.items() if number not in inner},
    )


def make_planar_patch(
    faces: tuple[int, ...], frame: PlaneFrame, loops: Sequence[Loop], area: float = 0.0, off: float = 0.0
) -> Patch:
    """Return a patch of a plane from loops, in any order, in the coordinates of its frame; see :class:`Patch`."""
    loops = sort_outer_first(loops)
    points = sample_loop_polygon(loops[0])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = _WINDOW_MARGIN * (high - low).max()
    return Patch(faces, "plane", frame.make_rectangle(low - margin, high + margin), True, loops, frame, area, off)


def sort_outer_first(loops: Iterable[Loop]) -> tuple[Loop, ...]:
    """Return loops by falling signed area in the parameter plane."""
    return tuple(sorted(loops, key=lambda loop: -_signed_area(sample_loop_polygon(loop))))


def sample_loop_polygon(loop: Loop) -> Array:
    """Return points (n, 2) along a loop in the parameter plane, eight on every piece of a pcurve."""
    points = []
    for use in loop:
        t = (use.breaks[:-1, None] + _SAMPLE_FRACTIONS * np.diff(use.breaks)[:, None]).ravel()
        along = use.pcurve(np.append(t, use.breaks[-1]))
        points.append((along if use.forward else along[::-1])[:-1])
    return np.concatenate(points)


def project_to_plane(frame: PlaneFrame, points: CurveFunction) -> CurveFunction:
    """Return a curve of space as one in the coordinates of a plane."""
    return lambda t: frame.to_local_coords(points(t))


def _signed_area(points: Array) -> float:
    x, y = (points - points[0]).T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def _find_root(group: list[int], i: int) -> int:
    while group[i] != i:
        i = group[i]
    return i


def _is_plane_continued(skin: PatchShell, found: tuple[tuple[int, int, int], ...]) -> bool:
    """Whether the two patches at an edge, which may be one, are one plane that goes on across it."""
    first, second = (skin.patches[i] for i, _, _ in found)
    one, other = (skin.patches[i].loops[j][k] for i, j, k in found)
    if first.frame is None or second.frame is None or one.forward == other.forward:
        return False
    normal, across = first.frame.normal, second.frame.normal
    if normal @ across <= 0 or np.linalg.norm(np.cross(normal, across)) > COPLANAR_ANGLE:
        return False
    corners = np.concatenate([skin.edges[use.edge].points(use.breaks) for loop in second.loops for use in loop])
    return bool(np.abs((corners - first.frame.origin) @ normal).max() <= COPLANAR_DISTANCE)


def _join_patches(patches: list[Patch], inner: set[int], edges: dict[int, PatchEdge]) -> Patch:
    uses = [use for patch in patches for loop in patch.loops for use in loop]
    kept = [use for use in uses if use.edge not in inner]
    frame = patches[0].frame
    if frame is None or len(kept) == len(uses):
        return patches[0]
    kept = [replace(use, pcurve=project_to_plane(frame, edges[use.edge].points)) for use in kept]
    faces = tuple(sorted(face for patch in patches for face in patch.faces))
    off = max(patch.plane_deviation + _measure_plane_distance(frame, patch) for patch in patches)
    return make_planar_patch(faces, frame, _chain_loops(kept, edges), sum(patch.area for patch in patches), off)


def _measure_plane_distance(frame: PlaneFrame, patch: Patch) -> float:
    """Return the largest distance of a patch of a plane from another plane: that of a corner of its window."""
    u, v = (np.array(domain) for domain in patch.surface.domain)
    corners = patch.surface.grid(u, v)
    return float(np.abs((corners - frame.origin) @ frame.normal).max())


def _chain_loops(uses: list[EdgeUse], edges: dict[int, PatchEdge]) -> list[Loop]:
    """Return the loops of uses that have material on their left."""
    coming: dict[int, list[int]] = {}
    going: dict[int, list[int]] = {}
    for i, use in enumerate(uses):
        start, stop = edges[use.edge].vertices[:: 1 if use.forward else -1]
        going.setdefault(start, []).append(i)
        coming.setdefault(stop, []).append(i)
    after = {}
    for vertex, incoming in coming.items():
        after.update(_pair_uses(uses, incoming, going[vertex]))
    loops = []
    while after:
        chain = [next(iter(after))]
        while (following := after.pop(chain[-1])) != chain[0]:
            chain.append(following)
        loops.append(tuple(uses[i] for i in chain))
    return loops


def _pair_uses(uses: list[EdgeUse], incoming: list[int], outgoing: list[int]) -> dict[int, int]:
    """Return which use goes on where which one comes in: the first one met by a turn through what is no material."""
    if len(incoming) == 1:
        return {incoming[0]: outgoing[0]}
    backward = np.array([_angle_at_vertex(uses[i], 1) for i in incoming])
    ahead = np.array([_angle_at_vertex(uses[i], 0) for i in outgoing])
    turns = np.mod(ahead - backward[:, None], 2 * np.pi)
    pairs: dict[int, int] = {}
    for flat in np.argsort(turns, axis=None):
        i, j = divmod(int(flat), len(outgoing))
        if incoming[i] not in pairs and outgoing[j] not in pairs.values():
            pairs[incoming[i]] = outgoing[j]
    return pairs


def _angle_at_vertex(use: EdgeUse, end: int) -> float:
    """Return the angle at which a use is seen from the vertex it starts (0) or stops at (1)."""
    breaks = use.breaks if use.forward == (end == 0) else use.breaks[::-1]
    here, near = use.pcurve(np.array([breaks[0], breaks[0] + _VERTEX_SHARE * (breaks[1] - breaks[0])]))
    x, y = near - here
    return float(np.arctan2(y, x))
