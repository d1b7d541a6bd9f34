"""A chain against half-spaces from rubber to diamond: contact time, and a second reflected wave.

You will see below which modulus of the wall a second wave comes back, and how long the contact
lasts. A soft wall holds the last sphere so long that it parts from the chain, and is then caught up
by it or catches up with it: a secondary wave. The thesis says that secondary waves appear above a
critical modulus; they appear below it.

Thesis, section 2.2.2, figure 2.8; J. Yang et al., Phys. Rev. E 83 (2011) 046606.

Run it: python examples/gallery/wall_modulus.py
"""

from pathlib import Path

import numpy as np

from beadwave import dem, scene
from beadwave.dem.spheres import time_scale
from beadwave.dem.waves.measures import exponent
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text, short
from beadwave.workflows.stages.chain.chain import initial_velocity
from observed import SPHERES, bare_chain, impact, last, observed, record, say

# E/(1 - nu^2) of the wall over that of a sphere, ascending
RATIOS = np.unique(
    np.concatenate([np.geomspace(3e-3, 30, 17), np.arange(0.25, 0.6, 0.02)]).round(4)
)
PUBLISHED = (0.39, 0.47)  # J. Yang et al. (2011): ratios between which the second wave fades out
FOLLOWED = 0.004  # of the largest wave: what is still followed; less than FADED
FADED = 0.005  # of the striker's speed: below it a second wave has faded out
SOFT = 0.5  # ratio below which a second wave is a soft wall's, just above PUBLISHED
VERY_SOFT = 0.1  # ratio below which the contact time is a power of the stiffness
DRAWN = (0.01, 0.1, 1.0, 10.0)  # ratios whose records are drawn, or the nearest


def main(ratios=RATIOS):
    """Second wave over the striker's speed, time [us] for which the last two spheres are apart, and
    contact time [us] at each wall; places of the two walls between which the wave fades out."""
    rig = scene("rig-rigid")
    v0, young = initial_velocity(rig), ratios * last(rig.chain.young)
    gpa, speed = 1e-9 * young, np.abs(v0).max()

    runs, second, apart_us = [], [], []
    for E in young:
        # until the wave is back at the striker: 2.6 natural times of a sphere in the chain, 12 of
        # the last one at the wall
        row = bare_chain(rig, dem.Flat(E, last(rig.chain.poisson)))
        in_chain = time_scale(row.mass[0], row.A[0], speed)
        at_wall = time_scale(row.mass[-1], row.A[-1], speed)
        duration = 2.6 * len(row.mass) * in_chain + 12 * at_wall
        march = impact(row, dem.rigid_wall(), v0, duration)
        run = observed(f"E = {short(1e-9 * float(E))} GPa", row, march, SPHERES, faint=FOLLOWED)
        runs.append(run)

        # largest velocity of the second reflected wave in any contact, over the striker's
        back = [track for track in run.tracks if (track.kind, track.number) == ("reflected", 2)]
        sizes = [abs(pulse.velocity) for track in back for pulse in track.pulses]
        second.append(max(sizes, default=0.0) / speed)

        # the last spheres do not touch while the wall is touched
        t, touch = march.t, run.contact.contact_time
        inside = (t > touch.start) & (t < touch.end)
        apart_us.append(1e6 * (march.contact_force[inside, -2] == 0.0).sum() * (t[1] - t[0]))
    second, apart_us = np.array(second), np.array(apart_us)
    seconds = np.array([run.contact.contact_time.seconds for run in runs])
    tau = np.array([run.contact.tau_c for run in runs])
    arr = [run.contact.arr for run in runs]

    # T_c ~ A^p where the wall alone decides; with one constant tau_c p would be -0.4
    very_soft = ratios < VERY_SOFT
    slope = exponent(np.array([run.chain.A[-1] for run in runs])[very_soft], seconds[very_soft])
    gone = fading(second)

    columns = (
        "E*_w/E*_s", "young_GPa", "contact_us", "tau_c", "arr", "second_over_striker", "apart_us",
    )  # fmt: skip
    rows = zip(
        *(np.asarray(x).tolist() for x in (ratios, gpa, 1e6 * seconds, tau, arr, second, apart_us)),
        strict=True,
    )
    print(aligned_text(columns, rows))
    if gone:
        say(f"""
            A second reflected wave of more than {100 * FADED:g} % of the striker's speed appears
            below a ratio of contact moduli, wall over sphere, of {ratios[gone[0]]:.3g} and is gone
            at {ratios[gone[1]]:.3g}: the critical Young's modulus of the wall is
            {gpa[gone[0]]:.0f} to {gpa[gone[1]]:.0f} GPa (published for 17 spheres: it fades out at
            ratios of {PUBLISHED[0]} to {PUBLISHED[1]}). Walls with a ratio above {SOFT} leave
            another, faint wave of at most {second[ratios > SOFT].max():.1%}, which arises in the
            chain.
            """)
    say(f"""
        The last sphere separates from the chain while it still touches the wall below a ratio of
        {ratios[apart_us > 0].max(initial=0.0):.3g}, which the thesis takes for the cause. Its
        condition, equal approach at the last two contacts, is a ratio of {1 / (2**1.5 - 1):.3f}.

        At soft walls the contact time goes with the stiffness of the wall's contact to the power
        {slope:.3f}, where equation 2.5 with one constant tau_c gives -0.4; tau_c is
        {tau.min():.3f} to {tau.max():.3f}, so it is no constant.
        """)

    modulus = "Young's modulus of the wall [GPa]"
    waves = [Line(None, gpa, second, "o-")]
    if gone:
        ends = np.array([0, 1.1 * second.max()])
        waves.append(Line("fades out", np.full(2, np.mean(gpa[gone])), ends, ":", 1))
    nearest = [int(np.abs(np.log(ratios / ratio)).argmin()) for ratio in DRAWN]
    title = f"sphere {SPHERES[-1]}: a soft wall reflects later, and twice"
    figure = [
        Panel("contact time (figure 2.8)", modulus, "contact time [µs]",
              [Line(None, gpa, 1e6 * seconds, "o-")], "xy"),
        Panel("dimensionless contact time", modulus, "tau_c [-]", [Line(None, gpa, tau, "o-")],
              "x"),
        Panel("second reflected wave (figure 2.8)", modulus, "velocity over the striker's", waves,
              "x"),
        record(title, [runs[i] for i in nearest], SPHERES[-1]),
    ]  # fmt: skip
    Path("wall_modulus.png").write_bytes(panels(figure, columns=2, size=(5.4, 3.2)))
    return second, apart_us, 1e6 * seconds, gone


def fading(second):
    """Places of two neighbouring walls, from the softest on, between which the second wave (k,) of
    a soft wall falls to FADED of the striker's speed; none if it does not. Of a stiff wall there is
    another wave, which the first may pass into."""
    falls = (second[:-1] > FADED) & (second[1:] <= FADED)
    return [int(falls.argmax()), int(falls.argmax()) + 1] if falls.any() else []


if __name__ == "__main__":
    main()
