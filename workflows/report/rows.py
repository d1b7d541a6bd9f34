"""A summary's numbers as a person reads them: label, value with unit, what it is."""

from collections.abc import Iterator

from workflows.report.numbers import GLUE, NONE, digits, grouped, percent, si
from workflows.report.summary import (
    ChainContact,
    ReductionHealth,
    SensorWaves,
    SphereWaves,
    Summary,
)

STEPS = {"time step": "time", "reduction": "reduction", "mesh": "mesh"}
SECONDS = {  # whose stages stand behind which error
    "time step": ("impact", "wall", "compilation"),
    "reduction": ("reduction", "reduction-error", "full-response", "response", "modes", "contact"),
    "mesh": ("mesh", "model", "second-mesh", "mesh-error"),
}


def headline(summary: Summary) -> list[tuple[str, str]]:
    """What matters first: frequencies, arrivals, TOF, ARR, errors, seconds."""
    contact, hz = summary.wall_contact, list(summary.modes_hz.values())
    found = [("scene", summary.scene)]
    if hz:
        found.append(("measured modes, computed", f"{' / '.join(digits(f, 4) for f in hz)} Hz"))
    if summary.load_factor is not None:
        found.append(("load over buckling load", percent(summary.load_factor)))
    found += [(f"waves at sphere {s}", arrivals(waves)) for s, waves in summary.waves.items()]
    found += [(name, sensed(one)) for name, one in summary.sensors.items()]
    if contact:
        found += [
            ("time of flight TOF", si(contact.tof_s, "s")),
            ("amplitude ratio ARR", percent(contact.arr_2_9)),
            ("peak force at the wall", si(summary.peak_wall_force_N, "N")),
        ]
    found.append(("errors", _errors(summary)))
    found.append(("seconds", _seconds(summary)))
    return [(label, value) for label, value in found if value not in ("", NONE)]


def arrivals(waves: SphereWaves) -> str:
    """The waves that pass a sphere."""
    told = [
        f"{wave.name or 'unnamed'} {si(wave.time_s, 's')} ({si(wave.peak_velocity_m_s, 'm/s')})"
        for wave in waves.arrivals
    ]
    return ", ".join(one.replace(" ", GLUE) for one in told) or "none"


def sensed(signal: SensorWaves) -> str:
    """A sensor's signal in a line."""
    told = [f"up to {si(signal.largest, signal.unit)}"]
    if signal.tof_s is not None:
        told += [f"TOF {si(signal.tof_s, 's')}", f"ARR {percent(signal.arr)}"]
    return ", ".join(one.replace(" ", GLUE) for one in told)


def _errors(summary: Summary) -> str:
    estimates = {label: getattr(summary.error_estimate, name) for label, name in STEPS.items()}
    told = [
        f"{label} {percent(value, 2)}" for label, value in estimates.items() if value is not None
    ]
    if summary.energy_error is not None:
        told.append(f"energy balance {percent(summary.energy_error, 2)}")
    return ", ".join(one.replace(" ", GLUE) for one in told)


def _seconds(summary: Summary) -> str:
    spent = {stage.name: stage.seconds for stage in summary.stages if not stage.cached}
    longest = sorted(spent, key=spent.get, reverse=True)[:3]
    if sum(spent.values()) < 0.01:
        return "kept results"
    told = ", ".join(f"{name} {digits(spent[name])}" for name in longest if spent[name] >= 0.05)
    return f"{digits(_whole(summary))}{f' ({told})' if told else ''}"


def _whole(summary: Summary) -> float:
    """Seconds of a run; of a folder that an earlier version wrote, the sum of its stages."""
    computed = sum(stage.seconds for stage in summary.stages if not stage.cached)
    return computed if summary.seconds is None or computed < 0.01 else summary.seconds


def details(summary: Summary) -> list[tuple[str, str]]:
    """All that the headline leaves out."""
    run = [
        ("degrees of freedom", grouped(summary.dofs) if summary.dofs else ""),
        ("wall modes", str(summary.n_wall_modes) if summary.n_steps else ""),
        ("time step", si(summary.dt_s, "s")),
        ("steps", grouped(summary.n_steps) if summary.n_steps else ""),
    ]
    wall = [(label, value) for label, value, _ in at_wall(summary)]
    model = reduction_rows(summary.reduction) if summary.reduction else []
    told = {label for label, _ in headline(summary)} | {"", NONE}
    return [row for row in (*run, *wall, *model) if not told & set(row)]


def facts(summary: Summary) -> list[tuple[str, str]]:
    """The few numbers beside the answer."""
    contact, found = summary.wall_contact, []
    if contact:
        found += [
            ("time of flight TOF", si(contact.tof_s, "s")),
            ("amplitude ratio ARR", percent(contact.arr_2_9)),
            ("wave speed in, back", _pair(contact.speed_in_m_s, contact.speed_back_m_s)),
            ("peak force at the wall", si(summary.peak_wall_force_N, "N")),
        ]
    hz = list(summary.modes_hz.values())
    if hz:
        found.append(("measured modes, computed", f"{' / '.join(digits(f, 4) for f in hz)} Hz"))
    seconds = _whole(summary)
    spent = f"{digits(seconds)} s" if seconds >= 0.01 else "none, results were kept"
    found.append(("computing time", spent))
    return [(label, value) for label, value in found if value not in (NONE, "")]


