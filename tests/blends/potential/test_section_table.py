"""Tables of sections against the sections themselves, and how many of these they take."""

import numpy as np
import pytest

from cqblend.blends.potential.section_table import SectionTable

V = np.linspace(0, 1, 5)
T = np.random.default_rng(3).random(3000)
NO_KINKS = np.empty(0)


def wave(t):
    """Sections that go around once."""
    angle = 2 * np.pi * np.asarray(t)[:, None]
    return np.stack([np.cos(angle + V), np.sin(angle) * (1 + V), np.exp(np.cos(angle - V))], axis=-1)


def bent(t):
    """The same, with a curvature that jumps along a slanted line."""
    past = np.maximum(np.asarray(t)[:, None] - 0.4 - 0.01 * V, 0)
    return wave(t) + past[..., None] ** 2


def torn(t):
    """The same, with a jump."""
    return wave(t) + (np.asarray(t)[:, None, None] > 0.377)


class Counted:
    def __init__(self, sections):
        self.sections, self.solved = sections, []

    def __call__(self, t):
        self.solved.append(t)
        return self.sections(t)

    @property
    def count(self):
        return sum(map(len, self.solved))


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7])
@pytest.mark.parametrize(
    ("sections", "closed", "most"), [(wave, True, 300), (wave, False, 300), (bent, False, 600), (torn, False, 700)]
)
def test_sections_are_within_the_tolerance(sections, closed, most, tolerance):
    exact = Counted(sections)
    table = SectionTable(exact, (0.0, 1.0), closed, tolerance, NO_KINKS)
    assert np.abs(table(T) - sections(T)).max() <= tolerance
    assert exact.count <= most


def test_a_table_is_made_once():
    exact = Counted(wave)
    table = SectionTable(exact, (0.0, 1.0), True, 1e-6, NO_KINKS)
    table(T)
    count = exact.count
    table(T[:1000])
    assert exact.count == count


def test_few_sections_are_exact():
    exact = Counted(wave)
    table = SectionTable(exact, (0.0, 1.0), True, 1e-3, NO_KINKS)
    assert np.array_equal(table(T[:7]), wave(T[:7]))
    assert exact.count == 7


def test_closed_sections_have_no_ends():
    """At the seam a closed table takes no more than elsewhere, an open one does."""
    counts = []
    for closed in (True, False):
        exact = Counted(wave)
        SectionTable(exact, (0.0, 1.0), closed, 1e-8, NO_KINKS)(T)
        counts.append(sum(int(((t < 0.02) | (t > 0.98)).sum()) for t in exact.solved))
    assert counts[0] < counts[1]


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("at", [(0.16506,), (0.0, 0.331, 0.9), (0.5, 0.502)])
def test_nothing_is_interpolated_across_known_kinks(at, closed):
    """Curvature jumps by 200 there, and slopes at the seam; a table that knows of none takes more sections and errs."""

    def kinked(t):
        inside = np.array([at_kink for at_kink in at if at_kink > 0])
        past = np.maximum(t[:, None] - inside, 0.0)
        bend = 100 * (past**2 * (1 - t[:, None])).sum(axis=1)
        return wave(t) + bend[:, None, None]

    kinks = np.array(sorted({*at, 0.0})) if closed else np.array([k for k in at if k > 0])
    exact = Counted(kinked)
    table = SectionTable(exact, (0.0, 1.0), closed, 1e-7, kinks)
    near = np.clip(np.add.outer(kinks, np.linspace(-2e-3, 2e-3, 41)).ravel(), 0.0, 1.0)
    t = np.concatenate([T, near])
    assert np.abs(table(t) - kinked(t)).max() <= 1e-7
    assert exact.count <= 300
