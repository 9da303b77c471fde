"""The command line: what it prints where, and its exit codes."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import cadquery as cq
import pytest

import cqblend
from cqblend import demo
from cqblend.__main__ import main

BOX = (30.0, 20.0, 10.0)
CORNER = f"{BOX[0]},{BOX[1]},5"


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """However slow the machine is, nothing announces itself unless a test asks for it."""
    monkeypatch.setattr("cqblend.__main__._QUIET_SECONDS", 600.0)


@pytest.fixture
def box(tmp_path):
    path = tmp_path / "box.step"
    cq.exporters.export(cq.Workplane().box(*BOX, centered=False), str(path))
    return path


def run(capsys, *arguments):
    """Run the command line in this process; return exit code, stdout and stderr."""
    try:
        code = main([str(argument) for argument in arguments])
    except SystemExit as leaving:
        code = leaving.code
    out, err = capsys.readouterr()
    return code, out, err


def one_line(err):
    """Return the only line of an error message."""
    lines = err.splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("cqblend: error: ")
    return lines[0]


@pytest.mark.parametrize(
    ("size", "law"),
    [("1..3", cqblend.linear(1, 3)), ("0:1,0.5:3,1:2", cqblend.table([(0, 1), (0.5, 3), (1, 2)])), ("2", 2)],
)
@pytest.mark.parametrize("name", ["radius", "width"])
def test_sizes_that_vary(capsys, box, tmp_path, size, law, name):
    code, out, _ = run(capsys, "blend", box, tmp_path / "out.step", "--near", CORNER, f"--{name}", size)
    assert code == 0
    assert "exact" in out
    shape = cq.importers.importStep(str(tmp_path / "out.step")).val()
    original = cq.importers.importStep(str(box))
    edge = original.edges(cq.selectors.NearestToPointSelector((BOX[0], BOX[1], 5)))
    expected = cqblend.blend_edges(original, edge, **{name: law}).shape
    assert shape.Center().toTuple() == pytest.approx(expected.Center().toTuple(), abs=1e-9)


def test_a_width_for_each_side_and_a_size_for_each_edge(capsys, box, tmp_path):
    out = tmp_path / "out.step"
    other = f"{BOX[0]},0,5"
    code, text, _ = run(
        capsys, "blend", box, out, "--near", CORNER, "--near", other, "--width", "1/2..3", "--width", "2"
    )
    assert code == 0
    assert text.count(" mm from the point") == 2
    code, _, err = run(capsys, "blend", box, out, "--near", CORNER, "--radius", "1", "--radius", "2")
    assert code == 2
    assert "--radius is given 2 times for 1 edges: once, or once for each --near" in one_line(err)
    code, _, err = run(capsys, "blend", box, out, "--near", CORNER, "--near", CORNER, "--radius", "1", "--radius", "2")
    assert code == 2
    assert "two sizes are given for edge" in err


@pytest.mark.parametrize("size", ["1..x", "1..2..3", "0:1", "0:1,2", "0:1,0.5:0,1:1", "-1..2", "0..0", ":", ".."])
def test_what_is_no_size(capsys, box, tmp_path, size):
    code, _, err = run(capsys, "blend", box, tmp_path / "out.step", "--near", CORNER, f"--radius={size}")
    assert code == 2
    assert "argument --radius" in err
    assert not (tmp_path / "out.step").exists()


def test_help_and_version_load_neither_occt_nor_numpy():
    code = (
        "import sys; from cqblend.__main__ import main\n"
        "try: main([sys.argv[1]])\n"
        "except SystemExit as leaving: assert leaving.code == 0\n"
        "assert not {'OCP', 'cadquery', 'numpy'} & set(sys.modules)"
    )
    for option in ("--help", "--version"):
        done = subprocess.run([sys.executable, "-c", code, option], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert "cqblend" in done.stdout


def test_help_documents_the_exit_codes(capsys):
    for arguments in (
        ["--help"],
        ["blend", "--help"],
        ["continuity", "--help"],
        ["unroll", "--help"],
        ["demo", "--help"],
    ):
        code, out, _ = run(capsys, *arguments)
        assert code == 0
        assert "exit codes:" in out


def test_version(capsys):
    assert run(capsys, "--version")[:2] == (0, f"cqblend {cqblend.__version__}\n")


@pytest.mark.parametrize(
    "size",
    [
        ["--radius", "2"],
        ["--width", "2"],
        ["--radius", "2", "--form", "exact"],
        ["--radius", "2", "--order", "6"],
        ["--radius", "2", "--order", "4,4,6"],
        ["--potential", "2"],
        ["--potential", "2,3,-10"],
    ],
)
def test_blend(capsys, box, tmp_path, size):
    output = tmp_path / "out.step"
    code, out, err = run(capsys, "blend", box, output, "--near", CORNER, *size)
    assert (code, err) == (0, "")
    assert "0 mm from the point" in out
    assert "valid blend, exact" in out
    solid = cq.importers.importStep(str(output)).val()
    assert solid.isValid()
    assert len(solid.Faces()) == 7


@pytest.mark.parametrize(("option", "count"), [([], 8), (["--no-chain"], 1)])
def test_a_point_picks_a_whole_chain_or_one_edge(capsys, tmp_path, option, count):
    path, output = tmp_path / "rounded.step", tmp_path / "out.step"
    cq.exporters.export(cq.Workplane().box(*BOX).edges("|Z").fillet(3), str(path))
    code, _, _ = run(capsys, "blend", path, output, "--near", "0,10,5", "--radius", "1", "--ends", "flat", *option)
    assert code == 0
    solid = cq.importers.importStep(str(output)).val()
    assert solid.isValid()
    flat_ends = 0 if count > 1 else 2
    assert len(solid.Faces()) == 10 + count + flat_ends


def test_near_may_be_repeated_and_negative(capsys, tmp_path):
    centered, output = tmp_path / "centered.step", tmp_path / "out.step"
    cq.exporters.export(cq.Workplane().box(*BOX), str(centered))
    code, out, _ = run(capsys, "blend", centered, output, "--near", "-15,-10,0", "--near=15,10,0", "--radius", "2")
    assert code == 0
    assert out.count("0 mm from the point") == 2
    assert len(cq.importers.importStep(str(output)).val().Faces()) == 8


def test_near_finds_the_sharp_edge_to_blend_and_any_to_look_at(capsys, tmp_path):
    """On a filleted cylinder, seam and smooth edges of the fillet are nearer to the point than the sharp one."""
    part = cq.Workplane().cylinder(20, 10).faces(">Z").edges().fillet(3)
    path = tmp_path / "part.step"
    cq.exporters.export(part, str(path))
    code, out, _ = run(capsys, "blend", path, tmp_path / "out.step", "--near", "10,0,7", "--radius", "1")
    assert code == 0
    assert "17 mm from the point" in out
    code, out, _ = run(capsys, "continuity", path, "--near", "10,0,7")
    assert code == 0
    assert "0 mm from the point" in out
    assert "smooth" in out


def test_continuity(capsys, box):
    code, out, err = run(capsys, "continuity", box, "--near", CORNER)
    assert (code, err) == (0, "")
    assert "angle 1.6 rad" in out


def test_unroll_to_a_file_for_each_sheet(capsys, box, tmp_path):
    options = "--tolerance", 0.1, "--sheet", "35x30", "--per-sheet", "--least-width", 8
    code, out, _ = run(capsys, "unroll", box, tmp_path / "p.dxf", *options)
    assert code == 0
    assert "unmerged" in out
    files = sorted(file.name for file in tmp_path.glob("p*"))
    assert len(files) > 1
    assert files[0] == "p-1.dxf"


@pytest.mark.parametrize("suffix", ["dxf", "svg", "pdf", "json"])
def test_unroll(capsys, box, tmp_path, suffix):
    pattern, strips = tmp_path / f"pattern.{suffix}", tmp_path / "strips.step"
    code, out, err = run(capsys, "unroll", box, pattern, "--tolerance", 0.1, "--tabs", "one", "--strips", strips)
    assert (code, err) == (0, "")
    assert "6 plane" in out
    assert "seams            12" in out
    assert pattern.stat().st_size > 1000
    assert cq.importers.importStep(str(strips)).val().Area() == pytest.approx(2 * (600 + 300 + 200), rel=1e-9)


def test_unroll_faces_near_points(capsys, box, tmp_path):
    pattern = tmp_path / "pattern.json"
    near = ["--near", "15,10,99", "--near", "-9,10,5", "--sheet", "100x50", "--kerf", "0.2"]
    code, out, _ = run(capsys, "unroll", box, pattern, "--tolerance", "0.1", *near)
    assert code == 0
    chosen = [line for line in out.splitlines() if line.startswith("face ")]
    assert [line.split(", ")[1] for line in chosen] == ["89 mm from the point", "9 mm from the point"]
    record = json.loads(pattern.read_text())
    assert sorted(piece["area"] for piece in record["pieces"]) == pytest.approx([200, 600])
    assert len(record["seams"]) == 1


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--tolerance", "0"], "tolerance must be above 0"),
        (["--tolerance", "nan"], "tolerance must be finite"),
        (["--tolerance", ".1", "--tabs", "one", "--tab-width", "-1"], "the width of tabs"),
        (["--tolerance", ".1", "--kerf", "-1"], "kerf"),
    ],
)
def test_unroll_with_bad_numbers(capsys, box, tmp_path, options, reason):
    code, out, err = run(capsys, "unroll", box, tmp_path / "pattern.dxf", *options)
    assert (code, out) == (2, "")
    assert reason in one_line(err)
    assert not (tmp_path / "pattern.dxf").exists()


@pytest.mark.parametrize("name", ["pattern", "pattern.png", "no/such/folder.dxf"])
def test_unroll_to_a_file_that_cannot_be(capsys, box, tmp_path, name):
    code, _, err = run(capsys, "unroll", box, tmp_path / name, "--tolerance", "0.1")
    assert code == 2
    one_line(err)


def test_unroll_tells_how_far_long_work_has_come(capsys, box, tmp_path, monkeypatch):
    monkeypatch.setattr("cqblend.__main__._QUIET_SECONDS", 0.0)
    code, _, err = run(capsys, "unroll", box, tmp_path / "pattern.svg", "--tolerance", "0.1")
    assert code == 0
    assert re.search(r"^cqblend: +\d+% ", err, re.MULTILINE)


@pytest.mark.slow
def test_demo(capsys, tmp_path):
    folder = tmp_path / "new"
    code, out, _ = run(capsys, "demo", "--output", folder)
    assert code == 0
    assert "valid blend, exact" in out
    assert out.splitlines()[-2:] == [f"written to {folder / 'teapot.step'}", f"drawn in {folder / 'teapot.png'}"]
    assert cq.importers.importStep(str(folder / "teapot.step")).val().isValid()
    picture = (folder / "teapot.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert 50_000 < len(picture) < 200_000  # an empty one has 3,000


def test_demo_without_a_picture(capsys, tmp_path, monkeypatch):
    """Without OpenGL, VTK falls back on a kind of window that crashes; everything else must come all the same."""
    from vtkmodules import vtkRenderingCore, vtkRenderingOpenGL2

    monkeypatch.setattr(vtkRenderingCore, "vtkRenderWindow", vtkRenderingOpenGL2.vtkOSOpenGLRenderWindow)
    monkeypatch.setattr("ctypes.util.find_library", lambda name: None)
    code, out, err = run(capsys, "demo", "--output", tmp_path)
    assert code == 0
    assert "valid blend, exact" in out
    assert "error" not in err
    assert out.splitlines()[-1].startswith("no picture: ")
    assert [path.name for path in tmp_path.iterdir()] == ["teapot.step"]


def test_demo_in_a_folder_that_cannot_be_made(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, err = run(capsys, "demo", "--output", tmp_path / "file" / "folder")
    assert code == 2
    assert "file" in err.splitlines()[-1]


# failures


def test_missing_input(capsys, tmp_path):
    code, out, err = run(capsys, "continuity", tmp_path / "none.step", "--near", "0,0,0")
    assert (code, out) == (2, "")
    assert "none.step" in one_line(err)


@pytest.mark.parametrize("content", [b"", b"this is no STEP file\n", b"ISO-10303-21;\nHEADER;\n", bytes(range(256))])
def test_damaged_input_leaves_the_output_alone(capsys, tmp_path, content):
    path, output = tmp_path / "bad.step", tmp_path / "out.step"
    path.write_bytes(content)
    output.write_text("precious")
    code, out, err = run(capsys, "blend", path, output, "--near", "0,0,0", "--radius", "1")
    assert (code, out) == (2, "")
    assert "bad.step" in one_line(err)
    assert output.read_text() == "precious"


def test_truncated_input(capsys, box, tmp_path):
    whole = box.read_bytes()
    for share in (0.2, 0.6, 0.95):
        path = tmp_path / "cut.step"
        path.write_bytes(whole[: int(share * len(whole))])
        code, _, err = run(capsys, "blend", path, tmp_path / "out.step", "--near", CORNER, "--radius", "1")
        assert code == 2
        assert "cut.step" in one_line(err)
        assert not (tmp_path / "out.step").exists()


def test_failed_blend_leaves_the_output_alone(capsys, box, tmp_path):
    output = tmp_path / "out.step"
    output.write_text("precious")
    code, _, err = run(capsys, "blend", box, output, "--near", CORNER, "--radius", "500")
    assert code == 1
    assert "500" in one_line(err)
    assert output.read_text() == "precious"
    assert list(tmp_path.iterdir()) in ([box, output], [output, box])


def test_nothing_to_look_at(capsys, tmp_path):
    path = tmp_path / "sphere.step"
    cq.exporters.export(cq.Workplane().sphere(5), str(path))
    code, _, err = run(capsys, "continuity", path, "--near", "0,0,0")
    assert code == 1
    assert "none is between two faces" in one_line(err)
    code, _, err = run(capsys, "blend", path, tmp_path / "out.step", "--near", "0,0,0", "--radius", "1")
    assert code == 1
    assert "none is sharp between two faces" in one_line(err)


def test_output_that_cannot_be_written(capsys, box, tmp_path):
    code, _, err = run(capsys, "blend", box, tmp_path / "no" / "such" / "out.step", "--near", CORNER, "--radius", "2")
    assert code == 2
    assert "out.step" in one_line(err)


@pytest.mark.parametrize("option", ["--steer=-1", "--steer=2", "--crease=nan", "--crease=3"])
def test_angles_that_are_none(capsys, box, tmp_path, option):
    output = tmp_path / "out.step"
    code, _, err = run(capsys, "blend", box, output, "--near", CORNER, "--radius=2", option)
    assert code == 2
    assert option[2:7] in one_line(err)


def test_a_crease_is_refused_unless_it_is_allowed(capsys, tmp_path):
    source, output, pot = tmp_path / "pot.step", tmp_path / "out.step", demo.sharp()
    cq.exporters.export(cq.Workplane(pot), str(source))
    near = ",".join(map(str, demo.joint(pot).positionAt(0.3).toTuple()))
    arguments = ["blend", source, output, f"--near={near}", f"--width={demo.WIDTH}", "--steer=0"]
    code, _, err = run(capsys, *arguments)
    assert code == 1
    assert "steer=0.34" in err
    code, out, _ = run(capsys, *arguments, "--crease=0.02")
    assert code == 0
    assert "inner crease 1.1e-02 rad" in out


@pytest.mark.parametrize("radius", ["0", "-1", "nan", "inf", "1e300"])
def test_radius_that_is_none(capsys, box, tmp_path, radius):
    output = tmp_path / "out.step"
    code, _, err = run(capsys, "blend", box, output, "--near", CORNER, f"--radius={radius}")
    assert code == 2
    assert "radius" in one_line(err)
    assert not output.exists()


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["nonsense"],
        ["blend"],
        ["blend", "in.step", "out.step", "--radius", "1"],
        ["blend", "in.step", "out.step", "--near", "0,0,0"],
        ["blend", "in.step", "out.step", "--near", "0,0,0", "--radius", "1", "--width", "1"],
        ["blend", "in.step", "out.step", "--near", "0,0,0", "--radius", "wide"],
        ["blend", "in.step", "out.step", "--near", "0,0", "--radius", "1"],
        ["blend", "in.step", "out.step", "--near", "0,0,nan", "--radius", "1"],
        ["blend", "in.step", "out.step", "--near", "0,0,0", "--radius", "1", "--form", "pretty"],
        ["continuity", "in.step", "--near"],
    ],
)
def test_wrong_usage(capsys, arguments):
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert "usage: cqblend" in err


def test_long_steps_announce_themselves(capsys, monkeypatch):
    from cqblend import __main__ as cli

    monkeypatch.setattr(cli, "_QUIET_SECONDS", 0.0)
    with cli._announce_step("thinking"):
        cli.threading.Event().wait(0.05)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines()[0] == "cqblend: thinking ..."
    assert err.splitlines()[1].startswith("cqblend: thinking: 0.")


def test_module_and_script_are_the_same(box):
    script = Path(sys.executable).with_name("cqblend")
    commands = [[sys.executable, "-m", "cqblend"], *([[str(script)]] if script.exists() else [])]
    for command in commands:
        done = subprocess.run(
            [*command, "continuity", str(box), "--near", CORNER], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        assert "convex" in done.stdout


# what is written is checked before anything is computed, and crashes, interrupts and closed pipes end well


@pytest.mark.parametrize(
    ("name", "reason"),
    [("out.txt", "not to 'out.txt'"), ("no/out.step", "does not exist"), ("sub.step", "is a folder")],
)
def test_an_output_that_cannot_be_is_refused_before_anything_is_read(capsys, tmp_path, name, reason):
    """The input does not even exist: had it been opened first, the message would say so."""
    (tmp_path / "sub.step").mkdir()
    absent = tmp_path / "absent.step"
    for arguments in (
        ["blend", absent, tmp_path / name, "--near", "0,0,0", "--radius", "1"],
        ["unroll", absent, tmp_path / "p.dxf", "--tolerance", "1", "--strips", tmp_path / name],
    ):
        code, out, err = run(capsys, *arguments)
        assert (code, out) == (2, "")
        assert reason in one_line(err)
    assert [path.name for path in tmp_path.iterdir()] == ["sub.step"]


def test_a_width_of_tabs_without_tabs_is_refused(capsys, box, tmp_path):
    code, _, err = run(capsys, "unroll", box, tmp_path / "p.dxf", "--tolerance", "0.1", "--tab-width", "3")
    assert code == 2
    assert "--tab-width has no effect" in one_line(err)


def test_a_damaged_but_whole_file_is_read_with_a_warning(capsys, box, tmp_path):
    whole = box.read_text()
    path = tmp_path / "odd.step"
    path.write_text(re.sub(r"#\d+ = DIRECTION\([^;]*;\n", "", whole, count=1))
    code, out, err = run(capsys, "continuity", path, "--near", CORNER)
    assert code == 0
    assert "angle 1.6 rad" in out
    (warning,) = [line for line in err.splitlines() if not line.startswith("cqblend: reading")]  # which takes its time
    assert warning.startswith(f"cqblend: warning: {path}: damaged: 1 entities")


def started(*arguments, **options):
    """Run the command line as users do."""
    command = [sys.executable, "-m", "cqblend", *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(Path(cqblend.__file__).parents[1]), "PYTHONUNBUFFERED": ""}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, text=True, env=environment, **(pipes | options))


def test_a_file_on_which_occt_crashes_is_an_error_that_names_it(box, tmp_path):
    """A surface that is the offset of itself: OCCT's reader calls itself until the stack is full."""
    path, output = tmp_path / "endless.step", tmp_path / "out.step"
    path.write_text(re.sub(r"(#\d+) = PLANE\([^;]*;", r"\1 = OFFSET_SURFACE('',\1,1.,.F.);", box.read_text(), count=1))
    output.write_text("precious")
    process = started("blend", path, output, "--near", CORNER, "--radius", "2")
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out) == (2, "")
    assert f"{path}: damaged" in one_line(err)
    assert output.read_text() == "precious"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["box.step", "endless.step", "out.step"]


