"""The example of Lee, Bedi and Dubey's figures 4 and 5: two Bezier patches, blended in three ways.

Surface 1 is the tower, surface 2 the ground; both are reshaped from reference points. An elliptic relation, a sharp one
(the paper's lambda of 10 is -10 in its equation 2), and one in which the tower grows to three times as much.
"""

import cadquery as cq
import potential_models

import cqblend

primaries = [potential_models.tower(), potential_models.ground()]
RELATIONS = {
    "elliptic": cqblend.Conic(1, 1, 0),
    "sharp": cqblend.Conic(1, 1, -10),
    "a = 3": cqblend.Conic(3, 1, 0),
}


def patch_blend(relation, **options):
    """Blend tower and ground."""
    tower = cqblend.reshape(primaries[0], reference="extents", tuning=(0, -1, 0.5), amounts=0.4)
    ground = cqblend.reshape(primaries[1], reference=(0, 0, -12), amounts=0.06)
    return cqblend.potential_blend(tower, ground, relation, **options)


by_relation = {name: patch_blend(relation, form="exact") for name, relation in RELATIONS.items()}
if __name__ == "__main__":
    for name, blend in by_relation.items():
        print(name)
        print(blend.certificate)

if "show_object" in globals():
    faces = [cqblend.to_face(surface) for surface in (*primaries, by_relation["elliptic"].surface)]
    show_object(cq.Compound.makeCompound(map(cq.Face, faces)), name="blend")  # type: ignore[name-defined]  # noqa: F821
