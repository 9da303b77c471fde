"""The imports of the package, read off its source, so that no import order hides one; imports of types count.

Run as a script, it draws the graph of rooms into docs/architecture.md.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "architecture.md"
CHART = re.compile(r"(?<=```mermaid\n).*?(?=```)", re.DOTALL)
MAP = re.compile(r"(?<=first lines of the modules -->\n).*?(?=<!-- end of the map -->)", re.DOTALL)

ROOMS = (
    ("errors",),
    ("argument_checks", "option_records"),
    ("installation_check", "atomic_files", "unroll_options"),
    ("sizes",),
    ("splines",),
    ("surfaces",),
    ("blends",),
    ("blends.corners",),
    ("blends.contacts",),
    ("blends.rails",),
    ("blends.sections",),
    ("blends.network",),
    ("blends.pde", "blends.potential"),
    ("blends.quality",),
    ("blend_numbers",),
    ("blend_options", "certificate"),
    ("bridge_options",),
    ("patterns.outline",),
    ("patterns.trimming",),
    ("patterns.strips",),
    ("patterns.flattening",),
    ("patterns",),
    ("patterns.stock",),
    ("patterns.files",),
    ("brep",),
    ("brep.conversion",),
    ("brep.measurement",),
    ("brep.selection",),
    ("brep.shell_editing",),
    ("brep.verification",),
    ("solid_blends",),
    ("api",),
    ("picture",),
    ("teapot",),
    ("demo",),
    ("cadquery_plugin", "command_line_values"),
    ("__init__",),
    ("__main__",),
)
"""The rooms from bottom to top; each may import what stands before it. Rooms of one line know nothing of each other."""


@cache
def modules() -> dict[str, Path]:
    """Return the modules of the package by their dotted names without its own; packages are their ``__init__``."""
    package = ROOT / "cqblend"
    found = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        found[".".join(parts if len(parts) == 1 else [part for part in parts if part != "__init__"])] = path
    return found


def find_imports(path: Path) -> Iterator[str]:
    """Yield the dotted names of all that a file imports, wherever in it, for the type checker too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute here"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@cache
def imports() -> dict[str, set[str]]:
    """Return for each module the modules of the package that it imports."""
    graph: dict[str, set[str]] = {}
    for name, path in modules().items():
        graph[name] = set()
        for imported in find_imports(path):
            parts = imported.split(".")
            if parts[0] == "cqblend":
                whole, home = ".".join(parts[1:]), ".".join(parts[1:-1])
                graph[name].add(whole if whole in modules() else home or "__init__")
        graph[name].discard(name)
    return graph


def find_room(module: str) -> str:
    """Return the room that a module stands in: its package, or itself at the top level."""
    path = modules()[module]
    return module if path.name == "__init__.py" or "." not in module else module.rpartition(".")[0]


@cache
def room_imports() -> dict[str, set[str]]:
    """Return for each room the other rooms that it imports."""
    graph: dict[str, set[str]] = {find_room(module): set() for module in modules()}
    for module, imported in imports().items():
        graph[find_room(module)] |= {find_room(one) for one in imported} - {find_room(module)}
    return graph


def find_reachable(graph: Mapping[str, Iterable[str]], start: Iterable[str]) -> set[str]:
    """Return all that can be reached from some nodes, these included."""
    found, todo = set(), list(start)
    while todo:
        node = todo.pop()
        if node not in found:
            found.add(node)
            todo.extend(graph[node])
    return found


def find_folders(room: str, folders: set[str]) -> set[str]:
    """Return the folders that a room imports, directly or by modules of the top level."""
    found = set()
    for other in room_imports()[room]:
        found |= {other} if other in folders else find_folders(other, folders) - {room}
    return found - {room}


def draw_chart() -> str:
    """Return the graph of folders as a Mermaid flow chart: an arrow for each import that no longer way implies."""
    used = {other for imported in room_imports().values() for other in imported}
    folders = {
        room
        for room, imported in room_imports().items()
        if modules()[room].name == "__init__.py" and room != "__init__" and (imported or room in used)
    }
    graph = {room: sorted(find_folders(room, folders)) for room in sorted(folders)}
    lines = ["flowchart BT"]
    for room in TopologicalSorter(graph).static_order():
        lines.append(f'    {_identify(room)}["{room}"]')
        for other in graph[room]:
            if other not in find_reachable(graph, set(graph[room]) - {other}):
                lines.append(f"    {_identify(room)} --> {_identify(other)}")
    return "\n".join(lines) + "\n"


def list_modules() -> str:
    """Return a table for each room: its modules, each with what the first line of its docstring says."""
    tables = []
    for room in (room for rooms in ROOMS for room in rooms):
        inside = [module for module in modules() if find_room(module) == room and module != "__init__"]
        if modules()[room].name == "__init__.py":
            inside = [module for module in inside if module != room]
        if "." in room or inside != [room]:
            tables.append(f"\n**`{room}`** {_describe(room)}\n\n| module | |\n|---|---|")
        elif not tables or not tables[-1].startswith("\n**Single"):
            tables.append("\n**Single modules, above those before**\n\n| module | |\n|---|---|")
        tables[-1] += "".join(f"\n| {_link(module)} | {_describe(module)} |" for module in inside)
    return "\n".join(table for table in tables if "](" in table) + "\n\n"


def _link(module: str) -> str:
    path = modules()[module]
    return f"[`{path.stem}`](../{path.relative_to(ROOT).as_posix()})"


def _describe(module: str) -> str:
    docstring = ast.get_docstring(ast.parse(modules()[module].read_text(encoding="utf-8"))) or ""
    return docstring.partition("\n\n")[0].replace("\n", " ").replace("|", "\\|").replace("``", "`")


def draw_page(page: str) -> str:
    """Return the page of the architecture with its chart and its map as the code is."""
    return MAP.sub(lambda _: list_modules(), CHART.sub(lambda _: draw_chart(), page, count=1), count=1)


def _identify(room: str) -> str:
    return room.replace(".", "_").strip("_")


if __name__ == "__main__":
    PAGE.write_text(draw_page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
