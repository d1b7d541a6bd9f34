"""The cycle that shakers keep up of chain, frictional contact and structure, by harmonic balance.

All bodies are linear between their contacts. Cut there, their approach and shift y (c contacts:
between spheres, at the wall along n, t1, t2) answer the contacts' forces f at each harmonic W of
the shakers' period by a receptance that is known in closed form,

    y = s - C f,    C = sum b b^T / (k - m W^2) + sum phi phi^T / (w^2 - W^2 + 2 i z w W) + S

over spheres, their turns and the wall's modes, with s of the shakers, f and y from rest. The
contacts answer y over time: Hertz' law with its damper, and the frictional contact led twice round
the path (alternating between frequency and time: T. M. Cameron, J. H. Griffin, J. Appl. Mech. 56
(1989) 149). What is to vanish is

    r = (1 + C K)^-1 (s - C f(y) - y)

where K are stiffnesses of the contacts: for f = K y, r is the whole way to the solution. Newton's
method finds it, -dr/dy known along directions that are added where a step is poor (generalised
conjugate residuals: S. C. Eisenstat, H. C. Elman, M. H. Schultz, SIAM J. Numer. Anal. 20 (1983)
345) and along each step (C. G. Broyden, Math. Comp. 19 (1965) 577). Nothing but the path between
samples is approximate: there is no step in the bodies' motion.
"""

import math
from typing import NamedTuple

import numpy as np

from beadwave.coupling.spatial_march import Before, MarchState, PreparedImpact
from beadwave.dem import UnstableStep
from beadwave.dem.friction import stick_stiffness
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.lateral import Springs, press_round
from beadwave.dem.kernels.spatial import (
    BEYOND_MODES,
    BY_CONTACT,
    BY_SHAKERS,
    DAMPED,
    RUBBED,
    FrictionalContact,
    SavedSpatial,
)

# Search for a cycle
# of the contacts; 10 to 120 are usual, and cycles that slip as a whole are found by few or none
MAX_EVALUATIONS = 160
# evaluations after which a cycle that still changes by more than `far` is given up: of 60
# random scenes those found had come below 0.004 by then, the others ended above 0.004
EARLY_EVALUATIONS = 40
FAR_CHANGE = 0.05
N_LAPS = 2  # of the frictional contact round a cycle
MAX_DIRECTIONS = 60  # of a Newton step, at most
LINEAR_RESIDUAL = 0.1  # of a Newton step's equation that may be left
# change of r over a step from which the next one takes no new directions; 0.1 to 0.5 take as
# many evaluations to 20 %
GOOD_CHANGE = 0.3
MAX_CUT_BACKS = 3  # of a Newton step that leads further away, each to its half
NUDGE = 1e-6  # of the cycle's size: differences along a direction; not varied
STUCK_SHARE = 0.8  # K across, of the contact's stiffness where it sticks; 0.6 to 0.8 tried
MIN_WEIGHT = 1e-2  # K at least, over its largest, by which motions are weighed
# of the contact's stiffness: springs of bodies that nothing holds; and of a body's own, what a
# harmonic leaves of it where it resonates
WEAK_SPRING = 1e-9


class InverseUpdate(NamedTuple):
    """By what -dr/dy differs from 1 on a cycle, in pairs: P = 1 + sum w e^T is near its inverse."""

    w: list  # of (N, c), in units of force
    e: list  # of (N, c), orthonormal for those found together, with the mean over time

    def step(self, r: Array) -> Array:
        """P r (N, c), the step that what is known would take for the residual r (N, c)."""
        share = [float(np.vdot(e, r)) / len(r) for e in self.e]
        return r + sum(x * w for x, w in zip(share, self.w, strict=True))

    def resampled(self, n_samples: int) -> "InverseUpdate":
        """Forces of a cycle of n_samples instants."""
        return InverseUpdate(*([resampled(x, n_samples) for x in part] for part in self))


