"""The modes of a scene and of the hammer test: as a table, and their MAC matrix as a picture."""

import numpy as np
from pydantic import BaseModel

from beadwave.fem.modes.mac import RIGID, strained
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.summary import ContactRow, MeshNumbers
from beadwave.workflows.report.summary_rows import mesh_words
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene.required_parts import with_mac
from beadwave.workflows.stages import warnings
from beadwave.workflows.stages.engine.pipeline import Pipeline
from beadwave.workflows.stages.engine.stage_table import has_bolts, has_sizes_chosen, in_contact
from beadwave.workflows.stages.structure.contact_zone import contacts_text
from beadwave.workflows.stages.structure.health import shape_names
from beadwave.workflows.structure.amplitude_table import (
    AmplitudeRow,
    amplitude_rows,
    amplitudes_text,
    slip_sentences,
)
from beadwave.workflows.structure.joint_table import JointRow, joint_rows, joints_text

READING = """\
mesh error: by which the elements make the frequency too high;
at contact: participation [kg^-1/2];  score: share of the mode's energy in the motion that
identifies the measured mode;  MAC: with that mode of stiff joints"""
BOUNDS = ("±", "no friction", "tied")
READING_BOUNDS = """\
±: standard deviation by the spreads of the joints;  no friction: as the faces under bolts slide and
the bolts alone carry the shear;  tied: as these faces are tied all over"""
LOADED = "The static load is {:.4g} % of the load that buckles it."
NO_TARGETS = "No targets: [[targets]] lists measured modes to compare with these."


class ModeRow(BaseModel):
    """One computed mode; `hammer_mode` where it is paired with one of the test.

    `score` is the share of its energy in the motion that tells the measured mode, `mac` that with
    the mode of stiff joints, `shape` what the measured mode looks like in words.
    """

    number: int
    frequency_hz: float
    participation: float | None
    # of the mesh, by which the frequency is too high; of a beam or a plate of mesh and theory
    error_percent: float | None = None
    part_error_percent: float | None = None  # by the fits of measured parts
    why: str = ""  # where an error above 5 % comes from, and what helps
    place: str = ""  # where it comes from, alone
    hammer_mode: int | None = None
    hammer_hz: float | None = None
    difference_percent: float | None = None
    score: float | None = None
    mac: float | None = None
    shape: str | None = None
    tied_hz: float | None = None  # with the faces under bolts of a drawing tied all over
    frictionless_hz: float | None = None  # without friction there
    deviation_hz: float | None = None  # by the spreads of the joints


