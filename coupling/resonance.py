"""Resonance curves of a structure that a frictional contact holds, by harmonic balance.

Approach and shift y of the last contact and its forces f, from rest, have harmonics of the shaker's
frequency. All but that contact is linear (`coupling.harmonic_balance`), the contacts before it
springs and dampers under their static forces, which leaves

    y - s + H f(y) = 0,   H = C_ll - C_lu D (1 + C_uu D)^-1 C_ul,   D = k + i omega gamma F

for each harmonic, with C and s of the bodies cut at their contacts, u those before and l the last.
f(y) is the contact's answer at equal instants of the cycle. Newton's method solves for y: df/dy is
known from differences, which no frequency changes, and along each step (C. G. Broyden, Math. Comp.
19 (1965) 577). A curve goes from each frequency and each force to the next, up and down.
T. M. Cameron, J. H. Griffin, J. Appl. Mech. 56 (1989) 149.

Cycles in which contacts before the last one open are beyond this: `coupling.periodic_state` finds
them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.coupling.errors import CouplingError
from beadwave.coupling.harmonic_balance import CutBodies, CycleForces, answer, cut_at_contacts
from beadwave.coupling.spatial_march import Before, PreparedImpact, ShakerForces

Array = NDArray[np.float64]


class HarmonicBalance(NamedTuple):
    """Search for a point of a curve."""

    # heat of a cycle of the shaken rig under 2 N, where all of it slips: 13 % off with 7 harmonics,
    # 1.6 % with 15, 0.02 % with 31, compared with the march in time; under 1 N, where a part slips,
    # 0.3 % with 7
    n_harmonics: int = 15
    n_instants: int = 128  # of a cycle
    # of the contact in two directions: 64 and 256 leave one that sticks 0.35 and 0.09 % soft
    n_cells: int = 128
    laps: int = 2  # of the contact round a cycle
    nudge: float = 1e-5  # of the gross slip: step of the difference quotients
    # motion that is left over: of the gross slip and what mu P moves, and of the cycle's own
    tolerance: float = 1e-5
    # of what is left, over a step, from which the next one takes new difference quotients
    good: float = 0.3
    most_iterations: int = 30
    finer: int = 32  # parts of a step to the next frequency, where a whole one does not converge


class CurvePoint(NamedTuple):
    """One point of a curve."""

    frequency: float  # [Hz]
    force: float  # [N] of the shaker
    motion: float  # [m] half of peak to peak of the wall's point at the contact, along its largest
    slip: float  # [m] half of peak to peak
    friction: float  # [N] half of peak to peak
    energy: float  # [J] heat of friction in a cycle
    stick: float  # least share of the area that sticks
    damping: float  # ratio of friction: heat over 4 pi times the mean energy of the modes
    stiffness: float  # [N/m] of the contact across: first harmonics of force over slip
    harmonics: Array  # ((2 n_harmonics + 1) c,) [m] of y: means, cosines, sines as in `flat`
    jacobian: Array  # ((2 n_harmonics + 1) c,) square [N/m] df/dy of these


def without_other_contacts(cut: CutBodies, body: PreparedImpact, n_harmonics: int) -> Array:
    """H (n_harmonics + 1, c, c) [m/N] of the last contact, c = 1 + n_directions, with the others as
    springs and dampers. Raises CouplingError where a harmonic is the frequency of a mode without
    damping.

    D, the springs and dampers of the other contacts, is never inverted: one without stiffness, as
    of a striker that is not there yet, is in order.
    """
    chain, static, omega = body.prepared.chain, body.prepared.static, cut.omega[: n_harmonics + 1]
    if cut.resonates[: n_harmonics + 1].any():
        h = int(cut.resonates.any(axis=1).argmax())
        raise CouplingError(
            f"a mode without damping lies at {cut.omega[h] / (2.0 * np.pi):.6g} Hz, a harmonic of "
            "the shaker; give it damping, or take another frequency."
        )
    u, C = chain.mass.size - 1, cut.C[: n_harmonics + 1]
    D = np.broadcast_to(cut.K[:u], (omega.size, u)).astype(complex)
    if body.prepared.damping is not None:
        force = np.maximum(static.force[:u], 0.0)
        D += 1j * omega[:, None] * np.asarray(chain.gamma)[:u] * force
    through = np.linalg.solve(np.eye(u) + C[:, :u, :u] * D[:, None, :], C[:, :u, u:])
    return C[:, u:, u:] - (C[:, u:, :u] * D[:, None, :]) @ through


def point(
    body: PreparedImpact,
    frequency: float,
    force: float,
    guess: CurvePoint | None,
    options: HarmonicBalance = HarmonicBalance(),
) -> CurvePoint | None:
    """The periodic motion under the first shaker's force [N] at a frequency [Hz], from a neighbour;
    None where Newton's method does not find it."""
    m, N = options.n_harmonics, options.n_instants
    chain, static = body.prepared.chain, body.prepared.static
    body = body._replace(
        shakers=ShakerForces(np.array([force]), np.array([frequency]), np.zeros(1)),
        search=body.search._replace(n_cells=options.n_cells),
    )
    # contacts that nothing presses are left out
    n_absent = int(np.argmax(static.force > 0.0))
    before = Before(np.zeros(chain.mass.size, bool), n_absent)
    cut = cut_at_contacts(body, before, N)
    H = without_other_contacts(cut, body, m)
    last = chain.mass.size - 1
    c = H.shape[1]

    # of each mean, cosine and sine: what gross slip and mu P move
    F0, A, law = float(static.force[-1]), float(chain.A[-1]), body.last.law
    overlap = (F0 / A) ** (2.0 / 3.0)
    unit = max(law.bound, 1e-3) * overlap
    bound = law.bound * law.modulus * np.sqrt(law.radius)
    most = max(bound * overlap**1.5 * 4.0 / 3.0, 1e-3 * F0)
    scale = flat((unit + most * np.abs(np.einsum("hii->hi", H))) * (1.0 + 1.0j))

    def answered(x: Array) -> tuple[Array, CycleForces]:
        """f of means, cosines and sines x, by the contact's answer at N instants; and that."""
        y = np.zeros((N, cut.K.size))
        y[:, last:] = over_time(harmonics_of(x, c), N)
        now = answer(body, before, cut, y, None, options.laps)
        return flat(of_time(now.force[:, last:] - cut.force[last:], m)), now

    # from the neighbour's cycle, or from what the shakers move where the contact does nothing
    driven = flat(2.0 / N * cut.shaken[: m + 1, last:])
    x, G = (driven, None) if guess is None else (guess.harmonics, guess.jacobian)
    f, now = answered(x)
    residual = (x - driven + moved(H, f)) / scale
    size = float(np.linalg.norm(residual))
    for _ in range(options.most_iterations):
        if size <= options.tolerance * min(1.0, float(np.linalg.norm(x / scale))):
            return shown(body, cut, x, f, G, now, options)

        # G = df/dy by differences where none is at hand; J is then that of the whole equation
        if fresh := G is None:
            nudged = options.nudge * unit * np.eye(x.size)
            G = np.stack([(answered(x + dx)[0] - f) / dx.max() for dx in nudged], axis=1)
        J = np.eye(x.size) + np.stack([moved(H, g) for g in G.T], axis=1)
        dx = np.linalg.solve(J / scale[:, None], -residual)

        # a step that leads further away is cut back along new quotients, not along those of before
        share = 1.0
        while True:
            f_after, now_after = answered(x + share * dx)
            after = (x + share * dx - driven + moved(H, f_after)) / scale
            size_after = float(np.linalg.norm(after))
            nearer = size_after < (1.0 - 0.1 * share) * size
            if nearer or not fresh or share < 1e-3:
                break
            share *= 0.5
        if not nearer:
            if fresh:
                return None
            G = None
            continue

        # Broyden: G along the step is what the step has shown; a poor step asks for new quotients
        dx = share * dx
        G = G + np.outer(f_after - f - G @ dx, dx) / (dx @ dx)
        if size_after > options.good * size:
            G = None
        x, f, now, residual, size = x + dx, f_after, now_after, after, size_after
    return None


