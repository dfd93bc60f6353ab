"""The proved distance from the fixed point of Coulomb friction, against fixed points that are known to 1e-12."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import alone, example1
from spaces import block

from signorini_fx.addons.uniqueness.fixed_point import fixed_point
from signorini_fx.results.summary import lines_of, summarise


def energy_norm_of_difference(one, other):
    """With the stiffness of the mesh that both are on."""
    e = one.displacement.x.petsc_vec.copy()
    e.axpy(-1, other.displacement.x.petsc_vec)
    matrix = one.model.elasticity([]).matrix
    product = matrix.createVecLeft()
    matrix.mult(e, product)
    return float(np.sqrt(product.dot(e)))


def in_the_plane(**friction):
    """Example 1 on 24 x 8 cells; the problem without regularisation."""
    return example1(nx=24, ny=8, gamma="auto", algorithm="exact", tolerance=1e-12, **friction)


def in_space(**friction):
    """A block over a paraboloid; its regularised problem."""
    return block(6, "hexahedra", tolerance=1e-12, coulomb="fp", **friction)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("scene", "bound"),
    [(in_the_plane, 0.5), (in_the_plane, 3.0), (in_space, 0.5), (in_space, 3.0), (in_space, "2 * abs(x[0])")],
)
def test_a_bound_that_is_far_from_the_fixed_point(scene, bound):
    """The solution with Tresca friction is a state of the iteration: its distance from the fixed point, and that of its
    bound, are at most what is proved, and not a hundredth of it.
    """
    coefficient = 0.2
    exact, state = alone(scene(coefficient=coefficient)), alone(scene(bound=bound))
    contact = replace(state.contact, bound=coefficient * state.contact.pressure)
    found = fixed_point(exact.model, contact)
    assert 0 < found.contraction < 1
    true = energy_norm_of_difference(state, exact)
    assert 0.01 * found.distance < true <= found.distance
    # The norm is a weighted one: where the bound is wrong everywhere by more than a share, the distance is no less.
    used, right = state.contact.bound, exact.contact.bound
    here = exact.contact.in_contact | state.contact.in_contact
    assert (np.abs(used - right)[here] / np.maximum(used, right)[here]).min() <= found.bound


def test_after_an_iteration():
    """What the iteration leaves is seen, in the plane with all ways to reach the fixed point."""
    scene = in_the_plane(coefficient=0.3)
    exact = alone(scene)
    for way in ({"coulomb": "fp", "tolerance": 1e-4}, {"coulomb": "newton"}):
        solver = scene.solver.model_copy(update=way)
        solution = alone(scene.model_copy(update={"solver": solver}))
        near = solution.fixed_point
        assert energy_norm_of_difference(solution, exact) <= near.distance + 1e-14
        assert near.distance < 1e-6


def test_what_the_line_says():
    """A number and what is assumed; where nothing is proved, that; without Coulomb friction, nothing."""
    scene = example1(coefficient=0.3, nx=24, ny=8, gamma="auto", error_bound=True)
    solution = alone(scene)
    summary = summarise(solution)
    told = "\n".join(map(str, lines_of(summary)))
    assert "the fixed point of this mesh is within" in told
    assert "that this is the bound of the exact solution is assumed; if linear systems are solved" in told
    assert summary["error_bound"]["contraction"] == solution.fixed_point.contraction < 1
    rough = alone(example1(coefficient=2.0, nx=24, ny=8, gamma="auto", error_bound=True))
    found = summarise(rough)["error_bound"]
    assert found["fixed_point"] is None
    assert found["contraction"] > 1
    assert "is not known: the contraction number is" in found["statement"]
    assert alone(example1(bound=1.5, nx=12, ny=4)).fixed_point is None


def test_nothing_without_asking():
    """A scene that asks for no bound does not compute it."""
    solution = alone(example1(coefficient=0.3, nx=12, ny=4))
    summarise(solution)
    assert "fixed_point" not in vars(solution)