@pytest.mark.parametrize(
    ("killed", "reason"), [("SIGSEGV", "try another edge or size"), ("SIGKILL", "too little memory")]
)
def test_a_crash_after_reading_is_an_error_that_names_the_file(capsys, box, tmp_path, monkeypatch, killed, reason):
    """The child kills itself and leaves an unfinished file; the next process, which only reads, comes back."""
    unfinished = "open(f'{sys.argv[1]}/.cqblend-{os.getpid()}-x.step', 'w').close()"
    codes = iter([f"import os, signal, sys; {unfinished}; os.kill(os.getpid(), signal.{killed})", ""])
    monkeypatch.setattr(
        "cqblend.__main__.build_interpreter_command",
        lambda code, *_: [sys.executable, "-c", next(codes), str(tmp_path)],
    )
    arguments = ["cqblend", "blend", box, tmp_path / "out.step", "--near", CORNER, "--radius", "2"]
    monkeypatch.setattr("sys.argv", [str(one) for one in arguments])
    handlers = [signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM)]
    code = main()
    assert (code, next(codes, None)) == (1, None)
    message = one_line(capsys.readouterr().err)
    assert str(box) in message
    assert killed in message
    assert reason in message
    assert [one.name for one in tmp_path.iterdir()] == ["box.step"]
    assert [signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM)] == handlers


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_ends_quietly(tmp_path, number, code):
    process = started("demo", "--output", tmp_path)
    first = process.stderr.readline()  # the blend has been under way for a second
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert first.startswith("cqblend: blending")
    assert (process.returncode, out, err) == (code, "", "")
    assert not list(tmp_path.iterdir())


