"""What ``cqblend demo`` shows: one blend, made, certified and written as STEP.

Exists as the first thing that a newcomer runs, and as the shortest example of the library's own use.
"""

from pathlib import Path

from cqblend.front import BlendResult, blend_edges
from cqblend.occ.step import write_step


def run(folder: Path) -> tuple[BlendResult, Path]:
    """Blend an edge of a block, write ``block.step`` into the folder and return the result and the path.

    Raises
    ------
    StepError
        The file cannot be written.
    """
    import cadquery

    block = cadquery.Workplane().box(30, 20, 10)
    result = blend_edges(block, block.edges("|Z and >X and >Y"), radius=4)
    path = folder / "block.step"
    folder.mkdir(parents=True, exist_ok=True)
    write_step(result.shape.wrapped, path)
    return result, path