class CutBodies(NamedTuple):
    """The bodies, cut at their contacts, at h harmonics of a period."""

    omega: Array  # (h,) [rad/s]
    C: Array  # (h, c, c) [m/N] answer of approach and shift to contact forces
    shaken: Array  # (h, c) [m] s, as numpy.fft.rfft counts it
    K: Array  # (c,) [N/m] of the contacts under their static forces, the last ones sticking
    rest: Array  # (c,) [m] overlaps at rest, 0 across
    force: Array  # (c,) [N] at rest
    sphere: Array  # (h, n) [m/N] of the spheres along the chain
    across: Array  # (h, d) [m/N] of the last sphere's centre across
    turn: Array  # (h,) [rad/(N m)] of its turn
    modes: Array  # (h, k) [s^2] of the modes; 0 of those that resonate
    resonates: Array  # (h, k) mask of modes without damping at a harmonic, see `resonant_modes`
    phi: Array  # (k, c) [kg^-1/2] participations of the modes in approach and shift
    push: Array  # (h, k) of the shakers on the modes, as numpy.fft.rfft counts it
    residual: Array  # (h, 1 + d) [m] motion L f of the contact


class CycleForces(NamedTuple):
    """Forces of the contacts over a cycle, at N times."""

    force: Array  # (N, c) [N], dampers included
    elastic: Array  # (N, c) [N] without dampers
    stick: Array  # (N,) share of the area
    heat: float  # [J] of friction in a period
    damped: float  # [J] of the dampers in a period
    creep: float  # change of the tangential force over the period, over its largest
    contacts: FrictionalContact  # springs of the frictional contact at t = 0
    slip: Array  # (d,) [m] where these are


class Balance(NamedTuple):
    """A cycle in which forces and motions agree, at N times from t = 0 on."""

    cut: CutBodies
    y: Array  # (N, c) [m]
    answer: CycleForces
    change: float  # of y by a step of r, over its size, both as forces K y
    evaluations: int
    learned: InverseUpdate


