"""The step from the error asked for."""

from typing import NamedTuple

import numpy as np

from dem.chain import InvalidChain, validate
from dem.schemes import SCHEMES, default_scheme
from dem.stability import fastest_rate
from dem.trajectory import Trajectory, UnstableStep, prepare, run, start

ASSUMED_ORDER = 2.5


class StepReport(NamedTuple):
    """How a step was found: one entry per march tried, coarse to fine."""

    dt: np.ndarray  # [s]
    difference: np.ndarray  # relative velocity change against the march before
    energy_error: np.ndarray
    error_estimate: float
    evaluations: int  # contact force evaluations of all marches


class Controlled(NamedTuple):
    """A march and the report on its step."""

    trajectory: Trajectory
    step_report: StepReport


def march_to_error(
    chain,
    wall,
    v0,
    *,
    duration,
    error,
    observed=None,
    scale=None,
    energy_error=None,
    scheme=None,
    n_save=1000,
    max_evaluations=2e8,
):
    """Trajectory whose velocities are off by less than `error` times `scale` on the observed
    spheres, and whose ledger closes to `energy_error`.

    observed: indices of spheres, None for all; scale: the largest initial speed unless given;
    energy_error: error / 10^4 without losses, error / 100 with them, unless given. The estimate
    compares marches of different step and assumes order 2.5, what contacts that open and close
    leave of any scheme. Raises UnstableStep if `max_evaluations` do not suffice.
    """
    validate(chain, wall, v0)
    _positive("error", error)
    _positive("duration", duration)
    name = scheme or default_scheme(chain, wall)
    if name not in SCHEMES:
        raise InvalidChain(f"scheme {name!r} is unknown; take one of {', '.join(SCHEMES)}")
    method = SCHEMES[name]
    prepared = prepare(chain, wall)
    scale = scale or float(np.abs(v0).max()) or 1.0
    energy_error = energy_error or _energy_target(chain, wall, error)
    rows = slice(None) if observed is None else np.asarray(observed)
    state = start(chain, wall, v0, prepared.static)
    rate = max(fastest_rate(chain, wall, v0, prepared.static), 1.0 / duration)
    step = 0.2 * method.order / rate
    coarse = run(chain, wall, prepared, state, duration, step, method, n_save)
    tried = [(coarse.dt, np.inf, coarse.energy_error)]
    spent = coarse.n_steps * method.evaluations
    growth = 2.0
    while True:
        spent += int(coarse.n_steps * growth) * method.evaluations
        if spent > max_evaluations:
            raise UnstableStep(
                f"error {error:g} is not reached with dt = {coarse.dt:.3g} s, found "
                f"{tried[-1][1]:.3g} in velocity and {tried[-1][2]:.3g} in energy; "
                "ask for a larger error or allow more evaluations"
            )
        fine = run(chain, wall, prepared, state, duration, coarse.dt / growth, method, n_save)
        difference = float(np.abs(fine.v - coarse.v)[:, rows].max()) / scale
        ratio = coarse.dt / fine.dt
        estimate = difference / (ratio**ASSUMED_ORDER - 1.0)
        tried.append((fine.dt, difference, fine.energy_error))
        excess = max(estimate / error, fine.energy_error / energy_error)
        if excess <= 1.0:
            break
        growth = float(np.clip((2.0 * excess) ** (1.0 / ASSUMED_ORDER), 1.5, 8.0))
        coarse = fine
    report = StepReport(*map(np.array, zip(*tried, strict=True)), estimate, spent)
    return Controlled(fine._replace(error_estimate=estimate), report)


def _energy_target(chain, wall, error):
    damped_wall = wall is not None and (wall.mobility > 0.0 or bool(np.any(wall.zeta)))
    lossless = chain.dissipation == "none" and not damped_wall
    return max(error * (1e-4 if lossless else 1e-2), 1e-12)


def _positive(name, value):
    if not (np.isfinite(value) and value > 0.0):
        raise InvalidChain(f"{name} is {value}; it must be finite and above 0")
