"""The documentation: what it shows runs, what it names is there."""

import importlib.util
import re
import shutil
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import beadwave
from beadwave import dem, rom
from beadwave.coupling.contact_response import ContactResponse
from beadwave.workflows.commands.app import COMMANDS, built
from beadwave.workflows.files.scene import built_in
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.run.run import IMPACT_FILES

from signal_guard import signals_restored

pytestmark = pytest.mark.pictures

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


def loaded(name):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


COMMANDS_OF = loaded("run_commands")
QUICK = [name for name, page in COMMANDS_OF.pages().items() if not COMMANDS_OF.is_slow(page)]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_what_a_page_shows_is_what_its_commands_print(name):
    assert COMMANDS_OF.run(COMMANDS_OF.pages()[name]) == []


def test_the_python_of_the_readme_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(
        r"^```python\n(.*?)^```", (ROOT / "README.md").read_text("utf-8"), re.M | re.S
    )
    names = {}
    exec(code, names)
    stated = float(re.search(r"# (\d+) N", code)[1])
    assert names["result"].summary.peak_wall_force_N == pytest.approx(stated, abs=0.5)


@pytest.mark.slow
def test_the_readme_states_the_numbers_of_its_run(tmp_path):
    summary = beadwave.run("rig-rom", out=tmp_path / "run").summary
    errors = summary.error_estimate
    force = next(error for error in summary.errors if error.name == "peak_wall_force_N")
    text = (ROOT / "README.md").read_text("utf-8")
    for stated in (
        f"{summary.peak_wall_force_N:.0f} N at the wall",
        f"{errors.time:.1e} (time)".replace("e-0", "e-"),
        f"{errors.reduction:.1e} (reduction)".replace("e-0", "e-"),
        f"{100 * errors.mesh:.1f} % (mesh)",
        f"{summary.peak_wall_force_N:.0f} N ± {100 * force.total / force.value:.2g} %",
    ):
        assert stated in text


def test_a_line_that_fails_is_an_error(tmp_path):
    page = tmp_path / "wrong.md"
    page.write_text("```sh\nbeadwave impact no-such-scene\n```\n")
    with pytest.raises(subprocess.CalledProcessError):
        COMMANDS_OF.run(page)


def test_commands_options_and_scenes_of_the_pages_are_there():
    known = {name: built(name) for name in COMMANDS}
    for page in (*DOCS.glob("*.md"), ROOT / "README.md"):
        for line in re.findall(r"beadwave ([a-z]+(?: [^\n`|]*)?)", page.read_text("utf-8")):
            command, _, rest = line.partition(" ")
            if command not in known:
                continue
            options = {option for p in known[command].params for option in p.opts}
            assert set(re.findall(r"(--[a-z-]+)", rest)) <= {*options, "--help"}, line
            assert set(re.findall(r"\brig-[\w-]*\w", rest)) <= set(built_in()), line


def test_every_command_has_its_help_on_the_page():
    text = (DOCS / "commands.md").read_text(encoding="utf-8")
    assert all(f"beadwave {name} --help" in text for name in COMMANDS)


QUOTED = """\
                 time of flight TOF  1.18 ms ± 0.021 %
                 errors  time step 0.8 ppm
mode    Hz  MAC
---------------
   1  61.2  1.00
...
   9  4126  0.98
...
case           accurate  seconds
time-reversal         4     25.2

contact      +-  damping       ±  slips
      3  0.0031  1.187 %  0.02 %   42 %

21 cases: 21 done; 37.9 s, 120 MB; evidence 34.3 +- 0.0052
"""


