"""The worker process of :mod:`cqblend.patterns.stock.spyrrow_packing`: packs polygons, read as JSON, by spyrrow.

Input: ``{"height": mm, "seconds": s, "items": [{"shape": [[x, y], ..], "angles": [degrees, ..]}, ..]}``. Output:
``[[degrees, x, y], ..]``, turned about the origin, then shifted. Does not import cqblend, which it may not find.
"""

import json
import sys


def main() -> None:
    """Read the task from the input, pack its items, and write their placements."""
    import spyrrow

    task = json.load(sys.stdin)
    items = [
        spyrrow.Item(str(k), [tuple(point) for point in one["shape"]], 1, one["angles"])
        for k, one in enumerate(task["items"])
    ]
    instance = spyrrow.StripPackingInstance("", task["height"], items)
    solution = instance.solve(spyrrow.StripPackingConfig(total_computation_time=task["seconds"], seed=0))
    places = {int(item.id): [item.rotation, *item.translation] for item in solution.placed_items}
    json.dump([places[k] for k in range(len(items))], sys.stdout)


if __name__ == "__main__":
    main()
