"""Studies of `accuracy`, cases of `stability` and groups of `verify`, by name.

The function of a name is that of its module with underscores, `wall_modes` of "wall-modes"; the
first line of its docstring is its line in the listing. One of `accuracy` takes a scene and the
progress, and returns a `Finding`; one of `stability` yields trials, one of `verify` comparisons
(see `harness`).
"""

from collections.abc import Callable
from importlib import import_module

from beadwave.workflows.scene import InvalidScene, nearest

OPTIONS = {"accuracy": "--stage", "stability": "--case", "verify": "--group"}  # that take a name
MODULES = {  # of a folder: names by module, in the order of the listing
    "accuracy": {
        "time": ["time"],
        "mesh": ["mesh"],
        "reduction": ["reduction"],
        "chain_length": ["chain-length", "wall-modes"],
    },
    "stability": {
        "assembly": ["joint-stiffness", "rayleigh-damping"],
        "bolts": ["pressed-faces"],
        "chains": [
            "young", "unlike-materials", "unlike-radii", "radius", "striker-speed", "preload",
            "sonic-vacuum", "dissipation", "spheres",
        ],
        "shaken": ["shaken-preload", "shaken-friction", "shaken-separation", "shaken-phase"],
        "steps": ["step", "drift", "time-reversal", "float-extremes"],
        "walls": ["wall-mode-frequency", "one-dof-wall", "wall-damping", "dashpot-wall"],
    },
    "verify": {
        "beams": ["beams"],
        "exact_reductions": ["reductions", "half-spaces"],
        "exact_structures": ["structures", "contact-node", "three-directions"],
        "friction": ["friction"],
        "gravity": ["gravity"],
        "published": ["solitary-wave", "contacts", "chain-and-wall"],
        "thesis_tables": ["second-waves", "thesis-tables"],
    },
}  # fmt: skip
SCENES = {  # that a study of accuracy is made for
    "time": "rig-rigid", "mesh": "rig-rom", "reduction": "rig-rom", "chain-length": "rig-rigid",
    "wall-modes": "rig-rigid",
}  # fmt: skip


def names(folder: str) -> list[str]:
    """All names of "accuracy", "stability" or "verify"."""
    return [name for of_module in MODULES[folder].values() for name in of_module]


def chosen(folder: str, wanted: tuple[str, ...] = ()) -> dict[str, Callable]:
    """The functions of these names, all if there are none; raises InvalidScene for an unknown
    one."""
    for name in wanted:
        if name not in names(folder):
            option, near = OPTIONS[folder], nearest(name, names(folder))
            raise InvalidScene(f"{option} {name!r} is not known; {near}.")
    modules = {name: module for module, group in MODULES[folder].items() for name in group}
    functions = {}
    for name in wanted or names(folder):
        module = import_module(f"{__package__}.{folder}.{modules[name]}")
        functions[name] = getattr(module, name.replace("-", "_"))
    return functions


def shown(folder: str) -> dict[str, str]:
    """A line on each name."""
    return {name: f.__doc__.partition("\n")[0] for name, f in chosen(folder).items()}
