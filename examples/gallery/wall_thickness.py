"""The reflected wave against the thickness of a plate: Zener's infinite one, and solid plates.

You will see the amplitude ratio (ARR) and the energy that plates from 8 sphere diameters to an
eighth of one take. The thesis tells thick walls from thin ones by whether a longitudinal wave
crosses the wall and returns within the contact. What a plate takes is carried along it by bending
waves: Zener's dashpot and the solid plates of finite elements both have those, and the solid ones
the way through the thickness as well. D is the diameter of a sphere, t the thickness.

Thesis, section 2.2.2; C. Zener, Phys. Rev. 59 (1941) 669.

Run it: python examples/gallery/wall_thickness.py       15 solid plates: minutes
"""

from pathlib import Path

import numpy as np

from beadwave import coupling, dem, scene
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from observed import say
from plates import (
    collision,
    diameter,
    middle_wall,
    observed_sphere,
    rebound,
    sizes,
    steel_plate,
)

RATIOS = (0.125, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)  # D/t
N_CURVE = 49  # thicknesses on Zener's curve
CHECKED = 4.0  # D/t at which mesh, modes, size of the plate and patch are varied, each alone
FACTORS = {
    "elements halved": {"seed": 0.5, "contact_seed": 0.5},
    "modes doubled": {"cutoff_hz": 2.0},
    "1.5 times as wide": {"reach": 1.5},
    "patch halved": {"patch": 0.5},
}
CLOSE = 0.1  # difference of the energies lost up to which Zener's plate holds
NEGLIGIBLE = 5.0  # D/t from which the thesis, after its reference [8], sees no reflected wave
FAINT = 0.05  # ARR that nobody would look for
REBOUNDS = 6.0  # D/t up to which one sphere rebounds at more than a tenth of its speed
DEEP_LOSS = 0.05  # of the energy, thesis: what a wall thicker than c T_c takes


