"""Frequency and damping of modes at the amplitudes of a run, of faces in contact under preload."""

import numpy as np

from beadwave import coupling, dem, rom
from beadwave.coupling.modes_at_amplitude import Backbone, SettledRun, settled
from beadwave.fem.contact.modal_backbone import ModalBackbone
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.workflows.report.summary import ModeAtAmplitude
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages import warnings
from beadwave.workflows.stages.chain.chain import Start
from beadwave.workflows.stages.chain.impact import impact
from beadwave.workflows.stages.chain.walls import wall_of


def amplitudes(
    scene: Scene,
    start: Start,
    reduction: rom.ReducedModel,
    modes: AssemblyModes,
    backbones: dict[int, ModalBackbone],
) -> SettledRun:
    """The modes with a backbone at their largest amplitudes of the run, and at its end."""
    hz = modes.omega / (2 * np.pi)
    curves = [
        Backbone(number, float(hz[number - 1]), b.largest, b.displacement, b.frequency,
                 b.loss_factor)
        for number, b in backbones.items() if len(b.displacement)
    ]  # fmt: skip

    def march(wall: dem.Wall | coupling.CoupledWall) -> dem.Trajectory:
        """The run before a wall."""
        return impact(scene, start, wall).trajectory

    return settled(curves, wall_of(scene, reduction), march)


def mode_numbers(settled: SettledRun) -> tuple[tuple[ModeAtAmplitude, ...], list[str]]:
    """Numbers of the modes at their amplitudes, and what is to be said of them."""
    rows = tuple(
        ModeAtAmplitude(
            mode=most.number,
            linear_hz=most.linear_hz,
            displacement_m=most.displacement,
            frequency_hz=most.linear_hz * most.factor,
            loss_factor=2 * most.ratio,
            end_displacement_m=end.displacement,
            end_frequency_hz=end.linear_hz * end.factor,
            end_loss_factor=2 * end.ratio,
        )
        for most, end in zip(settled.largest, settled.at_end, strict=True)
    )
    beyond = {mode.number: mode.displacement for mode in settled.largest if mode.beyond}
    return rows, list(warnings.beyond_backbones(beyond))
