"""The corpus of faulty solids and of sound ones, by which the check of replaced faces is measured.

Run as a program, it writes the table of what is found into docs/reliability.md.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import boundary_faults  # noqa: F401 - enters its faults
import numpy as np
from blended_solids import Replacement, make_sound_blends
from fault_places import FAULTS, Fault, NotApplicableError
from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf
from OCP.TopAbs import TopAbs_FACE
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS
from solid_drafts import take_apart
from solid_faults import VARIATIONS

from cqblend.brep.topology import ShapeIndex, make_compound
from cqblend.brep.verification.brep_check import drop_inherited_flaws, find_flaws
from cqblend.brep.verification.replaced_faces import Check
from cqblend.brep.verification.solid_verification import ReplacementCheck, check_solid

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reliability.md"
START, STOP = "<!-- catch table: written by tests/support/fault_corpus.py -->\n", "<!-- end of the catch table -->"

SOLIDS_PER_FAULT = 8
"""How many solids each fault is put into, if so many have a place for it."""


@dataclass(frozen=True)
class Specimen:
    """A faulty solid and what kind of fault it has."""

    kind: str
    replacement: Replacement

    def __str__(self) -> str:
        return f"{self.kind}: {self.replacement.name}"

    @cached_property
    def found_by(self) -> frozenset[Check]:
        """The checks of ``check_solid`` that find something wrong."""
        return frozenset(record.check for record in check(self.replacement).records)

    @property
    def is_found(self) -> bool:
        """Whether ``check_solid`` finds anything wrong."""
        return bool(self.found_by)

    @cached_property
    def is_found_ordinarily(self) -> bool:
        """Whether BRepCheck finds anything wrong with the changed faces in its ordinary mode."""
        return self._is_found_by_occt(exact=False)

    @cached_property
    def is_found_exactly(self) -> bool:
        """Whether BRepCheck does so in its exact mode."""
        return self._is_found_by_occt(exact=True)

    def _is_found_by_occt(self, *, exact: bool) -> bool:
        before, after = (ShapeIndex(s, TopAbs_FACE) for s in (self.replacement.before, self.replacement.after))
        old, new = ([f for f in one if f not in other] for one, other in ((before, after), (after, before)))
        found = find_flaws(make_compound(new), exact=exact)
        return bool(found and drop_inherited_flaws(found, find_flaws(make_compound(old), exact=exact)))


def check(replacement: Replacement) -> ReplacementCheck:
    """Return what ``check_solid`` finds."""
    return check_solid(
        replacement.before,
        replacement.after,
        replacement.new_faces,
        grows=replacement.grows,
        tolerance=replacement.tolerance,
    )


@cache
def make_faulty_solids() -> tuple[Specimen, ...]:
    """Return the faulty solids, the same ones each time."""
    functions = [(kind, function) for kind, functions in FAULTS.items() for function in functions]
    return tuple(
        Specimen(kind, replacement)
        for number, (kind, function) in enumerate(functions)
        for replacement in _change_solids(function, number)
    )


@cache
def make_sound_solids() -> tuple[Replacement, ...]:
    """Return sound solids: the blends as they are, moved, and varied."""
    sound = make_sound_blends()
    place = TopLoc_Location(_make_turn())
    moved = [
        Replacement(
            f"moved, {one.name}",
            one.before.Moved(place),
            one.after.Moved(place),
            tuple(TopoDS.Face_s(face.Moved(place)) for face in one.new_faces),
            one.grows,
        )
        for one in sound[::2]
    ]
    varied = [solid for i, function in enumerate(VARIATIONS) for solid in _change_solids(function, 1000 + i)]
    return (*sound, *moved, *varied)


def _make_turn() -> gp_Trsf:
    turn = gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 2)), 0.7)
    return turn


def _change_solids(function: Fault, seed: int) -> Iterator[Replacement]:
    """Yield sound blends changed by a function, in random order, those that have a place for it."""
    sound, rng, made = make_sound_blends(), np.random.default_rng([14, seed]), 0
    for i in rng.permutation(len(sound)).tolist():
        draft = take_apart(sound[i])
        try:
            function(draft, rng)
        except NotApplicableError:
            continue
        yield draft.build(f"{function.__name__}, {sound[i].name}")
        made += 1
        if made == SOLIDS_PER_FAULT:
            return


def format_catch_table() -> str:
    """Return the table: kinds of faults, and in how many solids of each which check finds one."""
    rows: dict[str, Counter[str]] = {}
    for specimen in make_faulty_solids():
        row = rows.setdefault(specimen.kind, Counter())
        row["solids"] += 1
        row["ordinary"] += specimen.is_found_ordinarily
        row["exact"] += specimen.is_found_exactly
        row["ours"] += specimen.is_found
        row.update(check.value for check in specimen.found_by)
    rows["**all**"] = sum(rows.values(), Counter())
    lines = [
        "| fault | solids | BRepCheck | exact BRepCheck | `check_solid` | by its check of |",
        "|---|---|---|---|---|---|",
    ]
    for kind, row in rows.items():
        counts = " | ".join(str(row[name]) for name in ("solids", "ordinary", "exact", "ours"))
        checks = ", ".join(f"{check.value} {row[check.value]}" for check in Check if row[check.value])
        lines.append(f"| {kind} | {counts} | {checks} |")
    return "\n".join(lines) + "\n"


def insert_catch_table(page: str) -> str:
    """Return a page with the table in its place."""
    head, rest = page.split(START)
    return head + START + format_catch_table() + STOP + rest.split(STOP)[1]


if __name__ == "__main__":
    PAGE.write_text(insert_catch_table(PAGE.read_text()))
