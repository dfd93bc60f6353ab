"""Averages over the hats of a surface in contact, for motions and forces that are known."""

from pathlib import Path

import numpy as np
import pytest

from signorini_fx.addons.judging.problems import judged_problem
from signorini_fx.addons.judging.projection import closest_points
from signorini_fx.addons.judging.touching_surface import touching_surface
from stability.foreign_decks import ForeignDeck, text_of
from stability.judged import CELLS, ELEMENTS

DATA = Path(__file__).parent / "data"
NAMES = ["stack_CPE4", "stack_CPE8R", "press_C3D8", "shelf_C3D20R", "shelf_C3D4", "shelf_CPE6"]


@pytest.mark.parametrize("name", NAMES)
def test_a_body_that_is_moved(name):
    """Down by some length and along by another one: what enters, the clearance and the slip are these."""
    problem, _ = judged_problem(DATA / f"{name}.inp")
    (contact,) = problem.contacts
    upper = problem.mesh.bodies == problem.mesh.bodies[contact.facets[0, 0]]
    gap = 0.02 if name.startswith("shelf") else 0.0
    v = np.zeros_like(problem.mesh.points)
    v[upper, 0], v[upper, -1] = 0.003, -0.03
    surface = touching_surface(problem, contact, v, np.zeros_like(v))
    np.testing.assert_allclose(surface.penetration, 0.03 - gap, rtol=1e-9)
    np.testing.assert_allclose(surface.clearance, gap - 0.03, rtol=1e-9)
    along = np.zeros(problem.mesh.dim)
    along[0] = 0.003
    np.testing.assert_allclose(surface.slip, np.broadcast_to(along, surface.slip.shape), atol=1e-12)
    down = -np.eye(problem.mesh.dim)[-1]
    np.testing.assert_allclose(surface.normal, np.broadcast_to(down, surface.normal.shape), atol=1e-12)
    assert surface.rotation == pytest.approx(0.0, abs=1e-12)
    # Apart: nothing enters.
    v[upper, -1] = 0.01
    surface = touching_surface(problem, contact, v, np.zeros_like(v))
    assert surface.penetration.max() == 0
    np.testing.assert_allclose(surface.clearance, gap + 0.01, rtol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_nodal_forces_of_a_uniform_traction(name):
    """Of a pressure and a shear each hat has its area times these, whatever the element."""
    from signorini_fx.addons.judging.problem_data import facet_points

    problem, _ = judged_problem(DATA / f"{name}.inp")
    (contact,) = problem.contacts
    at = facet_points(problem.mesh, contact.facets, 4, revolved=False)
    traction = np.zeros(problem.mesh.dim)
    traction[0], traction[-1] = 0.5, 2.0  # upward, which presses the body
    forces = np.zeros_like(problem.mesh.points)
    np.add.at(forces, contact.facets, np.einsum("fq,qk,d->fkd", at.weight, at.shape, traction))
    surface = touching_surface(problem, contact, np.zeros_like(forces), forces)
    loose = surface.sliding
    assert loose.any()
    np.testing.assert_allclose(surface.push[loose], 2.0 * surface.area[loose], rtol=1e-10)
    np.testing.assert_allclose(surface.shear[loose, 0], 0.5 * surface.area[loose], rtol=1e-10)
    assert surface.area.sum() == pytest.approx(2.0 if problem.mesh.dim == 2 else 2.0 * 1.0, rel=1e-12)


def test_closest_points_of_a_curved_surface():
    """A facet of degree 2 that is a parabola: the distance along its normal, and none beside it."""
    problem, _ = judged_problem(DATA / "stack_CPE8R.inp")
    (contact,) = problem.contacts
    x = problem.mesh.points.copy()
    bent = np.unique(contact.opposite)
    x[bent, 1] += 0.05 * x[bent, 0] ** 2  # each facet holds a parabola exactly
    s = np.linspace(0.1, 1.9, 7)
    normal = np.column_stack((-0.1 * s, np.ones_like(s))) / np.sqrt(1 + 0.01 * s**2)[:, None]
    base = np.column_stack((s, x[bent, 1].min() + 0.05 * s**2))
    found = closest_points(problem.mesh, contact.opposite, x, base + 0.01 * normal)
    np.testing.assert_allclose(found.distance, 0.01, rtol=1e-6)
    np.testing.assert_allclose(found.normal, normal, atol=1e-6)
    beside = closest_points(problem.mesh, contact.opposite, x, np.array([[9.0, 0.3]]))
    assert beside.distance[0] > 1


@pytest.mark.parametrize("kind", ["shelf", "press", "stack"])
@pytest.mark.parametrize("element", sorted({*ELEMENTS["plane"], *ELEMENTS["space"]}))
def test_the_decks_of_the_study_are_read_completely(tmp_path, kind, element):
    """Nothing of them is lost, and all of it can be judged."""
    dim, quadratic = (3, element in ("C3D10", "C3D20R")) if element[:3] == "C3D" else (2, element[3] in "68")
    friction = 0.3 if kind != "shelf" else 0.0
    deck = ForeignDeck(kind, element, CELLS[(1 if dim == 2 else 3) + quadratic][0], friction=friction, warp=0.2)
    (tmp_path / "deck.inp").write_text(text_of(deck))
    problem, reasons = judged_problem(tmp_path / "deck.inp")
    assert (reasons, problem.lost, problem.element) == ([], (), element)
    assert len(problem.rigid_bodies) == (kind != "stack")
    (contact,) = problem.contacts
    assert (contact.stiffness, contact.rubs, contact.nodal) == (1e5, kind != "shelf", False)
    for name, forces in problem.loads.items():
        size = {"BODY_TOP": 2.0, "BODY_RIGHT": 0.25}[name.split()[-1]]  # pressure 1 on 2, and .5 on .5
        revolved = element.startswith("CAX")
        mean = {"BODY_TOP": 2.0, "BODY_RIGHT": 3.0}[name.split()[-1]] if revolved else 1.0
        assert np.linalg.norm(forces.sum(axis=0)) == pytest.approx(size * mean, rel=1e-10)
