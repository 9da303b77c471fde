"""Public function that joins two places of one body, or of two, by a smooth bridge.

The arguments are translated and checked here; the work is done by :mod:`cqblend.solid_blends.bridging`.
"""

from typing import Any

from cqblend.api.cad_shapes import collect_bodies, to_given_side
from cqblend.api.solid_functions import BlendResult, wrap_result
from cqblend.bridge_options import BRIDGE_DEFAULTS, BridgeOptions
from cqblend.option_records import collect_options, document_options
from cqblend.solid_blends.bridging import bridge_shape


@document_options(BridgeOptions)
def bridge(
    shape: Any,
    side1: Any,
    side2: Any,
    *,
    continuity: str | tuple[str, str] = BRIDGE_DEFAULTS.continuity,
    bulge: float | tuple[float, float] = BRIDGE_DEFAULTS.bulge,
    tangents: str | tuple[str, str] = BRIDGE_DEFAULTS.tangents,
    section: str = BRIDGE_DEFAULTS.section,
    start: float | None = None,
    solid: bool = BRIDGE_DEFAULTS.solid,
    form: str = BRIDGE_DEFAULTS.form,
    tolerance: float = BRIDGE_DEFAULTS.tolerance,
    angular_tolerance: float = BRIDGE_DEFAULTS.angular_tolerance,
    steer: float = BRIDGE_DEFAULTS.steer,
    crease: float | None = None,
) -> BlendResult:
    """Join two places of one body, or of two that need not touch, by a bridge that is smooth with both.

    Two bodies become one; one body gets a handle. The result is verified before it is returned. The input is left as it
    was.

    Parameters
    ----------
    shape : cadquery.Shape, cadquery.Workplane, build123d.Shape or TopoDS_Shape, or a sequence of solids
        A solid, a compound or a sequence of solids that has both sides.
    side1, side2 : a face, a closed edge or wire, or a pair
        What the bridge takes the place of. A face goes; the bridge starts at its boundary, and goes on with the faces
        beside it. A closed edge or wire of the shape means the face of which it is the outer boundary, and that goes;
        the face on its other side stays. A pair of a face and a closed wire, or `Curve`, on it cuts an opening in the
        face, which stays, and with which the bridge is smooth: the curve is one in the parameters of
        ``cqblend.to_surface(face)``, or in space. If the wire of a pair is the outer boundary of the face, that goes.
    ... : the options of `BridgeOptions`

    Returns
    -------
    BlendResult
        With the shape, in which one solid has taken the place of the bodies, the faces of the bridge, one for each pair
        of faces that it lies between, and the certificate. Edges are numbered 0 there, for none is blended.

    Raises
    ------
    InputError
        An argument is of the wrong type, out of range, or contradicts another one; a wire is open, or not on its face.
    SelectionError
        A side is foreign to the shape, or does not tell which face goes.
    TopologyError
        What goes has a hole or a seam, or both sides are in each other's way.
    GeometryError
        The bridge folds, crosses itself, or runs into a body.
    DegreeError
        ``form="exact"`` would need a degree above 25.
    VerificationError
        The result failed verification.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> low = cadquery.Workplane().circle(5).extrude(10)
    >>> high = cadquery.Workplane(origin=(6, 0, 30)).circle(3).extrude(10)
    >>> result = cqblend.bridge([low.val(), high.val()], low.faces(">Z"), high.faces("<Z"))
    >>> result.shape.isValid(), len(result.faces), result.certificate.angle < 1e-10
    (True, 1, True)
    """
    return bridge_with_options(shape, side1, side2, collect_options(BridgeOptions, locals()))


def bridge_with_options(shape: Any, side1: Any, side2: Any, options: BridgeOptions) -> BlendResult:
    """Do what :func:`bridge` does, with the options in a record."""
    request = options.to_request()
    bodies = collect_bodies(shape)
    sides = to_given_side("side1", side1), to_given_side("side2", side2)
    return wrap_result(bodies.model, bridge_shape(bodies.shape, sides, request))
