"""The report page in a real browser without a network: what it computes, draws and lets through.

Chromium comes from the system (install.sh takes it from apt), playwright drives it.
"""

import json
import re
import shutil
from functools import partial
from importlib import import_module
from io import BytesIO
from os import environ
from types import SimpleNamespace
from typing import get_args

import meshio
import numpy as np
import pytest
from PIL import Image

from beadwave import rom
from beadwave.coupling.surface_motion import wall_modes
from beadwave.workflows.files.scene import scene as load
from beadwave.workflows.report import report
from beadwave.workflows.report.first_screen import chain_words, wall_words
from beadwave.workflows.report.number_format import figures, si
from beadwave.workflows.report.page_data import PageLimits, page_data, upwards
from beadwave.workflows.report.page_rows import STANDS_FOR, scene_rows
from beadwave.workflows.report.provenance import sources
from beadwave.workflows.report.report import harmless_json
from beadwave.workflows.report.summary import Summary
from beadwave.workflows.report.summary_rows import error_words
from beadwave.workflows.scene.tables.walls import Wall

from command_line import beadwave

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
BROWSER = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SMALL = ("chain.count=5", "output.spheres=[1,4]", "output.samples=201", "time.duration=0.5e-3")
LARGEST = 3_000_000  # bytes of the page of the default run, whose mesh is four times as fine
ASKED = environ.get("BEADWAVE_TEST_BROWSER")  # where it is set, a missing browser is a failure
needs_browser = pytest.mark.skipif(
    not (CHROMIUM or ASKED), reason="no chromium: apt-get install chromium"
)


def run_of(name, changes, folder):
    changes = [f"--set={change}" for change in changes]
    assert beadwave("run", name, f"--out={folder}", *changes) == 0
    return folder


@pytest.fixture(scope="module")
def rig(coarse_run):
    """A coarse run of the rig."""
    return coarse_run


@pytest.fixture(scope="module")
def browser():
    sync_api = (
        import_module("playwright.sync_api")
        if ASKED
        else pytest.importorskip("playwright.sync_api")
    )
    with sync_api.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=BROWSER)
        yield browser
        browser.close()


def page_of(browser, folder, scheme="light", width=1280):
    """Opens the page of a folder off line; what it complains of ends up in its list."""
    view = {"width": width, "height": 900}
    page = browser.new_context(
        viewport=view, color_scheme=scheme, offline=True, reduced_motion="reduce"
    ).new_page()
    page.complaints = []
    page.on("console", lambda message: page.complaints.append(message.text))
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.set_default_timeout(120_000)  # ms, of a busy machine
    page.goto(f"file://{folder}/report.html")
    drawn(page)
    return page


@pytest.fixture
def opened(browser):
    """Opens pages for one test."""
    pages = []

    def open_page(folder, **options):
        pages.append(page_of(browser, folder, **options))
        return pages[-1]

    yield open_page
    for page in pages:
        page.context.close()


@pytest.fixture(scope="module")
def page(rig, browser):
    """The page of the coarse rig, for tests that only ask it or set what they look at."""
    return page_of(browser, rig)


@pytest.fixture(scope="module")
def narrow_page(rig, browser):
    """The same on a narrow screen."""
    return page_of(browser, rig, width=400)


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_the_page_opens_without_complaint_and_fits(rig, opened, scheme, width):
    page = opened(rig, scheme=scheme, width=width)
    assert page.complaints == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator(".chart canvas").count() >= 5
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", background))) < 200) == (scheme == "dark")


