"""Materials by name, and the contact that yields first."""

import numpy as np
import pytest

from beadwave import dem
from beadwave.workflows.run.api import impact
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.named_materials import NAMED, named_material
from beadwave.workflows.scene.toml import resolved, toml

CHAIN = {"count": 3, "radius": 0.006, "material": "bearing-steel"}


def scene_of(**tables):
    return resolved({"chain": CHAIN, "striker": {"velocity": 0.3}, **tables}, "materials")


def test_a_name_stands_for_its_numbers_and_numbers_beside_it_count():
    scene = scene_of(wall={"kind": "half-space", "material": "Aluminium 6082", "young": 71e9})
    assert (scene.wall.young, scene.wall.poisson, scene.wall.yield_stress) == (71e9, 0.3, 260e6)
    assert scene.chain.density == NAMED["bearing-steel"].density


def test_a_list_of_names_is_one_material_for_each_sphere():
    scene = scene_of(chain={**CHAIN, "material": ["steel", "glass", "steel"]})
    assert scene.chain.young == (210e9, 70e9, 210e9)
    assert scene.chain.density == (7850.0, 2500.0, 7850.0)


def test_a_body_may_be_made_of_a_named_material():
    tables = {
        "assembly": {"held": ["bar:-x"]},
        "bodies": {"bar": {"box": [0.1, 0.02, 0.02], "seed": 0.01, "material": "titanium"}},
    }
    scene = resolved(tables, "bar")
    assert scene.made_of("bar").young == NAMED["titanium"].young


def test_a_scene_with_named_materials_is_read_back_as_it_was():
    import tomllib

    scene = scene_of(wall={"kind": "1dof", "frequency": 500.0, "mass": 1.0, "material": "brass"})
    assert resolved(tomllib.loads(toml(scene)), "materials") == scene


@pytest.mark.parametrize("table", ["chain", "wall"])
def test_an_unknown_material_is_refused_with_those_that_are_known(table):
    wall = {"kind": "half-space", "material": "stell" if table == "wall" else "steel"}
    chain = {**CHAIN, "material": "stell"} if table == "chain" else CHAIN
    with pytest.raises(InvalidScene, match=rf"{table}: material = 'stell' .* steel, bearing-steel"):
        scene_of(chain=chain, wall=wall)


@pytest.mark.parametrize(
    ("names", "known"),
    [
        (("Steel", "S355", "structural steel"), "steel"),
        (("aluminum-6061", "Al 6061-T6", "6061", "alu_6061"), "aluminium-6061"),
        (("EN AW-6082", "EN-AW-6082-T6", "Aluminium 6082"), "aluminium-6082"),
        (("stainless steel 304", "AISI 304", "inox-304"), "stainless-304"),
        (("acrylic", "Plexiglass", "PMMA", "Acrylic glass"), "pmma"),
        (("Ti-6Al-4V", "titanium grade 5"), "titanium"),
        (("100Cr6", "52100"), "bearing-steel"),
    ],
)
def test_a_material_has_the_names_that_people_write(names, known):
    for name in names:
        assert named_material(name) is NAMED[known]
        body = {"box": [0.1, 0.02, 0.02], "seed": 0.01, "material": name}
        scene = resolved({"assembly": {"held": ["bar:-x"]}, "bodies": {"bar": body}}, "bar")
        assert scene.made_of("bar").young == NAMED[known].young


@pytest.mark.parametrize(
    ("name", "members"),
    [
        ("aluminium", "aluminium-6082, aluminium-6061, aluminium-7075"),
        ("Aluminum", "aluminium-6082, aluminium-6061, aluminium-7075"),
        ("stainless", "stainless-304"),
        ("stainless steel", "stainless-304"),
        ("polymer", "pmma, ptfe"),
    ],
)
def test_a_family_is_refused_with_the_grades_that_are_known(name, members):
    with pytest.raises(InvalidScene, match=f"names a family, there are {members}; take one"):
        scene_of(chain={**CHAIN, "material": name})
    body = {"box": [0.1, 0.02, 0.02], "seed": 0.01, "material": name}
    tables = {"assembly": {"held": ["bar:-x"]}, "bodies": {"bar": body}}
    with pytest.raises(InvalidScene, match=f"names a family, known of it: {members}; take"):
        resolved(tables, "bar")
    own = {"young": 71e9, "poisson": 0.33, "density": 2700.0}
    assert resolved(tables | {"materials": {name: own}}, "bar").made_of("bar").young == 71e9


