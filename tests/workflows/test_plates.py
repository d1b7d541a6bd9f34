"""Plates of finite elements as walls, and the two studies made with them."""

from contextlib import nullcontext
from functools import cache

import numpy as np
import pytest

from beadwave import coupling
from beadwave.workflows.evidence import catalogue
from beadwave.workflows.evidence.thesis import plates
from beadwave.workflows.evidence.thesis.boundary_distance import (
    BoundaryDistanceOptions,
    boundary_distance,
)
from beadwave.workflows.evidence.thesis.collision import first_contact
from beadwave.workflows.evidence.thesis.wall_thickness import WallThicknessOptions, wall_thickness
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report.finding import write
from beadwave.workflows.report.tables import records
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.toml import resolved
from beadwave.workflows.stages.chain import start
from beadwave.workflows.stages.impact import impact
from beadwave.workflows.stages.walls import wall_of
from beadwave.workflows.stages.warnings import thick_plate

RISE = 164e-6  # s, the chain's contact with a half-space of its steel


def quiet(stage):
    return nullcontext()


@cache
def study(name):
    """Few plates and distances; modes doubled is the one variation of a mesh."""
    usual = scene("rig-half-space")
    if name == "wall-thickness":
        options = WallThicknessOptions(
            ratios=(2.0, 4.0, 5.0), n_curve=3, factors={"modes doubled": {"cutoff_hz": 2.0}}
        )
        return wall_thickness(usual, quiet, options)
    options = BoundaryDistanceOptions(
        ratios=(2.0, 4.0), diameters=(0.4, 1.2, 2.0, 3.2, 4.0), drawn=(0.4,), factors={}
    )
    return boundary_distance(usual, quiet, options)


def column(finding, name, **where):
    rows = records(finding.tables[0])
    return np.array([row[name] for row in rows if where.items() <= row.items()])


def solid(ratio, **changes):
    rig = scene("rig-half-space")
    plate = plates.steel(rig, plates.diameter(rig) / ratio)
    size = plates.sizes(plate, RISE, RISE)._replace(**changes)
    return rig, plate, plates.middle_wall(plate, size)


@pytest.mark.parametrize("ratio", [2.0, 4.0])
def test_a_sphere_rebounds_from_a_solid_plate_as_from_zeners(ratio):
    """Issue's bound 3 % before echoes return; measured 0.9 % and 1.6 %, a plate that is not thin
    against its waves (k h = 0.4 and 0.3) gives way more."""
    rig, plate, wall_of_solid = solid(ratio)
    zener = plates.rebound(rig, coupling.infinite_plate(plate))
    assert plates.rebound(rig, wall_of_solid) == pytest.approx(zener, rel=0.03)
    assert plates.rebound(rig, wall_of_solid) < zener


def test_edges_that_answer_within_the_contact_are_felt():
    """The size of the plate matters only then: a third of it gives the sphere more back."""
    size = plates.sizes(solid(4.0)[1], RISE, RISE)
    rig, plate, small = solid(4.0, reach=size.reach / 3)
    zener = plates.rebound(rig, coupling.infinite_plate(plate))
    assert abs(plates.rebound(rig, small) / zener - 1) > 0.1


@pytest.mark.slow
def test_thinner_plates_send_less_back_and_take_more():
    finding = study("wall-thickness")
    for model in ("infinite (Zener)", "solid"):
        assert np.all(np.diff(column(finding, "arr", model=model)) < 0)
        assert np.all(np.diff(column(finding, "lost_%", model=model)) > 0)
    # the thicker, the more Zener's thin plate leaves out
    lost = [column(finding, "lost_%", model=m) for m in ("solid", "infinite (Zener)")]
    assert np.all(np.diff(lost[0] / lost[1]) < 0) and np.all(lost[0] > lost[1])


@pytest.mark.slow
def test_modes_beyond_those_kept_answer_at_once():
    """Doubled modes change ARR by 4e-5 (wall-thickness) at D/t = 4."""
    finding = study("wall-thickness")
    base, more = (
        column(finding, "arr", model=model, d_over_t=4.0)[0]
        for model in ("solid", "solid, modes doubled")
    )
    assert more == pytest.approx(base, abs=2e-4)


@pytest.mark.slow
def test_a_clamped_edge_stiffens_the_plate_until_it_is_out_of_reach():
    """Beyond the bending waves' reach the plate is the infinite one, within 3 % as above."""
    rig, finding = scene("rig-half-space"), study("boundary-distance")
    for ratio in (2.0, 4.0):
        arr = column(finding, "arr", d_over_t=ratio)
        plate = plates.steel(rig, plates.diameter(rig) / ratio)
        infinite = plates.collision(rig, coupling.infinite_plate(plate)).arr
        half_space = 0.944
        assert arr[0] == pytest.approx(half_space, abs=0.03) and arr[0] > arr[1] > arr[2]
        np.testing.assert_allclose(arr[-2:], infinite, rtol=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wall-thickness", "boundary-distance"])
def test_the_studies_answer_the_thesis_and_draw(name, tmp_path):
    finding = study(name)
    assert sum("Thesis" in sentence for sentence in finding.sentences) >= 3
    write(finding, RunFolder(tmp_path))
    picture = tmp_path / "figures" / f"study_{name.replace('-', '_')}.png"
    assert picture.stat().st_size > 50_000


def test_a_first_collision_ends_where_the_force_does_though_an_echo_strikes_harder():
    t = np.linspace(0.0, 1.0, 1001)
    force = np.where(t < 0.3, np.sin(np.pi * t / 0.3), 0.0)
    force = force + np.where((t > 0.5) & (t < 0.7), 2.0 * np.sin(np.pi * (t - 0.5) / 0.2), 0.0)
    contact, again = first_contact(t, force)
    assert contact.end == pytest.approx(0.3, abs=2e-3) and contact.start < 2e-3
    assert again == pytest.approx(0.5, abs=3e-3)


@pytest.mark.parametrize(("thickness", "warned"), [(0.01, False), (0.08, True)])
def test_a_run_on_a_plate_too_thick_for_zener_says_so(thickness, warned):
    """k h = 0.35 and 0.99 for the contact's 164 us."""
    rig = scene("rig-half-space", ("wall.kind=dashpot", f"wall.plate_thickness={thickness}"))
    sentences = list(thick_plate(rig, impact(rig, start(rig), wall_of(rig)).trajectory))
    assert any("k h = 0.99" in sentence for sentence in sentences) == warned
    assert any("thick relative to" in sentence for sentence in sentences) == warned


def test_a_scene_without_a_wave_is_refused():
    chain = {"count": 3, "radius": 0.01, "density": 7800.0, "young": 2e11, "poisson": 0.3}
    short = resolved({"name": "s", "chain": chain, "striker": {"velocity": 1.0}}, "s")
    with pytest.raises(InvalidScene, match=r"chain\.count = 3"):
        catalogue.study("wall-thickness", short, quiet)
