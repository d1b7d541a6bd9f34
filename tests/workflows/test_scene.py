"""Scenes: what is filled in, what is refused, and how it is said."""

import math
import re

import numpy as np
import pytest

from beadwave import coupling
from beadwave.workflows.files.scene import built_in, scene, scene_text
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.toml import resolved, toml
from beadwave.workflows.stages.chain.chain import flat
from beadwave.workflows.stages.chain.damping import damping_law
from beadwave.workflows.stages.chain.impact import require_start
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.structure.assembly import solid

MINIMAL = {
    "name": "minimal",
    "chain": {"count": 2, "radius": 0.01, "density": 7800.0, "young": 2e11, "poisson": 0.3},
    "striker": {"velocity": 1.0},
}


def minimal(**tables):
    return {**MINIMAL, **tables}


@pytest.mark.parametrize("name", built_in())
def test_a_resolved_scene_reads_back_as_itself(name, tmp_path):
    first = scene(name)
    path = tmp_path / "scene.toml"
    path.write_text(toml(first))
    assert scene(str(path)) == first


@pytest.mark.parametrize("name", built_in())
def test_a_built_in_scene_names_the_sources_of_its_numbers(name):
    for line in built_in()[name].splitlines():
        key, equals, value = line.partition("=")
        if equals and any(c.isdigit() for c in value.split("#")[0]) and key.strip() in SOURCED:
            assert any(word in line for word in ("thesis", "inferred", "assumed")), line


@pytest.mark.parametrize("name", built_in())
def test_the_first_line_of_a_built_in_scene_is_a_sentence_of_its_own(name):
    first = built_in()[name].splitlines()[0]
    assert re.fullmatch(r"# [A-Z].*\.", first), first


def test_fewer_spheres_than_are_watched_are_refused_with_what_works():
    with pytest.raises(InvalidScene) as refused:
        scene("rig-rigid", ("chain.count=9",))
    change = re.search(r'--set (output\.spheres)="(.*?)"', str(refused.value))
    result = scene("rig-rigid", ("chain.count=9", f"{change[1]}={change[2]}"))
    assert result.output.spheres == (1, 4, 9)


SOURCED = {"count", "radius", "density", "young", "poisson", "velocity", "frequency", "mass"} | {
    "coefficient", "duration", "spheres", "point", "ratio", "damping_ratio", "block_x", "block_y",
}  # fmt: skip


def test_an_absent_table_is_an_absent_part():
    result = resolved(MINIMAL, "minimal")
    assert result.wall is None and result.assembly is None and result.preload is None
    assert result.time.error == 1e-4


def test_a_setting_changes_one_value():
    assert scene("rig-rigid", ("chain.count=15",)).chain.count == 15
    assert scene("rig-rigid", ("wall.kind=half-space",)).wall.kind == "half-space"
    assert scene("rig-1dof", ("wall.kind=rigid",)).wall.kind == "rigid"


def test_a_step_replaces_the_error_asked_for():
    time = scene("rig-rigid", ("time.dt=1e-7",)).time
    assert (time.dt, time.error) == (1e-7, None)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("time.dt=1e-7", "time.error=1e-4"),
        ("striker.drop=1cm", "striker.velocity=0.3"),
        ("reduction.modes=8", "reduction.error=1e-3"),
    ],
)
def test_two_settings_that_exclude_each_other_are_refused(first, second):
    for both in ((first, second), (second, first)):
        keys = [change.partition("=")[0] for change in both]
        words = f"^--set {keys[0]} and --set {keys[1]} exclude each other; drop one"
        with pytest.raises(InvalidScene, match=words):
            scene("rig-rom", both)


def test_settings_apply_in_order():
    assert scene("rig-rigid", ("chain.count=15", "chain.count=16")).chain.count == 16


