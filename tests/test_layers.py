"""The rooms and what may import what, as docs/architecture.md has it."""

import ast
from graphlib import TopologicalSorter

import pytest
from import_graph import PAGE, ROOMS, draw_page, find_imports, find_room, imports, modules, room_imports

import cqblend

LATER = {"batch"}
"""Public functions that are planned: no module may take their names."""

LONGEST = 500
"""Lines that a module may have."""


def test_no_import_goes_in_a_circle():
    """Raises CycleError, which names the circle, if one does; imports of types count."""
    assert set(TopologicalSorter(imports()).static_order()) == set(modules())


def test_rooms_import_only_what_stands_below():
    level = {room: number for number, rooms in enumerate(ROOMS) for room in rooms}
    upward = [
        f"{module} imports {other}"
        for module, imported in imports().items()
        for other in imported
        if find_room(module) != find_room(other) and level[find_room(module)] <= level[find_room(other)]
    ]
    assert upward == []


def test_every_room_has_its_place():
    assert {room for rooms in ROOMS for room in rooms} == set(room_imports())


def test_the_page_shows_the_rooms_as_they_are():
    """Run ``python tests/support/import_graph.py`` to draw chart and map anew."""
    page = PAGE.read_text(encoding="utf-8")
    assert "```mermaid\nflowchart" in page
    assert "first lines of the modules -->\n\n**" in page
    assert page == draw_page(page)


def test_only_brep_imports_ocp():
    importers = {module for module in modules() if "OCP" in map(find_root, find_runtime_imports(module))}
    assert {module.partition(".")[0] for module in importers} == {"brep"}


def test_nothing_imports_scipy_or_numba_or_build123d():
    heavy = {"scipy", "numba", "build123d"}
    assert [module for module, path in modules().items() if heavy & set(map(find_root, find_imports(path)))] == []


def find_root(name):
    """Return the package that a dotted name begins with."""
    return name.partition(".")[0]


def find_runtime_imports(module):
    """Yield what a module imports at run time: what it imports for the type checker does not count."""
    todo = [ast.parse(modules()[module].read_text(encoding="utf-8"))]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            todo.extend(node.orelse)
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module
        todo.extend(ast.iter_child_nodes(node))


def test_no_module_has_the_name_of_a_public_function():
    """Importing it would hide the function."""
    functions = {name for name in cqblend.__all__ if callable(getattr(cqblend, name))} | LATER
    assert [module for module in modules() if module.rpartition(".")[2] in functions] == []


def test_modules_are_short():
    lengths = {module: len(path.read_text(encoding="utf-8").splitlines()) for module, path in modules().items()}
    assert {module: length for module, length in lengths.items() if length > LONGEST} == {}


def test_most_functions_are_named_by_more_than_one_word():
    """Verb and object: at least 55 % of all functions and methods; what is left are properties and public names."""
    names = [
        node.name.strip("_")
        for path in modules().values()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("__")
    ]
    assert sum("_" in name for name in names) > 0.55 * len(names)


def find_constants(path):
    """Yield the names of a module's constants, without leading underscores, and the source of their values."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
            pairs = [(target, node.value)]
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(target.elts, node.value.elts, strict=True))
            for name, value in pairs:
                if isinstance(name, ast.Name) and name.id.strip("_").isupper():
                    yield name.id.strip("_"), ast.unparse(value)


def find_record_fields(path):
    """Yield the names of the fields of a module's records of constants, and the source of their values."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef) and node.name.endswith(("Tolerances", "Limits", "Layout")):
            for field in node.body:
                if isinstance(field, ast.AnnAssign) and isinstance(field.value, ast.Constant):
                    yield field.target.id, ast.unparse(field.value)


@pytest.mark.parametrize("find", [find_constants, find_record_fields])
def test_constants_mean_one_thing(find):
    """No two modules have a constant of one name with two values."""
    values = {}
    for path in modules().values():
        for name, value in find(path):
            values.setdefault(name, set()).add(value)
    assert {name: found for name, found in values.items() if len(found) > 1} == {}
