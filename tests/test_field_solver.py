"""Laws of the sparse Hermitian solver: it solves, whatever the order and the couplings."""

import numpy as np
import pytest
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import splu

from btfcore.hermitian import HermitianSolver, dissected
from btfcore.mesh.topology import edges
from tests.surfaces import plane, sphere


def system(count, pairs, seed=0, shift=0.1):
    """Connection Laplacian with random turns and weights, shifted."""
    random = np.random.default_rng(seed)
    weight = random.uniform(0.1, 3, len(pairs))
    turn = np.exp(2j * np.pi * random.random(len(pairs)))
    tail, head = pairs.T
    values = np.concatenate([weight, weight, -weight * turn, -weight * turn.conj()])
    rows, columns = np.concatenate([tail, head, head, tail]), np.concatenate([tail, head] * 2)
    matrix = csc_array(coo_array((values, (rows, columns)), shape=(count, count)))
    return csc_array(matrix + diags_array(np.full(count, shift)))


@pytest.mark.parametrize("make", [plane, sphere])
def test_solutions_fulfil_the_system(make):
    dense = make()
    pairs, _ = edges(dense.faces)
    matrix = system(len(dense.vertices), pairs)
    right = np.random.default_rng(1).standard_normal((2, len(dense.vertices)))
    right = right[0] + 1j * right[1]
    solver = HermitianSolver(matrix, dissected(dense.vertices, pairs))
    found = solver.solve(right)
    assert np.abs(matrix @ found - right).max() < 1e-10
    np.testing.assert_allclose(found, splu(matrix).solve(right), atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_any_order_gives_the_dense_solution(seed):
    random = np.random.default_rng(seed)
    count = 30
    pairs = np.unique(np.sort(random.integers(0, count, (60, 2)), axis=1), axis=0)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    matrix = system(count, pairs, seed)
    right = random.standard_normal(count) + 0j
    solver = HermitianSolver(matrix, random.permutation(count).astype(np.int32))
    expected = np.linalg.solve(matrix.toarray(), right)
    np.testing.assert_allclose(solver.solve(right), expected, atol=1e-10)


def test_uncoupled_unknowns_and_a_single_one_are_solved():
    none = np.zeros((0, 2), np.int32)
    for count in (1, 40):
        points = np.zeros((count, 3))
        solver = HermitianSolver(system(count, none, shift=2.0), dissected(points, none))
        np.testing.assert_allclose(solver.solve(np.ones(count) + 0j), 0.5)


def test_dissection_orders_every_unknown_once_and_saves_fill_in():
    dense = plane(60, 60)
    pairs, _ = edges(dense.faces)
    order = dissected(dense.vertices, pairs)
    np.testing.assert_array_equal(np.sort(order), np.arange(3600))
    matrix = system(3600, pairs)

    def fill(order):
        return len(HermitianSolver(matrix, order)._lower)

    assert fill(order) < 0.6 * fill(np.arange(3600, dtype=np.int32))
