"""A twin experiment: a known rig makes the data, a calibration has to find it again.

Everything it writes says SYNTHETIC on its face. The data does not come from the model that is
fitted: another scheme marches it at an error of 1e-8 and a higher rate, the instrument's filter
acts on that, and noise and trigger are added to its samples.
"""

from textwrap import fill
from time import perf_counter
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel

import dem
from workflows.files.record import SYNTHETIC, Record
from workflows.fit.calibration import parameters as free_parameters
from workflows.fit.calibration.calibrate import Calibrated, CalibrationRequest, calibrated
from workflows.fit.core.calibration.coverage import Repeats, refitted
from workflows.fit.core.calibration.instrument import (
    OVERSAMPLED,
    Clean,
    Twin,
    clean_signals,
    repeated,
)
from workflows.fit.core.calibration.parameters import Parameter
from workflows.report.tables import LINE, aligned_text
from workflows.scene import InvalidScene, OneDofWall, Scene
from workflows.stages.chain import chain, initial_velocity

SOUGHT = 0.9  # share of repeats inside their bars


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
            case "dissipation":
                return float(np.max(scene.contact.coefficient))
        if isinstance(scene.wall, OneDofWall):
            return scene.wall.damping_ratio
        return float(np.atleast_1d(scene.damping.ratio)[p.index])


class Coverage(BaseModel):
    """How often repeats of the noise found the truth inside their two-sigma bars."""

    synthetic: bool = True
    runs: int
    seconds: float
    share: dict[str, float]
    pooled: float
    met: bool

    def text(self) -> str:
        """A line per parameter."""
        rows = ((name, f"{100 * share:.1f} %") for name, share in self.share.items())
        table = aligned_text(("parameter", "within two sigma"), rows)
        worst = min(self.share, key=self.share.get)
        verdict = (
            f"Within two sigma in {100 * self.pooled:.1f} % of all, at least "
            f"{100 * self.share[worst]:.1f} % ({worst}); {100 * SOUGHT:.0f} % are asked for: "
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


def clean(scene: Scene, wall: dem.Wall | None, twin: Twin, made_by: Truth) -> Clean:
    """The known rig marched and filtered by the instrument."""
    if not scene.output.spheres:
        raise InvalidScene("output.spheres is empty; name the spheres that are measured.")
    if made_by.frequency is not None:
        wall = wall._replace(omega=np.array([2 * np.pi * made_by.frequency]))
    row, v0 = chain(scene), initial_velocity(scene)
    row = row._replace(A=row.A * made_by.contact)
    return clean_signals(row, wall, v0, twin, scene.output.spheres, scene.time.duration)


def measured(made: Clean, twin: Twin, run: int = 0) -> Record:
    """The record of one experiment: repeats with jitter of the trigger and noise."""
    return Record(*repeated(made, twin, run), made.spheres, SYNTHETIC)


def twin_run(
    scene: Scene, wall: dem.Wall | None, twin: Twin, request: CalibrationRequest
) -> tuple[Calibrated, Record]:
    """The experiment made and calibrated; the report holds the truth beside what was found."""
    made_by = truth(scene, twin)
    data = measured(clean(scene, wall, twin, made_by), twin)
    request = request._replace(instrument=twin.instrument)
    found = calibrated(scene, wall, data, "twin (synthetic)", request)
    for row, p in zip(found.report.parameters, found.fit.parameters, strict=True):
        row.truth = made_by.of(p, twin, scene)
    found.report.remarks.insert(0, _told(twin, found))
    return found, data


def _told(twin: Twin, found: Calibrated) -> str:
    contacts = [r for r in found.report.parameters if r.name.startswith("contact ")]
    off = max((abs(r.found / r.truth - 1) for r in contacts), default=0.0)
    inside = [
        r.two_sigma is not None and abs(r.found - r.truth) <= r.two_sigma
        for r in found.report.parameters
    ]
    return (
        f"Known rig: contacts scattered by {100 * twin.scatter:g} %, noise {1e3 * twin.noise:g} "
        f"mm/s rms below {twin.instrument / 1e3:g} kHz, {twin.sampling / 1e6:g} MHz, "
        f"{twin.repeats} repeats, trigger {1e6 * twin.jitter:g} us, seed {twin.seed}, all assumed. "
        f"Contacts are found within {100 * off:.2g} %; {sum(inside)} of {len(inside)} parameters "
        "lie within their bars."
    )


def coverage(
    scene: Scene,
    wall: dem.Wall | None,
    twin: Twin,
    request: CalibrationRequest,
    found: Calibrated,
    runs: int,
) -> Coverage:
    """Shares of repeats of the experiment, each with its own noise, whose bars hold the truth.

    Each is fitted from what the first experiment found: the search is not repeated, its bars are.
    """
    began = perf_counter()
    made_by = truth(scene, twin)
    made = clean(scene, wall, twin, made_by)
    known = np.array([made_by.of(p, twin, scene) for p in found.fit.parameters])
    start = tuple(
        p._replace(start=float(x))
        for p, x in zip(found.fit.parameters, found.fit.value, strict=True)
    )
    rig = free_parameters.rig(scene, wall, twin.before)
    inside = refitted(Repeats(rig, twin, request.band, made, start), runs)
    hits = np.abs(inside[:, 0] - known) <= inside[:, 1]
    share = {p.name: float(s) for p, s in zip(start, hits.mean(axis=0), strict=True)}
    return Coverage(
        runs=runs,
        seconds=perf_counter() - began,
        share=share,
        pooled=float(hits.mean()),
        met=min(share.values()) >= SOUGHT,
    )
