"""What the page says in words and tables: labels, values and what they mean."""

from pathlib import Path
from typing import Any

import numpy as np

from workflows.results.numbers import NONE, digits, grouped, percent, si
from workflows.results.packing import unpacked
from workflows.results.provenance import flat
from workflows.results.summary import ReductionHealth, Summary
from workflows.scene import (
    DashpotWall,
    HalfSpaceWall,
    OneDofWall,
    RigidWall,
    RomWall,
    Scene,
)
from workflows.scene.quantities import entries

STEPS = {"time step": "time", "reduction": "reduction", "mesh": "mesh"}
SECONDS = {  # whose stages stand behind which error
    "time step": ("impact", "wall", "compilation"),
    "reduction": ("reduction", "reduction-error", "full-response", "response", "modes", "contact"),
    "mesh": ("mesh", "model", "coarse-reduction", "mesh-error"),
}
STANDS_FOR = {
    "rigid": "The wall is rigid and has no shape: the slab stands for it.",
    "half-space": "The wall is a half-space without an end: the block stands for it, and does not "
    "move but under the contact itself.",
    "1dof": "The wall is one mass on a spring without a shape: slab and coil stand for them.",
    "dashpot": "The wall is a dashpot without a shape: slab and piston stand for it.",
    "rom": "The wall is a reduced model without a surface: slab and coil stand for it.",
}


def context(scene: Scene | None, summary: Summary, data: dict[str, Any]) -> dict[str, Any]:
    """Everything that the template shows beside summary, scene and data."""
    places = data.get("assembly", {}).get("of_mode", [])
    modes = [mode.model_dump() for mode in summary.modes]
    rows = scene_rows(scene, summary) if scene else []
    targets = [mode for mode in summary.modes if mode.target]
    plots = data.get("curves", {}).get("plots", {})
    return {
        "has": {
            "chain": "chain" in data,
            "assembly": "assembly" in data,
            "motion": "chain" in data and ("assembly" not in data or "q" in data["assembly"]),
            "wall": "force" in plots,
            "wall_motion": "wall" in plots,
            "response": "response" in data,
        },
        "facts": facts(summary),
        "targets": targets,
        "worst_target": max((abs(m.frequency_hz / m.target_hz - 1) for m in targets), default=0),
        "has_mac": any(mode.mac is not None for mode in summary.modes),
        "shown_modes": [
            {**mode, "row": i}
            for i, (mode, place) in enumerate(zip(modes, places, strict=False))
            if place >= 0
        ],
        "view_note": view_note(data),
        "chain_words": chain_words,
        "wall_words": wall_words,
        "waves_words": waves_words,
        "at_wall": at_wall(summary),
        "budget": budget(summary),
        "energies": energies(plots),
        "reduction_rows": reduction_rows(summary.reduction) if summary.reduction else [],
        "scene_rows": rows,
        "defaults": [row for row in rows if row["kind"] == "default"],
    }


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
    seconds = sum(stage.seconds for stage in summary.stages if not stage.cached)
    found.append(("computed in", f"{digits(seconds)} s" if seconds >= 0.01 else "kept results"))
    return [(label, value) for label, value in found if value not in (NONE, "")]


def _pair(one: float | None, two: float | None) -> str:
    return f"{digits(one)}, {si(two, 'm/s')}" if one and two else si(one, "m/s")


def chain_words(scene: Scene) -> str:
    """The first sentence's beginning: what strikes what."""
    chain = scene.chain
    radius = np.unique(chain.radius)
    size = " to ".join(si(2 * R, "m") for R in (radius[0], radius[-1])[: len(radius)])
    row = f"{grouped(chain.count)} sphere{'s' if chain.count > 1 else ''} of {size} diameter"
    if scene.striker is None:
        return f"{row} start with velocities of their own and lean on"
    speed = si(scene.striker.velocity, "m/s")
    return f"{row}: the first one strikes the row at {speed}, and the last one leans on"


def wall_words(scene: Scene, summary: Summary) -> str:
    """What the chain leans on, to the end of the sentence."""
    match scene.wall:
        case None:
            return "nothing: the chain is free."
        case RigidWall():
            return "a rigid wall."
        case HalfSpaceWall(young=E):
            return f"a half-space (E = {si(E, 'Pa')})."
        case OneDofWall(frequency=f, mass=m):
            return f"a mass of {si(m, 'kg')} on a spring ({si(f, 'Hz')})."
        case DashpotWall(plate_thickness=h) if h:
            return f"an infinite plate {si(h, 'm')} thick."
        case DashpotWall(coefficient=c):
            return f"a dashpot of {si(c, 'N s/m')}."
        case RomWall(file=file) if file:
            return f"a reduced model of {summary.n_wall_modes} modes ({Path(file).name})."
    mass = summary.reduction and summary.reduction.mass_kg
    return (
        f"an assembly of {si(mass, 'kg')} ({grouped(summary.dofs)} degrees of freedom, reduced to "
        f"{summary.n_wall_modes} modes)."
    )


