"""The certificate reports the worst of its rails, merges without losing any, and prints as an aligned table."""

from dataclasses import FrozenInstanceError, fields, replace

import pytest

from cqblend import Certificate, EdgeRecord, RailRecord

RAILS = (
    RailRecord(1, 2, 7, gap=1e-12, angle=3e-11, curvature_jump=0.4, direction=0.0, length=2e-4, tolerance=1e-7),
    RailRecord(2, 5, 7, gap=4e-12, angle=1e-11, curvature_jump=0.2, direction=5e-7, length=1e-4, tolerance=3e-7),
)
ONE = Certificate(
    rails=RAILS,
    form="exact",
    degree=(3, 3),
    poles=(12, 4),
    rational=False,
    inner_crease=0.0,
    method="wire substitution",
    validity=(lambda: True,),
    width=(3.5, 3.75),
    stations=1000,
)
OTHER = replace(
    ONE,
    rails=(replace(RAILS[0], edge=11, gap=2e-9),),
    form="compact",
    degree=(7, 3),
    poles=(8, 5),
    rational=True,
    inner_crease=0.01,
    method="splitter",
    validity=(lambda: False,),
    width=(2.0, 3.6),
    stations=400,
)


@pytest.mark.parametrize("name", ["gap", "angle", "curvature_jump", "direction", "length", "tolerance"])
def test_properties_are_the_largest_over_the_rails(name):
    assert getattr(ONE, name) == max(getattr(rail, name) for rail in RAILS)


def test_merging_keeps_every_rail_and_the_worst_of_the_rest():
    merged = Certificate.merge([ONE, OTHER, ONE])
    assert merged.rails == (*ONE.rails, *OTHER.rails, *ONE.rails)
    assert (merged.form, merged.rational, merged.valid) == ("compact", True, False)
    assert (merged.degree, merged.poles) == ((7, 3), (12, 5))
    assert (merged.width, merged.inner_crease, merged.stations) == ((2.0, 3.75), 0.01, 400)
    assert merged.method == "wire substitution, splitter"
    assert merged.gap == 2e-9


def test_merging_one_changes_nothing():
    assert Certificate.merge([ONE]) == ONE


def test_table_is_aligned_and_complete():
    lines = str(Certificate.merge([ONE, OTHER])).splitlines()
    assert (
        lines[0]
        == "INVALID blend, compact, hermite, degree 7 x 3, 12 x 5 poles, rational, by wire substitution, splitter"
    )
    assert lines[1] == "width 2 to 3.75 mm, inner crease 1.0e-02 rad, 400 stations a rail"
    table = lines[2:]
    assert len(table) == 2 + 3
    assert len({len(line) for line in table}) == 1
    hidden = {"kept", "held", "bend", "section"}
    assert all(len(line.split()) == len(fields(RailRecord)) - len(hidden) for line in table[2:])
    units = dict(zip(table[0].replace("curvature jump", "curvature_jump").split()[3:], table[1].split(), strict=True))
    assert units == {
        "gap": "mm",
        "angle": "rad",
        "curvature_jump": "1/mm",
        "direction": "rad",
        "length": "rel.",
        "tolerance": "mm",
    }


def test_held_rails_are_told_below_the_table_and_not_counted():
    held = replace(ONE.rails[0], held=True, angle=1.25, curvature_jump=9.0)
    certificate = replace(ONE, rails=(held, *ONE.rails[1:]))
    assert (
        str(certificate).splitlines()[-1] == f"side {held.side}: G0, held on the edge of face {held.face}, at 1.25 rad"
    )
    assert certificate.angle == max(rail.angle for rail in ONE.rails[1:])
    assert certificate.curvature_jump == max(rail.curvature_jump for rail in ONE.rails[1:])


def test_joints_that_stay_are_told_below_the_table():
    rails = (replace(ONE.rails[0], kept=0.25), *ONE.rails[1:])
    assert str(replace(ONE, rails=rails)).splitlines()[-1] == "side 1: the joint stays as it was on 25.0% of the rail"


def test_equal_widths_print_once():
    assert "width 3.5 mm," in str(replace(ONE, width=(3.5, 3.5 + 1e-9)))


def test_certificates_cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        ONE.valid = False
    with pytest.raises(FrozenInstanceError):
        RAILS[0].gap = 0.0


def test_edges_that_are_no_rails_are_printed_only_if_they_stray_or_join_two_blends():
    end = EdgeRecord("end", 7, 3, gap=1e-9, angle=None, tolerance=1e-7)
    seam = EdgeRecord("seam", 7, 0, gap=1e-12, angle=2e-13, tolerance=1e-7)
    assert str(replace(ONE, edges=(end, seam))) == str(ONE)
    astray = replace(end, gap=2e-7)
    assert astray.strays
    assert str(replace(ONE, edges=(astray, seam))).splitlines()[-1] == (
        "edge 7: the end at vertex 3 has gap 2.0e-07 mm, tolerance 1.0e-07 mm"
    )
    between = replace(seam, kind="between")
    worse = replace(between, angle=3e-13, curvature_jump=0.5)
    lines = str(replace(ONE, edges=(between, worse))).splitlines()
    assert lines[-1] == "2 edges between blends: gap 1.0e-12 mm, angle 3.0e-13 rad, curvature jump 5.0e-01 1/mm"


def test_merged_certificates_have_the_edges_of_all():
    ends = tuple(EdgeRecord("end", number, 3, 1e-9, None, 1e-7) for number in (7, 9))
    merged = Certificate.merge([replace(ONE, edges=ends[:1]), replace(OTHER, edges=ends[1:])])
    assert merged.edges == ends
