"""Errors of a run's single numbers, from pairs of runs whose walls differ."""

from contextlib import nullcontext

import pytest

from workflows.files.scene import scene
from workflows.stages.number_errors import (
    MarchedPair,
    during_largest_collision,
    numbers_with_errors,
)
from workflows.stages.pipeline import pipeline_of


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
    assert later["peak_wall_force_N"] == later["contact_time_s"] == 0.0
    # a peak of 2 % more is an error of 2 %, and a tenth of the change besides
    within = errors(rebound, scaled_force(run, during, 1.02))
    peak = float(run.contact_force[:, -1].max())
    assert within["peak_wall_force_N"] == pytest.approx((0.02 + 0.1 * 0.02) * peak, rel=1e-6)
    assert within["contact_time_s"] >= 0.1 * 0.02 * 5 * contact.seconds * (1 - 1e-9)
