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
    design_hammer_test           where to hit and watch
    tune_to_responses            a model fitted to frequency responses themselves
    rank_parameters, fit_losses  what is worth freeing in a fit of joints; loss factors from damping
    joints_posterior             all joints and materials that measured modes allow
    reduce, reduce_matrices      a reduced model: of a scene, of one's own K, M, w
    look, export                 bodies and where they touch; CalculiX, Abaqus, STEP
    calibrate                    a chain and its wall fitted to measured velocities
    inspect, design              numbers of the structure from forces or velocities in the chain;
                                 which sphere to watch
    sweep, sweep_price           many cases into one table, what outputs depend on; the cost
    scan, load_sweep             the chain over a face, a map; a finished sweep or scan
    accuracy, stability          errors against run times; extreme cases
    verify                       our results beside independent codes and published numbers
    doctor                       what is installed, what is missing and what that costs

Results hold numbers as attributes; `data` is an xarray.Dataset with named dimensions and units,
`plot()` a picture that a notebook shows and `.save("x.png")` writes. Bad input raises
beadwave.InvalidScene, a ValueError, in one sentence. A function that takes `out` writes there what
the command of its name would.

The packages behind it, each with a help of its own: beadwave.geometry, beadwave.fem, beadwave.rom,
beadwave.dem, beadwave.coupling.
"""

from importlib import import_module
from types import FunctionType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from beadwave.workflows.evidence.api import accuracy, stability, studies, verify
    from beadwave.workflows.fit.api import calibrate, design, inspect, joints_posterior
    from beadwave.workflows.installation.doctor import doctor
    from beadwave.workflows.run.api import Run, film, impact, load, run, scene, scenes
    from beadwave.workflows.scene import InvalidScene, Scene
    from beadwave.workflows.structure.api import (
        design_hammer_test,
        export,
        fit_losses,
        hammer,
        look,
        modes,
        rank_parameters,
        reduce,
        reduce_matrices,
        thesis_table,
        tune,
        tune_to_responses,
        write_hammer_test,
    )
    from beadwave.workflows.sweep.api import Cases, load_sweep, scan, sweep, sweep_price

_HOMES = {
    "beadwave.workflows.evidence.api": ("accuracy", "stability", "studies", "verify"),
    "beadwave.workflows.fit.api": ("calibrate", "design", "inspect", "joints_posterior"),
    "beadwave.workflows.installation.doctor": ("doctor",),
    "beadwave.workflows.run.api": ("Run", "film", "impact", "load", "run", "scene", "scenes"),
    "beadwave.workflows.scene": ("InvalidScene", "Scene"),
    "beadwave.workflows.structure.api": (
        "design_hammer_test",
        "export",
        "fit_losses",
        "hammer",
        "look",
        "modes",
        "rank_parameters",
        "reduce",
        "reduce_matrices",
        "thesis_table",
        "tune",
        "tune_to_responses",
        "write_hammer_test",
    ),
    "beadwave.workflows.sweep.api": ("Cases", "load_sweep", "scan", "sweep", "sweep_price"),
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
    "design_hammer_test",
    "doctor",
    "export",
    "film",
    "fit_losses",
    "hammer",
    "impact",
    "inspect",
    "joints_posterior",
    "load",
    "load_sweep",
    "look",
    "modes",
    "rank_parameters",
    "reduce",
    "reduce_matrices",
    "run",
    "scan",
    "scene",
    "scenes",
    "stability",
    "studies",
    "sweep",
    "sweep_price",
    "thesis_table",
    "tune",
    "tune_to_responses",
    "verify",
    "write_hammer_test",
]

_PACKAGES = ("geometry", "fem", "rom", "dem", "coupling", "workflows")


def __getattr__(name: str):
    """The function or the package, imported when it is first asked for."""
    if name in _PACKAGES:
        return import_module(f"beadwave.{name}")
    if name not in _MODULES:
        raise AttributeError(f"module 'beadwave' has no attribute {name!r}")
    value = getattr(import_module(_MODULES[name]), name)
    if isinstance(value, FunctionType):
        from beadwave.workflows.scene.arguments import checked

        value = checked(value)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__doc__"]
