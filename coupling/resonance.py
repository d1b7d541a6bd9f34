"""Resonance curves of a structure that a frictional contact holds, by harmonic balance.

The relative motion r of the last sphere and the wall, r = (overlap, slip along t1 and t2), and the
force F of the contact on the wall are periodic, with harmonics r_h and F_h of the shaker's circular
frequency omega. All but the contact is linear:

    r_h - r_h^0 + H(h omega) F_h(r) = 0,   h = 0..n_harmonics

with the receptances H = H_wall + H_sphere of the structure and of sphere, arm and chain, and what
the shaker alone would move, r^0. F(r) is the contact's own force at equal instants of the cycle:
Hertz' law and the springs of `dem.kernels.tangential`, after cycles that leave no trace of the
start. Newton's method solves for r_h; a curve goes from each frequency and each force to the next,
up and down. T. M. Cameron, J. H. Griffin, J. Appl. Mech. 56 (1989) 149.

The chain before the last sphere is linear about its static forces: cycles in which those contacts
open are beyond this, and `coupling.periodic_state` marches them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.errors import CouplingError
from coupling.spatial_march import Body
from dem.friction import open_cells
from dem.kernels.cycles import cycle_forces

Array = NDArray[np.float64]


class HarmonicBalance(NamedTuple):
    """How a point of a curve is found."""

    # heat of a cycle of the shaken rig under 2 N, where all of it slips: 13 % off with 7 harmonics,
    # 1.6 % with 15, 0.02 % with 31, beside the march in time; under 1 N, where a part slips, 0.3 %
    # with 7
    n_harmonics: int = 15
    n_instants: int = 128  # of a cycle
    n_cells: int = (
        128  # of the contact: 64 and 256 leave a contact that sticks 0.35 and 0.09 % soft
    )
    nudge: float = 1e-5  # of the gross slip: step of the difference quotients
    tolerance: float = 1e-5  # of the gross slip and what mu P moves: motion that is left over
    most_iterations: int = 30
    finer: int = 16  # parts of a step to the next frequency, where a whole one does not converge
    hold: float = 1.0  # [N/m] along the chain, of a chain that nothing holds; not varied
    # of a mode's stiffness: what a harmonic may leave of it at least; below, H loses its digits
    resonant: float = 1e-9


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
    harmonics: Array  # (n_harmonics + 1, 3) complex, of r


def receptances(body: Body, omega: float, options: HarmonicBalance) -> tuple[Array, Array]:
    """H (3, 3) of the relative motion under contact forces, and r^0 (3,) complex under the unit
    force of the first shaker, at a circular frequency. Raises CouplingError where that is the
    frequency of a mode without damping."""
    wall, chain, static = body.wall, body.prepared.chain, body.prepared.static
    dynamic = wall.omega**2 - omega**2 + 2j * wall.zeta * wall.omega * omega
    if (np.abs(dynamic) <= options.resonant * wall.omega**2).any():
        raise CouplingError(
            f"a mode without damping lies at {omega / (2.0 * np.pi):.6g} Hz, a harmonic of the "
            "shaker; give it damping, or take another frequency."
        )
    response, hold = 1.0 / dynamic, options.hold
    H = (wall.phi.T * response) @ wall.phi + wall.residual_compliance
    alone = -((wall.phi.T * response) @ wall.load[:, 0] + wall.load_residual[:, 0])

    # the chain along its line, contacts before the last linear about their static forces
    n = chain.mass.size
    force = np.maximum(static.force[: n - 1], 0.0)
    stiffness = 1.5 * (np.asarray(chain.A)[: n - 1] ** 2 * force) ** (1.0 / 3.0)
    gamma = 0.0
    if chain.gamma is not None and chain.dissipation != "none":
        gamma = np.asarray(chain.gamma)[: n - 1]
    K = np.diag(chain.springs[0] - omega**2 * np.asarray(chain.mass, float)).astype(complex)
    for i, k in enumerate(stiffness + 1j * omega * gamma * force):
        b = np.zeros(n)
        b[i], b[i + 1] = 1.0, -1.0
        K += k * np.outer(b, b)
    K[0, 0] += hold
    H[0, 0] += np.linalg.solve(K, np.eye(n)[-1])[-1]

    # the last sphere across: on its arm, and turning about its middle
    for j, k in enumerate(np.broadcast_to(body.last.arm_stiffness, 2)):
        if np.isfinite(k):
            rest = max(float(k), hold)
            H[1 + j, 1 + j] += 1.0 / (rest - omega**2 * float(chain.mass[-1]))
        if np.isfinite(body.last.arm_rotation):
            turn = max(float(body.last.arm_rotation), hold * chain.radius[-1] ** 2)
            H[1 + j, 1 + j] += chain.radius[-1] ** 2 / (turn - omega**2 * body.last.inertia)
    return H, alone


class ContactCycle(NamedTuple):
    """What the contact answers to a motion."""

    force: Array  # (k, 3) [N] on the wall along n, t1, t2, above the static one
    heat: float  # [J]
    stick: float


def contact_cycle(body: Body, r: Array, options: HarmonicBalance) -> ContactCycle:
    """Forces over a cycle of relative motion r (k, 3) [m] about the static state."""
    chain, static = body.prepared.chain, body.prepared.static
    A, F0 = float(chain.A[-1]), float(static.force[-1])
    overlap = (F0 / A) ** (2.0 / 3.0) + r[:, 0]
    force = np.empty((len(r), 3))
    force[:, 0] = A * np.maximum(overlap, 0.0) ** 1.5 - F0
    across = np.empty((len(r), 2))
    heat, stick = cycle_forces(
        open_cells(options.n_cells), body.last.law, overlap, np.ascontiguousarray(r[:, 1:]), across
    )
    force[:, 1:] = across
    return ContactCycle(force, heat, stick)


def point(
    body: Body,
    frequency: float,
    force: float,
    guess: Array | None,
    options: HarmonicBalance = HarmonicBalance(),
) -> CurvePoint | None:
    """The periodic motion under the first shaker's force [N] at a frequency [Hz], from the
    harmonics of a neighbour; None where Newton's method does not find it."""
    m, k = options.n_harmonics, options.n_instants
    omega = 2.0 * np.pi * frequency
    systems = [receptances(body, h * omega, options) for h in range(m + 1)]
    H = np.array([H for H, _ in systems])
    driven = np.zeros((m + 1, 3), complex)
    driven[1] = force * systems[1][1]

    # unknowns: the real mean, then real and imaginary parts, in units of the gross slip
    F0, A = float(body.prepared.static.force[-1]), float(body.prepared.chain.A[-1])
    overlap = (F0 / A) ** (2.0 / 3.0)
    unit = max(body.last.law.bound, 1e-3) * overlap
    bound = body.last.law.bound * body.last.law.modulus * np.sqrt(body.last.law.radius)
    most = max(bound * overlap**1.5 * 4.0 / 3.0, 1e-3 * F0)  # mu P

    scale = unit + most * np.abs(np.einsum("hii->hi", H))

    def harmonics(x: Array) -> Array:
        parts = x.reshape(2 * m + 1, 3) * unit
        return np.vstack([parts[:1], parts[1 : m + 1] + 1j * parts[m + 1 :]])

    def flat(c: Array) -> Array:
        return np.concatenate([c[:1].real, c[1:].real, c[1:].imag]).ravel()

    t = np.arange(k) / k
    waves = np.exp(2j * np.pi * np.outer(t, np.arange(m + 1)))
    weights = np.full(m + 1, 2.0 / k)
    weights[0] = 1.0 / k

    def answer(x: Array) -> tuple[Array, ContactCycle]:
        c = harmonics(x)
        cycle = contact_cycle(body, (waves @ c).real, options)
        F = weights[:, None] * (waves.conj().T @ cycle.force)
        return flat((c - driven + np.einsum("hij,hj->hi", H, F)) / scale), cycle

    x = flat(driven if guess is None else guess) / unit
    residual, cycle = answer(x)
    size = float(np.linalg.norm(residual))
    for _ in range(options.most_iterations):
        if size <= options.tolerance:
            break
        J = np.empty((len(x), len(x)))
        for j in range(len(x)):
            moved = x.copy()
            moved[j] += options.nudge
            J[:, j] = (answer(moved)[0] - residual) / options.nudge
        step = np.linalg.solve(J, -residual)
        share = 1.0
        while share > 1e-3:
            further, of_cycle = answer(x + share * step)
            if np.linalg.norm(further) < (1.0 - 0.1 * share) * size:
                break
            share *= 0.5
        else:
            return None
        x, residual, cycle = x + share * step, further, of_cycle
        size = float(np.linalg.norm(residual))
    if not size <= options.tolerance:
        return None
    return shown(body, frequency, force, harmonics(x), cycle, options)


