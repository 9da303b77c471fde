"""What the check of replaced faces finds in a corpus of faulty solids, and that it leaves sound ones alone."""

import numpy as np
import pytest
from blended_solids import make_sound_blends
from fault_corpus import FAULTS, PAGE, check, insert_catch_table, make_faulty_solids, make_sound_solids
from solid_drafts import take_apart
from solid_faults import drop_space_curve

from cqblend.brep.verification.brep_check import is_valid
from cqblend.brep.verification.replaced_faces import Check


def test_the_corpus_is_large_enough():
    assert len(make_faulty_solids()) >= 200
    assert len(make_sound_solids()) >= 40
    assert {specimen.kind for specimen in make_faulty_solids()} == set(FAULTS)
    assert len(make_sound_blends()) == len({one.name for one in make_sound_blends()})


@pytest.mark.parametrize("kind", FAULTS)
def test_every_fault_is_found(kind):
    specimens = [specimen for specimen in make_faulty_solids() if specimen.kind == kind]
    assert specimens
    assert [str(specimen) for specimen in specimens if not specimen.is_found] == []


def test_problems_name_the_blend_that_is_at_fault():
    """On a plate with nine blended rims, one of them is faulty: what is found says which."""
    plates = [specimen.replacement for specimen in make_faulty_solids() if "nine rims" in specimen.replacement.name]
    found = [
        [r.new_faces for r in check(plate).records if r.check not in (Check.SHELLS, Check.SIDES)] for plate in plates
    ]
    named = [set(faces) for faces in found if faces]
    assert len(named) >= 5
    assert all(len(faces) == 1 and len(next(iter(faces))) == 1 for faces in named)
    assert len(set.union(*named)) > 2


def test_an_edge_without_a_curve_in_space():
    """BRepCheck crashes on it, so it is told before."""
    draft = take_apart(make_sound_blends()[0])
    drop_space_curve(draft, np.random.default_rng(1))
    (first, second) = check(draft.build("box without a curve")).problems
    assert first == second
    assert "has no curve in space" in first


def test_sound_solids_have_no_problems():
    problems = {solid.name: check(solid).problems for solid in make_sound_solids()}
    assert {name: found for name, found in problems.items() if found} == {}


def test_a_solid_without_problems_is_valid_as_a_whole():
    solids = [one for one in make_sound_solids() if is_valid(one.before)]
    assert [one.name for one in solids if not is_valid(one.after)] == []


def test_the_page_shows_what_is_found():
    assert PAGE.read_text() == insert_catch_table(PAGE.read_text()), "run python tests/support/fault_corpus.py"
