"""Resonance curves of a shaken structure whose contact slips the more the harder it is shaken.

You will see the motion at the contact over the shaker's frequency, followed up and down. With
little force the contact sticks and ties the structure to the arm; with much it slips and the
structure moves as it would alone. Each point is a cycle in which the contact's forces f and the
motions y of the bodies, cut at their contacts, agree at all harmonics,

    y = s - C f(y)

(harmonic balance, `coupling.harmonic_balance`), found from its neighbour's. Two points are marched
in time as well.

T. M. Cameron, J. H. Griffin, J. Appl. Mech. 56 (1989) 149.

Run it: python examples/gallery/resonance.py       meshes the rig's structure: minutes
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import root

from beadwave import scene
from beadwave.coupling.continuation import before_striker, cold_state
from beadwave.coupling.harmonic_balance import (
    answer,
    cut_at_contacts,
)
from beadwave.coupling.spatial_march import Before
from beadwave.dem.shakers import ShakerForces
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from observed import say
from shaken_rig import shaken_rig, state_of, stuck_wall

FORCES = (0.1, 0.5, 1.0, 2.0)  # factors on the shaker's
N_FREQUENCIES = 13
BEYOND = 0.15  # of the lower and the higher of the linear resonances, to either side
CHECKED = (1.0, 2.0)  # of the forces, at the scene's frequency, marched in time
MARCH_ERROR, MARCH_CELLS = 3e-3, 64
N_INSTANTS = 128  # of a cycle
N_CELLS = 128  # of the contact: 64 and 256 leave one that sticks 0.35 and 0.09 % soft
# heat of a cycle under 2 N, where all of the contact slips: 13 % off with 7 harmonics, 1.6 % with
# 15, 0.02 % with 31, beside the march in time; under 1 N, where a part slips, 0.3 % with 7
N_HARMONICS = 15
TOLERANCE = 1e-5  # motion that is left over, of the cycle's own
FINER = 32  # parts of a step to the next frequency or force, where a whole one does not converge


class Point(NamedTuple):
    """A cycle under a shaker's force, and what it shows."""

    frequency: float  # [Hz]
    force: float  # [N]
    motion: float  # [m] half of peak to peak of the wall's point at the contact, along its largest
    slip: float  # [m] half of peak to peak
    friction: float  # [N] half of peak to peak
    heat: float  # [J] of friction in a cycle
    stick: float  # least share of the area that sticks
    damping: float  # ratio of friction: heat over 4 pi times the mean energy of the modes
    stiffness: float  # [N/m] of the contact across: first harmonics of force over slip
    y: np.ndarray  # (1 + N_HARMONICS, c) [m] amplitudes of the last contact's motion from rest


