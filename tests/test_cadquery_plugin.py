"""The import hook that gives CadQuery its methods, tried in fresh processes on a module that stands for CadQuery."""

import subprocess
import sys

import pytest
from places import ROOT

STAND_IN = """
import pathlib, sys
tried = pathlib.Path(__file__).with_suffix(".tried")
if "fails" in sys.argv and not tried.exists():
    tried.touch()
    raise ImportError("the first time")
class Workplane: pass
"""


@pytest.fixture
def run(tmp_path):
    (tmp_path / "cadquery.py").write_text(STAND_IN)

    def run_code(code, *arguments):
        begin = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]\n"
        command = [sys.executable, "-c", begin + code, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    return run_code


REGISTERED = "print(cadquery.Workplane.blend is cqblend.cadquery_plugin.blend)"


@pytest.mark.parametrize("order", ["cadquery, cqblend", "cqblend, cadquery"])
def test_methods_are_registered_in_either_order(run, order):
    assert run(f"import {order}; {REGISTERED}; print(hasattr(cadquery.Workplane, 'unroll'))") == ["True", "True"]


def test_the_module_keeps_its_own_loader(run):
    """Else its source, its resources and its reload would not be found."""
    code = """
import cqblend, cadquery, inspect
print(*(type(one).__name__ for one in (cadquery.__loader__, cadquery.__spec__.loader)))
print("touch" in inspect.getsource(cadquery))
"""
    assert run(code) == ["SourceFileLoader", "SourceFileLoader", "True"]


def test_an_import_that_failed_is_tried_again(run):
    code = f"""
import cqblend
try:
    import cadquery
except ImportError as error:
    print(error)
import cadquery
{REGISTERED}
"""
    assert run(code, "fails") == ["the", "first", "time", "True"]


def test_a_reloaded_module_gets_its_methods_again(run):
    code = f"import cqblend, cadquery, importlib; importlib.reload(cadquery); {REGISTERED}"
    assert run(code) == ["True"]


def test_without_cadquery_the_error_is_python_s_own(run):
    code = """
import cqblend
sys.path[:] = []
try:
    import cadquery
except ModuleNotFoundError as error:
    print(error.name)
"""
    assert run(code) == ["cadquery"]
