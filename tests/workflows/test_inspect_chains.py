"""Records of two chains on one structure in, numbers of it out."""

import numpy as np
import pytest

import beadwave
from beadwave.coupling.sensors import Sensor, measured_in_runs
from beadwave.workflows.files.scene import scene
from beadwave.workflows.fit.measured_record import files_of_strike, recorded
from beadwave.workflows.fit.parametric_wall import Bounds
from beadwave.workflows.fit.scene_parameters import scene_at, usual_each
from beadwave.workflows.fit.varied_chains import computed, varied_chains
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.chain.sensor_signals import csv_text
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.sweep.cases import base_of


def chain(name, face, at, count, striker):
    return {
        "name": name, "on": f"plate:{face}", "at": at, "count": count, "radius": 6e-3,
        "density": 7800.0, "young": 210e9, "poisson": 0.3, "striker": striker,
    }  # fmt: skip


PLATE = {
    "name": "struck-plate",
    "chains": [
        chain("above", "+z", [-0.03, 0.0], 5, {"velocity": 0.3}),
        chain("below", "-z", [0.035, 0.01], 4, {"velocity": 0.2, "time": 2e-5}),
    ],
    "assembly": {"held": ["plate:-x", "plate:+x"], "material": "steel"},
    "bodies": {"plate": {"box": [0.12, 0.08, 0.005]}},
    "materials": {"steel": {"young": 210e9, "poisson": 0.3, "density": 7850.0}},
    "mesh": {"scale": 1.6},
    "reduction": {"kind": "free-modes", "error": 3e-3},
    "damping": {"kind": "modal", "ratio": 0.005},
    "time": {"duration": 6e-4, "error": 1e-4},
    "output": {
        "spheres": [3],
        "instrument": {"sampling": 1e6},
        "sensors": [
            {"chain": name, "sphere": 3, "quantity": "force", "noise": 0.01}
            for name in ("above", "below")
        ],
    },
}
TRUTH = {"materials.steel.young": 202e9, "materials.steel.density": 7700.0}
KEYS = tuple(TRUTH)


@pytest.fixture(scope="module")
def drops(tmp_path_factory):
    """Records of the true plate, struck twice."""
    folder, files = tmp_path_factory.mktemp("drops"), []
    for i, (above, below) in enumerate([(0.31, 0.19), (0.4, 0.26)]):
        speeds = {
            "chains.above.striker.velocity": above, "chains.below.striker.velocity": below,
            "output.instrument.seed": i,
        }  # fmt: skip
        true = scene(PLATE, {**TRUTH, **speeds})
        files.append(folder / f"drop{i}.csv")
        files[-1].write_text(csv_text(true, pipeline_of(true, quiet)("record")))
    return files


def test_modulus_and_both_strikers_come_out_within_their_bars(drops, tmp_path):
    assert (
        drops[0]
        .read_text()
        .splitlines()[1]
        .endswith("above sphere 3 force [N], below sphere 3 force [N]")
    )
    result = beadwave.inspect(
        PLATE, drops, find="materials.steel.young",
        bounds="materials.steel.young=180e9:240e9", out=tmp_path / "inspected",
        changes={"materials.steel.density": TRUTH["materials.steel.density"]},
        each="chains.above.striker.velocity=0.3,0.4;chains.below.striker.velocity=0.2,0.25",
    )  # fmt: skip
    young, *own = result.report.numbers + result.report.others
    assert abs(young.found - TRUTH["materials.steel.young"]) < young.two_sigma < 6e9
    assert young.identifiable == "yes" and {"noise", "mesh"} <= set(young.bar_by)
    found = {number.name: number for number in own}
    for name, true in {"above": 0.4, "below": 0.26}.items():
        speed = found[f"chains.{name}.striker.velocity, record 2"]
        assert abs(speed.found - true) < 1.5 * speed.two_sigma < 0.02


