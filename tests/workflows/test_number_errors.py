"""Errors of a run's single numbers, from pairs of runs whose walls differ."""

from contextlib import nullcontext

import numpy as np
import pytest

from beadwave.dem.waves.chain_waves import chain_waves
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.errors.number_errors import (
    MarchedPair,
    during_largest_collision,
    numbers_with_errors,
)


@pytest.fixture(scope="module")
def rebound():
    """A chain before a wall that a mass on a spring makes, its impact and waves."""
    run = pipeline_of(scene("rig-1dof"), lambda name: nullcontext())
    return run.scene, run("start"), run("impact"), run("waves")


def errors(rebound, changed, key="mesh"):
    case, start, impact, waves = rebound
    pairs = {key: [MarchedPair(impact.trajectory, changed, 1.0)]}
    rows = numbers_with_errors(case, start, impact, waves, pairs)
    return {row.name: getattr(row, key) for row in rows}


def scaled_force(run, mask, factor):
    """The run with the wall's force times `factor` at these instants."""
    force = run.contact_force.copy()
    force[mask, -1] *= factor
    return run._replace(contact_force=force)


def test_what_differs_behind_the_largest_collision_is_no_error_of_it(rebound):
    run, waves = rebound[2].trajectory, rebound[3]
    during = during_largest_collision(run, waves)
    contact = waves.contact.contact_time
    assert run.t[during].min() < contact.start < contact.end < run.t[during].max()
    assert run.t[during].max() < contact.end + 0.51 * contact.seconds
    later = errors(rebound, scaled_force(run, run.t > run.t[during].max(), 0.5))
    for name in ("peak_wall_force_N", "contact_time_s", "tof_s", "arr_2_9"):
        assert later[name] == 0.0
    # a peak of 2 % more is an error of 2 %, and 8 % of the change besides
    within = errors(rebound, scaled_force(run, during, 1.02))
    peak = float(run.contact_force[:, -1].max())
    assert within["peak_wall_force_N"] == pytest.approx((0.02 + 0.08 * 0.02) * peak, rel=1e-6)
    assert within["contact_time_s"] >= 0.1 * 0.02 * 5 * contact.seconds * (1 - 1e-9)


def test_an_amplitude_ratio_is_as_wrong_as_a_fifth_of_what_its_collision_changes_by(rebound):
    """Its two waves may change alike: here they stay, and the wall's force is 2 % larger."""
    run, waves = rebound[2].trajectory, rebound[3]
    within = errors(rebound, scaled_force(run, during_largest_collision(run, waves), 1.02))
    assert within["arr_2_9"] >= 0.2 * 0.02 * waves.contact.arr * (1 - 1e-9)


def test_a_time_of_flight_is_as_wrong_as_contact_and_travelling_time_together(rebound):
    """The collision lasts 2 % longer, the waves come back faster by as much: the time of flight
    stays, and neither of the two is known any better for it."""
    case, start, impact, waves = rebound
    run, contact = impact.trajectory, waves.contact
    n = len(start.chain.mass)
    longer = 0.02 * contact.contact_time.seconds
    back = longer / (2 * np.sum(start.chain.radius) / contact.speed_back)
    force = run.contact_force.copy()
    onset, opened = contact.contact_time.start, contact.contact_time.end
    force[:, -1] = np.interp(onset + (run.t - onset) / 1.02, run.t, force[:, -1])
    later = run.t > opened
    for i in range(n - 1):
        faster = opened + (run.t[later] - opened) / (1 - back)
        force[later, i] = np.interp(faster, run.t, run.contact_force[:, i])
    changed = run._replace(contact_force=force)

    read = chain_waves(changed, start.chain, case.output.spheres, at_wall=True).contact
    of_contact = abs(read.contact_time.seconds - contact.contact_time.seconds)
    on_the_way = abs(read.travelling_time - contact.travelling_time)
    assert of_contact == pytest.approx(longer, rel=0.05)
    assert on_the_way == pytest.approx(longer, rel=0.3)
    assert abs(read.tof - contact.tof) < 0.3 * longer
    assert errors(rebound, changed)["tof_s"] > of_contact + on_the_way