def harmonics_of(x: Array, c: int) -> Array:
    """(m + 1, c) complex amplitudes a of the motion Re(a e^(i h w t)), h = 0 to m, from means,
    cosines and sines x ((2 m + 1) c,); the sines count as -sin."""
    m = x.size // c // 2
    parts = x.reshape(2 * m + 1, c)
    return np.vstack([parts[:1], parts[1 : m + 1] + 1j * parts[m + 1 :]])


def flat(amplitudes: Array) -> Array:
    """Means, cosines and sines ((2 m + 1) c,) of complex amplitudes (m + 1, c): the inverse of
    `harmonics_of`."""
    a = amplitudes
    return np.concatenate([a[:1].real, a[1:].real, a[1:].imag]).ravel()


def over_time(amplitudes: Array, N: int) -> Array:
    """(N, c) values at N equal instants of a period, of complex amplitudes (m + 1, c)."""
    spectrum = 0.5 * N * amplitudes
    spectrum[0] *= 2.0
    return np.fft.irfft(spectrum, N, axis=0)


def of_time(values: Array, m: int) -> Array:
    """(m + 1, c) complex amplitudes of values (N, c) over a period."""
    amplitudes = 2.0 / len(values) * np.fft.rfft(values, axis=0)[: m + 1]
    amplitudes[0] *= 0.5
    return amplitudes


