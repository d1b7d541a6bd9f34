"""A chain, its last sphere across it, and a wall of modes in three directions, marched together.

    m_i x_i'' = f_{i-1} - f_i + load_i - k_i (x_i - rest_i)                along n, into the wall
    m u'' + k u = -T - S,     I psi'' + kappa psi = -R (T - S)             across, along t1 (and t2)
    q'' + 2 zeta omega q' + omega^2 q = phi F + Re(B e^(i w t)),            F = (N, T)
    U = phi^T q + S F + Re(L e^(i w t))

F acts between the last sphere and the wall: N = A d^(3/2) of the overlap d = x_n - U_n, and T of
the springs of `tangential` under the shift dU = d(u + R psi - U_t). S is that of the contact with
the sphere before, which stays on the chain's line, under d(u - R psi); 0 without friction there.
Force and motion of the residual compliance are found together, by Broyden's method from the tangent
of a contact that sticks (C. G. Broyden, Math. Comput. 19 (1965) 577). A step of h is

    half a kick by T, half a kick by the normal forces, their dampers;
    spheres, arm and modes move exactly without contact forces, the modes under their shakers;
    new forces;  dampers, half a kick by the normal forces, half a kick by T

of order 2, symmetric in time but for the contact's memory. What the shakers do on the modes and
what these lose are exact over each step.
"""

import math
from typing import NamedTuple

from beadwave.dem.kernels.arguments import Array, Steps
from beadwave.dem.kernels.compiled import fastmath, ieee, ieee_entry, ieee_march
from beadwave.dem.kernels.lateral import Sphere, contact_state, press
from beadwave.dem.kernels.laws import damping_impulse, hertz_force
from beadwave.dem.kernels.numbers import larger
from beadwave.dem.kernels.shaking import ModalShakerForces, shake
from beadwave.dem.kernels.tangential import (
    SpringCells,
    SpringRow,
    TangentialLaw,
    copy_cells,
)

# of `SavedSpatial.energy`: [J] in Hertz' contacts, in the tangential contact's springs, friction's
# heat, in the modes about rest; the four of the ledger; a number that is finite where the state is
HERTZ, SPRINGS, RUBBED, SWING, DAMPED, BY_CONTACT, BY_SHAKERS, BEYOND_MODES, FINITE = range(9)
# of `SpatialMotion.ledger`: [J] lost in the contacts' dampers, work of the contact on the modes,
# work of the shakers on the modes, and on the motion L f of the contact
IN_DAMPERS, ON_MODES, SHAKEN, SHAKEN_BEYOND = range(4)
ITERATIONS = 60  # for the force on a residual compliance; some six are usual
ROUNDING = 1e-12  # of the force, to which it is found


class SpatialMotion(NamedTuple):
    """The moving state, changed in place; across there are n_directions, 1 or 2."""

    x: Array  # (n,) [m]
    v: Array  # (n,) [m/s]
    u: Array  # (n_directions,) [m] of the last sphere across
    u_v: Array  # (n_directions,) [m/s]
    psi: Array  # (n_directions,) [rad] by which its contact point moves as by u / R
    spin: Array  # (n_directions,) [rad/s]
    q: Array  # (k,) [kg^1/2 m] from rest
    p: Array  # (k,)
    f: Array  # (n + 1,) [N] elastic forces: f[0] = 0, f[i] before sphere i + 1, f[n] at the wall
    force: Array  # (1 + n_directions,) [N] on the wall along n, t1, t2, without dampers
    slip: Array  # (n_directions,) [m] of the bodies at the contact
    pending: Array  # (1 + n_directions,) [N s] impulse that the modes have not got yet
    wall: Array  # (2, 1 + n_directions) phi^T q, phi^T p, the pending impulse included
    ledger: Array  # (4,) [J]
    behind: Array  # (n_directions,) [N] of the contact with the sphere before, on the last one
    rolled: Array  # (n_directions,) [m] u - R psi at which these forces were computed


