import numpy as np
import pytest
from scipy.sparse import csc_matrix, csr_matrix, diags_array
from scipy.sparse.linalg import splu
from skfem import MeshTet

from fem import Connections, Held, Material, assemble, factorisation, factorised, joined
from fem.factorisation import Pardiso, _superlu, has_pardiso
from fem.multifrontal import Cholesky, NotPositiveDefinite, Singular, plan
from fem.nested_dissection import edges, nested_dissection

STEEL = Material(210e9, 0.3, 7850.0)


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


def brick(n, held):
    """A cube of tetrahedra, held at its base or free, beside one that nothing joins to it."""
    lines = [np.linspace(0, 0.1, n)] * 3
    cube = MeshTet.init_tensor(*lines).with_boundaries({"base": lambda x: x[2] < 1e-9})
    structure = assemble({"one": cube, "other": cube}, dict.fromkeys(("one", "other"), STEEL))
    faces = [Held("one:base"), Held("other:base")] if held else []
    return joined(structure, Connections(held=faces))


def test_cholesky_by_nested_dissection_solves_as_superlu_does():
    K = brick(6, held=True).K
    b = np.random.default_rng(0).normal(size=(K.shape[0], 3))
    exact = splu(K).solve(b)
    found = Cholesky(K)
    np.testing.assert_allclose(found.solve(b), exact, rtol=0, atol=1e-9 * np.abs(exact).max())
    np.testing.assert_allclose(found.solve(b[:, 0]), exact[:, 0], atol=1e-9 * np.abs(exact).max())


def test_nested_dissection_keeps_halves_apart_and_every_vertex_once():
    K = brick(7, held=True).K
    graph = csr_matrix(abs(K).sign())
    domains = nested_dissection(graph)
    assert np.array_equal(
        np.sort(np.concatenate([d.vertices for d in domains])), range(len(K.indptr) - 1)
    )
    below = [set()] * len(domains)
    for i, (vertices, children) in enumerate(domains):
        halves = [below[child] for child in children]
        for half in halves:
            met = set(edges(graph, np.array(sorted(half)))[1].tolist())
            assert not any(met & other for other in halves if other is not half)
        below[i] = set(vertices.tolist()).union(*halves)


def test_a_factor_takes_less_than_superlu_and_foresees_its_size():
    K = brick(7, held=True).K
    foreseen, factor = plan(K).bytes, Cholesky(K)
    assert sum(L11.nbytes + L21.nbytes for L11, L21 in factor.blocks) == foreseen
    assert foreseen < 0.7 * 8 * _superlu(K).nnz


def test_what_has_no_cholesky_factor_is_left_to_superlu(monkeypatch):
    monkeypatch.setattr(factorisation, "WORTH_DISSECTION", 10)
    model = brick(4, held=True)
    assert isinstance(factorised(model.K), Cholesky)
    indefinite = (model.K - (2 * np.pi * 1e5) ** 2 * model.M).tocsc()
    b = np.ones(indefinite.shape[0])
    assert not isinstance(factorised(indefinite), Cholesky)
    np.testing.assert_allclose(indefinite @ factorised(indefinite).solve(b), b, rtol=1e-6)
    with pytest.raises(ValueError, match="neither held nor joined"):
        factorised(brick(4, held=False).K)
    with pytest.raises(Singular):
        Cholesky(brick(4, held=False).K)
    with pytest.raises(NotPositiveDefinite):
        Cholesky(indefinite)