def point(body, frequency, force, start=None):
    """The cycle at a frequency [Hz] under a force [N], from the motion y of a neighbour; None if
    none is found."""
    chain, static, wall, law = body.prepared.chain, body.prepared.static, body.wall, body.last.law
    shakers = ShakerForces(np.array([force]), np.array([frequency]), np.zeros(1))
    body = body._replace(shakers=shakers, search=body.search._replace(n_cells=N_CELLS))
    # contacts that nothing presses are left out
    before = Before(np.zeros(chain.mass.size, bool), int(np.argmax(static.force > 0.0)))
    cut, N = cut_at_contacts(body, before, N_INSTANTS), N_INSTANTS
    last, harmonics = chain.mass.size - 1, slice(N_HARMONICS + 1)

    # answer H of the last contact, the others as springs under their static forces
    C, K = cut.C[harmonics], cut.K[:last]
    through = np.linalg.solve(np.eye(last) + C[:, :last, :last] * K, C[:, :last, last:])
    H = C[:, last:, last:] - (C[:, last:, :last] * K) @ through
    c = H.shape[1]

    def over_time(amplitudes):
        """(N, c) values of complex amplitudes (h, c) at the instants of a cycle."""
        spectrum = 0.5 * N * amplitudes
        spectrum[0] *= 2.0
        return np.fft.irfft(spectrum, N, axis=0)

    def amplitudes(values):
        """The inverse of `over_time`, of as many harmonics as y has."""
        spectrum = 2.0 / N * np.fft.rfft(values, axis=0)[harmonics]
        spectrum[0] *= 0.5
        return spectrum

    def packed(a):
        return np.concatenate([a.real.ravel(), a[1:].imag.ravel()])

    def unpacked(x):
        a = x[: (N_HARMONICS + 1) * c].reshape(-1, c).astype(complex)
        a[1:] += 1j * x[(N_HARMONICS + 1) * c :].reshape(-1, c)
        return a

    def contact(y):
        """Forces of the contacts over the cycle, the last one led round its path twice."""
        moved = np.zeros((N, cut.K.size))
        moved[:, last:] = over_time(y)
        return answer(body, before, cut, moved, None, 2)

    # y in units of gross slip, what is left over in those and in what mu P moves
    F0 = float(static.force[-1])
    overlap = (F0 / float(chain.A[-1])) ** (2.0 / 3.0)
    unit = max(law.bound, 1e-3) * overlap
    bound = 4.0 / 3.0 * law.bound * law.modulus * np.sqrt(law.radius) * overlap**1.5
    most = max(bound, 1e-3 * F0)
    scale = packed((unit + most * np.abs(np.einsum("hii->hi", H))) * (1.0 + 1.0j))
    driven = 2.0 / N * cut.shaken[harmonics, last:]

    def residual(x):
        y = unpacked(unit * x)
        f = amplitudes(contact(y).force[:, last:] - cut.force[last:])
        return packed(y - driven + np.einsum("hij,hj->hi", H, f)) / scale

    def jacobian(x):
        """By differences of 1e-5 of the gross slip."""
        r = residual(x)
        return np.stack([(residual(x + 1e-5 * e) - r) / 1e-5 for e in np.eye(x.size)], axis=1)

    guess = packed(driven if start is None else start) / unit
    x = root(residual, guess, jac=jacobian, method="hybr", options={"xtol": 1e-8}).x
    size = np.linalg.norm(unit * x / scale)
    if not np.linalg.norm(residual(x)) <= TOLERANCE * min(1.0, size):
        return None

    # the modes under contact and shaker: the wall's motion at the contact, and their mean energy
    y, now = unpacked(unit * x), contact(unpacked(unit * x))
    F = amplitudes(now.force[:, last:] - cut.force[last:])
    q = cut.modes[harmonics] * (F @ cut.phi[:, last:].T + 2.0 / N * cut.push[harmonics])
    u, slip = over_time(q @ wall.phi[:, 1:]), over_time(y)[:, 1:]
    squares = wall.omega**2 + cut.omega[1 : N_HARMONICS + 1, None] ** 2
    mean = 0.25 * float(np.sum(squares * np.abs(q[1:]) ** 2))
    axis = 1 + int(np.ptp(slip, axis=0).argmax())
    return Point(
        frequency, force,
        motion=0.5 * float(np.ptp(u, axis=0).max()),
        slip=0.5 * float(np.ptp(slip[:, axis - 1])),
        friction=0.5 * float(np.ptp(now.force[:, last + axis])),
        heat=now.heat,
        stick=float(now.stick.min()),
        damping=now.heat / (4.0 * np.pi * mean),
        stiffness=float((F[1, axis] / y[1, axis]).real),
        y=y,
    )  # fmt: skip


