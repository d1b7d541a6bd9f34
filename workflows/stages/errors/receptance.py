"""Errors of a run at a measured wall: by the noise of the response, and by the end of its band.

The chain is marched again at walls fitted to the response with its residuals at random phases, and
at one fitted to the lower part of the band. Twice the mean change of the former and the change of
the latter are the error.
"""

import numpy as np

from beadwave import coupling, dem
from beadwave.coupling.measured_wall import measured_wall
from beadwave.dem.waves.chain_waves import ChainWaves
from beadwave.workflows.files.receptance_file import fitted
from beadwave.workflows.report.summary import NumberError
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.chain import Start
from beadwave.workflows.stages.errors.numbers import MarchedPair, instants, numbers_with_errors
from beadwave.workflows.stages.errors.waves import observed


def pairs(scene: Scene, start: Start, impact: coupling.Impact) -> tuple[MarchedPair, ...]:
    """The run compared with each of those at other walls, with its share of the error."""
    run, fits = impact.trajectory, fitted(scene.wall)
    others = [(fit, 2 / len(fits.by_noise)) for fit in fits.by_noise] + [(fits.by_band, 1.0)]
    march = {"duration": float(run.t[-1]), "dt": run.dt, "n_save": len(run.t) - 1}
    walls = [(measured_wall(fit, half_space=fits.half_space), share) for fit, share in others]
    return tuple(
        MarchedPair(run, dem.march(start.chain, wall, start.velocity, **march), share)
        for wall, share in walls
    )


def receptance_error(scene: Scene, start: Start, impact: coupling.Impact) -> float:
    """Largest velocity error of the observed spheres up to the horizon over the largest initial
    speed."""
    n, at = instants(scene, impact.trajectory), observed(scene)
    changes = [
        pair.share * np.abs(pair.second.v[:n, at] - pair.first.v[:n, at]).max()
        for pair in pairs(scene, start, impact)
    ]
    return float(sum(changes) / np.abs(start.velocity).max())


def number_errors(
    scene: Scene, start: Start, impact: coupling.Impact, waves: ChainWaves
) -> tuple[NumberError, ...]:
    """Every number of the waves with its errors of the time step and of the receptance."""
    of_fit = {"receptance": pairs(scene, start, impact)}
    return numbers_with_errors(scene, start, impact, waves, of_fit)
