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


class ReductionHealth(BaseModel):
    """What the reduced model is like; see rom.Health.

    effective_mass_captured: share of the assembly's mass that moves along the chain with the
    modes; half_space_compliance_m_per_N is what the Hertz law holds already and the wall gives up.
    """

    kind: str
    coordinates: int
    static_compliance_m_per_N: float
    half_space_compliance_m_per_N: float
    effective_mass_captured: float | None = None
    asymmetry: float
    lowest_mass: float
    lowest_stiffness: float
    rigid_modes: int
    moved_by_the_contact: float
    receptance_error: float | None = None
    findings: tuple[str, ...] = ()


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
    reduction: ReductionHealth | None = None
    verdict: tuple[str, ...] = ()
    wall_modes_left_out: tuple[str, ...] = ()
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
        *_reduction_rows(summary.reduction),
    ]
    return [(label, value) for label, value in labelled if value]


def _reduction_rows(health: ReductionHealth | None) -> list[tuple[str, str | None]]:
    if health is None:
        return []
    own = health.static_compliance_m_per_N - health.half_space_compliance_m_per_N
    return [
        ("reduced model", f"{health.kind}, {health.coordinates} coordinates"),
        ("static compliance of the structure", _number(own, "m/N")),
        ("static compliance with the contact", _number(health.static_compliance_m_per_N, "m/N")),
        ("mass captured along the chain", _number(health.effective_mass_captured, "%", 100)),
        ("modes that the contact moves", _number(health.moved_by_the_contact, "%", 100)),
        ("asymmetry of the matrices", _number(health.asymmetry)),
        ("error of the receptance", _number(health.receptance_error)),
    ]


def _number(value: Any, unit: str = "", scale: float = 1.0) -> str | None:
    return None if value is None else f"{scale * value:.4g} {unit}".rstrip()


def _joined(values, unit: str) -> str | None:
    return " / ".join(f"{value:.5g}" for value in values) + f" {unit}" if values else None
