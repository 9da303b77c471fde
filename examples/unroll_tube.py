"""A bent tube with tabs (Elber 1995, figures 2 and 6): rings around it, cut to sheets of paper.

Rings are wanted, whatever needs the fewest strips: they are assembled one after the other.
"""

import cadquery as cq
import unroll_models


def written(pattern):
    """Print the report, and write the pieces with tabs to glue them by, on sheets of A3."""
    print(pattern.report)
    pattern = pattern.with_tabs(8)
    print("no room for tabs:", ", ".join(pattern.tabs.missing) or "nowhere")
    pattern.export("tube.pdf", sheet=(400, 277), page="a3")
    pattern.export("tube.svg")


flat = cq.Workplane(unroll_models.tube()).unroll(0.7, direction="rings", report=written)

if "show_object" in globals():
    show_object(flat, name="tube")  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
