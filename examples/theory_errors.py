"""The error stated of the theory of bending beside the true one, against solids.

You will see, for beams and plates drawn by a seed, struck by a chain of six spheres: the velocity
error of the theory against the same body of quadratic hexahedra,

    true = max |v - v_solid| / V,   up to about when the second wave comes back,

of the theory as solids correct it and of the usual theory (Cowper's beam that does not bulge,
Mindlin's plate with pi^2 / 12), then what a run states, `error_estimate.theory`, and stated over
true.

            o o o o o o ->  |======.=========|   thickness 4 to 30 mm, 8 to 22 as long,
                            |                |   0.5 to 3 as wide, nu from 0.22 to 0.38

Half of each body is meshed, between its mirror and a side; elements are an eighth of the thickness
at the strike and at held ends, and half of it or less anywhere else.

Run it: python examples/theory_errors.py [beams] [plates] [seed]        ten seconds a body
"""

import sys
from contextlib import nullcontext

import numpy as np

from beadwave import dem, fem, geometry, rom
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.errors.better_walls import march_before, observed_velocities
from beadwave.workflows.stages.structure import bending

MATERIALS = ((210e9, 0.3, 7850.0), (70e9, 0.33, 2700.0), (3.2e9, 0.38, 1190.0), (110e9, 0.22, 7e3))
STRUCK = "plate:+x"
HELD = {"hinged": "x", "clamped": "xyz", "free": ""}  # directions, across first
DAMPING = 0.002
SPHERES = 6


def main(beams: int = 12, plates: int = 4, seed: int = 3) -> None:
    rng = np.random.default_rng(seed)
    print(f"{'':44} {'true':>8} {'by solids':>9} {'usual':>8} {'stated':>8} {'ratio':>6}")
    ratios = []
    for kind in ["beam"] * beams + ["plate"] * plates:
        drawn = random_beam(rng) if kind == "beam" else random_plate(rng)
        true, corrected, usual, stated = errors(drawn)
        ratios.append(stated / true)
        print(
            f"{title(drawn):44} {true:8.1e} {corrected:9.1e} {usual:8.1e} {stated:8.1e} "
            f"{ratios[-1]:6.2f}",
            flush=True,
        )
    print(
        f"stated over true: least {min(ratios):.2f}, median {np.median(ratios):.2f}, most "
        f"{max(ratios):.2f}; {np.mean([1 <= r <= 4 for r in ratios]):.0%} from 1 to 4"
    )


def random_beam(rng: np.random.Generator) -> Scene:
    """A beam that is held at one end at least."""
    h = 10 ** rng.uniform(np.log10(4e-3), np.log10(30e-3))
    left, right = (str(rng.choice(["hinged", "clamped", "free"])) for _ in "lr")
    if "clamped" not in (left, right) and "free" in (left, right):
        left = "clamped"
    young, poisson, density = MATERIALS[rng.integers(len(MATERIALS))]
    beam = {
        "thickness": h,
        "width": h * 2 ** rng.uniform(-1, 1.6),
        "length": h * 10 ** rng.uniform(np.log10(8), np.log10(22)),
        "left": left,
        "right": right,
    }
    beam["position"] = beam["length"] * rng.uniform(0.4, 0.6)
    return with_chain("beam", beam, (young, poisson, density), rng)


def random_plate(rng: np.random.Generator) -> Scene:
    """A plate struck on the middle of its width, the edges along it alike."""
    h = 10 ** rng.uniform(np.log10(4e-3), np.log10(16e-3))
    along = str(rng.choice(["clamped", "hinged", "free"]))
    plate = {
        "thickness": h,
        "length": h * rng.uniform(8, 14),
        "width": h * rng.uniform(8, 14),
        "left": str(rng.choice(["clamped", "hinged"])),
        "right": str(rng.choice(["clamped", "hinged"])),
        "front": along,
        "back": along,
    }
    plate["at"] = (plate["length"] * rng.uniform(0.35, 0.65), plate["width"] / 2)
    return with_chain("plate", plate, MATERIALS[rng.integers(len(MATERIALS))], rng)


