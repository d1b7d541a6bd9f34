"""ARR against the thickness of a plate: Zener's infinite one, and solid plates of finite elements.

The thesis tells thick walls from thin ones by whether a longitudinal wave crosses the wall and
returns within the contact. What a plate takes is carried along it by bending waves: both models
here have those, and the solid one the way through the thickness as well. Thesis, section 2.2.2.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from beadwave import coupling, dem
from beadwave.workflows.evidence.study import concluded, counted
from beadwave.workflows.evidence.thesis import plates
from beadwave.workflows.evidence.thesis.collision import Collision
from beadwave.workflows.evidence.thesis.plates import PlateSizeRules
from beadwave.workflows.evidence.thesis.requirements import FEWEST, require_chain
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.progress import Progress

NEGLIGIBLE = 5.0  # D/t from which the thesis, after its reference [8], sees no reflected wave
DEEP_LOSS = 0.05  # of the energy, thesis: what a wall thicker than c T_c takes
FACTORS = {  # of the sizes of a plate's mesh, each varied alone
    "elements halved": {"seed": 0.5, "contact_seed": 0.5},
    "modes doubled": {"cutoff_hz": 2.0},
    "1.5 times as wide": {"reach": 1.5},
    "patch halved": {"patch": 0.5},
}
COLUMNS = (
    "model", "d_over_t", "t_mm", "k_h", "restitution", "arr", "lost_%", "contact_us",
    "force_N",
)  # fmt: skip


class WallThicknessOptions(NamedTuple):
    """What the study varies, and what it tells apart."""

    ratios: tuple[float, ...] = (0.125, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)  # D/t
    n_curve: int = 49  # thicknesses on Zener's curve
    checked: float = 4.0  # D/t at which mesh, modes, size of the plate and patch are varied
    factors: Mapping[str, Mapping[str, float]] = FACTORS
    drawn: tuple[float, ...] = (0.25, 2.0, 4.0, 6.0)  # D/t whose velocities are
    close: float = 0.1  # difference of the energies lost up to which Zener's plate holds
    faint: float = 0.05  # ARR that nobody would look for
    rebounds: float = 6.0  # D/t up to which one sphere rebounds at more than a tenth of its speed


class PlateImpact(NamedTuple):
    """The impact on one plate by one model of it."""

    ratio: float  # D/t
    restitution: float  # of one sphere
    collision: Collision  # of the chain


def wall_thickness(
    scene: Scene, progress: Progress, options: WallThicknessOptions = WallThicknessOptions()
) -> Finding:
    """Reflected waves from plates of any thickness, thin and solid (thesis, section 2.2.2)."""
    require_chain(scene, FEWEST)
    sphere, diameter = plates.observed_sphere(scene), plates.diameter(scene)
    ratios, checked = options.ratios, options.checked

    def plate_of(ratio: float) -> coupling.Plate:
        """The plate of steel that is so many times thinner than a sphere."""
        return plates.steel(scene, diameter / ratio)

    def impact(ratio: float, wall: dem.Wall) -> PlateImpact:
        """Of one sphere and of the chain, at a model of the plate."""
        return PlateImpact(ratio, plates.rebound(scene, wall), plates.collision(scene, wall))

    def zener(ratio: float) -> PlateImpact:
        """At the infinite plate, a dashpot: no wave comes back from an edge."""
        return impact(ratio, coupling.infinite_plate(plate_of(ratio)))

    # half-space, Zener's plates on a fine curve and at the thicknesses of the solid ones
    with progress("half-space and infinite plates"):
        deep = plates.collision(scene, dem.rigid_wall())
        curve = [zener(ratio) for ratio in np.geomspace(ratios[0], ratios[-1], options.n_curve)]
        thin = [zener(ratio) for ratio in ratios]

    # solid plates, so large that no wave is back before the end of the contact with Zener's plate;
    # one of them with mesh, modes, size and patch varied
    sizes = {
        z.ratio: plates.sizes(plate_of(z.ratio), deep.contact.seconds, z.collision.contact.seconds)
        for z in thin
    }
    solid, checks = [], []
    for ratio in counted(ratios, progress, "solid plate, D/t = {:g}".format):
        solid.append(impact(ratio, plates.middle_wall(plate_of(ratio), sizes[ratio])))
    for name, factors in options.factors.items():
        with progress(f"D/t = {checked:g}, {name}"):
            wall = plates.middle_wall(plate_of(checked), sizes[checked].scaled(**factors))
            checks.append((name, impact(checked, wall)))

    # share of the striker's energy that the same force radiates into a half-space
    flat, run = plates.steel(scene, 1.0), deep.trajectory
    radiated = coupling.radiated_energy(
        run.t, run.contact_force[:, -1], flat.young, flat.poisson, flat.density
    ) / float(run.energy_kinetic[0])

    def of_chain(collision: Collision) -> tuple[float, ...]:
        """ARR, energy lost [%], contact time [us] and peak force [N]."""
        # what an elastic run loses is the march's error: no more than 8 digits, no minus zero
        lost = 100 * round(collision.lost, 8) + 0.0
        return collision.arr, lost, 1e6 * collision.contact.seconds, collision.peak_force

    pairs = list(zip(thin, solid, strict=True))
    models = [model for z, s in pairs for model in (("infinite (Zener)", z), ("solid", s))]
    models += [(f"solid, {name}", plate) for name, plate in checks]
    rows = [("half-space", None, None, None, 1.0, *of_chain(deep))]
    for model, impacted in models:
        plate, collision = plate_of(impacted.ratio), impacted.collision
        k_h = coupling.slenderness(plate, collision.contact.seconds)
        rows.append(
            (model, impacted.ratio, 1e3 * plate.thickness, k_h, impacted.restitution,
             *of_chain(collision))
        )  # fmt: skip

    # where Zener's plate and the solid one agree, in energy lost and in restitution
    by_ratio = {plate.ratio: plate for plate in solid}
    agreeing = [
        s.ratio for z, s in pairs if abs(s.collision.lost / z.collision.lost - 1) < options.close
    ]
    rebounds = [
        abs(s.restitution / z.restitution - 1) for z, s in pairs if s.ratio <= options.rebounds
    ]
    omega = PlateSizeRules().carried * np.pi / deep.contact.seconds
    half_way = np.sqrt(flat.young / flat.density) * deep.contact.seconds / 2
    striker_speed = np.abs(run.v[0]).max()
    curve_ratio = np.array([z.ratio for z in curve])
    curve_arr = np.array([z.collision.arr for z in curve])

    # over D/t: Zener's curve and the solid plates beside levels of a half-space and of the thesis
    def level(name: str, value: float, style: str = "--", colour: int = 2) -> Line:
        return Line(name, curve_ratio[[0, -1]], np.full(2, value), style, colour)

    def over_thickness(title: str, label: str, value, *others: Line, axes: str = "x") -> Panel:
        """A value of Zener's plates as a curve, of the solid ones as points, over D/t."""
        of_curve, of_solid = (np.array([value(p) for p in model]) for model in (curve, solid))
        lines = [
            Line("infinite plate (Zener)", curve_ratio, of_curve, colour=0),
            Line("solid plate, finite elements", np.array(ratios), of_solid, "o", 1),
            *others,
        ]
        return Panel(title, "sphere diameter over thickness, D/t", label, lines, axes)

    from_here = np.full(2, NEGLIGIBLE), np.array([0, 1.0])
    figure = [
        over_thickness(
            "amplitude ratio (v_back / v_in)^(6/5)", "ARR", lambda p: p.collision.arr,
            level("half-space", deep.arr),
            Line("thesis: negligible from here", *from_here, ":", 4),
        ),
        over_thickness(
            "energy absorbed by the wall", "% of the striker's", lambda p: 100 * p.collision.lost,
            level("half-space, radiated waves", 100 * radiated),
            level("thesis: walls thicker than c T_c", 100 * DEEP_LOSS, ":", 4),
            axes="xy",
        ),
        over_thickness(
            "one sphere alone", "restitution", lambda p: p.restitution, level("half-space", 1.0)
        ),
        over_thickness(
            "contact time of the last sphere", "T_c [µs]",
            lambda p: 1e6 * p.collision.contact.seconds,
            level("half-space", 1e6 * deep.contact.seconds),
        ),
    ]  # fmt: skip

    # records of some solid plates
    forces, velocities = [], []
    for s in solid:
        if s.ratio in options.drawn:
            name, run = f"D/t = {s.ratio:g}", s.collision.trajectory
            forces.append(Line(name, 1e3 * run.t, run.contact_force[:, -1]))
            velocities.append(Line(name, 1e3 * run.t, run.v[:, sphere - 1]))
    title = "force at solid plates; later collisions are echoes from the edges"
    figure.append(Panel(title, "time [ms]", "force [N]", forces))
    figure.append(Panel(f"sphere {sphere}, the same", "time [ms]", "velocity [m/s]", velocities))

    return concluded(
        __file__,
        COLUMNS,
        tuple(rows),
        panels(figure, columns=2, size=(5.6, 3.4)),
        sphere=sphere,
        options=options,
        worst=max(rebounds),
        thickest=pairs[0],
        thinnest=pairs[-1],
        close_from=min(agreeing, default=None),
        radiated=radiated,
        carried_hz=omega / (2 * np.pi),
        speed=coupling.group_speed(plate_of(checked), omega),
        reach=sizes[checked].reach,
        half_way=half_way,
        n_within=sum(diameter / ratio <= half_way for ratio in ratios),
        deep_loss=DEEP_LOSS,
        striker=striker_speed,
        fast=striker_speed * (DEEP_LOSS / radiated) ** (5 / 3),  # radiated ~ V^(3/5)
        two=by_ratio[2.0].collision,
        negligible=NEGLIGIBLE,
        five=by_ratio[NEGLIGIBLE].collision,
        faint_from=float(np.interp(-options.faint, -curve_arr, curve_ratio)),  # ARR falls with D/t
        deep=deep,
        checked=by_ratio[checked],
        checks=checks,
    )
