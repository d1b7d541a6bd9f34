"""March of spheres in space: kicks by their contacts, drifts between them, an energy ledger.

    x_i'' m_i = P_i (sum of contact forces + load_i)        spin_i' I_i = Q_i (sum of moments)

A contact presses the second of its spheres along the line of centres e, and pulls it along the
first sphere's surface:  N e - T. Its overlap is that at rest less the stretch of the arm X between
the centres, with D the difference of the displacements,

    |X + D| - |X| = (2 X.D + D.D) / (|X + D| + |X|)                                      `stretch`

as the difference of the two lengths would lose seven digits. P_i and Q_i are the projectors of a
guide: a line leaves one displacement, a plane two and one spin.

T grows by Mindlin's stiffness k = K sqrt(d) over the relative way s of the surfaces, turns with the
pair, and is bounded by mu N:

    d grows   dT = k ds          new springs come unstressed
    d falls   T = k xi, dxi = ds  springs that leave take their energy along

so that the energy T^2 / 2k falls by xi^2 / 2 |dk| either way, which is booked as friction's heat: a
law that kept T while k falls would make energy (R. D. Mindlin, H. Deresiewicz, J. Appl. Mech. 20
(1953) 327; C. Thornton, S. J. Cummins, P. W. Cleary, Powder Technol. 233 (2013) 30).

Where one contact is the question, as that of a chain with a structure, T is that of the springs of
`dem.kernels.tangential` instead, exact under any history of a contact whose axes stay.

A structure moves its points, where spheres lean on it, with its modes and along the directions that
each point has:

    q'' + 2 zeta omega q' + omega^2 q = Phi F,    U = Phi^T q + S F

S is what is in series with each contact alone: minus the half-space that Hertz' and Mindlin's laws
hold already. What the points feel of each other is in the modes. The overlap d follows from
d + s N(d) = gap, and the tangential stiffness is k / (1 + s_t k). Where springs take the place of
increments S may couple the three directions, and overlap and way are found together.

Forces are computed contact by contact, then summed sphere by sphere in a fixed order, both without
rearranged arithmetic: how the work is shared out changes no bit of the result.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.dem.kernels.arguments import Array, Damping, ForceShape, Plastic, Steps
from beadwave.dem.kernels.compiled import (
    contracted,
    contracted_inline,
    fastmath,
    ieee,
    ieee_inline,
    ieee_march,
)
from beadwave.dem.kernels.crew import STOPPED, Crew, meet, share
from beadwave.dem.kernels.laws import (
    contact_stiffness,
    damper_coefficient,
    elastic_force,
    elastic_indentation,
    hertz_force,
    never_pulls,
    plastic_force,
    plastic_indentation,
    plastic_loss,
    spring_share,
    stored_energy,
)
from beadwave.dem.kernels.numbers import larger
from beadwave.dem.kernels.shaking import ModalShakerForces, shake
from beadwave.dem.kernels.tangential import (
    HEAT,
    STICK,
    SpringCells,
    TangentialLaw,
    cell_energy,
    cell_force,
    copy_cells,
    slide_cells,
)

Numbers = NDArray[np.int64]

# columns of the saved energies, in the order of `SpaceTrajectory`
(KINETIC, ROTATION, CONTACT, WALL_CONTACT, TANGENTIAL, LEAF, WALL, RESIDUAL, IN_CONTACTS,
 IN_FRICTION, IN_WALL, OF_LOAD, OF_WEIGHT, OF_DRIVE, OF_SHAKERS, TOTAL) = range(16)  # fmt: skip
ITERATIONS = 60  # for the way of springs behind a compliance; some five are usual
ROUNDING = 1e-12  # of that way, to which it is found
# [m] of an approach that counts as none where a contact rubs: a wave announces itself by 1e-320 m,
# whose squares are 0
UNPRESSED = 1e-100


class SpaceMotion(NamedTuple):
    """The moving state of s spheres and c contacts, changed in place."""

    u: Array  # (s, 3) [m] displacements from the places at rest
    v: Array  # (s, 3) [m/s]
    spin: Array  # (s, 3) [rad/s]
    force: Array  # (c, 3) [N] on the second sphere of each contact
    moment: Array  # (c, 3) [N m] r e x T, of which each sphere gets its share
    traction: Array  # (c, 3) [N] T on the first sphere
    depth: Array  # (c,) [m] overlap at which forces were computed, < 0 for a gap
    bound: Array  # (c,) [N] of T then
    stiffness: Array  # (c,) [N/m] against the way then; 0 of an open contact
    compliance: Array  # (c,) [m/N] one over it; 0 of an open contact
    damper: Array  # (c, 3) [N] on the second sphere, with the dampers
    middle: Array  # (s, 3) [m/s] velocities inside of a kick with dampers
    change: Array  # (s, 3) [m/s] that such a kick makes
    steady: Array  # (s, 3) [N] load and holding springs, where there are any
    point: Array  # (p, 3) [m] of the structure's points
    point_v: Array  # (p, 3) [m/s]
    middle_point: Array  # (p, 3) [m/s] inside of a kick with dampers
    pressed_point: Array  # (p, 3) [m] of the points when forces were computed last
    lost: Array  # (c,) [J] by dampers and yield
    heat: Array  # (c,) [J] by friction


class SpaceArrays(NamedTuple):
    """Spheres and contacts as a march reads them: contacts of two spheres first, then those of a
    sphere with a plane."""

    mass: Array  # (s,) [kg]
    inverse_mass: Array  # (s,) [1/kg]
    inertia: Array  # (s,) [kg m^2]
    first: Numbers  # (c,) a sphere
    second: Numbers  # (c,) a sphere, -1 for a plane at rest, -2 - k for point k of the structure
    n_pairs: int  # contacts of two spheres
    arm: Array  # (c, 3) [m] from the first centre to the second at rest; to a plane its normal
    length: Array  # (c,) [m] of the arm; to a plane the radius
    share: Array  # (c, 2) of the moment for the first and the second sphere
    overlap: Array  # (c,) [m] at rest, < 0 for a gap
    A: Array  # (c,) [N/m^1.5]
    residual: Array  # (c,) [m/N] in series with the contact along its normal; 0 of two spheres
    start: Numbers  # (s + 1,) where each sphere's contacts begin in `incident`
    incident: Numbers  # contacts of each sphere, c as first and -1 - c as second sphere


class Friction(NamedTuple):
    """Friction of c contacts."""

    coefficient: Array  # (c,) mu
    stiffness: Array  # (c,) K [N/m^1.5] of k = K sqrt(d)
    residual: Array  # (c,) [m/N] in series with k


class ContactSprings(NamedTuple):
    """Exact tangential springs of m contacts, in cells (`dem.kernels.tangential`), with room for
    the trials of their way behind a compliance."""

    contact: Numbers  # (m,) which they are, ascending
    frame: Array  # (m, 2, 3) unit vectors across each contact
    law: tuple[Array, Array, Array]  # (m,) each: modulus, bound and radius of `TangentialLaw`
    residual: Array  # (m, 3, 3) [m/N] in series, along the normal and the frame
    u: Array  # (m, n_cells + 1, 2) [m] of the cells
    state: Array  # (m, 7)
    trial_u: Array  # (m, n_cells + 1, 2) room
    trial_state: Array  # (m, 7)
    slip: Array  # (m, 2) [m] of the second over the first surface so far
    rate: Array  # (m,) [m/s] of approach in the last drift
    pressed: Array  # (m,) [N] of the last forces
    room: Array  # (m, 7, 3)


class HoldingSprings(NamedTuple):
    """m springs that hold spheres at their places at rest, each along a line."""

    sphere: Numbers  # (m,)
    line: Array  # (m, 3) [sqrt(N/m)] a unit vector times the root of the stiffness


class Arms(NamedTuple):
    """m springs against the turns of spheres."""

    sphere: Numbers  # (m,)
    stiffness: Array  # (m,) [N m/rad]
    angle: Array  # (m, 3) [rad] so far


class Guides(NamedTuple):
    """Projectors on what the guide of each sphere leaves free, (s, 3, 3) each."""

    motion: Array
    turn: Array


class StructureModes(NamedTuple):
    """m modes that move the points of a structure along r directions, those of a point together."""

    q: Array  # (m,) [kg^1/2 m] from rest
    p: Array  # (m,) dq/dt
    phi: Array  # (r, m) [kg^-1/2]
    omega: Array  # (m,) [rad/s]
    static: Array  # (m,) displacement at rest
    propagator: Array  # (n_fractions, 4, m) as of `WallModes`
    square: Array  # (r, r) [1/kg] phi phi^T, velocities after unit impulses
    direction: Array  # (r, 3) unit vectors
    start: Numbers  # (p + 1,) where each point's directions begin
    rest_force: Array  # (r,) [N]
    force: Array  # (r,) [N] room
    v: Array  # (r,) [m/s] phi p
    kicked: Array  # (2, r) room of a kick with dampers: impulses over its time, velocities inside
    work: Array  # (1,) [J] of the contacts on the modes so far
    shaking: ModalShakerForces  # what moves the modes in each drift
    shaken: Array  # (1,) [J] work of that so far


class Drive(NamedTuple):
    """Spheres whose motion along a direction is given: a polynomial of the time behind each of n
    knots, highest power first."""

    spheres: Numbers  # (d,) with an inverse mass of 0
    direction: Array  # (3,)
    knots: Array  # (n,) [s]
    coefficients: Array  # (m, n - 1) of the displacement [m]
    work: Array  # (1,) [J] done so far


class Parts(NamedTuple):
    """Optional parts of a packing, None where it lacks one; the functions below take each by
    itself, and what is None is compiled out of them."""

    shape: ForceShape | None  # of the elastic force; None: Hertz
    plastic: Plastic | None
    damping: Damping | None
    friction: Friction | None
    springs: ContactSprings | None
    turning: Array | None  # (s,) [1/(kg m^2)] inverse inertia, where spheres spin
    guides: Guides | None
    load: Array | None  # (s, 3) [N]; there where springs hold spheres
    weight: Array | None  # (s, 3) [N], part of the load
    held: HoldingSprings | None
    arms: Arms | None
    modes: StructureModes | None
    drive: Drive | None


class SpaceSaved(NamedTuple):
    """States, forces and energies at k saves, of the saved spheres and contacts alone."""

    spheres: Numbers  # which are saved
    contacts: Numbers
    u: Array  # (k, n_spheres, 3) [m]
    v: Array  # (k, n_spheres, 3) [m/s]
    spin: Array  # (k, n_spheres, 3) [rad/s]; (k, 0, 3) without friction
    slip: Array  # (k, m, 2) [m] of the first over the second surface, of exact springs
    stick: Array  # (k, m) share of their contacts' area
    rubbed: Array  # (k, m) [J] friction's heat in them so far
    force: Array  # (k, n_contacts) [N] along the line of centres, dampers included
    traction: Array  # (k, n_contacts, 3) [N] on the second sphere; (k, 0, 3) without friction
    wall: Array  # (k, 3, r) displacement [m], velocity [m/s], force [N] of the structure's points
    modes: Array  # (k, m) q of the structure's modes, what they have at rest included
    energy: Array  # (k, 16) [J]


@ieee_march
def march(
    motion: SpaceMotion, arrays: SpaceArrays, parts: Parts, fractions: tuple[Array, Array],
    steps: Steps, saved: SpaceSaved, crew: Crew,
) -> int:  # fmt: skip
    """n_save times stride steps of kick b[0], drift a[0], ..., kick b[-1], with the `fractions` a
    and b of the step; the state is saved before and after each stride.

    Changes motion, modes and plastic contacts in place. Ends early, and says after how many saves,
    when a state is not finite. Each thread of a crew has its contacts and spheres, the first one
    all else; dampers take one thread.
    """
    (a, b), (dt, n_save, stride) = fractions, steps
    low, high = share(arrays.mass.size, crew)
    stale = n_save >= 0  # a literal True would compile what takes it once more
    drifted = 0.0
    now = 0.0  # [s] of the positions
    postponed = 0.0  # [s] of a last kick, by the forces of the next step's first one
    for k in range(n_save + 1):
        for step in range(stride if k > 0 else 0):
            for i in range(b.size):
                kick, drift = b[i] * dt + postponed, a[i] * dt if i < a.size else 0.0
                postponed = 0.0
                if kick != 0.0:
                    if stale:
                        press(drifted, motion, arrays, parts, crew)
                        drifted = 0.0
                        stale = False
                    if i >= a.size and step < stride - 1 and joins(parts.damping):
                        postponed = kick
                        continue
                    push(kick, motion, arrays, parts, parts.damping, crew)
                    push_spins(low, high, kick, motion, arrays, parts.turning, parts.guides)
                    turn_back(low, high, kick, motion, parts.turning, parts.arms)
                    if crew.worker == 0:
                        work_of_drive(kick, motion, arrays, parts.drive)
                if drift != 0.0:
                    drift_spheres(low, high, drift, motion)
                    turn_arms(low, high, drift, motion, parts.arms)
                    if crew.worker == 0:
                        drift_structure(i, now, motion, parts.modes)
                    drifted += drift
                    now += drift
                    drive_on(now, motion, parts.drive, crew)
                    stale = True
        if stale:  # forces, and friction's state, belong to these positions
            press(drifted, motion, arrays, parts, crew)
            drifted = 0.0
            stale = False
        meet(crew)
        if crew.worker == 0 and not save(k, motion, arrays, parts, saved):
            crew.gate[STOPPED] = 1
        meet(crew)
        if crew.gate[STOPPED]:
            return k
    return n_save


@ieee_inline
def press(
    drifted: float, motion: SpaceMotion, arrays: SpaceArrays, parts: Parts, crew: Crew
) -> None:
    """Forces of all contacts after a drift [s]."""
    low, high = share(arrays.A.size, crew)
    meet(crew)  # all spheres are there
    contact_forces(low, high, drifted, motion, arrays, parts.shape, parts.plastic, parts.friction)
    shear_contacts(low, high, drifted, motion, arrays, parts.damping, parts.springs)
    meet(crew)  # all forces are
    for k in range(motion.point.shape[0] if crew.worker == 0 else 0):
        for axis in range(3):
            motion.pressed_point[k, axis] = motion.point[k, axis]


@ieee_inline
def push(
    kick: float, motion: SpaceMotion, arrays: SpaceArrays, parts: Parts, damping: Damping | None,
    crew: Crew,
) -> None:  # fmt: skip
    """Impulse over `kick` [s] on spheres and wall, with the dampers where there are any."""
    low, high = share(arrays.mass.size, crew)
    load = steady_forces(low, high, motion.u, motion.steady, parts.load, parts.held)
    if damping is None:
        push_spheres(low, high, kick, motion, arrays, parts.guides, load)
        if crew.worker == 0:
            push_structure(kick, motion, arrays, parts.modes)
    else:
        push_damped(kick, motion, arrays, parts, parts.guides, load, parts.modes)


@contracted_inline
def stretch(
    c: int, u: Array, point: Array, arrays: SpaceArrays
) -> tuple[float, float, float, float, float]:
    """Rise of the distance of contact c [m], the vector y between its bodies now, and its length:
    of a plane the normal, whose length is 1."""
    i, j = arrays.first[c], arrays.second[c]
    x0, x1, x2 = arrays.arm[c, 0], arrays.arm[c, 1], arrays.arm[c, 2]
    if j < 0:
        d0, d1, d2 = -u[i, 0], -u[i, 1], -u[i, 2]
        if j < -1:
            k = -2 - j
            d0, d1, d2 = d0 + point[k, 0], d1 + point[k, 1], d2 + point[k, 2]
        return x0 * d0 + x1 * d1 + x2 * d2, x0, x1, x2, 1.0
    d0, d1, d2 = u[j, 0] - u[i, 0], u[j, 1] - u[i, 1], u[j, 2] - u[i, 2]
    y0, y1, y2 = x0 + d0, x1 + d1, x2 + d2
    r = math.sqrt(y0 * y0 + y1 * y1 + y2 * y2)
    twice = d0 * (x0 + y0) + d1 * (x1 + y1) + d2 * (x2 + y2)
    return twice / (r + arrays.length[c]), y0, y1, y2, r


@contracted_inline
def in_series(
    c: int, gap: float, arrays: SpaceArrays, shape: ForceShape | None, plastic: Plastic | None
) -> float:
    """Overlap [m] of contact c where it shares the approach `gap` > 0 [m] with a spring; nan where
    no force answers."""
    s = arrays.residual[c]
    if s == 0.0:
        return gap
    if plastic is not None:
        return plastic_indentation(c, gap, arrays.A, s, plastic)
    return elastic_indentation(c, gap, s, arrays.A, shape)


@contracted
def contact_forces(
    low: int, high: int, drifted: float, motion: SpaceMotion, arrays: SpaceArrays,
    shape: ForceShape | None, plastic: Plastic | None, friction: Friction | None,
) -> None:  # fmt: skip
    """Forces of the contacts from `low` to `high` after a drift [s] with the velocities there are;
    those that are pressed deeper than ever yield."""
    force, u, point, A = motion.force, motion.u, motion.point, arrays.A
    for c in range(high):
        if c < low:
            continue
        rise, y0, y1, y2, r = stretch(c, u, point, arrays)
        d = arrays.overlap[c] - rise
        if d <= 0.0:
            force[c, 0], force[c, 1], force[c, 2] = 0.0, 0.0, 0.0
            if friction is not None:
                open_contact(c, d, motion, friction)
            else:
                motion.depth[c] = d
            continue
        d = in_series(c, d, arrays, shape, plastic)
        if plastic is None:
            pressed = elastic_force(c, d, A, shape)
        else:
            deepen(c, d, motion.lost, A, plastic)
            pressed = plastic_force(c, d, A, plastic)
        unit = 1.0 / r
        along = unit * pressed
        force[c, 0], force[c, 1], force[c, 2] = along * y0, along * y1, along * y2
        if friction is not None:
            line = (unit * y0, unit * y1, unit * y2, r)
            rub(c, drifted, d, pressed, line, motion, arrays, friction)
        else:
            motion.depth[c] = d


@ieee_inline
def deepen(c: int, d: float, lost: Array, A: Array, plastic: Plastic) -> None:
    """Yield of contact c at an overlap d [m] deeper than any before; what it takes is booked."""
    if d > plastic.top[c]:
        before = plastic_loss(plastic.limit[c], plastic.top[c], A[c])[0]
        now, plastic.coefficient[c], plastic.crater[c] = plastic_loss(plastic.limit[c], d, A[c])
        plastic.top[c] = d
        lost[c] += now - before


@contracted_inline
def shear_stiffness(c: int, d: float, friction: Friction) -> tuple[float, float]:
    """Tangential stiffness [N/m] of contact c at the overlap d > 0 [m], the spring in series with
    it included, and one over it."""
    k = friction.stiffness[c] * math.sqrt(d)
    compliance = 1.0 / k
    if friction.residual[c] != 0.0:
        compliance += friction.residual[c]
        k = 1.0 / compliance
    return k, compliance


@contracted_inline
def open_contact(c: int, d: float, motion: SpaceMotion, friction: Friction) -> None:
    """Friction of an open contact, the gap -d [m]: none; what its springs still held is heat."""
    T = motion.traction
    if motion.stiffness[c] > 0.0:
        square = T[c, 0] * T[c, 0] + T[c, 1] * T[c, 1] + T[c, 2] * T[c, 2]
        motion.heat[c] += 0.5 * square * motion.compliance[c]
        motion.stiffness[c], motion.compliance[c] = 0.0, 0.0
    for axis in range(3):
        T[c, axis] = 0.0
        motion.moment[c, axis] = 0.0
    motion.depth[c], motion.bound[c] = d, 0.0


@contracted_inline
def rub(
    c: int, drifted: float, d: float, pressed: float, line: tuple[float, float, float, float],
    motion: SpaceMotion, arrays: SpaceArrays, friction: Friction,
) -> None:  # fmt: skip
    """Friction of contact c after a drift [s] to the overlap d [m] under `pressed` [N]; `line` is
    the unit vector between the centres and their distance.

    The velocities are those of the drift, so that the way is that of its middle: order 2.
    """
    i, j = arrays.first[c], arrays.second[c]
    v, spin, T = motion.v, motion.spin, motion.traction
    e0, e1, e2, r = line
    reach = r if j >= 0 else arrays.length[c] - d  # of the two surfaces' arms together

    # relative velocity of the centres, turn of both surfaces, and twice their mean spin about e
    w0, w1, w2 = -v[i, 0], -v[i, 1], -v[i, 2]
    a, b = reach * arrays.share[c, 0], reach * arrays.share[c, 1]
    s0, s1, s2 = a * spin[i, 0], a * spin[i, 1], a * spin[i, 2]
    twist = spin[i, 0] * e0 + spin[i, 1] * e1 + spin[i, 2] * e2
    if j >= 0:
        w0, w1, w2 = w0 + v[j, 0], w1 + v[j, 1], w2 + v[j, 2]
        s0, s1, s2 = s0 + b * spin[j, 0], s1 + b * spin[j, 1], s2 + b * spin[j, 2]
        twist += spin[j, 0] * e0 + spin[j, 1] * e1 + spin[j, 2] * e2
    elif j < -1 and drifted != 0.0:
        # modes swing in a drift: the mean velocity of the point, not that at its end
        k, now, before = -2 - j, motion.point, motion.pressed_point
        unit = 1.0 / drifted
        w0 += unit * (now[k, 0] - before[k, 0])
        w1 += unit * (now[k, 1] - before[k, 1])
        w2 += unit * (now[k, 2] - before[k, 2])
    along = w0 * e0 + w1 * e1 + w2 * e2
    w0, w1, w2 = w0 - along * e0, w1 - along * e1, w2 - along * e2

    # the line in the middle of the drift is e - q; to a plane it stays. The squares of a step's
    # turns, some 1e-12, are left out
    turn = 0.5 * drifted / (r - drifted * along) if j >= 0 else 0.0
    q0, q1, q2 = turn * w0, turn * w1, turn * w2

    # way of the surfaces over each other, across that line and across e:  w - s x (e - q)
    grown = 1.0 + turn * along
    about = s0 * e0 + s1 * e1 + s2 * e2
    g0 = grown * w0 - (s1 * e2 - s2 * e1) + about * (e1 * q2 - e2 * q1)
    g1 = grown * w1 - (s2 * e0 - s0 * e2) + about * (e2 * q0 - e0 * q2)
    g2 = grown * w2 - (s0 * e1 - s1 * e0) + about * (e0 * q1 - e1 * q0)
    g0, g1, g2 = drifted * g0, drifted * g1, drifted * g2

    # T turns with the pair: the least turn of the line, and its mean spin about it
    t0, t1, t2 = T[c, 0], T[c, 1], T[c, 2]
    along = t0 * e0 + t1 * e1 + t2 * e2
    t0, t1, t2 = t0 - along * (e0 - q0), t1 - along * (e1 - q1), t2 - along * (e2 - q2)
    twist *= 0.5 * drifted
    if twist != 0.0:
        scale = 1.0 / math.sqrt(1.0 + twist * twist)
        t0, t1, t2 = (
            scale * (t0 + twist * (e1 * t2 - e2 * t1)),
            scale * (t1 + twist * (e2 * t0 - e0 * t2)),
            scale * (t2 + twist * (e0 * t1 - e1 * t0)),
        )

    # a contact that closes within the step has the part of the way behind that
    d0 = motion.depth[c]
    if d0 < 0.0:
        closed = d / (d - d0)
        g0, g1, g2 = closed * g0, closed * g1, closed * g2
    k0, soft = motion.stiffness[c], motion.compliance[c]
    k1, compliance = shear_stiffness(c, d, friction)
    motion.stiffness[c], motion.compliance[c] = k1, compliance
    x0, x1, x2 = soft * t0, soft * t1, soft * t2  # xi before
    square, p = t0 * t0 + t1 * t1 + t2 * t2, (t0, t1, t2)
    if k1 < k0:
        k = k1
        t0, t1, t2 = k * (x0 + g0), k * (x1 + g1), k * (x2 + g2)
    else:
        k = (2.0 / 3.0) * (k0 * k0 + k0 * k1 + k1 * k1) / (k0 + k1)  # mean over the overlaps
        t0, t1, t2 = t0 + k * g0, t1 + k * g1, t2 + k * g2

    # slip: back to the bound along the radius, against the mean of the force in the step
    size, bound = t0 * t0 + t1 * t1 + t2 * t2, friction.coefficient[c] * pressed
    if size > bound * bound:
        size, before = math.sqrt(size), math.sqrt(square)
        if before >= motion.bound[c] * (1.0 - 1e-9):
            base = before * k1 * soft if k1 < k0 else before
            t0, t1, t2, along = swept(p, (g0, g1, g2), before, bound, k)
            size = base + k * along
        else:
            scale = bound / size
            t0, t1, t2 = scale * t0, scale * t1, scale * t2
        motion.heat[c] += larger(0.5 * (before + bound) * (size - bound) / k, 0.0)
    motion.bound[c] = bound
    x0, x1, x2 = x0 + compliance * t0, x1 + compliance * t1, x2 + compliance * t2
    motion.heat[c] += 0.125 * (x0 * x0 + x1 * x1 + x2 * x2) * abs(k1 - k0)
    T[c, 0], T[c, 1], T[c, 2] = t0, t1, t2
    motion.depth[c] = d

    motion.force[c, 0] -= t0
    motion.force[c, 1] -= t1
    motion.force[c, 2] -= t2
    motion.moment[c, 0] = reach * (e1 * t2 - e2 * t1)
    motion.moment[c, 1] = reach * (e2 * t0 - e0 * t2)
    motion.moment[c, 2] = reach * (e0 * t1 - e1 * t0)


@ieee_inline
def shear_contacts(
    low: int, high: int, drifted: float, motion: SpaceMotion, arrays: SpaceArrays,
    damping: Damping | None, springs: ContactSprings | None,
) -> None:  # fmt: skip
    """Exact tangential forces of the contacts from `low` to `high` that have springs, after a drift
    [s] with the velocities there are, at the overlaps of `contact_forces`."""
    if springs is None:
        return
    for m in range(springs.contact.size):
        if low <= springs.contact[m] < high:
            shear(m, drifted, motion, arrays, damping, springs)


@ieee
def shear(
    m: int, drifted: float, motion: SpaceMotion, arrays: SpaceArrays, damping: Damping | None,
    springs: ContactSprings,
) -> None:  # fmt: skip
    """Force of contact m with springs, and its overlap, which a compliance in series that couples
    the directions changes.

    Way and force are along the contact's axes at rest; the surfaces are at their distance from the
    centres at rest. The pressure that bounds slip includes Hunt and Crossley's damper, at the rate
    of approach that the last two drifts, of equal length, lead on to.
    """
    c = springs.contact[m]
    i, j, d = arrays.first[c], arrays.second[c], motion.depth[c]
    v, spin, frame, slip = motion.v, motion.spin, springs.frame[m], springs.slip[m]
    rise, e0, e1, e2, r = stretch(c, motion.u, motion.point, arrays)
    e0, e1, e2, gap = e0 / r, e1 / r, e2 / r, arrays.overlap[c] - rise
    if 0.0 < gap <= UNPRESSED:
        gap, d = 0.0, 0.0

    # relative velocity of the centres, and turn of both surfaces
    a, b = arrays.length[c] * arrays.share[c, 0], arrays.length[c] * arrays.share[c, 1]
    w0, w1, w2 = 0.0 - v[i, 0], 0.0 - v[i, 1], 0.0 - v[i, 2]
    s0, s1, s2 = a * spin[i, 0], a * spin[i, 1], a * spin[i, 2]
    if j >= 0:
        w0, w1, w2 = w0 + v[j, 0], w1 + v[j, 1], w2 + v[j, 2]
        s0, s1, s2 = s0 + b * spin[j, 0], s1 + b * spin[j, 1], s2 + b * spin[j, 2]
    elif j < -1 and drifted != 0.0:
        # modes swing in a drift: the mean velocity of the point, not that at its end
        k, now, before = -2 - j, motion.point, motion.pressed_point
        unit = 1.0 / drifted
        w0 += unit * (now[k, 0] - before[k, 0])
        w1 += unit * (now[k, 1] - before[k, 1])
        w2 += unit * (now[k, 2] - before[k, 2])
    elif j < -1:
        k = -2 - j
        w0, w1, w2 = w0 + motion.point_v[k, 0], w1 + motion.point_v[k, 1], w2 + motion.point_v[k, 2]
    approach = 0.0 - (w0 * e0 + w1 * e1 + w2 * e2)
    w0, w1, w2 = w0 - (s1 * e2 - s2 * e1), w1 - (s2 * e0 - s0 * e2), w2 - (s0 * e1 - s1 * e0)
    way1 = drifted * (w0 * frame[0, 0] + w1 * frame[0, 1] + w2 * frame[0, 2])
    way2 = drifted * (w0 * frame[1, 0] + w1 * frame[1, 1] + w2 * frame[1, 2])

    # total over elastic pressure
    q = 1.0
    if damping is not None:
        rate = 1.5 * approach - 0.5 * springs.rate[m] if drifted != 0.0 else approach
        springs.rate[m] = approach
        k_n = 1.5 * arrays.A[c] * math.sqrt(larger(d, 0.0))
        q = larger(1.0 + damping.gamma[c] * rate / (1.0 + arrays.residual[c] * k_n), 0.0)

    law = law_of(m, springs)
    cells, T = SpringCells(springs.u[m], springs.state[m]), motion.traction
    if arrays.residual[c] == 0.0 or gap <= 0.0:
        slide_cells(cells, law, d, q, way1, way2)
        slip[0] += way1
        slip[1] += way2
    else:
        springs.room[m, 0, 0] = d
        d = press_behind(m, gap, q, (way1, way2), motion, arrays, springs)
    t1, t2 = cell_force(cells, law)
    motion.heat[c], motion.depth[c] = cells.state[HEAT], d
    springs.pressed[m] = hertz_force(larger(d, 0.0), arrays.A[c]) if d == d else math.nan
    for axis in range(3):
        T[c, axis] = t1 * frame[0, axis] + t2 * frame[1, axis]
    N, reach = springs.pressed[m], arrays.length[c]
    motion.force[c, 0] = N * e0 - T[c, 0]
    motion.force[c, 1] = N * e1 - T[c, 1]
    motion.force[c, 2] = N * e2 - T[c, 2]
    motion.moment[c, 0] = reach * (e1 * T[c, 2] - e2 * T[c, 1])
    motion.moment[c, 1] = reach * (e2 * T[c, 0] - e0 * T[c, 2])
    motion.moment[c, 2] = reach * (e0 * T[c, 1] - e1 * T[c, 0])


@ieee_inline
def law_of(m: int, springs: ContactSprings) -> TangentialLaw:
    """The tangential law of contact m with springs."""
    modulus, bound, radius = springs.law
    return TangentialLaw(modulus[m], bound[m], radius[m], 0.0)


@ieee
def press_behind(
    m: int, gap: float, q: float, way: tuple[float, float], motion: SpaceMotion,
    arrays: SpaceArrays, springs: ContactSprings,
) -> float:  # fmt: skip
    """Move the cells of contact m by what the compliance S (3, 3) [m/N] in series leaves of an
    approach `gap` and a way of the surfaces [m]: its overlap [m], from the estimate room[0, 0] on;
    NaN where no forces answer.

    Broyden's method for overlap and ways of the surfaces, with the inverse of the tangent: that of
    a contact that sticks, again after 15 steps (C. G. Broyden, Math. Comput. 19 (1965) 577).
    """
    c, S, frame, law = springs.contact[m], springs.residual[m], springs.frame[m], law_of(m, springs)
    A, T, room = arrays.A[c], motion.traction[c], springs.room[m]
    x, off, last, step, H = room[0], room[1], room[2], room[3], room[4:7]
    cells = SpringCells(springs.u[m], springs.state[m])
    trial = SpringCells(springs.trial_u[m], springs.trial_state[m])
    before1 = T[0] * frame[0, 0] + T[1] * frame[0, 1] + T[2] * frame[0, 2]
    before2 = T[0] * frame[1, 0] + T[1] * frame[1, 1] + T[2] * frame[1, 2]
    x[1], x[2] = way
    for iteration in range(ITERATIONS):
        copy_cells(cells, trial, law)
        slide_cells(trial, law, x[0], q, x[1], x[2])
        t1, t2 = cell_force(trial, law)
        N = hertz_force(larger(x[0], 0.0), A)
        change, c1, c2 = N - springs.pressed[m], t1 - before1, t2 - before2
        for i in range(3):
            last[i] = off[i]
        off[0] = x[0] + S[0, 0] * N - S[0, 1] * t1 - S[0, 2] * t2 - gap
        off[1] = x[1] - S[1, 0] * change + S[1, 1] * c1 + S[1, 2] * c2 - way[0]
        off[2] = x[2] - S[2, 0] * change + S[2, 1] * c1 + S[2, 2] * c2 - way[1]
        size = abs(x[0]) + abs(gap) + abs(way[0]) + abs(way[1])
        if abs(off[0]) + abs(off[1]) + abs(off[2]) <= ROUNDING * size:
            break
        if iteration == ITERATIONS - 1 or not size <= 1e300:
            x[0] = math.nan
            break
        if iteration % 15 == 0:
            root = math.sqrt(larger(x[0], 0.0))
            k_n, k_t = 1.5 * A * root, 2.0 * math.sqrt(law.radius) * root * law.modulus
            for i in range(3):
                for j in range(3):
                    H[i, j] = 0.0
                H[i, i] = 1.0 / (1.0 + S[i, i] * (k_n if i == 0 else k_t))
        else:
            follow(H, step, off, last)
        for i in range(3):
            step[i] = 0.0 - (H[i, 0] * off[0] + H[i, 1] * off[1] + H[i, 2] * off[2])
            x[i] += step[i]
    copy_cells(trial, cells, law)
    springs.slip[m, 0] += x[1]
    springs.slip[m, 1] += x[2]
    return x[0]


@ieee
def follow(H: Array, step: Array, off: Array, last: Array) -> None:
    """Change the inverse H (3, 3) of a tangent, so that it leads from the change of what is off
    since `last` (3,) to the step, by Sherman's and Morrison's formula; `last` becomes that change.
    """
    scale = 0.0
    for i in range(3):
        last[i] = off[i] - last[i]
    for i in range(3):
        scale += step[i] * (H[i, 0] * last[0] + H[i, 1] * last[1] + H[i, 2] * last[2])
    if scale == 0.0:
        return
    s0 = step[0] * H[0, 0] + step[1] * H[1, 0] + step[2] * H[2, 0]
    s1 = step[0] * H[0, 1] + step[1] * H[1, 1] + step[2] * H[2, 1]
    s2 = step[0] * H[0, 2] + step[1] * H[1, 2] + step[2] * H[2, 2]
    for i in range(3):
        moved = H[i, 0] * last[0] + H[i, 1] * last[1] + H[i, 2] * last[2]
        missed = (step[i] - moved) / scale
        H[i, 0] += missed * s0
        H[i, 1] += missed * s1
        H[i, 2] += missed * s2


@contracted
def swept(
    T: tuple[float, float, float], way: tuple[float, float, float], before: float, bound: float,
    k: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """T [N] of a contact that slips all along a way [m], from the size `before` to the bound, and
    the way along it. T turns into the way by d(theta) = -k/b sin(theta) ds, whose solution
    tan(theta/2) exp(-k s / b) has order 2, where the radius alone would have order 1."""
    s = math.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    if s == 0.0:
        scale = bound / before
        return scale * T[0], scale * T[1], scale * T[2], 0.0
    w0, w1, w2 = way[0] / s, way[1] / s, way[2] / s
    if before == 0.0:  # a contact that has just closed
        return bound * w0, bound * w1, bound * w2, s
    along = T[0] * w0 + T[1] * w1 + T[2] * w2
    a0, a1, a2 = T[0] - along * w0, T[1] - along * w1, T[2] - along * w2
    across = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
    cosine = along / before
    if across < 1e-12 * before:
        cosine = math.copysign(1.0, along)
        return bound * cosine * w0, bound * cosine * w1, bound * cosine * w2, s * cosine
    # tan(theta/2) without the difference of its two terms
    half = across / (before + along) if along > 0.0 else (before - along) / across
    half *= math.exp(-2.0 * k * s / (before + bound))
    scale = 1.0 / (1.0 + half * half)
    c1, s1 = scale * (1.0 - half * half), 2.0 * scale * half / across
    return (
        bound * (c1 * w0 + s1 * a0), bound * (c1 * w1 + s1 * a1), bound * (c1 * w2 + s1 * a2),
        0.5 * s * (cosine + c1),
    )  # fmt: skip


@contracted
def push_spheres(
    low: int, high: int, kick: float, motion: SpaceMotion, arrays: SpaceArrays,
    guides: Guides | None, load: Array | None,
) -> None:  # fmt: skip
    """Impulse of contacts and load over `kick` [s] on the spheres from `low` to `high`, each summed
    in the order of its contacts."""
    v, force = motion.v, motion.force
    for i in range(high):
        if i < low:
            continue
        f0, f1, f2 = 0.0, 0.0, 0.0
        if load is not None:
            f0, f1, f2 = load[i, 0], load[i, 1], load[i, 2]
        for at in range(arrays.start[i], arrays.start[i + 1]):
            c = arrays.incident[at]
            if c >= 0:
                f0, f1, f2 = f0 - force[c, 0], f1 - force[c, 1], f2 - force[c, 2]
            else:
                c = -1 - c
                f0, f1, f2 = f0 + force[c, 0], f1 + force[c, 1], f2 + force[c, 2]
        if guides is not None:
            f0, f1, f2 = projected(guides.motion, i, f0, f1, f2)
        scale = kick * arrays.inverse_mass[i]
        v[i, 0] += scale * f0
        v[i, 1] += scale * f1
        v[i, 2] += scale * f2


@contracted
def push_spins(
    low: int, high: int, kick: float, motion: SpaceMotion, arrays: SpaceArrays,
    turning: Array | None, guides: Guides | None,
) -> None:  # fmt: skip
    """Impulse of friction's moments over `kick` [s] on the spheres from `low` to `high`; none where
    none spins."""
    if turning is None:
        return
    spin, moment = motion.spin, motion.moment
    for i in range(high):
        if i < low:
            continue
        m0, m1, m2 = 0.0, 0.0, 0.0
        for at in range(arrays.start[i], arrays.start[i + 1]):
            c, side = arrays.incident[at], 0
            if c < 0:
                c, side = -1 - c, 1
            part = arrays.share[c, side]
            m0 += part * moment[c, 0]
            m1 += part * moment[c, 1]
            m2 += part * moment[c, 2]
        if guides is not None:
            m0, m1, m2 = projected(guides.turn, i, m0, m1, m2)
        scale = kick * turning[i]
        spin[i, 0] += scale * m0
        spin[i, 1] += scale * m1
        spin[i, 2] += scale * m2


@ieee_inline
def steady_forces(
    low: int, high: int, u: Array, steady: Array, load: Array | None, held: HoldingSprings | None
) -> Array | None:
    """Load and holding springs [N] on the spheres from `low` to `high`, displaced by u (s, 3) [m],
    in `steady` (s, 3); the load itself without springs."""
    if held is None:
        return load
    for i in range(low, high):
        for axis in range(3):
            steady[i, axis] = load[i, axis]
    for m in range(held.sphere.size):
        i, line = held.sphere[m], held.line[m]
        if low <= i < high:
            pull = line[0] * u[i, 0] + line[1] * u[i, 1] + line[2] * u[i, 2]
            for axis in range(3):
                steady[i, axis] -= pull * line[axis]
    return steady


@ieee_inline
def turn_back(
    low: int, high: int, kick: float, motion: SpaceMotion, turning: Array | None, arms: Arms | None
) -> None:
    """Impulse of the arms over `kick` [s] on the spins of the spheres from `low` to `high`."""
    if arms is None:
        return
    for m in range(arms.sphere.size):
        i = arms.sphere[m]
        if low <= i < high:
            for axis in range(3):
                motion.spin[i, axis] -= kick * turning[i] * arms.stiffness[m] * arms.angle[m, axis]


@ieee_inline
def turn_arms(low: int, high: int, drift: float, motion: SpaceMotion, arms: Arms | None) -> None:
    """Turns of the arms over `drift` [s]."""
    if arms is None:
        return
    for m in range(arms.sphere.size):
        i = arms.sphere[m]
        if low <= i < high:
            for axis in range(3):
                arms.angle[m, axis] += drift * motion.spin[i, axis]


@contracted_inline
def projected(P: Array, i: int, f0: float, f1: float, f2: float) -> tuple[float, float, float]:
    """P_i f, of the projectors P (s, 3, 3)."""
    return (
        P[i, 0, 0] * f0 + P[i, 0, 1] * f1 + P[i, 0, 2] * f2,
        P[i, 1, 0] * f0 + P[i, 1, 1] * f1 + P[i, 1, 2] * f2,
        P[i, 2, 0] * f0 + P[i, 2, 1] * f1 + P[i, 2, 2] * f2,
    )


@ieee
def gather(force: Array, arrays: SpaceArrays, modes: StructureModes) -> None:
    """Forces [N] of all contacts on the points of a structure, along their directions."""
    for r in range(modes.force.size):
        modes.force[r] = 0.0
    for c in range(arrays.n_pairs, arrays.A.size):
        k = -2 - arrays.second[c]
        if k >= 0:
            for r in range(modes.start[k], modes.start[k + 1]):
                for axis in range(3):
                    modes.force[r] += force[c, axis] * modes.direction[r, axis]


@ieee
def along_directions(values: Array, vectors: Array, modes: StructureModes) -> None:
    """Vectors (p, 3) of the points of which `values` (r,) are the components."""
    for k in range(vectors.shape[0]):
        for axis in range(3):
            vectors[k, axis] = 0.0
            for r in range(modes.start[k], modes.start[k + 1]):
                vectors[k, axis] += values[r] * modes.direction[r, axis]


@fastmath
def push_row(r: int, impulse: float, modes: StructureModes) -> None:
    """Impulse [N s] on the structure along its direction r: p += phi_r I, with the work of it."""
    modes.work[0] += impulse * (modes.v[r] + 0.5 * modes.square[r, r] * impulse)
    for other in range(modes.v.size):
        modes.v[other] += modes.square[other, r] * impulse
    p, phi = modes.p, modes.phi
    for j in range(p.size):
        p[j] += phi[r, j] * impulse


@ieee
def push_structure(
    kick: float, motion: SpaceMotion, arrays: SpaceArrays, modes: StructureModes | None
) -> None:
    """Impulse over `kick` [s] of the contacts' forces beyond those at rest on the structure."""
    if modes is not None:
        gather(motion.force, arrays, modes)
        for r in range(modes.force.size):
            push_row(r, kick * (modes.force[r] - modes.rest_force[r]), modes)
        along_directions(modes.v, motion.point_v, modes)