class SpatialArrays(NamedTuple):
    """Arrays of chain and wall that the march reads."""

    inverse_mass: Array  # (n,) [1/kg]; 0 of a sphere that is held
    A: Array  # (n,) [N/m^1.5]; 0 where a contact is left out
    gamma: Array  # (n,) [s/m] of Hunt and Crossley's damping
    load: Array  # (n,) [N] balances the contact forces at rest
    rest: Array  # (n,) [m]
    swing: Array  # (4, n) what x - rest and v become in a step, see `oscillators.propagator`
    offset: float  # [m] normal displacement of the modes at rest
    rest_force: float  # [N] normal, at rest
    omega: Array  # (k,) [rad/s]
    phi: Array  # (1 + n_directions, k)
    square: Array  # (1 + n_directions, 1 + n_directions) phi^T phi, velocity after unit impulse
    propagator: Array  # (4, k) of the modes
    residual: Array  # (1 + n_directions, 1 + n_directions) S [m/N]
    soft: bool  # whether S is anything


class FrictionalContact(NamedTuple):
    """The frictional contact: a row in one direction, cells in two, and as much room for trials;
    and that with the sphere before, where there is friction."""

    row: SpringRow | None
    room: SpringRow | None
    cells: SpringCells | None
    trial_row: SpringRow | None
    trial_cells: SpringCells | None
    before_row: SpringRow | None = None  # of the contact with the sphere before
    before_cells: SpringCells | None = None

    def copied(self) -> "FrictionalContact":
        """A copy in arrays of its own."""
        parts = (
            None if part is None else type(part)(*(values.copy() for values in part))
            for part in self
        )
        return FrictionalContact(*parts)


class Trials(NamedTuple):
    """Room for Broyden's method in d = 1 + n_directions unknowns."""

    force: Array  # (d,) forces tried
    answer: Array  # (d,) forces that the contact answers
    residual: Array  # (d,) their difference
    step: Array  # (d,) from forces tried to the next
    shift: Array  # (d,) overlap of the contact and shift of its surfaces
    jacobian: Array  # (d, d)
    solved: Array  # (d, d) room of the elimination
    gap: Array  # (d,) approach and shift of the bodies, the residual motion included
    motion: Array  # (d,) [m] of the contact by L
    motion_rate: Array  # (d,) [m/s] of it
    motion_before: Array  # (d,) the same a step ago
    force_before: Array  # (d,) forces a step ago
    change: Array  # (d,) of the forces in the last step


class SpatialSystem(NamedTuple):
    """Chain, last sphere, contact, wall and shakers for marches by equal steps."""

    arrays: SpatialArrays
    sphere: Sphere
    law: TangentialLaw
    shaking: ModalShakerForces
    trials: Trials
    law_before: TangentialLaw | None = None  # of the contact with the sphere before


class SavedSpatial(NamedTuple):
    """States at k saves."""

    x: Array  # (k, n)
    v: Array  # (k, n)
    contact_force: Array  # (k, n), dampers included
    across: Array  # (k, 4, n_directions) u, its velocity, psi, spin
    force: Array  # (k, 1 + n_directions), without dampers
    slip: Array  # (k, n_directions)
    wall: Array  # (k, 2, 1 + n_directions) displacement and velocity of the modes at the contact
    stick: Array  # (k,) share of the area
    motion: Array  # (k, 1 + n_directions) [m] of the contact by L
    energy: Array  # (k, 9) [J] HERTZ to FINITE
    q: Array  # (k, n_modes) or (k, 0)
    p: Array  # (k, n_modes) or (k, 0)


# --- wall ----------------------------------------------------------------------------------------


@ieee
def push(i: int, impulse: float, motion: SpatialMotion, square: Array) -> None:
    """An impulse [N s] on the wall along direction i, and its work; square (d, d) [1/kg] with
    d = 1 + n_directions. Velocities of all directions change: modes couple them."""
    velocity, work = motion.wall[1], impulse * (motion.wall[1, i] + 0.5 * square[i, i] * impulse)
    motion.ledger[ON_MODES] += work
    for j in range(velocity.size):
        velocity[j] += square[i, j] * impulse
    motion.pending[i] += impulse


@fastmath
def give_pending(motion: SpatialMotion, phi: Array) -> None:
    """The modes get the pending impulse, phi (d, k) of d = 1 + n_directions; the wall's velocity
    has it already."""
    p, pending = motion.p, motion.pending
    for i in range(pending.size):
        impulse = pending[i]
        for j in range(p.size):
            p[j] += phi[i, j] * impulse
        pending[i] = 0.0


