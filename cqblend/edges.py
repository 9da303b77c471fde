"""Blend edges of a solid: the one place where rails, sections, topology surgery and verification come together.

Works on ``TopoDS`` shapes; the front doors translate. A result that does not verify is never returned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.gp import gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_OUT, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex

from cqblend.blends import rails as rail_forms
from cqblend.blends.contact import Contacts, inward, intersect, rolling_ball, set_back
from cqblend.blends.hermite import Blend, hermite
from cqblend.blends.primaries import Array
from cqblend.blends.rails import Rail, Solver, Wanted
from cqblend.certificate import Certificate, RailRecord
from cqblend.errors import CqblendError, GeometryError, InputError, SelectionError, SizeError, UnsupportedError, VerificationError
from cqblend.occ.adapt import FaceSide, face_side
from cqblend.occ.measure import continuity_between, inner_crease
from cqblend.occ.spine import EdgeSpine, chain
from cqblend.occ.surgery import Proposal, RailsTooShort, Surgery
from cqblend.occ.topology import Ancestors, Index, ends, ends_uv, explore, location_of, replaced_solid
from cqblend.occ.verification import check_solid
from cqblend.request import BlendRequest

SMOOTH = 1e-3  # rad: the faces must meet at a larger angle than this for the edge to be one
RAIL_TOLERANCE = 1e-5  # of the size asked for: how near rails run to the ball's contacts
EDGE_TOLERANCE = 5e-7  # mm, the most that a new edge may have
SAMPLES = 400  # points at which each rail is measured for the certificate


@dataclass(frozen=True)
class Joint:
    """An edge, or a closed loop of edges, between two faces of one solid, ready to be blended."""

    solid: TopoDS_Shape
    numbers: tuple[int, ...]  # of the edges, in the shape's edge map
    spine: EdgeSpine
    sides: tuple[FaceSide, FaceSide]
    tolerance: float

    @property
    def name(self) -> str:
        """What messages call it."""
        return f"edge {self.numbers[0]}" if len(self.numbers) == 1 else f"edges {', '.join(map(str, self.numbers))}"


def blend_shape(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], request: BlendRequest
) -> tuple[TopoDS_Shape, tuple[TopoDS_Face, ...], Certificate]:
    """Blend edges of a shape; return the new shape, its blend faces, and the certificate.

    Raises
    ------
    SelectionError
        An edge is foreign, a seam, degenerate, not between two faces of one closed solid, or smooth already.
    SizeError
        The size does not fit; the message names the largest that does.
    CqblendError
        Whatever else stands in the way, by its own type. The input is never changed.
    """
    index = Index(shape, TopAbs_EDGE)
    numbers = [index.of(edge) for edge in edges]
    if 0 in numbers:
        raise SelectionError("an edge does not belong to the shape: select edges of the shape that is blended")
    numbers = list(dict.fromkeys(numbers))
    joint = _joint(shape, [TopoDS.Edge_s(index[number]) for number in numbers], tuple(numbers), request)
    try:
        proposal, blend = _blended(joint, request)
    except SizeError as error:
        raise SizeError(f"{joint.name}: {error}{_largest(joint, request)}") from error
    except CqblendError as error:
        error.args = (f"{joint.name}: {error.args[0]}", *error.args[1:])
        raise
    result = replaced_solid(shape, joint.solid, proposal.solid)
    return result, (proposal.blend,), _certificate(joint, shape, proposal, blend)


def _joint(shape: TopoDS_Shape, edges: list[TopoDS_Edge], numbers: tuple[int, ...], request: BlendRequest) -> Joint:
    """Check the selection and read the two faces."""
    if not edges:
        raise InputError("no edge was given")
    solids = [solid for solid in explore(shape, TopAbs_SOLID) if Index(solid, TopAbs_EDGE).of(edges[0])]
    if not solids:
        raise SelectionError(f"edge {numbers[0]} is not part of a solid; blends need a closed solid")
    solid = solids[0]
    faces_at = Ancestors(solid, TopAbs_EDGE, TopAbs_FACE)
    index = Index(solid, TopAbs_FACE)
    pairs = set()
    for number, edge in zip(numbers, edges, strict=True):
        if BRep_Tool.Degenerated_s(edge):
            raise SelectionError(f"edge {number} is degenerate (a pole): it has no length to blend along")
        faces = faces_at(edge)
        if len(faces) == 1 and BRep_Tool.IsClosed_s(edge, faces[0]):
            raise SelectionError(f"edge {number} is a seam of one closed face, not a joint of two faces")
        if len(faces) != 2:
            raise SelectionError(f"edge {number} has {len(faces)} face(s) in its solid, not 2: the shell is open or not manifold")
        pairs.add(tuple(sorted(index.of(face) for face in faces)))
    if len(pairs) > 1:
        raise UnsupportedError("edges between more than one pair of faces in one call are not built yet; blend them in turn")
    first, second = (TopoDS.Face_s(index[number]) for number in next(iter(pairs)))
    if request.first is not None:
        if request.first.IsSame(second):
            first, second = second, first
        elif not request.first.IsSame(first):
            raise SelectionError(f"first= is not one of the two faces at edge {numbers[0]}")
    edges = _grown(edges, first, second, faces_at, solid)
    ordered, closed = chain(edges, first)
    spine = EdgeSpine(ordered, closed)
    points = spine.points(np.linspace(0, 1, 65)[: -1 if closed else None])
    around = closed or spine.turn() is not None
    sides = tuple(face_side(face, points, around=around) for face in (first, second))
    tolerance = max(BRep_Tool.Tolerance_s(edge) for edge in edges)
    joint = Joint(solid, numbers, spine, (sides[0], sides[1]), tolerance)
    _check_sharp(joint)
    size = request.radius if request.radius is not None else min(request.width or (0.0,))
    if size < 10 * tolerance:
        raise SizeError(f"{joint.name}: size {size:g} is below ten times the edge's own tolerance, {tolerance:.2g}")
    return joint


def _grown(
    edges: list[TopoDS_Edge], first: TopoDS_Face, second: TopoDS_Face, faces_at: Ancestors, solid: TopoDS_Shape
) -> list[TopoDS_Edge]:
    """Follow the joint past vertices at which only the two faces meet: there it merely happens to be cut into edges."""
    edges_at, faces_around = Ancestors(solid, TopAbs_VERTEX, TopAbs_EDGE), Ancestors(solid, TopAbs_VERTEX, TopAbs_FACE)
    pair = [first, second]
    grown, waiting = list(edges), list(edges)
    while waiting:
        for vertex in ends(waiting.pop()):
            if len(faces_around(vertex)) > 2:
                continue
            for edge in edges_at(vertex):
                between = faces_at(edge)
                joins = len(between) == 2 and all(any(face.IsSame(one) for one in pair) for face in between)
                if joins and not any(edge.IsSame(one) for one in grown):
                    grown.append(edge)
                    waiting.append(edge)
    return grown


def _check_sharp(joint: Joint) -> None:
    stations = joint.spine.stations(np.linspace(0.02, 0.98, 17), joint.sides)
    n1, n2 = (side.outward * side.primary.normals(uv) for side, uv in zip(joint.sides, stations.uv, strict=True))
    angle = np.arctan2(np.linalg.norm(np.cross(n1, n2), axis=1), (n1 * n2).sum(1))
    if angle.min() < SMOOTH:
        raise SelectionError(f"{joint.name} is smooth already: its faces meet at {angle.min():.2g} rad")
    if angle.max() > np.pi - SMOOTH:
        raise SelectionError(f"{joint.name} is a knife edge: its faces fold back onto each other")


def _solver(joint: Joint, request: BlendRequest) -> Solver:
    """Return the function from t to contacts."""
    sides, length = joint.sides, joint.spine.length

    def solve(t: Array) -> Contacts:
        stations = intersect(sides, joint.spine.stations(t, sides), length)
        if request.radius is not None:
            return rolling_ball(sides, stations, request.radius)
        assert request.width is not None
        return set_back(sides, stations, request.width)

    primaries = (sides[0].primary, sides[1].primary)
    if joint.spine.closed:
        return rail_forms.around(solve, primaries)
    return rail_forms.along(solve, primaries)


def _size(request: BlendRequest) -> float:
    return request.radius if request.radius is not None else max(request.width or (0.0,))


def _rails(joint: Joint, request: BlendRequest, domain: tuple[float, float]) -> tuple[Rail, Rail]:
    """Fit rails of the lightest form."""
    solve = _solver(joint, request)
    primaries = (joint.sides[0].primary, joint.sides[1].primary)
    closed = joint.spine.closed
    extent = float(np.abs(joint.spine.points(np.linspace(0, 1, 9))).max()) + _size(request)
    if not closed:
        rails = rail_forms.straight(primaries, solve, domain, request.bulge, extent)
        if rails is not None:
            return rails
    turn = joint.spine.turn()
    if turn is not None:
        rails = rail_forms.circular(primaries, solve, domain, turn, request.bulge, extent)
        if rails is not None:
            return rails
    wanted = Wanted(max(RAIL_TOLERANCE * _size(request), 1e-7), bulge=request.bulge)
    if closed:
        start = _clear_start(joint, solve)
        domain = (start, start + 1)
    return rail_forms.cubic(primaries, solve, domain, wanted, closed=closed)


def _clear_start(joint: Joint, solve: Solver) -> float:
    """Return the t at which a closed rail starts: as far as may be from the seams of both faces."""
    t = np.arange(33) / 32
    solved = solve(t)
    clearance = np.full(len(t), np.inf)
    for side, uv in zip(joint.sides, solved.uv, strict=True):
        native = uv if side.native is side.primary else side.native.unlift(side.primary.lift(uv), np.zeros_like(uv))
        for axis, period in enumerate(side.native.periods):
            if period is not None:
                phase = (native[:, axis] - side.bounds[axis, 0]) / period
                clearance = np.minimum(clearance, np.abs(phase - np.round(phase)))
    return float(t[np.argmax(clearance)]) % 1.0


def _blended(joint: Joint, request: BlendRequest) -> tuple[Proposal, Blend]:
    """Propose a blended solid and verify it."""
    domain = (0.0, 1.0) if joint.spine.closed else _reach(joint, request)
    _check_inside(joint, request)
    for _ in range(4):
        blend = hermite(_rails(joint, request, domain), request.form, request.tolerance, request.angular_tolerance)
        surgery = Surgery(joint.solid, joint.spine, joint.sides, blend)
        try:
            proposal = surgery.closed() if joint.spine.closed else surgery.open()
            break
        except RailsTooShort as short:
            slack = 0.1 * (short.needed[1] - short.needed[0])
            domain = (min(domain[0], short.needed[0] - slack), max(domain[1], short.needed[1] + slack))
    else:
        raise GeometryError("the blend runs on beside the face at the end of the edge without ever meeting it")
    convex = bool(inward(joint.sides, joint.spine.stations(np.array([0.5]), joint.sides))[2][0] > 0)
    limit = max(EDGE_TOLERANCE, 2 * joint.tolerance, 2 * request.tolerance)
    problems = check_solid(joint.solid, proposal.solid, [proposal.blend], grows=not convex, tolerance=limit)
    if problems:
        raise VerificationError("the blended solid did not verify and is withheld: " + "; ".join(problems[:4]))
    return proposal, blend


def _reach(joint: Joint, request: BlendRequest) -> tuple[float, float]:
    """Return the range of t over which open rails reach the planes of the faces at their ends, and a little more."""
    solve = _solver(joint, request)
    t = np.array([0.0, 1.0])
    contacts, stations = solve(t), joint.spine.stations(t, joint.sides)
    points = [side.primary.jet(uv)[0] for side, uv in zip(joint.sides, contacts.uv, strict=True)]
    faces_at = Ancestors(joint.solid, TopAbs_VERTEX, TopAbs_FACE)
    margin = float(contacts.reach.max()) / 5
    past = []
    for end, vertex in enumerate(joint.spine.vertices):
        tau, corner = stations.direction[end], location_of(vertex)
        sign = 1.0 if end else -1.0
        needed = [0.0]
        for face in faces_at(vertex):
            if any(face.IsSame(side.face) for side in joint.sides):
                continue
            side = face_side(face, corner[None])
            uv = _vertex_parameters(side, vertex)
            normal = side.native.normals(uv[None])[0]
            along = float(tau @ normal)
            if abs(along) < 0.02:
                raise GeometryError(f"the face at the end of {joint.name} runs along the edge; the blend cannot end on it")
            needed += [sign * float((corner - point[end]) @ normal) / along for point in points]
        past.append((max(needed) + margin) / joint.spine.length)
    return -past[0], 1 + past[1]


def _vertex_parameters(side: FaceSide, vertex: TopoDS_Vertex) -> Array:
    """Return a vertex's (u, v) on a face, from the end of an edge of that face."""
    for use in explore(side.face, TopAbs_EDGE):
        for end, uv in zip(ends(use), ends_uv(use, side.face), strict=True):
            if end.IsSame(vertex) and not BRep_Tool.Degenerated_s(use):
                return uv
    raise GeometryError("a vertex is not on the boundary of its face")


