"""Explicit march: kicks by the contacts, drifts of spheres, leaf springs and modes between them."""

import math

from dem.kernels.arguments import (
    IN_CONTACTS,
    IN_GUIDES,
    Array,
    Correction,
    Damping,
    LeafSprings,
    Modes,
    Motion,
    Parts,
    Saved,
    Steps,
    V,
)
from dem.kernels.compiled import fastmath, fastmath_inline, fastmath_march
from dem.kernels.events import correct_events, crossed, yield_contacts
from dem.kernels.laws import LINEAR, damper, damping_impulse, hertz_force, sphere_forces, wall_force
from dem.kernels.ledger import save
from dem.kernels.modes import drift_modes, push_modes, push_wall

# --- bare chains -------------------------------------------------------------------------------


@fastmath
def kick_and_drift(
    kick: float, drift: float, x: Array, v: Array, A: Array, f: Array, minv: Array
) -> None:
    """Forces, kick and free flight of bare spheres in one pass; f[n], at the wall, is given."""
    last = v.size - 1
    before = 0.0
    for i in range(last):
        here = x[i]
        d = here - x[i + 1]
        force = hertz_force(d if d > 0.0 else 0.0, A[i])
        speed = v[i] + kick * minv[i] * (before - force)
        f[i + 1] = force
        v[i] = speed
        x[i] = here + drift * speed
        before = force
    v[last] += kick * minv[last] * (before - f[last + 1])
    x[last] += drift * v[last]


@fastmath_inline
def push_and_drift(kick: float, drift: float, x: Array, v: Array, f: Array, minv: Array) -> None:
    """The same with forces that are known."""
    for i in range(v.size):
        speed = v[i] + kick * minv[i] * (f[i] - f[i + 1])
        v[i] = speed
        x[i] += drift * speed


@fastmath_inline
def kick_and_drift_modes(
    k: int, kick: float, drift: float, force: float, wall: Array, modes: Modes | None
) -> None:
    if modes is None:
        return
    impulse = kick * (force - modes.rest_force)
    if drift == 0.0:
        push_modes(impulse, wall, modes)
    else:
        push_wall(impulse, modes.square, wall)
        drift_modes(k, impulse, wall, modes)


@fastmath_inline
def flow_bare(k: int, kick: float, drift: float, stale: bool, motion: Motion, parts: Parts) -> None:
    """Forces, kick and drift of a chain without any of the parts that `bare` excludes."""
    x, v, f = motion.x, motion.v, motion.f
    pull_wall(kick, stale, motion, parts)
    if stale:
        kick_and_drift(kick, drift, x, v, parts.A, f, parts.inverse_mass)
    else:
        push_and_drift(kick, drift, x, v, f, parts.inverse_mass)
    kick_and_drift_modes(k, kick, drift, f[x.size], motion.wall, parts.modes)


# --- kicks and drifts with all parts -----------------------------------------------------------


@fastmath
def push_spheres(v: Array, dt: float, f: Array, minv: Array, load: Array | None) -> None:
    if load is None:
        for i in range(v.size):
            v[i] += dt * minv[i] * (f[i] - f[i + 1])
    else:
        for i in range(v.size):
            v[i] += dt * minv[i] * (f[i] - f[i + 1] + load[i])


@fastmath
def drift_spheres(k: int, dt: float, x: Array, v: Array, leaf: LeafSprings | None) -> None:
    """Free flight, or the exact swing on the leaf springs by the k-th drift."""
    if leaf is None:
        for i in range(x.size):
            x[i] += dt * v[i]
    else:
        rest, swing = leaf.rest, leaf.propagator
        for i in range(x.size):
            u = x[i] - rest[i]
            x[i] = rest[i] + swing[k, 0, i] * u + swing[k, 1, i] * v[i]
            v[i] = swing[k, 2, i] * u + swing[k, 0, i] * v[i]


@fastmath_inline
def pull_wall(kick: float, stale: bool, motion: Motion, parts: Parts) -> None:
    """Force at the wall; taken anew where a dashpot creeps in it."""
    n = motion.x.size
    if parts.A.size == n and (stale or parts.mobility is not None):
        motion.f[n] = wall_force(
            kick, motion, parts.A, parts.offset, parts.residual, parts.mobility, parts.plastic
        )


@fastmath_inline
def kick_modes(kick: float, force: float, wall: Array, modes: Modes | None) -> None:
    if modes is not None:
        push_modes(kick * (force - modes.rest_force), wall, modes)


@fastmath_inline
def slid(v: float, dt: float, a: float, b: float) -> tuple[float, float]:
    """Velocity after dt and way of a body that a pushes and Coulomb friction holds by b at most,
    both accelerations: it may stop, stay, and go on the other way."""
    way = 0.0
    if v != 0.0:
        rate = a - math.copysign(b, v)
        end = v + dt * rate
        if end * v > 0.0:
            return end, 0.5 * abs(v + end) * dt
        stops = -v / rate
        way = 0.5 * abs(v) * stops
        dt -= stops
    if abs(a) <= b:
        return 0.0, way
    end = dt * (a - math.copysign(b, a))
    return end, way + 0.5 * abs(end) * dt


@fastmath_inline
def slide_spheres(
    v: Array, dt: float, f: Array, minv: Array, load: Array | None, friction: Array
) -> float:
    """`push_spheres` in guides; what their friction takes."""
    lost = 0.0
    for i in range(v.size):
        net = f[i] - f[i + 1]
        if load is not None:
            net += load[i]
        v[i], way = slid(v[i], dt, minv[i] * net, minv[i] * friction[i])
        lost += friction[i] * way
    return lost


