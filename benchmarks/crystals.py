"""Seconds of a contact-step of crystals: over their size, beside LAMMPS and beside the chain.

You will see, for hexagonal packings from some hundred contacts to a hundred thousand, the seconds
of one step of one contact in the march in space, without friction and with friction, spin and
ledger; for each size the same packing in LAMMPS (package GRANULAR: Hertz, mindlin with history,
sphere integration), both in one thread, where it is installed; the power of the cost in the
contacts; a chain in its own engine; and, of the largest packing, seconds of the clock by one thread
over those by one on each core, which tell something where nothing else works on the machine.

    cost = c contacts^p

A packing is pressed by some micrometres, so that all contacts are closed, and its first row is
struck; both programs march it by velocity Verlet with the same step, in seconds of the processor
after a first run that compiles and builds lists.

Run it: python benchmarks/crystals.py [LARGEST]        contacts, 1e5 by default, a minute
"""

import sys
from importlib.util import find_spec
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.dem import space
from beadwave.workflows.report.tables import aligned_text

from programs import lammps

R, RHO, E, NU, MU = 6e-3, 7800.0, 210e9, 0.3, 0.2
SPEED, DT, STEPS = 0.3, 2e-7, 400
SPACING = 2 * R * (1.0 - 1e-4)  # m
REPEATS = 3  # of which the quickest counts: other work of the machine only adds
marching = sys.modules[space.march.__module__]


class Cost(NamedTuple):
    """Seconds of a step of one contact."""

    contacts: int
    smooth: float
    rubbing: float
    lammps: float | None  # with friction


def packing(columns: int, rows: int, friction: float) -> tuple[space.Packing, np.ndarray]:
    """A hexagonal packing before a rigid wall and the velocities (s, 3) of its first row."""
    lattice = space.lattice("hexagonal", (columns, rows))
    pairs, arm = space.touching(lattice.centre, lattice.period, 1.0 + space.CLOSE)
    last = np.flatnonzero(lattice.place[:, 1] == rows - 1)
    wall = space.Plane(last, np.array([0.0, 1.0, 0.0]), np.zeros(last.size), E, NU)
    found = space.packing_of(
        SPACING * lattice.centre, R, RHO, E, NU, pairs=pairs, arm=SPACING * arm, planes=[wall]
    )
    v0 = np.zeros((columns * rows, 3))
    v0[lattice.place[:, 1] == 0, 1] = SPEED
    if friction:
        found = found._replace(friction=np.full(len(found.A), friction))
    return found, v0


def quickest(run, clock=process_time) -> float:
    """[s] of the quickest of some calls, after a first one."""
    run(1)
    times = []
    for _ in range(REPEATS):
        started = clock()
        run(STEPS)
        times.append(clock() - started)
    return min(times)


def of_space(columns: int, rows: int, friction: float, threads: int = 1, **clock) -> float:
    """[s] of a contact-step in space, by Verlet."""
    found, v0 = packing(columns, rows, friction)
    marching.LEAST_SHARE = len(found.A) // threads

    def run(steps):
        space.march(
            found, None, v0, duration=steps * DT, dt=DT, n_save=1, saved=[0], scheme="verlet"
        )

    return quickest(run, **clock) / STEPS / len(found.A)


def of_lammps(columns: int, rows: int) -> float:
    """[s] of a contact-step of the same packing in LAMMPS, with friction and history."""
    found, v0 = packing(columns, rows, MU)
    x, law = found.rest, f"mindlin NULL 0.0 {MU!r}"
    sphere = lammps.LammpsSpheres(R, RHO, E, NU)
    engine = lammps.packing(x, v0, sphere, law, DT)
    try:
        wall = f"yplane NULL {float(x[:, 1].max()) + R!r}"
        contact = lammps.contact_of(sphere, law)
        engine.command(f"fix wall all wall/gran granular {contact} {wall}")
        seconds = quickest(lambda steps: engine.command(f"run {steps} post no"))
    finally:
        engine.close()
    return seconds / STEPS / len(found.A)


def of_chain(n: int = 1000) -> float:
    """[s] of a contact-step of a chain in its own engine, by Verlet."""
    row = dem.row_of_spheres(R, RHO, E, NU, count=n)
    v0 = SPEED * np.eye(n)[0]

    def run(steps):
        dem.march(row, dem.rigid_wall(), v0, duration=steps * DT, dt=DT, n_save=1, scheme="verlet")

    return quickest(run) / STEPS / n


def main(largest: float = 1e5) -> list[Cost]:
    """Print the table; returns its rows."""
    found = []
    for contacts in (3e2, 3e3, 3e4, 1e5):
        if contacts > largest:
            continue
        columns = rows = round(np.sqrt(contacts / 3.0))
        n = len(packing(columns, rows, 0.0)[0].A)
        peer = of_lammps(columns, rows) if find_spec("lammps") else None
        smooth, rubbing = of_space(columns, rows, 0.0), of_space(columns, rows, MU)
        found.append(Cost(n, smooth, rubbing, peer))
    header = ("contacts", "smooth [ns]", "friction [ns]", "LAMMPS [ns]", "LAMMPS over ours")
    rows = [
        (
            c.contacts, f"{1e9 * c.smooth:.1f}", f"{1e9 * c.rubbing:.1f}",
            None if c.lammps is None else f"{1e9 * c.lammps:.1f}",
            None if c.lammps is None else f"{c.lammps / c.rubbing:.2f}",
        )
        for c in found
    ]  # fmt: skip
    print(aligned_text(header, rows))
    if len(found) > 1:
        x = np.log([c.contacts for c in found])
        for name in ("smooth", "rubbing"):
            y = np.log([c.contacts * getattr(c, name) for c in found])
            print(f"cost of a step, {name}: contacts^{np.polyfit(x, y, 1)[0]:.2f}")
    columns = round(np.sqrt(found[-1].contacts / 3.0))
    one, all_cores = (
        of_space(columns, columns, MU, threads, clock=perf_counter)
        for threads in (1, marching.MOST_WORKERS)
    )
    print(f"threads on all cores, friction: {one / all_cores:.2f} times as quick as one")
    print(f"chain of 1000 in its own engine: {1e9 * of_chain():.1f} ns a contact-step")
    return found


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
