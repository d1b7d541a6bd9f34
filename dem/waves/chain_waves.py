"""The waves of a run: followed through the chain, named at spheres, and measured at the wall."""

from collections.abc import Iterable
from typing import NamedTuple

from dem.chain import Chain
from dem.trajectory import Trajectory
from dem.waves.labels import Label, labels
from dem.waves.measures import WallContact, wall_contact
from dem.waves.tracks import WaveTrack, wave_tracks


class ChainWaves(NamedTuple):
    """Waves along the chain, at the observed spheres, and the impact at the wall, if any."""

    tracks: tuple[WaveTrack, ...]
    labels: dict[int, tuple[Label, ...]]
    contact: WallContact | None


def chain_waves(
    run: Trajectory, row: Chain, spheres: Iterable[int], *, at_wall: bool
) -> ChainWaves:
    """Waves of a run, labelled at the spheres (counted from 1), and its collision with the wall."""
    tracks = wave_tracks(run.t, run.v, run.contact_force, row.mass, row.A)
    # twenty waves of a kind: after a few dozen impacts there are none to name
    tracks = tuple(track for track in tracks if track.number <= 20)
    return ChainWaves(
        tracks,
        {s: labels(tracks, run.t, run.v[:, s - 1], s) for s in spheres},
        wall_contact(run.t, run.v, run.contact_force, row, tracks) if at_wall else None,
    )
