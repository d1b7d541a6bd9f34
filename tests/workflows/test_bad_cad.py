"""Bad CAD by command: status 2 and one sentence that says what is wrong and what to do."""

from pathlib import Path
from types import SimpleNamespace

import gmsh
import numpy as np
import pytest

from beadwave.geometry.cad.occ import model, write_step
from beadwave.geometry.cad.shapes import Box, Cylinder
from beadwave.geometry.cad.solids import require_size
from beadwave.geometry.cad.step_file import check_step, n_solids
from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.meshing.gmsh_session import session, silent
from beadwave.workflows.files.step import require_step

from command_line import beadwave

pytestmark = pytest.mark.usefixtures("shared_cache", "files_read_here")

SCENE = """
materials.steel = {{ young = 210e9, poisson = 0.3, density = 7850.0 }}
[assembly]
step = "bad.step"
material = "steel"
touching = "tied"
held = ["{held}"]
"""
CUBE = Box((0.04, 0.04, 0.04))
ON_TOP = Box((0.04, 0.04, 0.04), at=(0, 0, 0.04))


def step_of(**shapes):
    write_step(shapes, Path("bad.step"))


def rewritten(old, new, **shapes):
    step_of(**shapes)
    text = Path("bad.step").read_text()
    assert old in text
    Path("bad.step").write_text(text.replace(old, new))


def surfaces():
    with session(), silent():
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write("bad.step")


def foil():
    with session(), silent():
        gmsh.model.occ.addBox(0, 0, 0, 0.1, 0.1, 4e-7)
        gmsh.model.occ.synchronize()
        gmsh.write("bad.step")


def cut_off():
    step_of(a=CUBE)
    text = Path("bad.step").read_text()
    Path("bad.step").write_text(text[: len(text) // 2])


def test_a_step_file_that_a_script_draws_says_so(capsys):
    """The example's scene in a fresh checkout."""
    Path("bad.py").write_text("")
    Path("mine.toml").write_text(SCENE.format(held="a:-z"), encoding="utf-8")
    assert beadwave("modes", "mine.toml") == 2
    assert "bad.step does not exist; draw it first: python " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("make", "held", "message"),
    [
        (lambda: Path("bad.step").write_text(""), "a:-z", "bad.step is empty"),
        (cut_off, "a:-z", "is cut off before END-ISO-10303-21"),
        (surfaces, "a:-z", "holds surfaces without a volume; export its bodies as solids"),
        (foil, "body:-z", "has no volume (4e-09 m^3): its thickness is zero"),
        (lambda: rewritten("'b'", "'a'", a=CUBE, b=ON_TOP), "a:-z",
         'no body is called "a"; there are "a-1", "a-2"'),
        (lambda: step_of(a=CUBE), "a@0.02,0.02,0.0", "is as near to a plane"),
        (lambda: step_of(a=CUBE, b=Box((0.01,) * 3)), "a:-z", '"b" lies inside "a"'),
        (lambda: step_of(a=CUBE, b=Box((0.04,) * 3, at=(0.03, 0, 0))), "a:-z", "overlap by"),
        (lambda: rewritten(".MILLI.,.METRE.", "$,.METRE.", a=CUBE), "a:-z", "is 40 x 40 x 40 m"),
        (
            lambda: step_of(a=CUBE, b=Cylinder(0.01, 0.04, at=(0, 0, 0.03), turn=(90, 0, 0))),
            "a:-z", "meet along a line or at a point",
        ),
        (
            lambda: step_of(a=CUBE, b=Box((0.04,) * 3, at=(0, 0, 0.0405))),
            "a:-z", "miss each other by 0.5 mm",
        ),
    ],
)  # fmt: skip
def test_bad_cad_is_refused_in_a_sentence(make, held, message, capsys):
    make()
    Path("mine.toml").write_text(SCENE.format(held=held), encoding="utf-8")
    assert beadwave("modes", "mine.toml") == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert message in error[-1] and "Traceback" not in "".join(error)


def test_a_step_file_that_lost_a_line_is_damaged(capsys):
    """A file that lost lines was read with a body less, or told to be in other units."""
    step_of(a=CUBE, b=ON_TOP)
    lines = Path("bad.step").read_text().splitlines(keepends=True)
    held = [i for i, line in enumerate(lines) if line.startswith("#")]
    for i in (held[len(held) // 3], held[len(held) // 2], held[2 * len(held) // 3]):
        Path("bad.step").write_text("".join([*lines[:i], *lines[i + 1 :]]))
        with pytest.raises(InvalidGeometry, match=r"is damaged: it (refers|describes)"):
            require_step(Path("bad.step"))


def test_a_step_file_with_a_solid_that_cannot_be_read_is_damaged(monkeypatch):
    step_of(a=CUBE)
    monkeypatch.setattr("beadwave.geometry.cad.occ.n_solids", lambda path: 2)
    with pytest.raises(InvalidGeometry, match="describes 2 solids, of which 1 can be read"):
        with model({}, Path("bad.step")):
            pass


def test_names_with_signs_of_references_are_no_damage():
    step_of(a=CUBE)
    text = Path("bad.step").read_text()
    Path("bad.step").write_text(text.replace("ADVANCED_FACE(''", "ADVANCED_FACE('it''s #9999'"))
    assert n_solids(Path("bad.step")) == 1
    check_step(Path("bad.step"))


def test_a_point_far_off_is_damage_and_a_thousand_times_too_large_another_unit():
    def bodies(*sides):
        faces = [SimpleNamespace(lower=np.zeros(3), upper=np.full(3, side)) for side in sides]
        complete = np.full(3, max(sides))
        return {"a": SimpleNamespace(faces=faces, lower=np.zeros(3), upper=complete)}

    with pytest.raises(InvalidGeometry, match=r"smaller than 0.02 m: its file is damaged"):
        require_size(bodies(0.01, 0.02, 0.02, 0.03, 100.0), of_file=True)
    with pytest.raises(InvalidGeometry, match="is in other units than it says"):
        require_size(bodies(10.0, 20.0, 20.0, 30.0, 100.0), of_file=True)
