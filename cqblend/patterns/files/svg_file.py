"""Writes drawings as SVG in true size: width, height and viewBox in millimetres, a group for each layer.

Drawing libraries would scale them, and fill the background. Depends on drawings only.
"""

from pathlib import Path as File
from xml.sax.saxutils import quoteattr

import numpy as np

from cqblend.patterns.files.drawing import STYLES, Drawing, Layer
from cqblend.patterns.outline.plane_path import Path
from cqblend.splines.bernstein import Array


def write_svg(drawing: Drawing, path: File) -> None:
    """Write a drawing. Arcs stay arcs; coordinates are mirrored, since the y axis of SVG points down."""
    width, height = (_format_number(side) for side in drawing.size)
    size = f'width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}"'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" version="1.1" {size}>',
    ]
    for layer in Layer:
        paths = drawing.paths_on(layer)
        if paths:
            lines.append(f"<g {_format_style(layer)}>")
            lines.extend(f'<path d="{_format_path(one, drawing.size[1])}"/>' for one in paths)
            lines.append("</g>")
    lines.append("</svg>\n")
    path.write_text("\n".join(lines), encoding="utf-8", newline="\n")


def _format_style(layer: Layer) -> str:
    """Return the attributes of the group of a layer."""
    style = STYLES[layer]
    attributes = {
        "id": layer.value,
        "fill": "none",
        "stroke": "#{:02x}{:02x}{:02x}".format(*style.colour),
        "stroke-width": _format_number(style.width),
    }
    if style.dashes:
        attributes["stroke-dasharray"] = " ".join(map(_format_number, style.dashes))
    return " ".join(f"{name}={quoteattr(value)}" for name, value in attributes.items())


def _format_path(path: Path, height: float) -> str:
    """Return path data: M, then L or A for each segment, Z if the path is closed."""
    points = path.points * [1.0, -1.0] + [0.0, height]
    sines = np.abs(np.sin(2 * np.arctan(path.bulges)))
    radii = np.divide(path.chords, 2 * sines, out=np.zeros(len(sines)), where=sines > 0)
    commands = [f"M{_format_point(points[0])}"]
    last = len(path.bulges) - 1
    for k, (end, bulge, radius) in enumerate(zip(points[1:], path.bulges, radii, strict=True)):
        if bulge != 0:
            r = _format_number(radius)
            commands.append(f"A{r} {r} 0 {int(abs(bulge) > 1)} {int(bulge < 0)} {_format_point(end)}")
        elif k < last or not path.closed:  # Z draws the last straight segment
            commands.append(f"L{_format_point(end)}")
    return "".join([*commands, "Z"] if path.closed else commands)


def _format_point(point: Array) -> str:
    return f"{_format_number(point[0])} {_format_number(point[1])}"


def _format_number(value: float) -> str:
    """Return a length in mm with nine decimals, without trailing zeros."""
    text = f"{value:.9f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