REFUSED = {
    "chain.radius=-1": ("chain.radius", "-1", "greater than 0"),
    "chain.radius='a'": ("chain.radius", "'a'", "number"),
    "chain.radius=nan": ("chain.radius", "nan", "finite"),
    "chain.young=inf": ("chain.young", "inf", "finite"),
    "chain.count=3.5": ("chain.count", "3.5", "integer"),
    "chain.count=true": ("chain.count", "True", "integer"),
    "chain.count=0": ("chain.count", "0", "1"),
    "chain.cuont=3": ("'cuont'", "'count'"),
    "chian.count=3": ("'chian'", "'chain'"),
    "chain=3": ("chain", "3", "table"),
    "chain.radius=[0.1, 0.2]": ("chain.radius", "2 values", "17"),
    "chain.radius=[0.1, -0.2]": ("chain.radius.2", "-0.2"),
    "masses.on=head": ("masses is a list of tables", "[[masses]]"),
    "chain.poisson=0.6": ("chain.poisson", "0.6", "0.5"),
    "contact.stiffness_factor=[1, 2]": ("contact.stiffness_factor", "2 values", "17"),
    "contact.dissipation=foo": ("contact.dissipation", "'foo'", "hunt-crossley"),
    "wall.kind=blob": ("wall.kind", "'blob'", "'half-space'"),
    "wall.kind=rom": ("[assembly]", "wall.file"),
    "wall.kind=1dof": ("wall.frequency", "missing"),
    "wall={kind='rom', file='no.npz'}": ("wall.file", "no.npz", "does not exist"),
    "contact.law=power": ("contact", '"power" needs stiffness', "add it"),
    "contact.exponent=2": ("exponent", '"power"', "drop it"),
    "contact={law='power', stiffness=-1, exponent=2}": ("contact.stiffness", "-1", "greater than"),
    "contact={law='power', stiffness=1e12, exponent=5}": ("contact.exponent", "5", "equal to 4"),
    "contact={law='power', stiffness=[1e12, 1e12], exponent=2}": ("contact.stiffness", "2 values"),
    "contact={law='table', file='no.csv'}": ("contact.file", "no.csv", "does not exist"),
    "contact.file=a.csv": ("file", '"table"', "drop it"),
    "contact.coefficient=1e12": ("contact.coefficient", "1e+06 s/m", "lower it"),
    "wall.kind=dashpot": ("wall", "coefficient", "plate_thickness"),
    "wall={kind='dashpot', coefficient=9.0, plate_thickness=1.0}": ("wall", "exclude"),
    "wall={kind='dashpot', coefficient=9.0, density=1e3}": ("wall", "density", "plate_thickness"),
    "wall={kind='dashpot', plate_thickness=-1.0}": ("wall.plate_thickness", "-1.0"),
    "output.spheres=[1, 44]": ("output.spheres", "44", "17"),
    "time.duration=-1": ("time.duration", "-1"),
    "time={dt=1e-7, error=1e-3}": ("dt", "error", "exclude"),
    "preload.force=-1": ("preload.force", "-1"),
    "striker.velocity=0": ("striker.velocity", "0", "greater than 0"),
    "striker.velocity=-0.3": ("striker.velocity", "-0.3", "greater than 0"),
    "chain.radius=1e300": ("chain.radius", "1e+300", "between 1e-18 and 1e+18"),
    "chain.density=1e-300": ("chain.density", "1e-300", "between 1e-18 and 1e+18"),
    "chain.count=9999999999999999999999": ("chain.count", "1000000"),
    "chain.radius=[]": ("chain.radius", "empty"),
    "time.dt=1": ("time.dt = 1", "time.duration = 0.003"),
    "time.dt=1e-15": ("time.dt", "1e-15", "steps", "1e+09"),
    "output.samples=1000000000": ("output.samples", "1000000"),
    "chain.count=100000": ("output.samples", "chain.count = 100000", "1e+08"),
    "name=a/b": ("name", "'a/b'"),
    "strike.on=lid": ("strike.on", "'lid' is no face of a body"),
    "assembly={held=[{on='lid:+z', directions='w'}]}": ("directions = 'w'", "letters x, y and z"),
    "chain": ("key=value",),
    "striker={velocity=1, velocity=2}": ("--set striker", "Duplicate", "'velocity'"),
    "output.spheres=[1, 2": ("--set output.spheres", "Unclosed array"),
    "time.error=2mm": ("time.error", "'2mm'", '0.02 or "2 %"'),
    "chain.count.x=3": ("chain.count.x", "17"),
}


