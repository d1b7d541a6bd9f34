import sys

import numpy as np
import pytest
from scipy.sparse import csc_matrix, csr_matrix, diags_array, eye_array, kron
from scipy.sparse.linalg import splu
from skfem import MeshTet

from beadwave.fem import Connections, HeldFace, Material, assemble, factorised, joined
from beadwave.fem.modes.solver import factorisation
from beadwave.fem.modes.solver.factorisation import (
    Pardiso,
    _superlu,
    condensed_on,
    has_pardiso,
)
from beadwave.fem.modes.solver.grouping import grouped, minimum_degree_work
from beadwave.fem.modes.solver.multifrontal import Cholesky, NotPositiveDefinite, Singular, plan
from beadwave.fem.modes.solver.nested_dissection import edges, nested_dissection
from beadwave.workflows.installation import doctor

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


def test_the_compliance_of_sparse_rows_is_that_of_whole_solutions():
    """Rows of a few unknowns in no order, one that reads nothing and one that reads all."""
    line = diags_array([np.full(12, 2.5), -np.ones(11), -np.ones(11)], offsets=[0, 1, -1])
    one = eye_array(12)
    A = csc_matrix(
        sum(
            kron(kron(*p[:2]), p[2]) for p in ((line, one, one), (one, line, one), (one, one, line))
        )
    )
    rng = np.random.default_rng(3)
    C = np.zeros((150, A.shape[0]))  # more than are added at once
    for row in C[2:]:
        row[rng.integers(0, A.shape[0], 3)] = rng.standard_normal(3)
    C[1] = rng.standard_normal(A.shape[0])
    W = Cholesky(A, grouped(A)).compliance(csr_matrix(C))
    exact = C @ splu(A).solve(C.T)
    np.testing.assert_allclose(W, exact, rtol=0, atol=1e-13 * np.abs(exact).max())


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


def chain_with_rows():
    """A chain and seven rows of it, sums of two links each."""
    K = spring_chain(200)
    return K, csr_matrix((np.ones(14), (np.repeat(np.arange(7), 2), 13 * np.arange(14))), (7, 200))


@pytest.mark.skipif(not has_pardiso(), reason="PARDISO is optional (the extra `fast`)")
def test_a_border_leaves_its_compliance_and_the_solutions_of_the_matrix():
    K, C = chain_with_rows()
    b = np.random.default_rng(0).normal(size=(200, 3))
    factor = Pardiso(K, C)
    np.testing.assert_allclose(factor.compliance, C @ factorised(K).solve(C.T.toarray()), rtol=1e-9)
    np.testing.assert_allclose(factor.solve(b), factorised(K).solve(b), rtol=1e-9)
    np.testing.assert_allclose(factor.solve(b[:, 0]), factorised(K).solve(b[:, 0]), rtol=1e-9)


@pytest.mark.parametrize("from_on", [100, 1000])
def test_a_compliance_is_that_of_unit_forces_by_either_way(monkeypatch, from_on):
    monkeypatch.setattr(factorisation, "WORTH_PARDISO", from_on)
    monkeypatch.setattr(factorisation, "AT_ONCE", 4)
    K, C = chain_with_rows()
    factor, W = condensed_on(K, C)
    np.testing.assert_allclose(W, C @ np.linalg.inv(K.toarray()) @ C.T, rtol=1e-9)
    np.testing.assert_allclose(K @ factor.solve(np.ones(200)), 1.0, rtol=1e-9)
    with pytest.raises(Singular):
        condensed_on(spring_chain(200, held=False), C)


def no_columns(factor):
    return factor.solve(np.zeros((50, 0))).shape


@pytest.mark.parametrize("factor", [_superlu, lambda K: Cholesky(K, grouped(K))])
def test_a_factor_solves_for_no_right_hand_side_at_all(factor):
    assert no_columns(factor(spring_chain(50))) == (50, 0)


@pytest.mark.skipif(not has_pardiso(), reason="PARDISO is optional (the extra `fast`)")
def test_pardiso_solves_for_no_right_hand_side_at_all():
    assert no_columns(Pardiso(spring_chain(50))) == (50, 0)


@pytest.mark.skipif(not has_pardiso(), reason="PARDISO is optional (the extra `fast`)")
def test_a_solution_is_right_to_rounding_without_refinement():
    # a chain on a support of 1e-9 of its springs: the residual stays at rounding of its terms, and
    # a second and a third pass through the factor, which iparm(7) counts, are not paid for
    K = (spring_chain(2000, held=False) + 1e-9 * eye_array(2000)).tocsc()
    b = np.random.default_rng(0).normal(size=2000)
    factor = Pardiso(K)
    x = factor.solve(b)
    terms = np.linalg.norm(abs(K) @ abs(x))
    assert np.linalg.norm(K @ x - b) < 10 * np.finfo(float).eps * terms
    assert factor._solver.iparm[6] == 0


@pytest.mark.skipif(not has_pardiso(), reason="PARDISO is optional (the extra `fast`)")
def test_the_library_of_the_solver_is_searched_for_once(monkeypatch):
    Pardiso(spring_chain(5))

    def searched(name):
        raise AssertionError(f"{name} searched for again")

    monkeypatch.setattr("pypardiso.pardiso_wrapper.find_library", searched)
    assert Pardiso(spring_chain(5)).solve(np.ones(5)).any()


