"""Modes of a hammer test paired with those of a model, what the pairs tell of the test, and targets
of a scene made of them."""

from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from beadwave import fem
from beadwave.fem.identification.hit_records import node_and_axis
from beadwave.fem.identification.measured_shapes import MeasuredShape, along_directions
from beadwave.fem.identification.response_scale import POWERS, remark_on_scale, response_scale
from beadwave.fem.identification.sensor_placement import one_more_point, outside
from beadwave.fem.modes.assembly_modes import AssemblyModes, field_of
from beadwave.fem.modes.mac import ShapeMatch, mac_near_double, measured_pairs, strained
from beadwave.workflows.files.measured_shape import measured_shape
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report import plots
from beadwave.workflows.report.number_format import digits, supported
from beadwave.workflows.scene import InvalidScene, ModalDampingTable, Scene
from beadwave.workflows.scene.tables.bodies import MeasuredMode
from beadwave.workflows.stages.engine.pipeline import Pipeline
from beadwave.workflows.stages.pages.pictures import rendered
from beadwave.workflows.stages.structure.targets import placed, remarks_on_axes
from beadwave.workflows.structure.hammer import (
    HammerReport,
    HammerRow,
    IdentifiedTest,
    points_without_place,
)
from beadwave.workflows.structure.tuning import targets


def measured_shapes(test: IdentifiedTest) -> list[MeasuredShape] | None:
    """The shape of each mode at the points of the test whose place is known; None where these are
    too few."""
    names, missing = test.test.responses.points, set(points_without_place(test.test))
    placed = [i for i in range(len(names)) if i not in missing]
    ends = [node_and_axis(names[i]) for i in placed]
    shapes = [along_directions(test.test.nodes, ends, phi[placed]) for phi in test.modes.phi.T]
    return None if any(shape is None for shape in shapes) else shapes


