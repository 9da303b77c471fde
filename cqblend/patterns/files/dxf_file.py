"""Writes drawings as DXF R2010, which cutters read: polylines with bulges in millimetres, a layer for each operation.

There are no splines, blocks or texts, only strokes. Depends on drawings only.
"""

from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np

from cqblend.patterns.files.drawing import STYLES, Drawing, Layer

if TYPE_CHECKING:
    from ezdxf.document import Drawing as Document

INSUNITS_MILLIMETRES = 4
"""Value of the header variable $INSUNITS."""

LINETYPES = {Layer.SCORE_MOUNTAIN: "DASHED", Layer.SCORE_VALLEY: "DASHDOT", Layer.GUIDE: "DOT"}
"""Line types of the layers that are not continuous."""


def write_dxf(drawing: Drawing, path: File) -> None:
    """Write a drawing. The same drawing gives the same file, byte for byte, with the same version of ezdxf.

    Layers are those of :class:`~cqblend.patterns.files.drawing.Layer`; every entity is an LWPOLYLINE.
    """
    import ezdxf

    options = ezdxf.options  # type: ignore[attr-defined]  # its documented place
    before = options.write_fixed_meta_data_for_testing
    options.write_fixed_meta_data_for_testing = True  # neither the time nor random numbers
    try:
        _build_document(drawing).saveas(path)
    finally:
        options.write_fixed_meta_data_for_testing = before


def _build_document(drawing: Drawing) -> "Document":
    """Return a drawing as a document of ezdxf."""
    from ezdxf.filemanagement import new

    document = new("R2010", setup=["linetypes"])
    document.header["$INSUNITS"] = INSUNITS_MILLIMETRES
    document.header["$MEASUREMENT"] = 1
    document.header["$LTSCALE"] = 5.0
    document.header["$EXTMIN"] = (0.0, 0.0, 0.0)
    document.header["$EXTMAX"] = (*drawing.size, 0.0)
    for layer, style in STYLES.items():
        added = document.layers.add(layer.value, color=style.aci, linetype=LINETYPES.get(layer, "Continuous"))
        added.dxf.lineweight = round(100 * style.width)
    space = document.modelspace()
    for entity in drawing.entities:
        closed = entity.path.closed
        vertices = np.column_stack([entity.path.points, np.append(entity.path.bulges, 0.0)])
        line = space.add_lwpolyline(vertices[:-1] if closed else vertices, format="xyb", close=closed)
        line.dxf.layer = entity.layer.value
    return document
