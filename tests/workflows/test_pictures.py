"""Pictures say what they show: no text over another, one scale, the band that was looked at."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from beadwave.fem.modes.mode_field import ModeField
from beadwave.workflows.files.record import SYNTHETIC
from beadwave.workflows.fit import fit_pictures
from beadwave.workflows.report import render
from beadwave.workflows.report.page_rows import velocity_errors
from beadwave.workflows.report.plots import Line, Panel, drawn
from beadwave.workflows.report.summary import ErrorEstimate, Summary
from beadwave.workflows.structure import hammer
from beadwave.workflows.structure.hammer import IdentifiedTest, auto_mac, shown_lines
from beadwave.workflows.sweep import sweep_pictures

from command_line import COARSE_RUN, beadwave

pytestmark = pytest.mark.pictures
X = np.linspace(0.0, 1.0, 11)


@pytest.mark.parametrize("n_lines", [1, 4, 5, 9])
@pytest.mark.parametrize("columns", [1, 2])
def test_no_legend_stands_over_a_title(n_lines, columns):
    lines = [Line(f"the curve of number {i}", X, X) for i in range(n_lines)]
    title = f"{SYNTHETIC}, of a file with a name"[: 48 // columns]
    sets = [Panel(title, "x", "y", lines, legend="above")] * 2
    figure, axes = drawn(sets, columns=columns, size=(9, 3))
    FigureCanvasAgg(figure).draw()
    for axis in axes:
        names, heading = axis.get_legend().get_window_extent(), axis._left_title.get_window_extent()
        beside = heading.x1 <= names.x0
        assert beside or names.y1 <= heading.y0 + 1.0 < names.y1 + 12.0  # pixels: above, not far
        assert beside == (n_lines * columns < 4)


def identified(low, high, title=SYNTHETIC):
    """A test of two modes at three points, identified between two frequencies [Hz]."""
    step = SimpleNamespace(step="poly-reference", options={"from_hz": low, "to_hz": high})
    rows = [
        SimpleNamespace(number=1, frequency_hz=351.4),
        SimpleNamespace(number=2, frequency_hz=12641.1),
    ]
    report = SimpleNamespace(title=title, steps=[step], rows=rows)
    f = np.arange(0.0, 20001.0, 10.0)
    usable = np.ones(len(f), bool)
    responses = SimpleNamespace(frequency_hz=f, H=np.ones((3, 1, len(f)), complex), usable=usable)
    phi = np.array([[1.0, 1.0], [1.0, -1.0], [0.0, 0.2]])
    return IdentifiedTest(report, SimpleNamespace(responses=responses), SimpleNamespace(phi=phi))


def test_pictures_of_a_hammer_test_end_a_little_beyond_the_band():
    for low, high, first, last in (
        (0, 6000, 10, 6900),
        (5000, 6000, 4850, 6150),
        (10, 2e4, 10, 2e4),
    ):
        test = identified(low, high)
        f = test.test.responses.frequency_hz[shown_lines(test)]
        assert (f[0], f[-1]) == (first, last)
        np.testing.assert_array_equal(
            hammer.summed_response(test.test.responses, shown_lines(test))[0], f
        )


def test_only_pictures_of_a_computed_test_have_the_banner():
    assert identified(0, 1).banner == SYNTHETIC
    assert identified(0, 1, "arm, 12 March").banner == ""


def test_alike_shapes_are_dark_in_the_auto_mac_and_high_frequencies_have_no_power(monkeypatch):
    maps, drawn_map = [], hammer.plots.heat_map

    def heat_map(axis, values, names, label, **how):
        drawn_map(axis, values, names, label, **how)
        maps.append((names, how, axis.images[0]))

    monkeypatch.setattr(hammer.plots, "heat_map", heat_map)
    assert auto_mac(identified(0, 20_000))[1:4] == b"PNG"
    ((names, how, image),) = maps
    assert names[0] == ["1: 351.4 Hz", "2: 12641 Hz"]
    assert how["limits"] == (0, 1)  # as the MAC with computed modes
    alike, unlike = (np.mean(image.cmap(image.norm(value))[:3]) for value in (1.0, 0.0))
    assert alike < 0.35 and unlike > 0.95


def test_a_mode_above_ten_kilohertz_is_named_by_its_digits():
    hz = np.array([51.0, 2174.26, 9999.4, 9999.7, 12413.2])
    field = ModeField({}, np.arange(1, 6), hz, np.zeros((5, 0, 3)), np.array([0, 2, 0, 0, 0]))
    assert field.names == [
        "mode 1: 51 Hz", "mode 2: 2174 Hz, measured 2", "mode 3: 9999 Hz", "mode 4: 10000 Hz",
        "mode 5: 12413 Hz",
    ]  # fmt: skip


def captured(monkeypatch, module, name):
    """Panels that a module hands to a function of `plots`."""
    panels, usual = [], getattr(module, name)

    def drawing(sets, **layout):
        panels.extend(sets)
        return usual(sets, **layout)

    monkeypatch.setattr(module, name, drawing)
    return panels


def test_curves_of_a_grid_have_a_marker_at_each_case(monkeypatch):
    panels = captured(monkeypatch, sweep_pictures, "panels")
    mass, hz = (x.ravel() for x in np.meshgrid([1.0, 3.0], [200.0, 300.0, 400.0]))
    sweep_pictures.picture(
        "force_N", mass * hz, {"wall.frequency [Hz]": hz, "wall.mass [kg]": mass}, {}
    )
    (panel,) = panels
    assert len(panel.lines) == 3 and all(line.style == "o-" for line in panel.lines)
    assert all(line.x.tolist() == [1.0, 3.0] for line in panel.lines)


def test_bars_over_the_length_say_that_they_are_of_the_noise_alone(monkeypatch):
    panels = captured(monkeypatch, fit_pictures, "drawn")
    row = SimpleNamespace(name="beam.thickness", bounds=(0.0, 2.0))
    report = SimpleNamespace(
        numbers=[row], record_length_s=[1e-3, 2e-3],
        two_sigma_by_length={"beam.thickness": [1.0, 0.1]},
    )  # fmt: skip
    assert fit_pictures.by_length(report, SYNTHETIC)[1:4] == b"PNG"
    assert panels[0].title.startswith("of the noise alone") and "theory" in panels[0].title
    np.testing.assert_allclose(panels[0].lines[0].y, [0.5, 0.05])


@pytest.mark.parametrize(
    ("radii", "n_drawn", "words"),
    [
        ([0.01] * 10, 10, "impact of a chain of 10"),
        ([0.01, 0.02], 2, "impact of a chain of 2"),
        ([0.01] * 200, 112, "impact of a chain of 200, 112 drawn"),  # 1.3 * 3^0.5 m of 0.02 m
        ([], 0, "impact"),
    ],
)
def test_every_sphere_of_a_chain_is_drawn_or_the_legend_says_how_many(
    radii, n_drawn, words, tmp_path, monkeypatch
):
    cube = render.pv.ImageData(dimensions=(2, 2, 2)).cast_to_unstructured_grid()
    cube.cell_data["body"] = np.zeros(1, int)
    centres, legends, sphere = [], [], render.pv.Sphere

    def counted(*, radius, center):
        centres.append(center)
        return sphere(radius=radius, center=center)

    monkeypatch.setattr(render.pv, "Sphere", counted)
    monkeypatch.setattr(
        render.pv.Plotter, "add_legend", lambda self, rows, **_: legends.extend(rows)
    )
    fixtures = render.Fixtures(["cube"], strike=[1.0, 0.5, 0.5, -1.0, 0.0, 0.0], spheres=radii)
    render.assembly(cube, fixtures, tmp_path / "assembly.png")
    assert len(centres) == n_drawn and [words] == [text for text, _ in legends]
    ends = np.cumsum([0.0, *(2 * radius for radius in radii[:n_drawn])])
    np.testing.assert_allclose([c[0] for c in centres], 1 + (ends[1:] + ends[:-1]) / 2)


def test_the_picture_shows_the_place_and_the_spheres_of_every_chain():
    plotter, drawn = render.white_plotter((1, 1)), []
    plotter.add_mesh = lambda mesh, **_: drawn.append(np.array(mesh.center))
    first, second = [0.0, 0.0, 1.0, 0.0, 0.0, -1.0], [1.0, 0.0, 0.0, -1.0, 0.0, 0.0]
    fixtures = render.Fixtures(["cube"], strike=first, spheres=[0.1] * 2)
    legend = render.struck(plotter, fixtures._replace(further=[(second, [0.2])]), 1.0)
    assert [words for words, _ in legend] == ["impacts of chains of 2 and 1"]
    np.testing.assert_allclose(drawn[3], [1.2, 0.0, 0.0], atol=1e-6)  # behind two and an arrow
    assert len(drawn) == 5
    without = fixtures._replace(spheres=(), further=[(second, ())])
    assert [words for words, _ in render.struck(plotter, without, 1.0)] == ["impacts"]


@pytest.mark.parametrize(("radii", "right_of_middle"), [([], True), ([0.01] * 10, False)])
def test_heights_stand_across_from_the_names(radii, right_of_middle, tmp_path, monkeypatch):
    cube = render.pv.ImageData(dimensions=(2, 2, 2)).cast_to_unstructured_grid()
    cube.cell_data["body"] = np.zeros(1, int)
    strike, places = [1.0, 0.5, 0.5, -1.0, 0.0, 0.0], {}
    right = np.cross(render.UP, render.eye_of(strike))

    def placed(self, points, labels, **_):
        beyond_middle = (np.array(points) - 0.5) @ right
        places.update(zip((text.strip() for text in labels), beyond_middle > 0, strict=True))

    monkeypatch.setattr(render.pv.Plotter, "add_point_labels", placed)
    fixtures = render.Fixtures(["cube"], strike=strike, spheres=radii)
    render.assembly(cube, fixtures, tmp_path / "assembly.png")
    middle = {"500": False} if right_of_middle else {}  # where the chain may pass there is none
    heights = dict.fromkeys(("0", *middle, "z = 1000 mm"), not right_of_middle)
    assert places == {"cube": right_of_middle} | heights


def test_the_first_sentence_on_errors_leaves_no_known_one_out():
    errors = ErrorEstimate(time=1e-4, mesh=0.02, receptance=3e-3)
    assert velocity_errors(Summary(scene="arm", error_estimate=errors)) == [
        (1e-4, "the time step"), (0.02, "the mesh"), (3e-3, "the measured receptances"),
    ]  # fmt: skip
    assert velocity_errors(Summary(scene="arm")) == [(None, "the time step")]
    known = {cause: 0.1 for cause in ErrorEstimate.model_fields}
    of_all = velocity_errors(Summary(scene="arm", error_estimate=ErrorEstimate(**known)))
    assert len(of_all) == len(known)


def test_a_bar_has_the_colour_of_its_verdict_and_a_legend_names_those_that_are_not_yes(monkeypatch):
    figures, usual = [], fit_pictures.png
    monkeypatch.setattr(
        fit_pictures, "png", lambda figure, face: figures.append(figure) or usual(figure)
    )

    def drawn_with(*verdicts):
        rows = [
            SimpleNamespace(name=f"wall.{i}", two_sigma=0.1 + i, found=2.0, identifiable=verdict)
            for i, verdict in enumerate(verdicts)
        ]
        fit_pictures.parameters(SimpleNamespace(parameters=rows), "")
        (panel,) = figures.pop().axes
        bars = sorted(panel.patches, key=lambda bar: bar.get_x())
        np.testing.assert_allclose(
            [bar.get_height() for bar in bars], [50 * (0.1 + i) for i in range(len(rows))]
        )
        names = panel.get_legend() and [text.get_text() for text in panel.get_legend().get_texts()]
        return [bar.get_facecolor() for bar in bars], names

    colours, names = drawn_with("yes", "no", "yes", "unconfirmed")
    assert colours[0] == colours[2] and len(set(colours)) == 3
    assert names == ["identifiable: yes", "identifiable: no", "identifiable: unconfirmed"]
    assert drawn_with("yes", "yes")[1] is None


@pytest.mark.slow
def test_a_killed_render_costs_the_pictures_only(monkeypatch, tmp_path, own_folder, capsys):
    killed = tmp_path / "python"
    killed.write_text("#!/bin/sh\nkill -SEGV $$\n")
    killed.chmod(0o755)
    monkeypatch.setattr("sys.executable", str(killed))
    changes = (f"--set={change}" for change in COARSE_RUN)
    assert beadwave("run", "rig-rom", *changes, "--out=out", "--json") == 0
    printed = capsys.readouterr()
    warnings = json.loads(printed.out)["warnings"]
    (warning,) = (sentence for sentence in warnings if "could not be rendered" in sentence)
    assert "libosmesa6" in warning
    assert not (tmp_path / "out" / "figures" / "modes.png").exists()
    assert warning in (tmp_path / "out" / "report.html").read_text()
