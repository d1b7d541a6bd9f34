"""Posteriors of joints on a tuning basis, beside integrals over a grid."""

import numpy as np
import pytest

pytest.importorskip("dynesty")

from beadwave.fem.modes.mac import Number
from beadwave.fem.updating.tuning import TuningBasis, TuningParameter
from beadwave.workflows.files.scene import scene
from beadwave.workflows.fit.joints_posterior import (
    PosteriorOptions,
    joints_posterior,
    matched_hz,
    posterior_of,
)
from beadwave.workflows.fit.nested import NestedOptions, log_normal, quantiles
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.structure.api import with_modes
from beadwave.workflows.structure.parameters import with_values

from command_line import beadwave
from known_models import PADS

STOREY = 29.7e6  # [N/m]
FRAME = [
    TuningParameter(f"frame.{name}", (f"frame.{name}",), STOREY, 1e5, 1e9, before=(STOREY,))
    for name in ("k1", "k2")
]


def frame():
    """Two storeys of 16.5 t and 16.1 t on two springs, M = I."""
    elongation = np.array([[1.0, 0.0], [-1.0, 1.0]]) / np.sqrt([16.5e3, 16.1e3])
    springs = tuple(p.name for p in FRAME)
    numbers = Number(1), Number(2)
    return TuningBasis(np.zeros((2, 2)), np.eye(2), elongation, springs, np.zeros(2), {}, numbers)


@pytest.mark.slow
def test_a_frame_of_two_storeys_has_the_lobes_that_an_integral_over_a_grid_has():
    """J. L. Beck, S.-K. Au, J. Eng. Mech. 128 (2002) 380: masses 0.572 and 0.428 near
    (0.493, 0.906) and (1.831, 0.244); ln f with a deviation of 1/32 is f^2 with one of 1/16."""
    measured, basis = {1: 3.13, 2: 9.83}, frame()
    options = PosteriorOptions(
        frequency_error=1 / 32, least_error=1e-7, largest_error=1e-6,
        sampler=NestedOptions(live=300, walk="rwalk", drawn=8192),
    )  # fmt: skip
    modes_of_priors = (1.3, 0.8)
    priors = [
        log_normal(p.name, mode * STOREY, 1.0, 0.005 * STOREY, 4 * STOREY)
        for p, mode in zip(FRAME, modes_of_priors, strict=True)
    ]
    found = joints_posterior(basis, FRAME, measured, seed=3, priors=priors, options=options)

    # exact frequencies of two storeys, and the product of likelihood and prior on a grid of ln t
    x = np.linspace(np.log(0.005), np.log(4), 1500)
    t1, t2 = np.exp(np.meshgrid(x, x, indexing="ij"))
    k1, k2, m1, m2 = t1 * STOREY, t2 * STOREY, 16.5e3, 16.1e3
    mean, product = ((k1 + k2) / m1 + k2 / m2) / 2, k1 * k2 / (m1 * m2)
    root = np.sqrt(mean**2 - product)
    f1, f2 = (np.sqrt(w2) / (2 * np.pi) for w2 in (product / (mean + root), mean + root))
    # a log-normal prior of this mode, over ln t: exp(-(ln t - ln mode - 1)^2 / 2)
    density = np.exp(-0.5 * ((32 * np.log(f1 / 3.13)) ** 2 + (32 * np.log(f2 / 9.83)) ** 2))
    for t, mode in ((t1, 1.3), (t2, 0.8)):
        density = density * np.exp(-0.5 * (np.log(t / mode) - 1) ** 2)
    first = t1 < 2 * t2  # a valley lies between the lobes
    share = density[first].sum() / density.sum()

    assert len(found.lobes) == 2
    assert found.lobes[0].mass == pytest.approx(share, abs=0.02)
    assert share == pytest.approx(0.572, abs=0.02)
    for lobe, inside, near in zip(
        found.lobes, (first, ~first), ((0.493, 0.906), (1.831, 0.244)), strict=True
    ):
        for j, t in enumerate((t1, t2)):
            exact = (density * t)[inside].sum() / density[inside].sum()
            assert lobe.mean[j] / STOREY == pytest.approx(exact, rel=0.02)
            assert exact == pytest.approx(near[j], rel=0.05)
    np.testing.assert_allclose(
        matched_hz(basis, FRAME, [0, 1], found.lobes[0].best[:2]), [3.13, 9.83], rtol=0.03
    )