@fastmath
def drift_wall(motion: SpatialMotion, arrays: SpatialArrays, forced: Array) -> None:
    """Exact motion of the modes over a step, what shakers add (`forced`, (2, k)) included, and the
    wall's at the contact."""
    q, p, wall, phi = motion.q, motion.p, motion.wall, arrays.phi
    qq, qp, pq, pp = (
        arrays.propagator[0], arrays.propagator[1], arrays.propagator[2], arrays.propagator[3]
    )  # fmt: skip
    for j in range(q.size):
        q_old, p_old = q[j], p[j]
        q[j] = qq[j] * q_old + qp[j] * p_old + forced[0, j]
        p[j] = pq[j] * q_old + pp[j] * p_old + forced[1, j]
    for i in range(phi.shape[0]):
        u, v = 0.0, 0.0
        for j in range(q.size):
            u += phi[i, j] * q[j]
            v += phi[i, j] * p[j]
        wall[0, i], wall[1, i] = u, v


# --- contact -------------------------------------------------------------------------------------


@ieee
def solve(matrix: Array, room: Array, right: Array, x: Array) -> None:
    """x (d,) of matrix x = right, by elimination with pivots; `matrix` stays."""
    d = right.size
    for i in range(d):
        x[i] = right[i]
        for j in range(d):
            room[i, j] = matrix[i, j]
    for i in range(d):
        pivot = i
        for k in range(i + 1, d):
            if abs(room[k, i]) > abs(room[pivot, i]):
                pivot = k
        x[i], x[pivot] = x[pivot], x[i]
        for j in range(d):
            room[i, j], room[pivot, j] = room[pivot, j], room[i, j]
        for k in range(i + 1, d):
            factor = room[k, i] / room[i, i]
            x[k] -= factor * x[i]
            for j in range(i, d):
                room[k, j] -= factor * room[i, j]
    for i in range(d - 1, -1, -1):
        for j in range(i + 1, d):
            x[i] -= room[i, j] * x[j]
        x[i] /= room[i, i]


@ieee
def copy_springs(
    law: TangentialLaw, row: SpringRow | None, cells: SpringCells | None,
    to_row: SpringRow | None, to_cells: SpringCells | None,
) -> None:  # fmt: skip
    """The contact's springs into others."""
    if row is not None:
        for j in range(row.count[0]):
            to_row.xi[j], to_row.u[j] = row.xi[j], row.u[j]
        to_row.count[0] = row.count[0]
        for j in range(row.state.size):
            to_row.state[j] = row.state[j]
    if cells is not None:
        copy_cells(cells, to_cells, law)


