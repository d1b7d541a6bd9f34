"""Explicit march: kicks by the contacts, drifts of spheres, leaf springs and modes between them.

A step of dt is a symmetric splitting with fractions a_i of the drifts, b_i of the kicks:

    kick   v_i  <-  v_i + b dt (f_{i-1} - f_i + load_i) / m_i         forces at fixed positions
    drift  x_i  <-  x_i + a dt v_i,  or the exact swing on a leaf spring;  modes exactly

with contact force f_i between spheres i and i + 1. Damping acts in the middle of each kick, exactly
at fixed positions. After the step comes what the scheme missed at contacts that opened, closed or
yielded (`events`).
"""

import math

from beadwave.dem.kernels.arguments import (
    IN_CONTACTS,
    IN_GUIDES,
    Array,
    ChainArrays,
    Correction,
    Damping,
    ForceShape,
    LeafSprings,
    Motion,
    SavedStates,
    Steps,
    V,
    WallModes,
)
from beadwave.dem.kernels.compiled import fastmath, fastmath_inline, fastmath_march
from beadwave.dem.kernels.events import correct_events, crossed, yield_contacts
from beadwave.dem.kernels.laws import (
    damper,
    damping_impulse,
    elastic_force,
    never_pulls,
    sphere_forces,
    wall_force,
)
from beadwave.dem.kernels.ledger import save
from beadwave.dem.kernels.modes import drift_modes, push_modes, push_wall


@fastmath_march
def march(
    motion: Motion, start: Motion, snapshot: Motion, chain: ChainArrays,
    fractions: tuple[Array, Array], correction: Correction | None, steps: Steps, saved: SavedStates,
) -> int:  # fmt: skip
    """n_save times stride steps of kick b[0], drift a[0], kick b[1], ..., kick b[-1], with the
    `fractions` a (n_drifts,), b (n_kicks,) of the step.

    The state is saved before and after each stride. `start` keeps that at the start of the last
    step; `snapshot` shares the state but has an array of forces of its own, as what is saved are
    total forces at an instant, and what is marched by may be of earlier positions. Changes motion
    and modes in place. Ends early, and says after how many saves, when a state is not finite.
    """
    (a, b), (dt, n_save, stride) = fractions, steps
    x, v, wall = motion.x, motion.v, motion.wall
    stale = n_save >= 0  # a literal True would compile what takes it once more
    for k in range(n_save + 1):
        for _step in range(stride if k > 0 else 0):
            if correction is not None or chain.plastic is not None:
                for i in range(x.size):
                    start.x[i], start.v[i] = x[i], v[i]
                for i in range(wall.size):
                    start.wall[i] = wall[i]

            # the forces of a kick serve the next one too where nothing has moved between them
            for i in range(b.size):
                kick = b[i] * dt
                drift = a[i] * dt if i < a.size else 0.0
                flow(i, kick, drift, stale, motion, chain, chain.bare, chain.damping)
                stale = drift != 0.0 or (stale and kick == 0.0)

            # what the scheme missed at contacts that opened or closed, and those that yielded
            if correction is not None:
                if crossed(motion, start, chain.A, chain.offset, chain.plastic):
                    correct_events(
                        dt, motion, start, chain, correction, chain.damping, chain.plastic
                    )
                    stale = True
            stale |= yield_contacts(dt, motion, start, chain, chain.plastic)
        if not save(k, dt, snapshot, chain, saved, chain.mobility):
            return k
    return n_save


