"""Detection of a broken installation of OCP, and the command that repairs it.

Two distributions write the same folder ``OCP``: cadquery-ocp, which CadQuery needs, and cadquery-ocp-novtk, which
build123d asks for. Whichever is installed last wins; if it is the one without VTK, ``import cadquery`` fails with a
message that names neither. This module detects the clash from the files alone and names the repair. It imports none of
the packages, and takes next to no time, because it runs at every ``import cqblend``. It also builds the command that
runs Python code in another process with the same packages.
"""

import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path

from cqblend.errors import InstallationError

REPAIR_COMMAND = "pip install --force-reinstall --no-deps cadquery-ocp"


def is_ocp_overwritten(packages: Path) -> bool:
    """Whether the binary in `packages` / OCP is not the one that cadquery-ocp installed.

    Compares its size with the one in the RECORD of cadquery-ocp.
    """
    if not any(packages.glob("cadquery_ocp_novtk-*.dist-info")):
        return False
    for record in packages.glob("cadquery_ocp-*.dist-info/RECORD"):
        for line in record.read_text(encoding="utf-8").splitlines():
            name, _, size = line.rsplit(",", 2)
            if name.startswith("OCP/OCP.") and size.isdigit():
                binary = packages / name
                return not binary.exists() or binary.stat().st_size != int(size)
    return False


class _CadQueryImportBlocker(MetaPathFinder):
    """Meta path finder that raises InstallationError when cadquery is imported, with the cause and the repair."""

    def find_spec(self, fullname: str, *_: object) -> ModuleSpec | None:
        if fullname == "cadquery":
            raise InstallationError(
                "CadQuery cannot be imported: cadquery-ocp-novtk, which build123d asks for, was installed after "
                f"cadquery-ocp and has overwritten it; repair it with: {REPAIR_COMMAND}"
            )
        return None


def build_interpreter_command(code: str, *arguments: str) -> list[str]:
    """Return the command that runs code in a process of its own, with the module path of this one."""
    return [sys.executable, "-P", "-c", f"import sys; sys.path[:] = {sys.path!r}; {code}", *arguments]


def explain_clash() -> None:
    """Make a later ``import cadquery`` raise InstallationError, if cadquery-ocp has been overwritten."""
    if "cadquery" in sys.modules:
        return
    spec = find_spec("OCP")
    for folder in (spec and spec.submodule_search_locations) or ():
        if is_ocp_overwritten(Path(folder).parent):
            sys.meta_path.insert(0, _CadQueryImportBlocker())
            return


def explain_import_failure(error: ImportError) -> InstallationError:
    """Return the error of a failed import of OCP, which names the repair."""
    if "shared object" in str(error):
        way_out = "install the system library it names; on Debian and Ubuntu: apt-get install libgl1"
    else:
        way_out = f"repair it with: {REPAIR_COMMAND}"
    return InstallationError(f"the OCCT binding OCP cannot be imported ({error}); {way_out}")
