"""Stated errors beside true ones over populations: at least as large, and not by far.

Of the ratios of stated to true errors the point of 5 % is to be at least 1, the median at most 10.
A true error below what its own reference resolves is counted as that.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

import dem
import rom
from dem.spheres import time_scale
from rom.truncation import frequencies
from workflows.evidence.verify.comparisons import Comparison
from workflows.evidence.verify.random_scenes import LAWS, WALLS, scene
from workflows.fit.core.calibration.calibration import calibrate
from workflows.fit.core.calibration.forward import ChainForward
from workflows.fit.core.calibration.parameters import Parameter, Rig
from workflows.fit.core.calibration.search import Options
from workflows.fit.core.calibration.signals import Signals

LEAST, MOST, FLOOR = 1.0, 10.0, 1e-10
NORMAL, HELD = 0.954, (0.90, 0.98)  # of bars that hold the truth
N_FITTED = 120
FINER = {"none": 8, "hunt-crossley": 8, "linear": 64, "linear-clipped": 64}  # of the step


def honest_steps() -> Iterator[Comparison]:
    """Stated over true errors of the time step: random chains, walls, laws, errors asked for."""
    yield from points("smooth forces", [*_steps(("none", "hunt-crossley"))])
    yield from points("forces that jump", [*_steps(("linear", "linear-clipped"))])


def honest_reductions() -> Iterator[Comparison]:
    """Stated over true errors of the receptance: random chains of springs and masses."""
    yield from points("receptance", [*_reductions()])


def honest_bars() -> Iterator[Comparison]:
    """Share of two-sigma bars that hold the truth: chains and walls fitted to noisy velocities."""
    yield _held(np.array([_fitted(seed) for seed in range(N_FITTED)]))


def _held(off: NDArray[np.float64]) -> Comparison:
    """The share of errors, in two-sigma bars, of at most one."""
    held = float(np.mean(np.abs(off) <= 1))
    said = f"calibration, {off.size} two-sigma bars: share that hold the truth"
    missing = max(0.0, HELD[0] - held, held - HELD[1])
    source = f"synthetic records with white noise; {100 * NORMAL:.1f} % expected"
    return Comparison(said, held, NORMAL, missing, 0.0, source)


def points(name: str, ratios: list[float]) -> tuple[Comparison, ...]:
    """Rows of the points of 5, 50 and 95 % of stated over true."""
    low, median, high = np.quantile(ratios, [0.05, 0.5, 0.95])
    source = "errors of finer runs, stated over true"
    said = f"{name}, {len(ratios)} scenes:"
    missing = max(0.0, LEAST - low)
    return (
        Comparison(f"{said} 5 % point", low, LEAST, missing, 0.0, source),
        Comparison(f"{said} median", median, MOST, max(0.0, median - MOST), 0.0, source),
        Comparison(f"{said} 95 % point", high, np.nan, 0.0, 0.0, source),
    )


def _steps(dissipations: tuple[str, ...]) -> Iterator[float]:
    """Of random scenes with each law at each wall, three errors asked for."""
    asked = product(LAWS, dissipations, WALLS, (1e-3, 1e-4, 1e-5))
    for seed, (law, dissipation, wall, error) in enumerate(asked):
        if (law, wall) == ("thornton", "dashpot"):
            continue
        rng = np.random.default_rng(1000 + seed)
        chain, behind, v0 = scene(rng, law, dissipation, wall)
        speed = float(np.abs(v0).max())
        duration = 5.0 * v0.size * float(time_scale(chain.mass.max(), chain.A.min(), speed))
        options = {"duration": duration, "n_save": 50}
        run = dem.march_to_error(chain, behind, v0, error=error, **options).trajectory
        dt = run.dt / FINER[dissipation]
        exact = dem.march(chain, behind, v0, dt=dt, scheme=run.scheme, **options)
        true = float(np.abs(run.v - exact.v).max()) / speed
        yield run.error_estimate / max(true, FLOOR)


def _reductions() -> Iterator[float]:
    """Chains of springs and masses at random, both kinds and both choices."""
    f = frequencies(4e3)
    kinds = product((rom.free_modes, _craig_bampton), ("lowest", "contact"), (15, 25, 40), range(3))
    for seed, (reduce, choice, n_modes, _) in enumerate(kinds):
        K, M, w = _springs(np.random.default_rng(seed))
        exact = rom.receptance(rom.full_order(K, M, w), None, f, loss=rom.LOSS)
        reduced = reduce(K, M, w, rom.Selection(n_modes=n_modes, choice=choice, to_hz=4e3))
        found = rom.receptance(reduced, None, f, loss=rom.LOSS)
        true = float(np.linalg.norm(found - exact) / np.linalg.norm(exact))
        if np.isfinite(reduced.error):
            yield reduced.error / max(true, FLOOR)


def _craig_bampton(K, M, w, asked: rom.Selection) -> rom.ReducedModel:
    return rom.craig_bampton(K, M, w, np.flatnonzero(w), asked)


def _springs(rng: np.random.Generator, n: int = 240):
    """K, M of masses in a row, held at one end, and w of the five at the other."""
    k = 3e8 * 3 ** rng.uniform(-1, 1, n)
    diagonal = k + np.append(k[1:], 0.0)
    K = sp.diags_array([-k[1:], diagonal, -k[1:]], offsets=[-1, 0, 1]).tocsc()
    M = sp.diags_array(0.02 * 3 ** rng.uniform(-1, 1, n)).tocsc()
    return K, M, np.append(np.zeros(n - 5), np.full(5, 0.2))


def _fitted(seed: int) -> NDArray[np.float64]:
    """Errors (3,) of a wall's contact, its mass and the striker's velocity in their bars."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 7))
    chain = dem.row_of_spheres(0.01, 7800.0, 2e11, 0.3, count=n)
    mass, speed = rng.uniform([0.1, 0.1], [1.0, 0.5])
    wall = dem.one_dof_wall(10 ** rng.uniform(2.5, 3.5), mass, 0.02)
    rig = Rig(chain, wall, np.append(speed, np.zeros(n - 1)), None, 0.0)
    sought = (
        Parameter("contact at the wall", "contact", 1.0, 0.3, 3.0, 0.3, index=n - 1),
        Parameter("striker", "striker", speed, 0.5 * speed, 2 * speed, 0.1 * speed),
        Parameter("mass", "mass", mass, 0.3 * mass, 3 * mass, 0.2 * mass),
    )
    truth = rng.uniform([0.7, 0.9, 0.8], [1.3, 1.1, 1.25]) * [1.0, speed, mass]
    t = 2e-6 * np.arange(500)
    record = Signals(t, np.zeros((500, 2)), (0, n // 2), np.full(2, np.nan))
    v = ChainForward(rig, sought, record).velocities(truth)
    v = v + speed * 10 ** rng.uniform(-3.0, -1.5) * rng.standard_normal(v.shape)
    found = calibrate(rig, sought, record._replace(v=v), options=Options(starts=1))
    return (found.value - truth) / found.uncertainty.two_sigma
