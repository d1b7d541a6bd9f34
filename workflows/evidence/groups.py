"""Studies of `accuracy`, cases of `stability` and groups of `verify`, by name.

The function of a name is that of its module with underscores, `wall_modes` of "wall-modes"; it is
imported when it runs. One of `accuracy` takes a scene and the progress, and returns a `Finding`;
one of `stability` yields trials, one of `verify` comparisons (see `harness`).
"""

from collections.abc import Callable
from importlib import import_module
from typing import NamedTuple

from beadwave.workflows.scene import InvalidScene, nearest


class Group(NamedTuple):
    """A line of the listing, the module, and the usual scene of a study of `accuracy`."""

    module: str
    shows: str
    scene: str | None = None


OPTIONS = {"accuracy": "--stage", "stability": "--case", "verify": "--group"}  # that take a name

GROUPS: dict[str, dict[str, Group]] = {
    "accuracy": {
        "time": Group(
            "time",
            "Error of every scheme and of general-purpose integrators against their run time.",
            "rig-rigid",
        ),
        "mesh": Group(
            "mesh",
            "Frequencies against the element size; of a beam or a plate with the waves beside.",
            "rig-rom",
        ),
        "reduction": Group(
            "reduction",
            "Error and cost of a reduced wall against the number of its modes.",
            "rig-rom",
        ),
        "chain-length": Group("sizes", "Run time against the number of spheres.", "rig-rigid"),
        "wall-modes": Group(
            "sizes", "Run time against the number of modes of the wall.", "rig-rigid"
        ),
    },
    "stability": {
        "joint-stiffness": Group(
            "assembly",
            "1 to 1e16 N/m in every direction, rigid joints, and none at all: the block floats.",
        ),
        "rayleigh-damping": Group(
            "assembly", "The thesis' coefficients and multiples of them, to far above critical."
        ),
        "young": Group("chains", "One Young's modulus for all spheres, from 1 MPa to 1 TPa."),
        "unlike-materials": Group("chains", "Steel next to ever softer spheres."),
        "unlike-radii": Group(
            "chains", "Every second sphere smaller, and a chain tapered a thousandfold."
        ),
        "radius": Group("chains", "One radius for all spheres, from 1 um to 1 m."),
        "striker-speed": Group("chains", "Speeds of the striker from 1 um/s to 100 m/s."),
        "preload": Group(
            "chains", "On the last sphere, and through all spheres by a spring on the first."
        ),
        "sonic-vacuum": Group(
            "chains", "No preload: the limit of a vanishing one, which only tiny forces reach."
        ),
        "dissipation": Group(
            "chains", "Each law of contact damping, from none to far beyond critical."
        ),
        "spheres": Group("chains", "Chains of 2 to 100 000 spheres."),
        "shaken-preload": Group(
            "shaken",
            "From no preload to 1 kN, without a shaker and at resonance, where all of it slips.",
        ),
        "shaken-friction": Group(
            "shaken", "Coefficients from 0 to 2, without a shaker and at resonance."
        ),
        "shaken-separation": Group(
            "shaken",
            "Shakers that move the wall along its normal too, until the contact opens within a "
            "cycle.",
        ),
        "shaken-phase": Group(
            "shaken", "Phases all round as the striker arrives, between stick and slip all over."
        ),
        "step": Group(
            "steps",
            "0.01 to 100 times the stability limit; a run at a given step must know its error.",
        ),
        "drift": Group(
            "steps",
            "Ten million steps of three spheres between spring and wall: does the energy wander?",
        ),
        "time-reversal": Group(
            "steps",
            "A march forth, velocities reversed, and back: the start is met to rounding and drift.",
        ),
        "float-extremes": Group("steps", "Inputs at and beyond the ends of what a float holds."),
        "wall-mode-frequency": Group(
            "walls", "A mode of ever higher frequency beside one at 1 kHz."
        ),
        "one-dof-wall": Group(
            "walls", "0.1 Hz to 1 MHz, a millionth to a million times a sphere's mass."
        ),
        "wall-damping": Group("walls", "Damping ratios of three modes, to far above critical."),
        "dashpot-wall": Group("walls", "Coefficients from that of air to that of rock [N s/m]."),
    },
    "verify": {
        "beams": Group(
            "beams",
            "Timoshenko beams: hinged, clamped, on springs, pulled and pressed, up to buckling.",
        ),
        "reductions": Group(
            "exact_reductions",
            "Craig-Bampton's published example, a chain of springs, two masses in touch.",
        ),
        "half-spaces": Group(
            "exact_reductions",
            "Energy of the surface wave, and Hertz' coefficients of spheres and walls.",
        ),
        "structures": Group(
            "exact_structures",
            "Rod, strip and block beside theory, a sphere on a beam, damping ratios.",
        ),
        "contact-node": Group(
            "exact_structures",
            "A force at a node of the block deflects it like 1/h, by a factor of its elements.",
        ),
        "three-directions": Group(
            "exact_structures",
            "Compliances across the normal: a slender cantilever, and the half-space of a patch.",
        ),
        "friction": Group(
            "friction",
            "Loops under constant load, oblique impacts, and histories by independent springs.",
        ),
        "gravity": Group(
            "gravity",
            "Upright chains: overlaps at rest, and waves through a preload that grows downwards.",
        ),
        "solitary-wave": Group(
            "published",
            "The wave in a chain of equal spheres: speed, force, shape, energy, recoil.",
        ),
        "contacts": Group("published", "One contact, two spheres, ten steel spheres."),
        "chain-and-wall": Group(
            "published",
            "Seventeen spheres at a wall, columns that fall, a plate that carries energy away.",
        ),
        "second-waves": Group(
            "thesis_tables",
            "The softness of a wall above which the chain is sent a second wave, and what stays.",
        ),
        "thesis-tables": Group(
            "thesis_tables",
            "Tables 5.2 and 5.3 by `modes --table`, the worst of four modes: minutes.",
        ),
    },
}


def chosen(folder: str, names: tuple[str, ...]) -> dict[str, Callable]:
    """The functions of these names, all if there are none; raises InvalidScene for an unknown
    one."""
    groups = GROUPS[folder]
    for name in names:
        if name not in groups:
            raise InvalidScene(f"{OPTIONS[folder]} {name!r} is not known; {nearest(name, groups)}.")
    functions = {}
    for name in names or groups:
        module = import_module(f"{__package__}.{folder}.{groups[name].module}")
        functions[name] = getattr(module, name.replace("-", "_"))
    return functions


def listing(folder: str) -> str:
    """A line for each name: the name in 20 columns, then what it shows."""
    return "\n".join(f"{name:20}{group.shows}" for name, group in GROUPS[folder].items())
