"""Solitary waves between a chain of spheres and the structure it hits.

Five lines for an impact:

    import beadwave

    result = beadwave.impact("rig-1dof", {"striker.velocity": 0.5})
    print(result.summary.peak_wall_force_N)  # 1049 N
    result.plot()                            # velocities of the observed spheres, in a notebook

A scene is a name (`beadwave.scenes()`), a TOML file, a dict of its tables, or a Scene. `changes`
sets values by their dotted keys. Everything is in SI units: m, kg, s, N, Pa, Hz.

    scene, scenes                what is computed, checked and completed
    run, impact, load, film      impacts; a finished run folder, and its film
    modes, tune, hammer          an assembly's modes, joints fitted to measured ones, hammer tests
    reduce, reduce_matrices      a reduced model: of a scene, of one's own K, M, w
    look, export                 bodies and where they touch; CalculiX, Abaqus, STEP
    calibrate, twin              a chain and its wall fitted to measured velocities
    inspect, design              numbers of the structure from forces or velocities in the chain;
                                 which sphere to watch
    sweep, sweep_price           many cases into one table, what outputs depend on; the cost
    scan, load_sweep             the chain over a face, a map; a finished sweep or scan
    study, accuracy, stability   the thesis again; errors against run times; extreme cases
    verify                       our results beside independent codes and published numbers
    doctor                       what is installed, what is missing and what that costs

Results hold numbers as attributes; `data` is an xarray.Dataset with named dimensions and units,
`plot()` a picture that a notebook shows and `.save("x.png")` writes. Bad input raises
beadwave.InvalidScene, a ValueError, in one sentence. A function that takes `out` writes there what
the command of its name would.

The rooms behind it, each with a help of its own: geometry, fem, rom, dem, coupling.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workflows.api.doctor import doctor
    from workflows.api.film import film
    from workflows.api.hammer import hammer, write_hammer_test
    from workflows.api.impacts import Run, impact, load, run
    from workflows.api.inspection import design, inspect
    from workflows.api.look import look
    from workflows.api.measurements import calibrate, twin
    from workflows.api.modes import export, modes, thesis_table
    from workflows.api.reduction import reduce, reduce_matrices
    from workflows.api.scenes import scene, scenes
    from workflows.api.studies import accuracy, stability, studies, study, verify
    from workflows.api.sweeps import Cases, load_sweep, scan, sweep, sweep_price
    from workflows.api.tuning import tune
    from workflows.scene import InvalidScene, Scene

_HOMES = {
    "workflows.api.doctor": ("doctor",),
    "workflows.api.film": ("film",),
    "workflows.api.hammer": ("hammer", "write_hammer_test"),
    "workflows.api.impacts": ("Run", "impact", "load", "run"),
    "workflows.api.inspection": ("design", "inspect"),
    "workflows.api.look": ("look",),
    "workflows.api.measurements": ("calibrate", "twin"),
    "workflows.api.modes": ("export", "modes", "thesis_table"),
    "workflows.api.reduction": ("reduce", "reduce_matrices"),
    "workflows.api.scenes": ("scene", "scenes"),
    "workflows.api.studies": ("accuracy", "stability", "studies", "study", "verify"),
    "workflows.api.sweeps": ("Cases", "load_sweep", "scan", "sweep", "sweep_price"),
    "workflows.api.tuning": ("tune",),
    "workflows.scene": ("InvalidScene", "Scene"),
}
_MODULES = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "Cases",
    "InvalidScene",
    "Run",
    "Scene",
    "accuracy",
    "calibrate",
    "design",
    "doctor",
    "export",
    "film",
    "hammer",
    "impact",
    "inspect",
    "load",
    "load_sweep",
    "look",
    "modes",
    "reduce",
    "reduce_matrices",
    "run",
    "scan",
    "scene",
    "scenes",
    "stability",
    "studies",
    "study",
    "sweep",
    "sweep_price",
    "thesis_table",
    "tune",
    "twin",
    "verify",
    "write_hammer_test",
]


def __getattr__(name: str):
    """The function, imported when it is first asked for."""
    if name not in _MODULES:
        raise AttributeError(f"module 'beadwave' has no attribute {name!r}")
    found = getattr(import_module(_MODULES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return [*__all__, "__doc__"]
