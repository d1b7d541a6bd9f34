"""The thesis' figures made again, on a coarse mesh: what each must show."""

from contextlib import nullcontext
from functools import cache

import numpy as np
import pytest

from beadwave.workflows.commands.app import main
from beadwave.workflows.evidence import catalogue
from beadwave.workflows.evidence.thesis.damping import DampingOptions, damping
from beadwave.workflows.evidence.thesis.energy import EnergyOptions, energy
from beadwave.workflows.evidence.thesis.schemes import SchemeOptions
from beadwave.workflows.evidence.thesis.singularity import SingularityOptions, singularity
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report import finding
from beadwave.workflows.scene import InvalidScene

from command_line import COARSE_RIG


def quiet(stage):
    return nullcontext()


SCHEMES = SchemeOptions(n_modes=20, error=1e-5)
STUDIES = {
    "singularity": (singularity, SingularityOptions(seeds=(4e-3, 2e-3))),
    "energy": (energy, EnergyOptions(duration=1e-3, finer=1.0, schemes=SCHEMES)),
    "damping": (damping, DampingOptions(duration=1e-3, schemes=SCHEMES)),
}


@cache
def study(name):
    function, options = STUDIES[name]
    return function(scene("rig-rom", COARSE_RIG), quiet, options)


def column(finding, name):
    return finding.tables[0].column(name)


@pytest.mark.slow
def test_a_node_sinks_in_like_1_over_h_and_the_structure_does_not_care():
    """Issue's bound for the node 1.8 per halving; for what the patch leaves 1 %, measured 1e-4."""
    sunk = study("singularity")
    assert all(growth > 1.8 for growth in column(sunk, "growth")[1:])
    for name in ("structure_by_patch", "structure_by_node"):
        own = column(sunk, name)
        assert np.ptp(own) < 1e-3 * np.mean(own)
    recovery = column(sunk, "recovery_points")
    assert recovery[-1] == pytest.approx(recovery[-2], rel=0.01)


@pytest.mark.slow
def test_only_the_scheme_of_the_thesis_makes_energy():
    made = study("energy")
    bump = dict(zip(column(made, "wall"), column(made, "bump"), strict=True))
    assert bump["half-space"] < 1e-9
    for wall in ("ROM half-space", "ROM assembly"):
        assert bump[f"{wall}, one functional"] < 1e-9
        assert bump[f"{wall}, thesis"] > 0.01
    missing = column(made, "missing_without_wall")
    assert missing[3] > 5 * missing[1] > 0  # the assembly takes more than a large block


@pytest.mark.slow
def test_the_rayleigh_damping_of_the_thesis_is_80_percent_at_51_hz():
    """references: 80 %, 15 %, 4.5 %, 0.53 %."""
    rows = dict(study("damping").tables[0].rows)
    ratios = [value for name, value in rows.items() if "Rayleigh" in name]
    np.testing.assert_allclose(ratios, [0.80, 0.15, 0.045, 0.0053], rtol=0.02)
    gains = [value for name, value in rows.items() if "largest gain" in name]
    assert gains[0] < 1e-9 and min(gains[1:]) > 0.01


@pytest.mark.slow
def test_a_study_writes_table_and_picture(tmp_path):
    sunk = study("singularity")
    finding.write(sunk, RunFolder(tmp_path))
    lines = (tmp_path / "singularity.csv").read_text().splitlines()
    assert len(lines) == 1 + len(sunk.tables[0].rows) and lines[0].startswith("seed_mm,")
    assert (tmp_path / "figures" / "study_singularity.png").stat().st_size > 10_000


def test_studies_are_listed_and_an_unknown_one_is_refused(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["beadwave", "study"])
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    assert all(name in capsys.readouterr().out for name in ("singularity",))
    with pytest.raises(InvalidScene, match="singularity"):
        catalogue.study("singular", scene("rig-rom", COARSE_RIG), quiet)