@fastmath
def drift_structure(k: int, now: float, motion: SpaceMotion, modes: StructureModes | None) -> None:
    """Exact motion of the structure under its shakers by the k-th drift, from `now` [s] on; its
    points' displacements and velocities are summed anew from the modes, so that rounding does not
    pile up."""
    if modes is None:
        return
    q, p, phi, u = modes.q, modes.p, modes.phi, modes.force
    qq, qp = modes.propagator[k, 0], modes.propagator[k, 1]
    pq, pp = modes.propagator[k, 2], modes.propagator[k, 3]
    modes.shaken[0] += shake(k, now, q, p, modes.shaking)
    forced = modes.shaking.forced
    for j in range(q.size):
        before, speed = q[j], p[j]
        q[j] = qq[j] * before + qp[j] * speed + forced[0, j]
        p[j] = pq[j] * before + pp[j] * speed + forced[1, j]
    for r in range(u.size):
        moved, speed = 0.0, 0.0
        for j in range(q.size):
            moved += phi[r, j] * q[j]
            speed += phi[r, j] * p[j]
        u[r], modes.v[r] = moved, speed
    along_directions(u, motion.point, modes)
    along_directions(modes.v, motion.point_v, modes)


@contracted
def drift_spheres(low: int, high: int, drift: float, motion: SpaceMotion) -> None:
    """Free flight of the spheres from `low` to `high` over `drift` [s]."""
    u, v = motion.u, motion.v
    for i in range(high):
        if i < low:
            continue
        u[i, 0] += drift * v[i, 0]
        u[i, 1] += drift * v[i, 1]
        u[i, 2] += drift * v[i, 2]


