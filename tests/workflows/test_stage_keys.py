"""Values that a stage reads of a scene are in its key, or kept results would outlive a change."""

from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest

from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene.named_files import file_keys, files_of, in_folder
from beadwave.workflows.scene.scene_table import SceneTable
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.stage_table import tables_of

SHORT = {"chain.count": 3, "time.duration": 3e-4, "output.spheres": [1, 3], "output.samples": 301}
BEAM = {
    "name": "beam",
    "materials": {"steel": {"young": 210e9, "poisson": 0.3, "density": 7850.0}},
    "assembly": {"held": ["beam:-x"], "material": "steel"},
    "bodies": {"beam": {"box": [0.2, 0.012, 0.02]}},
    "mesh": {"scale": 2.0},
    "strike": {"on": "beam:+y"},
    "targets": [{"hz": 250.0, "number": 1}],
    "chain": {"count": 3, "radius": 0.0127, "density": 7800.0, "young": 210e9, "poisson": 0.3},
    "striker": {"velocity": 0.1},
    "wall": {"kind": "rom"},
    "reduction": {"kind": "free-modes", "modes": 10},
    "time": {"duration": 3e-4},
    "output": {"spheres": [1, 3], "samples": 301},
}
SENSORS = {
    "output.sensors": [{"sphere": 2, "quantity": "force"}, {"sphere": 1, "quantity": "velocity"}],
    "output.instrument": {"bits": 8},
}
# of keys alone a mesh is refused, for the memory that its modes would take
UNKEYED = {"mesh"}


@pytest.fixture
def reads(monkeypatch):
    """The keys that were read, (table, key), of those that the scene has."""
    names = set()
    attribute, dump = SceneTable.__getattribute__, SceneTable.model_dump

    def noted(table, name):
        value = attribute(table, name)
        if value is not None and name in type(table).model_fields:
            names.add((type(table).__name__, name))
        return value

    def note_all(value):
        if isinstance(value, SceneTable):
            for name in type(value).model_fields:
                note_all(getattr(value, name))
        elif isinstance(value, tuple | list | dict):
            for entry in value.values() if isinstance(value, dict) else value:
                note_all(entry)

    def whole(table, *arguments, **options):
        note_all(table)
        return dump(table, *arguments, **options)

    monkeypatch.setattr(SceneTable, "__getattribute__", noted)
    monkeypatch.setattr(SceneTable, "model_dump", whole)
    return names


@pytest.mark.parametrize(
    ("source", "changes"),
    [
        ("rig-1dof", SHORT | SENSORS),
        ("oblique-sphere", {}),
        pytest.param(BEAM, SENSORS, marks=pytest.mark.slow),
    ],
    ids=["chain", "friction", "structure"],
)
def test_a_stage_reads_nothing_of_a_scene_that_its_key_lacks(source, changes, reads, own_folder):
    pipeline = pipeline_of(scene(source, changes), lambda name: nullcontext())
    whole, keyed, n_checked = pipeline.scene, {}, 0

    def keys_of(name):
        """Content of the key of a stage, its own and that of the stages it needs."""
        if name not in keyed:
            stage = pipeline._stages[name]
            reads.clear()
            stage.reads(whole)
            keyed[name] = set(reads).union(*map(keys_of, stage.needs))
        return keyed[name]

    ends = ["chain-numbers", "chain-files", "figures"]
    ends += ["sensor-numbers", "signals"] if pipeline.scene.output.sensors else []
    ends += ["structure-numbers", "structure-errors"] if pipeline.scene.has_structure else []
    reached = []
    while ends:
        name = ends.pop()
        reached += [name] if name not in reached else []
        ends += pipeline._stages[name].needs
    for name in reached:
        stage = pipeline._stages[name]
        needed = [pipeline(need) for need in stage.needs + stage.means]
        allowed = keys_of(name) | {("Scene", "name")}
        module, name_of_function = stage.function.split(":")
        function = getattr(import_module(module, "beadwave.workflows.stages"), name_of_function)
        reads.clear()
        function(whole, *needed)
        lacks = set(reads) - allowed if name not in UNKEYED else set()
        assert not lacks, f"{name} reads {sorted(lacks)}: add it to its row of stage_table.py"
        n_checked += 1
    assert n_checked >= 5


def naming_files(table=SceneTable):
    """Every table and key that names a file."""
    yield from ((table, key) for key in file_keys(table))
    for below in table.__subclasses__():
        yield from naming_files(below)


@pytest.mark.parametrize(
    ("table", "key"), list(naming_files()), ids=lambda value: getattr(value, "__name__", value)
)
def test_a_file_is_of_the_folder_of_its_scene_and_its_content_is_in_the_key(table, key, tmp_path):
    empty = table.model_construct(**dict.fromkeys(table.model_fields))
    named = empty.model_copy(update={key: "a.csv"})
    found = in_folder((named, empty), tmp_path)
    assert list(files_of(found)) == [str(tmp_path / "a.csv")]
    assert found[1] is empty and list(files_of(named)) == ["a.csv"]

    reads, scene_of_one = tables_of("table"), SimpleNamespace(table=found)
    contents = []
    for text in (None, "1", "2"):
        if text is not None:
            Path(tmp_path, "a.csv").write_text(text)
        contents.append(str(reads(scene_of_one)))
    assert len(set(contents)) == 3