def towards(body, begin, end, start, parts=FINER):
    """The point at the frequency and force of `end`, over one between where that is too far."""
    reached = point(body, *end, start)
    if reached is None and parts > 1:
        middle = (0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1]))
        if between := towards(body, begin, middle, start, parts // 2):
            reached = towards(body, middle, end, between.y, parts // 2)
    return reached


def curve(body, frequencies, forces):
    """Points at frequencies [Hz] and forces [N] in pairs, each from the one before; where the curve
    turns back the next one starts anew, from a small force."""
    points = []
    for end in zip(frequencies, forces, strict=True):
        reached = None
        if points:
            before = points[-1]
            reached = towards(body, (before.frequency, before.force), end, before.y)
        points.append(reached or towards(body, (end[0], 0.0), end, None))
        if points[-1] is None:
            raise ValueError(f"no cycle is found at {end[0]:.4g} Hz under {end[1]:.3g} N")
    return points


def main(forces=FORCES, n_frequencies=N_FREQUENCIES, checked=CHECKED, changes=()):
    """At the peak under each force: frequency [Hz], motion over force [m/N], damping, and how far
    the curves up and down in frequency differ over the peak."""
    shaken = scene("rig-shaker", changes)
    rig, (shaker,) = shaken_rig(shaken), shaken.shakers
    body = rig.body(shaken.friction.coefficient, N_CELLS)

    def equivalent_hz(stiffness):
        """[Hz] of the mode that the shaker moves most, its contact a spring across [N/m]."""
        wall = stuck_wall(rig.wall, stiffness, rig.last, rig.start.chain)
        moved = np.abs(wall.load[:, 0]) / np.maximum(wall.omega, 1.0) ** 2
        moved[wall.omega < 1.0] = 0.0
        return float(wall.omega[moved.argmax()]) / (2.0 * np.pi)

    # curves under each force, up and down in frequency
    free, stuck = equivalent_hz(0.0), equivalent_hz(rig.contact_stiffness())
    low, high = (1.0 - BEYOND) * min(free, stuck), (1.0 + BEYOND) * max(free, stuck)
    frequencies, rows, curves = np.linspace(low, high, n_frequencies), [], []
    for force in [factor * shaker.force for factor in forces]:
        up = curve(body, frequencies, [force] * n_frequencies)
        down = curve(body, frequencies[::-1], [force] * n_frequencies)[::-1]
        curves.append((force, up, down))
        peak = max(up, key=lambda point: point.motion)
        apart = max(abs(a.motion - b.motion) for a, b in zip(up, down, strict=True))
        rows.append((
            force, float(peak.frequency), 1e6 * peak.motion, 1e6 * peak.motion / force,
            1e6 * peak.slip, peak.friction, 1e6 * peak.heat, state_of(peak.stick), peak.damping,
            equivalent_hz(peak.stiffness), apart / peak.motion,
        ))  # fmt: skip
    columns = (
        "force_N", "peak_hz", "motion_um", "per_force_um_N", "slip_um", "friction_N", "loop_uJ",
        "cycle", "damping", "mode_hz", "up_down",
    )  # fmt: skip
    print(aligned_text(columns, rows))
    weak, strong, most = rows[0], rows[-1], max(row[-1] for row in rows)
    say(f"""
        `motion` is that of the structure at the contact, half of peak to peak; `damping` the heat
        of friction in a period over 4 pi times the mean energy of the modes; `mode` the frequency
        of the shaken mode with the contact as a spring of its first harmonics; `up_down` the
        largest difference of a curve followed up and down in frequency, over its peak.

        Without friction the shaken mode lies at {free:.1f} Hz, on a contact that sticks at
        {stuck:.1f} Hz. Under {weak[0]:.3g} N the peak is at {weak[1]:.1f} Hz with {weak[3]:.3g}
        µm/N, under {strong[0]:.3g} N at {strong[1]:.1f} Hz with {strong[3]:.3g} µm/N; friction
        damps it by a ratio of at most {max(row[8] for row in rows):.1%} at the peaks.

        Up and down in frequency the curves differ by at most {most:.0e} of their peak:
        {"one motion belongs" if most < 0.01 else "more than one motion may belong"} to each
        frequency.
        """)

    # at the scene's frequency, marched in time as well
    hz = shaker.frequency
    marched = []
    for force in [factor * shaker.force for factor in checked]:
        reached = curve(body, [hz], [force])[0]
        pushed = rig._replace(shakers=rig.shakers._replace(force=np.array([force])))
        march = pushed.body(shaken.friction.coefficient, MARCH_CELLS)
        v0, held = rig.start.velocity, shaken.friction.upstream == "held"
        before = before_striker(march, v0, upstream_held=held)
        state = cold_state(march, before, error=MARCH_ERROR, speed=float(np.abs(v0).max()))
        marched += [
            (force, hz, "slip_um", 1e6 * reached.slip, 1e6 * state.slip),
            (force, hz, "friction_N", reached.friction, state.friction),
            (force, hz, "loop_uJ", 1e6 * reached.heat, 1e6 * state.energy),
        ]
    if marched:
        columns = ("force_N", "frequency_hz", "quantity", "balance", "march")
        print("\n" + aligned_text(columns, marched))
        off = ", ".join(f"{abs(row[3] / row[4] - 1.0):.1%}" for row in marched)
        say(f"""
            Marched in time, these differ from the harmonic balance by {off}. The balance keeps
            {N_HARMONICS} harmonics, and takes the contacts before the last sphere as linear.
            """)

    over, loops = [], []
    for i, (force, *ways) in enumerate(curves):
        for points, style, name in zip(ways, ("-", "o"), (f"{force:g} N", None), strict=True):
            per_force = np.array([1e6 * p.motion / force for p in points])
            over.append(Line(name, frequencies, per_force, style, i, 1.2))
            heat = np.array([max(1e6 * p.heat, 1e-6) for p in points])
            loops.append(Line(name, frequencies, heat, style, i, 1.2))
    up_down = "lines up, marks down"
    figure = [
        Panel(up_down, "frequency [Hz]", "motion over force [µm/N]", over),
        Panel(up_down, "frequency [Hz]", "loop of a period [µJ]", loops, "y"),
    ]
    Path("resonance.png").write_bytes(panels(figure, columns=2, size=(5.5, 3.2)))
    return tuple(np.array([row[i] for row in rows]) for i in (1, 3, 8, 10))


if __name__ == "__main__":
    main(changes=sys.argv[1:])
