"""Public functions on solids: blend edges, find the largest size, insert a blend, measure, verify, convert to splines.

Each takes shapes of the caller's library, checks the arguments, has `cqblend.solid_blends` or `cqblend.brep` do the
work on TopoDS shapes, and returns shapes of the same library. Nothing is computed here.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from numbers import Real
from typing import TYPE_CHECKING, Any

from cqblend.api.cad_shapes import (
    collect_edges,
    collect_faces,
    collect_held_edges,
    convert_size_keys,
    resolve_shape,
    to_topods,
    to_topods_edge,
    to_topods_face,
    wrap_like,
)
from cqblend.argument_checks import check_choice, check_positive
from cqblend.blend_options import BLEND_DEFAULTS, BlendOptions, BlendRequest, GivenSize
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.conversion import pcurves, spline_conversion
from cqblend.brep.measurement import edge_continuity
from cqblend.brep.verification import solid_verification
from cqblend.certificate import Certificate, SkippedEdges
from cqblend.errors import InputError, shown
from cqblend.option_records import collect_options, document_options
from cqblend.solid_blends.blend_insertion import insert_into_shape
from cqblend.solid_blends.blend_pipeline import BlendedShape, blend_shape
from cqblend.solid_blends.largest_size_search import find_largest_size
from cqblend.splines import Curve, Surface

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

    from cqblend.brep.measurement.edge_continuity import Continuity
    from cqblend.brep.verification.solid_verification import Verification


@dataclass(frozen=True, slots=True)
class BlendResult:
    """A blended shape, with its blend faces and their certificate.

    Attributes
    ----------
    shape : cadquery.Shape, build123d.Shape or TopoDS_Shape
        The blended shape, in the library of the input.
    faces : tuple of faces
        The blend faces in it, in the order of the edges, in the library of the input.
    certificate : Certificate
        How exact the blend is. ``print`` it.
    """

    shape: Any
    faces: tuple[Any, ...]
    certificate: Certificate

    @property
    def skipped(self) -> tuple[SkippedEdges, ...]:
        """Picked edges that were not blended: smooth already, seams, degenerate, or left out by ``on_error="skip"``."""
        return self.certificate.skipped


@document_options(BlendOptions)
def blend_edges(
    shape: Any,
    edges: Any,
    radius: GivenSize | None = None,
    *,
    width: GivenSize | tuple[GivenSize, GivenSize] | None = None,
    taper: float | None = None,
    continuity: str | tuple[str, str] | None = None,
    tangents: str | tuple[str, str] = BLEND_DEFAULTS.tangents,
    bulge: float | tuple[float, float] = BLEND_DEFAULTS.bulge,
    steer: float = BLEND_DEFAULTS.steer,
    crease: float | None = None,
    section: str = BLEND_DEFAULTS.section,
    a: float | None = None,
    b: float | None = None,
    lam: float | None = None,
    order: int | tuple[int, int, int] | None = None,
    parameters: Any = None,
    terms: int | str = BLEND_DEFAULTS.terms,
    form: str = BLEND_DEFAULTS.form,
    tolerance: float = BLEND_DEFAULTS.tolerance,
    angular_tolerance: float = BLEND_DEFAULTS.angular_tolerance,
    ends: str | tuple[str, str] = BLEND_DEFAULTS.ends,
    corner: str = BLEND_DEFAULTS.corner,
    setback: float | Mapping[Any, float] | None = None,
    first: Any = None,
    on_error: str = BLEND_DEFAULTS.on_error,
    hold: Any = None,
    chain: bool = BLEND_DEFAULTS.chain,
) -> BlendResult:
    """Replace sharp edges of a solid or shell by blend faces that meet their neighbours with exact continuity or more.

    The result is verified before it is returned. The input is left as it was.

    Parameters
    ----------
    shape : cadquery.Shape, cadquery.Workplane, build123d.Shape or TopoDS_Shape
        The solid or the shell, which may be open, or a compound of solids, shells and faces.
    edges : an edge, or an iterable of edges
        Edges of that very shape. A Workplane with edges on its stack, a ShapeList and a compound of edges will do.
    ... : the options of `BlendOptions`

    Returns
    -------
    BlendResult
        With shape and faces in the library of `shape`, and the certificate.

    Raises
    ------
    InputError
        An argument is of the wrong type, out of range, or contradicts another one.
    SelectionError
        An edge is foreign to the shape, or not between two faces; or all of them are smooth already, seams or
        degenerate. Such edges among others are passed over, and listed in the result as ``skipped``.
    SizeError
        The radius or the width does not fit; `max_size` finds what does.
    DegreeError
        ``form="exact"`` would need a degree above 25.
    GeometryError, TopologyError, VerificationError
        The blend cannot be computed, cannot be built into the shape, or failed verification.
    UnsupportedError
        The option is not built yet.

    Warns
    -----
    FlatEndWarning
        An end is flat, with ``ends="auto"``.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> box = cadquery.Solid.makeBox(30, 20, 10)
    >>> result = cqblend.blend_edges(box, box.edges("|Z and >X and >Y"), radius=2)
    >>> result.certificate.valid, result.certificate.form
    (True, 'exact')
    >>> result.certificate.angle < 1e-10
    True
    >>> plate = cqblend.blend_edges(box, box.edges("|Z and >X and >Y"), radius=2, section="pde", order=6)
    >>> plate.certificate.curvature_jump < 1e-10
    True
    >>> sharp = cqblend.blend_edges(box, box.edges("|Z and >X and >Y"), section="potential", a=2, b=3, lam=-10)
    >>> sharp.certificate.angle < 1e-10
    True
    """
    return blend_with_options(shape, edges, collect_options(BlendOptions, locals()))


def blend_with_options(shape: Any, edges: Any, options: BlendOptions) -> BlendResult:
    """Do what :func:`blend_edges` does, with the options in a record."""
    request = _to_request(options)
    native = resolve_shape(shape)
    return wrap_result(native, blend_shape(to_topods(native), collect_edges(edges), request))


def wrap_result(native: Any, blended: BlendedShape) -> BlendResult:
    """Return a blended shape in the library of the input."""
    return BlendResult(
        shape=wrap_like(native, blended.shape),
        faces=tuple(wrap_like(native, face) for face in blended.faces),
        certificate=blended.certificate,
    )


def _to_request(options: BlendOptions) -> BlendRequest:
    """Check options in which `first` is a face, `hold` edges, and keys of mappings are edges, of any library."""
    first = None if options.first is None else to_topods_face(options.first, "first")
    hold = None if options.hold is None else collect_held_edges(options.hold)
    converted = replace(options, first=first, hold=hold)
    if isinstance(options.radius, Mapping):
        converted = replace(converted, radius=convert_size_keys("radius", options.radius))
    if isinstance(options.width, Mapping):
        converted = replace(converted, width=convert_size_keys("width", options.width))
    if isinstance(options.setback, Mapping):
        converted = replace(converted, setback=convert_size_keys("setback", options.setback))
    return converted.to_request()


def max_size(
    shape: Any,
    edges: Any,
    *,
    by: str = "radius",
    tolerance: float = 0.02,
    **options: Any,
) -> float:
    """Return the largest radius or width with which edges can be blended: with all smaller ones, they can as well.

    That is the end of the first interval from 0 in which all sizes work. It is found by some fifteen to thirty trials
    of `blend_edges`, because the ends of the edges and the rest of the solid limit the size as well as the two faces.
    Larger sizes may work again, beyond a hole for example. Sizes no larger than the edge's tolerance do not count.

    Parameters
    ----------
    shape, edges
        As of `blend_edges`.
    by : {"radius", "width"}
        Which of the two is looked for; not where one of them is given.
    tolerance : float
        Relative accuracy of the result, from 0.001 to 0.5: `blend_edges` works with (1 - tolerance) times the result.
        It is not the tolerance of the compact form.
    **options
        All other options of `blend_edges`, except for numbers as sizes, and for `tolerance`, which has its default
        there. A radius or width that varies, differs by side or by edge may be given: then the result is a factor on
        all these sizes.

    Returns
    -------
    float
        The radius or the width, mm, or the largest factor on the sizes that are given.

    Raises
    ------
    InputError
        An argument is of the wrong type, out of range, unknown, or contradicts another one.
    CqblendError
        No size works; the error is what `blend_edges` raises of a small one.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> box = cadquery.Solid.makeBox(30, 20, 10)
    >>> size = cqblend.max_size(box, box.edges("|Z and >X and >Y"))
    >>> 19.6 < size < 20
    True
    >>> cqblend.blend_edges(box, box.edges("|Z and >X and >Y"), 0.98 * size).certificate.valid
    True
    >>> factor = cqblend.max_size(box, box.edges("|Z and >X and >Y"), width=(1, 2))
    >>> 9 < factor < 15.1
    True
    """
    by = check_choice("by", by, ("radius", "width"))
    tolerance = check_positive("tolerance", tolerance)
    if not 1e-3 <= tolerance <= 0.5:
        raise InputError(f"tolerance is relative, from 0.001 to 0.5, not {tolerance:g}")
    for name, value in options.items():
        if name in ("a", "b", "lam") or (name in ("radius", "width") and isinstance(value, Real)):
            raise InputError(f"{name} is a size, which max_size looks for: leave it out")
        if name == "on_error":
            raise InputError("max_size looks for sizes with which all edges can be blended: leave on_error out")
        if name == "hold" and options[name] is not None:
            raise InputError("max_size looks for sizes from 0 on, and a ball must be large to be held: leave hold out")
    known = {field.name for field in fields(BlendOptions)}
    for name in options:
        if name not in known:
            raise InputError(f"{name} is no option of blend_edges")
    if options.get("section") == "potential":
        raise InputError('max_size looks for a radius or a width, which section="potential" does not have')
    if options.get("radius") is None and options.get("width") is None:
        options[by] = 1.0
    elif by != "radius":
        raise InputError("by has no effect where radius or width is given: leave by out")
    request = _to_request(BlendOptions(**options))
    return find_largest_size(to_topods(resolve_shape(shape)), collect_edges(edges), request, tolerance)


def insert_blend(shape: Any, edges: Any, blend: BlendSurface, *, first: Any = None) -> BlendResult:
    """Put a blend of surfaces into a solid, in the place of the edge between two faces that lie on these surfaces.

    The faces are cut at the blend's rails, and the result is verified before it is returned. The input is left as it
    was.

    Parameters
    ----------
    shape : cadquery.Shape, cadquery.Workplane, build123d.Shape or TopoDS_Shape
        The solid, or a compound of solids.
    edges : an edge, or an iterable of edges
        Edges of that very shape that make up one joint of two faces. These must be faces on B-splines, in whose own
        parameters the blend's rails run: ``shape.toNURBS()`` (CadQuery) turns others into such.
    blend : Blend
        What `cqblend.hermite_blend`, `cqblend.pde_blend` or `cqblend.potential_blend` made of
        ``cqblend.to_surface(face)`` of the two faces. On an open joint, it must reach over the faces at both ends.
    first : a face, optional
        The face that counts as side 1 in the certificate.

    Raises
    ------
    InputError
        An argument is of the wrong type, or the rails do not lie on the two faces.
    SelectionError
        An edge is foreign to the shape, a seam, degenerate, smooth already, or the edges are several joints.
    GeometryError, TopologyError, VerificationError
        The blend does not fit into the shape, or the result failed verification.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> can = cadquery.Workplane(cadquery.Solid.makeCylinder(5, 10).toNURBS())
    >>> lid, wall = can.faces(">Z").val(), can.faces("not(>Z or <Z)").val()
    >>> sides = [cqblend.reshape(face, by="normal", amounts=-1) for face in (lid, wall)]
    >>> blend = cqblend.potential_blend(*sides, cqblend.Conic(1, 2))
    >>> result = cqblend.insert_blend(can, can.edges(">Z"), blend)
    >>> result.certificate.valid
    True
    """
    if not isinstance(blend, BlendSurface):
        raise InputError(
            f"a blend to insert is what hermite_blend, pde_blend or potential_blend made, not {shown(blend)}"
        )
    native = resolve_shape(shape)
    side1_face = None if first is None else to_topods_face(first, "first")
    return wrap_result(native, insert_into_shape(to_topods(native), collect_edges(edges), blend, side1_face))


def continuity(shape: Any, edge: Any) -> "Continuity":
    """Measure how smoothly two faces of a shape meet along an edge. Any shape, not only a blended one.

    Parameters
    ----------
    shape : cadquery.Shape, cadquery.Workplane, build123d.Shape or TopoDS_Shape
        A shape of any kind that contains the edge and its two faces.
    edge : an edge
        One edge of that very shape.

    Returns
    -------
    Continuity
        The largest gap (mm), angle (rad) and curvature jump (1/mm) along the edge.

    Raises
    ------
    InputError
        An argument is of the wrong type, or several edges are given.
    SelectionError
        The edge is foreign to the shape, degenerate, or not between two faces.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> box = cadquery.Solid.makeBox(30, 20, 10)
    >>> round(cqblend.continuity(box, box.Edges()[0]).angle, 6)
    1.570796
    """
    return edge_continuity.measure_continuity(to_topods(resolve_shape(shape)), to_topods_edge(edge))


def verify(shape: Any, faces: Any = None) -> "Verification":
    """Check a solid, or a shell that bounds none, harder than ``isValid`` does.

    Exact BRepCheck, OCCT's own analysis of continuity around the faces, a cut and a common with a box that add up, and
    a round trip through STEP.

    Parameters
    ----------
    shape : cadquery.Shape, cadquery.Workplane, build123d.Shape or TopoDS_Shape
        The solid, the shell, or a compound of them.
    faces : a face or an iterable of faces, optional
        The blend faces of it, as in ``BlendResult.faces``.

    Returns
    -------
    Verification
        ``ok``, and the figures.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> cqblend.verify(cadquery.Solid.makeBox(30, 20, 10)).ok
    True
    """
    return solid_verification.verify_shape(
        to_topods(resolve_shape(shape)), None if faces is None else collect_faces(faces)
    )


def to_surface(face: Any) -> "Surface":
    """Return the surface of a face, cut to its parameter bounds, as a symbolic spline.

    Parameters
    ----------
    face : cadquery.Face, build123d.Face or TopoDS_Face
        A face on a surface of any type.

    Raises
    ------
    InputError
        It is not a face.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> cqblend.to_surface(cadquery.Solid.makeBox(30, 20, 10).Faces()[0]).degree
    (1, 1)
    """
    return spline_conversion.to_surface(to_topods_face(face, "face"))


def to_face(surface: "Surface") -> "TopoDS_Face":
    """Return the face that covers the whole of a symbolic spline surface, as a TopoDS face.

    Wrap it with ``cadquery.Face(...)`` or ``build123d.Face(...)``.

    Raises
    ------
    InputError
        It is not a Surface of dim 3.
    """
    if not isinstance(surface, Surface) or surface.dim != 3:
        raise InputError(f"a face covers a Surface of dim 3, not {shown(surface)}")
    return spline_conversion.to_face(surface)


def to_curve(edge: Any) -> "Curve":
    """Return an edge as a symbolic spline in space, over the edge's own parameters and in its sense; conics as arcs.

    Parameters
    ----------
    edge : cadquery.Edge, build123d.Edge or TopoDS_Edge

    Raises
    ------
    InputError
        It is not an edge.
    SelectionError
        It is degenerate: a point.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> cqblend.to_curve(cadquery.Edge.makeCircle(2))(0.0)
    array([2., 0., 0.])
    """
    return pcurves.edge_to_curve(to_topods_edge(edge))


def to_edge(curve: "Curve") -> "TopoDS_Edge":
    """Return the edge that covers the whole of a symbolic spline curve, as a TopoDS edge.

    Wrap it with ``cadquery.Edge(...)`` or ``build123d.Edge(...)``.

    Raises
    ------
    InputError
        It is not a Curve of dim 3.
    """
    if not isinstance(curve, Curve) or curve.dim != 3:
        raise InputError(f"an edge covers a curve in space, a Curve of dim 3, not {shown(curve)}")
    return pcurves.curve_to_edge(curve)
