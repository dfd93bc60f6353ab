"""The pattern of a stiffness with what joins two bodies, which tangents share."""

import numpy as np
import pytest
import scipy.sparse as sp
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.mechanics.assembly import joint_pattern
from signorini_fx.mechanics.assembly.joint_pattern import joined_stiffness
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness, NodalStiffness
from signorini_fx.mechanics.body.elastic_body import sum_of


@pytest.fixture(scope="module")
def body():
    """A form on a square with a clamped side, its condition, and which unknowns that prescribes."""
    mesh = dmesh.create_unit_square(MPI.COMM_SELF, 5, 4)
    space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    nodes = fem.locate_dofs_geometrical(space, lambda x: np.isclose(x[0], 0.0))
    fixed = np.zeros(2 * space.dofmap.index_map.size_local, dtype=bool)
    fixed[(2 * nodes[:, None] + np.arange(2)).ravel()] = True
    form = fem.form(ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx)
    return form, fem.dirichletbc(np.zeros(2), nodes, space), fixed


def beside(nodes, seed=0):
    """Blocks at two nodes, and a joint between some, which are in no order."""
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(2 * len(nodes), 2 * len(nodes)))
    joint = JointStiffness(np.array(nodes), sp.csr_array(matrix + matrix.T))
    return NodalStiffness(np.array([3, 7]), np.tile(np.eye(2), (2, 1, 1)), (joint,))


def entries(matrix):
    """As a dense array."""
    starts, columns, values = matrix.getValuesCSR()
    return sp.csr_array((values, columns, starts), shape=matrix.getSize()).toarray()


def test_entries_are_those_of_a_sum(body):
    """Whatever pattern there was before: of the same joints, of others, of another form, or none."""
    form, condition, fixed = body
    last, seen = None, []
    for number, nodes in enumerate(([28, 1, 14], [28, 1, 14], [2, 22, 9], [28, 1, 14])):
        added = beside(nodes, number)
        expected = sum_of((form,), [condition])
        added.add_to(expected, fixed)
        matrix, last = joined_stiffness((form,), [condition], added, fixed, last)
        np.testing.assert_allclose(entries(matrix), entries(expected), rtol=0, atol=1e-14)
        seen.append(last)
    assert seen[1] is seen[0]
    assert seen[2] is not seen[1]
    assert seen[3] is seen[2]  # which has kept room for both
    twice = (form, form)
    expected = sum_of(twice, [condition])
    added.add_to(expected, fixed)
    matrix, other = joined_stiffness(twice, [condition], added, fixed, last)
    assert other is not last
    np.testing.assert_allclose(entries(matrix), entries(expected), rtol=0, atol=1e-14)


def test_room_that_is_not_needed_is_given_up(body, monkeypatch):
    """A pattern does not grow with each facet that is passed."""
    monkeypatch.setattr(joint_pattern, "KEPT_ROOM", 0.5)
    form, condition, fixed = body
    last, sizes = None, []
    for nodes in ([28, 1, 14], [2, 22], [4, 26]):
        _, last = joined_stiffness((form,), [condition], beside(nodes), fixed, last)
        sizes.append(last.room.size)
    assert sizes[2] == sizes[1] < sizes[0]
