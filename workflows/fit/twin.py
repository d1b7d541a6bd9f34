"""A twin experiment: a known rig makes the data, a calibration has to find it again.

Everything it writes says SYNTHETIC on its face. The data does not come from the model that is
fitted, see `workflows.fit.instrument`.
"""

from collections.abc import Mapping, Sequence
from textwrap import fill
from time import perf_counter
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel

from beadwave import dem
from beadwave.dem.kernels.laws import SHAPE_PARAMETERS
from beadwave.workflows.files.record import SYNTHETIC, Record
from beadwave.workflows.fit import scene_parameters
from beadwave.workflows.fit.calibrate import CalibrationOutcome, CalibrationRequest, calibrated
from beadwave.workflows.fit.instrument import (
    OVERSAMPLED,
    Clean,
    Repeats,
    Twin,
    clean_signals,
    refitted,
    repeated,
)
from beadwave.workflows.fit.model_errors import BetterModel
from beadwave.workflows.fit.parameter import Parameter
from beadwave.workflows.report.tables import LINE, aligned_text
from beadwave.workflows.scene import InvalidScene, OneDofWall, Scene
from beadwave.workflows.stages.chain.chain import chain, initial_velocity

MET = 0.9  # share of repeats inside their two-sigma bars that is asked for


class Truth(NamedTuple):
    """The rig that made the data."""

    contact: np.ndarray  # (n_contacts,) factors on the scene's stiffness
    frequency: float | None  # [Hz]

    def of(self, p: Parameter, twin: Twin, scene: Scene) -> float:
        """The true value of a parameter."""
        match p.kind:
            case "contact":
                return float(self.contact[p.index])
            case "frequency":
                return self.frequency
            case "trigger":
                return twin.before
            case "mass":
                return scene.wall.mass
            case "striker":
                return scene.striker.velocity
            case "preload":
                return scene.preload.force if scene.preload else 0.0
            case key if key == "stiffness" or key in SHAPE_PARAMETERS:
                return float(getattr(scene.contact, key))
            case "dissipation":
                return float(np.max(scene.contact.coefficient))
        if isinstance(scene.wall, OneDofWall):
            return scene.wall.damping_ratio
        return float(np.atleast_1d(scene.damping.ratio)[p.index])


class Coverage(BaseModel):
    """Rate at which repeats of the noise have the truth inside their two-sigma bars."""

    synthetic: bool = True
    runs: int
    seconds: float
    share: dict[str, float]
    pooled: float
    required: float  # share of each parameter from which on `met` is true
    met: bool

    def text(self) -> str:
        """A line per parameter."""
        rows = ((name, f"{100 * share:.1f} %") for name, share in self.share.items())
        table = aligned_text(("parameter", "within two sigma"), rows)
        worst = min(self.share, key=self.share.get)
        verdict = (
            f"Within two sigma in {100 * self.pooled:.1f} % of all, at least "
            f"{100 * self.share[worst]:.1f} % ({worst}); {100 * MET:.0f} % are asked for: "
            f"{'met' if self.met else 'not met'}."
        )
        head = f"{SYNTHETIC}; {self.runs} repeats of the experiment in {self.seconds:.1f} s"
        return "\n".join(["", head, table, fill(verdict, LINE, subsequent_indent="  ")])


def checked(twin: Twin) -> Twin:
    """The twin; raises InvalidScene for numbers that no experiment has."""
    limits = {
        "scatter": (0.0, 0.5), "frequency": (1.0, 1e5), "noise": (0.0, 10.0),
        "sampling": (1e4, 1e8), "instrument": (1e3, 1e8),
        "jitter": (0.0, 1e-3), "before": (0.0, 1e-2),
    }  # fmt: skip
    for name, (low, high) in limits.items():
        value = getattr(twin, name)
        if not low <= value <= high:
            raise InvalidScene(
                f"--{name} {value:g} must be between {low:g} and {high:g}; change it."
            )
    if twin.instrument >= 0.5 * OVERSAMPLED * twin.sampling:
        raise InvalidScene(f"--instrument {twin.instrument:g} Hz is beyond the sampling; lower it.")
    return twin


