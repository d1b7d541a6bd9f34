"""What all studies share: modules of their folder, templates that say the numbers."""

from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from jinja2 import UndefinedError

from beadwave.dem.waves.measures import exponent
from beadwave.workflows.evidence import catalogue, study
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.report.tables import Table, as_csv, records, short, text

FOLDER = Path(catalogue.__file__).parent
STUDY = '''
"""A module."""

def {name}(scene, progress) -> {returns}:
    """Waves of {name}.

    Of no interest to the listing."""
'''


def test_a_study_has_a_template_beside_its_module_and_a_name_that_is_listed():
    studies = catalogue.catalogue("thesis")
    templates = {path.stem for path in (FOLDER / "thesis").glob("[!_]*.md")}
    modules = [entry.module.rpartition(".")[2] for entry in studies.values()]
    assert sorted(modules) == sorted(templates)  # one study to a module
    for name, entry in studies.items():
        assert name == entry.function.replace("_", "-") == name.lower()
        assert entry.shows.endswith(".") and len(entry.shows) <= 100


def test_a_module_put_into_the_folder_is_a_study_and_its_helpers_are_none(tmp_path, monkeypatch):
    studies = tmp_path / "workflows" / "studies"
    (studies / "thesis").mkdir(parents=True)
    for name, returns in (("two_walls", "Finding"), ("helper", "float"), ("_hidden", "Finding")):
        (studies / "thesis" / f"{name}.py").write_text(STUDY.format(name=name, returns=returns))
    monkeypatch.setattr(catalogue, "__file__", str(studies / "catalogue.py"))
    assert catalogue.listing("thesis").split() == ["two-walls", "Waves", "of", "two_walls."]


def test_a_template_says_paragraphs_and_refuses_a_number_that_nobody_computed(tmp_path):
    module = tmp_path / "fall.py"
    module.with_suffix(".md").write_text(
        "The body falls\n{{ way | milli | places(1) }} mm.\n\n\nB."
    )
    assert rendered(str(module), way=2e-3) == ("The body falls 2.0 mm.", "B.")
    with pytest.raises(UndefinedError, match="way"):
        rendered(str(module))


@pytest.mark.parametrize(
    ("written", "words"),
    [
        (study.places(-1e-9, 2), "0.00"),
        (study.places(float("nan"), 2), "-"),
        (study.percent(0.1234, 1), "12.3 %"),
        (study.between([0.25, 0.1, 0.2], 1), "0.1 to 0.2"),
        (study.between([0.1, 0.101], 1), "0.1"),
        (study.listed([1, 2, 3]), "1, 2 and 3"),
        (study.listed(["one"]), "one"),
        (study.verdict(None), "cannot be judged"),
    ],
)
def test_numbers_are_written_in_one_form(written, words):
    assert written == words


def test_a_table_is_aligned_for_a_person_and_exact_for_machines():
    table = Table("t", ("wall", "force"), (("steel", 1234.5), ("a", 0.00012345), ("b", np.nan)))
    assert text(table) == "wall      force\nsteel      1234\na      0.000123\nb             -"
    assert as_csv(table) == "wall,force\nsteel,1234.5\na,0.00012345\nb,\n"
    assert records(table)[2] == {"wall": "b", "force": None}
    assert short(1e5) == "1e+05" and short(None) == "-"


def test_the_exponent_of_a_power_law_is_found():
    x = np.geomspace(1.0, 9.0, 5)
    assert exponent(x, 3.0 * x**0.4) == pytest.approx(0.4, abs=1e-12)


def test_from_the_second_piece_on_a_study_says_how_many_are_left_and_how_long(monkeypatch):
    clock = iter((0.0, 10.0, 16.0))
    monkeypatch.setattr(study, "perf_counter", lambda: next(clock))
    shown, worked = [], []

    @contextmanager
    def progress(name):
        shown.append(name)
        yield
        worked.append(name)

    for piece in study.counted((1, 2, 3), progress, "{} mm".format):
        assert len(shown) == piece == len(worked) + 1  # the stage runs while the piece is worked on
    assert shown == worked == [
        "1 mm", "2 mm (2 of 3, about 20 s left)", "3 mm (3 of 3, about 8 s left)",
    ]  # fmt: skip
