"""The impact as a film, and as surfaces over time for ParaView."""

import re
from itertools import pairwise

import meshio
import numpy as np
import pytest
from PIL import Image

from command_line import beadwave

pytestmark = pytest.mark.pictures
SMALL = ("chain.count=4", "output.spheres=[1,4]", "output.samples=201", "time.duration=0.5e-3")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A short run against one mass on a spring."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        folder = tmp_path_factory.mktemp("run")
        changes = [f"--set={change}" for change in SMALL]
        assert beadwave("run", "rig-1dof", f"--out={folder}", *changes) == 0
    return folder


@pytest.mark.slow
def test_a_film_shows_the_impact_frame_by_frame(folder):
    assert beadwave("film", str(folder), "--out=film.gif", "--seconds=0.5") == 0
    with Image.open(folder / "film.gif") as film:
        assert film.n_frames == 10
        pictures = []
        for i in (0, 5, 9):
            film.seek(i)
            pictures.append(np.asarray(film.convert("RGB"), dtype=float))
    assert min(np.abs(second - first).max() for first, second in pairwise(pictures)) > 50


@pytest.mark.slow
def test_a_film_of_an_upright_chain_shows_it_whole(tmp_path, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    changes = [f"--set={change}" for change in (*SMALL, "gravity={}", "chain.count=9")]
    assert beadwave("run", "rig-rigid", f"--out={tmp_path / 'run'}", *changes) == 0
    assert beadwave("film", str(tmp_path / "run"), "--out=film.gif", "--seconds=0.5") == 0
    with Image.open(tmp_path / "run" / "film.gif") as film:
        view = np.asarray(film.convert("L"), dtype=float)[30:624]  # below the words
    rows, columns = np.nonzero(view < 240)
    assert min(rows.min(), 593 - rows.max(), columns.min(), 1247 - columns.max()) > 0
    assert np.ptp(rows) > 2 * np.ptp(columns)


@pytest.mark.slow
def test_paraview_gets_the_displacements_of_the_trajectory(folder):
    assert beadwave("film", str(folder), "--pvd") == 0
    entries = re.findall(
        r'timestep="(\S+)" part="(\d)" file="(\S+)"', (folder / "film.pvd").read_text()
    )
    with np.load(folder / "trajectory.npz") as run:
        t, x, wall = run["t"], run["x"] - run["x"][0], run["wall_x"] - run["wall_x"][0]
    assert float(entries[-1][0]) == pytest.approx(t[-1], rel=1e-6)
    for time, number, name in entries[100:104]:
        i = int(np.abs(t - float(time)).argmin())
        moved = meshio.read(folder / name).point_data["displacement"][:, 0]
        expected = x[i] if number == "1" else np.full(8, wall[i])
        np.testing.assert_allclose(moved, expected, atol=1e-6 * np.abs(x).max())


@pytest.mark.parametrize(
    ("options", "message"),
    [(["--out=film.avi"], ".mp4 or .gif"), (["--out=../film.gif"], "names a file in DIR")],
)
def test_a_name_that_is_no_film_is_refused(folder, options, message, capsys):
    assert beadwave("film", str(folder), *options) == 2
    assert message in capsys.readouterr().err


def test_a_folder_without_a_run_has_no_film(tmp_path, capsys):
    assert beadwave("film", str(tmp_path)) == 2
    assert "no finished run folder" in capsys.readouterr().err
