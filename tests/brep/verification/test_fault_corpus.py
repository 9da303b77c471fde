"""What the check of replaced faces finds in a corpus of faulty solids, and that it leaves sound ones alone."""

import pytest
from blended_solids import make_sound_blends
from fault_corpus import FAULTS, PAGE, check, insert_catch_table, make_faulty_solids, make_sound_solids

from cqblend.brep.verification.brep_check import is_valid


def test_the_corpus_is_large_enough():
    assert len(make_faulty_solids()) >= 200
    assert len(make_sound_solids()) >= 40
    assert {specimen.kind for specimen in make_faulty_solids()} == set(FAULTS)
    assert len(make_sound_blends()) == len({one.name for one in make_sound_blends()})


@pytest.mark.parametrize("kind", FAULTS)
def test_every_fault_that_occt_finds_is_found(kind):
    found = [s for s in make_faulty_solids() if s.kind == kind and s.is_found_exactly]
    assert [str(specimen) for specimen in found if not specimen.is_found] == []


def test_sound_solids_have_no_problems():
    problems = {solid.name: check(solid).problems for solid in make_sound_solids()}
    assert {name: found for name, found in problems.items() if found} == {}


def test_a_solid_without_problems_is_valid_as_a_whole():
    solids = [one for one in make_sound_solids() if is_valid(one.before)]
    assert [one.name for one in solids if not is_valid(one.after)] == []


def test_the_page_shows_what_is_found():
    assert PAGE.read_text() == insert_catch_table(PAGE.read_text()), "run python tests/support/fault_corpus.py"
