"""Values on the command line: texts that become points, sizes, orders and the like, or an error that argparse reports.

Light, since ``cqblend --help`` loads it.
"""

import argparse
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from cqblend.errors import InputError

if TYPE_CHECKING:
    from cqblend.sizes.size_functions import Linear, Table

SIZES_EPILOG = """sizes:
  2                  2 mm all along
  1..3               from 1 mm at the start of the edge to 3 mm at its end
  0:1,0.5:3,1:2      through 1, 3 and 2 mm at t = 0, 0.5 and 1, smooth in between; t runs from 0 to 1 by arc length
  0 at an end lets the blend end there in a point

"""


def parse_point(text: str) -> tuple[float, float, float]:
    """Return three coordinates, of X,Y,Z."""
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected three numbers X,Y,Z, not {text!r}") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise argparse.ArgumentTypeError(f"the numbers must be finite, not {text!r}")
    return x, y, z


def parse_size(text: str) -> "float | Linear | Table":
    """Return a number, or the size that varies as `SIZES_EPILOG` says."""
    try:
        if ".." in text:
            from cqblend.sizes.size_functions import linear

            first, last = text.split("..")
            return linear(float(first), float(last))
        if ":" in text:
            from cqblend.sizes.size_functions import table

            pairs = (pair.split(":") for pair in text.split(","))
            return table([(float(t), float(size)) for t, size in pairs])
        return float(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no size, as 2, 1..3 or 0:1,0.5:3,1:2 are") from None


def parse_width(text: str) -> "float | Linear | Table | tuple[float | Linear | Table, ...]":
    """Return a size, or those on both sides."""
    sizes = tuple(map(parse_size, text.split("/")))
    return sizes[0] if len(sizes) == 1 else sizes


def parse_relation(text: str) -> tuple[float, ...]:
    """Return one to three numbers, of A[,B[,L]]."""
    try:
        numbers = tuple(map(float, text.split(",")))
    except ValueError:
        numbers = ()
    if not 1 <= len(numbers) <= 3:
        raise argparse.ArgumentTypeError(f"{text!r} is not one to three numbers, as in 2 or 2,3,-10")
    return numbers


def parse_orders(text: str) -> tuple[int, ...]:
    """Return three orders of equations, of N or X,Y,Z."""
    try:
        orders = tuple(map(int, text.split(",")))
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number N or three numbers X,Y,Z, not {text!r}") from None
    return orders * 3 if len(orders) == 1 else orders


def parse_sheet_size(text: str) -> tuple[float, float]:
    """Return the width and the height of a sheet, of WxH."""
    try:
        width, height = map(float, text.lower().split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected two numbers WxH, not {text!r}") from None
    return width, height


def attach_points(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with each point joined to its option by "=": argparse takes ``-1,2,3`` for an option."""
    attached: list[str] = []
    for argument in arguments:
        if attached and attached[-1] in ("--near", "--hold"):
            attached[-1] += f"={argument}"
        else:
            attached.append(argument)
    return attached


def assign_sizes(name: str, given: Sequence[Any] | None, edges: Sequence[Any]) -> Any:
    """Return the one size that is given, or a mapping from edges if each has its own."""
    if given is None or len(given) == 1:
        return given and given[0]
    if len(given) != len(edges):
        raise InputError(f"--{name} is given {len(given)} times for {len(edges)} edges: once, or once for each --near")
    return dict(zip(edges, given, strict=True))