def shown(
    body: Body, frequency: float, force: float, r: Array, cycle: ContactCycle,
    options: HarmonicBalance,
) -> CurvePoint:  # fmt: skip
    """Amplitudes and energies of a periodic motion with harmonics r (n_harmonics + 1, 3)."""
    wall, omega = body.wall, 2.0 * np.pi * frequency
    t = np.arange(options.n_instants) / options.n_instants
    waves = np.exp(2j * np.pi * np.outer(t, np.arange(len(r))))
    motion = (waves @ r).real
    weights = np.full(len(r), 2.0 / options.n_instants)
    weights[0] = 1.0 / options.n_instants
    F = weights[:, None] * (waves.conj().T @ cycle.force)

    # the modes under contact and shaker: the wall's motion at the contact, and their mean energy
    q = np.zeros((len(r), wall.omega.size), complex)
    for h in range(len(r)):
        push = wall.phi @ F[h] + (force * wall.load[:, 0] if h == 1 else 0.0)
        q[h] = push / (wall.omega**2 - (h * omega) ** 2 + 2j * wall.zeta * wall.omega * h * omega)
    u = (waves @ (q @ wall.phi[:, 1:])).real
    orders = np.arange(1, len(r))[:, None] * omega
    energy = float(np.sum(0.25 * (wall.omega**2 + orders**2) * np.abs(q[1:]) ** 2))
    axis = int(np.ptp(motion[:, 1:], axis=0).argmax())
    slip = 0.5 * float(np.ptp(motion[:, 1 + axis]))
    across = 0.5 * float(np.ptp(cycle.force[:, 1 + axis]))
    first = r[1, 1 + axis]
    return CurvePoint(
        frequency, force, 0.5 * float(np.ptp(u, axis=0).max()), slip, across, cycle.heat,
        cycle.stick, cycle.heat / (4.0 * np.pi * energy) if energy > 0.0 else 0.0,
        float((F[1, 1 + axis] / first).real) if abs(first) > 0.0 else 0.0, r,
    )  # fmt: skip