@ieee
def place_driven(now: float, motion: SpaceMotion, drive: Drive | None) -> None:
    """Displacement and velocity of the driven spheres at an instant [s]; they do not spin."""
    if drive is None:
        return
    low, high = 0, drive.knots.size - 1
    while high - low > 1:
        middle = (low + high) // 2
        if drive.knots[middle] <= now:
            low = middle
        else:
            high = middle
    t, value, rate = now - drive.knots[low], 0.0, 0.0
    for power in range(drive.coefficients.shape[0]):
        rate = rate * t + value
        value = value * t + drive.coefficients[power, low]
    for at in range(drive.spheres.size):
        i = drive.spheres[at]
        for axis in range(3):
            motion.u[i, axis] = value * drive.direction[axis]
            motion.v[i, axis] = rate * drive.direction[axis]
            motion.spin[i, axis] = 0.0


@ieee_inline
def joins(damping: Damping | None) -> bool:
    """True if two kicks by the same forces are one: dampers are right to a power of the kick."""
    return damping is None


@ieee_inline
def drive_on(now: float, motion: SpaceMotion, drive: Drive | None, crew: Crew) -> None:
    """`place_driven`, once all spheres have drifted."""
    if drive is not None:
        meet(crew)
        if crew.worker == 0:
            place_driven(now, motion, drive)


