"""What becomes of edges that meet at corners, on parts as people draw them, beside OCCT's native fillet.

Run ``python -m benchmarks.corner_part_scores`` from the project's folder. A line for each part of
`benchmarks.corner_parts` and `benchmarks.corner_features`, and for all edges of each small STEP part in a folder, at an
eighth of its shortest edge, as `benchmarks.corner_scores` judges them.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cadquery as cq
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet

import cqblend
from benchmarks.attempts import EXACT, Made, attempt
from benchmarks.blend_scores import Blended, Limits
from benchmarks.corner_bodies import list_sharp_edges
from benchmarks.corner_features import FEATURES, HARD_FEATURES
from benchmarks.corner_parts import PARTS, CornerPart
from benchmarks.corner_scores import CornerScore, score_corners, score_fillet
from benchmarks.native import DEFAULTS
from benchmarks.tables import Table
from benchmarks.tangent_chains import EdgeLinks
from benchmarks.touching_balls import Body

LARGEST_FILE = 400_000
"""Size of a STEP file that counts as small, bytes."""
SHARE = 1 / 8
"""Radius on parts that were read, in shortest edges."""
COLUMNS = ("part", "edges", "radius, mm", "verdict", "faces", "native", "native faces", "s", "native s", "why")


def tabulate(timeout: float, folder: Path, names: Sequence[str] = ("",), jobs: int = 1) -> Iterator[Table]:
    """Yield the table of all parts whose names contain one of some words; tell on stderr of each."""
    makers = [*PARTS, *FEATURES, *HARD_FEATURES]
    drawn = [(maker.__name__.replace("_", " "), maker) for maker in makers]
    read = [(path.stem, lambda path=path: read_part(path)) for path in list_small_files(folder)]
    chosen = [(title, maker) for title, maker in (*drawn, *read) if any(name in title for name in names)]

    def run(one: tuple[str, object]) -> list[str | float]:
        row = try_part(one[0], one[1](), timeout)  # type: ignore[operator]
        print(*row, sep="  ", file=sys.stderr, flush=True)
        return row

    with ThreadPoolExecutor(jobs) as pool:
        yield Table("corner_parts", COLUMNS, list(pool.map(run, chosen)))


def list_small_files(folder: Path) -> list[Path]:
    """Return the small STEP files of a folder."""
    files = sorted([*folder.glob("*.stp"), *folder.glob("*.step")])
    return [path for path in files if path.stat().st_size < LARGEST_FILE]


def read_part(path: Path) -> CornerPart:
    """Read a part and pick all edges of it at which faces meet at an angle."""
    body = cq.importers.importStep(str(path)).val()
    edges = list_sharp_edges(body)
    return CornerPart(body, edges, SHARE * min(edge.Length() for edge in edges))


def try_part(name: str, part: CornerPart, timeout: float) -> list[str | float]:
    """Blend the edges of a part both ways, and return its row."""
    shape, largest = part.body.wrapped, max(part.radii)
    sharp = list_sharp_edges(part.body)
    links = EdgeLinks(Body(shape))
    picked = [edge for edge in part.edges if any(edge.isSame(other) for other in sharp)]
    chains = [links.follow_chain(edge.wrapped).edges for edge in picked]
    edges = list({hash(edge): edge for chain in chains for edge in chain}.values())

    def blend() -> Made:
        sizes = part.radius if isinstance(part.radius, (int, float)) else dict(zip(part.edges, part.radii, strict=True))
        result = cqblend.blend_edges(part.body, part.edges, sizes)
        if abs(result.certificate.coverage - 1) > 1e-12:
            raise AssertionError(f"the certificate has a coverage of {result.certificate.coverage}")
        promise = EXACT if result.certificate.form == "exact" else 1e-5
        return Made(result.shape.wrapped, [face.wrapped for face in result.faces], promise)

    def fillet() -> Made:
        maker = BRepFilletAPI_MakeFillet(shape)
        for edge, radius in zip(part.edges, part.radii, strict=True):
            if any(edge.isSame(other) for other in sharp):
                maker.Add(radius, edge.wrapped)
        maker.Build()
        return Made(maker.Shape(), [], math.inf)

    def judge(made: Made) -> CornerScore:
        limits = Limits(gap=1e-9, angle=1e-8) if made.promise <= EXACT else Limits(angle=made.promise)
        return score_corners(Blended(shape, edges, largest, made.shape, made.faces), limits)

    ours = attempt(shape, blend, timeout, judge)
    theirs = attempt(
        shape, fillet, timeout, lambda made: score_fillet(Blended(shape, edges, largest, made.shape, made.faces))
    )
    faces = [score.faces if isinstance(score, CornerScore) else math.nan for score in (ours.score, theirs.score)]
    middle = [ours.verdict, faces[0], theirs.verdict, faces[1], ours.ms / 1e3, theirs.ms / 1e3]
    return [name, len(edges), largest, *middle, ours.reason]


def main() -> None:
    parser = argparse.ArgumentParser(description="Blend edges that meet at corners of everyday parts.")
    parser.add_argument("names", nargs="*", default=[""], help="only parts whose names contain one of these")
    parser.add_argument("--cases", type=Path, default=DEFAULTS.cases, help="folder with STEP parts")
    parser.add_argument("--timeout", type=float, default=DEFAULTS.timeout, help="s, of one attempt")
    parser.add_argument("--jobs", type=int, default=1, help="attempts at the same time")
    options = parser.parse_args()
    for table in tabulate(options.timeout, options.cases, options.names, options.jobs):
        print(table)


if __name__ == "__main__":
    main()