class ModeTable(BaseModel):
    """All computed modes with their participation at the contact [kg^-1/2]."""

    scene: str
    rows: list[ModeRow]
    error_of: str = "mesh error"
    load_factor: float | None = None  # static load over that which buckles the structure
    joints: list[JointRow] = []  # those that are known from their drawing
    contact: list[ContactRow] = []  # faces that bolts press, of model = "contact"
    amplitude: list[AmplitudeRow] | None = None  # of --amplitude
    mesh: MeshNumbers | None = None  # of mesh.error
    warnings: list[str] = []

    def text(self) -> str:
        """The table as text, with how to read its columns."""
        cells = []
        bounded = self.joints or self.contact
        has_parts = any(row.part_error_percent is not None for row in self.rows)
        for row in self.rows:
            at_contact = None if row.participation is None else f"{row.participation:.4f}"
            error = None if row.error_percent is None else f"{row.error_percent:.2g} %"
            of_parts = row.part_error_percent
            parts = () if not has_parts else (None if of_parts is None else f"{of_parts:.2g} %",)
            limits = (row.deviation_hz, row.frictionless_hz, row.tied_hz) if bounded else ()
            bounds = (None if hz is None else f"{hz:.4g}" for hz in limits)
            hz = f"{row.frequency_hz:.2f}"
            computed = (row.number, hz, *bounds, error, *parts, at_contact)
            if row.hammer_mode is None:
                cells.append((*computed, "", "", ""))
                continue
            off = round(row.difference_percent, 1) + 0.0  # no minus zero
            measured = f"{row.hammer_mode}: {row.hammer_hz:.5g} Hz ({off:+.1f} %)"
            mac = None if row.mac is None else f"{row.mac:.2f}"
            cells.append((*computed, measured, f"{row.score:.2f}", mac))
        bounds = BOUNDS if bounded else ()
        parts = ("of parts",) if has_parts else ()
        head = "mode", "Hz", *bounds, self.error_of, *parts, "at contact", "measured", "score"
        table = aligned_text((*head, "MAC"), cells)
        legend = READING if any(row.hammer_mode for row in self.rows) else NO_TARGETS
        load = LOADED.format(100 * self.load_factor) if self.load_factor is not None else ""
        if self.mesh:
            load = "\n".join(filter(None, (load, f"Meshes: {mesh_words(self.mesh)}.")))
        shapes = ", ".join(f"{r.hammer_mode}: {r.shape}" for r in self.rows if r.shape)
        # of the modes whose errors arise at one place the worst has the sentence
        at_place: dict[str, list[ModeRow]] = {}
        for row in self.rows:
            if row.why:
                at_place.setdefault(row.place, []).append(row)
        whys = []
        for rows in at_place.values():
            worst = max(rows, key=lambda row: row.error_percent)
            others = ", ".join(str(row.number) for row in rows if row is not worst)
            ones = "errors of modes" if len(rows) > 2 else "error of mode"
            arise = "arise" if len(rows) > 2 else "arises"
            there_too = f" The smaller {ones} {others} {arise} there too." if others else ""
            whys.append(f"Mode {worst.number}: {worst.why}{there_too}")
        joints = f"{READING_BOUNDS}\n" if bounded else ""
        joints += f"\n{joints_text(self.joints)}\n" if self.joints else ""
        contact = f"{contacts_text(self.contact)}\n" if self.contact else ""
        amplitude = f"{amplitudes_text(self.amplitude)}\n" if self.amplitude else ""
        tables = (joints, contact, amplitude)
        sentences = filter(None, (shapes, legend, *tables, load, *self.warnings, *whys))
        return "\n".join([table, "", *sentences])


