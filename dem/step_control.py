"""The step from the error asked for, by marching twice with different steps."""

from typing import NamedTuple

import numpy as np

from dem.chain import validate
from dem.checks import InvalidChain
from dem.schemes import SCHEMES, default_scheme
from dem.stability import (
    BACKWARD,
    UnstableStep,
    fastest_decay,
    fastest_rate,
    stability_interval,
)
from dem.trajectory import Trajectory, march, prepare, run, start


class StepReport(NamedTuple):
    """How a step was found: one entry per comparison of two marches, coarse to fine."""

    dt: np.ndarray  # [s] of the finer march
    difference: np.ndarray  # relative velocity change against the coarser march
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
    energy_error: error / 100 unless given;
    max_evaluations: of all contacts, unless given as many as take about a minute. The estimate
    divides the difference of two marches by what order 2 leaves, less than any scheme here keeps
    (1.75 for a scheme of order 2, 0.75 for the linear laws, whose force jumps). Raises UnstableStep
    if `max_evaluations` do not suffice.
    """
    validate(chain, wall, v0)
    _positive("error", error)
    _positive("duration", duration)
    prepared = prepare(chain, wall)
    rate = max(fastest_rate(chain, wall, v0, prepared.static), 1.0 / duration)
    decay = fastest_decay(chain, wall, v0, prepared.static)
    name = scheme or default_scheme(chain, wall, stiffly_damped=decay > 3.0 * BACKWARD * rate)
    if name not in SCHEMES:
        raise InvalidChain(f"scheme {name!r} is unknown; take one of {', '.join(SCHEMES)}")
    method = SCHEMES[name]
    scale = scale or float(np.abs(v0).max()) or 1.0
    energy_error = energy_error or max(1e-2 * error, 1e-12)
    observed = slice(None) if observed is None else np.asarray(observed)
    order = _assumed_order(chain, method)
    state = start(chain, wall, v0, prepared.static)
    allowed = max_evaluations or 2e10 / (chain.mass.size + prepared.static.q.size)
    if method.kind == "implicit":
        allowed /= 20

    def attempt(step, saves):
        try:
            return run(chain, wall, prepared, state, duration, step, method, saves)
        except UnstableStep:
            return None

    step = min(_first_step(method, error, energy_error) / rate, duration / n_save)
    spent = duration / (2.0 * step) * method.evaluations
    if not spent <= allowed:
        raise UnstableStep(_unaffordable(error, duration, step, spent, allowed))
    coarse = attempt(2.0 * step, _sparser(n_save, duration / (2.0 * step)))
    if coarse is not None and coarse.dt < 1.5 * step:  # n_save saves left no room for a longer one
        step = coarse.dt / 2.0
    tried = []
    while True:
        spent += duration / step * method.evaluations
        if spent > allowed:
            raise UnstableStep(_unreached(error, step, tried))
        fine = attempt(step, n_save)
        if fine is None or coarse is None:
            coarse, step = fine, step / (4.0 if fine is None else 2.0)
            continue
        every = n_save // (coarse.t.size - 1)
        difference = float(np.abs(fine.v[::every] - coarse.v)[:, observed].max()) / scale
        estimate = difference / ((coarse.dt / fine.dt) ** order - 1.0)
        tried.append((fine.dt, difference, fine.energy_error))
        excess = max(estimate / error, fine.energy_error / energy_error)
        if excess <= 1.0:
            break
        likely = max(order, 0.75 * min(method.order, 4) if order > 1.0 else 0.0)
        step = fine.dt / np.clip((2.0 * excess) ** (1.0 / likely), 1.5, 8.0)
        coarse = fine
    report = StepReport(*map(np.array, zip(*tried, strict=True)), estimate, int(spent))
    return Controlled(fine._replace(error_estimate=estimate), report)


def with_step_error(chain, wall, v0, trajectory, *, state=None):
    """The trajectory of a given step, its relative velocity error estimated by half the step.

    The estimate is cautious like that of `march_to_error`, on all spheres; `state` is what the
    trajectory continued, if it did.
    """
    finer = march(
        chain, wall, v0, duration=float(trajectory.t[-1]), dt=trajectory.dt / 2.0,
        scheme=trajectory.scheme, n_save=trajectory.t.size - 1, state=state,
    )  # fmt: skip
    scale = float(np.abs(v0).max()) or 1.0
    difference = float(np.abs(finer.v - trajectory.v).max()) / scale
    order = _assumed_order(chain, SCHEMES[trajectory.scheme])
    return trajectory._replace(error_estimate=difference / (1.0 - 0.5**order))


def _assumed_order(chain, method):
    return 0.75 if chain.dissipation.startswith("linear") else min(2.0, method.order - 0.25)


def _unaffordable(error, duration, step, needed, allowed):
    return (
        f"error {error:g} over {duration:g} s is not reached within {allowed:.2g} evaluations, it "
        f"takes more than {needed:.2g} at dt = {step:.3g} s; ask for a larger error or less time"
    )


def _unreached(error, step, tried):
    found = "no march that stays finite (a negative residual compliance may be too large)"
    if tried:
        found = f"{tried[-1][1]:.3g} in velocity and {tried[-1][2]:.3g} in energy"
    return (
        f"error {error:g} is not reached with dt = {step:.3g} s, found {found}; "
        "ask for a larger error or allow more evaluations"
    )


def _first_step(method, error, energy_error):
    """Step times contact frequency that reaches both errors on a chain of 17 spheres, with a
    margin of 3 (measured)."""
    if method.kind == "implicit":
        return 0.1 * (error / 5e-2) ** 0.5 if method.order == 2 else 0.2 * (error / 6e-5) ** 0.25
    interval = stability_interval(method)
    if method.order == 2:
        return min(0.058 * min((error / 8e-3) ** 0.5, (energy_error / 5e-4) ** 0.5), 0.2 * interval)
    share = min((error / 3e-5) ** 0.25, (energy_error / 3e-6) ** 0.25)
    return interval * min(0.055 * share, 0.16)


def _sparser(n_save, limit):
    """Largest divisor of n_save that is not above the limit, n_save if there is none."""
    divisors = (n_save // k for k in range(1, 51) if n_save % k == 0)
    return next((m for m in divisors if m <= limit * (1 + 1e-9)), n_save)


def _positive(name, value):
    if not (np.isfinite(value) and value > 0.0):
        raise InvalidChain(f"{name} is {value}; it must be finite and above 0")
