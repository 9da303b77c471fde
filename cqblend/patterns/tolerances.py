"""Tolerances and limits of unrolling pieces and of judging divisions."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AssemblyTolerances:
    """Tolerances and limits of assembling pieces and of judging them.

    Attributes
    ----------
    most_bow
        Largest ratio of length to chord to which a segment of a border is bent: that of an arc of 86 degrees. The
        vertices along edges are closer than that.
    most_rounds
        Largest number of rounds in which vertices are added to edges.
    dividing_share
        Share of the division of faces in the progress of the work.
    area_mismatch
        Relative: by how much the area of the pieces of a thin face may differ from that of the face.
    thin_face
        A face is thin if its mean width (twice its area over the length of its borders) is below this many tolerances.
    edge_excess
        Relative: by how much an edge may be longer than the ends of the strips along it.
    refinement_margin
        Factor on the refinement by which a mismatch is expected to disappear.
    same_vertex
        Relative to the parameter range of an edge: segments between vertices that are closer are not divided.
    """

    most_bow: float = 1.1
    most_rounds: int = 6
    dividing_share: float = 0.6
    area_mismatch: float = 0.02
    thin_face: float = 4.0
    edge_excess: float = 0.02
    refinement_margin: float = 1.1
    same_vertex: float = 1e-6


ASSEMBLY_TOLERANCES = AssemblyTolerances()
