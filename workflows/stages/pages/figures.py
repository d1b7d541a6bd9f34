"""The stages that draw figures; cached like other results, so that a repeated run draws nothing."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beadwave.coupling import Impact
from beadwave.dem.waves.chain_waves import ChainWaves
from beadwave.dem.waves.labels import Label
from beadwave.dem.waves.tracks import WaveTrack
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report import plots
from beadwave.workflows.report.page_data import ledger
from beadwave.workflows.report.plots import Line, Panel
from beadwave.workflows.scene import Scene

if TYPE_CHECKING:
    from beadwave.coupling.sensors import SensorRecord  # scipy's filters, a second
    from beadwave.dem.lateral import LateralTrajectory
    from beadwave.dem.space import RowRun, SpaceTrajectory


def of_chain(scene: Scene, impact: Impact, waves: ChainWaves) -> tuple[Picture, ...]:
    """Figures of a run: velocities of the observed spheres with their waves, all spheres'
    velocities over time, and the energy ledger."""
    observed = scene.output.spheres or (1, scene.chain.count)
    return (
        Picture("velocities", velocities(impact.trajectory, observed, waves.labels)),
        Picture("waves", space_time(impact.trajectory, waves.tracks)),
        Picture("energies", energies(impact.trajectory._asdict())),
    )


def of_chains(
    scene: Scene, march: "SpaceTrajectory", waves: "tuple[tuple[RowRun, ChainWaves], ...]"
) -> tuple[Picture, ...]:
    """Figures of several chains: forces at the structure, of those that rub friction and the share
    that sticks, a map over time of each, energies."""
    names = [row.name for row in scene.chains]
    lines = [
        Line(name, 1e3 * run.t, run.contact_force[:, -1], None, i, 1.2)
        for i, (name, (run, _)) in enumerate(zip(names, waves, strict=True))
    ]
    forces = [Panel("", "time [ms]", "force at the\nstructure [N]", lines, legend="above")]
    rubbing = [
        (i, name, run) for i, (name, (run, _)) in enumerate(zip(names, waves, strict=True))
        if run.across is not None
    ]  # fmt: skip
    if rubbing:
        friction, sticking = [], []
        for i, name, run in rubbing:
            axis = int(np.ptp(run.across.friction_force, axis=0).argmax())
            along = f"{name}, t{axis + 1}"
            force, stick = run.across.friction_force[:, axis], 100 * run.across.stick_share
            friction.append(Line(along, 1e3 * run.t, force, None, i, 1.2))
            sticking.append(Line(name, 1e3 * run.t, stick, None, i, 1.2))
        forces += [
            Panel("", "time [ms]", "friction at the\nstructure [N]", friction, legend="above"),
            Panel("", "time [ms]", "of the area\nsticks [%]", sticking, legend="above"),
        ]
    figure, axes = plots.subplots(len(names), 1, (8, 1.0 + 2.6 * len(names)), sharex=True)
    for axis, name, (run, followed) in zip(axes, names, waves, strict=True):
        tracked(axis, run, followed.tracks)
        axis.set_title(name, fontsize=9, loc="left")
    for axis in axes[:-1]:
        axis.set_xlabel("")
    return (
        Picture("forces", plots.panels(forces, size=(8, 3.2))),
        Picture("waves", plots.png(figure)),
        Picture("energies", energies(march._asdict())),
    )


def of_friction(
    scene: Scene, impact: Impact, waves: ChainWaves, lateral: "LateralTrajectory"
) -> tuple[Picture, ...]:
    """Figures of a run with friction: besides `of_chain`'s the force over the slip, and over time
    friction with its bound and the share of the contact that sticks."""
    across = {k: a for k, a in lateral._asdict().items() if isinstance(a, np.ndarray)}
    run = impact.trajectory
    both = run._asdict() | across | {"energy_total": run.energy_total + lateral.energy}
    observed = scene.output.spheres or (1, scene.chain.count)
    return (
        Picture("velocities", velocities(run, observed, waves.labels)),
        Picture("waves", space_time(run, waves.tracks)),
        Picture("energies", energies(both)),
        Picture("friction", friction_loop(run, lateral, scene.friction.coefficient)),
    )


def friction_loop(run, lateral: "LateralTrajectory", coefficient: float) -> bytes:
    """PNG: tangential force over slip, and over time with its bound mu F, with the share of the
    contact's area that sticks; along the direction in which the surface moves most."""
    axis = int(np.ptp(lateral.slip, axis=0).argmax())
    force, slip = lateral.friction_force[:, axis], 1e6 * lateral.slip[:, axis]
    bound, t = coefficient * np.maximum(run.contact_force[:, -1], 0.0), 1e3 * run.t
    name, loops = f"t{axis + 1}", [Line(None, slip, force, "-", 0, 1.2)]
    if lateral.cycle is not None:
        loop = lateral.cycle
        before = (1e6 * loop.slip[:, axis], loop.friction_force[:, axis])
        loops = [Line("a period before", *before, "--", 1, 1.2), loops[0]._replace(name="the run")]
    panels = [
        Panel("", f"slip along {name} [\N{MICRO SIGN}m]", f"friction along {name} [N]", loops,
              legend="above"),
        Panel("", "time [ms]", "force [N]",
              [Line(f"friction, {name}", t, force, "-", 0, 1.2),
               Line("its bound", t, bound, "--", 1, 1.0), Line(None, t, -bound, "--", 1, 1.0)],
              legend="above"),
        Panel("", "time [ms]", "share that sticks",
              [Line(None, t, lateral.stick_share, "-", 2, 1.2)]),
    ]  # fmt: skip
    return plots.panels(panels, size=(8, 2.4))


