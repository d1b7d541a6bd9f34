"""The last sphere across the chain: it moves and turns, an arm holds it, friction acts at the wall.

    m u'' + k u = -T - S,     I psi'' + kappa psi = -R (T - S),
    dU = du + R dpsi - dw at the wall,     du - R dpsi at the sphere before

in each direction along the wall: u of the centre, psi the turn by which the contact's point of the
sphere moves as by u / R, w of the wall. T is the tangential force of the contact at the wall, S
that of the contact with the sphere before, which moves along the chain alone. The march along the
chain gives the overlaps of both: friction leaves that motion alone. Each step is a half kick by T
and S, the exact motion of sphere and arm without them, the new T and S, another half kick: order 2
(Stormer and Verlet), and the error of T's onset as t^(3/2) is of order 5/2.
"""

from typing import NamedTuple

from beadwave.dem.kernels.arguments import Array, Steps
from beadwave.dem.kernels.compiled import ieee, ieee_entry, ieee_march
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

# of `SavedAcross.energy`: [J] of the centre's motion, of the turn's, of the arm, of the contacts'
# springs, friction's heat, work of the wall's motion on the contact
MOVING, TURNING, IN_ARM, IN_CONTACTS, RUBBED, BY_WALL = range(6)


class Sphere(NamedTuple):
    """The sphere and what holds it, in n_directions of 1 or 2; held fast where it is clamped."""

    inverse_mass: Array  # (n_directions,) [1/kg]; 0 where the arm clamps
    inverse_inertia: float  # [1/(kg m^2)]; 0 where the arm clamps
    radius: float  # [m]
    stiffness: Array  # (n_directions,) [N/m] of the arm; 0 where it clamps
    turn_stiffness: float  # [N m/rad] of the arm; 0 where it clamps
    swing: Array  # (4, n_directions) what u and v become in a step, see `oscillators.propagator`
    turn: Array  # (4, 1) the same of psi and its rate


class Pressing(NamedTuple):
    """Overlap of the contact along the chain, at the ends of equal steps."""

    overlap: Array  # (k,) [m]
    rate: Array  # (k,) [m/s]
    bend: Array  # (k,) [m/s^2] its second derivative
    step: float  # [s]
    gamma: float  # [s/m] of Hunt and Crossley's damping


class Across(NamedTuple):
    """The state across the chain, (n_directions,) each, changed in place."""

    u: Array  # [m]
    v: Array  # [m/s]
    psi: Array  # [rad]
    spin: Array  # [rad/s]
    force: Array  # [N] of the contact at the wall, T
    behind: Array  # [N] of the contact with the sphere before, S
    slip: Array  # [m] of the bodies at the contact, U


class Springs(NamedTuple):
    """The contact: a row and a workspace in one direction, cells in two; None for the other."""

    row: SpringRow | None
    room: SpringRow | None
    cells: SpringCells | None


class Touch(NamedTuple):
    """A contact of the sphere."""

    law: TangentialLaw
    pressing: Pressing
    springs: Springs


class SavedAcross(NamedTuple):
    """States at k saves."""

    u: Array  # (k, n_directions), as those below
    v: Array
    psi: Array
    spin: Array
    force: Array
    slip: Array
    stick: Array  # (k,) share of the contact's area
    energy: Array  # (k, 6) [J] MOVING to BY_WALL


@ieee
def pressed(t: float, pressing: Pressing) -> tuple[float, float]:
    """Overlap [m] at t [s] and the total pressure over the elastic one, 1 + gamma d' and at least
    0: the polynomial of degree 5 that agrees with value, slope and bend at both ends of a step; it
    errs by h^6 d^(6) / 46080 at the most, to leading order."""
    d, r, b, h = pressing.overlap, pressing.rate, pressing.bend, pressing.step
    k = min(int(t / h), d.size - 2)
    s = t / h - k
    p = 1.0 - s
    p3, s3 = p * p * p, s * s * s
    overlap = p3 * ((1.0 + s * (3.0 + 6.0 * s)) * d[k] + s * (1.0 + 3.0 * s) * h * r[k])
    overlap += s3 * ((1.0 + p * (3.0 + 6.0 * p)) * d[k + 1] - p * (1.0 + 3.0 * p) * h * r[k + 1])
    overlap += 0.5 * h * h * s * s * p * p * (p * b[k] + s * b[k + 1])
    if pressing.gamma == 0.0:
        return overlap, 1.0
    rate = 30.0 * s * s * p * p * (d[k + 1] - d[k]) / h
    rate += p * p * (1.0 + s * (2.0 - 15.0 * s)) * r[k]
    rate += s * s * (1.0 + p * (2.0 - 15.0 * p)) * r[k + 1]
    rate += 0.5 * h * s * p * (p * (2.0 - 5.0 * s) * b[k] - s * (2.0 - 5.0 * p) * b[k + 1])
    return overlap, larger(1.0 + pressing.gamma * rate, 0.0)


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


