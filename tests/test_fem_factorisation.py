import numpy as np
import pytest
from scipy.sparse import csc_matrix, diags_array

from fem import factorised
from fem.factorisation import Pardiso, has_pardiso


def spring_chain(n, held=True):
    diagonal = np.full(n, 2.0)
    diagonal[-1] = 1.0
    if not held:
        diagonal[0] = 1.0
    return csc_matrix(diags_array([diagonal, -np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1, -1]))


def test_a_factor_solves_for_one_and_for_many_right_hand_sides():
    K = spring_chain(50)
    pulled = factorised(K).solve(np.eye(50)[:, -1])
    np.testing.assert_allclose(pulled, np.arange(1, 51), rtol=1e-12)
    np.testing.assert_allclose(factorised(K).solve(np.eye(50)) @ K, np.eye(50), atol=1e-9)


def test_a_free_structure_is_refused():
    with pytest.raises(ValueError, match="neither held nor joined"):
        factorised(spring_chain(50, held=False))


def test_nan_is_refused():
    with pytest.raises(ValueError, match="NaN or inf"):
        factorised(spring_chain(5) * np.nan)


@pytest.mark.skipif(not has_pardiso(), reason="PARDISO is optional (the extra `fast`)")
def test_both_solvers_agree():
    K = spring_chain(200)
    b = np.random.default_rng(0).normal(size=(200, 3))
    np.testing.assert_allclose(Pardiso(K).solve(b), factorised(K).solve(b), rtol=1e-9)
    np.testing.assert_allclose(Pardiso(K).solve(b[:, 0]), factorised(K).solve(b[:, 0]), rtol=1e-9)


@pytest.mark.skipif(not has_pardiso(), reason="PARDISO is optional (the extra `fast`)")
def test_the_library_of_the_solver_is_searched_for_once(monkeypatch):
    Pardiso(spring_chain(5))

    def searched(name):
        raise AssertionError(f"{name} searched for again")

    monkeypatch.setattr("pypardiso.pardiso_wrapper.find_library", searched)
    assert Pardiso(spring_chain(5)).solve(np.ones(5)).any()
