"""The report of a pattern: how far its flat pieces are from the shape, as a record of numbers and as text.

The numbers are measured or proved in `cqblend.patterns`; here they are summed up and printed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan

import numpy as np

from cqblend.patterns.unroll_result import Areas, Record, UnrollResult
from cqblend.unroll_options import UnrollOptions

THIN_WIDTH = 2.0
"""Width below which a piece is hard to cut and reported as thin, mm."""

MAX_PRINTED_NAMES = 12
"""Largest number of names of pieces that are printed in a row."""


@dataclass(frozen=True, slots=True)
class Report:
    """How far a pattern is from the shape it was made of. ``print`` it.

    Attributes
    ----------
    tolerance, flat : float
        Tolerances that were given: largest distance between shape and strips, and between strips and flat pieces, mm.
    strips : int
        Number of strips, N, a plane being one. Trimming may part a strip into several pieces.
    elber : int
        Number of strips that Elber's algorithm 1 takes for the same faces, directions and tolerance; faces that are
        faces that are ruled and developable count once.
    ideal : float
        N*, the integral of max_u sqrt(|<n, S_vv>| / (8 tolerance)) dv over the faces: the asymptotic number of strips
        of the best division along parameter lines.
    deviation : float
        Largest distance between shape and strips, both ways, mm.
    certified : bool
        Whether `deviation` is a proven bound for all pieces; that of strips whose rulings were paired anew is measured.
    flattening : float
        Largest distance between a strip in space and its flat piece folded, mm.
    twist : float
        Largest angle by which the normal of a strip turns along a ruling, bounded, rad; 0 if all are developable.
    ruling : float
        Largest change of the length of a ruling by laying it flat, relative.
    strain : float
        Largest change of a length inside a strip, relative; rails and rulings keep theirs. 0 on developable strips,
        nan where they were laid flat as triangles.
    area_change : float
        Largest change of a strip's area by laying it flat, relative.
    area : float
        Area of all pieces together, without tabs, mm^2.
    face_area : float
        Area of all faces together, mm^2.
    seams : int
        Number of seams.
    seam_mismatch : float
        Largest difference in length between the two sides of a seam, relative to its length.
    seam_stretch : float
        Largest excess of a seam's length over that of the edge of the shape along which it runs, relative.
    overlap : float
        Largest area that a piece covers twice, mm^2; always 0, because pieces that overlap themselves are cut.
    pieces : tuple of Record
        Quality of each piece.
    areas : tuple of Areas
        Area of each face, and of its pieces.
    thin : tuple of str
        Names of pieces that are thinner than 2 mm: twice their area over the length of their outlines.
    unmerged : tuple of str
        Names of pieces that are thinner than ``least_width``, and could not be merged into a neighbour within the
        tolerance.
    detours : tuple of str
        For each face that could not be divided in the first way that was tried: the way taken, and why others failed.
    """

    tolerance: float
    flat: float
    strips: int
    elber: int
    ideal: float
    deviation: float
    certified: bool
    flattening: float
    twist: float
    ruling: float
    strain: float
    area_change: float
    area: float
    face_area: float
    seams: int
    seam_mismatch: float
    seam_stretch: float
    overlap: float
    pieces: tuple[Record, ...]
    areas: tuple[Areas, ...]
    thin: tuple[str, ...]
    unmerged: tuple[str, ...]
    detours: tuple[str, ...]

    @classmethod
    def from_unroll_result(cls, unrolled: UnrollResult, options: UnrollOptions) -> "Report":
        """Return the worst, or the sum, of the figures of all pieces."""
        records, pieces = unrolled.records, unrolled.pieces
        return cls(
            tolerance=options.tolerance,
            flat=options.flat,
            strips=unrolled.strips,
            elber=unrolled.elber,
            ideal=unrolled.ideal,
            deviation=max((one.bound for one in records), default=0.0),
            certified=all(one.proven for one in records),
            flattening=max((one.error for one in records), default=0.0),
            twist=max((one.twist for one in records), default=0.0),
            ruling=max((one.ruling for one in records), default=0.0),
            strain=float(np.max([one.strain for one in records], initial=0.0)),  # nan if one is
            area_change=max((abs(one.flat_area / one.area - 1) for one in records if one.area > 0), default=0.0),
            area=sum(piece.area for piece in pieces.pieces),
            face_area=sum(one.face for one in unrolled.areas),
            seams=len(pieces.seams),
            seam_mismatch=pieces.mismatch() + 16 * float(np.finfo(float).eps),
            seam_stretch=unrolled.stretch,
            overlap=0.0,
            pieces=records,
            areas=unrolled.areas,
            thin=tuple(one.name for one in records if one.width < THIN_WIDTH),
            unmerged=tuple(one.name for one in records if one.width < (options.least_width or 0.0)),
            detours=unrolled.detours,
        )

    def __str__(self) -> str:
        kinds: dict[str, int] = {}
        for record in self.pieces:
            kinds[record.kind] = kinds.get(record.kind, 0) + 1
        kind = ", ".join(f"{count} {name}" for name, count in sorted(kinds.items(), key=lambda item: -item[1]))
        strain = "" if isnan(self.strain) else f", inside strips by {self.strain:.2g}"
        how = "certified" if self.certified else "measured"
        rows = (
            ("pieces", f"{len(self.pieces)} ({kind})"),
            ("strips", f"{self.strips}; by Elber's algorithm {self.elber}, ideal {self.ideal:.1f}"),
            (
                "shape to strips",
                f"{self.deviation:.3g} mm, {how}; asked {self.tolerance:.3g} mm",
            ),
            ("twist", f"{self.twist:.2g} rad along a ruling, at most"),
            (
                "strips to flat",
                f"{self.flattening:.3g} mm, asked {self.flat:.3g} mm; rulings change by {self.ruling:.1g}{strain}",
            ),
            (
                "area",
                f"{self.area:.6g} of the faces' {self.face_area:.6g} mm2; a strip's changes by {self.area_change:.2g}",
            ),
            (
                "seams",
                f"{self.seams}; their sides differ by {self.seam_mismatch:.1g}, from edges by {self.seam_stretch:.1g}",
            ),
            ("overlap", f"{self.overlap:.3g} mm2"),
            *((("thin", f"below {THIN_WIDTH:g} mm: {_abbreviate_names(self.thin)}"),) if self.thin else ()),
            *((("unmerged", _abbreviate_names(self.unmerged)),) if self.unmerged else ()),
            *(("detour", detour) for detour in self.detours),
        )
        width = max(len(name) for name, _ in rows)
        return "\n".join(f"{name:<{width}}  {text}" for name, text in rows)


def _abbreviate_names(names: Sequence[str]) -> str:
    """Return names separated by commas; of many, the first ones and the number of the others."""
    more = f" and {len(names) - MAX_PRINTED_NAMES} more" if len(names) > MAX_PRINTED_NAMES else ""
    return ", ".join(names[:MAX_PRINTED_NAMES]) + more
