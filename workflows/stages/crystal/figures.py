"""Figures of a crystal's run: over position, over rows and time, its energies."""

import numpy as np

from beadwave.dem.space import SpaceTrajectory
from beadwave.dem.space.waves import Arrivals
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report import plots
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.crystal.packing import CrystalStart
from beadwave.workflows.stages.pages.figures import energies

SNAPSHOTS = (0.15, 0.35, 0.6, 0.9)  # of the last arrival


def crystal_figures(
    scene: Scene, start: CrystalStart, march: SpaceTrajectory, waves: Arrivals
) -> tuple[Picture, ...]:
    """Arrivals and peaks over position, snapshots, rows over time, energies."""
    return (
        Picture("crystal", arrival_map(start, march, waves)),
        Picture("snapshots", snapshots(start, march, waves)),
        Picture("rows", rows(scene, start, march)),
        Picture("energies", energies(march._asdict())),
    )


class View:
    """The plane that a crystal is drawn in: x across, the axis of the impact down; of a crystal in
    space the spheres nearest to the middle of those that are struck."""

    def __init__(self, start: CrystalStart, march: SpaceTrajectory) -> None:
        centre = start.packing.rest[march.saved]
        down = start.axis if start.axis else 1 if np.ptp(centre[:, 1]) > 0.0 else 0
        self.axes = (0, down) if down else (1, 0)
        depth = next(k for k in range(3) if k not in self.axes)
        struck = start.moving
        middle = np.median(start.packing.rest[struck, depth])
        near = np.abs(centre[:, depth] - middle)
        self.shown = np.flatnonzero(near <= near.min() + 0.51 * start.spacing)
        self.centre = centre[self.shown][:, self.axes]
        self.radius = start.packing.radius[march.saved][self.shown]
        self.struck = struck[march.saved][self.shown]  # whose colours are beyond the scale
        self.labels = tuple(f"{'xyz'[k]} [mm]" for k in self.axes)

    def label(self, axis: plots.Axes, *, left: bool = True) -> None:
        """Names of the axes."""
        axis.set_xlabel(self.labels[0])
        axis.set_ylabel(self.labels[1] if left else "")

    @property
    def inches(self) -> tuple[float, float]:
        """Size of one picture of the crystal."""
        width, height = np.ptp(self.centre, axis=0) + 2.0 * self.radius.max()
        tall = float(np.clip(3.6 * height / width, 2.4, 6.5))
        return float(np.clip(tall * width / height, 1.4, 4.2)), tall


def arrival_map(start: CrystalStart, march: SpaceTrajectory, waves: Arrivals) -> bytes:
    """PNG: arrival and largest speed of each sphere over position."""
    view = View(start, march)
    width, tall = view.inches
    figure, (left, right) = plots.subplots(1, 2, (2 * width + 2.6, tall + 0.6))
    at = view.shown
    plots.spheres(left, view.centre, view.radius, 1e3 * waves.time[at], "arrival [ms]")
    peak = np.where(np.isnan(waves.time[at]), np.nan, waves.peak[at])
    top = np.nanmax(np.where(view.struck, np.nan, peak), initial=0.0) or 1.0
    plots.spheres(
        right, view.centre, view.radius, peak, "largest speed [m/s]", cmap="magma_r",
        limits=(0.0, top),
    )  # fmt: skip
    view.label(left)
    view.label(right, left=False)
    return plots.png(figure)


def snapshots(start: CrystalStart, march: SpaceTrajectory, waves: Arrivals) -> bytes:
    """PNG: speed of each sphere at some instants before the wave has passed the last."""
    view = View(start, march)
    last = np.nanmax(waves.time[view.shown], initial=0.0) or march.t[-1]
    instants = [int(np.searchsorted(march.t, share * last)) for share in SNAPSHOTS]
    speed = np.linalg.norm(march.velocity[instants][:, view.shown], axis=2)
    top = float(speed[:, ~view.struck].max(initial=0.0)) or 1.0
    width, tall = view.inches
    figure, axes = plots.subplots(1, 4, (4 * 0.75 * width + 2.0, 0.8 * tall + 0.7))
    for i, (axis, k) in enumerate(zip(axes, instants, strict=True)):
        plots.spheres(
            axis, view.centre, view.radius, speed[i], "speed [m/s]", cmap="magma_r",
            limits=(0.0, top), bar=i == 3,
        )  # fmt: skip
        axis.set_title(f"{1e3 * march.t[k]:.3g} ms", fontsize=9, loc="left")
        view.label(axis, left=i == 0)
    return plots.png(figure)


def rows(scene: Scene, start: CrystalStart, march: SpaceTrajectory) -> bytes:
    """PNG: mean velocity of the rows along their axis, and their kinetic energy, over time; of a
    network and a Y the speed of the spheres one by one."""
    crystal = scene.crystal
    mass = start.packing.mass[march.saved]
    kinetic = 0.5 * mass * np.einsum("ksx,ksx->ks", march.velocity, march.velocity)
    if crystal.nodes or crystal.lattice == "y":
        velocity = np.linalg.norm(march.velocity, axis=2)
        energy, name, label = kinetic, "sphere", "speed [m/s]"
    else:
        height = start.packing.rest[march.saved, start.axis]
        _, row = np.unique(np.round(height / (0.1 * start.spacing)), return_inverse=True)
        sums = np.equal.outer(np.arange(row.max() + 1), row).astype(float)
        velocity = march.velocity[:, :, start.axis] @ (sums / sums.sum(axis=1)[:, None]).T
        energy, name = kinetic @ sums.T, "row" if start.axis == 1 else "layer"
        label = f"mean velocity along {'xyz'[start.axis]} [m/s]"
    figure, axes = plots.subplots(2, 1, (8, 7.2), sharex=True)
    place = f"{name}, 1 = first"
    plots.over_time(axes[0], march.t, velocity, (place, label))
    plots.over_time(axes[1], march.t, 1e3 * energy, (place, "kinetic energy [mJ]"), signed=False)
    axes[-1].set_xlabel("time [ms]")
    return plots.png(figure)