@pytest.mark.parametrize("change", REFUSED)
def test_a_refusal_names_the_key_the_value_and_what_is_allowed(change):
    with pytest.raises(InvalidScene) as refusal:
        scene("rig-rigid", (change,))
    sentence = str(refusal.value)
    assert all(part in sentence for part in REFUSED[change]), sentence
    assert "\n" not in sentence and sentence.endswith(".") and not sentence.endswith("..")


TOO_SHORT = {
    "joints.bolts.at=[[0.02, 0.02]]": ".1 = [0.02, 0.02] has 2 values; give 3: x, y, z.",
    "bodies.base.at=[0, 0]": " = [0, 0] has 2 values; give 3: x, y, z.",
    "bodies.base.plate.outline=[[0]]": ".1 = [0] has 1 value; give 2: x, y.",
    "bodies.base.box=[1, 1]": " = [1, 1] has 2 values; give 3: lengths along x, y, z.",
    "strike.nodes=[[0.1]]": ".1 = [0.1] has 1 value; give 2.",
}


@pytest.mark.parametrize("change", TOO_SHORT)
def test_a_list_that_is_too_short_is_refused_with_what_it_must_hold(change):
    with pytest.raises(InvalidScene) as refusal:
        scene("plate-on-bolts", (change,))
    key = change.partition("=")[0]
    assert str(refusal.value) == f"plate-on-bolts: {key}{TOO_SHORT[change]}"


@pytest.mark.parametrize(
    ("change", "words"),
    [("preload.force=3", "preload.force = 3"), ("contact.coefficient=0.5", "0.5 at the wall")],
)
def test_steady_forces_on_a_dashpot_wall_are_refused(change, words):
    plate = "wall={kind='dashpot', plate_thickness=5e-3}"
    with pytest.raises(InvalidScene, match=words):
        scene("rig-rigid", (plate, change))


def test_a_plate_is_the_dashpot_of_its_material_and_thickness():
    """Zener's 8 sqrt(D rho h): steel, 5 mm, by hand D = 210e9 * 1.25e-7 / (12 * 0.91) = 2403.8."""
    result = scene("rig-rigid", ("wall.kind=dashpot", "wall.plate_thickness=5e-3"))
    assert result.wall.density == 7850.0
    assert 1 / wall_of(result).mobility == pytest.approx(8 * (2403.85 * 39.25) ** 0.5, rel=1e-5)
    bare = scene("rig-rigid", ("wall={kind='dashpot', coefficient=2457.0}",))
    assert 1 / wall_of(bare).mobility == pytest.approx(2457.0)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\xef\xbb\xbf", "empty"),
        (b"", "empty"),
        (b"[chain", "not TOML"),
        (b"\xff\xfe", "UTF-8"),
        (b"name = 'x'", "[chain]"),
    ],
)
def test_a_broken_file_is_refused(tmp_path, content, words):
    path = tmp_path / "scene.toml"
    path.write_bytes(content)
    with pytest.raises(InvalidScene, match=words.replace("[", r"\[")):
        scene(str(path))


def test_a_missing_file_is_refused_with_the_nearest_scene():
    with pytest.raises(InvalidScene, match="'rig-rigid'"):
        scene("rig-rigit")


