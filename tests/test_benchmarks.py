"""What can be told of the benchmarks without measuring times: what they blend, and where their tables go."""

import re

import pytest
from OCP.TopAbs import TopAbs_FACE
from places import ROOT

from benchmarks import __main__ as command
from benchmarks import native
from benchmarks.attempts import Outcome
from benchmarks.plain_cases import circular_joints, edges_of_many_faces, hole_rims, straight_joints
from benchmarks.tables import MACHINE, Table, replace_blocks
from cqblend.brep.topology import ShapeIndex


def test_joints_are_one_edge_each():
    trials = [*straight_joints(), *circular_joints()]
    assert [trial.name for trial in trials if len(trial.edges) != 1] == []
    assert len({trial.name for trial in trials}) == len(trials) == 15


def test_bodies_have_the_numbers_that_their_names_say():
    assert [len(hole_rims(count).edges) for count in (1, 4, 16)] == [1, 4, 16]
    for trial in edges_of_many_faces():
        assert len(trial.edges) == 1
        assert f"{len(ShapeIndex(trial.shape, TopAbs_FACE))} faces" in trial.name


def test_tables_are_markdown():
    table = Table("name", ("what", "ms", "ratio"), [("box", 123.456, 0.98765), ("rim", float("nan"), "none")])
    assert str(table).splitlines() == [
        "| what | ms | ratio |",
        "| --- | --: | --: |",
        "| box | 123 | 0.988 |",
        "| rim |  | none |",
    ]


def test_tables_take_their_places():
    document = "a\n<!-- one -->\nold\n<!-- end of one -->\nb\n<!-- two -->\n<!-- end of two -->\n"
    replaced = replace_blocks(document, {"one": "new", "three": "lost"})
    assert replaced == "a\n<!-- one -->\n\nnew\n\n<!-- end of one -->\nb\n<!-- two -->\n<!-- end of two -->\n"
    assert replace_blocks(replaced, {"one": "new"}) == replaced


def test_the_document_has_a_place_for_every_group_of_edges():
    text = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
    places = set(re.findall(r"<!-- end of (\w+) -->", text))
    assert {*native.GROUPS, MACHINE, "outcomes"} - {"failing"} <= places
    assert places == set(re.findall(r"<!-- (\w+) -->", text))


def test_ratios_are_of_solids_that_both_make():
    trial = hole_rims(1)
    made, broken, refused = (
        Outcome(status, ms=ms) for status, ms in (("ok", 4.0), ("invalid", 2.0), ("SizeError", 9.0))
    )
    rows = [native.Comparison(trial, theirs, made) for theirs in (made, broken, refused)]
    rows.append(native.Comparison(trial, made, refused))
    assert native.summarise_times("all", rows) == ["all", 3.0, 4.0, 1.5, 2.0]
    assert native.summarise_outcomes("all", rows)[1:7] == [4, 2, 3, 1, "2 (0)", 0]


def test_a_group_that_does_not_exist_is_refused(capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["benchmarks", "rims", "rimz"])
    with pytest.raises(SystemExit):
        command.main()
    assert "there is no group rimz" in capsys.readouterr().err