def test_a_closed_pipe_ends_quietly(box):
    for arguments in (["continuity", box, "--near", CORNER], ["--help"]):
        reading, writing = os.pipe()
        process = started(*arguments, stdout=writing)
        os.close(writing)
        os.close(reading)
        _, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (141, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
def test_a_full_disk_behind_standard_output_is_one_line(box):
    with Path("/dev/full").open("w") as full:
        process = started("continuity", box, "--near", CORNER, stdout=full)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "standard output cannot be written: No space left on device" in one_line(err)


@pytest.mark.parametrize("suffix", ["dxf", "svg", "pdf", "json", "step", "png"])
def test_a_failing_writer_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, suffix):
    """The disk is full when the file is to be put in its place."""
    from cqblend import picture
    from cqblend.brep.step_files import write_step

    def full(descriptor):
        raise OSError(28, "No space left on device")

    path = tmp_path / f"out.{suffix}"
    path.write_text("precious")
    monkeypatch.setattr(os, "fsync", full)
    square = cq.Face.makePlane(2, 1)
    part = picture.ShadedFaces([square], (0.5, 0.5, 0.5))
    write = {
        "step": lambda: write_step(square.wrapped, path),
        "png": lambda: picture.draw_views([picture.View([part], (1, 1, 1), (0, 0, 0), 3.0)], path, size=(20, 20)),
    }.get(suffix, lambda: cqblend.unroll(square, 0.1).export(path))
    with pytest.raises(OSError, match="No space left"):
        write()
    assert path.read_text() == "precious"
    assert [one.name for one in tmp_path.iterdir()] == [path.name]
