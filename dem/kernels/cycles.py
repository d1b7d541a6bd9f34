"""Tangential forces of a contact over the last of three cycles of a given motion."""

from dem.kernels.arguments import Array
from dem.kernels.compiled import ieee_entry
from dem.kernels.numbers import smaller
from dem.kernels.tangential import HEAT, STICK, SpringCells, TangentialLaw, cell_force, slide_cells


@ieee_entry
def cycle_forces(
    cells: SpringCells, law: TangentialLaw, overlap: Array, slip: Array, force: Array
) -> tuple[float, float]:
    """Fill force (k, 2) [N] at the k instants of a cycle in which the overlap (k,) [m] and the slip
    (k, 2) [m] return; heat [J] of the cycle and the least share of the area that sticks.

    The contact of open cells is pressed first, then sheared by a cycle whose slip grows from
    nothing, by another, and by the one that counts.
    """
    k = len(overlap)
    slide_cells(cells, law, overlap[0], 1.0, 0.0, 0.0)
    at1, at2, heat, stick = 0.0, 0.0, 0.0, 1.0
    for i in range(1, 3 * k + 1):
        grown = i / k if i < k else 1.0
        to1, to2 = grown * slip[i % k, 0], grown * slip[i % k, 1]
        slide_cells(cells, law, overlap[i % k], 1.0, to1 - at1, to2 - at2)
        at1, at2 = to1, to2
        if i == 2 * k:
            heat = cells.state[HEAT]
        if i > 2 * k:
            stick = smaller(stick, cells.state[STICK])
            force[i % k, 0], force[i % k, 1] = cell_force(cells, law, 0), cell_force(cells, law, 1)
    return cells.state[HEAT] - heat, stick
