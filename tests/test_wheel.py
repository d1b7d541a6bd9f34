"""Content that `pip install` of the wheel adds to other packages."""

import os
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("geometry", "fem", "rom", "dem", "coupling", "workflows")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the content of the wheel that this checkout makes."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    ZipFile(wheel).extractall(folder / "site-packages")
    return folder / "site-packages"


def test_the_wheel_puts_one_package_into_site_packages(installed):
    names = {path.name for path in installed.iterdir()}
    assert names == {"beadwave", "beadwave-0.1.0.dist-info"}


def test_the_wheel_holds_every_file_of_the_rooms_and_the_licences_of_what_it_ships(installed):
    def files(folder):
        paths = (path for path in folder.rglob("*") if path.is_file())
        return {path.relative_to(folder) for path in paths if "__pycache__" not in path.parts}

    for room in ROOMS:
        assert files(installed / "beadwave" / room) == files(ROOT / room), room
    licences = {path.name for path in next(installed.glob("*.dist-info")).rglob("*LICENSE")}
    assert licences == {"LICENSE", "ogl.LICENSE", "uplot.LICENSE"}


@pytest.mark.slow
def test_the_wheel_runs_where_the_checkout_is_not_on_the_path(installed, tmp_path):
    command = [sys.executable, "-P", "-m", "beadwave", "impact", "rig-1dof", "--json"]
    environment = os.environ | {
        "PYTHONPATH": str(installed), "BEADWAVE_CACHE_DIR": str(tmp_path / "cache"),
    }  # fmt: skip
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and '"peak_wall_force_N"' in done.stdout, done.stderr
    where = "import beadwave.fem; print(beadwave.fem.__file__)"
    done = subprocess.run(
        [sys.executable, "-P", "-c", where], env=environment, capture_output=True, text=True
    )
    assert Path(done.stdout.strip()).is_relative_to(installed)
