"""Tables in Markdown, the machine that they were measured on, and their places in a document."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

MACHINE = "machine"
"""Name of the place in a document where the machine stands."""


@dataclass(frozen=True)
class Table:
    """A table: the name of its place in the document, titles of columns, and rows that begin with a title.

    A number is shown with three digits, NaN as nothing.
    """

    name: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str | float]]

    def __str__(self) -> str:
        lines = [self.columns, ["---", *["--:"] * (len(self.columns) - 1)]]
        lines += [[_format_cell(cell) for cell in row] for row in self.rows]
        return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _format_cell(cell: str | float) -> str:
    if isinstance(cell, str):
        return cell
    if cell != cell:
        return ""
    return f"{cell:.0f}" if abs(cell) >= 100 or cell == int(cell) else f"{cell:.3g}"


def describe_machine() -> str:
    """Return the processor, its cores, and the versions of what the times depend on."""
    model = platform.processor() or platform.machine()
    cpus = Path("/proc/cpuinfo")
    if cpus.exists():
        found = re.search(r"^model name\s*:\s*(.*)$", cpus.read_text(), re.MULTILINE)
        model = found[1] if found else model
    versions = ", ".join(
        f"{name} {version(package)}" for name, package in (("NumPy", "numpy"), ("OCP", "cadquery-ocp"))
    )
    return f"{model}, {os.cpu_count()} cores; {platform.system()}, Python {platform.python_version()}, {versions}."


def replace_blocks(document: str, blocks: dict[str, str]) -> str:
    """Return a document with new text between ``<!-- NAME -->`` and ``<!-- end of NAME -->``, where it has these."""
    for name, text in blocks.items():
        first, last = f"<!-- {name} -->", f"<!-- end of {name} -->"
        before, found, rest = document.partition(first)
        _, closed, after = rest.partition(last)
        if found and closed:
            document = f"{before}{first}\n\n{text}\n\n{last}{after}"
    return document
