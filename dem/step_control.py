"""The step from the error asked for, and the largest step that makes sense."""

from typing import NamedTuple

import numpy as np

from dem.chain import InvalidChain, validate
from dem.schemes import SCHEMES, schedule
from dem.trajectory import (
    Trajectory,
    UnstableStep,
    default_scheme,
    prepare,
    run,
    start,
)

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


def fastest_rate(chain, wall, v0):
    """Upper estimate of the largest contact frequency [rad/s]: all kinetic energy in one contact,
    on top of the static force."""
    prepared = prepare(chain, wall)
    energy = 0.5 * float(chain.mass @ np.square(v0))
    overlap = (2.5 * energy / chain.A) ** 0.4 + (prepared.static.force / chain.A) ** (2 / 3)
    stiffness = 1.5 * chain.A * np.sqrt(overlap)
    inverse = 1.0 / chain.mass
    pair = inverse[:-1] + inverse[1:]
    if wall is not None:
        pair = np.append(pair, inverse[-1] + wall.phi @ wall.phi)
    return float(np.sqrt((stiffness * pair).max(initial=0.0)))


def stability_interval(scheme):
    """Largest dt * omega for which a linear contact of frequency omega stays bounded."""
    plan = schedule(scheme)
    z = np.arange(0.01, 12.0, 0.01)
    x, v = np.tile(np.eye(2)[:, :, None], z.size)

    def kick(fraction):
        v[:] -= fraction * z * x

    def drift(fraction):
        x[:] += fraction * z * v

    kick(plan.lead_b)
    drift(plan.lead_a)
    for b, a in zip(plan.b[:-1], plan.a[:-1], strict=True):
        kick(b)
        drift(a)
    kick(plan.end_b)
    drift(plan.end_a)
    unstable = np.abs(x[0] + v[1]) > 2.0 + 1e-9
    return float(z[unstable.argmax()]) if unstable.any() else float(z[-1])


def stability_limit(chain, wall, v0, *, scheme=None):
    """Largest meaningful step [s]; contacts that share a sphere can lower it by up to sqrt(2)."""
    validate(chain, wall, v0)
    name = scheme or default_scheme(chain, wall)
    rate = fastest_rate(chain, wall, v0)
    return stability_interval(SCHEMES[name]) / rate if rate > 0.0 else np.inf


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
    rate = max(fastest_rate(chain, wall, v0), 1.0 / duration)
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
