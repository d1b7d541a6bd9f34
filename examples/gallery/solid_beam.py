"""A hinged beam by Timoshenko's theory, by Euler and Bernoulli's, and as a solid of hexahedra.

You will see how near both theories come to the solid in frequencies, time of flight and amplitude
ratio, at several thicknesses. The solid is struck over a patch, its half-space taken out; half of
it is meshed, between the mirror along its length and a side. Hinged ends, where Euler and
Bernoulli's modes are sines; nothing is damped.

Run it: python examples/gallery/solid_beam.py                    the scene beam, minutes
        python examples/gallery/solid_beam.py beam.width=0.01    with changes
"""

import sys
from pathlib import Path

import numpy as np

from beadwave import dem, fem, geometry, rom, scene
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.stages.structure import bending
from observed import bending_run, bending_wall, distance, say

FACTORS = (1.0, 2.0, 3.0)  # of the scene's thickness
N_MODES = 5  # that are compared
STRUCK = "plate:+x"
# the solid's mesh: elements through the thickness, how long one is over how high, radius of the
# patch over the thickness and at most [m], frequency up to which modes move one by one
LAYERS, SLENDERNESS, PATCH, LARGEST_PATCH, CUTOFF_HZ = 4, 4.0, 0.15, 2e-3, 60e3


def main(factors=FACTORS, changes=()):
    """Of each thickness a row for each theory (Timoshenko, Euler and Bernoulli, solid): first and
    fifth frequency [Hz], contact time and time of flight [us], amplitude ratio; differences to the
    solid in time of flight [us], amplitude ratio [%], frequencies [%] and the first reflected wave
    (`observed.distance`)."""
    usual, rows, numbers, figure = scene("beam", changes), [], [], []
    for factor in factors:
        thickness = factor * usual.beam.thickness
        hinged = usual.but(beam={"thickness": thickness, "left": "hinged", "right": "hinged"})
        beam = hinged.beam
        steel = fem.Material(beam.young, beam.poisson, beam.density)

        # Timoshenko's beam is the scene's own, Euler and Bernoulli's has 100 modes
        timoshenko = bending.modes(hinged, bending.model(hinged)).omega
        section = bending.section(beam)
        thin, phi, residual = euler_bernoulli(beam.length, section, steel, beam.position, 100)
        solid_omega, wall_of_solid = solid_wall(beam, steel)
        # of the solid, which also twists and stretches, the modes nearest to Timoshenko's
        nearest = np.abs(solid_omega[:, None] - timoshenko[:N_MODES]).argmin(axis=0)
        theories = {
            "Timoshenko": (timoshenko, bending_wall(hinged)),
            "Euler-Bernoulli": (thin, dem.Wall(thin, np.zeros(len(thin)), phi, residual)),
            "solid": (solid_omega[nearest], wall_of_solid),
        }
        runs = {
            theory: bending_run(hinged, wall._replace(zeta=np.zeros(len(wall.omega))))
            for theory, (_, wall) in theories.items()
        }
        solid, hz = runs["solid"], {t: x[:N_MODES] / (2 * np.pi) for t, (x, _) in theories.items()}

        # how far each theory is from the solid
        spheres, of_thickness = tuple(solid.labels), []
        for theory, run in runs.items():
            off = (np.nan,) * 4
            if run is not solid:
                off = (
                    1e6 * (run.contact.tof - solid.contact.tof),
                    100 * (run.contact.arr / solid.contact.arr - 1),
                    100 * float(np.abs(hz[theory] / hz["solid"] - 1).max()),
                    distance(run, solid, 1, spheres),
                )
            first, fifth = float(hz[theory][0]), float(hz[theory][-1])
            contact_us, tof = 1e6 * run.contact.contact_time.seconds, 1e6 * run.contact.tof
            of_thickness.append((first, fifth, contact_us, tof, run.contact.arr, *off))
            rows.append((1e3 * thickness, theory, *of_thickness[-1]))
        numbers.append(of_thickness)

        sphere = max(spheres)
        lines = [
            Line(theory, run.milliseconds, run.velocity(sphere), style, i, 1.2)
            for i, ((theory, run), style) in enumerate(
                zip(runs.items(), ("-", ":", "--"), strict=True)
            )
        ]
        title = f"{1e3 * thickness:.3g} mm thick, sphere {sphere}"
        figure.append(Panel(title, "time [ms]", "velocity [m/s]", lines))

    columns = (
        "first_hz", "fifth_hz", "contact_us", "tof_us", "arr", "d_tof_us", "d_arr_%", "d_hz_%",
    )  # fmt: skip
    print(aligned_text(("mm", "theory", *columns, "off_solid"), rows))
    numbers = np.array(numbers)
    timoshenko, euler = np.abs(numbers[:, :2, 5:8]).max(axis=0)
    say(f"""
        Differences are those to the solid: in time of flight, amplitude ratio and the first five
        frequencies (at most), and the distance of the first reflected wave. Timoshenko's theory is
        within {timoshenko[0]:.2f} µs, {timoshenko[1]:.2f} % and {timoshenko[2]:.2f} %, Euler and
        Bernoulli's within {euler[0]:.2f} µs, {euler[1]:.2f} % and {euler[2]:.1f} %.
        """)
    Path("solid_beam.png").write_bytes(panels(figure, columns=3, size=(4.4, 3.2)))
    return numbers