@ieee
def work_of_drive(
    kick: float, motion: SpaceMotion, arrays: SpaceArrays, drive: Drive | None
) -> None:
    """Work over `kick` [s] against the contacts' forces on the driven spheres."""
    if drive is None:
        return
    for at in range(drive.spheres.size):
        i = drive.spheres[at]
        for place in range(arrays.start[i], arrays.start[i + 1]):
            c = arrays.incident[place]
            sign = 1.0
            if c < 0:
                c, sign = -1 - c, -1.0
            power = 0.0
            for axis in range(3):
                power += motion.force[c, axis] * motion.v[i, axis]
            drive.work[0] += kick * sign * power


# --- dampers -------------------------------------------------------------------------------------


@ieee_inline
def damper_force(
    c: int, v: Array, w: Array, motion: SpaceMotion, arrays: SpaceArrays, shape: ForceShape | None,
    plastic: Plastic | None, damping: Damping,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Damping force [N] of contact c with the velocities v (s, 3) of the spheres and w (p, 3) of
    the structure's points, its rate of approach [m/s], and the line of centres; 0 of an open
    contact."""
    _, y0, y1, y2, r = stretch(c, motion.u, motion.point, arrays)
    e0, e1, e2 = y0 / r, y1 / r, y2 / r
    pressed = motion.force[c, 0] * e0 + motion.force[c, 1] * e1 + motion.force[c, 2] * e2
    if pressed <= 0.0:
        return 0.0, 0.0, e0, e1, e2
    i, j = arrays.first[c], arrays.second[c]
    rate = v[i, 0] * e0 + v[i, 1] * e1 + v[i, 2] * e2
    if j >= 0:
        rate -= v[j, 0] * e0 + v[j, 1] * e1 + v[j, 2] * e2
    elif j < -1:
        k = -2 - j
        rate -= w[k, 0] * e0 + w[k, 1] * e1 + w[k, 2] * e2
    extra = damper_coefficient(damping.gamma[c], pressed, damping.law) * rate
    if arrays.residual[c] != 0.0:
        k_n = contact_stiffness(c, pressed, arrays.A, shape, plastic)
        extra *= spring_share(k_n, arrays.residual[c])[0]
    if never_pulls(damping.law) and extra < -pressed:
        extra = -pressed
    return extra, rate, e0, e1, e2


@ieee
def push_damped(
    kick: float, motion: SpaceMotion, arrays: SpaceArrays, parts: Parts, guides: Guides | None,
    load: Array | None, modes: StructureModes | None,
) -> None:  # fmt: skip
    """Kick [s] of contacts and dampers together at fixed positions, m v' = F + F_d(v), by the
    classical method of Runge and Kutta: F_d is linear in v where it is not cut, so that what is
    left is of order 5 in the kick times the dampers' rate. Each damper takes force times rate of
    approach, by the weights of the method.
    """
    v, middle, total = motion.v, motion.middle, motion.change
    n, m = arrays.mass.size, arrays.A.size
    if modes is not None:
        for r in range(modes.v.size):
            modes.kicked[0, r] = 0.0
        along_directions(modes.v, motion.middle_point, modes)
    for i in range(n):
        for axis in range(3):
            middle[i, axis] = v[i, axis]
            total[i, axis] = 0.0
    for stage in range(4):
        weight = (1.0 if stage in (0, 3) else 2.0) / 6.0
        ahead = 1.0 if stage == 2 else 0.5  # of the kick, to where the next stage looks
        for c in range(m):
            extra, rate, e0, e1, e2 = damper_force(
                c, middle, motion.middle_point, motion, arrays, parts.shape, parts.plastic,
                parts.damping,
            )  # fmt: skip
            motion.lost[c] += kick * weight * extra * rate
            motion.damper[c, 0] = motion.force[c, 0] + extra * e0
            motion.damper[c, 1] = motion.force[c, 1] + extra * e1
            motion.damper[c, 2] = motion.force[c, 2] + extra * e2
        for i in range(n):
            f0, f1, f2 = 0.0, 0.0, 0.0
            if load is not None:
                f0, f1, f2 = load[i, 0], load[i, 1], load[i, 2]
            for at in range(arrays.start[i], arrays.start[i + 1]):
                c = arrays.incident[at]
                sign = -1.0
                if c < 0:
                    c, sign = -1 - c, 1.0
                f0 += sign * motion.damper[c, 0]
                f1 += sign * motion.damper[c, 1]
                f2 += sign * motion.damper[c, 2]
            if guides is not None:
                f0, f1, f2 = projected(guides.motion, i, f0, f1, f2)
            scale = kick * arrays.inverse_mass[i]
            total[i, 0] += weight * scale * f0
            total[i, 1] += weight * scale * f1
            total[i, 2] += weight * scale * f2
            middle[i, 0] = v[i, 0] + ahead * scale * f0
            middle[i, 1] = v[i, 1] + ahead * scale * f1
            middle[i, 2] = v[i, 2] + ahead * scale * f2
        if modes is not None:
            gather(motion.damper, arrays, modes)
            for r in range(modes.force.size):
                modes.force[r] -= modes.rest_force[r]
                modes.kicked[0, r] += weight * modes.force[r]
            for r in range(modes.force.size):
                modes.kicked[1, r] = modes.v[r]
                for other in range(modes.force.size):
                    modes.kicked[1, r] += ahead * kick * modes.square[r, other] * modes.force[other]
            along_directions(modes.kicked[1], motion.middle_point, modes)
    for i in range(n):
        for axis in range(3):
            v[i, axis] += total[i, axis]
    if modes is not None:
        for r in range(modes.force.size):
            push_row(r, kick * modes.kicked[0, r], modes)
        along_directions(modes.v, motion.point_v, modes)


# --- what is saved -------------------------------------------------------------------------------


@ieee_inline
def save(k: int, motion: SpaceMotion, arrays: SpaceArrays, parts: Parts, saved: SpaceSaved) -> bool:
    """Row k of the saved states, forces and energies; is it finite?"""
    energy = saved.energy[k]
    for e in range(TOTAL):
        energy[e] = 0.0
    save_spheres(k, motion, arrays, saved, parts.turning, parts.load, parts.weight)
    save_held(k, motion, saved, parts.held, parts.arms)
    save_contacts(
        k, motion, arrays, saved, parts.shape, parts.plastic, parts.damping, parts.friction
    )
    save_springs(k, motion, arrays, saved, parts.springs)
    save_structure(k, motion, arrays, saved, parts.turning, parts.modes)
    energy[OF_DRIVE] = drive_work(parts.drive)
    total = 0.0
    for e in range(OF_LOAD):
        total += energy[e]
    works = energy[OF_LOAD] + energy[OF_WEIGHT] + energy[OF_DRIVE] + energy[OF_SHAKERS]
    energy[TOTAL] = total - works
    return abs(energy[TOTAL]) <= 1e300  # not so of inf or NaN


@ieee_inline
def drive_work(drive: Drive | None) -> float:
    """Work [J] of a drive so far; 0 without."""
    if drive is None:
        return 0.0
    return drive.work[0]


@ieee
def save_structure(
    k: int, motion: SpaceMotion, arrays: SpaceArrays, saved: SpaceSaved,
    turning: Array | None, modes: StructureModes | None,
) -> None:  # fmt: skip
    """Row k of the structure's points and modes, the forces on it, its energy and what its damping
    took."""
    if modes is None:
        return
    for c in range(arrays.n_pairs, arrays.A.size):
        save_point_force(k, c, motion, arrays, saved, turning, modes)
    q, p, static = modes.q, modes.p, modes.static
    swing = 0.0
    for j in range(q.size):
        kinetic, stiffness = 0.5 * p[j] * p[j], 0.5 * modes.omega[j] * modes.omega[j]
        swing += kinetic + stiffness * q[j] * q[j]
        saved.energy[k, WALL] += kinetic + stiffness * (q[j] + static[j]) ** 2
        saved.modes[k, j] = q[j] + static[j]
    saved.energy[k, IN_WALL] = modes.work[0] + modes.shaken[0] - swing
    saved.energy[k, OF_SHAKERS] = modes.shaken[0]
    for r in range(modes.v.size):
        moved = 0.0
        for j in range(q.size):
            moved += modes.phi[r, j] * q[j]
        saved.wall[k, 0, r], saved.wall[k, 1, r] = moved, modes.v[r]


@ieee
def save_spheres(
    k: int, motion: SpaceMotion, arrays: SpaceArrays, saved: SpaceSaved,
    turning: Array | None, load: Array | None, weight: Array | None,
) -> None:  # fmt: skip
    """Row k of the spheres' states, their energies and the works of steady forces."""
    u, v, energy = motion.u, motion.v, saved.energy[k]
    for at in range(saved.spheres.size):
        i = saved.spheres[at]
        for axis in range(3):
            saved.u[k, at, axis] = u[i, axis]
            saved.v[k, at, axis] = v[i, axis]
            if turning is not None:
                saved.spin[k, at, axis] = motion.spin[i, axis]
    for i in range(arrays.mass.size):
        square, turn, work, heavy = 0.0, 0.0, 0.0, 0.0
        for axis in range(3):
            square += v[i, axis] * v[i, axis]
            turn += motion.spin[i, axis] * motion.spin[i, axis]
            if weight is not None:
                heavy += weight[i, axis] * u[i, axis]
            if load is not None:
                work += load[i, axis] * u[i, axis]
        energy[KINETIC] += 0.5 * arrays.mass[i] * square
        energy[ROTATION] += 0.5 * arrays.inertia[i] * turn
        energy[OF_WEIGHT] += heavy
        energy[OF_LOAD] += work - heavy  # the load holds the weights as well


@ieee
def save_held(
    k: int, motion: SpaceMotion, saved: SpaceSaved, held: HoldingSprings | None, arms: Arms | None
) -> None:
    """Row k of the energies of what holds spheres and their turns."""
    if held is not None:
        for m in range(held.sphere.size):
            u, line = motion.u[held.sphere[m]], held.line[m]
            pull = line[0] * u[0] + line[1] * u[1] + line[2] * u[2]
            saved.energy[k, LEAF] += 0.5 * pull * pull
    if arms is not None:
        for m in range(arms.sphere.size):
            for axis in range(3):
                angle = arms.angle[m, axis]
                saved.energy[k, LEAF] += 0.5 * arms.stiffness[m] * angle * angle


@ieee
def save_contacts(
    k: int, motion: SpaceMotion, arrays: SpaceArrays, saved: SpaceSaved, shape: ForceShape | None,
    plastic: Plastic | None, damping: Damping | None, friction: Friction | None,
) -> None:  # fmt: skip
    """Row k of the contacts' forces, their energies and losses."""
    v, energy, at = motion.v, saved.energy[k], 0
    for c in range(arrays.A.size):
        d, pressed, stored = motion.depth[c], 0.0, 0.0
        if d > 0.0:
            if plastic is None:
                pressed = elastic_force(c, d, arrays.A, shape)
                stored = stored_energy(c, d, pressed, arrays.A, shape)
            else:
                pressed = plastic_force(c, d, arrays.A, plastic)
                stored = 0.4 * pressed * (d - plastic.crater[c])
        energy[CONTACT if arrays.second[c] >= 0 else WALL_CONTACT] += stored
        energy[RESIDUAL] += 0.5 * arrays.residual[c] * pressed * pressed
        if damping is not None:
            pressed += damper_force(
                c, v, motion.point_v, motion, arrays, shape, plastic, damping
            )[0]  # fmt: skip
        if friction is not None and d > 0.0:
            T = motion.traction
            square = T[c, 0] * T[c, 0] + T[c, 1] * T[c, 1] + T[c, 2] * T[c, 2]
            energy[TANGENTIAL] += 0.5 * square * shear_stiffness(c, d, friction)[1]
        motion.damper[c, 0] = pressed  # room: for the forces on the structure
        energy[IN_CONTACTS] += motion.lost[c]
        energy[IN_FRICTION] += motion.heat[c]
        if at < saved.contacts.size and saved.contacts[at] == c:
            saved.force[k, at] = pressed
            if friction is not None:
                for axis in range(3):
                    saved.traction[k, at, axis] = -motion.traction[c, axis]
            at += 1


@ieee
def save_springs(
    k: int, motion: SpaceMotion, arrays: SpaceArrays, saved: SpaceSaved,
    springs: ContactSprings | None,
) -> None:  # fmt: skip
    """Row k of the contacts with exact springs: slip, share of the area that sticks, heat, force,
    energy of the springs and of what tangential forces do in the compliance in series."""
    if springs is None:
        return
    for m in range(springs.contact.size):
        c, S, frame = springs.contact[m], springs.residual[m], springs.frame[m]
        cells, T = SpringCells(springs.u[m], springs.state[m]), motion.traction[c]
        t1 = 0.0 - (T[0] * frame[0, 0] + T[1] * frame[0, 1] + T[2] * frame[0, 2])
        t2 = 0.0 - (T[0] * frame[1, 0] + T[1] * frame[1, 1] + T[2] * frame[1, 2])
        across = 0.5 * (S[1, 1] * t1 * t1 + S[2, 2] * t2 * t2) + S[1, 2] * t1 * t2
        saved.energy[k, RESIDUAL] += springs.pressed[m] * (S[0, 1] * t1 + S[0, 2] * t2) + across
        saved.energy[k, TANGENTIAL] += cell_energy(cells, law_of(m, springs))
        saved.stick[k, m], saved.rubbed[k, m] = cells.state[STICK], motion.heat[c]
        for axis in range(2):  # of the first over the second
            saved.slip[k, m, axis] = 0.0 - springs.slip[m, axis]
        for at in range(saved.contacts.size):
            if saved.contacts[at] == c:
                for axis in range(3):
                    saved.traction[k, at, axis] = 0.0 - T[axis]


@ieee
def save_point_force(
    k: int, c: int, motion: SpaceMotion, arrays: SpaceArrays, saved: SpaceSaved,
    turning: Array | None, modes: StructureModes,
) -> None:  # fmt: skip
    """The force of contact c, whose normal part `save_contacts` has left, added to row k of its
    point's."""
    point = -2 - arrays.second[c]
    if point < 0:
        return
    for r in range(modes.start[point], modes.start[point + 1]):
        for axis in range(3):
            force = motion.damper[c, 0] * arrays.arm[c, axis]
            if turning is not None:
                force -= motion.traction[c, axis]
            saved.wall[k, 2, r] += force * modes.direction[r, axis]
