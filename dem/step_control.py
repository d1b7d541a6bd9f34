"""The step from the error asked for, by marching twice with different steps."""

from typing import NamedTuple

import numpy as np

from dem.chain import InvalidChain, validate
from dem.schemes import SCHEMES, default_scheme
from dem.stability import fastest_rate, stability_interval
from dem.trajectory import Trajectory, UnstableStep, prepare, run, start


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
    max_evaluations=None,
):
    """Trajectory whose velocities are off by less than `error` times `scale` on the observed
    spheres, and whose ledger closes to `energy_error`.

    observed: indices of spheres, None for all; scale: the largest initial speed unless given;
    energy_error: error / 10^4 without losses, error / 100 with them, unless given;
    max_evaluations: of all contacts, unless given as many as take about a minute. The estimate
    divides the difference of two marches by what order 2.5 leaves (2 and, explicit, 1 for the
    linear laws, whose force jumps), less than any scheme here keeps. Raises UnstableStep if `max_evaluations`
    do not suffice.
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
    observed = slice(None) if observed is None else np.asarray(observed)
    order = 2.5
    if chain.dissipation.startswith("linear"):
        order = 2.0 if method.kind == "implicit" else 1.0
    state = start(chain, wall, v0, prepared.static)
    rate = max(fastest_rate(chain, wall, v0, prepared.static), 1.0 / duration)
    allowed = max_evaluations or 2e10 / (chain.mass.size + prepared.static.q.size)

    def attempt(step, saves):
        return run(chain, wall, prepared, state, duration, step, method, saves)

    spacing = duration / n_save
    step = min(_first_step(method, error, energy_error) / rate, spacing)
    coarse = attempt(2.0 * step, _sparser(n_save, duration / (2.0 * step)))
    tried = [(coarse.dt, np.inf, coarse.energy_error)]
    spent = coarse.n_steps * method.evaluations
    while True:
        spent += int(duration / step) * method.evaluations
        if spent > allowed:
            raise UnstableStep(
                f"error {error:g} is not reached with dt = {coarse.dt:.3g} s, found "
                f"{tried[-1][1]:.3g} in velocity and {tried[-1][2]:.3g} in energy; "
                "ask for a larger error or allow more evaluations"
            )
        fine = attempt(step, n_save)
        every = n_save // (coarse.t.size - 1)
        difference = float(np.abs(fine.v[::every] - coarse.v)[:, observed].max()) / scale
        estimate = difference / ((coarse.dt / fine.dt) ** order - 1.0)
        tried.append((fine.dt, difference, fine.energy_error))
        excess = max(estimate / error, fine.energy_error / energy_error)
        if excess <= 1.0:
            break
        step = fine.dt / np.clip((2.0 * excess) ** (1.0 / max(order, 1.0)), 1.5, 8.0)
        coarse = fine
    report = StepReport(*map(np.array, zip(*tried, strict=True)), estimate, spent)
    return Controlled(fine._replace(error_estimate=estimate), report)


def _first_step(method, error, energy_error):
    """Step times contact frequency that reaches both errors on a chain of 17 spheres, with a
    margin of 3 (measured)."""
    if method.kind == "implicit":
        return 0.1 * (error / 5e-2) ** 0.5 if method.order == 2 else 0.2 * (error / 6e-5) ** 0.25
    interval = stability_interval(method)
    if method.order == 2:
        return min(0.058 * min((error / 8e-3) ** 0.5, (energy_error / 5e-4) ** 0.5), 0.2 * interval)
    share = min((error / 5e-5) ** 0.25, (energy_error / 8e-6) ** 0.25)
    return interval * min(0.055 * share, 0.08)


def _sparser(n_save, limit):
    """Largest divisor of n_save that is not above the limit, n_save if there is none."""
    divisors = (n_save // k for k in range(1, 51) if n_save % k == 0)
    return next((m for m in divisors if m <= limit * (1 + 1e-9)), n_save)


def _energy_target(chain, wall, error):
    damped_wall = wall is not None and (wall.mobility > 0.0 or bool(np.any(wall.zeta)))
    lossless = chain.dissipation == "none" and chain.yield_overlap is None and not damped_wall
    return max(error * (1e-4 if lossless else 1e-2), 1e-12)


def _positive(name, value):
    if not (np.isfinite(value) and value > 0.0):
        raise InvalidChain(f"{name} is {value}; it must be finite and above 0")
