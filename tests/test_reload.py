"""Renders as CQ-editor does: after each run of a script, every module that the run imported is thrown away.

CadQuery is loaded by the editor itself and stays, or is reloaded in place if the user asks for that. Modules of scipy
do not survive being thrown away, so the path of a blend must not load any.
"""

import subprocess
import sys

import pytest
from places import ROOT

EDITOR = """
import importlib, sys
import cadquery

shown = []

def render(path):
    before = set(sys.modules)
    try:
        exec(compile(open(path).read(), path, "exec"), {"show_object": lambda shape, name: shown.append(shape)})
        return cadquery.Workplane.blend
    finally:
        for name in set(sys.modules) - before:
            assert name.partition(".")[0] != "scipy", name
            del sys.modules[name]

def reload_cadquery():
    for name in ("occ_impl.shapes", "cq"):
        importlib.reload(sys.modules[f"cadquery.{name}"])
    importlib.reload(cadquery)

def forget_cadquery():
    global cadquery
    for name in [name for name in sys.modules if name.partition(".")[0] == "cadquery"]:
        del sys.modules[name]
    import cadquery
"""


def run(code, *arguments):
    return subprocess.run(
        [sys.executable, "-c", EDITOR + code, *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.parametrize("between", ["pass", "reload_cadquery()", "forget_cadquery()"])
def test_an_example_renders_again_and_again(between):
    code = f"""
first = render(sys.argv[1])
{between}
second = render(sys.argv[1])
{between}
third = render(sys.argv[1])
assert len({{first, second, third}}) == 3  # registered anew each time
assert len(shown) == 3
assert all(shape.isValid() and shape.Volume() < 6000 for shape in shown)
assert len({{round(shape.Volume(), 9) for shape in shown}}) == 1
"""
    done = run(code, ROOT / "examples" / "block.py")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("valid blend, exact") == 6


@pytest.mark.slow
def test_a_pattern_renders_again_and_again(tmp_path):
    script = tmp_path / "ball.py"
    script.write_text(
        """
import cadquery as cq, cqblend
def report(pattern):
    for suffix in ("dxf", "svg", "pdf", "json"):
        pattern.with_tabs(2).export(f"FOLDER/pattern.{suffix}")
show_object(cq.Workplane().sphere(10).unroll(0.3, report=report), name="flat")
""".replace("FOLDER", str(tmp_path))
    )
    code = """
for _ in range(3):
    render(sys.argv[1])
reload_cadquery()
render(sys.argv[1])
assert len({tuple(round(face.Area(), 9) for face in flat.faces().vals()) for flat in shown}) == 1
"""
    done = run(code, script)
    assert done.returncode == 0, done.stderr


def test_scripts_that_import_cqblend_first(tmp_path):
    """The hook waits for CadQuery; of two that wait, the later one wins."""
    code = """
import sys
import cqblend
stale = cqblend.cadquery_plugin.blend
for name in [name for name in sys.modules if name.partition(".")[0] == "cqblend"]:
    del sys.modules[name]
import cqblend, cadquery
assert cadquery.Workplane.blend is cqblend.cadquery_plugin.blend is not stale
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
