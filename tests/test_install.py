"""A broken installation says what is wrong and how to repair it.

The clash of cadquery-ocp and cadquery-ocp-novtk is played with packages of a few bytes.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

from cqblend.installation_check import REPAIR_COMMAND, is_ocp_overwritten

BINARY = "OCP/OCP.cpython-311-x86_64-linux-gnu.so"


def install(packages, name, size):
    """Put on disk what pip leaves of one of the two distributions; both write the same binary."""
    folder = packages / f"{name}-7.9.3.1.dist-info"
    folder.mkdir(parents=True)
    (folder / "RECORD").write_text(
        f"OCP/__init__.py,sha256=abc,0\n{BINARY},sha256=def,{size}\n{folder.name}/RECORD,,\n"
    )
    (packages / "OCP").mkdir(exist_ok=True)
    (packages / "OCP" / "__init__.py").touch()
    (packages / BINARY).write_bytes(bytes(size))


@pytest.mark.parametrize(
    ("order", "clash"),
    [
        ([("cadquery_ocp", 70)], False),
        ([("cadquery_ocp_novtk", 50)], False),
        ([("cadquery_ocp_novtk", 50), ("cadquery_ocp", 70)], False),
        ([("cadquery_ocp", 70), ("cadquery_ocp_novtk", 50)], True),
    ],
)
def test_the_later_installation_wins(tmp_path, order, clash):
    for name, size in order:
        install(tmp_path, name, size)
    assert is_ocp_overwritten(tmp_path) is clash


def test_uninstalling_one_takes_the_binary_of_both(tmp_path):
    install(tmp_path, "cadquery_ocp_novtk", 50)
    install(tmp_path, "cadquery_ocp", 70)
    (tmp_path / BINARY).unlink()
    assert is_ocp_overwritten(tmp_path)


def test_this_installation_is_sound():
    import OCP

    assert not is_ocp_overwritten(Path(OCP.__path__[0]).parent)


def python(code, packages):
    """Run code with some packages put before all others; return the last line on stderr."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(packages), str(ROOT)])}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 1
    return done.stderr.splitlines()[-1]


def test_import_of_cadquery_names_the_repair(tmp_path):
    install(tmp_path, "cadquery_ocp", 70)
    install(tmp_path, "cadquery_ocp_novtk", 50)
    message = python("import cqblend, cadquery", tmp_path)
    assert message.startswith("cqblend.errors.InstallationError: CadQuery cannot be imported: cadquery-ocp-novtk")
    assert message.endswith(REPAIR_COMMAND)


@pytest.mark.parametrize(
    ("failure", "way_out"),
    [
        ("libGL.so.1: cannot open shared object file: No such file or directory", "apt-get install libgl1"),
        ("No module named 'OCP.OCP'", REPAIR_COMMAND),
    ],
)
def test_a_binding_that_cannot_be_loaded(tmp_path, failure, way_out):
    (tmp_path / "OCP").mkdir()
    (tmp_path / "OCP" / "__init__.py").write_text(f"raise ImportError({failure!r})\n")
    message = python("import cqblend; cqblend.blend_edges", tmp_path)
    assert message.startswith("cqblend.errors.InstallationError: the OCCT binding OCP cannot be imported")
    assert failure in message
    assert message.endswith(way_out)


def test_the_command_line_says_it_in_one_line(tmp_path):
    (tmp_path / "OCP").mkdir()
    (tmp_path / "OCP" / "__init__.py").write_text("raise ImportError('gone')\n")
    code = "import sys; from cqblend.__main__ import main; sys.exit(main(['continuity', 'x.step', '--near', '0,0,0']))"
    assert python(code, tmp_path).startswith("cqblend: error: the OCCT binding OCP cannot be imported (gone)")