def moved(H: Array, f: Array) -> Array:
    """H f, ((2 m + 1) c,) [m], of forces f ((2 m + 1) c,) [N] by means, cosines and sines, with
    H (m + 1, c, c)."""
    return flat(np.einsum("hij,hj->hi", H, harmonics_of(f, H.shape[1])))


def shown(
    body: PreparedImpact,
    cut: CutBodies,
    x: Array,
    f: Array,
    G: Array,
    now: CycleForces,
    options: HarmonicBalance,
) -> CurvePoint:
    """Amplitudes and energies of a periodic motion x, forces f and G = df/dy by means, cosines and
    sines; `now` are the contacts' forces over its cycle."""
    wall, m, N = body.wall, options.n_harmonics, options.n_instants
    last, c = body.prepared.chain.mass.size - 1, 1 + len(body.frame)
    y, F = harmonics_of(x, c), harmonics_of(f, c)

    # the modes under contact and shaker: the wall's motion at the contact, and their mean energy
    push = 2.0 / N * cut.push[: m + 1]
    q = cut.modes[: m + 1] * (F @ cut.phi[:, last:].T + push)
    u = over_time(q @ wall.phi[:, 1:], N)
    mean = 0.25 * (wall.omega**2 + cut.omega[1 : m + 1, None] ** 2) * np.abs(q[1:]) ** 2
    energy, shift = float(np.sum(mean)), over_time(y, N)[:, 1:]
    axis = int(np.ptp(shift, axis=0).argmax())
    friction, first = now.force[:, last + 1 + axis], y[1, 1 + axis]
    return CurvePoint(
        frequency=float(body.shakers.frequency[0]),
        force=float(body.shakers.force[0]),
        motion=0.5 * float(np.ptp(u, axis=0).max()),
        slip=0.5 * float(np.ptp(shift[:, axis])),
        friction=0.5 * float(np.ptp(friction)),
        energy=now.heat,
        stick=float(now.stick.min()),
        damping=now.heat / (4.0 * np.pi * energy) if energy > 0.0 else 0.0,
        stiffness=float((F[1, 1 + axis] / first).real) if abs(first) > 0.0 else 0.0,
        harmonics=x,
        jacobian=G,
    )


def curve(
    body: PreparedImpact,
    frequencies: Sequence[float],
    forces: Sequence[float],
    options: HarmonicBalance = HarmonicBalance(),
) -> list[CurvePoint]:
    """Points at frequencies [Hz] and forces [N] in pairs, each from the one before; where a step is
    too long it is divided, and where the curve turns back the next one starts anew. Raises
    CouplingError where the curve cannot be followed."""
    if np.ndim(body.wall.load) != 2 or body.wall.load.shape[1] != 1:
        raise CouplingError("a resonance curve is that of one shaker; give one.")
    if not body.prepared.static.force[-1] > 0.0:
        raise CouplingError("nothing presses the last contact; give a preload.")
    if not min(frequencies) > 0.0:
        raise CouplingError(f"frequencies must be above 0 Hz, {min(frequencies):g} is not.")
    chain = body.prepared.chain
    damped = chain.gamma is not None and chain.dissipation != "none"
    if damped and float(np.broadcast_to(chain.gamma, chain.mass.size)[-1]) > 0.0:
        raise CouplingError(
            "resonance curves leave the damper of the last contact out; take a restitution of 1 "
            "there, or march to the periodic state."
        )

    # from point to point; a step that is too long is halved, into `finer` parts at most
    points: list[CurvePoint] = []

    def towards(
        begin: tuple[float, float], end: tuple[float, float], guess: CurvePoint | None, parts: int
    ) -> CurvePoint | None:
        """The point at the frequency and force of the end, over one between where that is too far
        from where the guess is."""
        reached = point(body, *end, guess, options)
        if reached is None and parts > 1:
            middle = (0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1]))
            between = towards(begin, middle, guess, parts // 2)
            if between is not None:
                reached = towards(middle, end, between, parts // 2)
        return reached

    for f, F in zip(frequencies, forces, strict=True):
        reached = None
        if points:
            before = points[-1]
            reached = towards((before.frequency, before.force), (f, F), before, options.finer)
        if reached is None:  # the first one, or the curve turns back here: from a small force
            reached = towards((f, 0.0), (f, F), None, options.finer)
        if reached is None:
            raise CouplingError(
                f"the resonance curve cannot be followed to {f:.4g} Hz at {F:.3g} N; take a "
                "smaller force, or a larger preload: contacts may open within the cycle."
            )
        points.append(reached)
    return points
