"""Verdicts: what is accurate, refused, flagged and failed, and runs that say where they end."""

import json
import re
import sys
from functools import partial

import numpy as np
import pytest

from beadwave import coupling, dem
from beadwave.coupling.verdict import large_step_error
from beadwave.workflows.commands.app import main
from beadwave.workflows.evidence import groups
from beadwave.workflows.evidence.harness import Outcome, Trial, judged
from beadwave.workflows.evidence.stability import shaken as stability_shaken
from beadwave.workflows.evidence.stability import steps as stability_steps
from beadwave.workflows.evidence.stability.chains import spheres_of, striker_velocity
from beadwave.workflows.evidence.stability.trials import settled

QUICK = sorted(
    {*groups.names("stability")} - {"joint-stiffness", "rayleigh-damping", "drift", "unlike-radii"}
)
SLOW = {"pressed-faces", "shaken-friction", "shaken-phase", "shaken-preload", "shaken-separation"}
HEAVY = ("100000", "x 100", "mass x 1e-06", "1e+06")


def trials_of(case):
    return groups.chosen("stability", (case,))[case]()


def run_of(outcome):
    """The verdict on an outcome, or on the error raised instead."""

    def run():
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    return judged(Trial(1.0, run))


@pytest.mark.parametrize(
    ("outcome", "verdict"),
    [
        (Outcome(1e-5, 1e-4), "accurate"),
        (Outcome(1e-5, 1e-4, ("outside",)), "flagged"),
        (Outcome(1e-3, 1e-4), "failed"),
        (Outcome(1e-3, 1e-4, ("outside",)), "failed"),
        (Outcome(np.nan, 1e-4), "failed"),
        (dem.UnstableStep("take less"), "refused"),
        (ZeroDivisionError("division by zero"), "failed"),
    ],
)
def test_verdict(outcome, verdict):
    assert run_of(outcome).verdict == verdict


def test_sentence_of_a_refusal_is_the_engines():
    assert run_of(dem.UnstableStep("take less")).source == "take less"


@pytest.mark.parametrize(
    ("case", "every"),
    [
        *(pytest.param(case, 1, marks=[pytest.mark.slow] * (case in SLOW)) for case in QUICK),
        ("shaken-friction", 4),  # of trials of a second
    ],
)
def test_no_case_fails(case, every):
    trials = [t for t in trials_of(case) if not str(t.parameter).endswith(HEAVY)][::every]
    rows = [judged(trial) for trial in trials]
    assert rows and not [row for row in rows if row.verdict == "failed"]
    assert all(row.source for row in rows if row.verdict != "accurate")


def test_a_light_wall_is_judged_by_a_march_that_its_contacts_bear():
    """A quarter of the run's step is beyond the stability that `march` asks for there."""
    (light,) = [t for t in trials_of("one-dof-wall") if t.parameter == "1000 Hz, mass x 1e-06"]
    assert judged(light).verdict == "accurate"


@pytest.mark.slow
def test_a_periodic_state_that_shorter_steps_do_not_improve_is_refused_early():
    """From 1024 steps a period on: at 65536 without that rule, many times as long."""
    touching = partial(stability_shaken.outcome, load=0.0, force=0.4, frequency=700.0)
    row = judged(Trial("0 N, 700 Hz", touching))
    assert row.verdict == "refused" and "shorter steps do not help" in row.source
    assert int(re.search(r"at (\d+) steps", row.source)[1]) < 20_000


@pytest.mark.slow
def test_a_sphere_that_flies_between_touches_is_in_no_periodic_state():
    """Without preload or damper it leaves the shaken wall for several periods, during which no
    force changes: taken for periodic, that left 4.6 % of the striker's speed open."""
    (resonant,) = [t for t in trials_of("shaken-preload") if t.parameter == "0 N, resonance"]
    row = judged(resonant)
    assert row.verdict == "refused" and "no periodic state" in row.source


def test_a_million_steps_do_not_drift():
    outcome = stability_steps.energy_drift("verlet", 1e-3, 1_000_000)
    assert outcome.value < 1e-5


def test_cases_that_must_be_accurate_are_not_refused():
    trials = [t for case in ("striker-speed", "spheres", "young") for t in trials_of(case)]
    verdicts = {judged(trial).verdict for trial in trials if trial.parameter != 100_000}
    assert verdicts == {"accurate", "flagged"}


