"""Draw press.step beside this file: fourteen bodies, a base on four feet, four columns, a top plate
with a ram and its head, a table and the block that is struck.

python examples/press.py && beadwave modes examples/press.toml
"""

import sys
from pathlib import Path

from beadwave.geometry.cad.occ import write_step
from beadwave.geometry.cad.shapes import Box, Cylinder, Slab

LONG, WIDE = 0.3, 0.2  # m
OUTLINE = ((0, 0), (LONG, 0), (LONG, WIDE), (0, WIDE))
CORNERS = ((0.03, 0.03), (0.27, 0.03), (0.03, 0.17), (0.27, 0.17))
MIDDLE = (LONG / 2, WIDE / 2)

SHAPES = {
    "base": Slab(OUTLINE, 0.03),
    **{f"column-{i}": Cylinder(0.012, 0.18, at=(*at, 0.12)) for i, at in enumerate(CORNERS, 1)},
    **{f"foot-{i}": Box((0.04, 0.04, 0.02), at=(*at, -0.01)) for i, at in enumerate(CORNERS, 1)},
    "top": Slab(OUTLINE, 0.025, at=(0, 0, 0.21)),
    "table": Box((0.1, 0.08, 0.02), at=(*MIDDLE, 0.04)),
    "block": Box((0.05, 0.05, 0.04), at=(*MIDDLE, 0.07)),
    "ram": Cylinder(0.02, 0.06, at=(*MIDDLE, 0.18)),
    "head": Cylinder(0.03, 0.03, at=(*MIDDLE, 0.25)),
}

if __name__ == "__main__":
    default = Path(__file__).with_suffix(".step")
    write_step(SHAPES, Path(sys.argv[1]) if sys.argv[1:] else default)
