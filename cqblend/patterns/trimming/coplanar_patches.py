"""Neighbouring faces of one plane merged into one patch, so that they are cut from the stock in one piece.

Boolean operations often leave several faces in one plane. The edges between them are dropped, and the other edges are
chained to loops by their vertices alone: nothing is intersected, and no distance decides which edge follows which.
Depends on trimmed patches only.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from cqblend.patterns.trimming.tolerances import TRIM_TOLERANCES
from cqblend.patterns.trimming.trimmed_patch import (
    CurveFunction,
    EdgeUse,
    Loop,
    Patch,
    PatchEdge,
    PatchShell,
    PlaneFrame,
)
from cqblend.splines.bernstein import Array

_LOOP_SAMPLE_FRACTIONS = np.arange(8) / 8
"""Of each piece of a pcurve, at which a loop is sampled."""


def merge_coplanar_patches(shell: PatchShell) -> PatchShell:
    """Return a shell in which planar patches of one plane that share edges are one patch; those edges are dropped.

    The patch keeps the frame of its first face. Where its boundary touches itself at a vertex, it becomes several loops
    that touch there rather than one that runs through the vertex twice, if possible.
    """
    group = list(range(len(shell.patches)))
    inner = set()
    for number, uses in shell.locate_edge_uses().items():
        if len(uses) == 2 and _is_plane_continued(shell, uses):
            inner.add(number)
            low, high = sorted(_find_root(group, patch) for patch, _, _ in uses)
            group[high] = low
    members: dict[int, list[Patch]] = {}
    for i, patch in enumerate(shell.patches):
        members.setdefault(_find_root(group, i), []).append(patch)
    return replace(
        shell,
        patches=tuple(_join_patches(patches, inner, shell.edges) for patches in members.values()),
        edges={number: edge for number, edge in shell.edges.items() if number not in inner},
    )


def make_planar_patch(
    faces: tuple[int, ...], frame: PlaneFrame, loops: Sequence[Loop], area: float = 0.0, plane_deviation: float = 0.0
) -> Patch:
    """Return a patch of a plane from loops, in any order, in the coordinates of its frame; see :class:`Patch`."""
    loops = sort_outer_first(loops)
    points = sample_loop_polygon(loops[0])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = TRIM_TOLERANCES.plane_window_margin * (high - low).max()
    window = frame.make_rectangle(low - margin, high + margin)
    return Patch(faces, "plane", window, True, loops, frame, area, plane_deviation)


def sort_outer_first(loops: Iterable[Loop]) -> tuple[Loop, ...]:
    """Return loops by falling signed area in the parameter plane."""
    return tuple(sorted(loops, key=lambda loop: -_signed_area(sample_loop_polygon(loop))))


def sample_loop_polygon(loop: Loop) -> Array:
    """Return points (n, 2) along a loop in the parameter plane, eight on every piece of a pcurve."""
    points = []
    for use in loop:
        t = (use.breaks[:-1, None] + _LOOP_SAMPLE_FRACTIONS * np.diff(use.breaks)[:, None]).ravel()
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


def _is_plane_continued(shell: PatchShell, uses: tuple[tuple[int, int, int], ...]) -> bool:
    """Whether the patches of both uses of an edge lie in one plane, on opposite sides of the edge."""
    first, second = (shell.patches[i] for i, _, _ in uses)
    one, other = (shell.patches[i].loops[j][k] for i, j, k in uses)
    if first.frame is None or second.frame is None or one.forward == other.forward:
        return False
    normal, other_normal = first.frame.normal, second.frame.normal
    if normal @ other_normal <= 0 or np.linalg.norm(np.cross(normal, other_normal)) > TRIM_TOLERANCES.coplanar_angle:
        return False
    corners = np.concatenate([shell.edges[use.edge].points(use.breaks) for loop in second.loops for use in loop])
    return bool(np.abs((corners - first.frame.origin) @ normal).max() <= TRIM_TOLERANCES.coplanar_distance)


def _join_patches(patches: list[Patch], inner: set[int], edges: dict[int, PatchEdge]) -> Patch:
    uses = [use for patch in patches for loop in patch.loops for use in loop]
    kept = [use for use in uses if use.edge not in inner]
    frame = patches[0].frame
    if frame is None or len(kept) == len(uses):
        return patches[0]
    kept = [replace(use, pcurve=project_to_plane(frame, edges[use.edge].points)) for use in kept]
    faces = tuple(sorted(face for patch in patches for face in patch.faces))
    deviation = max(patch.plane_deviation + _measure_plane_distance(frame, patch) for patch in patches)
    return make_planar_patch(faces, frame, _chain_loops(kept, edges), sum(patch.area for patch in patches), deviation)


def _measure_plane_distance(frame: PlaneFrame, patch: Patch) -> float:
    """Return the largest distance of a planar patch from another plane, mm: that of a corner of its window."""
    u, v = (np.array(domain) for domain in patch.surface.domain)
    corners = patch.surface.grid(u, v)
    return float(np.abs((corners - frame.origin) @ frame.normal).max())


def _chain_loops(uses: list[EdgeUse], edges: dict[int, PatchEdge]) -> list[Loop]:
    """Chain uses that have material on their left to loops."""
    arriving: dict[int, list[int]] = {}
    leaving: dict[int, list[int]] = {}
    for i, use in enumerate(uses):
        start, stop = edges[use.edge].vertices[:: 1 if use.forward else -1]
        leaving.setdefault(start, []).append(i)
        arriving.setdefault(stop, []).append(i)
    after = {}
    for vertex, incoming in arriving.items():
        after.update(_pair_uses(uses, incoming, leaving[vertex]))
    loops = []
    while after:
        chain = [next(iter(after))]
        while (following := after.pop(chain[-1])) != chain[0]:
            chain.append(following)
        loops.append(tuple(uses[i] for i in chain))
    return loops


def _pair_uses(uses: list[EdgeUse], incoming: list[int], outgoing: list[int]) -> dict[int, int]:
    """Pair the uses that arrive at a vertex with those that leave it, by their indices.

    An arriving use is followed by the first leaving one that is met turning counterclockwise from it, through the
    outside, so that loops do not cross. Of several pairs the smallest turn is made first.
    """
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
    """Return the angle (rad) of the direction in which a use leaves the vertex that it starts (0) or stops at (1)."""
    breaks = use.breaks if use.forward == (end == 0) else use.breaks[::-1]
    here, near = use.pcurve(np.array([breaks[0], breaks[0] + TRIM_TOLERANCES.tangent_step * (breaks[1] - breaks[0])]))
    x, y = near - here
    return float(np.arctan2(y, x))
