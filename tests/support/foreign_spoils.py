"""Displacements of other programs that are changed on purpose."""

import numpy as np
from scipy.sparse.linalg import splu

from signorini_fx.addons.judging.calculix_results import read_dat, read_frd
from signorini_fx.addons.judging.foreign_equilibrium import Equilibrium, best_fit
from signorini_fx.addons.judging.formulations import stiffness_by_material
from signorini_fx.addons.judging.problems import judged_problem
from signorini_fx.addons.judging.touching_surface import touching_surface


def displacements(file):
    """Numbers of nodes, and displacements, shape (n, 3)."""
    tables = (read_dat if file.suffix == ".dat" else read_frd)(file)
    return list(tables.displacement), np.array([values for values, _ in tables.displacement.values()])


def _judged(deck):
    """Problem, displacement, the fit of its equilibrium, and the surface of its first contact."""
    problem, _ = judged_problem(deck)
    numbers, values = displacements(deck.with_suffix(".dat"))
    rows = dict(zip(numbers, values, strict=True))
    v = np.array([rows[number][: problem.mesh.dim] for number in problem.mesh.names.tolist()])
    fit = best_fit(Equilibrium(problem, v, np.zeros_like(v))).fit
    return problem, v, fit, touching_surface(problem, problem.contacts[0], v, fit.residual)


def with_node_entering(deck):
    """The displacement of which the corner that is pressed most enters by a tenth of the largest one."""
    _, v, _, surface = _judged(deck)
    corner = int(np.argmax(np.where(surface.judged, surface.push, -np.inf)))
    v[surface.corners[corner]] += 0.1 * np.linalg.norm(v, axis=1).max() * surface.normal[corner]
    return v


def with_other_forces(deck, change):
    """The displacement in equilibrium with other forces at the corners in contact of a body that supports hold.

    Args:
        deck: the problem, with its .dat beside it.
        change: from forces at corners and normals, shapes (c, d), to what is added to them.
    """
    problem, v, fit, surface = _judged(deck)
    nodes = surface.corners[surface.sliding]
    extra = np.zeros_like(v)
    extra[nodes] = change(fit.residual[nodes], surface.normal[surface.sliding])
    free = np.flatnonzero((np.isnan(problem.prescribed) & problem.deformable[:, None]).ravel())
    stiffness = sum(stiffness_by_material(problem, fit.formulation))[free][:, free].tocsc()
    moved = v.ravel().copy()
    moved[free] += splu(stiffness).solve(extra.ravel()[free])
    return moved.reshape(v.shape)
