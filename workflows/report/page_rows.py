"""Tables and notes of the page below its first screen, and all that its template reads."""

from typing import Any

import numpy as np

from beadwave.workflows.report.first_screen import (
    chain_words,
    chains_words,
    crystal_words,
    facts,
    wall_words,
    waves_words,
)
from beadwave.workflows.report.number_format import GLUE, NONE, digits, grouped, percent, si
from beadwave.workflows.report.packing import unpacked
from beadwave.workflows.report.provenance import flat
from beadwave.workflows.report.summary import Summary
from beadwave.workflows.report.summary_rows import (
    ERROR_OF,
    LARGE,
    at_wall,
    budget,
    error_words,
    reduction_rows,
    sensed,
    spelled,
    spheres_words,
)
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.quantities import entries
from beadwave.workflows.scene.units import GAINS

# what the view draws for a wall without a shape, by wall.kind; see page/wall.js
STANDS_FOR = {
    None: "The chain is free: there is no wall.",
    "rigid": "The wall is rigid and has no shape: the slab stands for it.",
    "half-space": "The wall is a half-space without an end: the block stands for it, and does not "
    "move but under the contact itself.",
    "1dof": "The wall is one mass on a spring without a shape: slab and coil stand for them.",
    "dashpot": "The wall is a dashpot without a shape: slab and piston stand for it.",
    "measured": "The wall is known by its response alone: slab and coil stand for it.",
    "rom": "The wall is a reduced model without a surface: slab and coil stand for it.",
}


def velocity_errors(summary: Summary) -> list[tuple[float | None, str]]:
    """Errors of the velocities, relative to the striker's, with their causes; None of a time step
    whose error is unknown, others only where they are known."""
    errors = summary.error_estimate
    model = [
        (errors.reduction, "the reduction"), (errors.mesh, "the mesh"),
        (errors.theory, "the theory of bending"), (errors.receptance, "the measured receptances"),
    ]  # fmt: skip
    return [(errors.time, "the time step"), *((x, cause) for x, cause in model if x is not None)]


def context(scene: Scene | None, summary: Summary, data: dict[str, Any]) -> dict[str, Any]:
    """Variables of the page's template besides summary, scene and data."""
    plots = data.get("curves", {}).get("plots", {})
    signals = data.get("signals", {}).get("plots", {})
    signal_words = {
        plot: " ".join(f"{c['name']}: {sensed(summary.sensors[c['name']])}." for c in curves)
        for plot, curves in signals.items()
    }
    targets = [mode for mode in summary.modes if mode.target]

    # modes that the view can move, and their row among its shapes
    places = data.get("assembly", {}).get("of_mode", [])
    shown_modes = [
        {**mode.model_dump(), "row": row}
        for row, (mode, place) in enumerate(zip(summary.modes, places, strict=False))
        if place >= 0
    ]

    # values that the user wrote, by table in the scene's order, and values by default
    rows = scene_rows(scene, summary) if scene else []
    groups: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        if row["kind"] != "default":
            groups.setdefault(row["table"], []).append(row)

    return {
        # what the page has something for
        "has": {
            "chain": "chain" in data,
            "assembly": "assembly" in data,
            "crystal": "crystal" in data,
            "motion": "crystal" in data
            or ("chain" in data and ("assembly" not in data or "q" in data["assembly"])),
            "wall": "force" in plots,
            "wall_motion": "wall" in plots,
            "friction": "friction" in data,
            "response": "response" in data,
        },
        # the first screen
        "chain_words": chain_words,
        "chains_words": chains_words,
        "wall_words": wall_words,
        "crystal_words": crystal_words,
        "waves_words": waves_words,
        "facts": facts(summary),
        "velocity_errors": velocity_errors(summary),
        "at_rest": bool(
            scene and scene.chain and scene.striker is None and scene.chain.initial_velocity is None
        ),
        "spheres_words": spheres_words,
        # the view and the plots
        "view_note": view_note(data),
        "signals": list(signals),
        "signal_words": signal_words,
        "energies": energies(plots),
        # frequencies
        "targets": targets,
        "worst_target": max((abs(m.frequency_hz / m.target_hz - 1) for m in targets), default=0),
        "has_mac": any(mode.mac is not None for mode in summary.modes),
        "shown_modes": shown_modes,
        # errors, next to their numbers and by cause
        "relative_error": summary.relative_error,
        "error_of": ERROR_OF,
        "large_error": LARGE,
        "error_words": error_words,
        "has_mode_errors": any(summary.relative_error(f"mode {m.number}") for m in summary.modes),
        "has_wave_errors": any(error.name.endswith(": time_s") for error in summary.errors),
        "error_causes": error_causes(summary),
        # the other tables
        "at_wall": at_wall(summary),
        "budget": budget(summary),
        "reduction_rows": reduction_rows(summary.reduction) if summary.reduction else [],
        "scene_groups": groups,
        "defaults": [row for row in rows if row["kind"] == "default"],
    }