def curve(
    body: Body,
    frequencies: Sequence[float],
    forces: Sequence[float],
    options: HarmonicBalance = HarmonicBalance(),
) -> list[CurvePoint]:
    """Points at frequencies [Hz] and forces [N] in pairs, each from the one before; where a step is
    too long it is divided, and where the curve turns back the next one starts anew. Raises
    CouplingError where the curve cannot be followed."""
    chain, static = body.prepared.chain, body.prepared.static
    if np.ndim(body.wall.load) != 2 or body.wall.load.shape[1] != 1:
        raise CouplingError("a resonance curve is that of one shaker; give one.")
    if not static.force[-1] > 0.0:
        raise CouplingError("nothing presses the last contact; give a preload.")
    if not min(frequencies) > 0.0:
        raise CouplingError(f"frequencies must be above 0 Hz, {min(frequencies):g} is not.")
    damped = chain.gamma is not None and chain.dissipation != "none"
    if damped and float(np.broadcast_to(chain.gamma, chain.mass.size)[-1]) > 0.0:
        raise CouplingError(
            "resonance curves leave the damper of the last contact out; take a restitution of 1 "
            "there, or march to the periodic state."
        )
    points: list[CurvePoint] = []

    def towards(
        f: float, F: float, begin: tuple[float, float], guess: Array | None
    ) -> CurvePoint | None:
        """The point at f, F by ever shorter steps from where the guess is."""
        parts = 1
        while parts <= options.finer:
            start, reached = guess, None
            for share in np.arange(1, parts + 1) / parts:
                at = (begin[0] + share * (f - begin[0]), begin[1] + share * (F - begin[1]))
                reached = point(body, *at, start, options)
                if reached is None:
                    break
                start = reached.harmonics
            if reached is not None:
                return reached
            parts *= 4
        return None

    for f, F in zip(frequencies, forces, strict=True):
        reached = None
        if points:
            before = points[-1]
            reached = towards(f, F, (before.frequency, before.force), before.harmonics)
        if reached is None:  # the first one, or the curve turns back here: from a small force
            reached = towards(f, F, (f, 0.0), None)
        if reached is None:
            raise CouplingError(
                f"the resonance curve cannot be followed to {f:.4g} Hz at {F:.3g} N; take a "
                "smaller force, or a larger preload: contacts may open within the cycle."
            )
        points.append(reached)
    return points
