"""Second waves as published, and tables 5.2 and 5.3 of the thesis beside the rig, whose sizes the
thesis does not give: inferred ones meet its figures to a few per cent."""

from collections.abc import Iterator

import numpy as np

from beadwave import coupling, dem
from beadwave.dem.spheres import time_scale
from beadwave.dem.waves.tracks import wave_tracks
from beadwave.workflows.evidence.harness import Comparison, compared
from beadwave.workflows.evidence.verify.published import EXACT
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.chain.chain import initial_velocity
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.structure.thesis_tables import TABLE_53, TableRow, table_52, table_53

FITTED, UNFITTED = 0.04, 0.2  # of a frequency that a tuning matches, and of one that it does not
PUBLISHED = (0.39, 0.47)  # Yang: ratios between which the second wave fades out
RATIOS = np.unique(
    np.concatenate([np.geomspace(3e-3, 30, 17), np.arange(0.25, 0.6, 0.02)]).round(4)
)
FAINT, FADED = (
    0.004,
    0.005,
)  # of the largest wave, what is followed; of the striker's speed, no wave
YANG = "J. Yang et al., Phys. Rev. E 83 (2011) 046606"
HAMMER = "the thesis, table 5.1, hammer test"


def second_waves() -> Iterator[Comparison]:
    """The softness of a wall above which the chain is sent a second wave, and what stays."""
    rig = scene("rig-rom", ())
    spheres = rig.chain
    v0 = initial_velocity(rig)
    speed = np.abs(v0).max()

    # half-spaces of E / (1 - nu^2) over that of a sphere, each until the wave is back at the
    # striker: 2.6 natural times of a sphere in the chain, 12 of the last one at the wall
    second = []
    for ratio in RATIOS:
        chain = dem.row_of_spheres(
            spheres.radius, spheres.density, spheres.young, spheres.poisson, count=spheres.count,
            flat=dem.Flat(ratio * spheres.young, spheres.poisson),
        )  # fmt: skip
        in_chain = time_scale(chain.mass[0], chain.A[0], speed)
        at_wall = time_scale(chain.mass[-1], chain.A[-1], speed)
        run = coupling.impact(
            chain, dem.rigid_wall(), v0, error=1e-4, n_save=3000,
            duration=2.6 * len(chain.mass) * in_chain + 12 * at_wall,
        ).trajectory  # fmt: skip
        tracks = wave_tracks(
            run.t, run.v, run.contact_force, chain.mass, chain.A, threshold=FAINT
        )  # fmt: skip
        crests = [
            abs(pulse.velocity)
            for track in tracks
            if (track.kind, track.number) == ("reflected", 2)
            for pulse in track.pulses
        ]
        second.append(max(crests, default=0.0) / speed)

    second, (low, high) = np.array(second), PUBLISHED
    yield compared("second reflected wave fades out at E*_w/E*_s",
                   RATIOS[np.argmax(second <= FADED)], (low + high) / 2,
                   allowed=(high - low) / 2, of=1.0, source=YANG)  # fmt: skip
    yield compared("second reflected wave of walls stiffer than the spheres [V]",
                   second[RATIOS > 1], 0.03, allowed=0.01, of=1.0, source=EXACT)  # fmt: skip


def thesis_tables() -> Iterator[Comparison]:
    """Tables 5.2 and 5.3 by `modes --table`, the worst of four modes: minutes."""
    rig = scene("rig-rom", ())
    for row in table_52(rig, quiet).rows:
        yield _worst(f"table 5.2, {row.model}", row, [*range(4)], FITTED, "the thesis, table 5.2")
    for match, row in zip(TABLE_53.values(), table_53(rig, quiet).rows, strict=True):
        matched = [i - 1 for i in match]
        source = HAMMER if "not in the thesis" in row.model else "the thesis, table 5.3"
        yield _worst(f"table 5.3, {row.model}", row, matched, FITTED, source)
        if unmatched := sorted({*range(4)} - {*matched}):
            name = f"table 5.3, {row.model}, not matched"
            yield _worst(name, row, unmatched, UNFITTED, source)


def _worst(name: str, row: TableRow, modes: list[int], allowed: float, source: str) -> Comparison:
    """Of these modes, counted from 0, the frequency that differs most."""
    ours, theirs = (np.array(hz, float)[modes] for hz in (row.modes_hz, row.thesis_hz))
    i = int(np.argmax(np.abs(ours / theirs - 1)))
    return compared(f"{name}, mode {modes[i] + 1} [Hz]", ours[i], theirs[i],
                    allowed=allowed, source=source)  # fmt: skip
