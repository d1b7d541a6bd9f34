"""Names in STEP files as systems write them: encodings, control directives, entity numbers."""

import re

import pytest

from beadwave.geometry import InvalidGeometry
from beadwave.geometry.cad.occ import model, write_step
from beadwave.geometry.cad.selectors import faces
from beadwave.geometry.cad.shapes import Box

from command_line import beadwave

THREE = {f"part{i}": Box((0.02, 0.01, 0.01), at=(0.02 * i, 0, 0)) for i in range(3)}


def boxes(path, *names, encoding="utf-8"):
    """Three boxes in a row, called as a file has it, within apostrophes."""
    write_step(THREE, path)
    text = path.read_text(encoding="latin-1")
    for i, name in enumerate(names):
        text = text.replace(f"'part{i}'", f"'{name}'")
    path.write_bytes(text.encode(encoding))
    return path


def names_of(path):
    with model({}, path) as cad:
        centres = {name: round(1e3 * body.centroid[0]) for name, body in cad.bodies.items()}
    assert list(centres.values()) == [0, 20, 40]
    return list(centres)


@pytest.mark.parametrize(
    ("written", "read"),
    [
        (r"Welle \X\D850", "Welle-Ø50"),
        (r"Welle \X2\00D8\X0\50", "Welle-Ø50"),
        (r"Welle \S\X50", "Welle-Ø50"),
        (r"\PB\Wa\S\3", "Wał"),
        (r"\X2\652F67B6\X0\ \X4\0001F600\X0\.", "支架-."),
        ("Welle Ø50", "Welle-Ø50"),
        ("支架", "支架"),
        ("Träger ''A''/2 | x", "Träger-A-2-x"),
        ("lid/base", "lid-base"),
        ("a,b;c:d", "a-b-c-d"),
        (r"C:\\parts\\lid", "C-parts-lid"),
        ("#17", "17"),
        (");#5=X(", "5-X"),
        ("/* lid */", "lid"),
        ("x" * 1000, "x" * 60),
        ("", "assembly"),  # the name of what it is a part of
        ("''", "body"),
        ("/", "body"),
        ("**", "body"),
    ],
)
def test_a_body_is_called_as_a_person_reads_its_name(tmp_path, written, read):
    path = boxes(tmp_path / "three.step", written)
    assert names_of(path) == [read, "part1", "part2"]


def test_names_in_latin_1_are_read_as_such(tmp_path):
    path = boxes(tmp_path / "latin.step", "Welle Ø50", "Welle Ø60", "Träger 1", encoding="latin-1")
    assert names_of(path) == ["Welle-Ø50", "Welle-Ø60", "Träger-1"]


def test_numbers_of_equal_names_pass_by_names_that_end_in_them(tmp_path):
    assert names_of(boxes(tmp_path / "a.step", "a", "a-1", "a")) == ["a-2", "a-1", "a-3"]
    unnamed = boxes(tmp_path / "b.step", "", "", "body")
    assert names_of(unnamed) == ["assembly-1", "assembly-2", "assembly-3"]
    long = "x" * 70
    assert names_of(boxes(tmp_path / "c.step", long, f"{long}y")) == [
        f"{'x' * 60}-1", f"{'x' * 60}-2", "part2"
    ]  # fmt: skip


def test_names_of_any_script_are_written_and_read_back(tmp_path):
    named = dict(zip(("Welle-Ø50", "支架", "a+b_c.d"), THREE.values(), strict=True))
    write_step(named, tmp_path / "three.step")
    assert (tmp_path / "three.step").read_bytes().isascii()
    assert names_of(tmp_path / "three.step") == list(named)


@pytest.mark.parametrize("label", ["#{}", "{}"])
def test_faces_and_shells_called_by_their_entity_number_have_no_name(tmp_path, label):
    path = boxes(tmp_path / "labelled.step")
    kinds = r"(#(\d+) = (?:ADVANCED_FACE|CLOSED_SHELL|MANIFOLD_SOLID_BREP)\()'[^']*'"
    text = path.read_text()
    path.write_text(re.sub(kinds, lambda m: f"{m[1]}'{label.format(m[2])}'", text))
    with model({}, path) as cad:
        sides = [b.upper - b.lower for b in cad.bodies.values()]
        names = {face.name for body in cad.bodies.values() for face in body.faces}
    assert len(sides) == 3 and names == {""}
    assert sides[0] == pytest.approx([0.02, 0.01, 0.01], abs=1e-6)


def test_a_face_is_picked_by_its_name_in_plain_letters(tmp_path):
    path = boxes(tmp_path / "named.step")
    text = path.read_text().replace(
        "ADVANCED_FACE(''", r"ADVANCED_FACE('Gr\X\F6\S\_e ''A'' (#99)'", 1
    )
    path.write_text(text)
    with model({}, path) as cad:
        assert faces("#Größe 'A' (#99)", cad.bodies).body == "part0"


@pytest.mark.usefixtures("files_read_here")
def test_a_scene_names_a_body_in_its_own_letters(tmp_path, capsys):
    path = boxes(tmp_path / "three.step", r"Welle \X\D850", "支架", "Träger ''A''/2 | x")
    (tmp_path / "mine.toml").write_text(
        f"""materials.steel = {{ young = 210e9, poisson = 0.3, density = 7850.0 }}
assembly = {{ step = "{path}", held = ["Welle-Ø50:-x"], material = "steel", touching = "tied" }}
strike = {{ on = "Träger-A-2-x:+x" }}
[bodies."支架"]
seed = 0.005
""",
        encoding="utf-8",
    )
    assert beadwave("look", tmp_path / "mine.toml") == 0
    report = capsys.readouterr().out
    assert "refuses" not in report and "Träger-A-2-x" in report


def test_an_assembly_of_other_files_names_them(tmp_path):
    path = boxes(tmp_path / "top.step")
    whole = path.read_text()
    refers = "DATA;\n#90001 = DOCUMENT_FILE('LID.stp','','',#2,'',$);\n"
    refers += "#90002 = DOCUMENT_FILE('top.step','','',#2,'',$);\n"
    refers += "#90003 = DOCUMENT_FILE('plan.pdf','','',#2,'',$);\n"
    path.write_text(whole.replace("DATA;", refers))
    with model({}, path) as cad:
        assert (len(cad.bodies), cad.elsewhere) == (3, ("LID.stp",))
    # without solids of its own
    path.write_text(re.sub("MANIFOLD_SOLID_BREP", "GEOMETRIC_SET", path.read_text()))
    with pytest.raises(InvalidGeometry, match=r"its parts are in other files \(LID\.stp\)"):
        names_of(path)