def test_a_solver_without_its_library_is_done_without(monkeypatch, tmp_path):
    text = "class PyPardisoSolver:\n    def __init__(self): raise ImportError('no mkl_rt')\n"
    (tmp_path / "pypardiso.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "pypardiso", raising=False)
    monkeypatch.setattr(factorisation, "WORTH_PARDISO", 10)
    for answer in (has_pardiso, factorisation._mkl):
        answer.cache_clear()
    try:
        assert factorised(spring_chain(50)).solve(np.eye(50)[:, -1])[-1] == pytest.approx(50.0)
        monkeypatch.setattr(doctor, "version", lambda name: "1.0")
        assert "missing: mkl: pypardiso finds no library mkl_rt" in doctor.doctor().text()
    finally:
        for answer in (has_pardiso, factorisation._mkl):
            answer.cache_clear()


def brick(n, held):
    """A cube of tetrahedra, held at its base or free, beside one that nothing joins to it."""
    lines = [np.linspace(0, 0.1, n)] * 3
    cube = MeshTet.init_tensor(*lines).with_boundaries({"base": lambda x: x[2] < 1e-9})
    structure = assemble({"one": cube, "other": cube}, dict.fromkeys(("one", "other"), STEEL))
    faces = [HeldFace("one:base"), HeldFace("other:base")] if held else []
    return joined(structure, Connections(held=faces))


def dissected(A):
    return Cholesky(A, grouped(A))


def test_cholesky_by_nested_dissection_solves_as_superlu_does():
    K = brick(6, held=True).K
    b = np.random.default_rng(0).normal(size=(K.shape[0], 3))
    exact = splu(K).solve(b)
    factor = dissected(K)
    np.testing.assert_allclose(factor.solve(b), exact, rtol=0, atol=1e-9 * np.abs(exact).max())
    np.testing.assert_allclose(factor.solve(b[:, 0]), exact[:, 0], atol=1e-9 * np.abs(exact).max())


def test_nested_dissection_keeps_halves_apart_and_every_vertex_once():
    K = brick(7, held=True).K
    graph = csr_matrix(abs(K).sign())
    domains = nested_dissection(graph, np.ones(K.shape[0], dtype=int))
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
    foreseen, factor = plan(grouped(K)).bytes, dissected(K)
    assert sum(L11.nbytes + L21.nbytes for L11, L21 in factor.blocks) == foreseen
    assert foreseen < 0.7 * 8 * _superlu(K).nnz


def test_indefinite_matrices_are_factorised_by_superlu(monkeypatch):
    monkeypatch.setattr(factorisation, "WORTH_COUNTING", (10, 10))
    model = brick(4, held=True)
    assert isinstance(factorised(model.K), Cholesky)
    indefinite = (model.K - (2 * np.pi * 1e5) ** 2 * model.M).tocsc()
    b = np.ones(indefinite.shape[0])
    assert not isinstance(factorised(indefinite), Cholesky)
    np.testing.assert_allclose(indefinite @ factorised(indefinite).solve(b), b, rtol=1e-6)
    with pytest.raises(ValueError, match="neither held nor joined"):
        factorised(brick(4, held=False).K)
    with pytest.raises(Singular):
        dissected(brick(4, held=False).K)
    with pytest.raises(NotPositiveDefinite):
        dissected(indefinite)


def test_minimum_degree_is_counted_on_the_groups_of_unknowns():
    K = brick(7, held=True).K
    groups = grouped(K)
    assert len(groups.weight) < 0.4 * K.shape[0]
    made = np.sum(np.diff(_superlu(K).L.indptr).astype(float) ** 2)
    assert minimum_degree_work(groups) == pytest.approx(made, rel=0.5)


def test_work_decides_between_minimum_degree_and_dissection(monkeypatch):
    monkeypatch.setattr(factorisation, "WORTH_COUNTING", (10, np.inf))
    K = brick(6, held=True).K
    thin = spring_chain(3000)
    assert not isinstance(factorised(thin), Cholesky)
    work = minimum_degree_work(grouped(K)) / K.shape[0]
    for worth, dissected_then in ((0.9 * work, True), (1.1 * work, False)):
        monkeypatch.setattr(factorisation, "WORTH_DISSECTION", worth)
        assert isinstance(factorised(K), Cholesky) == dissected_then


def test_a_plane_through_a_regular_grid_is_found_as_its_separator():
    """The first cut of 30 x 10 x 10 points is one of 100."""
    axes = [diags_array([np.ones(n - 1), np.ones(n), np.ones(n - 1)], offsets=[-1, 0, 1])
            for n in (30, 10, 10)]  # fmt: skip
    graph = csr_matrix(kron(axes[0], kron(axes[1], axes[2])))
    *_, first = nested_dissection(graph, np.ones(3000, dtype=int))
    assert len(first.vertices) == 100


def test_bodies_that_hang_on_a_thread_are_cut_there():
    """Cubes of 9^3 and 11^3 points, joined by a line of 5: halves need not be equal."""
    cubes = [MeshTet.init_tensor(*[np.arange(n)] * 3) for n in (9, 11)]
    sizes = [9**3, 5, 11**3]
    first = np.cumsum([0, *sizes])
    pairs = [cube.edges + first[2 * i] for i, cube in enumerate(cubes)]
    line = np.arange(first[1] - 1, first[2] + 1)
    i, j = np.hstack([*pairs, [line[:-1], line[1:]]])
    n = first[-1]
    graph = csr_matrix((np.ones(len(i)), (i, j)), shape=(n, n))
    *_, cut = nested_dissection(csr_matrix(graph + graph.T + eye_array(n)), np.ones(n, dtype=int))
    assert len(cut.vertices) == 1 and cut.vertices[0] in line