def velocities(run, observed: Iterable[int], named: dict[int, tuple[Label, ...]]) -> bytes:
    """PNG: velocities of the observed spheres, one panel each, waves marked by their numbers."""
    t = 1e3 * run.t
    panels = [
        Panel("", "", f"sphere {sphere}\nvelocity [m/s]",
              [Line(None, t, run.v[:, sphere - 1], "-", i, 1.2)])
        for i, sphere in enumerate(observed)
    ]  # fmt: skip
    marks = [
        [Mark(_name(wave), wave.arrival.time, wave.arrival.peak_velocity) for wave in labels]
        for labels in (named.get(sphere, ()) for sphere in observed)
    ]
    return _with_marks(panels, marks, sharey=True)


def signals(scene: Scene, record: "SensorRecord") -> Picture:
    """Signals of the sensors, one panel each, the waves marked by their names."""
    t = record.t
    panels, marks = [], []
    columns = zip(scene.output.sensors, record.y.T, record.waves, strict=True)
    for i, (sensor, y, waves) in enumerate(columns):
        curve = Line(None, 1e3 * t, y, "-", i, 1.2)
        panels.append(Panel("", "", f"{sensor.label}\n[{sensor.unit}]", [curve]))
        of_sensor = []
        for wave in waves:
            # "incident 2" is i2 and "reflected 1" is 1, as at the spheres
            short = wave.name.replace("incident", "i").replace("i ", "i").replace("reflected ", "")
            of_sensor.append(Mark(short, wave.time, float(np.interp(wave.time, t, y))))
        marks.append(of_sensor)
    return Picture("signals", _with_marks(panels, marks))


class Mark(NamedTuple):
    """A wave's name next to its crest on a curve."""

    name: str
    time: float  # [s] of the crest
    height: float  # of the crest, in the curve's unit; the name is below a negative one


def _with_marks(panels: list[Panel], marks: list[list[Mark]], *, sharey: bool = False) -> bytes:
    """PNG: panels above each other with a common axis of time, the marks of each on it."""
    size = (8, 1.7 + 1 / len(panels))
    figure, axes = plots.drawn(panels, size=size, sharex=True, sharey=sharey)
    for axis, of_panel in zip(axes, marks, strict=True):
        axis.margins(x=0.01, y=0.15)
        for mark in of_panel:
            up = 1 if mark.height > 0 else -1
            axis.annotate(
                mark.name, (1e3 * mark.time, mark.height), (0, 3 * up), fontsize=8, ha="center",
                textcoords="offset points", va="bottom" if up > 0 else "top",
            )  # fmt: skip
    axes[-1].set_xlabel("time [ms]")
    return plots.png(figure)


def _name(wave: Label | WaveTrack) -> str:
    """Short name of a wave: its number if it is reflected, i, i2, i3, ... if it is incident."""
    if wave.kind == "reflected":
        return str(wave.number)
    return "i" if wave.number == 1 else f"i{wave.number}"


def space_time(run, tracks: Iterable[WaveTrack]) -> bytes:
    """PNG: velocity of every sphere over time as a map, with the tracks of the waves."""
    figure, (axis,) = plots.subplots(1, 1, (8, 4.6))
    tracked(axis, run, tracks)
    return plots.png(figure)


def tracked(axis: plots.Axes, run, tracks: Iterable[WaveTrack]) -> None:
    """Velocity of every sphere over time as a map, with the tracks of the waves."""
    plots.space_time(axis, run.t, run.v)
    limits = axis.get_xlim(), axis.get_ylim()
    late = 1e3 * (0.97 * run.t[-1] + 0.03 * run.t[0])
    for track in tracks:
        places = [pulse.contact + 0.5 for pulse in track.pulses]
        times = [1e3 * pulse.time for pulse in track.pulses]
        axis.plot(times, places, color="black", linewidth=0.8, linestyle=(0, (3, 2)))
        at_end = times[-1] > late
        axis.annotate(
            _name(track), (times[-1], places[-1]), (-4 if at_end else 4, 0), fontsize=8,
            va="center", textcoords="offset points", ha="right" if at_end else "left",
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "linewidth": 0},
        )  # fmt: skip
    axis.set(xlim=limits[0], ylim=limits[1])


def energies(run: dict[str, np.ndarray]) -> bytes:
    """PNG: terms of the energy ledger over time, as changes since the start, and its closure error
    over the striker's energy; the run's arrays are (k,), t [s] and energies [J] by their names."""
    t = 1e3 * run["t"]
    *terms, (_, total) = ledger(run)
    lines = [Line(words, t, 1e3 * E, None, i, 1.2) for i, (words, E) in enumerate(terms)]
    lines.append(Line("sum", t, 1e3 * total, "--", "black", 1.0))
    gap = (run["energy_total"] - run["energy_total"][0]) / max(run["energy_kinetic"][0], 1e-300)
    power = int(np.floor(np.log10(np.abs(gap).max(initial=0.0) or 1.0)))
    closure = f"closure error\n[1e{power} of the\nstriker's]"
    panels = [
        Panel("", "", "energy [mJ]", lines, legend="above"),
        Panel("", "time [ms]", closure, [Line(None, t, gap / 10.0**power, "-", "black", 0.9)]),
    ]
    return plots.panels(panels, size=(8, 2.8), sharex=True, height_ratios=(3, 1))