@ieee
def touch(
    pressure: float, motion: SpatialMotion, system: SpatialSystem, contacts: FrictionalContact
) -> None:
    """Forces of the contact at the bodies' positions `trials.gap`, and the springs there, in place;
    `pressure` is the total one over the elastic one. NaN where no force is found."""
    arrays, law, trials = system.arrays, system.law, system.trials
    gap, force, slip, S = trials.gap, motion.force, motion.slip, arrays.residual
    n, A = slip.size, arrays.A[arrays.A.size - 1]
    d = force.size
    G, answer, R, J = trials.force, trials.answer, trials.residual, trials.jacobian
    if not arrays.soft:
        overlap = larger(gap[0], 0.0)
        force[0] = hertz_force(overlap, A)
        way1 = gap[1] - slip[0]
        way2 = gap[2] - slip[1] if n == 2 else 0.0
        way = (way1, way2)
        press(law, overlap, pressure, way, answer, contacts.row, contacts.room, contacts.cells)
        for j in range(n):
            force[1 + j], slip[j] = answer[j], gap[1 + j]
        return

    # forces G on S leave a gap to which the contact answers: from the last forces, continued, on
    for i in range(d):
        G[i] = force[i] + trials.change[i]
    for iteration in range(ITERATIONS):
        for i in range(d):
            trials.shift[i] = gap[i] - S[i, 0] * (G[0] - (arrays.rest_force if i > 0 else 0.0))
            for j in range(n):
                trials.shift[i] -= S[i, 1 + j] * G[1 + j]
        overlap = larger(trials.shift[0], 0.0)
        way1 = trials.shift[1] - slip[0]
        way2 = trials.shift[2] - slip[1] if n == 2 else 0.0
        copy_springs(law, contacts.row, contacts.cells, contacts.trial_row, contacts.trial_cells)
        press(
            law, overlap, pressure, (way1, way2), answer, contacts.trial_row, contacts.room,
            contacts.trial_cells,
        )  # fmt: skip
        for j in range(n, 0, -1):
            answer[j] = answer[j - 1]
        answer[0] = hertz_force(overlap, A)
        size, off = 0.0, 0.0
        for i in range(d):
            R[i] = answer[i] - G[i]
            size += abs(answer[i]) + abs(G[i])
            off += abs(R[i])
        if off <= ROUNDING * size:
            break
        if iteration == ITERATIONS - 1 or not off <= 1e300:
            answer[0] = math.nan

        # J = -(1 + K S) of the contact that sticks, then Broyden's updates from step to step
        # after 15 iterations the tangent is that of stick again
        if J[0, 0] == 0.0 or iteration == 15:
            a = math.sqrt(law.radius * overlap)
            k_n, k_t = 1.5 * A * math.sqrt(overlap), 2.0 * a * law.modulus
            for i in range(d):
                for j in range(d):
                    J[i, j] = -(k_n if i == 0 else k_t) * S[i, j]
                J[i, i] -= 1.0
        elif iteration > 0:
            # the difference that a step of J would have left is 0: what is left corrects J
            length = 0.0
            for i in range(d):
                length += trials.step[i] * trials.step[i]
            for i in range(d):
                for j in range(d):
                    J[i, j] += R[i] * trials.step[j] / length
        solve(J, trials.solved, R, trials.step)
        for i in range(d):
            trials.step[i] = 0.0 - trials.step[i]
            G[i] += trials.step[i]

    copy_springs(law, contacts.trial_row, contacts.trial_cells, contacts.row, contacts.cells)
    for i in range(d):
        force[i] = answer[i]
    for j in range(n):
        slip[j] = trials.shift[1 + j]


@ieee
def approach(t: float, motion: SpatialMotion, system: SpatialSystem) -> None:
    """Overlap of the bodies at the contact and their shift, without S F, into `trials.gap`."""
    arrays, shaking, radius = system.arrays, system.shaking, system.sphere.radius
    trials, last = system.trials, motion.x.size - 1
    gap, moved, rate = trials.gap, trials.motion, trials.motion_rate
    for i in range(gap.size):
        moved[i], rate[i] = 0.0, 0.0
    for g in range(shaking.omega.size):
        c, s = math.cos(shaking.omega[g] * t), math.sin(shaking.omega[g] * t)
        for i in range(gap.size):
            moved[i] += shaking.residual[g, 0, i] * c - shaking.residual[g, 1, i] * s
            turned = shaking.residual[g, 0, i] * s + shaking.residual[g, 1, i] * c
            rate[i] -= shaking.omega[g] * turned
    gap[0] = motion.x[last] - arrays.offset - motion.wall[0, 0] - moved[0]
    for j in range(motion.u.size):
        gap[1 + j] = motion.u[j] + radius * motion.psi[j] - motion.wall[0, 1 + j] - moved[1 + j]


@ieee
def damp(
    i: int, h: float, motion: SpatialMotion, arrays: SpatialArrays, motion_rate: float
) -> None:
    """Impulse of the damper of contact i over a time h [s] at fixed positions, exact; `motion_rate`
    [m/s] of the wall by L, against which the shakers work. Contacts that share a sphere do not
    commute: the march takes them from the striker to the wall and, after the drift, back."""
    v, minv, n = motion.v, arrays.inverse_mass, motion.v.size
    force, gamma = motion.f[i + 1], arrays.gamma[i]
    if gamma == 0.0 or force <= 0.0:
        return
    w = v[i] - (v[i + 1] if i < n - 1 else motion.wall[1, 0] + motion_rate)
    mobility = minv[i] + (minv[i + 1] if i < n - 1 else arrays.square[0, 0])
    if mobility == 0.0:
        return
    c = gamma * force
    if i == n - 1:
        c *= share(force, arrays) ** 2
    impulse = damping_impulse(w, h, force, c, mobility, True)
    motion.ledger[IN_DAMPERS] += impulse * (w - 0.5 * mobility * impulse)
    v[i] -= impulse * minv[i]
    if i < n - 1:
        v[i + 1] += impulse * minv[i + 1]
    else:
        push(0, impulse, motion, arrays.square)
        motion.ledger[SHAKEN_BEYOND] -= impulse * motion_rate


