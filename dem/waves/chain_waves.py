"""The waves of a run: followed through the chain, named at spheres, and measured at the wall."""

from collections.abc import Iterable
from typing import NamedTuple

from beadwave.dem.chain import Chain
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.trajectory import Trajectory
from beadwave.dem.waves.labels import Label, labels
from beadwave.dem.waves.measures import WallContact, wall_contact
from beadwave.dem.waves.tracks import WaveTrack, wave_tracks

UNEQUAL = 1.25  # ratio of masses beyond which waves are not those of equal spheres


class ChainWaves(NamedTuple):
    """Waves along the chain, at the observed spheres, and at the wall."""

    tracks: tuple[WaveTrack, ...]
    labels: dict[int, tuple[Label, ...]]  # by sphere, counted from 1; empty of unlike spheres
    contact: WallContact | None  # None without a wall, and of spheres at rest


def chain_waves(
    run: Trajectory, row: Chain, spheres: Iterable[int], *, at_wall: bool
) -> ChainWaves:
    """Waves of the run of a chain `row`, labelled at the spheres (counted from 1) unless these are
    unlike; its collision with the wall if there is one (`at_wall`) and a sphere moves."""
    at_wall = at_wall and bool(run.v[0].any())
    A = row.elastic.hertz(run.contact_force.max(axis=0, initial=0.0))
    tracks = wave_tracks(run.t, run.v, run.contact_force, row.mass, A)
    # at most twenty waves each way: after a few dozen impacts the chain moves chaotically, and what
    # is still tracked is no solitary wave
    tracks = tuple(track for track in tracks if track.number <= 20)
    # the solitary wave of equal spheres does not fit those of unlike ones: the fit takes seconds
    # and was of low quality at 15 of 21 waves
    equal = mass_spread(row.mass) < UNEQUAL
    return ChainWaves(
        tracks,
        {s: labels(tracks, run.t, run.v[:, s - 1], s) if equal else () for s in spheres},
        wall_contact(run.t, run.v, run.contact_force, row, tracks) if at_wall else None,
    )


def mass_spread(mass: Array) -> float:
    """Largest over least mass (n,) of the spheres between the first and the last one; these two may
    differ: one is the striker, and to the other one something may be fixed."""
    inner = mass[1:-1]
    return float(inner.max() / inner.min()) if inner.size else 1.0
