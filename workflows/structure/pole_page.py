"""A page with the stability diagram of a hammer test (`beadwave hammer --out`): a click takes or
leaves out a pole, and the page shows the command that computes the modes so."""

from collections.abc import Sequence
from pathlib import Path
from shlex import join
from typing import Any

import numpy as np
from markupsafe import Markup

from beadwave.fem.identification.poly_reference import IdentifiedModes
from beadwave.workflows.files.hammer import Reading
from beadwave.workflows.report.report import harmless_json, in_one_file
from beadwave.workflows.structure.hammer import Choice, IdentifiedTest, shown_lines, summed_response


def pole_page(test: IdentifiedTest, choice: Choice, command: str, structure: str) -> str:
    """HTML; `command` is the one that repeats the test, without its --reject and --accept;
    `structure` is the scene whose modes the test is compared with, "" for none."""
    report, modes = test.report, test.modes
    # 4000 lines of the response on the page: what a screen can show, peaks kept
    frequency, response = at_most(*summed_response(test.test.responses, shown_lines(test)), 4000)
    chosen = [
        {"number": row.number, "hz": row.frequency_hz, "zeta": row.zeta, "taken": True,
         "found": row.number not in choice.accept, "why": "; ".join(row.remarks)}
        for row in report.rows
    ]  # fmt: skip
    left_out = [
        {"number": row.number, "hz": row.frequency_hz, "zeta": row.zeta, "taken": False,
         "found": row.number in choice.reject, "why": row.reason}
        for row in report.left_out
    ]  # fmt: skip
    poles = sorted([*chosen, *left_out], key=lambda pole: pole["hz"])
    data = {
        "frequency": frequency.tolist(), "response": response.tolist(),
        "orders": diagram_rows(modes, np.array([pole["hz"] for pole in poles])),
        "poles": poles, "command": command,
        "reject": list(choice.reject), "accept": list(choice.accept),
    }  # fmt: skip
    return in_one_file(
        "poles", scripts=["vendor/uplot.min.js"], module="poles",
        styles=["vendor/uplot.min.css", "style.css", "poles.css"],
        files=report.file_names, structure=structure,
        banner=test.banner, poles=poles, data=Markup(harmless_json(data)),
    )  # fmt: skip


def command_of(
    paths: Sequence[Path], scene: object, changes: object, reading: Reading, choice: Choice,
    out: Path,
) -> str:  # fmt: skip
    """The command line that repeats a test, without its --reject and --accept; a scene that is no
    file or name, and changes that are no texts, are left to the caller."""
    words = ["beadwave", "hammer", *map(str, paths)]
    if isinstance(scene, str | Path):
        words += ["--scene", str(scene)]
    if isinstance(changes, Sequence) and not isinstance(changes, str):
        words += [word for change in changes for word in ("--set", str(change))]
    usual = Reading()
    for option, value, default in (
        ("--points", reading.points, usual.points),
        ("--estimator", reading.estimator, usual.estimator),
        ("--window", reading.decay, usual.decay),
        ("--force-channel", reading.force_channel, usual.force_channel),
    ):
        if value != default:
            words += [option, str(value)]
    if choice.band_hz is not None:
        words += ["--band", "{:g}:{:g}".format(*choice.band_hz)]
    return join([*words, "--out", str(out)])


def diagram_rows(
    modes: IdentifiedModes, numbered: np.ndarray, near: float = 0.005
) -> list[list[Any]]:
    """Of each order its poles [Hz], and of each 1 where it is within the share `near` of one of the
    `numbered` (n,) [Hz]."""
    rows = []
    for order, poles in modes.diagram:
        hz = np.abs(poles) / (2 * np.pi)
        recurs = np.abs(np.divide.outer(hz, numbered) - 1).min(axis=1, initial=np.inf) < near
        rows.append([int(order), hz.round(3).tolist(), recurs.astype(int).tolist()])
    return rows


def at_most(x: np.ndarray, y: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """At most n points of a curve (k,), of each stretch the highest."""
    size = -(-len(x) // n)
    first = np.arange(0, len(x), size)
    highest = [a + int(np.argmax(y[a : a + size])) for a in first]
    return x[highest], y[highest]
