"""A hinged beam by Timoshenko's theory, by Euler and Bernoulli's, and as a solid of hexahedra.

The solid is struck over a patch, its half-space taken out; half of it is meshed, between the mirror
along its length and a side. The scene's own [beam] with hinged ends, at several thicknesses.
"""

from typing import NamedTuple

import numpy as np

from beadwave import dem, fem, geometry, rom
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.fem.hinged import euler_bernoulli
from beadwave.workflows.evidence.study import concluded, counted
from beadwave.workflows.evidence.thesis import bent
from beadwave.workflows.evidence.thesis.wave_distance import distance
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages import bending
from beadwave.workflows.stages.progress import Progress

SCENE = "beam"
N_MODES = 5  # that the table and the sentences compare
STRUCK = "plate:+x"
COLUMNS = ("mm", "theory", "first_hz", "fifth_hz", "contact_us", "tof_us", "arr", "off_solid")


class SolidBeamOptions(NamedTuple):
    """What the study varies, and the solid's mesh, which is not varied."""

    factors: tuple[float, ...] = (1.0, 2.0, 3.0)  # of the scene's thickness
    layers: int = 4  # elements through the thickness
    slenderness: float = 4.0  # of an element: how long over how high
    patch: float = 0.15  # of the thickness, radius of the patch, and up to
    largest_patch: float = 2e-3  # [m]
    cutoff_hz: float = 60e3  # up to which the solid's modes move one by one


def solid_beam(
    scene: Scene, progress: Progress, options: SolidBeamOptions = SolidBeamOptions()
) -> Finding:
    """Waves of a beam by Timoshenko's and Euler-Bernoulli's theory beside those of the solid.

    Hinged at both ends, where Euler and Bernoulli's modes are sines, and undamped. Raises
    InvalidScene for beams that are not rectangular or under a force.
    """
    bent.require(scene, "beam")
    if scene.beam.thickness is None or scene.beam.axial_force:
        raise InvalidScene(
            f"the scene {scene.name} has a beam that is not rectangular or under a force; give "
            "width, thickness and axial_force = 0."
        )

    rows, figure, worst = [], [], []
    for factor in counted(options.factors, progress, "{:g} times the scene's thickness".format):
        thickness = factor * scene.beam.thickness
        hinged = scene.but(beam={"thickness": thickness, "left": "hinged", "right": "hinged"})
        beam = hinged.beam
        steel = fem.Material(beam.young, beam.poisson, beam.density)
        # Timoshenko's beam is the scene's own, Euler and Bernoulli's has 100 modes
        timoshenko = bending.modes(hinged, bending.model(hinged)).omega
        thin, phi, residual = euler_bernoulli(
            beam.length, bending.section(beam), steel, beam.position, 100
        )
        solid_omega, wall_of_solid = _solid_wall(hinged, steel, options)

        # of the solid, which also twists and stretches, the modes nearest to Timoshenko's
        nearest = np.abs(solid_omega[:, None] - timoshenko[:N_MODES]).argmin(axis=0)
        theories = (
            ("Timoshenko", timoshenko, bent.wall(hinged)),
            ("Euler-Bernoulli", thin, dem.Wall(thin, np.zeros(len(thin)), phi, residual)),
            ("solid", solid_omega[nearest], wall_of_solid),
        )
        runs = {
            theory: bent.run(hinged, wall._replace(zeta=np.zeros(len(wall.omega))))
            for theory, _, wall in theories
        }
        solid, hz_solid = runs["solid"], theories[-1][1][:N_MODES] / (2 * np.pi)

        # how far both theories are from the solid
        of_solid = bent.tof_and_arr(solid.contact)
        off = {"mm": 1e3 * thickness, "tof": [], "arr": [], "hz": []}
        for theory, omega, _ in theories:
            run, hz = runs[theory], omega[:N_MODES] / (2 * np.pi)
            tof, arr = bent.tof_and_arr(run.contact)
            waves = float("nan")
            if run is not solid:
                waves = distance(run, solid, 1, tuple(run.labels))
                off["tof"].append(1e6 * (tof - of_solid[0]))
                off["arr"].append(arr / of_solid[1] - 1)
                off["hz"].append(np.abs(hz / hz_solid - 1).max())
            contact_us = 1e6 * run.contact.contact_time.seconds
            rows.append((1e3 * thickness, theory, hz[0], hz[-1], contact_us, 1e6 * tof, arr, waves))
        worst.append(off)

        sphere = max(solid.labels)
        lines = [
            Line(theory, run.milliseconds, run.velocity(sphere), style, i, 1.2)
            for i, ((theory, run), style) in enumerate(
                zip(runs.items(), ("-", ":", "--"), strict=True)
            )
        ]
        title = f"{1e3 * thickness:.3g} mm thick, sphere {sphere}"
        figure.append(Panel(title, "time [ms]", "velocity [m/s]", lines))

    return concluded(
        __file__, COLUMNS, tuple(rows), panels(figure, columns=3, size=(4.4, 3.2)), worst=worst,
    )  # fmt: skip


def _solid_wall(
    scene: Scene, steel: fem.Material, options: SolidBeamOptions
) -> tuple[np.ndarray, dem.Wall]:
    """Frequencies [rad/s] of the modes that the contact moves, and the wall, of the solid beam.

    Half of the width is meshed, K and M are doubled; hinges hold the ends' height.
    """
    beam = scene.beam
    patch_radius = min(options.largest_patch, options.patch * beam.thickness)
    mesh = geometry.plate_mesh(
        beam.thickness,
        geometry.Extent((-beam.position, beam.length - beam.position), (0.0, beam.width / 2)),
        seed=options.slenderness * beam.thickness / options.layers, contact_seed=patch_radius,
    )  # fmt: skip
    half = fem.assemble(geometry.by_body(mesh), {"plate": steel})
    structure = half._replace(K=2 * half.K, M=2 * half.M)
    mirror = fem.HeldFace("plate:-z", "z")
    hinges = [fem.HeldFace("plate:-y", "x"), fem.HeldFace("plate:+y", "x")]
    model = fem.joined(structure, fem.Connections(held=[mirror, *hinges]))

    middle = (beam.position - beam.length / 2, -beam.width / 4)
    patch = fem.contact_patch(model, STRUCK, middle, patch_radius, mirrors="z")
    local = fem.half_space_on_mesh(model, STRUCK, patch, steel, mirrors=("plate:-z",))
    moving = rom.Selection(cutoff_hz=options.cutoff_hz)
    reduced = rom.free_modes(model.K, model.M, patch.w, moving, factorise=fem.factorised)
    modes = rom.modal(reduced)
    moved = (modes.omega > 0) & (np.abs(modes.phi) > 1e-3 * np.abs(modes.phi).max())
    return modes.omega[moved], wall_from_reduced(reduced, half_space=local)