@pytest.mark.parametrize(
    ("quoted", "printed"),
    [
        ("1.18 ms", "1.19 ms"),  # a unit in the last place
        ("± 0.021 %", "± 0.029 %"),  # an error, rounded by another processor
        ("± 0.021 %", "± 205 ppm"),
        ("time step 0.8 ppm", "time step 0.7 ppm"),
        ("61.2", "61.79"),  # less than a hundredth
        ("4126", "4130"),
        ("37.9 s, 120 MB", "3 s, 99.5 MB"),  # what it cost
        (
            "\nmode    Hz  MAC",
            "\nmode          Hz   MAC",
        ),  # columns are as wide as their widest cell
        ("---------------", "----------------"),
        ("done; 37.9 s,", "done;\n  37.9 s,"),  # folded elsewhere
        ("37.9 s,", "41\n  s,"),
        ("0.0031", "0.0045"),  # an error, by its column
        ("  0.02 %", "  0.03 %"),
        ("42 %", "41 %"),  # a share
        ("+- 0.0052", "+- 0.005"),
        ("0.0031  1.187 %  0.02 %", " 0.003  1.191 % 0.025 %"),
        ("...\n   9", "   2  99.9  1.00\n   9"),  # what the page leaves out
        ("...\n   9", "   9"),
        ("25.2", "0.313"),
    ],
)
def test_a_page_may_differ_from_what_is_printed_by(quoted, printed):
    assert QUOTED.count(quoted) == 1
    assert COMMANDS_OF.first_difference(QUOTED, QUOTED.replace(quoted, printed)) is None


@pytest.mark.parametrize(
    ("quoted", "printed", "line"),
    [
        ("1.18 ms", "1.20 ms", 0),
        ("1.18 ms", "1.18 µs", 0),
        ("1.18 ms", "-1.18 ms", 0),
        ("time of flight", "echo delay", 0),
        ("± 0.021 %", "± nan %", 0),
        ("± 0.021 %", "± 0.033 %", 0),
        ("± 0.021 %", "0.021 %", 0),
        ("time step 0.8 ppm", "time step 8 ppm", 1),
        ("time step 0.8 ppm", "reduction 0.8 ppm", 1),
        ("61.2", "61.9", 4),
        ("1.00\n", "1.02\n", 4),
        ("   1  61.2  1.00\n", "", 4),
        ("   9  4126  0.98\n", "", 6),
        ("4     25.2", "5     25.2", 9),  # counts are the same or not
        ("0.0031", "0.0048", 12),
        ("0.02 %", "0.02", 12),
        ("1.187 %", "1.206 %", 12),
        ("42 %", "44 %", 12),
        ("42 %", "42", 12),
        ("      3  0", "      4  0", 12),
        ("21 cases", "22 cases", 14),
        ("+- 0.0052", "+- 0.009", 14),
        ("0.0052\n", "0.0052\nwritten: x\n", 15),  # a line more at the end
    ],
)
def test_a_page_may_not_differ_from_what_is_printed_by(quoted, printed, line):
    assert QUOTED.count(quoted) == 1
    difference = COMMANDS_OF.first_difference(QUOTED, QUOTED.replace(quoted, printed))
    assert difference.line == line
    assert difference.quoted == [*QUOTED.splitlines(), ""][line].strip()


def test_a_page_that_quotes_what_is_no_longer_printed_is_named_with_its_line(tmp_path):
    page, text = (
        tmp_path / "page.md",
        "# Page\n\n```sh\nprintf 'a\\nb 2\\n'\n```\n\n```text\na\nb 1\n```\n",
    )
    page.write_text(text)
    (message,) = COMMANDS_OF.run(page)
    assert message.startswith("page.md, line 9, ")
    assert "quoted: b 1\n" in message and message.endswith("now:    b 2")
    assert page.read_text() == text
    COMMANDS_OF.run(page, write=True)
    assert page.read_text() == text.replace("b 1", "b 2")
    assert COMMANDS_OF.run(page) == []