@pytest.fixture(scope="module")
def pads(tmp_path_factory):
    path = tmp_path_factory.mktemp("pads") / "pads.toml"
    path.write_text(PADS)
    return path


@pytest.mark.slow
def test_a_posterior_holds_the_stiffnesses_that_made_the_frequencies_and_names_what_is_open(
    pads, shared_cache
):
    true = {"joints.pads.kz": 1.3e7, "joints.pads.krx": 420.0}
    hz = pipeline_of(with_values(scene(pads), true), quiet)("modes").omega[:4] / (2 * np.pi)
    chosen, wanted, _ = with_modes(pads, (), None, dict(enumerate(hz.tolist(), 1)), quiet)
    options = PosteriorOptions(sampler=NestedOptions(live=60, walk="rwalk", drawn=2048))
    free = (*true, "masses.sensor.mass")
    bounds = "joints.pads.kz=3e6:5e7,joints.pads.krx=50:5e3,masses.sensor.mass=0.98:1.02"
    report = posterior_of(
        chosen, wanted, free, quiet, seed=1, bounds=bounds, options=options
    ).report
    rows = {row.name: row for row in report.parameters}
    for name, value in true.items():
        row = rows[name]
        assert row.low < value < row.high and row.high / row.low < 1.05 and row.says == "value"
    # a mass of 20 g that is known to 2 % moves no mode by 0.1 %
    assert rows["masses.sensor.mass"].says == "nothing"
    assert "masses.sensor.mass is not determined by these modes." in report.remarks
    # the model is exact here: of its error two spare modes of 0.1 % know an upper end
    assert rows["model error"].high < 0.01 and rows["model error"].says == "upper bound"
    assert len(report.lobes) == 1 and report.lobes[0].mass == pytest.approx(1.0)
    for n, f in report.lobes[0].modes_hz.items():
        assert f == pytest.approx(hz[int(n) - 1], rel=3e-3)


def test_quantiles_of_weighted_samples_are_those_of_repeated_ones():
    x, n = np.array([3.0, 1.0, 2.0, 5.0]), np.array([300, 100, 200, 400])
    expected = np.quantile(np.repeat(x, n), [0.2, 0.5])
    assert quantiles(x, n / n.sum(), (0.05, 0.8)) == [1.0, 5.0]
    assert quantiles(x, n / n.sum(), (0.2, 0.45)) == pytest.approx([2.0, 3.0], abs=1e-12)
    assert expected.tolist() == [2.0, 3.0]


@pytest.mark.parametrize(
    ("bounds", "sentence"),
    [
        ("joints.pads.ky=1:2", "--bounds joints.pads.ky is not free"),
        ("joints.pads.kz=5:2", r"must be NAME=LOW:HIGH with 0 < LOW < HIGH, in N/m, as in"),
        ("joints.pads.kz=nan:2", "must be NAME=LOW:HIGH"),
        ("joints.pads.kz", "must be NAME=LOW:HIGH"),
    ],
)
def test_bounds_that_cannot_be_are_refused_before_anything_is_computed(pads, bounds, sentence):
    chosen, wanted, _ = with_modes(pads, (), None, {1: 480.0}, quiet)
    with pytest.raises(InvalidScene, match=sentence):
        posterior_of(chosen, wanted, ("joints.pads.kz",), quiet, seed=0, bounds=bounds)


def test_options_that_contradict_each_other_are_refused(pads, capsys):
    start = ("tune", str(pads), "--match=1=480", "--free=joints.pads.kz")
    for more, words in (
        (("--rank", "--posterior"), "different answers; keep one"),
        (("--seed=1",), "--bounds and --seed are those of --posterior"),
        (("--posterior", "--out=x.toml"), "--posterior writes no scene; drop --out"),
        (("--posterior", "--seed=-1"), "--seed -1 must be a number from 0 to 1e18"),
    ):
        assert beadwave(*start, *more) == 2
        assert words in capsys.readouterr().err
