"""What the page says in words and tables: labels, values and what they mean."""

from pathlib import Path
from typing import Any

import numpy as np

from workflows.report.numbers import grouped, si
from workflows.report.packing import unpacked
from workflows.report.provenance import flat
from workflows.report.rows import at_wall, budget, facts, reduction_rows, sensed
from workflows.report.summary import Summary
from workflows.scene import (
    DashpotWall,
    HalfSpaceWall,
    OneDofWall,
    RigidWall,
    RomWall,
    Scene,
)
from workflows.scene.quantities import entries
from workflows.scene.units import GAINS

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
    signals = data.get("signals", {}).get("plots", {})
    return {
        "has": _parts(data, plots),
        "signals": list(signals),
        "signal_words": {plot: _sensed(summary, curves) for plot, curves in signals.items()},
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
        "scene_groups": groups(rows),
        "defaults": [row for row in rows if row["kind"] == "default"],
    }


def _parts(data: dict[str, Any], plots: dict[str, Any]) -> dict[str, bool]:
    """Which parts of the page there is something for."""
    return {
        "chain": "chain" in data,
        "assembly": "assembly" in data,
        "motion": "chain" in data and ("assembly" not in data or "q" in data["assembly"]),
        "wall": "force" in plots,
        "wall_motion": "wall" in plots,
        "response": "response" in data,
    }


def _sensed(summary: Summary, curves: list[dict[str, Any]]) -> str:
    return " ".join(f"{one['name']}: {sensed(summary.sensors[one['name']])}." for one in curves)


def chain_words(scene: Scene) -> str:
    """The first sentence's beginning: what strikes what."""
    chain = scene.chain
    radius = np.unique(chain.radius)
    size = " to ".join(si(2 * R, "m") for R in (radius[0], radius[-1])[: len(radius)])
    row = f"{grouped(chain.count)} sphere{'s' if chain.count > 1 else ''} of {size} diameter"
    if scene.striker is None:
        return f"{row} start with velocities of their own{' and lean on' if scene.wall else ''}"
    speed, drop = si(scene.striker.velocity, "m/s"), scene.striker.drop
    leans = "" if scene.wall is None else ", and the last one leans on"
    falls = f"falls {si(drop, 'm')} and " if drop else ""
    return f"{row}: the first one {falls}strikes the row at {speed}{leans}"


def wall_words(scene: Scene, summary: Summary) -> str:
    """What the chain leans on, to the end of the sentence."""
    match scene.wall:
        case None:
            return "with nothing behind it."
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
    what = f"a {scene.struck_body}" if scene.bending else "an assembly"
    return (
        f"{what} of {si(mass, 'kg')} ({grouped(summary.dofs)} degrees of freedom, reduced to "
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
        drawn, n = data["assembly"]["points"]["shape"][0], data["assembly"]["n_nodes"]
        thinned = "" if drawn == n else f" Drawn with {grouped(drawn)} of {grouped(n)} outer nodes."
        return (
            "Surface of the assembly, displaced as X + s Σ q_k(t) φ_k(X) from its state at rest, "
            "coloured by displacement; spheres by velocity, red towards the wall. Assembly and "
            "spheres have factors of their own, without which nothing would be seen to move. Modes "
            f"are those that the reduced model holds; modes.vtu has all of them.{thinned}"
        )
    standing = STANDS_FOR.get(data.get("wall") or "", "The chain is free: there is no wall.")
    return f"Spheres are coloured by velocity, red towards the wall. {standing}"


def energies(plots: dict[str, Any]) -> list[tuple[str, float, float, float]]:
    """Of each part: energy at the end [J], its share of the striker's, the largest [J]."""
    curves = [(one["name"], unpacked(one["values"])) for one in plots.get("energy", [])]
    if not curves:
        return []
    start = float(curves[0][1][0]) or 1.0
    ends = [(name, float(E[-1]), float(E[np.abs(E).argmax()])) for name, E in curves]
    return [(name, last, last / start, most) for name, last, most in ends]


def scene_rows(scene: Scene, summary: Summary) -> list[dict[str, str]]:
    """Every value of the scene with its unit, where it comes from and the note beside it."""
    units = _units(scene)
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


def _units(scene: Scene) -> dict[str, str]:
    """Units by dotted key."""
    gains = {
        f"output.sensors.{i}.gain": GAINS[sensor.quantity].unit
        for i, sensor in enumerate(scene.output.sensors or (), start=1)
    }
    known = {entry.key: entry.quantity.kind.unit for entry in entries(scene)}
    return known | gains | {"gravity.inclination": "°"}


def groups(rows: list[dict[str, str]]) -> dict[str, list[dict[str, str]]]:
    """The rows that somebody wrote, by table in the scene's order."""
    found: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        if row["kind"] != "default":
            found.setdefault(row["table"], []).append(row)
    return found


def _shown(value: Any, unit: str) -> str:
    if isinstance(value, tuple | list):
        return ", ".join(_shown(one, unit) for one in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    if value == np.inf:
        return "rigid"
    if isinstance(value, int) and not unit:
        return grouped(value)
    return si(value, unit, 6).replace("^2", "²").replace("^3", "³").replace("^4", "⁴")


def _note(comment: str) -> str:
    """A comment of a scene without the unit that it starts with."""
    first, comma, rest = comment.partition(", ")
    is_unit = (
        comma
        and len(first) < 9
        and "(" not in first
        and not first.startswith(("thesis", "inferred", "assumed"))
    )
    return rest if is_unit else comment
