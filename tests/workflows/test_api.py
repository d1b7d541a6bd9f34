"""`import beadwave`: each command's work as a function."""

import ast
import doctest
import importlib
import json
import subprocess
import sys
from inspect import getdoc, isfunction, signature
from pathlib import Path

import numpy as np
import pytest

import beadwave
from beadwave import coupling, dem, rom
from beadwave.coupling.reduced_wall import wall_of
from beadwave.workflows.commands.app import COMMANDS, main
from beadwave.workflows.stages.chain.chain import chain, initial_velocity

ROOT = Path(__file__).parents[2]
SHORT = {"chain.count": 5, "output.spheres": [1, 3], "time.duration": 5e-4}
ROOMS = ("geometry", "fem", "rom", "dem", "coupling")

pytestmark = pytest.mark.usefixtures("own_folder")


def test_the_door_opens_without_loading_what_is_behind_it():
    code = "import sys, beadwave; dir(beadwave); print(sorted({'numpy', 'pydantic', 'scipy', "
    code += "'numba', 'xarray'} & set(sys.modules)), "
    code += "sorted(m for m in sys.modules if 'workflows' in m))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[] []"


def test_what_an_editor_is_told_is_what_is_there():
    source = ast.parse(Path(beadwave.__file__).read_text(encoding="utf-8"))
    typed = next(node for node in source.body if isinstance(node, ast.If))
    assert ast.unparse(typed.test) == "TYPE_CHECKING"
    told = {name.name: line.module for line in typed.body for name in line.names}
    assert told == beadwave._MODULES
    assert sorted(told) == beadwave.__all__ == sorted(set(dir(beadwave)) - {"__doc__"})


@pytest.mark.parametrize("name", beadwave.__all__)
def test_every_name_is_documented(name):
    found = getattr(beadwave, name)
    assert len(getdoc(found)) > 50
    if isfunction(found):
        assert name in beadwave.__doc__ or name in ("studies", "thesis_table", "write_hammer_test")


def test_every_command_that_computes_has_its_function():
    own = {"report", "scene", "scenes"}
    assert {name for name in COMMANDS if name not in own} <= set(beadwave.__all__)
    for name in set(COMMANDS) - own - {"doctor", "stability", "film", "verify"}:
        assert "changes" in signature(getattr(beadwave, name)).parameters


@pytest.mark.parametrize("room", ROOMS)
def test_the_help_of_a_room_names_what_it_has(room):
    module = importlib.import_module(f"beadwave.{room}")
    words = set(module.__doc__.replace(",", " ").replace("`", " ").split())
    assert len(words & set(module.__all__)) >= 3
    assert any(
        unit in module.__doc__ for unit in ("[N/m]", "[kg/m^3]", "[m/N]", "Lengths in m", "[N]")
    )


EXAMPLES = sorted(
    ".".join(("beadwave", *source.relative_to(ROOT).with_suffix("").parts)).removesuffix(
        ".__init__"
    )
    for room in (*ROOMS, "workflows")
    for source in (ROOT / room).rglob("*.py")
    if "\n    >>> " in source.read_text() or "\n>>> " in source.read_text()
)


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_in_docstrings_print_what_they_show(name):
    examples = doctest.testmod(importlib.import_module(name))
    assert examples.attempted and not examples.failed


@pytest.mark.slow
def test_a_function_and_its_command_find_the_same(monkeypatch, capsys):
    found = beadwave.impact("rig-1dof", SHORT)
    sets = [f"--set={key}={value}" for key, value in SHORT.items()]
    monkeypatch.setattr(sys, "argv", ["beadwave", "impact", "rig-1dof", "--json", *sets])
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    printed = json.loads(capsys.readouterr().out)
    mine = json.loads(found.summary.text())
    assert printed["peak_wall_force_N"] == mine["peak_wall_force_N"] > 100
    assert printed["waves"] == mine["waves"]


def test_a_run_can_be_loaded_again():
    done = beadwave.run("rig-rigid", SHORT, out="mine")
    again = beadwave.load("mine")
    assert again.scene == done.scene
    assert again.summary.text() == done.summary.text()
    assert done.arrays.keys() == again.arrays.keys() >= {"t", "x", "v", "contact_force"}
    assert again.plot("energies").png == done.plot("energies").png
    assert done.plot().save("v.png").read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(beadwave.InvalidScene, match="no picture 'energy'"):
        done.plot("energy")
    with pytest.raises(beadwave.InvalidScene, match="no finished run folder"):
        beadwave.load("cache")


def test_arrays_bear_names_and_units():
    found = beadwave.impact("rig-rigid", SHORT)
    data = found.data
    assert data.v.dims == ("time", "sphere") and data.v.units == "m/s"
    assert data.contact_force.dims == ("time", "contact") and data.time.units == "s"
    peak = float(data.contact_force.sel(contact=5).max())
    assert peak == found.summary.peak_wall_force_N
    assert list(data.sphere) == [1, 2, 3, 4, 5] and data.energy_total.units == "J"
    found = beadwave.impact("rig-1dof", SHORT, out="out")
    data = found.data
    assert data.wall_q.dims == ("time", "mode") and data.wall_phi.dims == ("mode",)
    at_contact = (data.wall_q * data.wall_phi).sum("mode")
    np.testing.assert_allclose(at_contact, data.wall_x, atol=1e-12)
    assert beadwave.load("out").data.equals(data)


