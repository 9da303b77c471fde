"""The layers: what may import what. Read off the source, so that no import order hides it."""

import ast

import pytest
from places import ROOT

PACKAGE = ROOT / "cqblend"
MODULES = sorted(path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py"))


def imports(module):
    """Yield the names of what a module imports at run time; what it imports for the type checker does not count."""
    todo = [ast.parse((PACKAGE / module).read_text(encoding="utf-8"))]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            todo.extend(node.orelse)
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute here"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        todo.extend(ast.iter_child_nodes(node))


def roots(module):
    return {name.partition(".")[0] for name in imports(module)}


def inside(module):
    """Return which parts of cqblend a module imports."""
    return {name.split(".")[1] for name in imports(module) if name.startswith("cqblend.")}


@pytest.mark.parametrize("module", MODULES)
def test_only_brep_imports_ocp(module):
    assert "OCP" not in roots(module) or module.startswith("brep/")


@pytest.mark.parametrize("module", MODULES)
def test_nothing_imports_scipy_or_numba(module):
    assert not {"scipy", "numba", "build123d"} & roots(module)


@pytest.mark.parametrize("module", [module for module in MODULES if "/" in module])
def test_layers(module):
    below = {"errors", "certificate", "blend_options", "installation", "whole_files"}
    allowed = {
        "splines": {"errors"},
        "surfaces": {"splines", "errors"},
        "blends": {"surfaces", "splines", "errors"},
        "patterns": {"splines", "errors", "whole_files"},
        "brep": {"blends", "surfaces", "patterns", "splines"} | below - {"blend_options"},
        "solid_blends": {"brep", "blends", "surfaces", "splines"} | below,
        "api": {"solid_blends", "brep", "blends", "patterns", "surfaces", "splines"} | below,
    }
    room = module.partition("/")[0]
    assert inside(module) <= allowed[room] | {room}


@pytest.mark.parametrize("module", [module for module in MODULES if module.startswith("blends/")])
def test_rooms_of_blends_stand_one_on_the_other(module):
    """From contacts to rails to sections; imports for the type checker count."""
    below = {
        "contacts": set(),
        "rails": {"contacts"},
        "sections": {"contacts", "rails"},
        "pde": {"contacts", "rails", "sections"},
        "potential": {"contacts", "rails", "sections"},
        "quality": {"contacts", "rails", "sections", "pde", "potential"},
    }
    room, _, rest = module.removeprefix("blends/").partition("/")
    if rest:
        text = (PACKAGE / module).read_text(encoding="utf-8")
        names = [node.module for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)]
        rooms = {name.split(".")[2] for name in names if name and name.startswith("cqblend.blends.")}
        assert rooms & set(below) <= below[room] | {room}