@ieee
def share(force: float, arrays: SpatialArrays) -> float:
    """Share of the bodies' rate of approach that the contact takes next to the residual compliance
    s under a normal force [N]: 1 / (1 + s k), right for dampers to first order."""
    A = arrays.A[arrays.A.size - 1]
    k = 1.5 * (A * A * larger(force, 0.0)) ** (1.0 / 3.0)
    return 1.0 / (1.0 + arrays.residual[0, 0] * k)


@ieee
def pressure(h: float, motion: SpatialMotion, arrays: SpatialArrays, motion_rate: float) -> float:
    """Total pressure of the last contact over the elastic one, 1 + gamma d', with d' [m/s] after
    the half kick h that is still to come: of the forces at hand, an error of h^2."""
    n = motion.v.size
    gamma = arrays.gamma[n - 1]
    if gamma == 0.0:
        return 1.0
    v, minv, last = motion.v, arrays.inverse_mass, n - 1
    force = motion.f[n]
    w = v[last] - motion.wall[1, 0] - motion_rate
    net = arrays.load[last] - force * (1.0 + gamma * w)
    if last > 0:
        behind = v[last - 1] - v[last]
        net += motion.f[last] * larger(1.0 + arrays.gamma[last - 1] * behind, 0.0)
    w += h * minv[last] * net
    w -= h * arrays.square[0, 0] * (force * (1.0 + gamma * w) - arrays.rest_force)
    for j in range(1, motion.force.size):
        w -= h * arrays.square[0, j] * motion.force[j]
    return larger(1.0 + gamma * w * share(force, arrays), 0.0)


@ieee
def kick(h: float, motion: SpatialMotion, arrays: SpatialArrays, sphere: Sphere) -> None:
    """Kick of all elastic forces over h [s]: of the spheres, and of the last one and the wall in
    all 1 + n_directions. The modes get the normal force beyond that at rest."""
    v, f, minv = motion.v, motion.f, arrays.inverse_mass
    for i in range(v.size):
        v[i] += h * minv[i] * (f[i] - f[i + 1] + arrays.load[i])
    push(0, h * (f[v.size] - arrays.rest_force), motion, arrays.square)
    for j in range(motion.u.size):
        T, behind = motion.force[1 + j], motion.behind[j]
        motion.u_v[j] -= h * sphere.inverse_mass[j] * (T + behind)
        motion.spin[j] -= h * sphere.inverse_inertia * sphere.radius * (T - behind)
        push(1 + j, h * T, motion, arrays.square)


@ieee
def forces(
    t: float, h: float, motion: SpatialMotion, system: SpatialSystem, contacts: FrictionalContact
) -> None:
    """All contact forces at the positions of the time t [s]; h [s] of the half kick to come, see
    `pressure`. NaN as of `touch`."""
    arrays, trials = system.arrays, system.trials
    x, f, n = motion.x, motion.f, motion.x.size
    for i in range(n - 1):
        f[i + 1] = hertz_force(larger(x[i] - x[i + 1], 0.0), arrays.A[i])
    approach(t, motion, system)
    if arrays.gamma[n - 1] != 0.0:
        # the elastic force where S gives way under the last forces, continued, for the pressure
        # alone: with the last forces as they are its error would be of order 1
        d = trials.gap[0]
        for i in range(motion.force.size):
            d -= arrays.residual[0, i] * (motion.force[i] + trials.change[i])
        f[n] = hertz_force(larger(d, 0.0), arrays.A[n - 1])
    q = pressure(h, motion, arrays, trials.motion_rate[0])
    touch(q, motion, system, contacts)
    f[n] = motion.force[0]
    rub_before(
        system.law_before, h, motion, system, contacts.before_row, contacts.room,
        contacts.before_cells,
    )  # fmt: skip


