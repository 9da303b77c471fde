"""Errors carry what programs want to know, and more can be said of one without reading its message."""

import inspect
import pickle

import cadquery as cq
import pytest

import cqblend
from cqblend import errors
from cqblend.errors import CqblendError, Failure, SizeError, UnrollError

TYPES = [one for _, one in inspect.getmembers(errors, inspect.isclass) if issubclass(one, CqblendError)]


@pytest.mark.parametrize("kind", TYPES)
def test_details_keep_type_and_attributes_and_the_original(kind):
    error = kind("too large")
    error.value = 3.0
    more = error.with_details(shape="edge 14", before="here: ", after="; try 2")
    assert type(more) is kind
    assert str(more) == "edge 14: here: too large; try 2"
    assert (more.shape, more.value, more.args) == ("edge 14", 3.0, ("here: too large; try 2",))
    assert str(error) == "too large"


def test_a_shape_within_a_shape():
    error = SizeError("too small", shape="edge 3", place=0.5).with_details(after=" by far")
    assert (str(error), error.shape, error.place) == ("edge 3: too small by far", "edge 3", 0.5)
    assert str(error.with_details(shape="face 5")) == "face 5: edge 3: too small by far"
    around = error.with_details(before="of all, ")
    assert (str(around), around.shape) == ("of all, edge 3: too small by far", "")


def test_attributes_of_a_type_of_its_own():
    error = UnrollError("no", "a pattern", (Failure((1,), SizeError("x")),)).with_details(shape="face 1")
    assert error.pattern == "a pattern"
    assert error.failures[0].faces == (1,)


@pytest.mark.parametrize("kind", TYPES)
def test_errors_cross_processes(kind):
    error = pickle.loads(pickle.dumps(kind("too large").with_details(shape="edge 14")))
    assert (type(error), str(error), error.shape) == (kind, "edge 14: too large", "edge 14")


def test_what_a_refused_size_tells_a_program():
    box = cq.Workplane().box(30, 20, 10)
    with pytest.raises(SizeError) as caught:
        cqblend.blend_edges(box.val(), box.edges("|Z and >X and >Y").vals(), 25)
    error = caught.value
    assert (error.kind, error.value) == ("too large", 25.0)
    assert str(error) == f"{error.shape}: {error.message}"
    assert error.shape.startswith("edge ")
    assert error.place is not None
    assert 0 <= error.place <= 1
