"""The last sphere across the chain, and its contact moved on: a row of springs in one direction,
cells in two."""

from typing import NamedTuple

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.compiled import ieee, ieee_entry
from beadwave.dem.kernels.numbers import larger
from beadwave.dem.kernels.tangential import (
    HEAT,
    STICK,
    SpringCells,
    SpringRow,
    TangentialLaw,
    cell_energy,
    cell_force,
    slide,
    slide_cells,
    stored_energy,
    tangential_force,
)


class Sphere(NamedTuple):
    """The sphere and what holds it, in n_directions of 1 or 2; held fast where it is clamped."""

    inverse_mass: Array  # (n_directions,) [1/kg]; 0 where the arm clamps
    inverse_inertia: float  # [1/(kg m^2)]; 0 where the arm clamps
    radius: float  # [m]
    stiffness: Array  # (n_directions,) [N/m] of the arm; 0 where it clamps
    turn_stiffness: float  # [N m/rad] of the arm; 0 where it clamps
    swing: Array  # (4, n_directions) what u and v become in a step, see `oscillators.propagator`
    turn: Array  # (4, 1) the same of psi and its rate


class Springs(NamedTuple):
    """The contact: a row and a workspace in one direction, cells in two; None for the other."""

    row: SpringRow | None
    room: SpringRow | None
    cells: SpringCells | None


@ieee
def press(
    law: TangentialLaw, d: float, q: float, way: tuple[float, float], force: Array,
    row: SpringRow | None, room: SpringRow | None, cells: SpringCells | None,
) -> None:  # fmt: skip
    """Move the contact on to the overlap d [m] and the total over the elastic pressure q, while its
    bodies shift by `way` [m] in both directions; its force (n_directions,) [N] with it."""
    shift(law, d, q, way, row, room, cells)
    contact_force(law, force, row, cells)


@ieee
def shift(
    law: TangentialLaw, d: float, q: float, way: tuple[float, float],
    row: SpringRow | None, room: SpringRow | None, cells: SpringCells | None,
) -> None:  # fmt: skip
    """`press` without the force."""
    if row is not None:
        slide(row, room, law, d, q, way[0])
    if cells is not None:
        slide_cells(cells, law, d, q, way[0], way[1])


@ieee
def contact_force(
    law: TangentialLaw, force: Array, row: SpringRow | None, cells: SpringCells | None
) -> None:
    """Fill in the force (n_directions,) [N] of the springs."""
    if row is not None:
        force[0] = tangential_force(row, law)
    if cells is not None:
        force[0], force[1] = cell_force(cells, law)


@ieee
def stick_and_heat(row: SpringRow | None, cells: SpringCells | None) -> tuple[float, float]:
    """Share of the area that sticks, friction's heat so far [J]."""
    stick, heat = 0.0, 0.0
    if row is not None:
        stick, heat = row.state[STICK], row.state[HEAT]
    if cells is not None:
        stick, heat = cells.state[STICK], cells.state[HEAT]
    return stick, heat


@ieee
def contact_state(
    law: TangentialLaw, row: SpringRow | None, cells: SpringCells | None
) -> tuple[float, float, float]:
    """Share of the area that sticks, stored energy [J], friction's heat so far [J]."""
    stored, (stick, heat) = 0.0, stick_and_heat(row, cells)
    if row is not None:
        stored = stored_energy(row, law)
    if cells is not None:
        stored = cell_energy(cells, law)
    return stick, stored, heat


@ieee_entry
def press_round(
    law: TangentialLaw, laps: int, path: Array, springs: Springs, slip: Array, force: Array,
    stick: Array,
) -> tuple[float, float]:  # fmt: skip
    """Lead a contact from the shift `slip` (n_directions,) [m] `laps` times round a closed path
    (k, 2 + n_directions) of overlaps [m], total over elastic pressures, and shifts [m]: friction's
    heat [J] of the last round, and the largest change of the force [N] over it.

    Changes the springs and `slip`, which end where the path begins, and fills in force
    (k, n_directions) and share of the area that sticks (k,) of the last round.
    """
    row, room, cells = springs
    n, k = force.shape[1], path.shape[0]
    heat_before, heat, change, before1, before2 = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(laps * k + 1):
        j = i % k
        way2 = path[j, 3] - slip[1] if n == 2 else 0.0
        shift(law, path[j, 0], path[j, 1], (path[j, 2] - slip[0], way2), row, room, cells)
        for m in range(n):
            slip[m] = path[j, 2 + m]
        stick[j], heat = stick_and_heat(row, cells)
        if i >= (laps - 1) * k:
            contact_force(law, force[j], row, cells)
        if i == (laps - 1) * k:
            heat_before, before1 = heat, force[0, 0]
            before2 = force[0, 1] if n == 2 else 0.0
    change = abs(force[0, 0] - before1)
    if n == 2:
        change = larger(change, abs(force[0, 1] - before2))
    return heat - heat_before, change