@ieee
def rub_before(
    law: TangentialLaw | None, h: float, motion: SpatialMotion, system: SpatialSystem,
    row: SpringRow | None, room: SpringRow | None, cells: SpringCells | None,
) -> None:  # fmt: skip
    """Friction between the last sphere and the one before at their positions, in place; h [s] of
    the half kick to come, after which the damper's pressure is taken, see `pressure`."""
    if law is None:
        return
    x, v, f, arrays = motion.x, motion.v, motion.f, system.arrays
    last, radius = x.size - 1, system.sphere.radius
    gamma, minv = arrays.gamma[last - 1], arrays.inverse_mass
    w = v[last - 1] - v[last]
    if gamma != 0.0:
        pressed = f[last] * larger(1.0 + gamma * w, 0.0)
        w += h * minv[last - 1] * (f[last - 1] - pressed + arrays.load[last - 1])
        w -= h * minv[last] * (pressed - f[last + 1] + arrays.load[last])
    way1 = motion.u[0] - radius * motion.psi[0] - motion.rolled[0]
    way2 = 0.0
    if motion.u.size == 2:
        way2 = motion.u[1] - radius * motion.psi[1] - motion.rolled[1]
    overlap, q = larger(x[last - 1] - x[last], 0.0), larger(1.0 + gamma * w, 0.0)
    press(law, overlap, q, (way1, way2), motion.behind, row, room, cells)
    for j in range(motion.u.size):
        motion.rolled[j] = motion.u[j] - radius * motion.psi[j]


@ieee
def add_state_before(
    energy: Array, law: TangentialLaw | None, row: SpringRow | None, cells: SpringCells | None
) -> None:
    """The springs' energy and friction's heat of the contact with the sphere before, added to those
    of the contact at the wall."""
    if law is not None:
        _, stored, heat = contact_state(law, row, cells)
        energy[SPRINGS] += stored
        energy[RUBBED] += heat


# --- march ---------------------------------------------------------------------------------------


@ieee_entry
def settle(
    t: float, motion: SpatialMotion, system: SpatialSystem, contacts: FrictionalContact
) -> None:
    """Bring wall, contact and forces to the positions of spheres and modes, in place: before a
    march, and after these were moved."""
    arrays = system.arrays
    give_pending(motion, arrays.phi)
    for i in range(motion.wall.shape[1]):
        motion.wall[0, i], motion.wall[1, i] = 0.0, 0.0
        for j in range(motion.q.size):
            motion.wall[0, i] += arrays.phi[i, j] * motion.q[j]
            motion.wall[1, i] += arrays.phi[i, j] * motion.p[j]
    forces(t, 0.0, motion, system, contacts)