def cut_at_contacts(body: PreparedImpact, before: Before, n_samples: int) -> CutBodies:
    """The bodies of a chain before the striker, at the n_samples // 2 + 1 harmonics of the shakers'
    period.

    A body that its contacts alone hold has no static receptance, and an undamped one has none at
    its own frequency. The first gets a spring of `weak` times the contacts' stiffness, the second
    `weak` times its own stiffness as its dynamic one: both are too soft to be seen next to the
    contacts. Modes of the wall that resonate are left to `resonant_modes`.
    """
    chain, static, wall, Q = body.prepared.chain, body.prepared.static, body.wall, body.to_frame
    n, d = chain.mass.size, len(body.frame)
    inverse = 1.0 / np.asarray(chain.mass, float)
    inverse[before.held] = 0.0
    A = np.array(chain.A, float)
    A[: before.n_absent] = 0.0
    k = 1.5 * (A**2 * np.maximum(static.force, 0.0)) ** (1.0 / 3.0)
    a = math.sqrt(body.last.law.radius * (max(static.force[-1], 0.0) / A[-1]) ** (2.0 / 3.0))
    k_t = float(stick_stiffness(body.last.law, a))
    omega = 2.0 * np.pi / body.shakers.period * np.arange(n_samples // 2 + 1)

    def oscillator(inverse: Array, stiffness: Array) -> Array:
        """(h, ...) [m/N] receptance of masses on springs; 0 of those held fast."""
        inverse, stiffness = np.atleast_1d(inverse), np.atleast_1d(stiffness)
        free = inverse > 0.0
        mass = 1.0 / np.where(free, inverse, 1.0)
        soft = np.maximum(stiffness, WEAK_SPRING * max(k.max(), k_t))
        dynamic = soft - np.multiply.outer(omega**2, mass)
        least = WEAK_SPRING * soft  # of a body without damping at a harmonic
        return free / np.where(np.abs(dynamic) < least, least, dynamic)

    leaf, R = np.broadcast_to(chain.springs[0], n), float(chain.radius[-1])
    inverse_across, inverse_inertia = body.mobility()
    arm = np.where(inverse_across > 0.0, body.arm_stiffness(), 0.0)
    kappa = float(body.last.arm_rotation) if inverse_inertia > 0.0 else 0.0
    sphere = oscillator(inverse, leaf)
    across = oscillator(inverse_across, arm)
    turn = oscillator(inverse_inertia * R**2, kappa / R**2)[:, 0]  # of R psi under T
    w = np.asarray(wall.omega, float)
    dynamic = w**2 - omega[:, None] ** 2 + 2j * wall.zeta * w * omega[:, None]
    resonates = np.abs(dynamic) <= WEAK_SPRING * w**2
    modes = ~resonates / np.where(resonates, 1.0, dynamic)

    # spheres join contacts before and behind, the wall's modes and S the last ones
    phi, c = Q @ wall.phi.T, n + d
    C = np.zeros((omega.size, c, c), complex)
    last = np.arange(n - 1, c)
    for i in range(n):
        b = np.zeros(c)
        b[i] = 1.0
        b[i - 1 if i else i] -= 1.0 if i else 0.0
        C += sphere[:, i, None, None] * np.outer(b, b)
    for j in range(d):
        C[:, n + j, n + j] += across[:, j] + turn
    at_wall = np.einsum("ik,hk,jk->hij", phi, modes, phi, optimize=True)
    C[np.ix_(np.arange(omega.size), last, last)] += at_wall + Q @ wall.residual_compliance @ Q.T

    # the shakers' forces at their harmonics
    push, shaken, residual = (np.zeros((omega.size, m), complex) for m in (w.size, c, 1 + d))
    for j, frequency in enumerate(np.asarray(body.shakers.frequency, float)):
        h = round(frequency * body.shakers.period)
        force = 0.5 * n_samples * body.shakers.force[j] * np.exp(1j * body.shakers.phase[j])
        push[h] += force * wall.load[:, j]
        residual[h] += force * (Q @ wall.load_residual[:, j])
    shaken[:, last] -= (modes * push) @ phi.T + residual

    offset = float(wall.phi[:, 0] @ static.q)
    at_rest = np.zeros(c)
    at_rest[: n - 1] = static.x[:-1] - static.x[1:]
    S = np.asarray(wall.residual_compliance, float)
    at_rest[n - 1] = static.x[-1] - offset - S[0, 0] * static.force[-1]
    force = np.append(static.force, np.zeros(d))
    K = np.append(k, np.full(d, k_t))
    participations = np.zeros((w.size, c))
    participations[:, last] = phi.T
    return CutBodies(
        omega, C, shaken, K, at_rest, force, sphere, across, turn, modes, resonates, participations,
        push, residual,
    )  # fmt: skip


class ResonantModes(NamedTuple):
    """Modes that the contacts alone hold at a harmonic: their motion q = fixed + gain g under
    contact forces f = K y + g, and what they move the contacts by, y -= moves q."""

    modes: Array  # (r,) their numbers
    fixed: Array  # (r,) [kg^1/2 m]
    gain: Array  # (r, c) [kg^1/2 m/N]
    moves: Array  # (c, r) [kg^-1/2]


def resonant_modes(cut: CutBodies, h: int, K: Array) -> ResonantModes:
    """Modes without damping at harmonic h, where the contacts have the stiffnesses K (c,) [N/m]:
    0 = P f + p with their participations P and the push p. With the other bodies'
    y = (1 + C K)^-1 (s - C g - P^T q),

        P K (1 + C K)^-1 P^T q = p + P K (1 + C K)^-1 (s - C g) + P g

    Raises UnstableStep for one that is pushed and that no contact holds."""
    (modes,) = np.nonzero(cut.resonates[h])
    P, p = cut.phi[modes], cut.push[h, modes]
    A = np.linalg.inv(np.eye(K.size) + cut.C[h] * K)
    moves = A @ P.T
    contact_stiffness = P @ (K[:, None] * moves)
    weak = (
        np.linalg.svd(contact_stiffness, compute_uv=False)[-1]
        <= 1e-12 * np.abs(K).max() * (P**2).sum()
    )
    if weak and np.abs(p).max() > 0.0:
        raise UnstableStep(
            f"the shakers push a mode without damping at its own {cut.omega[h] / 2 / np.pi:.6g} "
            "Hz, which no contact holds: it grows without end; give it damping, or take another "
            "frequency"
        )
    inverse = np.linalg.pinv(contact_stiffness)
    fixed = inverse @ (p + P @ (K * (A @ cut.shaken[h])))
    gain = inverse @ (P - P @ (K[:, None] * (A @ cut.C[h])))
    return ResonantModes(modes, fixed, gain, moves)


def let_go(
    body: PreparedImpact, cut: CutBodies, pushed: Array
) -> tuple[FrictionalContact, Array, Array]:
    """Contact, shift (d,) [m] and tangential force (d,) [N] of bodies at rest after the contact was
    pressed and pushed to and fro by (d,) [m]: friction holds them where the last push has left the
    force at its bound. Without a push the contact was never sheared."""
    n, d = body.prepared.chain.mass.size, len(body.frame)
    contacts, slip, force = body.at_rest().contacts, np.zeros(d), np.zeros((2, d))
    path = np.zeros((2, 2 + d))
    path[:, :2] = max(float(cut.rest[n - 1]), 0.0), 1.0
    path[:, 2:] = -pushed, pushed
    springs = Springs(contacts.row, contacts.room, contacts.cells)
    press_round(body.last.law, 1, path, springs, slip, force, np.zeros(2))
    return contacts, -cut.C[0, n:, n:].real @ force[0], force[0]


def answer(
    body: PreparedImpact,
    before: Before,
    cut: CutBodies,
    y: Array,
    memory: CycleForces | None,
    laps: int,
    pushed: Array | None = None,
) -> CycleForces:
    """Forces of the contacts on the cycle y (N, c) [m], led round it `laps` times: from what
    another cycle left, else from rest, after pushes of the frictional contact by (d,) [m] if any
    (`let_go`)."""
    chain, law = body.prepared.chain, body.last.law
    n, d, N = chain.mass.size, len(body.frame), len(y)

    # along the chain: Hertz' force and its damper, whose rate of approach is the cycle's own
    A = np.array(chain.A, float)
    A[: before.n_absent] = 0.0
    overlap = np.maximum(cut.rest[:n] + y[:, :n], 0.0)
    elastic = A * overlap**1.5
    pressure, damped = np.ones((N, n)), 0.0
    if body.prepared.damping is not None:
        gamma = np.asarray(chain.gamma, float)
        rate = np.fft.irfft(1j * cut.omega[:, None] * np.fft.rfft(y[:, :n], axis=0), N, axis=0)
        pressure = np.maximum(1.0 + gamma * rate, 0.0)
        lost = np.mean((pressure - 1.0) * elastic * rate, axis=0)
        damped = body.shakers.period * float(lost.sum())

    # across: the frictional contact is led round the path of overlap, pressure and shift
    tangential, stick = np.zeros((N, d)), np.zeros(N)
    path = np.column_stack([overlap[:, -1], pressure[:, -1], y[:, n:]])
    if memory is None:
        contacts, slip, _ = let_go(body, cut, np.zeros(d) if pushed is None else pushed)
    else:
        contacts, slip = memory.contacts.copied(), memory.slip.copy()
    springs = Springs(contacts.row, contacts.room, contacts.cells)
    heat, change = press_round(law, laps, path, springs, slip, tangential, stick)
    return CycleForces(
        force=np.column_stack([elastic * pressure, tangential]),
        elastic=np.column_stack([elastic, tangential]),
        stick=stick,
        heat=heat,
        damped=damped,
        creep=change / (float(np.abs(tangential).max()) or 1.0),
        contacts=contacts,
        slip=slip,
    )


def balance(
    body: PreparedImpact,
    before: Before,
    n_samples: int,
    tolerance: float,
    creep: float,
    *,
    start: Balance | None = None,
    pushed: Array | None = None,
) -> Balance:
    """A cycle of n_samples to a change of `tolerance`, from one of any number of samples; its
    change is above the tolerance where none is found. Before it the contact was never sheared, or
    pushed to and fro by (d,) [m].

    In one direction a contact comes into its cycle at once; across that direction what slips
    little forgets its shear over many periods, which are added until one creeps by `creep`. Raises
    UnstableStep as of `resonant_modes`.
    """
    # r is linear but for what the contacts answer beyond K y: A = (1 + C K)^-1 harmonic by harmonic
    cut = cut_at_contacts(body, before, n_samples)
    N, c, d = n_samples, cut.K.size, len(body.frame)
    K = cut.K.copy()
    K[c - d :] *= STUCK_SHARE
    A = np.linalg.inv(np.eye(c) + cut.C * K)
    AC = A @ cut.C
    linear = (A @ cut.shaken[:, :, None])[:, :, 0]
    for h in np.flatnonzero(cut.resonates.any(axis=1)):
        resonant = resonant_modes(cut, h, K)
        linear[h] -= resonant.moves @ resonant.fixed
        AC[h] += resonant.moves @ resonant.gain
    # contacts that little presses are weighed as well, else their spheres drift unseen
    units = np.maximum(K, MIN_WEIGHT * K.max())
    evaluations, memory = 0, None

    def residual(y: Array) -> tuple[Array, CycleForces]:
        """r, as forces K r, and what the contacts answer."""
        nonlocal evaluations
        evaluations += 1
        now = answer(body, before, cut, y, memory, N_LAPS, pushed)
        beyond = np.fft.rfft(now.force - cut.force - K * y, axis=0)
        r = np.fft.irfft(linear - (AC @ beyond[:, :, None])[:, :, 0], N, axis=0) - y
        return units * r, now

    def size(r: Array) -> float:
        """Root mean square over time of r (N, c), as forces [N]."""
        return float(np.sqrt(np.vdot(r, r) / N))

    y = np.fft.irfft(linear, N, axis=0) if start is None else resampled(start.y, N)
    learned = InverseUpdate([], []) if start is None else start.learned.resampled(N)
    r, now = residual(y)
    trusted = True  # what was learned
    while True:
        change = size(r) / (size(units * y) or 1.0)
        best = Balance(cut, y, now, change, evaluations, learned)
        if change <= tolerance and now.creep <= creep:
            return best
        lost = evaluations >= EARLY_EVALUATIONS and change > FAR_CHANGE
        if lost or evaluations >= MAX_EVALUATIONS:
            return best._replace(change=max(change, now.creep))
        if not math.isfinite(change):
            return best._replace(change=math.inf)

        # in its cycle but for what creeps: on from there
        if change <= tolerance:
            memory = now
            r, now = residual(y)
            continue

        # a step by what is known of dr/dy, which becomes known along the step
        if trusted:
            s = learned.step(r)
            r_after, now_after = residual(y + s / units)
            e, norm = r - r_after, size(r - r_after)
            if norm > 0.0:
                learned.w.append((s - learned.step(e)) / norm)
                learned.e.append(e / norm)
            trusted = size(r_after) <= GOOD_CHANGE * size(r)
            if size(r_after) <= size(r):
                y, r, now = y + s / units, r_after, now_after
            continue

        # Newton's step: directions d, each what is known to solve what remains, and e = -dr/dy d
        remaining, s, D, E = r, np.zeros_like(r), [], []
        length = NUDGE * size(units * y)
        while len(D) < MAX_DIRECTIONS and size(remaining) > LINEAR_RESIDUAL * size(r):
            direction = learned.step(remaining)
            direction = direction / size(direction)
            e = (r - residual(y + length * direction / units)[0]) / length
            for d_before, e_before in zip(D, E, strict=True):
                share = float(np.vdot(e_before, e)) / N
                e, direction = e - share * e_before, direction - share * d_before
            norm = size(e)
            if not norm > 0.0:
                break
            D.append(direction / norm)
            E.append(e / norm)
            share = float(np.vdot(E[-1], remaining)) / N
            remaining, s = remaining - share * E[-1], s + share * D[-1]
        new = [direction - learned.step(e) for direction, e in zip(D, E, strict=True)]
        learned = InverseUpdate([*learned.w, *new], [*learned.e, *E])
        for _ in range(MAX_CUT_BACKS + 1):
            r_after, now_after = residual(y + s / units)
            if size(r_after) < size(r):
                break
            s = 0.5 * s
        y, r, now, trusted = y + s / units, r_after, now_after, True


def resampled(y: Array, n_samples: int) -> Array:
    """A cycle (N, c) at n_samples instants, (n_samples, c): harmonics beyond those of the fewer
    samples are 0, and so is the highest of these."""
    out = np.zeros((n_samples // 2 + 1, y.shape[1]), complex)
    spectrum = np.fft.rfft(y, axis=0)
    m = min(len(out), len(spectrum)) - 1
    out[:m] = spectrum[:m] * (n_samples / len(y))
    return np.fft.irfft(out, n_samples, axis=0)


def cycle_of(
    body: PreparedImpact, balance: Balance, n_saves: int
) -> tuple[MarchState, SavedSpatial]:
    """The state at t = 0, and n_saves + 1 instants of the period as a march would save them.

    Of the energies the last instant has what a period adds: friction's heat, what is lost in
    dampers, work of the contact and of the shakers on the modes, and on the motion L f; the first
    instant has none, and those between are not known.
    """
    cut, answer, y = balance.cut, balance.answer, balance.y
    n, N = body.prepared.chain.mass.size, len(y)
    wall, Q, R = body.wall, body.to_frame, float(body.prepared.chain.radius[-1])
    period, rate = body.shakers.period, 1j * cut.omega[:, None]
    f = np.fft.rfft(answer.force - cut.force, axis=0)

    def over_time(spectrum: Array) -> Array:
        """Values at N instants of a spectrum (h, ...) as numpy.fft.rfft counts it."""
        return np.fft.irfft(spectrum, N, axis=0)

    # the modes under forces; the spheres by approach and shift from there on, as soft springs would
    # make much of what little the forces still change by
    phi = Q @ wall.phi.T
    q = cut.modes * (f[:, n - 1 :] @ phi + cut.push)
    for h in np.flatnonzero(cut.resonates.any(axis=1)):
        resonant = resonant_modes(cut, h, cut.K)
        beyond = f[h] - cut.K * np.fft.rfft(y, axis=0)[h]
        q[h, resonant.modes] = resonant.fixed + resonant.gain @ beyond
    wall_motion = q @ phi.T
    at_wall = np.fft.rfft(y, axis=0)
    at_wall[:, n - 1 :] += wall_motion + f[:, n - 1 :] @ (Q @ wall.residual_compliance @ Q.T)
    at_wall[:, n - 1 :] += cut.residual
    x = np.cumsum(at_wall[:, n - 1 :: -1], axis=1)[:, ::-1] * (cut.sphere[0] > 0.0)
    u, turned = -cut.across * f[:, n:], -cut.turn[:, None] * f[:, n:]
    # what the forces still change by moves centre and turn each by its receptance: a centre on a
    # stiff arm follows its force well, the turn of a sphere that rolls hardly
    missing = at_wall[:, n:] - u - turned
    softness = np.abs(cut.across) + np.abs(cut.turn)[:, None]
    share = np.abs(cut.across) / np.where(softness > 0.0, softness, 1.0)
    u, psi = u + share * missing, (turned + (softness > 0.0) * (1.0 - share) * missing) / R

    # work and losses: the mean of a product is 2 Re sum A B* / N^2
    def mean(a: Array, b: Array) -> float:
        """Mean over a period of the product of two motions of spectra (h, ...), summed over all
        but time; right where one of them has no mean, as velocities have none."""
        return 2.0 * float(np.real(np.vdot(b, a))) / N**2

    work = period * mean(rate * q, cut.push)
    beyond = period * mean(rate * f[:, n - 1 :], cut.residual)
    lost = period * mean(rate * q, 2.0 * wall.zeta * wall.omega * (rate * q))

    # as saved
    every = np.append(np.arange(0, N, N // n_saves), 0)
    k = n_saves + 1
    energy = np.zeros((k, 9))
    energy[-1, RUBBED] = answer.heat
    energy[-1, DAMPED] = answer.damped
    energy[-1, BY_CONTACT] = lost - work
    energy[-1, BY_SHAKERS] = work
    energy[-1, BEYOND_MODES] = beyond
    across = np.stack([over_time(part) for part in (u, rate * u, psi, rate * psi)], axis=1)
    static = body.prepared.static
    saved = SavedSpatial(
        x=(static.x + over_time(x))[every],
        v=over_time(rate * x)[every],
        contact_force=answer.force[every, :n],
        across=across[every],
        force=answer.elastic[every, n - 1 :],
        slip=y[every, n:],
        wall=np.stack([over_time(wall_motion), over_time(rate * wall_motion)], axis=1)[every],
        stick=answer.stick[every],
        motion=over_time(cut.residual)[every],
        energy=energy,
        q=np.zeros((k, 0)),
        p=np.zeros((k, 0)),
    )

    moving = body.at_rest()
    motion = moving.motion
    for values, at_0 in (
        (motion.x, saved.x[0]), (motion.v, saved.v[0]), (motion.u, across[0, 0]),
        (motion.u_v, across[0, 1]), (motion.psi, across[0, 2]), (motion.spin, across[0, 3]),
        (motion.q, over_time(q)[0]), (motion.p, over_time(rate * q)[0]),
        (motion.force, saved.force[0]), (motion.slip, y[0, n:]), (motion.wall, saved.wall[0]),
    ):  # fmt: skip
        values[:] = at_0
    motion.f[1:] = answer.elastic[0, :n]
    return moving._replace(contacts=answer.contacts), saved
