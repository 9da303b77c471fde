"""The examples and the Python in the documentation: what a reader will copy must run, and print what it says."""

import os
import re
import subprocess
import sys

import pytest
from places import ROOT

from cqblend import demo

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SOLIDS = [path for path in EXAMPLES if re.search("^result = ", path.read_text(encoding="utf-8"), re.MULTILINE)]
UNROLLED = [path for path in EXAMPLES if "unroll_models." in path.read_text(encoding="utf-8")]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def python(code, folder):
    """Run code as a script of its own, in an empty folder."""
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=folder,
        check=False,
        env={"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'examples'}"},
    )


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize("path", SOLIDS, ids=lambda path: path.stem)
def test_solid(path, tmp_path):
    """As in CQ-editor, which gives ``show_object``."""
    if "build123d" in path.read_text(encoding="utf-8"):
        pytest.importorskip("build123d")
    code = f"""
import cqblend, runpy
shown = []
made = runpy.run_path({str(path)!r}, {{"show_object": lambda shape, name: shown.append(shape)}})
assert len(shown) == 1
report = cqblend.verify(shown[0], made["result"].faces)
assert report.ok, report
assert made["result"].certificate.angle <= 1e-5
"""
    done = python(code, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "valid blend, " in done.stdout
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("path", UNROLLED, ids=lambda path: path.stem)
def test_unrolled(path, tmp_path):
    """From the shell: the files that it names are in the folder in which it is run."""
    done = subprocess.run(
        [sys.executable, str(path)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
        env={"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'examples'}"},
    )
    assert done.returncode == 0, done.stderr
    text = path.read_text(encoding="utf-8")
    written = {file.name: file.stat().st_size for file in tmp_path.iterdir()}
    assert written
    assert min(written.values()) > 1000
    assert set(re.findall(r'"(\w+\.(?:dxf|pdf|step|svg))"', text)) <= set(written)
    reports = done.stdout.count("overlap          0 mm2")
    assert reports == done.stdout.count("certified; asked") >= 1


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_python_in_the_documentation(page, tmp_path):
    """The blocks of a page run one after the other, and the errors that comments quote are the ones that come."""
    code = "\n".join(blocks(page, "python"))
    done = python(code, tmp_path)
    assert done.returncode == 0, done.stderr
    for promised in re.findall(r"print\(error\)  # (.*)", code):
        assert promised.strip(". ") in done.stdout


def test_the_certificate_in_the_readme_is_the_demo_s():
    """All but the digits of rounding: the two lines at its head, and which faces and edges there are."""
    (printed,) = blocks(ROOT / "README.md", "text")
    expected = printed.splitlines()
    actual = str(demo.blended(demo.sharp()).certificate).splitlines()
    rounding = re.compile(r"\d\.\de-1\d")
    assert [rounding.sub("rounding", line) for line in actual[:4]] == [
        rounding.sub("rounding", line) for line in expected[:4]
    ]
    assert [line.split()[:3] for line in actual[4:]] == [line.split()[:3] for line in expected[4:]]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    anchors = {
        other: {re.sub(r"[^\w\- ]", "", line.lstrip("# ")).lower().replace(" ", "-") for line in headings(other)}
        for other in PAGES
    }
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith("https://"):
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        assert path.exists(), target
        assert not anchor or anchor in anchors[path], target


def headings(page):
    return [line for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