def waves_words(summary: Summary) -> str:
    """The first wave at each observed sphere."""
    firsts = [(s, waves.arrivals[0]) for s, waves in summary.waves.items() if waves.arrivals]
    if not firsts:
        return "No wave passes the observed spheres."
    told = [
        f"sphere {sphere} at {si(wave.time_s, 's')} with {si(wave.peak_velocity_m_s, 'm/s')}"
        for sphere, wave in firsts
    ]
    return f"The first wave passes {', '.join(told)}."


def view_note(data: dict[str, Any]) -> str:
    """What is true of the view and what is drawn for the eye."""
    if "assembly" in data:
        return (
            "Surface of the assembly, displaced as X + s Σ q_k(t) φ_k(X) from its state at rest, "
            "coloured by displacement; spheres by velocity, red towards the wall. Assembly and "
            "spheres have factors of their own, without which nothing would be seen to move. Modes "
            "are those that the reduced model holds; modes.vtu has all of them."
        )
    standing = STANDS_FOR.get(data.get("wall") or "", "The chain is free: there is no wall.")
    return f"Spheres are coloured by velocity, red towards the wall. {standing}"


def at_wall(summary: Summary) -> list[tuple[str, str, str]]:
    """The collision in the measures of the literature: label, value, what it is."""
    c = summary.wall_contact
    if c is None:
        return []
    rows = [
        ("peak force", si(summary.peak_wall_force_N, "N"), "largest force of the last contact"),
        ("contact radius", si(summary.contact_radius_m, "m"), "of the Hertz contact at that force"),
        (
            "contact time",
            si(c.contact_time_s, "s"),
            f"while the force is above {si(c.threshold_N, 'N')}, 1 % of its peak above rest",
        ),
        (
            "dimensionless contact time τ_c",
            _digits(c.tau_c),
            "contact time over (m² / (V A_w²))^(1/5): mass of a sphere, speed of the striker, "
            "Hertz coefficient at the wall",
        ),
        ("wave speed, incident", si(c.speed_in_m_s, "m/s"), "mean along the chain"),
        ("wave speed, reflected", si(c.speed_back_m_s, "m/s"), "of the first reflected wave"),
        (
            "travelling time",
            si(c.travelling_time_s, "s"),
            "through all spheres and back at these two speeds",
        ),
        ("time of flight TOF", si(c.tof_s, "s"), "travelling time and contact time"),
        (
            "amplitude ratio ARR",
            percent(c.arr_2_9),
            "|reflected / incident velocity|^(6/5), mean along the chain: the ratio of the forces",
        ),
        (
            "energy restitution",
            percent(c.energy_restitution),
            "square root of kinetic energy at the end over that at the start",
        ),
        (
            "velocity sum ratio",
            percent(c.velocity_sum_ratio_2_8),
            "sum of sphere speeds, end over start; no measure of loss: elastic spheres reach 136 %",
        ),
    ]
    return [row for row in rows if row[1] != NONE]


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
        rows.append(("pictures and waves", "", digits(rest)))
    return rows


def energies(plots: dict[str, Any]) -> list[tuple[str, float, float, float]]:
    """Of each part: energy at the end [J], its share of the striker's, the largest [J]."""
    curves = [(one["name"], unpacked(one["values"])) for one in plots.get("energy", [])]
    if not curves:
        return []
    start = float(curves[0][1][0]) or 1.0
    ends = [(name, float(E[-1]), float(E[np.abs(E).argmax()])) for name, E in curves]
    return [(name, last, last / start, most) for name, last, most in ends]


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


def scene_rows(scene: Scene, summary: Summary) -> list[dict[str, str]]:
    """Every value of the scene with its unit, where it comes from and the note beside it."""
    units = {entry.key: entry.quantity.kind.unit for entry in entries(scene)}
    found = []
    for full, value in flat(scene.model_dump(exclude_none=True)).items():
        if full in ("name", "unusual"):
            continue
        table, _, key = full.partition(".")
        source = summary.sources.get(full)
        found.append(
            {
                "table": table,
                "key": key or table,
                "full": full,
                "value": _shown(value, units.get(full, "")),
                "kind": source.kind if source else "",
                "note": _note(source.note if source else ""),
            }
        )
    return found


def _shown(value: Any, unit: str) -> str:
    if isinstance(value, tuple | list):
        return ", ".join(_shown(one, unit) for one in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    if value == np.inf:
        return "rigid"
    return grouped(value) if isinstance(value, int) and not unit else si(value, unit, 6)


def _note(comment: str) -> str:
    """A comment of a scene without the unit that it starts with."""
    first, comma, rest = comment.partition(", ")
    is_unit = comma and len(first) < 9 and not first.startswith(("thesis", "inferred", "assumed"))
    return rest if is_unit else comment