def test_files_of_one_strike_are_one_record(drops, tmp_path):
    title, head, *lines = drops[0].read_text().splitlines()
    lead, *names = head.split(", ")
    rows = [line.split(",") for line in lines]

    def written(file, column, rows=rows, name=None):
        body = [f"{row[0]},{row[column]}" for row in rows]
        head = f"{lead}, {name or names[column - 1]}"
        (tmp_path / file).write_text("\n".join([title, head, *body]))
        return tmp_path / file

    above, shorter = written("above+.csv", 1), written("below.csv", 2, rows[:-20])
    whole, apart = recorded(drops[0]), recorded(above, shorter)
    assert apart.channels == whole.channels and apart.synthetic
    np.testing.assert_array_equal(apart.t, whole.t[:-20])
    np.testing.assert_array_equal(apart.y, whole.y[:-20])
    assert files_of_strike(above) == (above,) and len(files_of_strike("a.csv+b.csv")) == 2
    with pytest.raises(InvalidScene, match="one trigger and one sampling"):
        recorded(above, written("later.csv", 2, rows[1:]))
    with pytest.raises(InvalidScene, match=r"both have above sphere 3 force; leave it out"):
        recorded(above, written("again.csv", 2, name=names[0]))
    twice = [[*row, row[2]] for row in rows]
    body = "\n".join(
        [f"{lead}, {names[1]}, {names[1]}", *(",".join([r[0], *r[2:]]) for r in twice)]
    )
    (tmp_path / "twice.csv").write_text(f"{title}\n{body}")
    with pytest.raises(InvalidScene, match=r"has 1 repeats, .* has 2; give as many"):
        recorded(above, tmp_path / "twice.csv")
    with pytest.raises(InvalidScene, match=r"'a.csv\+' joins files by \+, one of them has no name"):
        files_of_strike("a.csv+")
    with pytest.raises(InvalidScene, match=r"b.csv"):
        beadwave.inspect(PLATE, f"{shorter}+{tmp_path / 'b.csv'}", find="materials.steel.young")


def test_the_structure_between_computed_ones_moves_the_spheres_as_the_one_computed_there():
    base, low, high = base_of(PLATE, ()), [190e9, 7500.0], [220e9, 8200.0]
    model = varied_chains(base, KEYS, Bounds(np.array(low), np.array(high)), 2, quiet)
    values = np.array(list(TRUTH.values()))
    exact = model.behind(computed(scene_at(base, KEYS, values)).wall)
    sensors = [Sensor(2, "force"), Sensor(3, "force", chain=1)]
    between, true = (
        measured_in_runs(sensors, varied(values).march(6e-4, 1e-6).rows)
        for varied in (model, exact)
    )
    np.testing.assert_allclose(between, true, rtol=0, atol=2e-5 * np.abs(true).max())


def test_the_strikers_velocities_are_each_records_own_unless_they_are_sought():
    plate = scene(PLATE, {})
    speeds = [f"chains.{name}.striker.velocity" for name in ("above", "below")]
    assert usual_each(plate, "materials.steel.young") == ";".join(speeds)
    assert usual_each(plate, speeds[0]) == speeds[1]
    assert usual_each(plate, ",".join(speeds)) == "none"


@pytest.mark.parametrize(
    ("header", "sentence"),
    [
        ("sphere 3 force", "'sphere 3 force', the scene has above, below; name a column's chain"),
        ("over sphere 3 force", "'over sphere 3 force', the scene has above, below"),
        ("below sphere 5 force", "allowed are 1 to chains.below.count = 4"),
    ],
)
def test_columns_of_no_chain_of_the_scene_are_refused(drops, tmp_path, header, sentence):
    file = tmp_path / "drop.csv"
    file.write_text(drops[0].read_text().replace("below sphere 3 force", header))
    with pytest.raises(InvalidScene, match=sentence):
        beadwave.inspect(PLATE, file, find="damping.ratio")


def test_a_record_of_several_chains_is_none_of_one(drops):
    with pytest.raises(InvalidScene, match="is of one of several chains, the scene has one"):
        beadwave.calibrate("rig-1dof", drops[0])
    with pytest.raises(InvalidScene, match="the scene has one chain"):
        beadwave.inspect("sensed-beam", drops[0], find="beam.young")


def test_chains_with_friction_are_not_compared_with_records(drops):
    with pytest.raises(InvalidScene, match=r"chains.above has friction"):
        beadwave.inspect(PLATE | {"friction": {"coefficient": 0.1}}, drops[0], find=KEYS[0])


def test_a_number_of_each_record_that_changes_the_structure_is_refused(drops):
    with pytest.raises(InvalidScene, match="changes the structure, which all records share"):
        beadwave.inspect(PLATE, drops, find="damping.ratio", each="materials.steel.young")