def euler_bernoulli(
    length: float, section: fem.Section, material: fem.Material, position: float, n_modes: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Modes of a hinged beam by Euler and Bernoulli, w = sin(k x), k = n pi / L:
    omega (n,) [rad/s], phi (n,) [kg^-1/2], and the compliance [m/N] of all further modes."""
    k, rho_A = np.arange(1, n_modes + 1) * np.pi / length, material.density * section.area
    EI = material.young * section.second_moment
    omega = k**2 * np.sqrt(EI / rho_A)
    phi = np.sqrt(2 / (rho_A * length)) * np.sin(k * position)
    static = (position * (length - position)) ** 2 / (3 * EI * length)
    return omega, phi, float(static - np.sum((phi / omega) ** 2))


def solid_wall(beam, steel):
    """Frequencies [rad/s] of the modes that the contact moves, and the wall, of the solid beam.

    Half of the width is meshed, K and M are doubled; hinges hold the ends' height.
    """
    patch_radius = min(LARGEST_PATCH, PATCH * beam.thickness)
    mesh = geometry.plate_mesh(
        beam.thickness,
        geometry.Extent((-beam.position, beam.length - beam.position), (0.0, beam.width / 2)),
        seed=SLENDERNESS * beam.thickness / LAYERS, contact_seed=patch_radius,
    )  # fmt: skip
    half = fem.assemble(geometry.by_body(mesh), {"plate": steel})
    structure = half._replace(K=2 * half.K, M=2 * half.M)
    mirror = fem.HeldFace("plate:-z", "z")
    hinges = [fem.HeldFace("plate:-y", "x"), fem.HeldFace("plate:+y", "x")]
    model = fem.joined(structure, fem.Connections(held=[mirror, *hinges]))

    middle = (beam.position - beam.length / 2, -beam.width / 4)
    patch = fem.contact_patch(model, STRUCK, middle, patch_radius, mirrors="z")
    local = fem.half_space_on_mesh(model, STRUCK, patch, steel, mirrors=("plate:-z",))
    moving = rom.Selection(cutoff_hz=CUTOFF_HZ)
    reduced = rom.free_modes(model.K, model.M, patch.w, moving, factorise=fem.factorised)
    modes = rom.modal(reduced)
    moved = (modes.omega > 0) & (np.abs(modes.phi) > 1e-3 * np.abs(modes.phi).max())
    return modes.omega[moved], wall_from_reduced(reduced, half_space=local)


if __name__ == "__main__":
    main(changes=sys.argv[1:])