@fastmath_inline
def flow(
    k: int, kick: float, drift: float, stale: bool, motion: Motion, chain: ChainArrays,
    bare: tuple | None, damping: Damping | None,
) -> None:  # fmt: skip
    """Kick, then the k-th drift, of `kick` and `drift` [s]; forces are computed anew where
    positions moved (`stale`).

    Dampers act between two halves of the elastic kick. Those of neighbouring contacts share a
    sphere and do not commute: half of the even ones, the odd ones, the other half of the even ones
    is symmetric, which keeps the order of the scheme.
    """
    if kick != 0.0:
        if bare is not None:
            flow_bare(k, kick, drift, stale, motion, chain)
            return
        if stale:
            sphere_forces(motion.x, chain.A, motion.f, chain.shape, chain.plastic)
        if damping is None:
            pull_wall(kick, stale, motion, chain)
            push(kick, motion, chain, chain.friction, chain.modes)
        else:
            pull_wall(0.5 * kick, stale, motion, chain)
            push(0.5 * kick, motion, chain, chain.friction, chain.modes)
            for first, share in ((0, 0.5), (1, 1.0), (0, 0.5)):
                damp_contacts(first, share * kick, motion, chain, damping)
            pull_wall(0.5 * kick, chain.mobility is not None, motion, chain)
            push(0.5 * kick, motion, chain, chain.friction, chain.modes)
    if drift != 0.0:
        drift_spheres(k, drift, motion.x, motion.v, chain.leaf)
        drift_modes(k, 0.0, motion.wall, chain.modes)


@fastmath
def drift_spheres(k: int, dt: float, x: Array, v: Array, leaf: LeafSprings | None) -> None:
    """Free flight of spheres x [m], v [m/s], (n,) each, for dt [s], or the exact swing on the leaf
    springs by the k-th drift."""
    if leaf is None:
        for i in range(x.size):
            x[i] += dt * v[i]
    else:
        rest, swing = leaf.rest, leaf.propagator
        for i in range(x.size):
            u = x[i] - rest[i]
            x[i] = rest[i] + swing[k, 0, i] * u + swing[k, 1, i] * v[i]
            v[i] = swing[k, 2, i] * u + swing[k, 0, i] * v[i]


# --- kicks ---------------------------------------------------------------------------------------


@fastmath_inline
def pull_wall(kick: float, stale: bool, motion: Motion, chain: ChainArrays) -> None:
    """Force at the wall, computed anew if positions moved or a dashpot creeps behind it."""
    n = motion.x.size
    if chain.A.size == n and (stale or chain.mobility is not None):
        motion.f[n] = wall_force(
            kick, motion, chain.A, chain.offset, chain.shape, chain.residual, chain.mobility,
            chain.plastic,
        )  # fmt: skip


@fastmath_inline
def push(
    kick: float, motion: Motion, chain: ChainArrays, friction: Array | None,
    modes: WallModes | None,
) -> None:  # fmt: skip
    """Impulse of the elastic forces and the load on spheres and modes over `kick` [s]; friction
    (n,) [N] of the guides. The modes get the force beyond that at rest."""
    v, f, minv = motion.v, motion.f, chain.inverse_mass
    if friction is None:
        push_spheres(v, kick, f, minv, chain.load)
    else:
        motion.ledger[IN_GUIDES] += slide_spheres(v, kick, f, minv, chain.load, friction)
    if modes is not None:
        push_modes(kick * (f[v.size] - modes.rest_force), motion.wall, modes)


@fastmath
def push_spheres(v: Array, dt: float, f: Array, minv: Array, load: Array) -> None:
    """v_i <- v_i + dt (f_{i-1} - f_i + load_i) / m_i, with v, minv = 1/m and load (n,),
    f (n + 1,) [N], dt [s]."""
    for i in range(v.size):
        v[i] += dt * minv[i] * (f[i] - f[i + 1] + load[i])


@fastmath_inline
def damp_contacts(
    first: int, dt: float, motion: Motion, chain: ChainArrays, damping: Damping | None
) -> None:
    """Impulses of the dampers of every second contact, from `first` on, over dt [s]: they share no
    sphere, so each is exact at fixed positions. The ledger gets what each takes,
    I (w - I / 2m) with the impulse I, the rate of approach w before it and 1/m = 1/m_1 + 1/m_2."""
    v, f, wall, minv = motion.v, motion.f, motion.wall, chain.inverse_mass
    n = v.size
    for i in range(first, chain.A.size, 2):
        w = v[i] - (v[i + 1] if i < n - 1 else wall[V])
        c = damper(
            i, i == n - 1, f[i + 1], chain.A, chain.shape, chain.residual, damping, chain.plastic
        )
        if c == 0.0:
            continue
        pair = damping.inverse_mass[i]
        impulse = damping_impulse(w, dt, f[i + 1], c, pair, never_pulls(damping.law))
        motion.ledger[IN_CONTACTS] += impulse * (w - 0.5 * pair * impulse)
        v[i] -= impulse * minv[i]
        if i < n - 1:
            v[i + 1] += impulse * minv[i + 1]
        else:
            push_modes(impulse, wall, chain.modes)