def truth(scene: Scene, twin: Twin) -> Truth:
    """A rig drawn by the twin's seed."""
    rng = np.random.default_rng([twin.seed, 0])
    factors = 1.0 + twin.scatter * rng.uniform(-1.0, 1.0, scene.n_contacts)
    of_mass = isinstance(scene.wall, OneDofWall)
    return Truth(factors, twin.frequency if of_mass else None)


def clean(scene: Scene, wall: dem.Wall | None, twin: Twin, true_rig: Truth) -> Clean:
    """The known rig marched and filtered by the instrument; raises InvalidScene where no sphere is
    measured."""
    if not scene.output.spheres:
        raise InvalidScene("output.spheres is empty; name the spheres that are measured.")
    if true_rig.frequency is not None:
        wall = wall._replace(omega=np.array([2 * np.pi * true_rig.frequency]))
    row, v0 = chain(scene), initial_velocity(scene)
    row = row._replace(A=row.A * true_rig.contact)
    return clean_signals(row, wall, v0, twin, scene.output.spheres, scene.time.duration)


def measured(signals: Clean, twin: Twin, run: int = 0) -> Record:
    """The record of one experiment: repeats with jitter of the trigger and noise."""
    return Record(*repeated(signals, twin, run), signals.spheres, SYNTHETIC)


def twin_run(
    scene: Scene,
    wall: dem.Wall | None,
    twin: Twin,
    request: CalibrationRequest,
    better: Mapping[str, Sequence[BetterModel]] = MappingProxyType({}),
) -> tuple[CalibrationOutcome, Record]:
    """The experiment made and calibrated; the report has the true and the fitted values."""
    true_rig = truth(scene, twin)
    data = measured(clean(scene, wall, twin, true_rig), twin)
    request = request._replace(instrument=twin.instrument)
    result = calibrated(scene, wall, data, "twin (synthetic)", request, better)
    rows = result.report.parameters
    for row, p in zip(rows, result.fit.parameters, strict=True):
        row.truth = true_rig.of(p, twin, scene)

    # the largest error of a contact, and how many parameters lie within their bars
    contacts = [row for row in rows if row.name.startswith("contact ")]
    error = max((abs(row.found / row.truth - 1) for row in contacts), default=0.0)
    inside = sum(
        row.two_sigma is not None and abs(row.found - row.truth) <= row.two_sigma for row in rows
    )
    result.report.remarks.insert(
        0,
        f"Known rig: contacts scattered by {100 * twin.scatter:g} %, noise {1e3 * twin.noise:g} "
        f"mm/s rms below {twin.instrument / 1e3:g} kHz, {twin.sampling / 1e6:g} MHz, "
        f"{twin.repeats} repeats, trigger {1e6 * twin.jitter:g} us, seed {twin.seed}, all assumed. "
        f"Contacts are found within {100 * error:.2g} %; {inside} of {len(rows)} parameters lie "
        "within their bars.",
    )
    return result, data


def coverage(
    scene: Scene,
    wall: dem.Wall | None,
    twin: Twin,
    request: CalibrationRequest,
    result: CalibrationOutcome,
    runs: int,
) -> Coverage:
    """Shares of repeats of the experiment, each with its own noise, whose bars hold the truth.

    Each is fitted from what the first experiment found: the search is not repeated, its bars are.
    """
    began = perf_counter()
    true_rig, fit = truth(scene, twin), result.fit
    signals = clean(scene, wall, twin, true_rig)
    true_values = np.array([true_rig.of(p, twin, scene) for p in fit.parameters])
    start = tuple(
        p._replace(start=float(x)) for p, x in zip(fit.parameters, fit.value, strict=True)
    )
    rig = scene_parameters.rig(scene, wall, twin.before)
    fits = refitted(Repeats(rig, twin, request.band, signals, start), runs)
    hits = np.abs(fits[:, 0] - true_values) <= fits[:, 1]
    share = {p.name: float(s) for p, s in zip(start, hits.mean(axis=0), strict=True)}
    return Coverage(
        runs=runs,
        seconds=perf_counter() - began,
        share=share,
        pooled=float(hits.mean()),
        required=MET,
        met=min(share.values()) >= MET,
    )
