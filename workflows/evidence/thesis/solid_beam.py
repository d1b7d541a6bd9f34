"""A hinged beam by Timoshenko's theory, by Euler and Bernoulli's, and as a solid of hexahedra.

The solid is struck over a patch, its half-space taken out; half of it is meshed, between the mirror
along its length and a side. The scene's own [beam] with hinged ends, at several thicknesses.
"""

from typing import NamedTuple

import numpy as np

import dem
import fem
import geometry
import rom
from coupling.wall import wall_from_reduced
from fem.hinged import euler_bernoulli
from workflows.evidence.prose import rendered
from workflows.evidence.thesis import bent
from workflows.evidence.thesis.observed_run import Observed
from workflows.evidence.thesis.wave_distance import distance
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import InvalidScene, Scene
from workflows.stages import bending
from workflows.stages.pipeline import Progress

SCENE = "beam"
FACTORS = (1.0, 2.0, 3.0)  # of the thickness
LAYERS, LONG = 4, 4.0  # elements through the thickness; how long they are over how high
PATCH = 0.15  # of the thickness, its radius, and up to
LARGEST_PATCH = 2e-3  # m
CUTOFF_HZ = 60e3
CHECKED = 5  # modes
STRUCK = "plate:+x"
COLUMNS = ("mm", "theory", "first_hz", "fifth_hz", "contact_us", "tof_us", "arr", "off_solid")


class Case(NamedTuple):
    """A beam by one theory at one thickness."""

    thickness: float  # [m]
    theory: str
    hz: np.ndarray  # (CHECKED,)
    run: Observed


def solid_beam(scene: Scene, progress: Progress) -> Finding:
    """Waves of a beam by Timoshenko's and Euler-Bernoulli's theory beside those of the solid."""
    bent.require(scene, "beam")
    if scene.beam.thickness is None or scene.beam.axial_force:
        raise InvalidScene(
            f"the scene {scene.name} has a beam that is not rectangular or under a force; give "
            "width, thickness and axial_force = 0."
        )
    cases = []
    for factor in FACTORS:
        thickness = factor * scene.beam.thickness
        one = scene.but(beam={"thickness": thickness, "left": "hinged", "right": "hinged"})
        with progress(f"thickness {1e3 * thickness:.3g} mm"):
            cases.append(tuple(_cases(one)))
    rows = tuple(_row(case, same[-1]) for same in cases for case in same)
    picture = Picture("study_solid_beam", _picture(cases))
    sentences = rendered(__file__, worst=_worst(cases))
    return Finding((Table("solid-beam", COLUMNS, rows),), sentences, (picture,))


def _cases(scene: Scene):
    """By Timoshenko, by Euler and Bernoulli, and last as a solid."""
    table = scene.beam
    steel = fem.Material(table.young, table.poisson, table.density)
    modes = bending.modes(scene, bending.model(scene)).omega
    yield _case(scene, "Timoshenko", modes, bent.wall(scene))
    section = bending.section(table)
    omega, phi, rest = euler_bernoulli(table.length, section, steel, table.position, 100)
    thin = dem.Wall(omega, np.zeros(len(omega)), phi, rest)
    yield _case(scene, "Euler-Bernoulli", omega, thin)
    moved, wall = _solid(scene, steel)
    nearest = np.abs(moved[:, None] - modes[:CHECKED]).argmin(axis=0)
    yield _case(scene, "solid", moved[nearest], wall)


def _case(scene: Scene, theory: str, omega: np.ndarray, wall: dem.Wall) -> Case:
    undamped = wall._replace(zeta=np.zeros(len(wall.omega)))
    return Case(scene.beam.thickness, theory, omega[:CHECKED] / (2 * np.pi),
                bent.run(scene, undamped))  # fmt: skip


def _solid(scene: Scene, steel: fem.Material) -> tuple[np.ndarray, dem.Wall]:
    """Bending modes [rad/s] that the contact moves, and the wall."""
    table = scene.beam
    patch_radius = min(LARGEST_PATCH, PATCH * table.thickness)
    mesh = geometry.plate_mesh(
        table.thickness,
        geometry.Extent((-table.position, table.length - table.position), (0.0, table.width / 2)),
        seed=LONG * table.thickness / LAYERS, contact_seed=patch_radius,
    )  # fmt: skip
    structure = fem.assemble(geometry.by_body(mesh), {"plate": steel})
    whole = structure._replace(K=2 * structure.K, M=2 * structure.M)
    held = [fem.Held("plate:-z", "z"), fem.Held("plate:-y", "x"), fem.Held("plate:+y", "x")]
    model = fem.joined(whole, fem.Connections(held=held))
    middle = (table.position - table.length / 2, -table.width / 4)
    patch = fem.contact_patch(model, STRUCK, middle, patch_radius, mirrors="z")
    local = fem.half_space_on_mesh(model, STRUCK, patch, steel, mirrors=("plate:-z",))
    asked = rom.Selection(cutoff_hz=CUTOFF_HZ)
    reduced = rom.free_modes(model.K, model.M, patch.w, asked, factorise=fem.factorised)
    found = rom.modal(reduced)
    moved = (found.omega > 0) & (np.abs(found.phi) > 1e-3 * np.abs(found.phi).max())
    return found.omega[moved], wall_from_reduced(reduced, half_space=local)


def _row(case: Case, solid: Case) -> tuple:
    seen = case.run.contact
    nan = float("nan")
    off = distance(case.run, solid.run, 1, tuple(case.run.labels)) if case is not solid else nan
    tof, arr = (nan if x is None else x for x in (seen.tof, seen.arr))
    return (
        1e3 * case.thickness, case.theory, case.hz[0], case.hz[-1],
        1e6 * seen.contact_time.seconds, 1e6 * tof, arr, off,
    )  # fmt: skip


def _worst(cases: list[tuple[Case, ...]]) -> list[dict]:
    """By thickness, how far both theories are from the solid."""
    return [
        {
            "mm": 1e3 * same[-1].thickness,
            "tof": [_off(case, same[-1], "tof", False) for case in same[:2]],
            "arr": [_off(case, same[-1], "arr", True) for case in same[:2]],
            "hz": [np.abs(case.hz / same[-1].hz - 1).max() for case in same[:2]],
        }
        for same in cases
    ]


def _off(case: Case, solid: Case, name: str, relative: bool) -> float:
    one, other = (getattr(c.run.contact, name) for c in (case, solid))
    if one is None or other is None:
        return float("nan")
    return one / other - 1 if relative else 1e6 * (one - other)


def _picture(cases: list[tuple[Case, ...]]) -> bytes:
    sets = []
    for same in cases:
        sphere = max(same[0].run.labels)
        lines = [
            Line(case.theory, case.run.milliseconds, case.run.velocity(sphere), style, i, 1.2)
            for i, (case, style) in enumerate(zip(same, ("-", ":", "--"), strict=True))
        ]
        title = f"{1e3 * same[0].thickness:.3g} mm thick, sphere {sphere}"
        sets.append(Panel(title, "time [ms]", "velocity [m/s]", lines))
    return panels(sets, columns=3, size=(4.4, 3.2))
