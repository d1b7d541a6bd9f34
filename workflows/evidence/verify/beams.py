"""The beams of the table `[beam]` beside the exact solutions of Timoshenko's equations.

With the shear force and the axial one's part of it in V, the section's moment in B and a harmonic
motion of omega, the state y = (w, theta, V, B) along the beam obeys y' = A y,

    w' = (V + kappa G A theta) / (kappa G A + N),     V' = -rho A omega^2 w,
    theta' = B / E I,     B' = -kappa G A (w' - theta) - rho I omega^2 theta,

and a frequency is where a motion exp(A L) y_0 that both ends allow exists: a determinant is zero.
"""

from collections.abc import Iterator

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from beadwave import fem
from beadwave.fem.bending.beam import ENDS, BeamEnd, Section
from beadwave.workflows.evidence.harness import Comparison, compared

LENGTH, STRUCK = 0.5, 0.19  # m
STEEL = fem.Material(210e9, 0.3, 7850.0)
SECTIONS = {
    "slender": fem.rectangle(0.02, 0.01, STEEL.poisson),
    "stout": fem.tube(0.1, 0.06, STEEL.poisson),
}
N_MODES = 6
TIMOSHENKO = "Timoshenko's frequency equation, Phil. Mag. 41 (1921) 744"
TRANSFER = "zeros of the determinant of Timoshenko's equations, by the matrix exponential"
ENGESSER = "F. Engesser, Zentralbl. Bauverw. 11 (1891) 483"
SPRINGS = BeamEnd(3e7, 2e4), BeamEnd(8e6, 0.0)  # N/m, N m/rad


def beams() -> Iterator[Comparison]:
    """Timoshenko beams: hinged, clamped, on springs, pulled and pressed, up to buckling."""
    hinged, clamped, free = (ENDS[kind] for kind in ("hinged", "clamped", "free"))
    for name, section in SECTIONS.items():
        load = 0.6 * _buckling_load(section, np.pi / LENGTH)
        cases = (
            (f"hinged {name} beam", (hinged, hinged), 0.0),
            (f"hinged {name} beam, pulled", (hinged, hinged), load),
            (f"hinged {name} beam, pressed", (hinged, hinged), -load),
            (f"clamped-clamped {name} beam", (clamped, clamped), 0.0),
            (f"clamped-free {name} beam", (clamped, free), 0.0),
            (f"hinged-clamped {name} beam", (hinged, clamped), 0.0),
            (f"{name} beam on springs, pressed", SPRINGS, -0.1 * load),
            (f"clamped {name} beam, pressed", (clamped, clamped), -load),
        )
        for case, ends, force in cases:
            beam = fem.beam(LENGTH, section, STEEL, ends, STRUCK, axial_force=force)
            hz = fem.modes(beam.K, beam.M, N_MODES).frequency_hz
            if ends == (hinged, hinged):
                exact, source = _hinged_hz(section, force), TIMOSHENKO
            else:
                exact = np.array([_zero_of_determinant(f, section, ends, force) for f in hz])
                source = TRANSFER
            # each by its own size: an error of the lowest counts as much as one of the highest
            worst = np.argmax(np.abs(hz / exact - 1))
            yield compared(f"{case}, six frequencies [Hz]", hz[worst], exact[worst],
                           allowed=1e-8, source=source)  # fmt: skip

        # the half wave of a buckled beam is as long as a hinged beam, half as long as a clamped one
        for kind, k in (("hinged", np.pi / LENGTH), ("clamped", 2 * np.pi / LENGTH)):
            ends = (ENDS[kind],) * 2
            beam = fem.beam(LENGTH, section, STEEL, ends, STRUCK, axial_force=-load)
            yield compared(f"{kind} {name} beam, buckling load [N]", load / beam.load_factor,
                           _buckling_load(section, k), allowed=1e-8, source=ENGESSER)  # fmt: skip


def _stiffnesses(section: Section) -> tuple[float, float]:
    """S = kappa G A [N] and B = E I [N m^2] of a section."""
    shear_modulus = STEEL.young / (2 * (1 + STEEL.poisson))
    return section.shear_factor * shear_modulus * section.area, STEEL.young * section.second_moment


def _buckling_load(section: Section, k: float) -> float:
    """P [N] at the wave number k [1/m]: E I k^2 / (1 + E I k^2 / kappa G A)."""
    S, B = _stiffnesses(section)
    return B * k**2 / (1 + B * k**2 / S)


def _hinged_hz(section: Section, force: float) -> np.ndarray:
    """The lowest frequencies (N_MODES,) [Hz] of a hinged beam under a pull N [N].

    Of w = sin(k x), theta = cos(k x), k = n pi / L, both roots s = omega^2 of
    (S k^2 + N k^2 - rho A s) (B k^2 + S - rho I s) = (S k)^2; at n = 0 sections turn alone.
    """
    S, B = _stiffnesses(section)
    k2 = (np.arange(1, N_MODES + 1) * np.pi / LENGTH) ** 2
    m, J = STEEL.density * np.array([section.area, section.second_moment])
    b = m * (B * k2 + S) + J * (S + force) * k2
    c = k2 * ((S + force) * (B * k2 + S) - S**2)
    root = np.sqrt(b**2 - 4 * m * J * c)
    # 2 c / (b + root), not (b - root) / 2 m J: of a slender beam both terms of that agree to most
    # of their digits
    s = np.sort(np.concatenate([[S / J], 2 * c / (b + root), (b + root) / (2 * m * J)]))
    return np.sqrt(s[:N_MODES]) / (2 * np.pi)


def _zero_of_determinant(
    hz: float, section: Section, ends: tuple[BeamEnd, BeamEnd], force: float
) -> float:
    """The exact frequency [Hz] next to hz, where the determinant of the module's docstring is zero;
    nan where it has no zero within 1 %."""
    S, B = _stiffnesses(section)
    m, J = STEEL.density * np.array([section.area, section.second_moment])

    def conditions(end: BeamEnd, outward: float) -> np.ndarray:
        """Rows (2, 4) that are zero on y: outward V + k w = 0 and outward B + k theta = 0, or
        w = 0, theta = 0 where a spring is rigid."""
        rows = np.zeros((2, 4))
        for i, k in enumerate(end):
            rows[i, [i, i + 2]] = (1.0, 0.0) if np.isinf(k) else (k, outward)
        return rows

    def determinant(f: float) -> float:
        """Of the four conditions at both ends, those at L carried there by exp(A L)."""
        s = (2 * np.pi * f) ** 2
        A = np.zeros((4, 4))
        A[0, 1:3] = S / (S + force), 1 / (S + force)
        A[1, 3] = 1 / B
        A[2, 0] = -m * s
        A[3] = -S * A[0]
        A[3, 1] += S - J * s
        # shifts in lengths, forces in E I / L^2: the rows are of one size
        unit = np.array([LENGTH, 1.0, B / LENGTH**2, B / LENGTH])
        Y = expm(LENGTH * A * unit / unit[:, None])
        at_0, at_L = conditions(ends[0], -1) * unit, conditions(ends[1], 1) * unit
        rows = np.vstack([at_0, at_L @ Y])
        return float(np.linalg.det(rows / np.abs(rows).max(axis=1)[:, None]))

    low, high = 0.99 * hz, 1.01 * hz
    if determinant(low) * determinant(high) > 0:
        return np.nan
    return brentq(determinant, low, high, xtol=1e-12 * hz, rtol=1e-14)