def _check_inside(joint: Joint, request: BlendRequest) -> None:
    """Raise SizeError if the contacts leave their faces: on the whole of a closed edge, in the middle of an open one."""
    t = np.arange(24) / 24 if joint.spine.closed else np.array([0.5])
    solved = _solver(joint, request)(t)
    for side, uv in zip(joint.sides, solved.uv, strict=True):
        native = uv if side.native is side.primary else side.native.unlift(side.primary.lift(uv), np.zeros_like(uv))
        for axis, period in enumerate(side.native.periods):
            if period is not None:
                start = side.bounds[axis, 0]
                native[:, axis] = start + np.mod(native[:, axis] - start, period)
        classifier = BRepTopAdaptor_FClass2d(side.face, 1e-9)
        for at, point in zip(t.tolist(), native.tolist(), strict=True):
            if classifier.Perform(gp_Pnt2d(*point)) == TopAbs_OUT:
                raise SizeError(f"size {_size(request):g} is too large: at t = {at:.3g} the rail leaves its face")


def _largest(joint: Joint, request: BlendRequest) -> str:
    """Say which size would fit, as far as contacts and faces tell; nothing if they would let the asked one pass."""

    def fits(factor: float) -> bool:
        scaled = replace(
            request,
            radius=None if request.radius is None else request.radius * factor,
            width=None if request.width is None else (request.width[0] * factor, request.width[1] * factor),
        )
        try:
            _check_inside(joint, scaled)
        except CqblendError:
            return False
        return True

    if fits(1.0):
        return ""
    low, high = 0.0, min(1.0, 4 * joint.spine.length / _size(request))
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return f"; the largest that fits is about {low * _size(request):.3g}" if low else ""


