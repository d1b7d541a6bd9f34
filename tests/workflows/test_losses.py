"""Loss factors from damping ratios and back, beside complex modes and synthetic tests."""

import json

import numpy as np
import pytest
from scipy.linalg import eigvals

from beadwave import rom
from beadwave.coupling import damping_ratios
from beadwave.fem.updating.loss_factors import damping_ratios_of, loss_factors
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene, LossFactorsTable
from beadwave.workflows.stages.chain.damping import damping
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.stages.structure.bodies import parts
from beadwave.workflows.stages.structure.face import StruckFace
from beadwave.workflows.stages.structure.loss_factors import strain_of, structure_damping
from beadwave.workflows.structure.api import fit_losses
from beadwave.workflows.structure.parameters import freed
from beadwave.workflows.structure.tuning import loosened

from command_line import beadwave
from known_models import PADS

STEEL, JOINT = 0.002, 0.05
LOSS = f"""
[damping]
kind = "loss"
materials = {{ steel = {STEEL} }}
joints = {{ pads = {JOINT} }}
"""
STRUCK = """
chain = { count = 4, radius = 0.00635, density = 7800.0, young = 210e9, poisson = 0.3 }
striker = { velocity = 0.3 }
wall = { kind = "rom" }
time = { duration = 5e-4 }
strike = { on = "block:+x", radius = 0.004 }
"""
N = 6


def silent_scene(folder, text):
    path = folder / "pads.toml"
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def lossy(tmp_path_factory):
    return silent_scene(tmp_path_factory.mktemp("lossy"), PADS + LOSS)


def ratios(one):
    """Damping ratios and frequencies [Hz] of the first modes by the scene's loss factors."""
    pipeline = pipeline_of(one, quiet)
    modes = pipeline("modes")
    law = structure_damping(one, pipeline("model"), modes)
    return damping_ratios(law, modes.omega)[:N], modes.omega[:N] / (2 * np.pi)


@pytest.mark.slow
def test_ratios_are_those_of_complex_modes_of_a_complex_stiffness(lossy, shared_cache):
    """K (1 + i eta): half the imaginary over the real part of lambda, to the square of eta."""
    one = scene(lossy)
    zeta, hz = ratios(one)
    names = [f"joints.pads.{key}" for key in ("kx", "kz", "krx", "krz")]
    parameters = freed(one, names)
    basis = pipeline_of(loosened(one, parameters), quiet)("tuning-basis")
    stiff = {"pads.ky": 1e13, "pads.kry": 1e11}  # rigid
    k = basis.stiffness.copy()
    for name, x in stiff.items():
        k[np.array(basis.spring) == name] = x
    for p in parameters:
        k[np.isin(basis.spring, p.springs)] = p.before[0]
    of_joints = (basis.elongation.T * k) @ basis.elongation
    K = (1 + 1j * STEEL) * basis.K0 + (1 + 1j * JOINT) * of_joints
    eigenvalues = np.sort_complex(eigvals(K, basis.M))[:N]
    np.testing.assert_allclose(np.sqrt(eigenvalues.real) / (2 * np.pi), hz, rtol=1e-3)
    np.testing.assert_allclose(eigenvalues.imag / (2 * eigenvalues.real), zeta, rtol=2e-3)
    assert zeta.max() > 8 * zeta.min()  # modes of the joint, modes of the bodies


@pytest.mark.slow
def test_shares_of_all_parts_make_the_whole_strain(lossy, shared_cache):
    one = scene(lossy)
    pipeline = pipeline_of(one, quiet)
    strain = strain_of(one, pipeline("model"), pipeline("modes"))
    assert set(strain.parts) == {"materials.steel", "joints.pads"}
    np.testing.assert_allclose(strain.shares[:N].sum(axis=1), 1.0, atol=1e-6)


@pytest.mark.slow
def test_loss_factors_are_recovered_from_noisy_ratios_within_their_bars_and_written(
    lossy, shared_cache, tmp_path
):
    zeta, hz = ratios(scene(lossy))
    rng, text = np.random.default_rng(0), PADS + '[damping]\nkind = "none"\n'
    for n in range(N):
        noisy = zeta[n] * (1 + 0.05 * rng.standard_normal())
        text += f"[[targets]]\nnumber = {n + 1}\nhz = {hz[n]}\nzeta = {noisy}\n"
        text += f"zeta_deviation = {0.05 * zeta[n]}\n"
    aimed, out = silent_scene(tmp_path, text), tmp_path / "damped.toml"
    fit = fit_losses(aimed, out=out)
    rows = {row.name: row for row in fit.report.factors}
    for name, true in (("materials.steel", STEEL), ("joints.pads", JOINT)):
        assert rows[name].says == "value" and rows[name].deviation < 0.1 * true
        assert abs(rows[name].value - true) < 2.5 * rows[name].deviation

    # the scene that was written damps its modes as they were measured
    written = scene(out)
    assert isinstance(written.damping, LossFactorsTable)
    assert written.damping.joints["pads"] == pytest.approx(rows["joints.pads"].value, rel=1e-2)
    np.testing.assert_allclose(ratios(written)[0], zeta, rtol=0.1)