def test_a_scene_is_told_in_any_way(tmp_path):
    named = beadwave.scene("rig-rigid", SHORT)
    file = tmp_path / "rig-rigid.toml"
    from beadwave.workflows.scene.toml import toml

    file.write_text(toml(named))
    tables = named.model_dump(exclude_none=True)
    told = [file, str(file), tables, named, ("rig-rigid",)]
    assert {beadwave.scene(source) == named for source in told[:4]} == {True}
    texts = ("chain.count=5", "output.spheres=[1, 3]", "time.duration=0.5 ms")
    assert beadwave.scene("rig-rigid", texts) == named
    arrays = {"chain.radius": np.full(5, 0.01), "striker.velocity": np.float64(0.2)}
    changed = beadwave.scene(named, arrays)
    assert changed.chain.radius == (0.01,) * 5 and changed.striker.velocity == 0.2


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"chain.raduis": 0.01}, "the nearest known is 'radius'"),
        ({"chain..radius": 0.01}, "is not dotted words"),
        ({"striker.velocity": "fast"}, "'fast' is no number"),
        (["chain.radius"], "is not key=value"),
    ],
)
def test_a_wrong_change_is_named(changes, said):
    with pytest.raises(beadwave.InvalidScene, match=said):
        beadwave.scene("rig-rigid", changes)


def test_a_mass_on_a_spring_is_the_same_wall_by_its_matrices():
    wall = beadwave.scene("rig-1dof").wall
    k = wall.mass * (2 * np.pi * wall.frequency) ** 2
    matrices = rom.full_order([[k]], [[wall.mass]], [1.0])
    damping = {"damping": {"kind": "modal", "ratio": wall.damping_ratio}}
    scene = beadwave.scene("rig-1dof", SHORT)
    surface = {"wall.young": wall.young or 210e9, "wall.poisson": wall.poisson or 0.3}
    mine = beadwave.impact(scene, damping | surface, rom=matrices)
    assert mine.summary.peak_wall_force_N == pytest.approx(
        beadwave.impact(scene).summary.peak_wall_force_N, rel=1e-6
    )


def springs(n=120):
    """A bar of n masses, held at one end, struck at the other."""
    K = 2e9 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    K[0, 0] = 2e9
    return K, 0.02 * np.eye(n), np.eye(n)[0]


@pytest.mark.slow
def test_a_reduction_of_own_matrices_keeps_their_static_compliance_and_force():
    K, M, w = springs()
    small = beadwave.reduce_matrices(K, M, w, modes=30)
    assert len(small.w) == 31
    compliance = w @ np.linalg.solve(K, w)
    assert rom.static_compliance(small) / compliance == pytest.approx(1, abs=1e-9)
    full = rom.full_order(K, M, w)
    forces = [
        beadwave.impact("rig-half-space", SHORT, rom=model).summary.peak_wall_force_N
        for model in (small, full)
    ]
    assert forces[0] / forces[1] == pytest.approx(1, abs=2e-3)


@pytest.mark.slow
def test_a_wall_by_hand_is_that_of_the_scene():
    """By the words of help(coupling) on the residual compliance, the preload and the surface."""
    K, M, w = springs()
    young, poisson, patch = 210e9, 0.3, 2e-3
    local = 0.1 * 0.6 * (1 - poisson**2) / (young * patch)
    given = {"half_space": local, "young": young, "poisson": poisson}
    model = beadwave.reduce_matrices(K, M, w, modes=30, **given)
    loaded = SHORT | {"preload": {"force": 15.0, "mass": 0.134}}
    found = beadwave.impact("rig-rigid", loaded, rom=model)

    c = found.scene.chain
    material = (c.radius, c.density, c.young, c.poisson)
    row = dem.row_of_spheres(*material, count=5, preload=15.0, flat=dem.Flat(young, poisson))
    row.mass[-1] += 0.134
    wall = wall_of(model)
    run = {"duration": 5e-4, "error": found.scene.time.error}
    v0 = np.array([found.scene.striker.velocity, 0.0, 0.0, 0.0, 0.0])
    by_hand = coupling.impact(row, wall, v0, **run).trajectory.contact_force[:, -1].max()
    assert by_hand / found.summary.peak_wall_force_N == pytest.approx(1, abs=1e-4)
    assert wall.residual_compliance == pytest.approx(-local, rel=0.05)

    without = coupling.impact(row, wall._replace(residual_compliance=0.0), v0, **run)
    bare = coupling.impact(row._replace(preload=0.0), wall, v0, **run)
    for other in (without, bare):
        force = other.trajectory.contact_force[:, -1].max()
        assert abs(force / by_hand - 1) > 1e-3
    assert np.array_equal(v0, initial_velocity(found.scene))
    assert np.array_equal(chain(found.scene).mass, row.mass)


@pytest.mark.slow
def test_a_mesh_of_ones_own_gives_way(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    import own_mesh

    model = own_mesh.reduced()
    forces = [
        beadwave.impact("rig-rigid", SHORT, rom=wall).summary.peak_wall_force_N
        for wall in (model, None)
    ]
    assert 0.7 < forces[0] / forces[1] < 0.95
    exact = 0.6 * 0.91 / (210e9 * own_mesh.PATCH)
    assert 0.7 < model.contact.half_space / exact < 1.0  # elements as large as the patch are stiff


def test_studies_are_listed_and_leave_tables():
    assert set(beadwave.studies("accuracy")) >= {"time", "mesh", "reduction"}
    verdicts = beadwave.stability(["time-reversal"])
    data = verdicts.data()
    assert list(data.verdict.values) == ["accurate"] * data.sizes["row"]
    with pytest.raises(beadwave.InvalidScene, match="'tim-reversal' is not known"):
        beadwave.stability(["tim-reversal"])
