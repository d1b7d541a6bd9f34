"""Waves of the shaken rig on a contact that slips, beside those on one that sticks.

You will see, for one thing of the scene changed at a time, how far the waves at the observed
spheres differ between the run as it is and the same run with a coefficient of friction so large
that the contact sticks; both start from their periodic state. A second table switches on what a
contact that sticks acts through, one mechanism after the other, without a shaker: it is compared
with a contact without any tangential force.

Run it: python examples/gallery/friction.py       42 periodic states: a quarter of an hour
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beadwave import dem, scene
from beadwave.coupling.continuation import (
    before_striker,
    cold_state,
    later,
    neighbouring_state,
    struck,
)
from beadwave.coupling.spatial_march import USUAL_SPATIAL_SEARCH, march_space, march_to_error
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.friction import ARRIVED
from observed import SPHERES, first_and_later, observed, say
from shaken_rig import shaken_rig, state_of, stuck_wall, uncoupled_wall

# what is varied, one thing at a time; the smallest coefficient is a greased contact, which slips as
# a whole at once
COEFFICIENTS = (0.001, 0.05, 0.1, 0.4)
PHASES = (45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)  # [degrees] later
FORCES, ARMS, PATCHES = (0.5, 2.0), (0.5, 2.0), (0.5, 0.0)  # factors; of a patch on its distance
STICKING = 2.0  # coefficient at which nothing slips in a cycle, and no one measures
STATE_ERROR = 3e-3  # of the periodic states
COARSER = 3.0  # times as large an error where none is found; the row states it
ERROR = 1e-4  # of the marches: a third of what the differences are judged by
N_CELLS = 64  # of the contact: 64, 128 and 256 left loops 4e-4 apart
N_SAVE = 3000
NOISE = 1e-3  # [m/s] rms of a laser vibrometer
TIMING = 1e-7  # [s] of its trigger


class Case(NamedTuple):
    """One row: what is varied, a scene, and how much later in the cycle the striker comes."""

    varied: str
    value: float
    scene: Scene
    turn: float = 0.0  # of a period


class Difference(NamedTuple):
    """Largest differences of two runs over the observed spheres."""

    arrival: float  # [s] of the first reflected wave
    amplitude: float  # [m/s] of its peak
    first: float  # [m/s] of the velocities until it has passed
    later: float  # [m/s] after it
    error: float  # [m/s] of both runs together


def cases(shaken, coefficients, phases, forces, arms, patches):
    """The scene, and one thing of it changed at a time."""
    (shaker,), (y, z) = shaken.shakers, shaken.strike.at
    yield Case("scene", shaken.friction.coefficient, shaken)
    for value in coefficients:
        yield Case("coefficient", value, shaken.but(friction={"coefficient": value}))
    for turn in phases:
        yield Case("phase [deg]", (shaker.phase + turn) % 360.0, shaken, turn / 360.0)
    for factor in forces:
        stronger = shaken.but(shakers=(shaker.but(force=factor * shaker.force),))
        yield Case("force [N]", factor * shaker.force, stronger)
    # another force in another place of the cycle, where all may slip as the wave comes
    most = max(forces, default=1.0) * shaker.force
    stronger = shaken.but(shakers=(shaker.but(force=most),))
    for turn in phases[1::2]:
        phase = (shaker.phase + turn) % 360.0
        yield Case(f"phase [deg] at {most:g} N", phase, stronger, turn / 360.0)
    for factor in arms:
        stiffness = factor * shaken.arm.stiffness
        yield Case("arm [MN/m]", 1e-6 * stiffness, shaken.but(arm={"stiffness": stiffness}))
    for factor in patches:
        moved = shaken.but(patch={"point": (factor * y, factor * z)})
        yield Case("patch [mm]", 1e3 * factor * y, moved)


def shaken_run(case, rig, coefficient, states):
    """The waves of a case with this coefficient and their error [m/s]; of its contact the state in
    the cycle before the striker, the share that sticks and the shaker's phase [degrees] as the wave
    arrives, and the loop of a period [uJ].

    Its periodic state is looked for from rest, that of a contact that sticks from the last one
    found, and kept in `states`.
    """
    body, v0 = rig.body(coefficient, N_CELLS), rig.start.velocity
    before = before_striker(body, v0, upstream_held=case.scene.friction.upstream == "held")
    fastest = float(np.abs(v0).max())
    shakers = [(s.frequency, s.force, s.phase) for s in case.scene.shakers]
    key = repr((coefficient, shakers, case.scene.arm, case.scene.strike))
    modes = f"{rig.wall.omega.size} modes"
    if key not in states:
        near = states.get(f"{coefficient:g} with {modes}", states.get(modes))
        wanted = {"error": STATE_ERROR, "speed": fastest}
        try:
            # a contact that sticks is nearly linear: another one's state is near
            if near is None or coefficient < STICKING:
                states[key] = cold_state(body, before, **wanted)
            else:
                states[key] = neighbouring_state(body, before, near, **wanted)
        except dem.UnstableStep:
            coarser = COARSER * STATE_ERROR
            states[key] = cold_state(body, before, error=coarser, speed=fastest)
        states[f"{coefficient:g} with {modes}"] = states[modes] = states[key]
    state = states[key]

    # from the state as it is when the striker comes, a part of a period later
    body, moving = later(body, before, state, case.turn)
    struck(moving, before, v0)
    run = march_to_error(
        body, moving, duration=case.scene.time.duration, error=ERROR, n_save=N_SAVE, speed=fastest
    )

    # the contact when the wave arrives, by the first rise of its force
    force = run.trajectory.contact_force[:, -1]
    rise = np.abs(force - force[0])
    at = int((rise >= ARRIVED * rise.max()).argmax())
    turned = 360.0 * shakers[0][0] * float(run.trajectory.t[at])
    phase = (turned + float(np.degrees(body.shakers.phase[0]))) % 360.0
    name = f"{case.varied} {case.value:g}"
    waves = observed(name, rig.start.chain, run.trajectory, SPHERES)
    error = fastest * run.trajectory.error_estimate + state.speed * state.error
    sticks = float(run.lateral.stick_share[at])
    return (waves, error), (state_of(state.stick), sticks, phase, 1e6 * state.energy)


def between(one, other):
    """Differences of the waves of two runs at the same instants, each given with its error."""
    (a, error_a), (b, error_b), arrival, amplitude = one, other, 0.0, 0.0
    for sphere in SPHERES:
        waves = [run.wave(sphere, "reflected", 1) for run in (a, b)]
        if all(waves):
            (t1, v1, *_), (t2, v2, *_) = (wave.arrival for wave in waves)
            arrival, amplitude = max(arrival, abs(t2 - t1)), max(amplitude, abs(v2 - v1))
    first, after = first_and_later(a, b)
    return Difference(arrival, amplitude, first, float(after.max()), error_a + error_b)


def mechanisms(rig, duration, coefficient):
    """By what is switched on: differences that a contact that sticks makes in the waves beside one
    without tangential force, without shakers."""
    # the last sphere clamped across; free to yield on its arm; free to turn
    v0, chain = rig.start.velocity, rig.start.chain
    clamped = rig.last._replace(arm_stiffness=np.full(2, np.inf), arm_rotation=np.inf)
    sprung = rig.last._replace(arm_rotation=np.inf)
    turning = clamped._replace(arm_rotation=0.0)
    search = USUAL_SPATIAL_SEARCH._replace(n_cells=N_CELLS)

    def run(wall, last, mu=STICKING):
        """The impact on another wall, with another last sphere and coefficient."""
        march = march_space(
            chain, wall, v0, rig._replace(last=last).last_with(mu), duration=duration, error=ERROR,
            n_save=N_SAVE, search=search,
        )  # fmt: skip
        error = float(np.abs(v0).max()) * march.trajectory.error_estimate
        return observed("", chain, march.trajectory, SPHERES), error

    # a contact that sticks and does not grow is a spring k_t, here a part of the structure
    k_t = rig.contact_stiffness()
    none = run(stuck_wall(rig.wall, 0.0, clamped, chain), clamped)
    runs = {
        "all but the structure's coupling": run(uncoupled_wall(rig.wall), rig.last),
        "coupling alone": run(stuck_wall(rig.wall, k_t, clamped, chain), clamped),
        "coupling, area that grows": run(rig.wall, clamped),
        "coupling, arm that yields": run(stuck_wall(rig.wall, k_t, sprung, chain), clamped),
        "coupling, sphere that turns": run(stuck_wall(rig.wall, k_t, turning, chain), clamped),
        "all of these": run(rig.wall, rig.last),
        "all of these, and slip": run(rig.wall, rig.last, coefficient),
    }
    return {name: between(none, each) for name, each in runs.items()}


def main(
    coefficients=COEFFICIENTS, phases=PHASES, forces=FORCES, arms=ARMS, patches=PATCHES, changes=()
):
    """States of the contact in the cycle and differences of the waves, by row; differences by
    mechanism."""
    shaken = scene("rig-shaker", changes)
    states, rows, compared = {}, [], []
    for case in cases(shaken, coefficients, phases, forces, arms, patches):
        rig = shaken_rig(case.scene)
        mu = case.scene.friction.coefficient
        try:
            slips, contact = shaken_run(case, rig, mu, states)
            stuck, _ = shaken_run(case, rig, STICKING, states)
        except dem.UnstableStep:
            print(f"No periodic state was found for {case.varied} {case.value:g}, left out.")
            continue
        change = between(stuck, slips)
        compared.append((contact[0], change, slips[0], stuck[0]))
        mm_s = [1e3 * value for value in change[1:]]
        rows.append((case.varied, case.value, *contact, 1e6 * change.arrival, *mm_s))
    rig = shaken_rig(shaken)
    by_mechanism = mechanisms(rig, shaken.time.duration, shaken.friction.coefficient)

    columns = (
        "varied", "value", "cycle", "sticks", "at_wall_deg", "loop_uJ", "arrival_us",
        "amplitude_mm_s", "first_mm_s", "later_mm_s", "error_mm_s",
    )  # fmt: skip
    print(aligned_text(columns, rows))
    say(f"""
        Every row is compared with the same run on a contact that sticks (coefficient {STICKING:g}):
        the largest differences at the observed spheres, beside the error of both runs, of a striker
        of {1e3 * np.abs(rig.start.velocity).max():.0f} mm/s. `cycle` is the contact's state in a
        period of the shaker, `sticks` the share of its area that sticks as the wave arrives: a wave
        presses the contact, and what it presses together sticks at first.
        """)
    for state in dict.fromkeys(state for state, *_ in compared):
        arrival, amplitude, _, after, error = np.transpose(
            [change for name, change, *_ in compared if name == state]
        )
        say(f"""
            A contact in {state}: the first reflected wave comes {1e6 * arrival.min():.3f} to
            {1e6 * arrival.max():.3f} µs earlier or later and changes by {1e3 * amplitude.min():.2f}
            to {1e3 * amplitude.max():.2f} mm/s, the waves after it by {1e3 * after.min():.1f} to
            {1e3 * after.max():.1f} mm/s; the error is {1e3 * error.min():.2f} to
            {1e3 * error.max():.2f} mm/s. A vibrometer with {1e6 * TIMING:g} µs and {1e3 * NOISE:g}
            mm/s sees the arrival in {(arrival > TIMING).sum()} of {len(arrival)} rows, and the
            later waves (three times its noise, in one record) in
            {(after > 3 * NOISE + error).sum()}.
            """)
    of_mechanism = [
        (name, 1e3 * change.first, 1e3 * change.later, 1e3 * change.error)
        for name, change in by_mechanism.items()
    ]
    columns = ("switched_on", "first_mm_s", "later_mm_s", "error_mm_s")
    print("\n" + aligned_text(columns, of_mechanism))
    say("""
        Mechanisms, without shaker: a contact that sticks is compared with one without any
        tangential force. Without the structure's coupling of directions hardly more than the
        numerical error is left: the coupling carries the effect. `beadwave design` says how well a
        single record determines the coefficient.
        """)

    # what slip changes at each sphere over time, for the largest difference of each state
    largest = {}
    for state, change, slips, stuck in compared:
        size = max(change.first, change.later)
        if state not in largest or size > largest[state][0]:
            largest[state] = (size, slips, stuck)
    figure = []
    for sphere in SPHERES:
        lines = [
            Line(f"{state}: {slips.name}", slips.milliseconds,
                 1e3 * (slips.velocity(sphere) - stuck.velocity(sphere)), "-", i, 1.0)
            for i, (state, (_, slips, stuck)) in enumerate(largest.items())
        ]  # fmt: skip
        legend = "above" if sphere == SPHERES[0] else "inside"
        label = "with slip less stuck [mm/s]"
        figure.append(Panel(f"sphere {sphere}", "time [ms]", label, lines, legend=legend))
    Path("friction.png").write_bytes(panels(figure, size=(8, 2.6)))
    return [state for state, *_ in compared], [change for _, change, *_ in compared], by_mechanism


if __name__ == "__main__":
    main(changes=sys.argv[1:])