def mode_table(pipeline: Pipeline, *, amplitude: bool = False) -> ModeTable:
    """Computed modes, each with the measured one that it is paired with, and with `amplitude` what
    faces in contact do to frequency and loss.

    Errors of frequencies are those of the mesh of bodies, of mesh and theory of a beam or a plate,
    and besides of the fits of measured parts.
    """
    scene, modes, mac = pipeline.scene, pipeline("modes"), pipeline("mac")
    shape = shape_names(scene)
    struck = scene.bending is not None or scene.strike is not None
    participation = np.abs(pipeline("contact").w @ modes.phi) if struck else [None] * len(mac)
    measured = {int(j): i for i, j in enumerate(modes.index) if j >= 0}

    # relative errors (k,), and why large ones are, of bodies by where the mesh misses energy
    if scene.bending is None:
        missed = pipeline("missed-energy")
        error, whys = missed.of_frequencies(modes.omega), missed.explained(scene, modes.omega)
        causes = missed.causes if any(whys) else ()
        places = [causes[k].place if causes else "" for k in missed.shapes_of(modes.omega)]
    else:
        errors = {e.name: e.relative for e in pipeline("structure-errors")}
        error = [errors.get(f"mode {i + 1}", np.nan) for i in range(len(modes.omega))]
        whys = places = [""] * len(error)
    of_parts = pipeline("part-errors") if scene.measured else None
    rows = []
    for j, hz in enumerate(modes.omega / (2 * np.pi)):
        row = ModeRow(number=j + 1, frequency_hz=hz, participation=participation[j])
        row.error_percent = None if np.isnan(error[j]) else 100 * float(error[j])
        if of_parts is not None and np.isfinite(of_parts[j]):
            row.part_error_percent = 100 * float(of_parts[j])
        row.why, row.place = whys[j], places[j] if whys[j] else ""
        if j in measured:
            i = measured[j]
            row.hammer_mode, row.hammer_hz = scene.measured_numbers[i], scene.measured_hz[i]
            row.difference_percent = 100 * (hz / scene.measured_hz[i] - 1)
            row.score = float(modes.score[i])
            row.mac = None if np.isnan(mac[j][i]) else float(mac[j][i])
            row.shape = shape[i]
        rows.append(row)
    joints, contact = [], []
    if scene.bending is None and has_bolts(scene):
        joints, bounds = joint_rows(pipeline("mesh").bolted), pipeline("joint-bounds")
        for key, values in bounds._asdict().items():
            for row, hz, omega in zip(rows, values.tolist(), modes.omega, strict=True):
                # rounding alone gives a rigid motion a frequency
                if omega > RIGID * modes.omega.max():
                    setattr(row, key, hz)
        if in_contact(scene):
            contact = pipeline("contact-numbers")
    sentences, at_amplitudes = list(warnings.overconstrained(modes.overconstrained)), None
    if amplitude:
        of_mode = pipeline("backbones")
        at_amplitudes = amplitude_rows(of_mode)
        sentences += slip_sentences(pipeline("model").contact, of_mode)
    sentences += warnings.overloaded_bolts(scene.utilisations)
    if scene.bending is None and (scene.floats or scene.springs):
        rigid = np.flatnonzero(~strained(pipeline("model"), modes)) + 1
        sentences += warnings.rigid_motions(rigid.tolist())
    elif scene.bending is None and (modes.omega < RIGID * modes.omega.max()).any():
        unheld = np.flatnonzero(~strained(pipeline("model"), modes)) + 1
        sentences += warnings.unheld_motions(unheld.tolist())
    of_shape = zip(scene.measured_numbers, scene.targets or (), strict=True)
    by_shape = [number for number, target in of_shape if target.shape]
    sentences += warnings.distant_pairs(
        {
            row.hammer_mode: (row.hammer_hz, row.frequency_hz)
            for row in rows
            if row.hammer_mode in by_shape
        }
    )
    if scene.measured:
        from beadwave.workflows.stages.structure import measured_parts

        sentences += measured_parts.sentences(scene)
        sentences += warnings.doubtful_parts(
            {row.number: 0.01 * (row.part_error_percent or 0.0) for row in rows}
        )
    mesh = pipeline("mesh-numbers") if has_sizes_chosen(scene) else None
    if mesh:
        sentences += warnings.mesh_above_asked(mesh)
    return ModeTable(
        scene=scene.name,
        mesh=mesh,
        rows=rows,
        error_of="mesh error" if scene.bending is None else "error",
        load_factor=modes.load_factor,
        joints=joints,
        contact=contact,
        amplitude=at_amplitudes,
        warnings=sentences,
    )


def mac_picture(pipeline: Pipeline) -> Picture:
    """The MAC matrix of the computed modes with those of stiff joints; values from 0.05 on stand in
    their cells."""
    from beadwave.workflows.report import plots  # matplotlib takes a third of a second

    with_mac(pipeline.scene)
    hz = pipeline("modes").omega / (2 * np.pi)
    mac = pipeline("mac")
    stiff = [f"mode {n}" for n in pipeline.scene.measured_numbers]
    figure, (axis,) = plots.subplots(1, 1, (5, 1.2 + 0.26 * len(mac)))
    names = [f"{f:.0f} Hz" for f in hz], stiff
    plots.heat_map(axis, mac, names, "MAC", legible=0.05, limits=(0, 1))
    axis.set_xlabel("with stiff joints, on the body whose motion tells the mode")
    return Picture("mac", plots.png(figure))