def with_chain(kind: str, table: dict, material: tuple[float, ...], rng) -> Scene:
    """The scene of a body, whose chain's size and velocity are drawn too."""
    young, poisson, density = material
    radius, velocity = table["thickness"] * rng.uniform(0.25, 0.9), rng.uniform(0.1, 1.0)
    # a wave takes 0.04 ms a sphere of the radius 6.35 mm at 0.3 m/s, and so long there and back
    duration = 0.14e-3 * SPHERES * radius / 6.35e-3 * (0.3 / velocity) ** 0.2
    # modes up to where half a wave is as long as the body is thick
    to_hz = 0.12 * np.sqrt(young / density) / table["thickness"]
    material_keys = {"young": young, "poisson": poisson, "density": density}
    usual = scene(kind)
    return usual.but(
        chain={"count": SPHERES, "radius": radius},
        striker={"velocity": velocity},
        damping={"ratio": DAMPING},
        time={"duration": duration, "horizon": duration},
        output={"spheres": (1, 3, SPHERES)},
        reduction={"modes": None, "cutoff": None, "error": 1e-4, "to_hz": float(to_hz)},
        **{kind: table | material_keys},
    )


def errors(drawn: Scene) -> tuple[float, float, float, float]:
    """True errors of the theory, of the one that solids correct and of the usual one; the error
    that a run states."""
    of = pipeline_of(drawn, lambda name: nullcontext())
    start, impact = of("start"), of("impact")
    speed = np.abs(start.velocity).max()
    run, others = impact.trajectory, bending.other_theories(drawn)
    walls = [solid_wall(drawn), *(wall_of(drawn, other.reduced) for other in others)]
    reference, *computed = (
        observed_velocities(drawn, march_before(wall, start, run)) for wall in walls
    )
    true = [np.abs(v - reference).max() for v in (observed_velocities(drawn, run), *computed)]
    return *(float(difference / speed) for difference in true), of("theory-error")


def solid_wall(drawn: Scene) -> dem.Wall:
    """The wall that the same body of solid elements makes; half of its width is meshed, K and M are
    doubled."""
    table = drawn.beam or drawn.plate
    h, material = table.thickness, fem.Material(table.young, table.poisson, table.density)
    position, tangential = (table.position, "") if drawn.beam else (table.at[0], "zy")
    patch_radius = 0.15 * h
    mesh = geometry.plate_mesh(
        h,
        geometry.Extent((-position, table.length - position), (0.0, table.width / 2)),
        seed=(0.5 if drawn.beam else 0.8) * h, contact_seed=patch_radius, end_seed=h / 6,
    )  # fmt: skip
    half = fem.assemble(geometry.by_body(mesh), {"plate": material})
    structure = half._replace(K=2 * half.K, M=2 * half.M)

    # the mirror; hinged edges hold what lies across, and of a plate along the edge
    held = [fem.HeldFace("plate:-z", "z")]
    sides = [("plate:-y", table.left, tangential[:1]), ("plate:+y", table.right, tangential[:1])]
    if drawn.plate:
        sides.append(("plate:+z", table.front, tangential[1:]))
    for face, kind, along in sides:
        directions = HELD[kind] + (along if kind == "hinged" else "")
        held += [fem.HeldFace(face, direction) for direction in directions]
    model = fem.joined(structure, fem.Connections(held=held))

    # struck on the plane of the mirror: of patch and half-space one half is meshed
    at = (position - table.length / 2, -table.width / 4)
    patch = fem.contact_patch(model, STRUCK, at, patch_radius, mirrors="z")
    local = fem.half_space_on_mesh(model, STRUCK, patch, material, mirrors=("plate:-z",))
    wanted = rom.Selection(error=1e-3, choice="contact", to_hz=drawn.reduction.to_hz)
    reduced = rom.free_modes(model.K, model.M, patch.w, wanted, factorise=fem.factorised)
    wall = wall_from_reduced(reduced, half_space=local)
    return wall._replace(zeta=np.full(len(wall.omega), DAMPING))


def title(drawn: Scene) -> str:
    """A line that says which body it is."""
    table, h = drawn.beam or drawn.plate, (drawn.beam or drawn.plate).thickness
    edges = (table.left, table.right, *((table.front,) if drawn.plate else ()))
    kind = "beam" if drawn.beam else "plate"
    return (
        f"{kind} {1e3 * h:4.1f} mm, {table.length / h:4.1f} x {table.width / h:4.1f} h, "
        f"{' '.join(edges)}"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
