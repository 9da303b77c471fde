"""The bodies of a shape: which there are, and what a shape looks like after one of them is replaced."""

import cadquery as cq
from OCP.TopAbs import TopAbs_FACE

from cqblend.brep.bodies import (
    join_shells,
    list_bodies,
    make_shell,
    replace_bodies,
    replace_body,
    replace_body_faces,
)
from cqblend.brep.topology import ShapeIndex

BOX = cq.Solid.makeBox(3, 2, 1)
OPEN = cq.Shell.makeShell(cq.Solid.makeBox(3, 2, 1, (5, 0, 0)).Faces()[1:])


def kinds(shape: cq.Shape) -> list[str]:
    return [part.ShapeType() for part in shape]


def wrapped(shape: cq.Shape) -> list:
    return [face.wrapped for face in shape.Faces()]


def test_solids_shells_and_loose_faces_are_bodies():
    loose = BOX.moved(cq.Location((0, 9, 0))).Faces()
    inner = cq.Compound.makeCompound([*loose[:2], BOX])
    shape = cq.Compound.makeCompound([OPEN, inner, *loose[2:5]])
    bodies = [cq.Shape.cast(body) for body in list_bodies(shape.wrapped)]
    assert [body.ShapeType() for body in bodies] == ["Solid", "Shell", "Shell", "Shell"]
    assert bodies[0].isSame(BOX)
    assert bodies[1].isSame(OPEN)
    assert [len(body.Faces()) for body in bodies[2:]] == [3, 2]
    assert list_bodies(BOX.Edges()[0].wrapped) == []
    (lone,) = list_bodies(loose[0].wrapped)
    assert len(ShapeIndex(lone, TopAbs_FACE)) == 1


def test_a_shell_knows_whether_it_is_closed():
    assert make_shell(wrapped(BOX)).Closed()
    assert not make_shell(wrapped(BOX)[1:]).Closed()


def test_a_replaced_body_stands_where_it_stood():
    loose = BOX.moved(cq.Location((0, 9, 0))).Faces()[:2]
    shape = cq.Compound.makeCompound([BOX, cq.Compound.makeCompound([BOX.Edges()[0], *loose, OPEN]), OPEN])
    body = next(one for one in list_bodies(shape.wrapped) if len(ShapeIndex(one, TopAbs_FACE)) == 2)
    new = make_shell(wrapped(BOX)[:3])
    changed = cq.Shape.cast(replace_body(shape.wrapped, body, new))
    assert kinds(changed) == ["Solid", "Compound", "Shell"]
    _, inner, _ = changed
    assert kinds(inner) == ["Edge", "Face", "Face", "Face", "Shell"]
    assert [one.isSame(other) for one, other in zip(changed, shape, strict=True)] == [True, False, True]
    assert replace_body(OPEN.wrapped, OPEN.wrapped, new).IsSame(new)
    whole = cq.Shape.cast(replace_body(shape.wrapped, OPEN.wrapped, new))
    assert [len(one.Faces()) for one in whole] == [6, 5, 3]


def test_faces_of_solids_and_of_shells_are_replaced_by_number():
    for body in (BOX, OPEN):
        index = ShapeIndex(body.wrapped, TopAbs_FACE)
        other = cq.Face.makePlane(1, 1).wrapped
        added = cq.Face.makePlane(2, 2).wrapped
        for removed in ((), (4,)):
            changed = cq.Shape.cast(replace_body_faces(body.wrapped, {2: other}, removed, index, [added]))
            assert changed.ShapeType() == body.ShapeType()
            expected = [other if n == 2 else index[n] for n in range(1, len(index) + 1) if n not in removed] + [added]
            assert [face.IsSame(one) for face, one in zip(wrapped(changed), expected, strict=True)].count(False) == 0


def test_bodies_that_a_bridge_joins_become_one_with_their_shells():
    other, hollow = (
        BOX.moved(cq.Location((0, 9, 0))),
        cq.Solid.makeBox(9, 9, 9, (20, 0, 0)).cut(cq.Solid.makeBox(3, 3, 3, (23, 3, 3))),
    )
    solids = [BOX.wrapped, hollow.Solids()[0].wrapped]
    parts = [BOX.Faces()[0].wrapped, max(hollow.Faces(), key=lambda face: face.Area()).wrapped]
    joined = cq.Shape.cast(join_shells(solids, parts))
    assert sorted(len(shell.Faces()) for shell in joined.Shells()) == [6, 12]
    shape = cq.Compound.makeCompound([BOX, OPEN, other])
    result = cq.Shape.cast(replace_bodies(shape.wrapped, [BOX.wrapped, other.wrapped], joined.wrapped))
    assert kinds(result) == ["Solid", "Shell"]
    pair = cq.Compound.makeCompound([BOX, other])
    assert cq.Shape.cast(replace_bodies(pair.wrapped, [BOX.wrapped, other.wrapped], joined.wrapped)).isSame(joined)
