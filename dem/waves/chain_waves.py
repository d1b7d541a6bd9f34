"""The waves of a run: followed through the chain, named at spheres, and measured at the wall."""

from collections.abc import Iterable
from typing import NamedTuple

from dem.chain import Chain
from dem.trajectory import Trajectory
from dem.waves.labels import Label, labels
from dem.waves.measures import WallContact, wall_contact
from dem.waves.tracks import WaveTrack, wave_tracks


class ChainWaves(NamedTuple):
    """Waves along the chain, at the observed spheres, and at the wall."""

    tracks: tuple[WaveTrack, ...]
    labels: dict[int, tuple[Label, ...]]  # by sphere, counted from 1
    contact: WallContact | None  # None without a wall, and of spheres at rest


def chain_waves(
    run: Trajectory, row: Chain, spheres: Iterable[int], *, at_wall: bool
) -> ChainWaves:
    """Waves of the run of a chain `row`, labelled at the spheres (counted from 1); its collision
    with the wall if there is one (`at_wall`) and a sphere moves."""
    at_wall = at_wall and bool(run.v[0].any())
    A = row.elastic.hertz(run.contact_force.max(axis=0, initial=0.0))
    tracks = wave_tracks(run.t, run.v, run.contact_force, row.mass, A)
    # at most twenty waves each way: after a few dozen impacts the chain moves chaotically, and what
    # is still tracked is no solitary wave
    tracks = tuple(track for track in tracks if track.number <= 20)
    return ChainWaves(
        tracks,
        {s: labels(tracks, run.t, run.v[:, s - 1], s) for s in spheres},
        wall_contact(run.t, run.v, run.contact_force, row, tracks) if at_wall else None,
    )