def error_causes(summary: Summary) -> tuple[list[str], list[tuple[str, str, list[str]]]]:
    """Causes of errors that some number has, and of each number with several its name, its value
    and its errors by cause, relative."""
    causes = [
        cause
        for cause in ("time", "reduction", "mesh", "theory")
        if any(getattr(error, cause) is not None for error in summary.errors)
    ]
    rows = []
    for error in summary.errors:
        by_cause = [getattr(error, cause) for cause in causes]
        if not error.value or sum(x is not None for x in by_cause) < 2:
            continue
        shares = [NONE if x is None else percent(x / abs(error.value), 2) for x in by_cause]
        value = percent(error.value) if error.name == "arr_2_9" else si(error.value, error.unit, 4)
        rows.append((spelled(error.name), value.removesuffix(f"{GLUE}1"), shares))
    return causes, rows


def view_note(data: dict[str, Any]) -> str:
    """A note on the 3-D view: what is to scale, and what is exaggerated."""
    if "assembly" in data:
        n_points, n = data["assembly"]["points"]["shape"][0], data["assembly"]["n_nodes"]
        thinned = f" Drawn with {grouped(n_points)} of {grouped(n)} outer nodes."
        return (
            "Surface of the structure, displaced as X + s Σ qₖ(t) φₖ(X) from its state at rest, "
            "coloured by displacement; spheres by velocity, red towards the wall. Structure and "
            "spheres have factors of their own, without which nothing would be seen to move. Modes "
            "are those that the reduced model holds; modes.vtu has all of them."
            f"{'' if n_points == n else thinned}"
        )
    if "crystal" in data:
        crystal = data["crystal"]
        shown, n = crystal["v"]["shape"], crystal["n_spheres"]
        kept = f"{grouped(shown[0])} of {grouped(crystal['n_instants'])} instants"
        if shown[1] < n:
            kept += f" of {grouped(shown[1])} of {grouped(n)} spheres"
        return (
            "Spheres are coloured by speed; their displacements have a factor, without which "
            "nothing would be seen to move. Both are cut where the fastest 2 % of the spheres go "
            f"farther. The view holds {kept}; trajectory.npz holds all that was saved."
        )
    standing = STANDS_FOR[data.get("wall")]
    return f"Spheres are coloured by velocity, red towards the wall. {standing}"


def energies(plots: dict[str, Any]) -> list[tuple[str, float, float, float]]:
    """For each term of the ledger its name, energy at the end [J], share of the striker's energy,
    and largest value [J]."""
    curves = [(curve["name"], unpacked(curve["values"])) for curve in plots.get("energy", [])]
    if not curves:
        return []
    start = float(curves[0][1][0]) or 1.0
    rows = []
    for name, E in curves:
        last, largest = float(E[-1]), float(E[np.abs(E).argmax()])
        rows.append((name, last, last / start, largest))
    return rows


def scene_rows(scene: Scene, summary: Summary) -> list[dict[str, str]]:
    """Every value of the scene with its unit, where it comes from and its note."""
    # units by dotted key; the gain of a sensor goes with what it reads
    units = {entry.key: entry.quantity.kind.unit for entry in entries(scene.written)}
    units |= {
        f"output.sensors.{i}.gain": GAINS[sensor.quantity].unit
        for i, sensor in enumerate((scene.output and scene.output.sensors) or (), start=1)
    }
    units["gravity.inclination"] = "°"

    # a row for each value, its source and note from the comment in the scene's text
    rows = []
    for full, value in flat(scene.model_dump(exclude_none=True)).items():
        if full in ("name", "unusual"):
            continue
        table, _, key = full.partition(".")
        source = summary.sources.get(full)

        # a comment of a scene without the unit that it starts with
        note = source.note if source else ""
        first, comma, after_unit = note.partition(", ")
        is_mark = first.startswith(("thesis", "inferred", "assumed"))
        if comma and len(first) < 9 and "(" not in first and not is_mark:
            note = after_unit
        if source:  # its mark says that already
            note = note.removeprefix(f"{source.kind}: ").removeprefix(f"{source.kind}, ")
        rows.append(
            {
                "table": table,
                "key": key or table,
                "full": full,
                "value": _value_words(value, units.get(full, "")),
                "kind": source.kind if source else "",
                "note": note,
            }
        )
    return rows


def _numbers(value: Any) -> list[float]:
    """The numbers of a list at any depth; nan for what is none."""
    if isinstance(value, tuple | list):
        return [number for item in value for number in _numbers(item)]
    return [float(value) if isinstance(value, int | float) else np.nan]


def _listed(values: Any, factor: float) -> str:
    """Numbers times a factor between commas, those of lists in a list in brackets."""
    return ", ".join(
        f"({_listed(item, factor)})" if isinstance(item, tuple | list) else digits(factor * item, 6)
        for item in values
    )


def _value_words(value: Any, unit: str) -> str:
    """A value of a scene with its unit: numbers of a list between commas, points in brackets, with
    the one unit of the largest."""
    if isinstance(value, tuple | list):
        numbers = np.array(_numbers(value))
        if unit and numbers.size > 1 and np.all(np.isfinite(numbers)) and numbers.any():
            largest = float(np.abs(numbers).max())
            digits_of_largest, prefixed = _value_words(largest, unit).split(GLUE)
            factor = float(digits_of_largest.replace("\u202f", "")) / largest
            return f"{_listed(value, factor)}{GLUE}{prefixed}"
        return ", ".join(_value_words(item, unit) for item in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    if value == np.inf:
        return "rigid"
    if isinstance(value, int) and not unit:
        return grouped(value)
    return si(value, unit, 6).replace("^2", "²").replace("^3", "³").replace("^4", "⁴")