@pytest.mark.parametrize("name", NAMED)
def test_named_materials_are_solids(name):
    m = NAMED[name]
    assert 1e9 < m.young < 1e12 and 0 < m.poisson < 0.5 and 1e3 < m.density < 2e4
    assert 5e-4 < m.yield_stress / m.young < 0.04 and len(m.source) > 20


def test_yield_is_judged_by_the_softer_side_of_each_contact():
    # the same force at all contacts: the one beside the soft wall yields first, though the
    # pressure between spheres is larger
    chain, force = dem_chain(), np.full((2, 3), 102.0)
    strain = dem.strain(
        chain, 210e9, force, np.zeros((2, 3)), yield_stress=2e9, of_wall=(70e9, 260e6)
    )
    assert (strain.contact, strain.yield_stress) == ("at the wall", 260e6)
    assert strain.yield_pressure == pytest.approx(1.6 * 260e6)
    (sentence,) = dem.outside(strain)
    assert "contact at the wall reaches" in sentence and "1.6 times 0.26 GPa" in sentence

    hard = dem.strain(chain, 210e9, force, np.zeros((2, 3)), yield_stress=2e9, of_wall=(7e10, 9e9))
    assert hard.contact == "of spheres 1 and 2"


@pytest.mark.parametrize(
    ("at_rest", "remedy"),
    [
        (0.0, "reduce the striker's velocity"),
        (60.0, "59 % of its force are there before the impact, of preload and weight: reduce"),
        # an eighth of the force has half of the pressure, which is 1.7 times the limit by itself
        (12.75, "12 % of its force are there before the impact"),
    ],
)
def test_a_preload_that_presses_too_hard_is_told_from_a_striker_that_does(at_rest, remedy):
    """Of a wall without a yield stress that is its own the remedy names the wall's."""
    chain, force = dem_chain(), np.array([[at_rest] * 3, [102.0] * 3])
    strain = dem.strain(
        chain, 210e9, force, np.zeros((2, 3)), yield_stress=2e11, of_wall=(70e9, 260e6)
    )
    (sentence,) = dem.outside(strain)
    assert remedy in sentence
    unknown = dem.strain(
        chain, 210e9, force, np.zeros((2, 3)), yield_stress=2e11, of_wall=(70e9, np.nan)
    )
    (sentence,) = dem.outside(unknown)
    assert "or state the yield_stress of the wall of a harder one" in sentence


def dem_chain():
    """Three steel spheres of 6 mm before an aluminium wall."""
    from beadwave.workflows.stages.chain.chain import chain

    return chain(
        scene_of(
            chain={**CHAIN, "young": 210e9},
            wall={"kind": "half-space", "material": "aluminium-6082"},
        )
    )


def test_a_sphere_on_aluminium_is_warned_of_at_the_pressure_of_hertz():
    # R = 6 mm on aluminium at 102 N: p0 = (6 F E*^2 / (pi^3 R^2))^(1/3)
    strain = dem.strain(
        dem_chain(), 210e9, np.array([[0.0, 0.0, 102.0]]), np.zeros((1, 3)),
        yield_stress=2e9, of_wall=(70e9, 260e6),
    )  # fmt: skip
    E_star = 1 / (0.91 / 210e9 + 0.91 / 70e9)
    p0 = (6 * 102.0 * E_star**2 / (np.pi**3 * 0.006**2)) ** (1 / 3)
    assert strain.pressure == pytest.approx(p0, rel=1e-9)


def test_the_warning_of_a_run_names_the_contact(monkeypatch):
    scene = {
        "chain": CHAIN, "striker": {"velocity": 0.5},
        "wall": {"kind": "half-space", "material": "aluminium-6082"},
    }  # fmt: skip
    warnings = impact(scene).summary.warnings
    assert any("contact at the wall reaches" in sentence for sentence in warnings)
