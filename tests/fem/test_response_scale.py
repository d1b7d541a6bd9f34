"""Residues of two masses on springs, exact, beside their mass-normalised shapes."""

import numpy as np
import pytest
from scipy.linalg import eigh

from beadwave.fem.identification.poly_reference import IdentifiedModes
from beadwave.fem.identification.response_scale import (
    POWERS,
    UNITS,
    remark_on_scale,
    response_scale,
)

K = np.array([[5e6, -2e6, 0.0], [-2e6, 4e6, -1e6], [0.0, -1e6, 1e6]])
M = np.diag([1.0, 2.0, 0.5])


@pytest.fixture
def shapes():
    omega2, phi = eigh(K, M)
    return np.sqrt(omega2), phi


def measured(omega, phi, power, hit=(0, 2)):
    """Modes as they are identified from (K - s^2 M)^-1 (i s)^power: partial fractions."""
    residues = np.einsum("pn,nm->npm", phi, phi[list(hit)].T) / (2j * omega)[:, None, None]
    residues = residues * ((1j * omega) ** power)[:, None, None]
    unit = phi / phi[np.abs(phi).argmax(axis=0), range(len(omega))]
    largest = np.abs(phi).argmax(axis=0)
    L = np.array([residues[n, largest[n]] for n in range(len(omega))])
    one = np.ones(len(omega))
    return IdentifiedModes(
        one, omega / (2 * np.pi), one, unit.astype(complex), L, one, one, one, one, one, (), (), ()
    )


@pytest.mark.parametrize("quantity", POWERS)
def test_exact_residues_have_the_size_of_their_model(shapes, quantity):
    omega, phi = shapes
    modes = measured(omega, phi, POWERS[quantity])
    # the partial fractions are those of the response itself
    s = 700.0
    H = np.linalg.inv(K - s**2 * M)[:, [0, 2]] * (1j * s) ** POWERS["displacements"]
    R = np.einsum("pn,nm->npm", phi, phi[[0, 2]].T) / (2j * omega)[:, None, None]
    poles = (1j * omega)[:, None, None]
    np.testing.assert_allclose((R / (1j * s - poles) - R / (1j * s + poles)).sum(axis=0), H)
    scale = response_scale(modes, quantity, phi, phi[[0, 2]])
    np.testing.assert_allclose(scale, 1.0, rtol=1e-12)
    # a model of four times the mass has shapes of half the size
    np.testing.assert_allclose(response_scale(modes, quantity, phi / 2, phi[[0, 2]] / 2), 4.0)
    assert remark_on_scale(scale) == ""


def test_units_called_by_anothers_name_are_told():
    for ratio, words in UNITS.items():
        assert words in remark_on_scale(np.array([0.9 * ratio, ratio, 1.1 * ratio, np.nan]))
    assert "look at units" in remark_on_scale(np.array([2.0, 2.1]))
    assert "1 paired mode:" in remark_on_scale(np.array([2.0]))
    assert remark_on_scale(np.array([np.nan])) == ""


def test_a_mode_that_no_response_sees_has_no_size(shapes):
    omega, phi = shapes
    scale = response_scale(measured(omega, phi, 2), "accelerations", 0 * phi, phi[[0, 2]])
    assert np.isnan(scale).all()