def test_parts_that_exclude_each_other_are_refused():
    moving = {**MINIMAL["chain"], "initial_velocity": [1.0, 0.0]}
    with pytest.raises(InvalidScene, match="initial_velocity"):
        resolved(minimal(chain=moving), "minimal")
    with pytest.raises(InvalidScene, match="nothing moves"):
        resolved({"chain": MINIMAL["chain"]}, "minimal")
    with pytest.raises(InvalidScene, match="nothing moves"):
        resolved({"chain": {**moving, "initial_velocity": [0.0, 0.0]}}, "minimal")
    with pytest.raises(InvalidScene, match="preload"):
        resolved(minimal(preload={"force": 2.0}), "minimal")


def test_a_byte_order_mark_is_no_part_of_a_scene(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(scene_text("rig-rigid").text, encoding="utf-8-sig")
    assert scene(str(path)) == scene("rig-rigid")


def test_damping_is_one_ratio_or_one_for_each_mode_of_the_hammer_test():
    with pytest.raises(InvalidScene, match=r"damping\.ratio has 2 values, 4 are allowed"):
        scene("rig-rom", ("damping.ratio=[0.01, 0.02]",))
    assert scene("rig-rom", ("damping.ratio=[0.01, 0.02, 0.01, 0.01]",))


def test_a_mesh_that_fits_no_memory_is_refused(monkeypatch):
    for seed in ("seed", "block_seed", "support_seed", "contact_seed"):
        with pytest.raises(InvalidScene, match=rf"mesh\.{seed} = 1e-09 m makes .* elements"):
            scene("rig-rom", (f"mesh.{seed}=1 nm", f"unusual=['mesh.{seed}']"))
    monkeypatch.setattr("beadwave.workflows.scene.rules.size.free_memory", lambda: 1e12)
    assert scene("rig-rom", ("mesh.contact_seed=1e-5", "mesh.seed=1e-3"))


@pytest.mark.parametrize(
    ("point", "words"),
    [
        ("[0]", "1 value; give 2"),
        ("[0, 0, 0]", "3 values; give 2"),
        ("[]", "0 values; give 2"),
        ("0", "must be a list of 2"),
    ],
)
def test_a_point_has_two_coordinates(point, words):
    with pytest.raises(InvalidScene, match=words):
        scene("rig-rom", (f"patch.point={point}",))


def test_dimensions_that_cannot_be_built_are_refused():
    for change, words in {
        "assembly.sheet_thickness=-1e-3": "sheet_thickness",
        "assembly.blok_x=0.1": "'block_x'",
        "assembly.poisson=0.5": "less than 0.5",
        "assembly.block.poisson=0.5": "less than 0.5",
        "assembly.washer_radius=0.05": "washer",
    }.items():
        with pytest.raises(InvalidScene, match=words):
            scene("rig-rom", (change,))


def test_a_rigid_joint_direction_is_infinite():
    result = scene("rig-rom", ("assembly.constraint=wires", "joints.head.kz=2e7"))
    assert result.bushings["head"].kz == 2e7
    assert math.isinf(result.bushings["head"].kx)
    assert resolved(_tables(result), "again") == result


def _tables(result):
    import tomllib

    return tomllib.loads(toml(result))


RAYLEIGH = ("damping.kind=rayleigh", "damping.frequency=[51, 8425]", "damping.ratio=[0.8, 0.0053]")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (RAYLEIGH[:2], "belong together"),
        ((*RAYLEIGH, "damping.alpha=3.0"), "keep one"),
        ((*RAYLEIGH[:2], "damping.ratio=[0.001, 0.5]"), "feeds energy into other modes"),
        ((*RAYLEIGH[:2], "damping.ratio=[0.8, 0.0053, 0.1]"), "3 values; give 2"),
    ],
)
def test_rayleigh_damping_by_two_frequencies_is_refused_where_it_means_nothing(changes, words):
    with pytest.raises(InvalidScene, match=words):
        scene("rig-rom", changes)


def test_rayleigh_damping_by_two_frequencies_has_their_ratios():
    table = scene("rig-rom", RAYLEIGH).damping
    zeta = coupling.damping_ratios(damping_law(table, []), 2 * np.pi * np.array([51.0, 8425.0]))
    np.testing.assert_allclose(zeta, [0.8, 0.0053], rtol=1e-12)


