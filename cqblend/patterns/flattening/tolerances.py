"""Tolerances and limits of laying strips flat."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FlatteningTolerances:
    """Tolerances and limits of laying strips flat.

    Attributes
    ----------
    node_merge
        Relative to the domain of the rails: nodes closer together are one.
    stationary_step
        Relative to the length of a rail: shorter steps between nodes are rounding of a rail that does not move.
    zero_ruling
        Relative to the longest ruling: shorter rulings have no relative error.
    opposed_velocities
        Relative to the squared velocities of both rails across a ruling: a scalar product of the two below minus this
        means that rulings meet between the rails.
    behind_apex
        Relative to the farthest point of a cone from its apex: rails farther beyond the apex than this cross it.
    point_on_strip
        Relative to the size of the flat strip: a point that is closer to a ruling than this lies on the strip.
    root_residual
        Relative to the squared size of the flat strip: cross product at which a point counts as on a ruling.
    max_segments
        Segments along a rail at most.
    longest_arc_chord
        An arc whose chord is less than this part of its length is split, if it is longer than the tolerance.
    max_depth
        How often a strip is divided again because of its strain, at most.
    max_depth_right_angle
        The same where its normal turns by a right angle along a ruling.
    strain_margin
        Factor on the strain when the number of narrower strips is estimated from it.
    block_size
        Points that are compared with all rulings or triangles at once, to limit memory.
    sampling_margin
        Factor on a sampled deviation, for what lies between the samples.
    """

    node_merge: float = 1e-12
    stationary_step: float = 1e-14
    zero_ruling: float = 1e-12
    opposed_velocities: float = 1e-9
    behind_apex: float = 1e-9
    point_on_strip: float = 1e-9
    root_residual: float = 1e-15
    max_segments: int = 20_000
    longest_arc_chord: float = 0.9
    max_depth: int = 4
    max_depth_right_angle: int = 8
    strain_margin: float = 1.1
    block_size: int = 512
    sampling_margin: float = 1.05


FLATTENING_TOLERANCES = FlatteningTolerances()