@ieee_march
def march_across(
    state: Across, sphere: Sphere, contact: Touch, before: Touch | None, wall: Array | None,
    steps: Steps, saved: SavedAcross,
) -> int:  # fmt: skip
    """March the sphere across the chain; changes the state and the springs.

    `before` is the contact with the sphere before, None without friction there; `wall`
    (n_steps + 1, n_directions) [m] is the wall's displacement at the ends of the steps, None at
    rest. Ends early, and says after how many saves, where a state is not finite.

    The work of the wall's motion is that of the mean of the forces before and after a step: of
    order 2, as the march.
    """
    h, n_save, stride = steps
    u, v, psi, spin, force, behind, slip = state
    law, pressing, springs = contact
    n, R, work = u.size, sphere.radius, 0.0
    for k in range(n_save + 1):
        for i in range(stride if k > 0 else 0):
            step = (k - 1) * stride + i
            way1, way2, back1, back2 = 0.0, 0.0, 0.0, 0.0
            for j in range(n):
                # half a kick, then sphere and arm move without the contact's force
                w = v[j] - 0.5 * h * sphere.inverse_mass[j] * (force[j] + behind[j])
                turning = spin[j] - 0.5 * h * sphere.inverse_inertia * R * (force[j] - behind[j])
                start, back = u[j] + R * psi[j], u[j] - R * psi[j]
                swing, turn = sphere.swing, sphere.turn
                v[j] = swing[2, j] * u[j] + swing[3, j] * w
                u[j] = swing[0, j] * u[j] + swing[1, j] * w
                spin[j] = turn[2, 0] * psi[j] + turn[3, 0] * turning
                psi[j] = turn[0, 0] * psi[j] + turn[1, 0] * turning
                way, back = u[j] + R * psi[j] - start, u[j] - R * psi[j] - back
                if wall is not None:
                    moved = wall[step + 1, j] - wall[step, j]
                    way -= moved
                    work -= 0.5 * moved * force[j]
                slip[j] += way
                way1, way2 = (way, 0.0) if j == 0 else (way1, way)
                back1, back2 = (back, 0.0) if j == 0 else (back1, back)

            # the contacts at the end of the step, and the other half of the kick
            d, q = pressed((step + 1) * h, pressing)
            press(law, d, q, (way1, way2), force, springs.row, springs.room, springs.cells)
            if before is not None:
                d, q = pressed((step + 1) * h, before.pressing)
                row, room, cells = before.springs
                press(before.law, d, q, (back1, back2), behind, row, room, cells)
            for j in range(n):
                v[j] -= 0.5 * h * sphere.inverse_mass[j] * (force[j] + behind[j])
                spin[j] -= 0.5 * h * sphere.inverse_inertia * R * (force[j] - behind[j])
                if wall is not None:
                    work -= 0.5 * (wall[step + 1, j] - wall[step, j]) * force[j]

        # the first save comes before any step: contacts take the overlap of the start, unshifted
        if k == 0:
            d, q = pressed(0.0, pressing)
            press(law, d, q, (0.0, 0.0), force, springs.row, springs.room, springs.cells)
            if before is not None:
                d, q = pressed(0.0, before.pressing)
                row, room, cells = before.springs
                press(before.law, d, q, (0.0, 0.0), behind, row, room, cells)

        # states and energies
        energy = saved.energy[k]
        energy[MOVING], energy[TURNING], energy[IN_ARM] = 0.0, 0.0, 0.0
        for j in range(n):
            saved.u[k, j], saved.v[k, j] = u[j], v[j]
            saved.psi[k, j], saved.spin[k, j] = psi[j], spin[j]
            saved.force[k, j], saved.slip[k, j] = force[j], slip[j]
            if sphere.inverse_mass[j] > 0.0:
                energy[MOVING] += 0.5 * v[j] * v[j] / sphere.inverse_mass[j]
            if sphere.inverse_inertia > 0.0:
                energy[TURNING] += 0.5 * spin[j] * spin[j] / sphere.inverse_inertia
            energy[IN_ARM] += 0.5 * sphere.stiffness[j] * u[j] * u[j]
            energy[IN_ARM] += 0.5 * sphere.turn_stiffness * psi[j] * psi[j]
        stick, energy[IN_CONTACTS], energy[RUBBED] = contact_state(law, springs.row, springs.cells)
        if before is not None:
            _, stored, heat = contact_state(before.law, before.springs.row, before.springs.cells)
            energy[IN_CONTACTS] += stored
            energy[RUBBED] += heat
        energy[BY_WALL] = work
        saved.stick[k] = stick
        everything = energy[MOVING] + energy[TURNING] + energy[IN_ARM] + energy[IN_CONTACTS]
        if not abs(everything + energy[RUBBED]) <= 1e300:
            return k
    return n_save


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