@fastmath_inline
def slide_spheres(
    v: Array, dt: float, f: Array, minv: Array, load: Array, friction: Array
) -> float:
    """`push_spheres` in guides, with the largest friction (n,) [N] of each; what it takes [J]."""
    lost = 0.0
    for i in range(v.size):
        net = f[i] - f[i + 1] + load[i]
        v[i], way = slid(v[i], dt, minv[i] * net, minv[i] * friction[i])
        lost += friction[i] * way
    return lost


@fastmath_inline
def slid(v: float, dt: float, a: float, b: float) -> tuple[float, float]:
    """Velocity [m/s] after dt [s] and way [m] of a body under a constant acceleration a, with
    Coulomb friction of at most b, both in m/s^2: it may stop, stay, and go on the other way."""
    way = 0.0

    # moving: friction opposes the motion until the body stops, if it does within dt
    if v != 0.0:
        rate = a - math.copysign(b, v)
        end = v + dt * rate
        if end * v > 0.0:
            return end, 0.5 * abs(v + end) * dt
        stops = -v / rate
        way = 0.5 * abs(v) * stops
        dt -= stops

    # at rest: friction holds it, or gives way by all that exceeds the bound
    if abs(a) <= b:
        return 0.0, way
    end = dt * (a - math.copysign(b, a))
    return end, way + 0.5 * abs(end) * dt


# --- chains without load, leaf springs, damping, yield and friction ------------------------------


@fastmath_inline
def flow_bare(
    k: int, kick: float, drift: float, stale: bool, motion: Motion, chain: ChainArrays
) -> None:
    """`flow` of a bare chain, in the fewest passes over its arrays; kick and drift in s."""
    x, v, f = motion.x, motion.v, motion.f
    pull_wall(kick, stale, motion, chain)
    if stale:
        kick_and_drift(kick, drift, motion, chain.A, chain.shape, chain.inverse_mass)
    else:
        push_and_drift(kick, drift, x, v, f, chain.inverse_mass)
    kick_and_drift_modes(k, kick, drift, f[x.size], motion.wall, chain.modes)


@fastmath
def kick_and_drift(
    kick: float, drift: float, motion: Motion, A: Array, shape: ForceShape | None, minv: Array
) -> None:
    """Forces, kick and free flight, both in s, of bare spheres in one pass: x_i moves on as soon as
    the forces on either side of it are known. f[n], at the wall, is given; A (n_contacts,),
    minv = 1/m (n,)."""
    x, v, f = motion.x, motion.v, motion.f
    last = v.size - 1
    previous = 0.0  # force between the spheres i - 1 and i
    for i in range(last):
        x_old = x[i]
        d = x_old - x[i + 1]
        force = elastic_force(i, d if d > 0.0 else 0.0, A, shape)
        speed = v[i] + kick * minv[i] * (previous - force)
        f[i + 1] = force
        v[i] = speed
        x[i] = x_old + drift * speed
        previous = force
    v[last] += kick * minv[last] * (previous - f[last + 1])
    x[last] += drift * v[last]


@fastmath_inline
def push_and_drift(kick: float, drift: float, x: Array, v: Array, f: Array, minv: Array) -> None:
    """Kick and free flight, both in s, of bare spheres with the forces f (n + 1,) of the last kick;
    x, v and minv = 1/m (n,)."""
    for i in range(v.size):
        speed = v[i] + kick * minv[i] * (f[i] - f[i + 1])
        v[i] = speed
        x[i] += drift * speed


@fastmath_inline
def kick_and_drift_modes(
    k: int, kick: float, drift: float, force: float, wall: Array, modes: WallModes | None
) -> None:
    """Kick [s] of the modes by the force [N] at the wall (4,), and the k-th drift, in one pass;
    without a drift the kick alone."""
    if modes is None:
        return
    impulse = kick * (force - modes.rest_force)
    if drift == 0.0:
        push_modes(impulse, wall, modes)
    else:
        push_wall(impulse, modes.square, wall)
        drift_modes(k, impulse, wall, modes)