@ieee
def save_spatial(
    k: int,
    motion: SpatialMotion,
    system: SpatialSystem,
    contacts: FrictionalContact,
    saved: SavedSpatial,
) -> None:
    """Row k of the saved states and energies; total forces of the contacts include their dampers'
    at the rates of that instant, cut at 0."""
    arrays, trials = system.arrays, system.trials
    x, v, n, energy = motion.x, motion.v, motion.x.size, saved.energy[k]

    # along the chain; behind a residual compliance the damper acts by the square of its share
    energy[HERTZ], size = 0.0, 0.0
    for i in range(n):
        saved.x[k, i], saved.v[k, i] = x[i], v[i]
        force = motion.f[i + 1]
        w = v[i] - (v[i + 1] if i < n - 1 else motion.wall[1, 0] + trials.motion_rate[0])
        if i == n - 1:
            w *= share(force, arrays) ** 2
        saved.contact_force[k, i] = force * larger(1.0 + arrays.gamma[i] * w, 0.0)
        if force > 0.0:
            energy[HERTZ] += 0.4 * force * (force / arrays.A[i]) ** (2.0 / 3.0)
        size += abs(x[i]) + abs(v[i])

    # the last sphere across, the forces on the wall and its motion there
    for j in range(motion.u.size):
        saved.across[k, 0, j], saved.across[k, 1, j] = motion.u[j], motion.u_v[j]
        saved.across[k, 2, j], saved.across[k, 3, j] = motion.psi[j], motion.spin[j]
        saved.slip[k, j] = motion.slip[j]
        size += abs(motion.u_v[j]) + abs(motion.spin[j])
    for i in range(motion.force.size):
        saved.force[k, i] = motion.force[i]
        saved.wall[k, 0, i], saved.wall[k, 1, i] = motion.wall[0, i], motion.wall[1, i]
        saved.motion[k, i] = trials.motion[i]
    saved.stick[k], energy[SPRINGS], energy[RUBBED] = contact_state(
        system.law, contacts.row, contacts.cells
    )
    add_state_before(energy, system.law_before, contacts.before_row, contacts.before_cells)

    # energies of the modes; what is not finite anywhere leaves FINITE so
    energy[SWING] = 0.0
    for j in range(motion.q.size):
        energy[SWING] += 0.5 * (motion.p[j] ** 2 + (arrays.omega[j] * motion.q[j]) ** 2)
    for j in range(saved.q.shape[1]):
        saved.q[k, j], saved.p[k, j] = motion.q[j], motion.p[j]
    for j in range(4):
        energy[DAMPED + j] = motion.ledger[j]
    energy[FINITE] = size + energy[HERTZ] + energy[SPRINGS] + energy[SWING]


@ieee_march
def march_spatial(
    t: float, motion: SpatialMotion, system: SpatialSystem, contacts: FrictionalContact,
    steps: Steps, saved: SavedSpatial,
) -> int:  # fmt: skip
    """March on from the time t [s] of a settled state, in place. Ends early, and says after how
    many saves, where a state is not finite."""
    arrays, sphere, _, shaking, trials, _ = system
    h, n_save, stride = steps
    x, v, u, u_v, psi, spin, q, p = motion[:8]
    n, rest, force, ledger = x.size, arrays.rest, motion.force, motion.ledger
    for k in range(n_save + 1):
        for i_step in range(stride if k > 0 else 0):
            now = t + ((k - 1) * stride + i_step) * h

            # half a kick
            kick(0.5 * h, motion, arrays, sphere)
            for i in range(n):
                damp(i, 0.5 * h, motion, arrays, trials.motion_rate[0])
            give_pending(motion, arrays.phi)

            # all moves without contact forces
            for i in range(n):
                s, E = x[i] - rest[i], arrays.swing
                x[i] = rest[i] + (E[0, i] * s + E[1, i] * v[i])
                v[i] = E[2, i] * s + E[3, i] * v[i]
            for j in range(u.size):
                swing, turn, s = sphere.swing, sphere.turn, u[j]
                u[j] = swing[0, j] * s + swing[1, j] * u_v[j]
                u_v[j] = swing[2, j] * s + swing[3, j] * u_v[j]
                s = psi[j]
                psi[j] = turn[0, 0] * s + turn[1, 0] * spin[j]
                spin[j] = turn[2, 0] * s + turn[3, 0] * spin[j]
            ledger[SHAKEN] += shake(0, now, q, p, shaking)
            drift_wall(motion, arrays, shaking.forced)

            # new forces; L f under them is work f d(L^T F) of the shakers
            for i in range(force.size):
                trials.force_before[i], trials.motion_before[i] = force[i], trials.motion[i]
            forces(now + h, 0.5 * h, motion, system, contacts)
            for i in range(force.size):
                trials.change[i] = force[i] - trials.force_before[i]
                moved = 0.5 * (trials.motion_before[i] + trials.motion[i])
                ledger[SHAKEN_BEYOND] += moved * (force[i] - trials.force_before[i])

            # the other half of the kick
            for i in range(n - 1, -1, -1):
                damp(i, 0.5 * h, motion, arrays, trials.motion_rate[0])
            kick(0.5 * h, motion, arrays, sphere)
        give_pending(motion, arrays.phi)
        save_spatial(k, motion, system, contacts, saved)
        if not saved.energy[k, FINITE] <= 1e300:
            return k
    return n_save
