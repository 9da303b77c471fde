"""The command line ``cqblend``: blends, measures and unrolls the shape in a STEP file without a script.

Results go to stdout; progress, warnings and errors go to stderr; the exit codes are those of `_EPILOG`. OCCT and NumPy
are loaded when a command needs them, so that ``--help`` is fast. OCCT crashes on some damaged files: the work is done
by a child process, and this one reports the crash.
"""

import argparse
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, get_args

from cqblend import __version__
from cqblend.blend_options import (
    BLEND_DEFAULTS,
    CONTINUITIES,
    CORNERS,
    ENDS,
    FORMS,
    ON_ERROR,
    SECTIONS,
    BlendOptions,
    BlendRequest,
)
from cqblend.command_line_values import (
    SIZES_EPILOG,
    assign_sizes,
    attach_points,
    parse_orders,
    parse_point,
    parse_relation,
    parse_sheet_size,
    parse_size,
    parse_width,
)
from cqblend.errors import CqblendError, CqblendWarning, FileError, InputError, InstallationError, StepError
from cqblend.installation_check import build_interpreter_command
from cqblend.option_records import collect_options
from cqblend.unroll_options import UNROLL_DEFAULTS, Direction, Method, UnrollOptions

OK, FAILED, USAGE, INTERRUPTED, OUTPUT_CLOSED = 0, 1, 2, 128 + signal.SIGINT, 141

Command = Callable[[argparse.Namespace], None]
"""What a command does with its parsed arguments."""

_EPILOG = f"""exit codes:
  {OK}  done
  {FAILED}  the shape could not be blended, measured or unrolled; one line on stderr says why
  {USAGE}  wrong usage, or a file that is missing, damaged or cannot be written
  {INTERRUPTED:d}, {OUTPUT_CLOSED}  interrupted, or nobody reads the output any more
"""

_DEFAULT_HELP = "default: %(default)s"

_STEP_SUFFIXES = (".step", ".stp", ".p21")

_TAB_WIDTH = 6.0
"""Default height of tabs, mm."""

_QUIET_SECONDS = 1.0
"""Time after which a step is announced, between two lines of progress, and for a stopped child to end, s."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name. By default those of the process, and then a child does the work.
    """
    try:
        try:
            options = _build_parser().parse_args(attach_points(sys.argv[1:] if arguments is None else arguments))
            return _run_in_child(options, sys.argv[1:]) if arguments is None else _run_command(options)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except KeyboardInterrupt:
        return INTERRUPTED
    except OSError as error:  # not one of cqblend's errors: standard output failed
        with suppress(OSError):  # else the interpreter reports the failure again when it exits
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            return OUTPUT_CLOSED
        _print_message("error", f"standard output cannot be written: {error.strerror}")
        return USAGE


