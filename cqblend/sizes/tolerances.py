"""Limits of the check, the continuation and the joining of sizes that vary."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LawTolerances:
    """Limits of the check and the continuation of laws.

    Attributes
    ----------
    samples, irregular_samples
        Parameters at which a law is looked at: equally spaced intervals, and others that share no period with these.
    least_jump
        Share of the largest size: a difference that stays above it, however near the parameters, is a jump.
    jump_halvings
        Halvings of an interval in search for a jump.
    least_kink
        Share of the steepest slope: a change of slope that stays above it, however near the parameters, is a corner.
    kink_halvings
        Halvings of an interval in search for a corner: of more, rounding would be seen.
    same_size
        Relative difference up to which two sizes are the same.
    slope_step
        Step of the one-sided differences that tell the slope at an end; a power of 2.
    least_continued
        Share of the size at an end, to which the size may fall linearly past it.
    least_solved
        Share of the largest size: contacts are not solved for where a size that goes to 0 is below it.
    """

    samples: int = 256
    irregular_samples: int = 61
    least_jump: float = 1e-6
    jump_halvings: int = 45
    least_kink: float = 1e-3
    kink_halvings: int = 18
    same_size: float = 1e-9
    slope_step: float = 2.0**-10
    least_continued: float = 0.5
    least_solved: float = 1e-3


LAW_TOLERANCES = LawTolerances()
