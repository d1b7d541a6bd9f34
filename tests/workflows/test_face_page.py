"""The page of a look, on which a click on a face shows its selectors."""

import json
import re
import shutil
from os import environ

import numpy as np
import pytest

from beadwave.geometry.cad.selectors import faces
from beadwave.geometry.drawing import face_triangles
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.structure.bodies import drawing
from beadwave.workflows.structure.face_page import face_page

from command_line import beadwave

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ASKED = environ.get("BEADWAVE_TEST_BROWSER")  # where it is set, a missing browser is a failure
BROWSER = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


@pytest.fixture(scope="module")
def html():
    with drawing(scene("rig-rom"), lines=False) as geometry:
        return face_page("rig", geometry.bodies, face_triangles(geometry))


def rows_of(html):
    return json.loads(re.search(r'id="data">(.*?)</script>', html)[1])["faces"]


def test_each_face_has_a_selector_of_its_own_and_all_pick_it(html):
    rows = rows_of(html)
    with drawing(scene("rig-rom"), lines=False) as geometry:
        every = [(body.name, face.tag) for body in geometry.bodies.values() for face in body.faces]
        assert [row["body"] for row in rows] == [body for body, _ in every]
        for row, (body, tag) in zip(rows, every, strict=True):
            assert row["selectors"], row["kind"]
            for selector in row["selectors"]:
                picked = faces(selector["text"], geometry.bodies)
                assert picked.body == body and tag in picked.tags
                assert len(picked.tags) == selector["faces"]
    words = {selector["text"] for row in rows for selector in row["selectors"]}
    assert {"block:+x", "plate:-z", "sheet-y:hole(6 mm)", "sheet-y:hole"} < words


def test_triangles_cover_each_face(html):
    """Plane faces of the blocks exactly: the sum of their triangles is the area in their words."""
    for row in rows_of(html):
        corners = np.array(row["points"]).reshape(-1, 3, 3)
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = 1e6 * np.linalg.norm(np.cross(a, b), axis=1).sum() / 2
        stated = float(re.search(r"([\d.e+]+) mm²", row["kind"])[1])
        assert area == pytest.approx(stated, rel=0.02)  # chords of a bore: 1.6 %


@pytest.mark.slow
@pytest.mark.skipif(not (CHROMIUM or ASKED), reason="no chromium: apt-get install chromium")
def test_a_click_shows_the_selectors_of_the_face_under_it(tmp_path):
    from playwright.sync_api import sync_playwright

    assert beadwave("look", "cantilever", f"--out={tmp_path}") == 0
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=BROWSER)
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        errors = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda said: errors.append(said.text) if said.type == "error" else None)
        page.goto(f"file://{tmp_path}/faces.html")
        box = page.locator("#view").bounding_box()
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        shown = page.locator("#picked").inner_text()
        # the beam's side that is struck is behind; of those towards the eye its middle shows one
        assert re.search(r'"beam:[+-][xyz]"', shown) and "this face alone" in shown
        page.locator("tbody tr").nth(0).click()
        assert page.locator("#picked").inner_text() != shown
        page.set_viewport_size({"width": 400, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= 400
        browser.close()
    assert not errors