@pytest.mark.parametrize("key", ["assembly.young", "assembly.block.young"])
def test_an_assembly_softer_than_rubber_is_refused(key):
    with pytest.raises(InvalidScene, match=rf"{key} = 1000 Pa must be at least 1e\+06 Pa"):
        scene("rig-rom", (f"{key}=1 kPa", f"unusual=['{key}']"))


@pytest.mark.parametrize("changes", [(), ("assembly.block.young=70e9", "assembly.poisson=0.2")])
def test_the_chain_touches_the_material_that_the_block_is_meshed_with(changes):
    result = scene("rig-rom", changes)
    block = solid(result, "block")
    assert flat(result) == (block.young, block.poisson)
    same = scene("rig-rom", (*changes, f"wall.young={block.young}"))
    assert flat(same) == flat(result)


@pytest.mark.parametrize(
    ("key", "given", "own"), [("young", "7e+10", "2.2124e+11"), ("poisson", "0.21", "0.3")]
)
def test_a_surface_other_than_the_block_is_refused(key, given, own):
    told = rf"wall\.{key} = {re.escape(given)}.*{re.escape(own)}.*drop"
    with pytest.raises(InvalidScene, match=told):
        scene("rig-rom", (f"wall.{key}={given}",))


def test_a_preload_on_an_assembly_that_floats_is_refused_before_anything_is_computed():
    alone = ('assembly.parts=["block"]', "reduction.kind=free-modes")
    unloaded = (*alone, "preload.force=0")
    with pytest.raises(InvalidScene, match=r"preload\.force = 15\.0 acts on an assembly without"):
        require_start(scene("rig-rom", alone))
    with pytest.raises(InvalidScene, match="acts on an assembly without supports"):
        require_start(scene("cantilever", ("assembly.held=[]", "preload.force=1")))
    with pytest.raises(InvalidScene, match=r"leaf_springs\.offset = 0\.0015 acts on an"):
        require_start(scene("rig-rom", unloaded))
    require_start(scene("rig-rom", (*unloaded, "leaf_springs.offset=0")))
    require_start(scene("rig-rom"))
    require_start(scene("cantilever", ("preload.force=1",)))


TWO_BODIES = {
    "bodies": {
        "foot": {"box": [0.08, 0.06, 0.01], "seed": 0.005, "material": "steel"},
        "post": {"box": [0.01, 0.06, 0.08], "at": [0, 0, 0.045], "material": "steel"},
    },
    "assembly": {"held": ["foot:-z"], "touching": "tied"},
}


@pytest.mark.parametrize(
    ("change", "known"),
    [
        ("bodies.X.material=steel", "there is no body 'X', known are foot, post"),
        ("bodies.fot.seed=4mm", "there is no body 'fot', the nearest known is 'foot'"),
        ("bodies.fot.at=[0, 0, 1]", "there is no body 'fot', the nearest known is 'foot'"),
    ],
)
def test_a_change_of_an_unknown_body_is_refused_with_those_that_there_are(change, known):
    with pytest.raises(InvalidScene, match=known):
        scene(TWO_BODIES, [change])
    with pytest.raises(InvalidScene, match="there is no body 'X', the scene has none"):
        scene("rig-rom", ["bodies.X.material=steel"])


def test_a_body_that_the_changes_draw_is_added():
    cap = ["bodies.cap.material=steel", "bodies.cap.box=[0.01, 0.06, 0.01]"]
    assert scene(TWO_BODIES, [*cap, "bodies.cap.at=[0, 0, 0.09]"]).bodies["cap"].drawn == "box"


def test_a_change_of_one_number_of_a_named_material_leaves_its_others():
    changed = scene(TWO_BODIES, ["materials.steel.young=190e9"]).made_of("foot")
    steel = scene(TWO_BODIES).made_of("foot")
    assert changed.young == 190e9 != steel.young
    assert (changed.poisson, changed.density) == (steel.poisson, steel.density)
