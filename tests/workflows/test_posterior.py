"""A posterior beside the bars: in the table, the folder and a figure; told where it cannot be."""

import numpy as np
import pytest

import twin
from beadwave.workflows.commands import app as cli
from beadwave.workflows.files.record import csv_text
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.fit import nested
from beadwave.workflows.fit.calibrate import CalibrationRequest, calibrated, with_posterior
from beadwave.workflows.fit.folder import write_calibration
from beadwave.workflows.fit.posterior import SAMPLER, posterior
from beadwave.workflows.scene.toml import resolved
from beadwave.workflows.stages.chain.walls import wall_of

SETTING = twin.Twin(frequency=800.0, noise=1e-3, repeats=4, jitter=1e-6, before=2e-5, seed=3)


@pytest.fixture(scope="module")
def rig():
    return resolved(
        {
            "name": "small",
            "chain": {
                "count": 6, "radius": 0.0127, "density": 7800.0, "young": 210e9, "poisson": 0.3,
            },
            "striker": {"velocity": 0.31},
            "preload": {"force": 5.0},
            "wall": {"kind": "1dof", "frequency": 900.0, "mass": 0.5, "damping_ratio": 0.05},
            "time": {"duration": 1.2e-3},
            "output": {"spheres": [1, 4]},
        },
        "small",
    )  # fmt: skip


@pytest.fixture(scope="module")
def data(rig):
    return twin.measured(twin.clean(rig, wall_of(rig), SETTING, np.ones(6)), SETTING)


@pytest.fixture(scope="module")
def result(rig, data):
    request = CalibrationRequest(
        free="striker,wall.frequency", instrument=SETTING.instrument, starts=1
    )
    return calibrated(rig, wall_of(rig), data, "data.csv", request)


@pytest.mark.slow
def test_samples_of_a_chain_have_the_quantiles_of_its_bars(tmp_path, result):
    """Two parameters that the data determines to 1e-3 are nearly Gaussian; 1000 samples leave
    0.04 of two sigma."""
    pytest.importorskip("dynesty", reason="the posterior is optional (the extra `posterior`)")
    sampled = with_posterior(result._replace(report=result.report.model_copy(deep=True)), 0)
    for row in sampled.report.parameters:
        ends = np.array([row.found - row.quantiles[0], row.quantiles[2] - row.found])
        np.testing.assert_allclose(ends, row.two_sigma, rtol=0.16)
    assert "2.3 %" in sampled.report.text() and "effective samples" in sampled.report.remarks[-1]
    write_calibration(sampled, RunFolder(tmp_path))
    fixed = np.load(tmp_path / "posterior.npz")
    assert fixed["samples"].shape[1] == 2 and fixed["synthetic"]
    assert fixed["weights"].sum() == pytest.approx(1.0) and fixed["weights"].min() > 0.0
    assert (tmp_path / "figures" / "posterior.png").is_file()


def test_a_posterior_of_too_few_samples_is_told_and_not_shown(tmp_path, result, monkeypatch):
    pytest.importorskip("dynesty", reason="the posterior is optional (the extra `posterior`)")
    few = SAMPLER._replace(runs=300, drawn=50)
    monkeypatch.setitem(posterior.__kwdefaults__, "options", few)
    RunFolder(tmp_path).write("posterior.npz", b"of an earlier run")
    short = with_posterior(result._replace(report=result.report.model_copy(deep=True)), 0)
    report = short.report
    assert report.remarks[-1].startswith("The posterior is not shown: its samples are worth")
    assert "2.3 %" not in report.text()
    with RunFolder(tmp_path).renewed() as folder:
        write_calibration(short, folder)
    assert not (tmp_path / "posterior.npz").exists()


def test_without_the_sampler_the_command_says_how_to_install_it(
    tmp_path, data, monkeypatch, capsys
):
    (tmp_path / "data.csv").write_text(csv_text(data))
    monkeypatch.setattr(nested, "find_spec", lambda _: None)
    line = ["calibrate", "rig-1dof", str(tmp_path / "data.csv"), "--posterior"]
    monkeypatch.setattr("sys.argv", ["beadwave", *line])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2
    assert "./install.sh posterior adds it" in capsys.readouterr().err
