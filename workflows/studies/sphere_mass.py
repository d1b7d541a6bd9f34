"""Spheres of 13 g, 70 g and 0.5 kg: by their size, as in a workshop, or by their density alone.

The thesis varies the mass in T_c ~ m^(2/5) and keeps the rest. A larger steel sphere has a stiffer
contact as well, A ~ sqrt(R): T_c ~ m^(1/3), and the wave passes diameters that grow alike, so that
its speed in m/s does not change at all. Thesis, section 2.2.2, figure 2.9, equation 2.10.
"""

from typing import NamedTuple

import numpy as np

import dem
from dem.spheres import time_scale
from workflows.chain_stages import initial_velocity
from workflows.run_folder import Picture
from workflows.scene import InvalidScene, Scene
from workflows.stages import Watch
from workflows.studies.observed import Observed, bare, exponent, observed, require_chain
from workflows.study import Finding
from workflows.study_figures import Line, Panel, panels

MASSES = (0.013, 0.07, 0.5)  # kg, thesis, figure 2.9
BETWEEN = (0.013, 0.03, 0.07, 0.2, 0.5)
BY = ("radius", "density")


class Case(NamedTuple):
    """Spheres of one mass."""

    mass: float  # [kg]
    by: str  # what was changed to get there
    run: Observed


def sphere_mass(scene: Scene, watch: Watch) -> Finding:
    """Contact time, speed, peaks and ARR over the spheres' mass."""
    spheres = require_chain(scene)
    if max(spheres) == 1:
        raise InvalidScene("output.spheres = [1] sees no incident wave; add another sphere.")
    with watch("chains"):
        cases = [_case(scene, mass, by, spheres) for by in BY for mass in BETWEEN]
    columns = (
        "by", "mass_kg", "contact_us", "speed_m_s", "spheres_per_ms", "peak_velocity_m_s",
        "peak_force_N", "arr",
    )  # fmt: skip
    rows = tuple((case.by, case.mass, *_measures(case, max(spheres))) for case in cases)
    picture = Picture("study_sphere_mass", _picture(cases, spheres))
    return Finding("sphere-mass", columns, rows, _sentences(cases, max(spheres)), (picture,))


def _case(scene: Scene, mass: float, by: str, spheres: tuple[int, ...]) -> Case:
    """A chain of spheres like the scene's last one, but for their mass."""
    keys = ("radius", "density", "young", "poisson")
    changed = {key: float(np.atleast_1d(getattr(scene.chain, key))[-1]) for key in keys}
    factor = mass / dem.spheres.mass(changed["radius"], changed["density"])
    changed[by] *= factor ** (1 / 3) if by == "radius" else factor
    row = bare(scene.model_copy(update={"chain": scene.chain.model_copy(update=changed)}))
    v0 = initial_velocity(scene)
    duration = 2.8 * len(v0) * time_scale(row.mass[0], row.A[0], np.abs(v0).max())
    run = observed(f"{mass:g} kg", row, dem.rigid_wall(), v0, duration=duration, spheres=spheres)
    return Case(mass, by, run)


def _measures(case: Case, sphere: int) -> tuple[float, ...]:
    contact, radius = case.run.contact, case.run.chain.radius[0]
    incident = case.run.wave(sphere, "incident", 1)
    return (
        1e6 * contact.contact_time.seconds,
        contact.speed_in,
        1e-3 * contact.speed_in / (2 * radius),
        incident.arrival.peak_velocity,
        float(case.run.trajectory.contact_force[:, -1].max()),
        contact.arr,
    )


def _grows(cases: list[Case], by: str, sphere: int) -> list[str]:
    """Exponents of the measures over the mass."""
    chosen = [case for case in cases if case.by == by]
    found = np.array([_measures(case, sphere) for case in chosen])
    return [_power(exponent([case.mass for case in chosen], column)) for column in found.T]


def _power(value: float) -> str:
    return f"{round(value, 3) + 0.0:.3f}"


def _sentences(cases: list[Case], sphere: int) -> tuple[str, ...]:
    by_size, by_density = (_grows(cases, by, sphere) for by in BY)
    arr = [case.run.contact.arr for case in cases]
    peaks = [_measures(case, sphere)[3] / case.run.trajectory.v[0].max() for case in cases]
    return (
        f"Contact time goes with mass to the power {by_density[0]} where only the density changes, "
        f"2/5 as in (2.10), but {by_size[0]} (1/3) where the sphere grows, since its contact grows "
        "stiffer with it.",
        f"Figure 2.9 speaks of faster waves from lighter spheres. In spheres per second they are "
        f"(power {by_size[2]}); in m/s the speed goes with power {by_size[1]} where the size "
        f"changes, since the spheres that it passes shrink alike, and with {by_density[1]} (-2/5) "
        "where the material does.",
        f"The thesis sees lower peaks from lighter spheres. The force falls (power {by_size[4]} by "
        f"size, {by_density[4]} by density), the velocity's peak does not ({by_size[3]}, "
        f"{by_density[3]}): it is {_range(peaks)} of the striker's at sphere {sphere}.",
        f"The thesis says that ARR is unaffected: it is {_range(arr)}, the mean of (2.9) along the "
        "chain.",
        _coefficient(cases[0].run.contact),
    )


def _range(values: list[float]) -> str:
    low, high = f"{min(values):.3f}", f"{max(values):.3f}"
    return low if low == high else f"{low} to {high}"


def _coefficient(contact: dem.wave_measures.WallContact) -> str:
    """What (2.9) makes of the coefficient of (2.8)."""
    ratio, energy = contact.velocity_sum_ratio, contact.energy_restitution
    return (
        f"(2.9) equates ARR with epsilon^(6/5) of (2.8). Of these spheres, which lose nothing "
        f"(restitution by energy {energy:.3f}), epsilon is {ratio:.3f} and its power "
        f"{ratio**1.2:.3f}: momentum turns round, so (2.8) is no measure of loss and not ARR's."
    )


def _picture(cases: list[Case], spheres: tuple[int, ...]) -> bytes:
    shown = [case for case in cases if case.by == "radius" and case.mass in MASSES]
    records = [
        Panel(
            f"{case.mass:g} kg, R = {1e3 * case.run.chain.radius[0]:.1f} mm (figure 2.9)",
            "time [ms]", "velocity [m/s]",
            [Line(f"sphere {s}", case.run.milliseconds, case.run.velocity(s)) for s in spheres],
        )
        for case in shown
    ]  # fmt: skip
    names = ("contact time [µs]", "speed [m/s]", "peak force at the wall [N]")
    laws = [_law(cases, name, i, max(spheres)) for name, i in zip(names, (0, 1, 4), strict=True)]
    return panels([*records, *laws], columns=3, size=(4.4, 3))


def _law(cases: list[Case], name: str, i: int, sphere: int) -> Panel:
    lines = []
    for by in BY:
        chosen = [case for case in cases if case.by == by]
        mass = np.array([case.mass for case in chosen])
        value = np.array([_measures(case, sphere)[i] for case in chosen])
        power = round(exponent(mass, value), 2) + 0.0
        lines.append(Line(f"by {by}, power {power:+.2f}", mass, value, "o-"))
    return Panel(name.split(" [")[0], "mass of a sphere [kg]", name, lines, "xy")
