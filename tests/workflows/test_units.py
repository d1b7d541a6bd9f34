"""Numbers with a unit, and numbers that look as if they were in another one."""

import tomllib

import pytest

from beadwave.workflows.files.scene import built_in, scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.quantities import entries
from beadwave.workflows.scene.toml import resolved, toml
from beadwave.workflows.scene.units import FREQUENCY, KINDS, LENGTH, NoSuchQuantity, in_si, unit_of

ONE_DOF = "wall={{kind='1dof', frequency={}, mass={}}}"


@pytest.mark.parametrize(
    ("change", "same"),
    [
        ("chain.radius=1.2 mm", "chain.radius=1.2e-3"),
        ("chain.radius=12.7mm", "chain.radius=12.7e-3"),
        ("chain.radius=0.5 in", "chain.radius=0.0127"),
        ("chain.young=210 GPa", "chain.young=210e9"),
        ("chain.young=2.1e5 N/mm²", "chain.young=210e9"),
        ("chain.density=7.85 g/cm3", "chain.density=7850.0"),
        ("chain.density=7.85e-9 t mm^-3", "chain.density=7850.0"),
        ("time.duration=3 ms", "time.duration=3e-3"),
        ("time.dt=100 ns", "time.dt=1e-7"),
        ("striker.velocity=310 mm/s", "striker.velocity=0.31"),
        ("contact.coefficient=0.1 s/m", "contact.coefficient=0.1"),
        (ONE_DOF.format("'20 kHz'", "'2870 g'"), ONE_DOF.format(20e3, 2.87)),
    ],
)
def test_a_number_with_its_unit_is_the_number_in_si(change, same):
    assert scene("rig-rigid", (change,)) == scene("rig-rigid", (same,))


@pytest.mark.parametrize(
    ("change", "same"),
    [
        ("assembly.block.young=223.58 GPa", "assembly.block.young=223.58e9"),
        ("assembly.sheet_thickness=0.847 mm", "assembly.sheet_thickness=0.847e-3"),
        ("assembly.screw_x=['-15 mm', 0.015]", "assembly.screw_x=[-0.015, 0.015]"),
        ("joints.head.ky=527.5 N/mm", "joints.head.ky=527.5e3"),
        ("joints.head.kry=99 N m", "joints.head.kry=99.0"),
        ("joints.head.kry=99 N m/rad", "joints.head.kry=99.0"),
        ("patch.point=['30 mm', 0.0]", "patch.point=[0.03, 0.0]"),
    ],
)
def test_every_dimension_of_an_assembly_takes_a_unit(change, same):
    assert scene("rig-rom", (change,)) == scene("rig-rom", (same,))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("chain.radius=1.2 kg", "'1.2 kg' is a mass, a length is needed"),
        ("chain.young=210 mm", "is a length, a pressure is needed"),
        ("time.duration=3 Hz", "is a frequency, a time is needed"),
        (ONE_DOF.format("'60 rad/s'", 1.0), "a frequency is needed"),
        ("contact.coefficient=3 N s/m", "is a dashpot, a loss per velocity is needed"),
        ("chain.radius=3 furlong", "no number with a unit that is known"),
        ("chain.radius=1,2 mm", "no number with a unit that is known"),
        ("chain.radius=-1 mm", "greater than 0"),
        ("chain.radius=1e999 m", "finite"),
    ],
)
def test_a_unit_of_another_kind_is_refused(change, words):
    with pytest.raises(InvalidScene, match=words):
        scene("rig-rigid", (change,))


@pytest.mark.parametrize("text", ["", "m", "1", "1 m m", "9" * 5000 + " m", "1 /", "1 m/", "0x1 m"])
def test_texts_without_a_number_and_a_unit_are_refused(text):
    with pytest.raises(NoSuchQuantity):
        in_si(text, LENGTH)


def test_radians_per_second_are_no_hertz_and_every_kind_reads_its_own_units():
    with pytest.raises(NoSuchQuantity):
        in_si("1 rad/s", FREQUENCY)
    for kind in KINDS:
        powers = {unit_of(unit).powers for unit in (kind.unit, *kind.others)}
        assert len(powers) == 1 and unit_of(kind.unit).factor == 1, kind