def test_a_long_output_is_shortened_between_sentences(tmp_path):
    page = tmp_path / "page.md"
    lines = [f"row {i}" for i in range(30)] + ["Sentence", "  goes on"] + ["end"] * 7
    page.write_text(
        "```sh\nprintf '%s\\n' " + " ".join(f"'{x}'" for x in lines) + "\n```\n\n```text\n```\n"
    )
    COMMANDS_OF.run(page, write=True)
    shown = page.read_text().split("```text\n")[1].splitlines()
    assert shown[17:21] == ["row 17", "...", "Sentence", "  goes on"]
    assert COMMANDS_OF.run(page) == []


def test_the_interface_lists_all_functions():
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^   (\w+)$", text, re.MULTILINE))
    assert listed == set(beadwave.__all__) - {"InvalidScene", "Scene"}


def test_every_field_of_a_result_has_its_comment_on_its_page(monkeypatch):
    monkeypatch.syspath_prepend(DOCS)
    from fields import fields

    words = {field.name: field.words for field in fields(dem.Wall)}
    assert list(words) == list(dem.Wall._fields)
    assert words["residual_compliance"] == "[m/N], may be slightly negative"
    rows = {field.name: field.words for field in fields(rom.ReducedModel)}
    assert rows.keys() == set(rom.ReducedModel._fields) and all(rows.values())
    assert "row 3 i + j" in rows["T"]


def test_formats_name_every_array_of_the_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "formats.md").read_text(encoding="utf-8")
    short = {"chain.count": 3, "output.spheres": [1], "time.duration": 2e-4}
    beadwave.impact("rig-1dof", short, out="out")
    with np.load("out/trajectory.npz") as arrays:
        assert all(f"`{name}`" in text for name in arrays)
    model = rom.full_order(np.diag([1e6, 4e6]), np.eye(2), [1.0, 0.0], C=np.eye(2))
    surface = rom.Surface(np.zeros((1, 3)), np.zeros((1, 4), int), np.zeros((3, 2)))
    contact = rom.Contact(1e-9, young=2e11, poisson=0.3, modes_hz=(51.0,))
    known = {"contact": contact, "coordinates": ("a", "b"), "surface": surface, "error": 1e-4}
    rom.save_npz("rom.npz", model._replace(T=None, **known))
    with np.load("rom.npz") as arrays:
        missing = [
            name for name in arrays if f"`{name}`" not in text and name not in ("n_boundary",)
        ]
    assert not missing
    assert all(f"`{name}`" in text for name in ContactResponse._fields)
    assert all(f"`{name}`" in text for name in IMPACT_FILES)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["impact", "own-mesh"])
def test_a_notebook_runs(name, tmp_path):
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(DOCS / "notebooks" / f"{name}.ipynb", as_version=4)
    client = nbclient.NotebookClient(
        notebook,
        timeout=900,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    )
    with signals_restored():  # it leaves SIGTERM to its default
        client.execute()
    outputs = [o for cell in notebook.cells for o in cell.get("outputs", ())]
    assert any("image/png" in o.get("data", {}) for o in outputs)
    assert any("N" in o.get("text", "") for o in outputs if o.output_type == "stream")


def test_the_gallery_has_a_page_for_each_script_that_says_what_it_shows():
    gallery = loaded("gallery")
    listed = (DOCS / "gallery" / "index.md").read_text(encoding="utf-8")
    pages = {path.stem for path in (DOCS / "gallery").glob("*.md")} - {"index"}
    assert pages == set(gallery.scripts()), "python docs/gallery.py NAME writes a page"
    for name, script in gallery.scripts().items():
        page = (DOCS / "gallery" / f"{name}.md").read_text(encoding="utf-8")
        shows, _, calls = gallery.docstring(script)
        assert len(shows) < 110 and shows.endswith("."), name
        assert f"\n\n{gallery.plain(shows)}\n\n" in page and gallery.plain(shows) in listed
        assert calls[0].startswith(f"python examples/gallery/{script.name}")
        assert all(call in page for call in calls)
        assert f"(tiles/{name}.png)" in listed