def _certificate(joint: Joint, shape: TopoDS_Shape, proposal: Proposal, blend: Blend) -> Certificate:
    """Measure the final faces."""
    faces = Index(shape, TopAbs_FACE)
    numbers = [faces.of(face) for face in Ancestors(shape, TopAbs_EDGE, TopAbs_FACE)(Index(shape, TopAbs_EDGE)[joint.numbers[0]])]
    surface = blend.surface
    records = []
    for i, (rail, edges) in enumerate(zip(blend.rails, proposal.rails, strict=True)):
        found = [continuity_between(((proposal.blend, edge), (proposal.sides[i], edge)), SAMPLES) for edge in edges]
        records.append(
            RailRecord(
                side=i + 1,
                face=numbers[i],
                edge=joint.numbers[0],
                gap=max(one.gap for one in found),
                angle=max(one.angle for one in found),
                curvature_jump=max(one.curvature_jump for one in found),
                direction=rail.direction,
                length=rail.length,
                tolerance=max(one.tolerance for one in found),
            )
        )
    t = np.linspace(*surface.domain[0], 65)
    across = np.linalg.norm(surface(t, np.ones(65)) - surface(t, np.zeros(65)), axis=1)
    _, _, poles, weights = surface.to_bspline()
    return Certificate(
        rails=tuple(records),
        form=blend.form,
        degree=surface.degree,
        poles=poles.shape[:2],
        rational=weights is not None,
        inner_crease=inner_crease(proposal.blend).angle,
        method="wire substitution",
        valid=True,
        width=(float(across.min()), float(across.max())),
        stations=SAMPLES,
    )