@needs_browser
@pytest.mark.parametrize("width", [1280, 400])
def test_the_map_names_every_wave_and_its_colours(page, narrow_page, width):
    page = page if width == 1280 else narrow_page
    page.evaluate(
        """() => {
          const write = CanvasRenderingContext2D.prototype.fillText;
          window.written = [];
          CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
            if (this.canvas.closest(".heat")) window.written.push([String(text), ...rest]);
            write.call(this, text, ...rest);
          };
          document.getElementById("theme").click();
        }"""
    )
    page.wait_for_function("written.some(([text]) => text === 'velocity [m/s]')")
    places = {text: (x, y) for text, x, y in page.evaluate("written")}
    tracks = page.evaluate("JSON.parse(document.getElementById('data').textContent).waves.tracks")
    names = {track["name"] for track in tracks}
    assert len(names) >= 2 and names <= places.keys()
    assert len({places[name] for name in names}) == len(names)
    wide, high = page.evaluate(
        "(c => [c.clientWidth, c.clientHeight])(document.querySelector('.heat canvas'))"
    )
    shown = [places[name] for name in names | {"velocity [m/s]"}]
    assert all(0 < x < wide and 0 < y < high for x, y in shown)


@needs_browser
def test_the_frequencies_fit_a_narrow_screen(narrow_page):
    table = narrow_page.locator("#modes")
    assert table.evaluate("t => t.scrollWidth <= t.parentElement.clientWidth")


def test_errors_stand_beside_their_numbers_and_large_ones_are_marked(rig):
    """On the first screen and in the tables; the coarse rig has modes that are off by a tenth."""
    html = (rig / "report.html").read_text(encoding="utf-8")
    first, tables = html.split('<section id="impact">')
    summary = Summary.model_validate_json((rig / "summary.json").read_text(encoding="utf-8"))
    for name, value in (
        ("tof_s", si(summary.wall_contact.tof_s, "s")),
        ("peak_wall_force_N", si(summary.peak_wall_force_N, "N")),
    ):
        words = error_words(summary.relative_error(name))
        for place in (first, tables):
            assert re.search(rf'{re.escape(value)} <span class="error[^>]*>{words}<', place)
    mode = summary.modes[0]
    words = error_words(summary.relative_error(f"mode {mode.number}"))
    cells = rf"{figures(mode.frequency_hz)}</td>\s*<td[^>]*> <span class=.error[^>]*>{words}"
    assert re.search(cells, tables)

    marked = re.findall(r'<span class="error large">([^<]*)', tables)
    listed = [summary.relative_error(f"mode {mode.number}") for mode in summary.modes]
    large = [error_words(error) for error in listed if error is not None and error > 0.05]
    assert large and set(large) <= set(marked)
    assert all(mark.endswith("!") for mark in large)


@needs_browser
def test_the_displacement_at_the_contact_is_that_of_the_trajectory(rig, page):
    with np.load(rig / "trajectory.npz") as run:
        t, wall_x = run["t"], run["wall_x"] - run["wall_x"][0]
    instants = np.random.default_rng(0).uniform(0, t[-1], 50)
    computed = page.evaluate("ts => ts.map((t) => beadwave.view.atContact(t))", instants.tolist())
    off = np.abs(np.array(computed) - np.interp(instants, t, wall_x)).max()
    assert off < 1e-3 * np.abs(wall_x).max()


@needs_browser
def test_the_surface_moves_as_the_reduced_model_says(rig, page):
    """16 bits of a shape and the shapes left out (1e-3 of the largest displacement)."""
    reduced = rom.load_npz(rig / "rom.npz")
    with np.load(rig / "trajectory.npz") as run:
        t, q = run["t"], run["wall_q"] - run["wall_q"][0]
        shape = wall_modes(reduced, run["wall_omega"], run["wall_phi"]).shape
    u = np.einsum("tk,kmi->tmi", q, shape)
    rng = np.random.default_rng(1)
    for node, i in rng.integers((u.shape[1], len(t)), size=(20, 2)):
        arguments = [int(node), float(t[i])]
        computed = page.evaluate("([node, t]) => beadwave.view.displacement(node, t)", arguments)
        assert np.abs(np.array(computed) - u[i, node]).max() < 2e-3 * np.abs(u).max()


