"""What a run found, as other programs read it: `summary.json`."""

from typing import Any

from pydantic import BaseModel, ConfigDict

HAMMER_TEST_HZ = (51.0, 269.0, 907.0, 8425.0)  # thesis, table 5.1


class StageTime(BaseModel):
    """What a stage took in this run."""

    name: str
    seconds: float
    cached: bool


class WaveArrival(BaseModel):
    """A wave passing an observed sphere."""

    time_s: float
    peak_velocity_m_s: float


class SphereWaves(BaseModel):
    """Waves at one sphere; between the incident and the first reflected one, what was asked for."""

    arrivals: tuple[WaveArrival, ...]
    tof_s: float | None
    arr: float | None


class ErrorEstimate(BaseModel):
    """Relative errors of the observed velocities; None where nothing estimated it."""

    time: float | None = None
    reduction: float | None = None
    mesh: float | None = None


class Summary(BaseModel):
    """Every number of a run that is worth comparing."""

    model_config = ConfigDict(ser_json_inf_nan="null", frozen=True)

    scene: str
    modes_hz: dict[str, float] = {}
    dofs: int = 0
    n_wall_modes: int = 0
    dt_s: float | None = None
    n_steps: int = 0
    peak_wall_force_N: float | None = None
    contact_radius_m: float | None = None
    energy_error: float | None = None
    error_estimate: ErrorEstimate = ErrorEstimate()
    waves: dict[str, SphereWaves] = {}
    stages: tuple[StageTime, ...] = ()
    warnings: tuple[str, ...] = ()
    versions: dict[str, str] = {}

    def text(self) -> str:
        """JSON, indented."""
        return self.model_dump_json(indent=2) + "\n"


def rows(summary: Summary) -> list[tuple[str, str]]:
    """The summary's single numbers as a person reads them: label, value with unit."""
    labelled = [
        ("modes 1 to 4", _joined(summary.modes_hz.values(), "Hz")),
        ("degrees of freedom", f"{summary.dofs:,}" if summary.dofs else None),
        ("modes of the wall", str(summary.n_wall_modes) if summary.n_steps else None),
        ("time step", _number(summary.dt_s, "µs", 1e6)),
        ("steps", f"{summary.n_steps:,}" if summary.n_steps else None),
        ("peak force at the wall", _number(summary.peak_wall_force_N, "N")),
        ("contact radius", _number(summary.contact_radius_m, "mm", 1e3)),
        ("energy error", _number(summary.energy_error)),
        ("error of the time step", _number(summary.error_estimate.time)),
        ("error of the reduction", _number(summary.error_estimate.reduction)),
        ("error of the mesh", _number(summary.error_estimate.mesh)),
    ]
    return [(label, value) for label, value in labelled if value]


def _number(value: Any, unit: str = "", scale: float = 1.0) -> str | None:
    return None if value is None else f"{scale * value:.4g} {unit}".rstrip()


def _joined(values, unit: str) -> str | None:
    return " / ".join(f"{value:.5g}" for value in values) + f" {unit}" if values else None
