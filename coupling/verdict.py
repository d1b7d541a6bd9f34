"""The verdict on chain and wall before a run: whether they can be marched, and forces to expect;
after a run, whether the step that was given was too long.

Predicted peak force: one sphere on the wall, F = A^(2/5) (5/4 m V^2)^(3/5), which a chain does not
reach (Hertz; Johnson, Contact Mechanics, sec. 11.4). Contact stiffness there:
k = dF/d delta = 3/2 A^(2/3) F^(1/3), in series with the residual compliance k / (1 + s k).
A finite-element body loaded over a patch contains the compliance of the half-space under it, and so
does Hertz' law: it is taken out of the wall, and s may come out negative (sec. 3.2 and 3.4).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.coupling.coupled_wall import CoupledWall
from beadwave.dem import Chain, Wall
from beadwave.dem.elastic import ElasticLaw, elastic_law


class Verdict(NamedTuple):
    """A judgement of a chain and its wall at given velocities.

    possible: the run can start. passive: the wall cannot make energy. predicted_peak_force in N.
    findings: reasons why the run is impossible or wrong. sentences: the whole verdict in words.
    """

    possible: bool
    passive: bool
    n_wall_modes: int
    predicted_peak_force: float
    findings: tuple[str, ...]
    sentences: tuple[str, ...]


def largest_monotone_force(residual: float, contact: ElasticLaw | float) -> float:
    """Force [N] up to which the overlap of a contact plus s F grows with F; inf for s >= 0.

    1/k + s = 0 there, of Hertz' law, for which its A may stand, at F = (2 / (3 |s|))^3 / A^2.
    """
    if residual >= 0:
        return np.inf
    law = elastic_law(contact)
    return float(law.force(law.fold(residual)))


def predicted_peak_force(
    chain: Chain, v0: ArrayLike, contacts: ElasticLaw | ArrayLike
) -> np.ndarray:
    """Largest forces (n_contacts,) [N] at contacts of a law, or of Hertz' with coefficients
    A (n_contacts,) [N/m^1.5], of a chain with velocities v0 (n,) [m/s], steady forces included.

    The smaller of two bounds: the force of one sphere that meets the contact with the whole
    difference of velocities, F = A^(2/5) (5/4 m V^2)^(3/5), times 1.03 (a column of spheres reaches
    1.024 of it: E. Falcon et al., Eur. Phys. J. B 3 (1998) 45); and the force at which one contact
    holds all kinetic energy E = 2/5 F delta, F = A^(2/5) (5/2 E)^(3/5).
    """
    v0, mass, law = np.asarray(v0, dtype=float), np.asarray(chain.mass), elastic_law(contacts)
    swing = v0.max(initial=0.0) - v0.min(initial=0.0)
    energies = 0.5 * mass.max() * swing**2, 0.5 * (mass @ v0**2)
    of_sphere, of_energy = (
        law.force(law.overlap_of_energy(np.full(np.shape(law.A), energy))) for energy in energies
    )
    of_sphere = 1.03 * of_sphere
    return np.minimum(of_sphere, of_energy) + np.abs(chain.steady).sum()


def verdict(chain: Chain, wall: Wall | CoupledWall | None, v0: ArrayLike) -> Verdict:
    """Judge a chain of n spheres with velocities v0 (n,) [m/s] against a wall, None for no wall. A
    Wall that makes energy is impossible; a CoupledWall that does may run, and is named: the scheme
    of the thesis is one."""
    n_modes = 0 if wall is None else len(wall.omega)

    # the contact at its peak force: Hertz in series with s, which gives way beyond the limit
    law = chain.elastic.at(np.s_[:] if wall is None else np.s_[-1:])
    forces = predicted_peak_force(chain, v0, law)
    force = float(forces.max(initial=0.0)) or float(np.abs(chain.steady).sum())
    s = 0.0 if wall is None else wall.residual_compliance
    tangent = float(law.stiffness(law.overlap(forces)).max(initial=0.0))
    limit = np.inf if wall is None else largest_monotone_force(s, law.at(-1))
    stiffness = tangent / (1 + s * tangent) if force < limit else np.inf

    # what forbids the run or makes it wrong
    findings = []
    if not force < limit:
        findings.append(
            f"The contact becomes unstable at {limit:.3g} N, below the predicted peak of "
            f"{force:.3g} N, since the residual compliance is {s:.3g} m/N; lower the "
            f"cutoff frequency or load a larger patch."
        )
    energy_source = None
    if isinstance(wall, CoupledWall):
        from beadwave.rom import is_indefinite  # scipy.sparse, for a tenth of a second

        if not wall.reciprocal:
            energy_source = (
                "The force enters through other weights than the displacement is read, so the "
                "wall is not passive and will generate energy; use one contact functional for both."
            )
        elif is_indefinite(wall.D):
            energy_source = "The wall's damping is negative."
    elif wall is not None and not (np.all(wall.zeta >= 0) and wall.mobility >= 0):
        energy_source = (
            f"The wall has a damping ratio of {np.min(wall.zeta, initial=0.0):.3g} and a mobility "
            f"of {wall.mobility:.3g}; both must be >= 0, or it generates energy."
        )
    if energy_source:
        findings.append(energy_source)
    if n_modes and not np.any(_reading(wall)):
        findings.append(
            "No wall mode has participation at the contact: the wall acts as rigid; check the "
            "patch."
        )

    omega = _contact_frequency(chain, wall, v0, stiffness)
    place = "between spheres" if wall is None else "at the wall"
    sentences = [
        f"Predicted peak force {place} {force:.3g} N, contact stiffness {1e-6 * stiffness:.3g} "
        "MN/m.",
        f"Highest frequency of the contacts {_frequency(omega)}.",
    ]
    if n_modes:
        sentences.append(
            f"The wall has {n_modes} mode{'s' if n_modes > 1 else ''} up to "
            f"{_frequency(np.max(wall.omega))} and a residual compliance of {1e9 * s:.3g} nm/N."
        )
    passive = energy_source is None
    return Verdict(
        possible=bool(force < limit) and (passive or isinstance(wall, CoupledWall)),
        passive=passive,
        n_wall_modes=n_modes,
        predicted_peak_force=force,
        findings=tuple(findings),
        sentences=(*sentences, *findings),
    )


def _contact_frequency(
    chain: Chain, wall: Wall | CoupledWall | None, v0: ArrayLike, stiffness: float
) -> float:
    """Largest circular frequency [rad/s] of the contacts at their peak forces; stiffness [N/m] is
    that of the last one at the wall.

    The gaps g_i between neighbours obey g'' = -B k g with B_ii = 1/m_i + 1/m_{i+1} and
    B_i,i+1 = -1/m_{i+1}, as neighbouring contacts share a sphere. Gershgorin's theorem bounds the
    eigenvalues of the symmetric sqrt(k) B sqrt(k) by the largest sum of a row.
    """
    inverse = 1 / np.asarray(chain.mass)
    between = chain.elastic.at(np.s_[: len(inverse) - 1])
    overlap = between.overlap(predicted_peak_force(chain, v0, between))
    k, pair = between.stiffness(overlap), inverse[:-1] + inverse[1:]
    if wall is not None:
        k = np.append(k, stiffness)
        pair = np.append(pair, inverse[-1] + float(_reading(wall) @ _reading(wall)))
    squared = k * pair
    shared = np.sqrt(k[:-1] * k[1:]) * inverse[: len(k)][1:] if len(k) > 1 else np.zeros(0)
    return float(np.sqrt(np.max(squared + np.append(shared, 0) + np.append(0, shared), initial=0)))


def _reading(wall: Wall | CoupledWall) -> np.ndarray:
    """Weights (k,) [kg^-1/2] by which the modes are read at the contact."""
    return wall.reading if isinstance(wall, CoupledWall) else wall.phi


def large_step_error(error: float | None) -> Iterator[str]:
    """A sentence on a step given by the user whose relative error exceeds a hundredth."""
    if error is not None and error > 0.01:
        yield (
            f"The step leaves an error of {error:.2g} in the velocities; take a smaller time.dt, "
            "or ask for time.error."
        )


def _frequency(omega: float) -> str:
    """The frequency of omega [rad/s] with its unit."""
    hz = omega / (2 * np.pi)
    return f"{1e-3 * hz:.3g} kHz" if hz >= 1e3 else f"{hz:.3g} Hz"