@fastmath_inline
def push(kick: float, motion: Motion, parts: Parts, friction: Array | None) -> None:
    v, f, minv = motion.v, motion.f, parts.inverse_mass
    if friction is None:
        push_spheres(v, kick, f, minv, parts.load)
    else:
        motion.ledger[IN_GUIDES] += slide_spheres(v, kick, f, minv, parts.load, friction)
    kick_modes(kick, motion.f[motion.x.size], motion.wall, parts.modes)


@fastmath_inline
def damp_contacts(
    first: int, dt: float, motion: Motion, parts: Parts, damping: Damping | None
) -> None:
    """Every second contact, from `first` on: they share no sphere."""
    v, f, wall, minv = motion.v, motion.f, motion.wall, parts.inverse_mass
    n = v.size
    for i in range(first, parts.A.size, 2):
        w = v[i] - (v[i + 1] if i < n - 1 else wall[V])
        c = damper(i, i == n - 1, f[i + 1], parts.A, parts.residual, damping, parts.plastic)
        if c == 0.0:
            continue
        pair = damping.inverse_mass[i]
        impulse = damping_impulse(w, dt, f[i + 1], c, pair, damping.law != LINEAR)
        motion.ledger[IN_CONTACTS] += impulse * (w - 0.5 * pair * impulse)
        v[i] -= impulse * minv[i]
        if i < n - 1:
            v[i + 1] += impulse * minv[i + 1]
        else:
            push_modes(impulse, wall, parts.modes)


@fastmath_inline
def kick_all(
    kick: float, stale: bool, motion: Motion, parts: Parts, damping: Damping | None
) -> None:
    """Kick, damping between two halves of the elastic kick; forces anew where positions are."""
    if stale:
        sphere_forces(motion.x, parts.A, motion.f, parts.plastic)
    if damping is None:
        pull_wall(kick, stale, motion, parts)
        push(kick, motion, parts, parts.friction)
        return
    pull_wall(0.5 * kick, stale, motion, parts)
    push(0.5 * kick, motion, parts, parts.friction)
    for first, share in ((0, 0.5), (1, 1.0), (0, 0.5)):
        damp_contacts(first, share * kick, motion, parts, damping)
    pull_wall(0.5 * kick, parts.mobility is not None, motion, parts)
    push(0.5 * kick, motion, parts, parts.friction)


@fastmath_inline
def coast(k: int, drift: float, motion: Motion, parts: Parts) -> None:
    """The k-th drift."""
    if drift != 0.0:
        drift_spheres(k, drift, motion.x, motion.v, parts.leaf)
        drift_modes(k, 0.0, motion.wall, parts.modes)


@fastmath_inline
def flow(
    k: int, kick: float, drift: float, stale: bool, motion: Motion, parts: Parts, bare: tuple | None
) -> None:
    """Kick, then the k-th drift."""
    if bare is not None:
        if kick != 0.0:
            flow_bare(k, kick, drift, stale, motion, parts)
        else:
            coast(k, drift, motion, parts)
        return
    if kick != 0.0:
        kick_all(kick, stale, motion, parts, parts.damping)
    coast(k, drift, motion, parts)


@fastmath_inline
def take_step(dt: float, stale: bool, a: Array, b: Array, motion: Motion, parts: Parts) -> bool:
    """Kick b[0], drift a[0], kick b[1], ..., kick b[-1]; are the forces stale at the end?"""
    for i in range(b.size):
        kick = b[i] * dt
        drift = a[i] * dt if i < a.size else 0.0
        flow(i, kick, drift, stale, motion, parts, parts.bare)
        stale = drift != 0.0 or (stale and kick == 0.0)
    return stale


@fastmath_inline
def keep(motion: Motion, before: Motion) -> None:
    """Copy the state to `before`."""
    for i in range(motion.x.size):
        before.x[i] = motion.x[i]
        before.v[i] = motion.v[i]
    for i in range(motion.wall.size):
        before.wall[i] = motion.wall[i]


@fastmath_inline
def corrected(
    dt: float, motion: Motion, before: Motion, parts: Parts, correction: Correction | None
) -> bool:
    """Correct what the last step missed; was there anything?"""
    if correction is None or not crossed(motion, before, parts.A, parts.offset, parts.plastic):
        return False
    correct_events(dt, motion, before, parts, correction, parts.damping, parts.plastic)
    return True


@fastmath_march
def march(
    motion: Motion, before: Motion, shown: Motion, parts: Parts, fractions: tuple[Array, Array],
    correction: Correction | None, steps: Steps, saved: Saved,
) -> int:  # fmt: skip
    """n_save times stride steps of kick b[0], drift a[0], kick b[1], ..., kick b[-1].

    The state is saved before and after each stride; `before` keeps that of the last step, `shown`
    has forces of its own. Changes motion and modes in place. Ends early, and says after how many
    saves, when a state is not finite.
    """
    (a, b), (dt, n_save, stride) = fractions, steps
    stale = n_save >= 0  # a literal True would compile what takes it once more
    for k in range(n_save + 1):
        for _step in range(stride if k > 0 else 0):
            if correction is not None or parts.plastic is not None:
                keep(motion, before)
            stale = take_step(dt, stale, a, b, motion, parts)
            stale |= corrected(dt, motion, before, parts, correction)
            stale |= yield_contacts(dt, motion, before, parts, parts.plastic)
        if not save(k, dt, shown, parts, saved, parts.mobility):
            return k
    return n_save
