"""What can be said before the run: will the coupled system work, and what forces to expect; and
after it, whether the step that was given was too long.

Predicted peak force: one sphere on the wall, F = A^(2/5) (5/4 m V^2)^(3/5), which a chain does not
reach (Hertz; Johnson, Contact Mechanics, sec. 11.4). Contact stiffness there:
k = dF/d delta = 3/2 A^(2/3) F^(1/3), in series with the residual compliance k / (1 + s k).
A finite-element body loaded over a patch holds the half-space under it, and so does the Hertz law:
one of them has to go, and s may come out negative (sec. 3.2 and 3.4).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from coupling.coupled_wall import CoupledWall
from dem import Chain, Wall
from dem.spheres import hertz_overlap, hertz_stiffness

LARGE_STEP_ERROR = 0.01  # of a step that the user gives
FALCON = 1.03  # peak force of a column of spheres over that of one sphere; 1.024 is the limit


class Verdict(NamedTuple):
    """A judgement of a chain and its wall at given velocities.

    possible: the run can start; passive: the wall cannot make energy; predicted_peak_force in N;
    findings: what forbids the run or makes it wrong; sentences: all of it for a reader.
    """

    possible: bool
    passive: bool
    n_wall_modes: int
    predicted_peak_force: float
    findings: tuple[str, ...]
    sentences: tuple[str, ...]


def largest_monotone_force(residual: float, contact_coefficient: float) -> float:
    """Force [N] up to which delta = (F/A)^(2/3) + s F grows with F; inf for s >= 0.

    d delta / dF = 2/3 A^(-2/3) F^(-1/3) + s = 0 at F = (2 / (3 |s|))^3 / A^2.
    """
    if residual >= 0:
        return np.inf
    return (2 / (3 * abs(residual))) ** 3 / contact_coefficient**2


def predicted_peak_force(chain: Chain, v0: ArrayLike, A: ArrayLike) -> np.ndarray:
    """Largest forces [N] at contacts of coefficients A [N/m^1.5], steady forces included."""
    v0, mass, A = np.asarray(v0, dtype=float), np.asarray(chain.mass), np.asarray(A, dtype=float)
    swing = v0.max(initial=0.0) - v0.min(initial=0.0)
    one = FALCON * A**0.4 * (1.25 * mass.max() * swing**2) ** 0.6
    everything = A**0.4 * (1.25 * (mass @ v0**2)) ** 0.6
    return np.minimum(one, everything) + np.abs(chain.steady).sum()


def verdict(chain: Chain, wall: Wall | CoupledWall | None, v0: ArrayLike) -> Verdict:
    """Judge a chain of n spheres with velocities v0 (n,) [m/s] against a wall, None for no wall."""
    A = float(np.max(chain.A, initial=0.0)) if wall is None else float(chain.A[-1])
    force = float(predicted_peak_force(chain, v0, A))
    s = 0.0 if wall is None else wall.residual_compliance
    hertz = float(hertz_stiffness(hertz_overlap(force, A), A)) if A else 0.0
    limit = largest_monotone_force(s, A)
    stiffness = hertz / (1 + s * hertz) if force < limit else np.inf
    findings, passive = _findings(wall, s, force, limit)
    omega = _kick_frequency(chain, wall, v0, stiffness)
    sentences = _sentences(wall, force, stiffness, omega) + findings
    return Verdict(
        possible=bool(force < limit) and (passive or isinstance(wall, CoupledWall)),
        passive=passive,
        n_wall_modes=0 if wall is None else len(wall.omega),
        predicted_peak_force=force,
        findings=findings,
        sentences=sentences,
    )


def _findings(
    wall: Wall | CoupledWall | None, s: float, force: float, limit: float
) -> tuple[tuple[str, ...], bool]:
    findings = []
    if not force < limit:
        findings.append(
            f"The contact becomes unstable at {limit:.3g} N, below the predicted peak of "
            f"{force:.3g} N, since the residual compliance is {s:.3g} m/N; lower the "
            f"cutoff frequency or load a larger patch."
        )
    unsound = _energy_source(wall)
    if unsound:
        findings.append(unsound)
    if wall is not None and len(wall.omega) and not np.any(_reading(wall)):
        findings.append(
            "No wall mode has participation at the contact: the wall acts as rigid; check the "
            "patch."
        )
    return tuple(findings), unsound is None


def _reading(wall: Wall | CoupledWall) -> np.ndarray:
    return wall.reading if isinstance(wall, CoupledWall) else wall.phi


def _energy_source(wall: Wall | CoupledWall | None) -> str | None:
    if isinstance(wall, CoupledWall):
        if not wall.reciprocal:
            return (
                "The force enters through other weights than the displacement is read, so the "
                "wall is not passive and will generate energy; use one contact functional for both."
            )
        from rom import is_indefinite  # scipy.sparse, for a tenth of a second

        return "The wall's damping is negative." if is_indefinite(wall.D) else None
    if wall is None or (np.all(wall.zeta >= 0) and wall.mobility >= 0):
        return None
    return (
        f"The wall has a damping ratio of {np.min(wall.zeta, initial=0.0):.3g} and a mobility of "
        f"{wall.mobility:.3g}; both must be >= 0, or it generates energy."
    )


def _kick_frequency(
    chain: Chain, wall: Wall | CoupledWall | None, v0: ArrayLike, stiffness: float
) -> float:
    """Largest circular frequency [rad/s] of the contacts at their peak forces."""
    inverse, A = 1 / np.asarray(chain.mass), np.asarray(chain.A)
    between = A[: len(inverse) - 1]
    overlap = hertz_overlap(predicted_peak_force(chain, v0, between), between)
    k = hertz_stiffness(overlap, between)
    k = np.append(k, [] if wall is None else stiffness)
    last = 0.0 if wall is None else float(_reading(wall) @ _reading(wall))
    pair = np.append(inverse[:-1] + inverse[1:], [] if wall is None else inverse[-1] + last)
    squared = k * pair
    # neighbours share a sphere: Gershgorin bound of the symmetrised contact matrix
    shared = np.sqrt(k[:-1] * k[1:]) * inverse[: len(k)][1:] if len(k) > 1 else np.zeros(0)
    return float(np.sqrt(np.max(squared + np.append(shared, 0) + np.append(0, shared), initial=0)))


def _sentences(
    wall: Wall | CoupledWall | None, force: float, stiffness: float, omega: float
) -> tuple[str, ...]:
    place = "between spheres" if wall is None else "at the wall"
    lines = [
        f"Predicted peak force {place} {force:.3g} N, contact stiffness {1e-6 * stiffness:.3g} "
        "MN/m.",
        f"Highest frequency of the contacts {omega / 2e3 / np.pi:.3g} kHz.",
    ]
    if wall is not None and len(wall.omega):
        n, highest = len(wall.omega), np.max(wall.omega) / 2e3 / np.pi
        lines.append(
            f"The wall has {n} mode{'s' if n > 1 else ''} up to {highest:.3g} kHz and a residual "
            f"compliance of {1e9 * wall.residual_compliance:.3g} nm/N."
        )
    return tuple(lines)


def large_step_error(error: float | None) -> Iterator[str]:
    """A step given by the user that leaves too much."""
    if error is not None and error > LARGE_STEP_ERROR:
        yield (
            f"The step leaves an error of {error:.2g} in the velocities; take a smaller time.dt, "
            "or ask for time.error."
        )
