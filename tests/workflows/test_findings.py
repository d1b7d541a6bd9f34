"""What all studies share: modules of their folder, templates that say the numbers."""

import sys
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from jinja2 import UndefinedError

import beadwave
from beadwave.dem.waves.measures import exponent
from beadwave.workflows.evidence import catalogue, study
from beadwave.workflows.evidence.accuracy import batch, cost, peers, runs, time, wall_modes
from beadwave.workflows.evidence.accuracy.row import AccuracyRow
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.tables import Table, as_csv, records, short, text

FOLDER = Path(catalogue.__file__).parent
SHORT = ("chain.count=6", "output.spheres=[1,4]", "time.duration=0.8e-3")
STUDY = '''
"""A module."""

def {name}(scene, progress) -> {returns}:
    """Waves of {name}.

    Of no interest to the listing."""
'''


def test_a_study_has_a_template_beside_its_module_and_a_name_that_is_listed():
    folder = "accuracy"
    studies = catalogue.catalogue(folder)
    templates = {path.stem for path in (FOLDER / folder).glob("[!_]*.md")}
    modules = [entry.module.rpartition(".")[2] for entry in studies.values()]
    assert sorted(modules) == sorted(templates)  # one study to a module
    for name, entry in studies.items():
        assert name == entry.function.replace("_", "-") == name.lower()
        assert entry.shows.endswith(".") and len(entry.shows) <= 100


def test_a_module_put_into_the_folder_is_a_study_and_its_helpers_are_none(tmp_path, monkeypatch):
    studies = tmp_path / "workflows" / "studies"
    (studies / "accuracy").mkdir(parents=True)
    for name, returns in (("two_walls", "Finding"), ("helper", "float"), ("_hidden", "Finding")):
        (studies / "accuracy" / f"{name}.py").write_text(STUDY.format(name=name, returns=returns))
    monkeypatch.setattr(catalogue, "__file__", str(studies / "catalogue.py"))
    assert catalogue.listing("accuracy").split() == ["two-walls", "Waves", "of", "two_walls."]


def test_listing_imports_no_study():
    for name in [
        name for name in sys.modules if name.startswith("beadwave.workflows.evidence.stability.")
    ]:
        sys.modules.pop(name)
    assert "dashpot-wall" in catalogue.listing("stability")
    assert "beadwave.workflows.evidence.stability.walls" not in sys.modules


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


@pytest.fixture
def few_peers(monkeypatch):
    monkeypatch.setattr(peers, "peers", lambda: {"odeint": peers.odeint})
    monkeypatch.setattr(runs, "ASKED", (1e-2,))


def rows_of(*methods):
    """A quick run of each method to 1e-8, ours the quicker one."""
    return [
        AccuracyRow("", name, 0.0, 1e-8, 1e-3 * (1 + i), setting=1e-7)
        for i, name in enumerate(methods)
    ]


def test_the_study_of_schemes_says_orders_and_ratios(few_peers, monkeypatch):
    monkeypatch.setattr(time, "scheme_rows", lambda *_, **__: iter(rows_of("rkn6")))
    monkeypatch.setattr(time, "peer_rows", lambda *_: iter(rows_of("rkn6", "odeint")[1:]))
    finding = time.time(scene("rig-rigid", SHORT), lambda name: nullcontext())
    sentences = " ".join(finding.sentences)
    assert "the reference solution, rkn6a with a small step, differs from DOP853" in sentences
    assert "rkn6 takes 1 ms, odeint 2 ms (2 times as long)" in sentences and "rkn6 -" in sentences


@pytest.mark.slow
def test_the_study_of_wall_modes_says_what_a_mode_costs(few_peers, monkeypatch):
    monkeypatch.setattr(wall_modes, "MODES", (0, 1, 2, 3))
    monkeypatch.setattr(wall_modes, "COMPARED", 2)
    ours, theirs = rows_of("rkn6", "odeint")

    def at(row, k):
        return row._replace(parameter=k, seconds=(k + 1) * row.seconds)

    monkeypatch.setattr(wall_modes, "scheme_row", lambda *case: at(ours, case[-1]))
    monkeypatch.setattr(wall_modes, "scheme_rows", lambda *_, **__: ())
    monkeypatch.setattr(
        wall_modes, "peer_rows", lambda *_, parameter, **__: [at(theirs, parameter)]
    )
    finding = wall_modes.wall_modes(scene("rig-rigid", SHORT), lambda name: nullcontext())
    assert "no modes of its own" in finding.sentences[0]
    assert "takes 1 ms with a rigid wall, and with modes 1 ms + 1e+03 µs" in finding.sentences[-1]


def test_the_study_of_populations_says_runs_a_second(monkeypatch):
    monkeypatch.setattr(batch, "POPULATION", 16)
    many = SimpleNamespace(dt=1e-6, energy_error=np.zeros(3), n_steps=800)
    timed = cost.Timed(many, cost.Seconds(16e-3, 0.0), cost.Seconds(1.0, 0.0))
    monkeypatch.setattr(batch, "timed", lambda *_, **__: timed)
    monkeypatch.setattr(batch, "step_of_median", lambda *_: (1e-6, 1e-4))
    finding = batch.batch(scene("rig-rigid", SHORT), lambda name: nullcontext())
    assert finding.sentences[0].startswith("1,000 runs a second (rkn6, ")


def test_what_takes_minutes_is_left_out_by_default_named_and_brought_by_thorough(monkeypatch):
    class Entry(SimpleNamespace):
        def stated(self, name, default=None):
            return getattr(self, name, default)

        def __call__(self, scene, progress, *, finer=False):
            return Finding((Table(self.name, ("finer",), ((finer,),)),))

    studies = {
        "quick": Entry(name="quick", SCENE="rig-rigid"),
        "cut": Entry(name="cut", SCENE="rig-rigid", THOROUGH={"finer": True}, LEFT_OUT="2 mm"),
        "long": Entry(name="long", SCENE="rig-rigid", ALONE=True),
    }

    def chosen(folder, names):
        return {name: studies[name] for name in names or studies}

    monkeypatch.setattr(catalogue, "chosen", chosen)
    monkeypatch.setattr(catalogue, "catalogue", lambda folder: studies)

    def found(stage="all", **options):
        return catalogue.accuracy(stage, lambda usual: usual, lambda name: nullcontext(), **options)

    usual, whole = found(), found(thorough=True)
    assert list(usual) == ["quick", "cut"] and list(whole) == list(studies)
    assert usual["cut"].tables[0].rows == ((False,),) and whole["cut"].tables[0].rows == ((True,),)
    assert usual["cut"].sentences == ("Left out of cut: 2 mm; --thorough brings it.",)
    assert not usual["quick"].sentences and not whole["cut"].sentences
    assert list(found("long")) == ["long"] and catalogue.accuracy_alone() == ("long",)
    said = beadwave.accuracy().sentences[-1]
    assert said == "Left out: the stages long; --stage with the name runs one, --thorough all."
    assert len(beadwave.accuracy(thorough=True).sentences) == 0


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