def test_strain_is_that_of_one_hertz_contact():
    # K. L. Johnson, Contact Mechanics (1985), eqs. 4.22 and 4.24, steel on steel flat
    chain = dem.row_of_spheres(0.01, 7800.0, 210e9, 0.3, count=1, flat=dem.Flat(210e9, 0.3))
    strain = dem.strain(chain, 210e9, np.array([[0.0], [100.0]]), np.array([[0.5], [-2.0]]))
    E_star = 210e9 / (2 * (1 - 0.09))
    a = (3 * 100.0 * 0.01 / (4 * E_star)) ** (1 / 3)
    assert strain.radius_ratio == pytest.approx(a / 0.01)
    assert strain.pressure == pytest.approx(1.5 * 100.0 / (np.pi * a**2))
    assert strain.yield_pressure == pytest.approx(1.6 * 2.1e9)
    assert strain.speed_ratio == pytest.approx(2.0 / (210e9 / 7800.0) ** 0.5)
    assert dem.outside(strain) == ()


def test_a_run_outside_of_its_model_says_so():
    fast = settled(spheres_of(), dem.rigid_wall(), striker_velocity(speed=100.0), 3e-4)
    assert len(fast.warnings) == 3
    assert not settled(spheres_of(), dem.rigid_wall(), striker_velocity(speed=0.1), 1e-3).warnings


def test_a_free_pair_that_never_touches_is_not_strained():
    chain = spheres_of(count=1, flat=None)
    strain = dem.strain(chain, 210e9, np.zeros((2, 0)), np.zeros((2, 1)))
    assert dem.outside(strain) == ()


def test_yielding_contacts_are_not_warned_of_pressure():
    chain = spheres_of(count=2)
    force, v = np.full((1, 2), 1e4), np.zeros((1, 2))
    assert dem.outside(dem.strain(chain, 210e9, force, v))
    plastic = chain._replace(yield_overlap=np.full(2, 2e-5))
    assert not dem.outside(dem.strain(plastic, 210e9, force, v))


@pytest.mark.parametrize("scheme", ["verlet", "rkn6", "energy2"])
def test_a_given_step_knows_its_error(scheme):
    chain, wall, v0 = spheres_of(), dem.rigid_wall(), striker_velocity()
    exact = dem.march(chain, wall, v0, duration=1e-3, dt=1e-7, scheme="rkn6", n_save=50)
    for dt in (1e-6, 5e-6):
        run = coupling.impact(chain, wall, v0, duration=1e-3, dt=dt, scheme=scheme, n_save=50)
        off = np.abs(run.trajectory.v - exact.v).max() / v0.max()
        assert 0.5 * off < run.trajectory.error_estimate < 5 * off


def test_a_continued_run_knows_its_error_too():
    chain, wall, options = spheres_of(), dem.rigid_wall(), {"dt": 2e-6, "scheme": "rkn6"}
    first = dem.march(chain, wall, striker_velocity(), duration=5e-4, **options)
    run = coupling.impact(
        chain, wall, striker_velocity(), duration=5e-4, state=first.final, **options
    )
    assert 0.0 < run.trajectory.error_estimate < 1e-4


def test_a_rough_step_is_warned_of():
    assert "0.2" in next(large_step_error(0.2))
    assert not [*large_step_error(1e-3), *large_step_error(None)]


def test_energy_beyond_floating_point_is_refused():
    with pytest.raises(dem.InvalidChain, match="kinetic energy"):
        dem.march(
            spheres_of(), dem.rigid_wall(), striker_velocity(speed=1e200), duration=1.0, dt=0.1
        )


def test_command_prints_verdicts_for_machines(capsys, monkeypatch, tmp_path):
    command = ["beadwave", "stability", "--case", "radius", "--json", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["parameter"] for row in rows] == pytest.approx(10.0 ** np.arange(-6, 1))
    assert {row["verdict"] for row in rows} == {"accurate"}
    assert len((tmp_path / "stability.csv").read_text().splitlines()) == 8


def test_unknown_case_is_bad_input(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["beadwave", "stability", "--case", "radii"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "radius" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stiffness", "changes"),
    [(1e14, ()), (0.0, ("preload.force=0.0", 'reduction.kind="free-modes"'))],
)
def test_stiff_and_floating_assemblies_are_marched_right(stiffness, changes):
    from beadwave.workflows.evidence.stability.assembly import on_joints

    outcome = on_joints(stiffness, *changes)
    assert outcome.value < outcome.allowed