def _pair(one: float | None, two: float | None) -> str:
    return f"{digits(one)}, {si(two, 'm/s')}" if one and two else si(one, "m/s")


def at_wall(summary: Summary) -> list[tuple[str, str, str]]:
    """The collision in the measures of the literature: label, value, what it is."""
    c = summary.wall_contact
    if c is None:
        return []
    rows = [
        ("peak force at the wall", si(summary.peak_wall_force_N, "N"), "of the last contact"),
        ("contact radius", si(summary.contact_radius_m, "m"), "of the Hertz contact at that force"),
        *_contact_time(c),
        *_waves_back(c),
        *_balances(c),
    ]
    return [row for row in rows if row[1] != NONE]


def _contact_time(c: ChainContact) -> Iterator[tuple[str, str, str]]:
    above = f"while the force is above {si(c.threshold_N, 'N')}, 1 % of its peak above rest"
    yield "contact time", si(c.contact_time_s, "s"), above
    yield (
        "dimensionless contact time τ_c",
        _digits(c.tau_c),
        "contact time over (m² / (V A_w²))^(1/5): mass of the last sphere, speed of the striker, "
        "Hertz coefficient at the wall",
    )


def _waves_back(c: ChainContact) -> Iterator[tuple[str, str, str]]:
    yield "wave speed, incident", si(c.speed_in_m_s, "m/s"), "mean along the chain"
    yield "wave speed, reflected", si(c.speed_back_m_s, "m/s"), "of the first reflected wave"
    both = "through all spheres and back at these two speeds"
    yield "travelling time", si(c.travelling_time_s, "s"), both
    yield "time of flight TOF", si(c.tof_s, "s"), "travelling time and contact time"
    forces = "|reflected / incident velocity|^(6/5), mean along the chain: the ratio of the forces"
    yield "amplitude ratio ARR", percent(c.arr_2_9), forces


def _balances(c: ChainContact) -> Iterator[tuple[str, str, str]]:
    root = "square root of kinetic energy at the end over that at the start"
    yield "energy restitution", percent(c.energy_restitution), root
    total = (
        "sum of sphere speeds, end over start; no measure of loss: elastic spheres at a rigid "
        "wall reach 136 %"
    )
    yield "velocity sum ratio", percent(c.velocity_sum_ratio_2_8), total


def _digits(value: float | None) -> str:
    return NONE if value is None else digits(value)


def budget(summary: Summary) -> list[tuple[str, str, str]]:
    """Each error beside the seconds of the stages that it pays for."""
    spent = {stage.name: stage.seconds for stage in summary.stages if not stage.cached}
    rows, told = [], set()
    for label, name in STEPS.items():
        error = getattr(summary.error_estimate, name)
        own = [stage for stage in SECONDS[label] if stage in spent]
        told |= set(own)
        seconds = digits(sum(spent[stage] for stage in own)) if own else ""
        if error is not None or own:
            rows.append((label, percent(error, 2), seconds))
    if summary.energy_error is not None:
        rows.append(("energy balance", percent(summary.energy_error, 2), ""))
    rest = sum(seconds for name, seconds in spent.items() if name not in told)
    if rest:
        rows.append(("everything else", "", digits(rest)))
    return rows


def reduction_rows(health: ReductionHealth) -> list[tuple[str, str]]:
    """The reduced model in numbers."""
    own = health.static_compliance_m_per_N - health.half_space_compliance_m_per_N
    rows = [
        ("kind", f"{health.kind}, {health.coordinates} coordinates"),
        ("static compliance of the structure", si(own, "m/N")),
        ("with the half-space under the patch", si(health.static_compliance_m_per_N, "m/N")),
        ("mass", si(health.mass_kg, "kg", 4)),
        ("centre of mass x, y, z", ", ".join(si(x, "m") for x in health.centre_m)),
        (
            "lowest fixed-interface frequencies",
            ", ".join(si(f, "Hz", 4) for f in health.fixed_interface_hz),
        ),
        ("effective mass along the chain", percent(health.effective_mass_captured)),
        ("share of modes excited at the contact", percent(health.moved_by_the_contact)),
        ("rigid-body residual forces", percent(health.grounding, 2)),
        ("matrix asymmetry", percent(health.asymmetry, 2)),
        ("receptance error (rms)", _receptance(health)),
    ]
    return [(label, value) for label, value in rows if value not in (NONE, "")]


def _receptance(health: ReductionHealth) -> str:
    stated = percent(health.receptance_error, 2)
    loss = health.receptance_loss_factor
    return f"{stated} at a loss factor of {percent(loss)}" if loss else stated