A_THOUSAND_OFF = {
    "rig-rigid chain.radius=12.7": "did you mean 0.0127 (12.7 mm)?",
    "rig-rigid chain.radius=9 m": "did you mean 0.009 (9 mm)?",
    "rig-rom assembly.young=210 kPa": "did you mean 2.1e+11 (210 GPa)?",
    "rig-rigid chain.young=210": "did you mean 2.1e+11 (210 GPa)?",
    "rig-rigid chain.young=210e3": "did you mean 2.1e+11 (210000 MPa)?",
    "rig-rigid chain.density=7.8": "did you mean 7800 (7.8 g/cm^3)?",
    "rig-rigid striker.velocity=310": "did you mean 0.31 (310 mm/s)?",
    "rig-rigid time.duration=3": "did you mean 0.003 (3 ms)?",
    "rig-1dof preload.mass=134": "did you mean 0.134 (134 g)?",
    "rig-1dof leaf_springs.offset=1.5": "did you mean 0.0015 (1.5 mm)?",
    "rig-rom assembly.sheet_thickness=1.2": "did you mean 0.0012 (1.2 mm)?",
    "rig-rom assembly.block_x=131.5": "did you mean 0.1315 (131.5 mm)?",
    "rig-rom assembly.screw_x=[-15, 15]": "did you mean -0.015 (-15 mm)?",
    "rig-rom assembly.block.density=7.4": "did you mean 7400 (7.4 g/cm^3)?",
    "rig-rom mesh.seed=6": "did you mean 0.006 (6 mm)?",
    "plate-on-bolts bodies.cover.plate.thickness=6": "did you mean 0.006 (6 mm)?",
    "plate-on-bolts bodies.cover.plate.thickness=6 m": "(20 times the longer side of its outline)",
}


@pytest.mark.parametrize("given", A_THOUSAND_OFF)
def test_a_number_in_another_unit_is_refused_with_what_was_probably_meant(given):
    name, change = given.split(" ", 1)
    with pytest.raises(InvalidScene) as refusal:
        scene(name, (change,))
    sentence, key = str(refusal.value), change.split("=")[0]
    assert A_THOUSAND_OFF[given] in sentence and f"{key} = " in sentence, sentence
    assert "\n" not in sentence and sentence.endswith("meant.")


MEANT = ('unusual=["chain.radius"]', "chain.radius=12.7 m")


def test_an_unusual_number_that_no_unit_makes_usual_is_meant_where_its_unit_stands_beside_it():
    result = scene("rig-rigid", ("time.duration=1e12 s",))
    assert result.time.duration == 1e12 and result.unusual == ("time.duration",)


def test_an_unusual_number_is_meant_where_its_key_is_listed():
    """A scene written out keeps that, until the value is another one."""
    result = scene("rig-rigid", MEANT)
    assert result.chain.radius == 12.7 and result.unusual == ("chain.radius",)
    tables = tomllib.loads(toml(result))
    assert tables["chain"]["radius"] == 12.7 and resolved(tables, "again") == result


def test_a_long_bar_that_is_drawn_as_a_plate_is_meant_where_its_key_is_listed():
    """The range of a thickness depends on the outline; a scene written out keeps the key."""
    key = "bodies.cover.plate.thickness"
    result = scene("plate-on-bolts", (f'unusual=["{key}"]', f"{key}=6", "mesh.scale=20"))
    assert result.unusual == (key,)
    assert resolved(tomllib.loads(toml(result)), "again").bodies == result.bodies
    assert scene("plate-on-bolts", (f"{key}=0.3",)).unusual is None


def test_a_new_value_of_a_key_listed_as_unusual_is_checked_again(tmp_path):
    path = tmp_path / "huge.toml"
    path.write_text(toml(scene("rig-rigid", MEANT)))
    assert scene(str(path)).chain.radius == 12.7
    with pytest.raises(InvalidScene, match="did you mean"):
        scene(str(path), ("chain.radius=14.0",))


@pytest.mark.parametrize("name", built_in())
def test_every_number_of_a_built_in_scene_is_usual(name):
    result = list(entries(scene(name).written))
    assert result and not any(entry.unusual for entry in result)


def test_a_number_with_a_dimension_takes_its_unit():
    """Ratios, counts and what has the unit of its law stand alone."""
    keys = {entry.key for entry in entries(scene("rig-rom").written)}
    keys |= {entry.key for entry in entries(scene("rig-1dof"))}
    bare = {"count", "poisson", "ratio", "damping_ratio", "error", "modes", "samples", "spheres",
            "direction", "stiffness_factor", "coefficient", "scale", "unknowns"}  # fmt: skip
    for result in (scene("rig-rom"), scene("rig-1dof")):
        for key, value in _numbers(result.model_dump()):
            assert (key in keys) != (key.split(".")[-1] in bare), (key, value)


def _numbers(tables, path=()):
    for name, value in tables.items():
        if isinstance(value, dict):
            yield from _numbers(value, (*path, name))
        elif isinstance(value, float | int) and not isinstance(value, bool):
            yield ".".join((*path, name)), value
