"""Pictures and printed tables that all findings share."""

from io import BytesIO

import numpy as np
import pytest
from matplotlib.image import imread

from beadwave.workflows.report.finding import Finding, record, text
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import Table

pytestmark = pytest.mark.pictures


@pytest.mark.slow
def test_curves_differ_on_paper_without_colour():
    """In grey: the same two curves, in other dashes or markers, are another picture."""
    x = np.linspace(1.0, 2.0, 20)

    def grey(*styles):
        lines = [Line(None, x, x + i, style, place) for i, (style, place) in enumerate(styles)]
        raw = imread(BytesIO(panels([Panel("", "", "", lines)])))[..., :3]
        return (raw @ np.full(3, 1 / 3) < 0.95).mean()

    dashed = {round(grey((None, place)), 4) for place in range(5)}
    assert len(dashed) == 5
    assert grey(("o-", 0)) > grey(("-", 0)) and grey(("s", 0)) != grey(("x", 0))


def test_a_number_that_is_none_is_a_dash_and_null():
    row = ("a", float("nan"), float("inf"))
    empty = Finding((Table("s", ("x", "y", "z"), (row,)),))
    assert record(empty)["rows"] == [{"x": "a", "y": None, "z": None}]
    assert text(empty).splitlines()[1].split() == ["a", "-", "inf"]