def main(ratios=RATIOS, n_curve=N_CURVE, factors=FACTORS):
    """Restitution of one sphere, ARR and energy lost (k, 3) at each of the ratios, of Zener's and
    of solid plates, and with each of the factors at CHECKED."""
    rig = scene("rig-half-space")
    D = diameter(rig)
    plates = {ratio: steel_plate(rig, D / ratio) for ratio in ratios}

    def impact(wall):
        """Restitution of one sphere, and the collision of the chain."""
        return rebound(rig, wall), collision(rig, wall)

    # half-space, Zener's plates on a fine curve and at the thicknesses of the solid ones; these are
    # so large that no wave is back before the end of the contact with Zener's plate
    deep = collision(rig, dem.rigid_wall())
    curve_ratio, T_c = np.geomspace(ratios[0], ratios[-1], n_curve), deep.contact.seconds
    zener = coupling.infinite_plate
    curve = [impact(zener(steel_plate(rig, D / ratio))) for ratio in curve_ratio]
    thin = {ratio: impact(zener(plate)) for ratio, plate in plates.items()}
    size = {
        ratio: sizes(plate, T_c, thin[ratio][1].contact.seconds) for ratio, plate in plates.items()
    }
    solid = {ratio: impact(middle_wall(plate, size[ratio])) for ratio, plate in plates.items()}
    checks = {
        name: impact(middle_wall(plates[CHECKED], size[CHECKED].scaled(**changes)))
        for name, changes in factors.items()
    }

    # share of the striker's energy that the same force radiates into a half-space
    steel, run = steel_plate(rig, 1.0), deep.trajectory
    radiated = coupling.radiated_energy(
        run.t, run.contact_force[:, -1], steel.young, steel.poisson, steel.density
    ) / float(run.energy_kinetic[0])

    def row(model, ratio, restitution, hit):
        plate = plates.get(ratio)
        k_h = coupling.slenderness(plate, hit.contact.seconds) if plate else None
        # what an elastic run loses is the march's error: no more than 8 digits, no minus zero
        lost, t_mm = 100 * round(hit.lost, 8) + 0.0, 1e3 * plate.thickness if plate else None
        contact_us = 1e6 * hit.contact.seconds
        return model, ratio, t_mm, k_h, restitution, hit.arr, lost, contact_us, hit.peak_force

    rows = [row("half-space", None, 1.0, deep)]
    for ratio in ratios:
        rows += [row("infinite (Zener)", ratio, *thin[ratio]), row("solid", ratio, *solid[ratio])]
    rows += [row(f"solid, {name}", CHECKED, *checked) for name, checked in checks.items()]
    columns = (
        "model", "d_over_t", "t_mm", "k_h", "restitution", "arr", "lost_%", "contact_us", "force_N",
    )  # fmt: skip
    print(aligned_text(columns, rows))

    # where Zener's plate and the solid one agree, in restitution and in energy lost
    worst = max(abs(solid[r][0] / thin[r][0] - 1) for r in ratios if r <= REBOUNDS)
    close = [r for r in ratios if abs(solid[r][1].lost / thin[r][1].lost - 1) < CLOSE]
    thick, checked, five = ratios[0], solid[CHECKED][1], solid[NEGLIGIBLE][1]
    striker = np.abs(run.v[0]).max()
    faint_from = np.interp(-FAINT, [-hit.arr for _, hit in curve], curve_ratio)  # falls with D/t
    say(f"""
        ARR is the amplitude ratio of the reflected wave (equation 2.9) at sphere
        {observed_sphere(rig)}. The plates are of the spheres' steel, the contacts elastic, without
        preload. Energies are shares of the striker's, lost at the end of the contact with the wall;
        restitution is that of one sphere.

        Restitution on the solid plate and on Zener's agree within {worst:.1%} up to D/t =
        {REBOUNDS:g}. Zener's plate takes the energy of the solid one within {CLOSE:.0%} from D/t =
        {min(close, default=np.inf):g} on; thicker plates are no longer thin relative to their
        bending waves (k h in the table): at D/t = {thick:g} Zener's plate takes
        {thin[thick][1].lost:.2%} and the solid one {solid[thick][1].lost:.2%}.

        Thesis: "L <= c T_c / 2 ... the energy loss is minimal". All plates up to
        {np.sqrt(steel.young / steel.density) * T_c / 2:.2f} m meet that, the one of D/t = 2 takes
        {solid[2.0][1].lost:.0%}. The rule is that of a bar, in which waves travel to and fro; the
        bending waves of a plate travel away.

        Thesis: beyond c T_c the wall takes about {DEEP_LOSS:.0%}. At {striker:.2g} m/s a half-space
        takes {radiated:.2%}, by the waves that this force radiates; the share grows with the speed
        to the power 3/5 and would reach {DEEP_LOSS:.0%} at
        {striker * (DEEP_LOSS / radiated) ** (5 / 3):.0f} m/s if the contact stayed elastic.

        Thesis, after its reference [8]: at D/t = {NEGLIGIBLE:g} the reflected wave is negligible.
        The plate takes {five.lost:.0%} of the energy there, but the ARR goes with the root of what
        is left and is {five.arr:.2f}; it falls below {FAINT:g} at D/t = {faint_from:.1f}.

        Thesis: a thinner plate lengthens the contact time T_c and lowers the ARR. Up to D/t =
        {CHECKED:g} T_c grows only from {1e6 * T_c:.0f} to {1e6 * checked.contact.seconds:.0f} µs,
        while the ARR falls from {deep.arr:.2f} to {checked.arr:.2f}.
        """)

    # Zener's plates as a curve, the solid ones as points, beside a half-space
    figure = []
    for title, label, value, level in (
        ("amplitude ratio (v_back / v_in)^(6/5)", "ARR", lambda e, hit: hit.arr, deep.arr),
        ("energy absorbed by the wall", "% of the striker's", lambda e, hit: 100 * hit.lost,
         100 * radiated),
        ("one sphere alone", "restitution", lambda e, hit: e, 1.0),
        ("contact time of the last sphere", "T_c [µs]", lambda e, hit: 1e6 * hit.contact.seconds,
         1e6 * T_c),
    ):  # fmt: skip
        of_curve, of_solid = (np.array([value(*x) for x in m]) for m in (curve, solid.values()))
        lines = [
            Line("infinite plate (Zener)", curve_ratio, of_curve, colour=0),
            Line("solid plate, finite elements", np.array(ratios), of_solid, "o", 1),
            Line("half-space", curve_ratio[[0, -1]], np.full(2, level), "--", 2),
        ]
        axes = "xy" if title.startswith("energy") else "x"
        figure.append(Panel(title, "sphere diameter over thickness, D/t", label, lines, axes))
    Path("wall_thickness.png").write_bytes(panels(figure, columns=2, size=(5.6, 3.4)))
    of_thin, of_solid, of_checks = (
        np.array([(restitution, hit.arr, hit.lost) for restitution, hit in model.values()])
        for model in (thin, solid, checks)
    )
    return of_thin, of_solid, of_checks


if __name__ == "__main__":
    main()