def _run_command(options: argparse.Namespace) -> int:
    """Run a command in this process and return its exit code."""
    with warnings.catch_warnings():
        others = warnings.showwarning

        def show_warning(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
            if issubclass(category, CqblendWarning):
                _print_message("warning", str(message))
            else:
                others(message, category, *where, **more)

        warnings.showwarning = show_warning
        try:
            options.run(options)
        except (StepError, FileError, InputError) as error:
            _print_message("error", str(error))
            return USAGE
        except CqblendError as error:
            _print_message("error", str(error))
            return FAILED
    return OK


def _print_message(what: str, message: str) -> None:
    print(f"cqblend: {what}: {' '.join(message.split())}", file=sys.stderr)


class _SignalReceived(BaseException):
    """A signal to end was sent to this process; its number is the argument."""


_END_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""The signals that ask a process to end, as far as this system has them."""


@contextmanager
def _raise_on_signals() -> Iterator[None]:
    """While the context lasts, signals to end raise `_SignalReceived`."""

    def raise_received(signal_number: int, _: FrameType | None) -> None:
        raise _SignalReceived(signal_number)

    before = {number: signal.signal(number, raise_received) for number in _END_SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _run_in_child(options: argparse.Namespace, arguments: Sequence[str]) -> int:
    """Run a command in a child process and return its exit code.

    An interrupt ends the child at once, even within OCCT: its unfinished files are removed here.
    """
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.SIG_DFL); "
        "from cqblend.__main__ import main; sys.exit(main(sys.argv[1:]))"
    )
    with _raise_on_signals(), subprocess.Popen(build_interpreter_command(code, *arguments)) as child:  # noqa: S603  (this program itself)
        try:
            return_code = child.wait()
        except _SignalReceived as ended:
            return_code = _stop_child(child, ended.args[0])
    if 0 <= return_code <= 255:
        return return_code
    _remove_unfinished(options, child.pid)
    return 128 - return_code if -return_code in _END_SIGNALS else _explain_crash(options, return_code)


def _stop_child(child: "subprocess.Popen[bytes]", signal_number: int) -> int:
    """Pass a signal on to the child, wait for its end, and return its return code."""
    for one in _END_SIGNALS:
        signal.signal(one, signal.SIG_IGN)
    if os.name == "posix":
        child.send_signal(signal_number)
    else:
        child.terminate()
    try:
        child.wait(_QUIET_SECONDS)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
    return -signal_number


def _remove_unfinished(options: argparse.Namespace, process: int) -> None:
    """Remove the unfinished files of a process beside the files that a command was to write."""
    from cqblend.atomic_files import remove_unfinished

    for path in (getattr(options, name, None) for name in ("output", "strips")):
        if path is not None:
            remove_unfinished(path if path.is_dir() else path.resolve().parent, process)


def _explain_crash(options: argparse.Namespace, return_code: int) -> int:
    """Print why a child has crashed, and return the exit code."""
    try:
        cause = signal.Signals(-return_code).name
    except ValueError:
        cause = f"code {return_code & 0xFFFFFFFF:#x}"
    file = getattr(options, "input", None)
    if file is None:
        _print_message("error", f"OCCT has crashed ({cause})")
        return FAILED
    code = "from cqblend.brep.step_files import read_step; read_step(sys.argv[1])"
    again = subprocess.run(build_interpreter_command(code, str(file)), capture_output=True, check=False)  # noqa: S603  (as above)
    if again.returncode not in range(256):
        _print_message("error", f"{file}: damaged: OCCT crashes when it reads the file ({cause})")
        return USAGE
    killed = "there may be too little memory" if cause == "SIGKILL" else "try another edge or size, or repair the file"
    _print_message("error", f"{file}: OCCT has crashed while it worked on the shape in it ({cause}): {killed}")
    return FAILED


def _build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="cqblend",
        description="Exactly smooth blends on the edges of STEP solids, and patterns of their faces for flat stock.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"cqblend {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    blend = _add_command(
        commands,
        "blend",
        _run_blend,
        "blend edges of the solid in a STEP file and print the certificate",
        epilog=SIZES_EPILOG + _EPILOG,
    )
    blend.add_argument("input", type=Path, metavar="IN.step")
    blend.add_argument("output", type=Path, metavar="OUT.step", help="replaced only when the new one is complete")
    _add_near_option(blend, repeatable=True)
    size = blend.add_mutually_exclusive_group(required=True)
    each = "; once, or once for each --near"
    size.add_argument("--radius", type=parse_size, metavar="SIZE", action="append", help=f"of the ball, mm{each}")
    size.add_argument(
        "--width",
        type=parse_width,
        metavar="SIZE[/SIZE]",
        action="append",
        help=f"distance from the edge to either rail, or to those on side 1 and side 2, mm{each}",
    )
    size.add_argument(
        "--potential",
        type=parse_relation,
        metavar="A[,B[,L]]",
        help="move one side by A, the other by B, mm, and fill by the curves in which they meet; L is lambda, default "
        "0, an ellipse; the less, the sharper",
    )
    blend.add_argument("--taper", type=float, metavar="L", help="length over which sizes in a chain change, mm")
    blend.add_argument("--section", choices=SECTIONS, help="default: auto, or what --potential or --order says")
    blend.add_argument("--continuity", choices=CONTINUITIES, help="default: G1, or what --order gives")
    blend.add_argument(
        "--order",
        type=parse_orders,
        metavar="N",
        help="fill by partial differential equations of order 2, 4 or 6 (G0, G1, G2), or 4,4,6 for x, y and z",
    )
    blend.add_argument("--ends", choices=ENDS, default=BLEND_DEFAULTS.ends, help=f"of open edges; {_DEFAULT_HELP}")
    blend.add_argument(
        "--corner", choices=CORNERS, default=BLEND_DEFAULTS.corner, help=f"where all edges are blended; {_DEFAULT_HELP}"
    )
    blend.add_argument("--setback", type=float, metavar="S", help="how far before it blends end, with --corner=setback")
    blend.add_argument(
        "--on-error", choices=ON_ERROR, default=BLEND_DEFAULTS.on_error, help=f"for edges that fail; {_DEFAULT_HELP}"
    )
    hold_help = "hold a rail on the edge nearest to this point, mm; may be repeated"
    blend.add_argument("--hold", type=parse_point, metavar="X,Y,Z", action="append", help=hold_help)
    blend.add_argument("--no-chain", dest="chain", action="store_false", help="do not go on along tangential edges")
    blend.add_argument("--form", choices=FORMS, default=BLEND_DEFAULTS.form, help=_DEFAULT_HELP)
    blend.add_argument(
        "--steer",
        type=float,
        metavar="S",
        default=BLEND_DEFAULTS.steer,
        help="largest turn next to knot lines, rad; default: %(default).2g",
    )
    blend.add_argument("--crease", type=float, metavar="C", help="how sharp a crease inside may be, rad")

    continuity = _add_command(
        commands, "continuity", _run_continuity, "measure how smoothly the two faces at an edge meet"
    )
    continuity.add_argument("input", type=Path, metavar="FILE.step")
    _add_near_option(continuity, repeatable=False)

    _add_unroll_command(commands)

    demo = _add_command(commands, "demo", _run_demo, "blend the Utah teapot: certificate, teapot.step and teapot.png")
    demo.add_argument("--output", type=Path, default=Path(), metavar="DIR", help="default: the working directory")
    return parser


def _add_unroll_command(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    unroll = _add_command(
        commands, "unroll", _run_unroll, "unroll faces to developable strips, and write what is to be cut"
    )
    unroll.add_argument("input", type=Path, metavar="IN.step")
    unroll.add_argument(
        "output", type=Path, metavar="OUT.dxf", help="or .svg, .pdf, .json; replaced only when complete"
    )
    unroll.add_argument("--tolerance", type=float, metavar="T", required=True, help="between shape and strips, mm")
    unroll.add_argument(
        "--near",
        type=parse_point,
        metavar="X,Y,Z",
        action="append",
        help="only the face nearest to this point, mm; may be repeated",
    )
    unroll.add_argument("--method", choices=get_args(Method), default=UNROLL_DEFAULTS.method, help=_DEFAULT_HELP)
    unroll.add_argument(
        "--direction", choices=get_args(Direction), default=UNROLL_DEFAULTS.direction, help=_DEFAULT_HELP
    )
    unroll.add_argument(
        "--developable", action="store_true", help="pair rulings anew where that makes strips developable"
    )
    unroll.add_argument(
        "--least-width", type=float, metavar="W", help="merge thinner pieces into their neighbours, mm; default: none"
    )
    unroll.add_argument("--tabs", choices=("one", "alternating", "both", "strips", "allowance"), help="default: none")
    unroll.add_argument("--tab-width", type=float, metavar="W", help=f"mm; default: {_TAB_WIDTH:g}")
    unroll.add_argument(
        "--sheet", type=parse_sheet_size, metavar="WxH", help="of the stock, mm; default: as large as it needs to be"
    )
    unroll.add_argument("--per-sheet", action="store_true", help="a file for every sheet: OUT-1.dxf, OUT-2.dxf, ..")
    unroll.add_argument("--kerf", type=float, metavar="K", default=0.0, help="of the cutter, mm; default: %(default)g")
    unroll.add_argument("--strips", type=Path, metavar="OUT.step", help="write the strips in space, too")


def _add_command(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    name: str,
    run: Command,
    text: str,
    epilog: str = _EPILOG,
) -> argparse.ArgumentParser:
    parser = commands.add_parser(
        name, help=text, description=text, epilog=epilog, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.set_defaults(run=run)
    return parser


def _add_near_option(parser: argparse.ArgumentParser, *, repeatable: bool) -> None:
    """Add ``--near``, which picks the nearest edge: never a seam or a pole, a smooth edge only for measuring."""
    parser.add_argument(
        "--near",
        type=parse_point,
        metavar="X,Y,Z",
        required=True,
        action="append" if repeatable else "store",
        help=f"the {'sharp ' * repeatable}edge nearest to this point, mm" + ("; may be repeated" if repeatable else ""),
    )


def _run_blend(options: argparse.Namespace) -> None:
    from cqblend.brep.selection.nearest_shapes import find_nearest_edge
    from cqblend.brep.step_files import read_step, write_step
    from cqblend.solid_blends.blend_pipeline import blend_shape

    section = options.section or ("potential" if options.potential else "auto" if options.order is None else "pde")
    relation = dict(zip(("a", "b", "lam"), options.potential or (), strict=False))

    def make_request(edges: Sequence[Any], hold: Sequence[Any] | None) -> BlendRequest:
        sizes = {name: assign_sizes(name, getattr(options, name), edges) for name in ("radius", "width")}
        given = {**vars(options), "section": section, "hold": hold, **relation, **sizes}
        return collect_options(BlendOptions, given).to_request()

    make_request(
        range(len(options.near)), options.hold
    )  # so that what is wrong with the options is said before the file is read
    _check_step_path(options.output)
    with _announce_step(f"reading {options.input}"):
        shape = read_step(options.input)
    with _announce_step("looking for the edges"):
        picked = [find_nearest_edge(shape, point, sharp=True) for point in options.near]
        held = [find_nearest_edge(shape, point, sharp=False) for point in options.hold or ()]
    for edge in picked:
        print(f"edge {edge.index}, {edge.distance:.3g} mm from the point")
    for edge in held:
        print(f"held on edge {edge.index}, {edge.distance:.3g} mm from the point")
    with _announce_step("blending"):
        edges = [edge.edge for edge in picked]
        result = blend_shape(shape, edges, make_request(edges, [edge.edge for edge in held] or None))
    with _announce_step(f"writing {options.output}"):
        write_step(result.shape, options.output)
    print(result.certificate)


def _run_continuity(options: argparse.Namespace) -> None:
    from cqblend.brep.measurement.edge_continuity import measure_continuity
    from cqblend.brep.selection.nearest_shapes import find_nearest_edge
    from cqblend.brep.step_files import read_step

    with _announce_step(f"reading {options.input}"):
        shape = read_step(options.input)
    with _announce_step("measuring"):
        picked = find_nearest_edge(shape, options.near, sharp=False)
        measured = measure_continuity(shape, picked.edge)
    print(f"edge {picked.index}, {picked.distance:.3g} mm from the point")
    print(measured)


def _run_unroll(options: argparse.Namespace) -> None:
    from cqblend.api.flat_pattern import unroll_with_options
    from cqblend.brep.selection.nearest_shapes import find_nearest_face
    from cqblend.brep.step_files import read_step, write_step
    from cqblend.patterns.files.pattern_files import check_pattern_path

    check_pattern_path(options.output)
    if options.tab_width is not None and not options.tabs:
        raise InputError("--tab-width has no effect without --tabs: leave it out, or say which")
    if options.strips:
        _check_step_path(options.strips)
    with _announce_step(f"reading {options.input}"):
        shape = read_step(options.input)
    faces = []
    for point in options.near or ():
        picked = find_nearest_face(shape, point)
        print(f"face {picked.index}, {picked.distance:.3g} mm from the point")
        faces.append(picked.face)
    wanted = collect_options(UnrollOptions, vars(options))
    pattern = unroll_with_options(faces or shape, wanted, _ProgressPrinter())
    if options.tabs:
        with _announce_step("adding tabs"):
            width = _TAB_WIDTH if options.tab_width is None else options.tab_width
            pattern = pattern.with_tabs(width, style=options.tabs)
    strips = pattern.strips_3d() if options.strips else None
    with _announce_step(f"placing the pieces and writing {options.output}"):
        pattern.export(options.output, sheet=options.sheet, kerf=options.kerf, per_sheet=options.per_sheet)
    if options.strips:
        with _announce_step(f"writing {options.strips}"):
            write_step(strips, options.strips)
    print(pattern.report)


class _ProgressPrinter:
    """Prints the progress of long work on stderr, at most once in `_QUIET_SECONDS`."""

    def __init__(self) -> None:
        self.last = time.monotonic()

    def __call__(self, part: float, what: str) -> None:
        now = time.monotonic()
        if now - self.last > _QUIET_SECONDS:
            self.last = now
            print(f"cqblend: {part:4.0%} {what}", file=sys.stderr, flush=True)


def _run_demo(options: argparse.Namespace) -> None:
    from cqblend import demo
    from cqblend.atomic_files import make_folder
    from cqblend.brep.step_files import write_step

    step, picture = options.output / "teapot.step", options.output / "teapot.png"
    make_folder(options.output)
    _check_step_path(step)
    with _announce_step("blending the spout of the Utah teapot onto its body"):
        pot = demo.sharp()
        result = demo.blended(pot)
    print(result.certificate)
    print(result.certificate.proof)
    with _announce_step(f"writing {step}"):
        write_step(result.shape.wrapped, step)
    print(f"written to {step}", flush=True)
    try:
        with _announce_step("drawing"):
            demo.draw(pot, result, picture)
    except (InstallationError, OSError) as error:
        print(f"no picture: {error}")
    else:
        print(f"drawn in {picture}")


def _check_step_path(path: Path) -> None:
    """Raise InputError or FileError if a STEP file cannot be written to a path."""
    from cqblend.atomic_files import check_target

    check_target(path, _STEP_SUFFIXES, "STEP files")


@contextmanager
def _announce_step(what: str) -> Iterator[None]:
    """Print on stderr the name of a step that takes longer than `_QUIET_SECONDS`, and then the time that it took."""
    start = time.monotonic()
    timer = threading.Timer(_QUIET_SECONDS, lambda: print(f"cqblend: {what} ...", file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        elapsed = time.monotonic() - start
        if elapsed > _QUIET_SECONDS:
            print(f"cqblend: {what}: {elapsed:.1f} s", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
