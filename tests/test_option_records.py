"""A function, a fluent method and a command have the options of one record: names, order, types, defaults and help."""

import inspect
import re
from dataclasses import MISSING, fields
from typing import get_args

import pytest

import cqblend
from cqblend import __main__ as cli
from cqblend import cadquery_plugin
from cqblend.blend_options import CONTINUITIES, CORNERS, ENDS, FORMS, ON_ERROR, BlendOptions
from cqblend.bridge_options import BridgeOptions
from cqblend.option_records import document_options
from cqblend.unroll_options import Direction, Method, UnrollOptions

USES = [
    (BlendOptions, cqblend.blend_edges),
    (BlendOptions, cadquery_plugin.blend),
    (BridgeOptions, cqblend.bridge),
    (BridgeOptions, cadquery_plugin.bridge),
    (UnrollOptions, cqblend.unroll),
    (UnrollOptions, cadquery_plugin.unroll),
]


def read_defaults(record):
    """Return the options of a record by name with their defaults, `inspect.Parameter.empty` for what has none."""
    none = inspect.Parameter.empty
    return {one.name: none if one.default is MISSING else one.default for one in fields(record)}


def find_actions(command):
    """Return the arguments of a command by name."""
    (commands,) = (action.choices for action in cli._build_parser()._actions if isinstance(action.choices, dict))
    return {action.dest: action for action in commands[command]._actions}


@pytest.mark.parametrize(("record", "function"), USES)
def test_signatures_have_the_options_of_the_record(record, function):
    options = read_defaults(record)
    given = [one for one in inspect.signature(function).parameters.values() if one.name in options]
    assert [(one.name, one.default) for one in given] == list(options.items())
    assert [one.kind for one in given[1:]] == [inspect.Parameter.KEYWORD_ONLY] * (len(options) - 1)
    assert {one.name: one.annotation for one in given} == {one.name: one.type for one in fields(record)}
    others = set(inspect.signature(function).parameters) - set(options)
    assert others <= {"self", "shape", "edges", "side1", "side2", "progress", "report"}


@pytest.mark.parametrize(
    ("command", "record", "left_out", "choices"),
    [
        (
            "blend",
            BlendOptions,
            # a, b and lam follow from --potential, and so may section
            {"section", "a", "b", "lam", "tangents", "bulge", "parameters", "terms", "tolerance", "angular_tolerance",
             "first"},
            {"continuity": CONTINUITIES, "ends": ENDS, "corner": CORNERS, "form": FORMS, "on_error": ON_ERROR},
        ),
        (
            "unroll",
            UnrollOptions,
            {"layout", "strain", "even", "flat_tolerance"},
            {"method": get_args(Method), "direction": get_args(Direction)},
        ),
    ],
)  # fmt: skip
def test_commands_have_options_of_the_record(command, record, left_out, choices):
    options = read_defaults(record)
    actions = {name: one for name, one in find_actions(command).items() if name in options and name not in left_out}
    assert set(actions) == set(options) - left_out
    assert {name: action.choices for name, action in actions.items() if action.choices} == choices
    for name, action in actions.items():
        assert action.required if options[name] is inspect.Parameter.empty else action.default == options[name]


@pytest.mark.parametrize(("record", "function"), USES)
def test_help_shows_every_option_with_its_default(record, function):
    options = read_defaults(record)
    text = inspect.getdoc(function)
    assert inspect.getdoc(record).partition("Attributes\n----------\n")[2] in text
    assert "... :" not in text
    headers = re.findall(r"^([a-z_, ]+) : (.*)$", text, flags=re.MULTILINE)
    documented = {name: header for names, header in headers for name in names.split(", ")}
    assert [name for name in documented if name in options] == list(options)
    for name, default in options.items():
        if default is None:
            assert documented[name].endswith("optional"), name
        elif isinstance(default, str):
            assert documented[name].endswith(f'default "{default}"'), name
        elif default is not inspect.Parameter.empty:
            shown = float(f"{default:.3g}") if type(default) is float else default
            assert documented[name].endswith(f"default {shown}"), name


def test_the_help_of_a_function_says_which_options_only_one_section_has():
    paragraphs = re.split(r"\n(?=[a-z_, ]+ : )", inspect.getdoc(BlendOptions))
    for option in fields(BlendOptions):
        (text,) = (one for one in paragraphs if option.name in one.partition(" : ")[0].split(", "))
        assert re.findall(r"Of the (\w+) section", text) == list(option.metadata.values()), option.name


def test_a_docstring_that_does_not_refer_to_the_record_is_an_error():
    def undocumented():
        """Do nothing."""

    with pytest.raises(ValueError, match="has no line"):
        document_options(BlendOptions)(undocumented)