def test_tiles_of_the_gallery_are_the_first_panels_of_its_pictures():
    gallery = loaded("gallery")
    for name in gallery.scripts():
        picture = Image.open(DOCS / "gallery" / f"{name}.png").convert("RGB")
        tile = Image.open(DOCS / "gallery" / "tiles" / f"{name}.png")
        assert tile.size == gallery.first_panel(picture).size, "python docs/gallery.py writes it"


@pytest.mark.slow
@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 3), (3, 1), (2, 2), (4, 3)])
@pytest.mark.parametrize("legend", ["inside", "above"])
def test_the_first_panel_of_a_picture_is_whole_and_alone(rows, columns, legend):
    x = np.linspace(0.0, 3.0, 50)
    one = Panel(
        "a title", "time [ms]", "velocity [m/s]", [Line("curve", x, np.sin(x))], "", None, legend
    )
    size = (4.6, 2.7)
    picture = Image.open(BytesIO(panels([one] * rows * columns, columns=columns, size=size)))
    tile = loaded("gallery").first_panel(picture.convert("RGB"))
    assert tile.width == pytest.approx(picture.width / columns, abs=20)  # pixels
    assert tile.height == pytest.approx(picture.height / rows, abs=20)
    # a blank border: no label, number or title is cut
    pixels = np.asarray(tile.convert("L"))
    assert pixels[-1].min() > 250 and pixels[:, -1].min() > 250
    # the labels of the panel are in it: as much ink as in its share of the picture
    share = np.mean(np.asarray(picture.convert("L")) < 235) / np.mean(pixels < 235)
    assert share == pytest.approx(1, abs=0.1)


def test_signs_of_a_sentence_mean_nothing_to_markdown_but_its_code_stays():
    said = loaded("gallery").plain("a_b < 2 and `c_d = 1` [%]")
    assert said == r"a\_b \< 2 and `c_d = 1` \[%\]"


def test_names_and_meanings_of_a_docstring_are_a_list_and_what_is_indented_stays():
    """A column of a formula is no name: its lines begin elsewhere."""
    plain = loaded("plain_docstrings")
    lines = ["free   what to vary, as", "       joints.NAME.kz", "match  modes  to meet"]
    assert plain.as_rst(lines) == [
        "``free``", "    what to vary, as joints.NAME.kz", "", "``match``", "    modes to meet", "",
    ]  # fmt: skip
    formula = ["    x'' = -k x   for x > 0", "    x'' = 0      else"]
    assert plain.as_rst(formula)[0] == ".. code-block:: text"


@pytest.mark.slow
def test_the_pages_build_without_a_warning(tmp_path, monkeypatch):
    pytest.importorskip("sphinx")
    pytest.importorskip("myst_nb")
    pytest.importorskip("latex2mathml")
    copied = shutil.copytree(
        DOCS, tmp_path / "docs", ignore=lambda _, names: [n for n in names if n[:1] == "_"]
    )
    gallery = loaded("gallery")
    shutil.copytree(gallery.SCRIPTS, tmp_path / "examples" / "gallery")
    monkeypatch.setattr(gallery, "HERE", copied / "gallery")
    monkeypatch.setattr(sys, "argv", ["gallery", "striker"])
    gallery.main()
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-W", "-q", str(copied), str(tmp_path / "site")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "site" / "api.html").read_text(encoding="utf-8")
    assert "Contact stiffnesses and wall parameters fitted" in page
    assert "cKDTree" not in page  # nor anything else that a module imports
    # names break between their words, in headings too
    choose = (tmp_path / "site" / "choose.html").read_text(encoding="utf-8")
    assert '<span class="pre">error_<wbr>estimate.<wbr>time</span>' in choose
    inspect = (tmp_path / "site" / "reference" / "beadwave.inspect.html").read_text(
        encoding="utf-8"
    )
    assert "<h1>beadwave.<wbr>inspect" in inspect and "0.<wbr>" not in choose
    theory = (tmp_path / "site" / "theory.html").read_text(encoding="utf-8")
    assert theory.count("<math") > 50 and "\\omega" not in theory