@needs_browser
def test_a_large_surface_is_drawn_with_fewer_nodes(rig, opened, tmp_path, monkeypatch):
    full_size = len((rig / "report.html").read_text())
    thinner = partial(page_data, limits=PageLimits(bytes=60_000))
    monkeypatch.setattr(report, "page_data", thinner)
    folder = tmp_path / "thinned"
    shutil.copytree(rig, folder)
    assert beadwave("report", str(folder)) == 0
    assert len((folder / "report.html").read_text()) < full_size - 200_000
    page = opened(folder)
    assert page.complaints == []
    assert "outer nodes" in page.locator("#impact .needs-view > .note").inner_text()
    with np.load(folder / "trajectory.npz") as run:
        t, wall_x = run["t"], run["wall_x"] - run["wall_x"][0]
    computed = page.evaluate("t => beadwave.view.atContact(t)", float(t[len(t) // 2]))
    assert abs(computed - wall_x[len(t) // 2]) < 1e-3 * np.abs(wall_x).max()
    at_start = picture(page)
    page.evaluate("beadwave.clock.seek(0.9 * beadwave.clock.duration)")
    assert picture(page) != at_start


def drawn(page):
    """Waits until what has changed is in the picture: observers of sizes are called in the first
    frame, what they ask for is drawn in the next."""
    page.evaluate(
        "() => document.fonts.ready.then(() => new Promise((done) => requestAnimationFrame("
        "() => requestAnimationFrame(() => requestAnimationFrame(done)))))"
    )


def picture(page):
    return page.locator(".view").screenshot()


def frames_drawn(page, n):
    """Waits for so many frames of the playing film."""
    start = page.evaluate("beadwave.clock.frames")
    page.wait_for_function("last => beadwave.clock.frames >= last", arg=start + n)


@needs_browser
def test_the_view_changes_with_the_play_head_the_mode_and_the_mouse(page):
    pictures = []
    for seconds in (0.2e-3, 1.2e-3):
        page.evaluate("t => beadwave.clock.seek(t)", seconds)
        pictures.append(picture(page))
    box = page.locator(".view canvas").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 400, box["y"] + 230)
    page.mouse.up()
    pictures.append(picture(page))
    page.click("button[data-mode='1']")
    drawn(page)
    pictures.append(picture(page))
    assert len(set(pictures)) == 4


EDGES = """() => {
  const gl = document.querySelector('.view canvas').getContext('webgl2');
  const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
  const all = new Uint8Array(4 * w * h);
  gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, all);
  const seen = Array.from({ length: w * h }, (_, i) => i).filter((i) => all[4 * i + 3]);
  return [seen.map((i) => i % w / w), seen.map((i) => Math.floor(i / w) / h)].flatMap((places) =>
    [places.reduce((a, b) => Math.min(a, b)), places.reduce((a, b) => Math.max(a, b))]);
}"""  # where what is drawn begins and ends


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("scene, width", [("rig-rom", 1280), ("rig-rom", 400), ("beam", 1280)])
def test_all_that_moves_stays_in_the_view_and_fills_it(scene, width, rig, opened, tmp_path):
    page = opened(rig if scene == "rig-rom" else run_of(scene, (), tmp_path), width=width)
    for share in np.linspace(0.0, 1.0, 7):
        page.evaluate("share => beadwave.clock.seek(share * beadwave.clock.duration)", share)
        left, right, low, high = page.evaluate(EDGES)
        assert 0.005 < left < right < 0.995 and 0.005 < low < high < 0.995
        assert right - left > 0.7 or high - low > 0.7


@needs_browser
def test_the_play_head_stands_at_the_same_time_in_view_and_plots(page):
    page.evaluate("beadwave.clock.seek(1.5e-3)")
    page.wait_for_function("document.querySelector('#impact .time').innerText.startsWith('1.500')")
    drawn(page)
    places = page.evaluate(
        "[...document.querySelectorAll('[data-plot] .head')].map((head) => {"
        "const over = head.parentElement.getBoundingClientRect();"
        "return (head.getBoundingClientRect().left - over.left) / over.width})"
    )
    np.testing.assert_allclose(places, 0.5, atol=0.02)  # of 3 ms
    assert page.locator("#impact .time").inner_text().startswith("1.500 ms")
    for plot in ("velocity", "energy", "force", "wall"):
        assert "1.5 ms" in page.locator(f"figure[data-plot='{plot}'] .u-legend").inner_text()


# the work that the page gives WebGL: calls that draw, their vertices, bytes sent to its memory
COUNTED = """() => {
  const work = beadwave.work = { draws: 0, vertices: 0, bytes: 0 };
  const context = WebGL2RenderingContext.prototype;
  for (const [name, count] of [["drawElements", 1], ["drawArrays", 2],
                               ["drawElementsInstanced", 1], ["drawArraysInstanced", 2]]) {
    const draw = context[name];
    context[name] = function (...given) {
      work.draws += 1;
      work.vertices += given[count] * (name.endsWith("Instanced") ? given.at(-1) : 1);
      return draw.apply(this, given);
    };
  }
  for (const name of ["bufferData", "bufferSubData", "texImage2D", "texSubImage2D"]) {
    const send = context[name];
    context[name] = function (...given) {
      work.bytes += given.find((value) => ArrayBuffer.isView(value))?.byteLength ?? 0;
      return send.apply(this, given);
    };
  }
}"""


@needs_browser
def test_a_frame_draws_structure_and_spheres_once_and_sends_their_motion_alone(rig, opened):
    """Seconds depend on the processor, this work does not: 2 calls, 16 228 vertices and 69 kB a
    frame of this mesh. `examples/page_frames.py` prints the seconds."""
    page = opened(rig)
    page.locator("#impact").scroll_into_view_if_needed()
    page.evaluate(COUNTED)
    page.evaluate("beadwave.clock.play(true)")
    state = "({...beadwave.work, frames: beadwave.clock.frames})"
    frames_drawn(page, 1)
    before = page.evaluate(state)
    frames_drawn(page, 10)
    after = page.evaluate(state)
    frames = after["frames"] - before["frames"]
    draws, vertices, n_bytes = (
        (after[name] - before[name]) / frames for name in ("draws", "vertices", "bytes")
    )
    assert 1.0 <= draws <= 3.0
    assert 5e3 < vertices < 20e3
    assert 20e3 < n_bytes < 100e3


@needs_browser
def test_the_curves_are_saved_as_they_were_run(rig, page, tmp_path):
    with page.expect_download() as download:
        page.click("figure[data-plot='velocity'] button.csv")
    download.value.save_as(tmp_path / "velocity.csv")
    head, *_ = (tmp_path / "velocity.csv").read_text().splitlines()
    assert head == '"time [s]","sphere 1 [m/s]","sphere 4 [m/s]","sphere 14 [m/s]"'
    table = np.loadtxt(tmp_path / "velocity.csv", delimiter=",", skiprows=1)
    with np.load(rig / "trajectory.npz") as run:
        np.testing.assert_allclose(table[:, 0], run["t"], rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(table[:, 1:], run["v"][:, [0, 3, 13]], atol=1e-7)


@pytest.mark.slow
@needs_browser
def test_without_webgl_the_still_pictures_stand_in(rig, browser, opened):
    page = opened(rig)
    page.add_init_script("HTMLCanvasElement.prototype.getContext = ((own) => function (kind) {"
                         "return kind === 'webgl2' ? null : own.apply(this, arguments);"
                         "})(HTMLCanvasElement.prototype.getContext)")  # fmt: skip
    page.reload()
    drawn(page)
    assert page.complaints == []
    assert not page.locator(".view canvas").is_visible()
    drawn_still = [(rig / "figures" / f"{name}.png").is_file() for name in ("assembly", "modes")]
    assert page.locator(".without img").count() == sum(drawn_still) > 0


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("name", ["rig-rigid", "rig-half-space", "rig-1dof", "free-chain"])
def test_a_slab_stands_for_a_wall_without_a_shape(name, opened, tmp_path, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    page = opened(run_of(name, SMALL, tmp_path / "out"))
    assert page.complaints == []
    at_start = picture(page)
    page.evaluate("beadwave.clock.seek(0.9 * beadwave.clock.duration)")
    assert picture(page) != at_start
    note = page.locator("#impact .needs-view > .note").inner_text()
    assert ("no wall" in note) if name == "free-chain" else ("stand" in note)


@pytest.mark.parametrize("table", get_args(get_args(Wall)[0]), ids=lambda table: table.__name__)
def test_every_kind_of_wall_has_words_of_its_own(table):
    kind = get_args(table.model_fields["kind"].annotation)[0]
    values = {
        name: "wall.npz" if "str" in str(field.annotation) else 1.0
        for name, field in table.model_fields.items()
    }
    wall = table.model_construct(**{**values, "kind": kind})
    words = wall_words(SimpleNamespace(wall=wall), SimpleNamespace(n_wall_modes=3))
    assert words.endswith(".") and ("3 modes" in words) == (kind == "rom")
    assert STANDS_FOR[kind].startswith("The wall ")


@needs_browser
@pytest.mark.parametrize("inclination, upright", [(90, True), (0, False)])
def test_a_chain_stands_as_its_weight_says(inclination, upright, opened, tmp_path, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    changes = (*SMALL, "chain.count=12", f"gravity.inclination={inclination}")
    page = opened(run_of("rig-rigid", changes, tmp_path / "out"))
    canvas = Image.open(BytesIO(page.locator(".view canvas").screenshot())).convert("RGB")
    pixels = np.asarray(canvas, int)[60:-40]  # without the words above and below
    is_drawn = np.abs(pixels - pixels[0, 0]).max(axis=2) > 20
    height, width = (np.ptp(np.nonzero(is_drawn)[axis]) for axis in (0, 1))
    assert (height > 2 * width) if upright else (width > 1.5 * height)


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, -1, 0), (0, 0, -1), (0.6, 0, -0.8)])
@pytest.mark.parametrize("inclination", [90.0, 30.0, 0.0, -90.0])
def test_up_is_against_the_weight_of_the_spheres(inclination, direction):
    scene = load("upright").but(gravity={"inclination": inclination})
    up = np.array(upwards(scene, direction))
    assert abs(np.linalg.norm(up) - 1) < 1e-12
    assert abs(up @ direction + np.sin(np.radians(inclination))) < 1e-12
    assert upwards(load("rig-rigid"), direction) == [0, 0, 1]


@needs_browser
def test_signals_of_sensors_are_drawn_by_unit(opened, tmp_path, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    sensors = "output.sensors=[{sphere=2}, {sphere=3}, {sphere=4, quantity='velocity'}]"
    folder = run_of("rig-rigid", (*SMALL, sensors), tmp_path / "out")
    assert (folder / "figures" / "signals.png").is_file()
    page = opened(folder)
    assert page.complaints == []
    assert page.locator("figure[data-plot^=signals] canvas").count() == 2
    with page.expect_download() as download:
        page.click("figure[data-plot='signals N'] button.csv")
    download.value.save_as(tmp_path / "force.csv")
    head, *_ = (tmp_path / "force.csv").read_text().splitlines()
    assert head == '"time [s]","force 2 [N]","force 3 [N]"'
    table = np.loadtxt(tmp_path / "force.csv", delimiter=",", skiprows=1)
    rows = np.loadtxt(folder / "signals.csv", delimiter=",", skiprows=2)
    step = round(table[1, 0] / rows[1, 0])
    np.testing.assert_allclose(table, rows[::step, :3], rtol=1e-6, atol=1e-5)


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_the_loop_and_the_disc_of_friction_follow_the_play_head(
    scheme, width, opened, tmp_path, monkeypatch
):
    """Words and pictures: a sphere that strikes obliquely slips at first, sticks, and is off."""
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    folder = run_of("oblique-sphere", (), tmp_path / "out")
    page = opened(folder, scheme=scheme, width=width)
    assert page.complaints == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    states, pictures = [], []
    for share in (0.002, 0.4, 0.99):
        page.evaluate(f"beadwave.clock.seek({share} * beadwave.clock.duration)")
        states.append(page.locator(".friction .state").inner_text())
        pictures.append([page.locator(f".friction canvas >> nth={i}").screenshot() for i in (0, 1)])
    assert "gross slip" in states[0] and "partial slip" in states[1] and "open" in states[2]
    assert all(len({one[i] for one in pictures}) == 3 for i in (0, 1))


@needs_browser
def test_the_disc_of_friction_has_the_share_that_sticks(opened, tmp_path, monkeypatch):
    """Blue over blue and orange pixels, beside the share in the words, to the width of an edge."""
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    page = opened(run_of("oblique-sphere", (), tmp_path / "out"))
    page.evaluate("beadwave.clock.seek(0.4 * beadwave.clock.duration)")
    words = page.locator(".friction .state").inner_text()
    share = float(re.search(r"([\d.]+) % of the area", words)[1]) / 100
    disc = Image.open(BytesIO(page.locator(".friction canvas >> nth=1").screenshot()))
    red, _, blue = np.moveaxis(np.asarray(disc.convert("RGB"), int), 2, 0)
    sticks, slips = (blue - red > 60).sum(), (red - blue > 60).sum()
    assert sticks / (sticks + slips) == pytest.approx(share, abs=0.02)


@needs_browser
def test_nothing_of_a_scene_runs_in_the_browser(opened, tmp_path, monkeypatch):
    """Names are escaped, and what were injected all the same is not allowed to run."""
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    folder = run_of("rig-rigid", SMALL, tmp_path / "out")
    evil = "</script><script>window.evil = 1</script><img src=x onerror='window.evil = 1'>"
    summary = json.loads((folder / "summary.json").read_text())
    summary |= {"warnings": [evil], "command": evil, "scene": evil, "verdict": [evil]}
    (folder / "summary.json").write_text(json.dumps(summary))
    assert beadwave("report", str(folder)) == 0
    page = opened(folder)
    assert page.complaints == []
    assert page.locator("h1").inner_text() == evil
    page.evaluate("document.body.insertAdjacentHTML('beforeend', `<img src=x onerror='evil=1'>`)")
    page.wait_for_function("[...document.images].every((image) => image.complete)")
    drawn(page)
    assert not page.evaluate("'evil' in window")


def test_data_hold_no_end_of_a_script():
    text = harmless_json({"name": "</script>&\u2028"})
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"name": "</script>&\u2028"}


def test_the_page_needs_no_network_and_stays_small(rig):
    html = (rig / "report.html").read_text()
    assert len(html) < LARGEST
    assert not re.findall(r'(?:src|href)="(?!data:|#)', html)


def test_paraview_warps_a_mode_unasked_and_finds_all_up_to_the_highest_target(rig):
    raw = (rig / "modes.vtu").read_bytes()
    modes = json.loads((rig / "summary.json").read_text())["modes"]
    first = re.search(rb'<PointData Vectors="([^"]+)">', raw)[1].decode()
    names = list(meshio.read(rig / "modes.vtu").point_data)
    assert names[0] == first and len(names) == len(modes)
    assert [i + 1 for i, name in enumerate(names) if "measured" in name] == [
        mode["number"] for mode in modes if mode["target"]
    ]
    assert modes[-1]["target"] == 4


def test_every_value_of_a_built_in_scene_says_where_it_is_from():
    kinds = sources(load("rig-rom"), None, ())
    assert kinds["chain.count"].kind == "thesis"
    assert kinds["chain.radius"].kind == "inferred"
    assert kinds["joints.head.ky"].kind == "inferred"
    assert kinds["chain.young"].kind == "assumed"
    assert kinds["mesh.seed"].kind == "chosen"
    assert kinds["contact.stiffness_factor"].kind == "default"


def test_every_sensor_of_a_built_in_scene_says_where_its_values_are_from():
    kinds = sources(load("upright"), "upright", ())
    assert kinds["output.sensors.1.gain"].kind == "assumed"
    assert "piezo" in kinds["output.sensors.1.gain"].note
    words = chain_words(load("upright")).replace("\u00a0", " ")
    assert "the first one falls 5 mm and strikes the row at 313 mm/s" in words


def test_what_differs_from_a_built_in_scene_is_yours(tmp_path):
    change = ("chain.radius=0.02",)
    kinds = sources(load("rig-rom", change), "rig-rom", change)
    assert kinds["chain.radius"].kind == "yours"
    assert kinds["chain.young"].kind == "assumed"
    scene_file = tmp_path / "own.toml"
    scene_file.write_text("chain = { count = 3, radius = 0.0127, density = 7800.0, young = 210e9, "
                   "poisson = 0.3 }\nstriker = { velocity = 0.31 }\n")  # fmt: skip
    kinds = sources(load(str(scene_file)), str(scene_file), ())
    assert {kinds[f"chain.{key}"].kind for key in ("count", "radius")} == {"yours"}
    assert kinds["time.duration"].kind == "default"


MINE = """# for the workshop
chain = { count = 3, radius = 0.0127, density = 7800.0, young = 210e9, poisson = 0.3 }
[striker]
velocity = 0.31  # by a light gate
[wall]
kind = "rigid"
[time]
duration = 0.2e-3  # enough
[[output.sensors]]
sphere = 2
gain = "5 mV/N"  # by drop test
[[output.sensors]]
sphere = 3  # the last
"""


def test_the_comments_of_a_scene_file_stay_with_its_run(tmp_path, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    scene_file = tmp_path / "own.toml"
    scene_file.write_text(MINE)
    out, change = tmp_path / "out", "--set=time.duration=0.1e-3"
    assert beadwave("impact", str(scene_file), f"--out={out}", change) == 0
    command, _, words = (out / "given.toml").read_text().partition("\n")
    assert words == MINE and command == f"# the scene of: beadwave impact {scene_file} {change}"
    summary = Summary.model_validate_json((out / "summary.json").read_text())
    assert beadwave("impact", str(out / "scene.toml"), f"--out={out}") == 0
    assert (out / "given.toml").read_text().endswith(MINE), "a repeated run has lost them"
    notes = {key: source.note for key, source in summary.sources.items() if source.note}
    assert notes == {
        "striker.velocity": "by a light gate", "output.sensors.1.gain": "by drop test",
        "output.sensors.2.sphere": "the last",
    }  # fmt: skip
    rows = {row["full"]: row["value"] for row in scene_rows(load(out / "scene.toml"), summary)}
    assert rows["output.sensors.1.gain"].replace("\u00a0", " ") == "5 mV/N"


@pytest.mark.slow
def test_values_of_a_list_bear_one_unit_and_points_stand_in_brackets(tmp_path):
    assert beadwave("impact", "rig-1dof", "--set=time.duration=1e-4", f"--out={tmp_path}/out") == 0
    summary = Summary.model_validate_json((tmp_path / "out" / "summary.json").read_text())
    rows = {row["full"]: row["value"] for row in scene_rows(load("plate-on-bolts"), summary)}
    plain = {key: value.replace("\u00a0", " ") for key, value in rows.items()}
    outline = "(0, 0), (200, 0), (200, 100), (0, 100) mm"
    assert plain["bodies.base.plate.outline"] == outline
    assert plain["bodies.cover.at"] == "0, 0, 30 mm" and plain["chain.radius"] == "6.35 mm"
    assert plain["strike.at"] == "30, 10 mm" and plain["output.spheres"] == "1, 5"


@pytest.mark.slow
def test_numbers_bear_prefixes():
    texts = [si(1.738e5, "Hz"), si(3.02e-7, "s"), si(0.09999, "m"), si(0.0, "N"), si(None, "N")]
    assert [text.replace("\u00a0", " ") for text in texts] == [
        "174 kHz", "302 ns", "100 mm", "0 N", "-"
    ]  # fmt: skip
