"""The page of a hammer test, on which a click takes a pole or leaves it out."""

import json
import re
import shlex
import shutil
from os import environ
from pathlib import Path

import numpy as np
import pytest

from beadwave.workflows.files.hammer import Reading
from beadwave.workflows.structure.hammer import Choice
from beadwave.workflows.structure.pole_page import at_most, command_of

from command_line import beadwave

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ASKED = environ.get("BEADWAVE_TEST_BROWSER")  # where it is set, a missing browser is a failure
BROWSER = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
LINES = np.arange(10.0, 1200.0, 0.2)


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """Responses with three modes at two points."""
    monkeypatch.chdir(tmp_path)
    omega, H = 2 * np.pi * LINES, np.zeros((2, len(LINES)), complex)
    for hz, zeta in ((51.0, 0.01), (269.0, 0.008), (905.0, 0.006)):
        w = 2 * np.pi * hz
        H += np.array([[1.0], [0.7]]) * -(omega**2) / (w**2 - omega**2 + 2j * zeta * w * omega)
    noise = np.random.default_rng(0).normal(size=(2, 2, len(LINES)))
    H += 1e-3 * np.abs(H).mean() * (noise[0] + 1j * noise[1])
    columns = [LINES, *(part for h in H for part in (h.real, h.imag))]
    table = np.column_stack(columns)
    np.savetxt("a test.csv", table, delimiter=",", header="f,re,im,re,im", comments="")
    return Path("a test.csv")


def data_of(page):
    return json.loads(re.search(r'id="data">(.*?)</script>', Path(page).read_text())[1])


@pytest.mark.slow
def test_the_page_holds_poles_of_the_report_and_a_command_that_repeats_it(measured):
    assert beadwave("hammer", str(measured), "--band=20:1100", "--reject=2", "--out=out") == 0
    report, data = json.loads(Path("out/modes.json").read_text()), data_of("out/poles.html")
    numbers = {pole["number"]: pole for pole in data["poles"]}
    assert [n for n, pole in sorted(numbers.items()) if pole["taken"]] == sorted(
        row["number"] for row in report["rows"]
    )
    assert not numbers[2]["taken"] and numbers[2]["found"] and data["reject"] == [2]
    assert len(data["frequency"]) <= 4000 and max(data["response"]) > 10
    words = shlex.split(data["command"])
    assert words[:3] == ["beadwave", "hammer", "a test.csv"]
    assert beadwave(*words[1:], "--reject=2") == 0  # over its own result
    assert json.loads(Path("out/modes.json").read_text())["rows"] == report["rows"]
    said = "modes are paired with those of rig-rom, as no --scene is given"
    assert said in report["remarks"]
    assert beadwave("hammer", str(measured), "--scene=rig-rom", "--out=named") == 0
    assert said not in json.loads(Path("named/modes.json").read_text())["remarks"]


def test_a_command_names_what_is_not_usual():
    reading = Reading("H2", 0.01, 1, Path("points.csv"))
    command = command_of(
        [Path("hit 1.wav"), Path("2.wav")], "mine.toml", ("mesh.scale=2",), reading,
        Choice((40.0, 950.0)), Path("out"),
    )  # fmt: skip
    assert command == (
        "beadwave hammer 'hit 1.wav' 2.wav --scene mine.toml --set mesh.scale=2 "
        "--points points.csv --estimator H2 --window 0.01 --band 40:950 --out out"
    )


def test_peaks_of_a_long_curve_stay_on_the_page():
    x = np.arange(100_000.0)
    y = np.ones(100_000)
    y[[5, 77_777]] = 9.0, 7.0
    few, high = at_most(x, y, 4000)
    assert len(few) <= 4000 and {5.0, 77_777.0} < set(few) and sorted(high)[-2:] == [7.0, 9.0]
    np.testing.assert_array_equal(at_most(x[:50], y[:50], 4000)[1], y[:50])


@pytest.mark.slow
@pytest.mark.skipif(not (CHROMIUM or ASKED), reason="no chromium: apt-get install chromium")
def test_a_click_on_a_line_or_a_row_changes_the_command(measured):
    from playwright.sync_api import sync_playwright

    assert beadwave("hammer", str(measured), "--out=out") == 0
    poles = {pole["number"]: pole for pole in data_of("out/poles.html")["poles"]}
    first = min(n for n, pole in poles.items() if pole["taken"])
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=BROWSER)
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        errors = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda said: errors.append(said.text) if said.type == "error" else None)
        page.goto(f"file://{Path('out').resolve()}/poles.html")
        command = page.locator("#command")
        usual = command.inner_text()
        assert "--reject" not in usual and "--accept" not in usual

        # on the line of the first mode: left out, and on it again: taken
        over, hz = page.locator("#diagram .u-over").bounding_box(), LINES[-1] - LINES[0]
        at = over["x"] + over["width"] * (poles[first]["hz"] - LINES[0]) / hz
        for expected in (f"{usual} --reject {first}", usual):
            page.mouse.click(at, over["y"] + over["height"] / 2)
            assert command.inner_text() == expected
        for number, pole in poles.items():
            page.locator(f'tr[data-number="{number}"]').click()
            option = "--reject" if pole["taken"] else "--accept"
            assert command.inner_text().endswith(f"{option} {number}")
            page.locator("#reset").click()
            assert command.inner_text() == usual
        page.set_viewport_size({"width": 400, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= 400
        browser.close()
    assert not errors