def likeness_of(
    test: IdentifiedTest, pipeline: Pipeline, measured: list[MeasuredShape]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """MAC (n, k) of the measured shapes with the computed modes, and these at the points of the
    test (p, k); raises InvalidScene for points off the assembly."""
    model, modes = pipeline("model"), pipeline("modes")
    shapes = [
        placed(pipeline.scene, model, test.test.places, shape, row.frequency_hz)
        for shape, row in zip(measured, test.report.rows, strict=True)
    ]
    # all shapes of one test are read at the same points
    reading = shapes[0].reading @ modes.phi
    at_points, hz = np.column_stack([s.shape for s in shapes]), modes.omega / (2 * np.pi)
    return mac_near_double(at_points, reading, hz), reading


def recognised(test: IdentifiedTest, pipeline: Pipeline, wanted: Collection[int]) -> IdentifiedTest:
    """The test with its modes paired one-to-one with computed ones, on MAC and frequency together;
    that of a wanted target's mode gets the target's number. As it is without points of shapes."""
    report, scene, measured = test.report, pipeline.scene, measured_shapes(test)
    if measured is None:
        return test
    model, modes = pipeline("model"), pipeline("modes")
    computed_hz = modes.omega / (2 * np.pi)
    likeness, reading = likeness_of(test, pipeline, measured)
    measured_hz = np.array([row.frequency_hz for row in report.rows])
    pairs = measured_pairs(measured_hz, computed_hz, likeness, fem.mac(reading, reading))
    numbers = zip(scene.measured_numbers, modes.index.tolist(), strict=True)
    number = {j: n for n, j in numbers if n in wanted}

    # the number of a target goes to the row of the mode that it is paired with
    rows = []
    for i, row in enumerate(report.rows):
        update: dict = {"mode": None, "remarks": [*row.remarks, *pairs.doubts[i]]}
        j, second = int(pairs.index[i]), int(pairs.runner_up[i])
        if j >= 0:
            update |= {
                "mode": number.get(j), "computed_hz": float(computed_hz[j]),
                "mac": float(likeness[i, j]),
            }  # fmt: skip
        else:
            update["remarks"].append("no computed mode is like it")
        if second >= 0:
            update |= {
                "runner_up_hz": float(computed_hz[second]),
                "runner_up_mac": float(likeness[i, second]),
            }
        rows.append(row.model_copy(update=update))

    # pairs of which nothing is doubted tell whether the responses have the model's size
    sure = np.array([i for i, j in enumerate(pairs.index) if j >= 0 and not pairs.doubts[i]], int)
    of_scale = measured_scale(test, pipeline, reading, sure, pairs.index[sure])
    on_points = points_that_tell(model, modes, reading, pairs.index[pairs.index >= 0])
    remarks = [
        *report.remarks,
        *([of_scale] if of_scale else []),
        *on_points,
        *remarks_on_axes(scene),
    ]
    return test._replace(report=report.model_copy(update={"rows": rows, "remarks": remarks}))


def points_that_tell(
    model: fem.Model,
    modes: AssemblyModes,
    reading: NDArray[np.float64],
    paired: NDArray[np.int64],
    match: ShapeMatch = ShapeMatch(),
    most: int = 3,
) -> list[str]:
    """Sentences on where one more point would tell paired modes from others that look alike at the
    points of the test, `reading` (p, k); of the first `most`, each and the nearest in frequency."""
    # spatial aliasing: at few points two shapes may look alike, of which MAC tells nothing
    auto_mac, hz = np.nan_to_num(fem.mac(reading, reading)), modes.omega / (2 * np.pi)
    alike = []
    for j in paired:
        others = np.flatnonzero((auto_mac[j] > match.alike) & (np.arange(len(hz)) != j))
        if others.size:
            nearest = np.abs(np.log(np.maximum(hz[others], 1e-9) / max(hz[j], 1e-9))).argmin()
            alike.append((int(j), int(others[nearest])))
    if not alike:
        return []
    try:
        places = outside(model)
    except ValueError:  # no face looks along an axis
        return []
    at_places = (model.T @ modes.phi)[places.reading]
    sentences = []
    for j, k in alike[:most]:
        best, with_it = one_more_point(reading[:, [j, k]], at_places[:, [j, k]])
        if with_it < match.alike:
            at = ", ".join(f"{x:.4g}" for x in places.points[best].round(5) + 0.0)
            sentences.append(
                f"one more point at [{at}] m along {'xyz'[places.axes[best]]} would tell the shape "
                f"at {hz[j]:.2f} Hz from that at {hz[k]:.2f} Hz: MAC {with_it:.2f} with it, "
                f"{auto_mac[j, k]:.2f} without"
            )
    return sentences


def measured_scale(
    test: IdentifiedTest,
    pipeline: Pipeline,
    reading: NDArray[np.float64],
    measured: NDArray[np.int64],
    computed: NDArray[np.int64],
) -> str:
    """A sentence where the responses of some measured modes have another size than those of the
    computed modes that they are; "" where they agree, or where the places of the hammer, or the
    quantity, are not known. `reading` (p, k) are the computed modes at the points with a place."""
    responses, nodes = test.test.responses, test.test.nodes
    ends = [node_and_axis(name) for name in responses.references]
    if test.test.quantity not in POWERS or not all(end and end[0] in nodes for end in ends):
        return ""
    points, axes = (np.array(values) for values in zip(*ends, strict=True))
    hit = MeasuredShape(
        np.array([nodes[node] for node in points.tolist()]),
        np.sign(axes)[:, None] * np.eye(3)[np.abs(axes) - 1],
        np.ones(len(axes), complex),
    )
    model, modes = pipeline("model"), pipeline("modes")
    at_references = placed(pipeline.scene, model, test.test.places, hit, 0.0).reading @ modes.phi
    missing = points_without_place(test.test)
    chosen = test.modes._replace(
        frequency_hz=test.modes.frequency_hz[measured],
        phi=np.delete(test.modes.phi, missing, axis=0)[:, measured],
        participation=test.modes.participation[measured],
    )
    scale = response_scale(
        chosen, test.test.quantity, reading[:, computed], at_references[:, computed]
    )
    return remark_on_scale(scale)


def mac_with_model(
    test: IdentifiedTest, pipeline: Pipeline, above: float = 1.25, most: int = 40
) -> tuple[Picture, ...]:
    """The MAC of the measured shapes with the computed modes at the points of the test, up to
    `above` times the highest measured frequency, at most so many; nothing without shapes."""
    measured, rows = measured_shapes(test), test.report.rows
    if measured is None:
        return ()
    likeness, _ = likeness_of(test, pipeline, measured)
    hz = pipeline("modes").omega / (2 * np.pi)
    shown = np.flatnonzero(hz <= above * max(row.frequency_hz for row in rows))[:most]
    if not shown.size:
        return ()
    figure, (axis,) = plots.subplots(1, 1, (2.6 + 0.42 * len(shown), 1.8 + 0.3 * len(rows)))
    names = (
        [f"{row.number}: {digits(row.frequency_hz, 5)} Hz" for row in rows],
        [f"{digits(f, 5)} Hz" for f in hz[shown]],
    )
    values = np.nan_to_num(likeness[:, shown])  # of a mode that no point sees
    plots.heat_map(axis, values, names, "MAC", legible=0.1, limits=(0, 1))
    axis.tick_params(axis="x", rotation=60)
    axis.set_xlabel("computed modes")
    axis.set_ylabel("modes of the test")
    return (Picture("mac", plots.png(figure, test.banner)),)


def shape_comparison(
    test: IdentifiedTest, pipeline: Pipeline, *, most: int = 8
) -> tuple[Picture, ...]:
    """Measured shapes as arrows next to the computed modes that they are paired with, of the first
    pairs of a test that is `recognised`, `most` in one picture (not varied); nothing without any.
    Raises NoPicture."""
    model, modes = pipeline("model"), pipeline("modes")
    computed_hz = modes.omega / (2 * np.pi)
    index, content, kind = [], [], "SYNTHETIC" if test.banner else "measured"
    for row, shape in zip(test.report.rows, measured_shapes(test) or [], strict=True):
        if row.computed_hz is None or len(index) == most:
            continue
        j = int(np.abs(computed_hz - row.computed_hz).argmin())
        at = placed(pipeline.scene, model, test.test.places, shape, row.frequency_hz)
        # turned to be as real as can be, then into the sense of the computed mode
        values = shape.values * np.exp(-0.5j * np.angle(np.sum(shape.values**2)))
        values = values.real * np.sign(values.real @ (at.reading @ modes.phi[:, j]))
        # the directions of a point together
        points, which = np.unique(shape.points, axis=0, return_inverse=True)
        displacement = np.zeros_like(points)
        np.add.at(displacement, which.ravel(), values[:, None] * shape.directions)
        index.append(j)
        content.append(
            {
                "measured": f"{row.number}: {kind} {row.frequency_hz:.2f} Hz",
                "computed": f"computed {row.computed_hz:.2f} Hz, MAC {row.mac:.2f}",
                "points": points.tolist(), "displacement": displacement.tolist(),
            }
        )  # fmt: skip
    if not index:
        return ()
    field = field_of(model, modes, np.array(index), np.zeros(len(index), int))
    return rendered("beadwave.workflows.report.render_shapes", field, content, "shapes")


def targets_of(test: IdentifiedTest, shapes: Path) -> str:
    """The modes as [[targets]] of a scene, their shapes in a file; a doubtful pair as a comment."""
    blocks = []
    for row in test.report.rows:
        doubts = [remark for remark in row.remarks if remark.startswith("doubtful")]
        damping = [f"zeta = {row.zeta:.4g}"]
        if row.zeta_deviation is not None:
            damping.append(f"zeta_deviation = {row.zeta_deviation:.2g}")
        lines = [
            "[[targets]]",
            f"hz = {supported(row.frequency_hz, row.frequency_deviation_hz or 0.0)}",
            *([f"hz_deviation = {row.frequency_deviation_hz:.2g}"] if has_deviation(row) else ()),
            f'shape = "{shapes}"',
            *damping,
        ]  # fmt: skip
        if doubts or (row.mac is None and row.runner_up_mac is not None):
            why = doubts[0] if doubts else "no computed mode is like it"
            lines = [f"# {why}", *(f"# {line}" for line in lines)]
        blocks.append("\n".join(lines))
    return "\n".join(blocks) + "\n"


def as_targets(
    test: IdentifiedTest, pipeline: Pipeline, match: str | None
) -> tuple[Scene, dict[int, float], list[str]]:
    """The scene of bodies with the test's modes as its targets and its damping, the frequencies to
    tune to by the mode's number, and what they were paired by; raises InvalidScene.

    A target is recognised by its measured shape where the file holds it; otherwise by the number of
    the computed mode that it is like, and where no points are known by its place in the order of
    frequencies.
    """
    scene, file = pipeline.scene, Path(test.report.file)
    by_shape = measured_shapes(test) is not None
    if by_shape:
        test = recognised(test, pipeline, ())
        computed_hz = pipeline("modes").omega / (2 * np.pi)
        rows = [row for row in test.report.rows if row.computed_hz is not None]
        place = [int(np.abs(computed_hz - row.computed_hz).argmin()) for row in rows]
        rows = [rows[i] for i in np.argsort(place)]
        # numbers of targets count modes that strain something; others are known by shape alone
        elastic_modes = strained(pipeline("model"), pipeline("modes"))
        number = np.where(elastic_modes, np.cumsum(elastic_modes), 0)[np.sort(place)].tolist()
    else:
        rows = sorted(test.report.rows, key=lambda row: row.frequency_hz)
        number = list(range(1, len(rows) + 1))
    if not rows:
        raise InvalidScene(
            f"{file}: none of its modes has a shape like one of {scene.name}; `beadwave hammer "
            f"{file} --scene {scene.name}` shows them."
        )

    def holds_shape(hz: float) -> bool:
        """True if the file itself holds the shape, and a scene may name it."""
        try:
            return by_shape and bool(len(measured_shape(file, hz).points))
        except InvalidScene:
            return False

    # a target by its shape, else by its number; a rigid motion without a shape has neither
    holds = [holds_shape(row.frequency_hz) for row in rows]
    written = [i for i in range(len(rows)) if holds[i] or number[i]]
    rows, number, holds = ([each[i] for i in written] for each in (rows, number, holds))
    tables = tuple(
        MeasuredMode(shape=str(file), **_of_test(row))
        if has_shape
        else MeasuredMode(number=n, **_of_test(row))
        for row, n, has_shape in zip(rows, number, holds, strict=True)
    )
    scene = scene.but(targets=tables)
    rows = [
        row.model_copy(update={"mode": n})
        for n, row in zip(scene.measured_numbers, rows, strict=True)
    ]
    scene, hz = applied(scene, test.report.model_copy(update={"rows": rows}), None)
    if match:
        hz = {n: hz[n] for n in targets(match, scene.measured_modes)}
    how = (
        "by the shapes of their points"
        if by_shape
        else "in the order of frequencies, since the test has no points (hammer --points pairs "
        "them by shape)"
    )
    listed = ", ".join(
        f"{f:.5g} Hz is mode {n}" if n else f"{f:.5g} Hz is a rigid motion"
        for f, n in zip(scene.measured_hz, number, strict=True)
    )
    doubts = [
        f"{row.frequency_hz:.5g} Hz: {remark}."
        for row in rows
        for remark in row.remarks
        if remark.startswith("doubtful")
    ]
    return scene, hz, [f"Modes of {file} are paired {how}: {listed}.", *doubts]


def applied(
    scene: Scene, report: HammerReport, match: str | None
) -> tuple[Scene, dict[int, float]]:
    """The scene with the measured damping, where all its modes have one, and the measured
    frequencies to tune to, {mode: Hz}; raises InvalidScene for modes without a resonance."""
    if not report.targets:
        raise InvalidScene(f"{report.file} has no resonance near the modes wanted; name others.")
    wanted = targets(match, scene.measured_modes) if match else {}
    missing = sorted(set(wanted) - set(report.targets))
    if missing:
        raise InvalidScene(f"{report.file} has no resonance near modes {missing}; leave them out.")
    ratios = [report.damping.get(i) for i in scene.measured_numbers]
    if None not in ratios:
        scene = scene.but(damping=ModalDampingTable(kind="modal", ratio=tuple(ratios)))
    of_test = {row.mode: _of_test(row) for row in report.rows if row.mode}
    return scene.remeasured(of_test), report.targets


def _of_test(row: HammerRow) -> dict[str, float | None]:
    """Frequency and damping of a row with their deviations, as keys of a target."""
    deviation = row.frequency_deviation_hz if has_deviation(row) else None
    return {
        "hz": row.frequency_hz, "hz_deviation": deviation,
        "zeta": row.zeta, "zeta_deviation": row.zeta_deviation,
    }  # fmt: skip


def has_deviation(row: HammerRow) -> bool:
    """True if the deviation of a row's frequency is known; of one line it is not."""
    return 0 < (row.frequency_deviation_hz or 0.0) < row.frequency_hz