def test_bars_of_loss_factors_hold_the_truth_as_often_as_they_say():
    shares = np.array([[0.9, 0.1], [0.5, 0.5], [0.2, 0.8], [0.7, 0.3], [0.05, 0.95]])
    true, rng = np.array([0.003, 0.04]), np.random.default_rng(4)
    zeta = damping_ratios_of(shares, true)
    within = []
    for _ in range(400):
        fit = loss_factors(shares, zeta * (1 + 0.1 * rng.standard_normal(5)), 0.1 * zeta)
        within.append(np.abs(fit.value - true) < 2 * fit.deviation)
    share = np.mean(within, axis=0)
    assert np.all(share > 0.93), share  # 0.954, and where they scatter more bars are wider


def test_of_parts_that_share_alike_none_is_determined_and_none_is_negative():
    shares = np.array([[0.5, 0.5], [0.4, 0.4], [0.3, 0.3]])
    zeta = damping_ratios_of(shares, [0.02, 0.02])
    fit = loss_factors(shares, zeta, 0.01 * zeta)
    assert not fit.is_value.any() and np.all(fit.deviation > 0.1)
    # a ratio that falls with the share asks for a negative factor, and gets none
    shares = np.array([[0.9, 0.1], [0.1, 0.9]])
    fit = loss_factors(shares, np.array([0.01, 0.0005]), np.array([1e-4, 1e-4]))
    assert fit.value[1] == 0 and fit.value[0] > 0 and not fit.is_value[1]


@pytest.mark.slow
def test_a_run_and_its_errors_take_the_ratios_of_the_loss_factors(shared_cache, tmp_path):
    """Compared with a run with the ratios of the modes one by one in their place."""
    import beadwave as library

    path = silent_scene(tmp_path, STRUCK + PADS + LOSS)
    one = scene(path)
    reduced = pipeline_of(one, quiet)("reduction")
    zeta, hz = ratios(one)
    omega = 2 * np.pi * hz
    np.testing.assert_allclose(damping_ratios(damping(one.damping, reduced), omega), zeta)
    result = library.run(path, out=tmp_path / "run")
    assert np.isfinite(result.summary.peak_wall_force_N)
    other = scene(path, {"damping.joints.pads": 0.5})
    assert damping_ratios(damping(other.damping, reduced), omega)[0] > 5 * zeta[0]
    assert reduced.contact.strain.parts == ("materials.steel", "joints.pads")
    rom.save_npz(tmp_path / "r.npz", reduced)
    assert rom.load_npz(tmp_path / "r.npz").contact.strain is None


@pytest.mark.slow
def test_a_scan_takes_on_any_mesh_the_ratios_of_the_loss_factors(shared_cache, tmp_path):
    one = scene(silent_scene(tmp_path, STRUCK + PADS + LOSS))
    zeta, hz = ratios(one)
    for face in (StruckFace(one), StruckFace(one, parts(one, coarser=0.8))):
        computed = damping_ratios(face._damping(), 2 * np.pi * hz)
        np.testing.assert_allclose(computed, zeta)


def test_what_has_no_ratios_or_no_such_parts_is_refused(lossy, shared_cache, capsys):
    with pytest.raises(InvalidScene, match="no target has a damping ratio"):
        fit_losses(scene(lossy, {"targets": [{"number": 1, "hz": 480.0}]}))
    with pytest.raises(InvalidScene, match=r"damping.joints.pasd is not of this assembly; it has"):
        ratios(scene(lossy, {"damping.joints": {"pasd": 0.1}}))
    with pytest.raises(InvalidScene, match="shares out the strain of bodies"):
        scene("rig-1dof", {"damping": {"kind": "loss"}})
    assert beadwave("tune", str(lossy), "--damping", "--free=joints.pads.kz") == 2
    assert "drop --match and --free" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_prints_the_shares_and_factors(lossy, shared_cache, capsys):
    targets = [{"number": n, "hz": 480.0 * n, "zeta": 0.02} for n in (1, 2, 3)]
    changes = f"--set=targets={json.dumps(targets).replace(':', '=')}"
    changes = changes.replace('"', "").replace("{", "{ ").replace("}", " }")
    assert beadwave("tune", str(lossy), "--damping", "--json", changes) == 0
    report = json.loads(capsys.readouterr().out)
    assert {row["name"] for row in report["factors"]} == {"materials.steel", "joints.pads"}
    assert report["modes"]["1"]["shares"]["joints.pads"] > 0.9
    assert any("came without zeta_deviation" in remark for remark in report["remarks"])
