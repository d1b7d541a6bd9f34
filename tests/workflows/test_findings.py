"""Findings: their tables, pictures and sentences."""

import numpy as np
import pytest

from beadwave.dem.waves.measures import exponent
from beadwave.workflows.report.tables import Table, as_csv, records, short, text


def test_a_table_is_aligned_for_a_person_and_exact_for_machines():
    table = Table("t", ("wall", "force"), (("steel", 1234.5), ("a", 0.00012345), ("b", np.nan)))
    assert text(table) == "wall      force\nsteel      1234\na      0.000123\nb             -"
    assert as_csv(table) == "wall,force\nsteel,1234.5\na,0.00012345\nb,\n"
    assert records(table)[2] == {"wall": "b", "force": None}
    assert short(1e5) == "1e+05" and short(None) == "-"


def test_the_exponent_of_a_power_law_is_found():
    x = np.geomspace(1.0, 9.0, 5)
    assert exponent(x, 3.0 * x**0.4) == pytest.approx(0.4, abs=1e-12)
