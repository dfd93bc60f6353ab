"""True errors of displacements in space, against solutions of degree 2 on finer meshes."""

from dataclasses import replace

import numpy as np
from dolfinx import mesh as dmesh
from scenes import alone
from spaces import box

from signorini_fx.addons.bounds.error_bound import Bounded
from signorini_fx.addons.bounds.simplices import TWICE
from signorini_fx.errors import SignoriniError
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.scenes.reading import parse_scene

# Barycentric coordinates of four points inside, exact for products of linear functions.
_INSIDE = (5 - np.sqrt(5)) / 20 + np.eye(4) * np.sqrt(5) / 5


def problem(solution):
    """The solution as plain arrays on tetrahedra."""
    return Bounded(solution.model, solution.displacement, solution.contact, 0.0)


def energy_of_difference(solution, reference):
    """Energy norm of the difference of two displacements on nested meshes, the second one finer."""
    coarse, fine = problem(solution), problem(reference)
    t, c = fine.t, coarse.t
    x = np.einsum("qc,ncd->nqd", _INSIDE, t.x[t.corners])
    where, local = np.full(len(t.corners), -1), np.zeros((len(t.corners), 4))
    first, ones = c.x[c.corners[:, 0]], np.array([1.0, 0.0, 0.0, 0.0])
    for cell, centre in enumerate(t.x[t.corners].mean(axis=1)):  # the cell whose smallest coordinate is the largest
        found = ones + np.einsum("nid,nd->ni", c.gradients, centre - first)
        where[cell] = found.min(axis=1).argmax()
        local[cell] = found[where[cell]]
    assert local.min() > 0
    barycentric = ones + np.einsum("nid,nqd->nqi", c.gradients[where], x - first[where][:, None])
    own = np.einsum("nqc,nck->nqk", barycentric, coarse.strained(coarse.y, coarse.middle)[where])
    difference = np.einsum("qc,nck->nqk", _INSIDE, fine.strained(fine.y, fine.middle)) - own
    return float(np.sqrt((t.volume[:, None] / 4 * (t.stress(difference) * difference * TWICE[3]).sum(axis=2)).sum()))


def on_finer_mesh(scene, times=1):
    """The scene on tetrahedra that are twice or four times finer, of degree 2, without regularisation."""
    tagged = scene.mesh
    for _ in range(times):
        tagged = refine(tagged)
    solver = scene.solver.model_copy(update={"algorithm": "alm"})
    element = scene.element.model_copy(update={"degree": 2})
    return alone(scene.model_copy(update={"mesh": tagged, "element": element, "solver": solver}))


def drawn(seed):
    """A random scene: tetrahedra, some moved, one load step, no friction or Tresca friction; one to three materials."""
    chance = np.random.default_rng(seed)
    pick = chance.choice
    shape = tuple(int(n) for n in chance.integers(2, 4, size=3))
    size = tuple(float(s) for s in chance.uniform(0.7, 1.6, size=3))
    tagged = box("tetrahedra", shape, size=size)
    x = tagged.mesh.geometry.x
    inner = ((x > 1e-9) & (x < np.array(size) - 1e-9)).all(axis=1)
    x[inner] += 0.15 * chance.uniform(-1, 1, (inner.sum(), 3)) * np.array(size) / shape
    young = float(10 ** chance.uniform(1, 5))
    stress = young * 1e-3
    push = stress * float(chance.uniform(0.3, 2))
    loads = [
        {"boundary": "top", "z": -push, "x": stress * float(pick([0.0, 0.4])), "y": stress * float(pick([0, 0.3]))}
    ]
    if chance.random() < 0.3:
        loads[0]["z"] = f"where(x[0] < {size[0] / shape[0]}, {-2 * push}, {-0.2 * push})"
    if chance.random() < 0.3:
        loads.append({"boundary": "right", "pressure": f"{push} * x[2]"})
    deep = 2e-3 * float(chance.uniform(0, 1))
    gap = pick(
        [
            "0.0",
            "0.0",
            f"{deep} * ((x[0] - {size[0] / 2})**2 + x[1]**2)",
            f"{deep} * x[0]",
            f"{deep} * abs(x[1] - {size[1] / 2})",
            f"{deep} * (1 - (x[0] - 0.3)**2)",
        ]
    )
    friction = {"law": "none"}
    if chance.random() < 0.65:
        bound = pick(
            [
                f"{stress * chance.uniform(0.02, 1)}",
                f"{stress} * abs(x[0])",
                f"where(x[1] < {size[1] / shape[1]}, {stress}, 0)",
            ]
        )
        friction = {"law": "tresca", "bound": str(bound)}
    supports = [
        [{"boundary": "left", "x": 0.0, "y": 0.0, "z": 0.0}],
        [{"boundary": "left", "normal": 0.0}, {"boundary": "front", "normal": 0.0}],
        [{"boundary": "left", "x": 1e-4, "y": -1e-4, "z": 1e-4}],
        [{"boundary": "left", "x": 0.0}, {"boundary": "back", "y": 0.0}, {"boundary": "right", "z": 0.0}],
    ]
    support = supports[int(chance.integers(len(supports)))]
    materials = [{"young": young, "poisson": float(pick([0.0, 0.3, 0.45, 0.49, -0.2]))}]
    if chance.random() < 0.4:
        cells = np.arange(tagged.mesh.topology.index_map(3).size_local, dtype=np.int32)
        middle = dmesh.compute_midpoints(tagged.mesh, 3, cells)
        kinds = chance.integers(3, size=len(cells)) if chance.random() < 0.5 else (middle[:, 2] > size[2] / 2) * 1
        regions = {f"part {k}": int(k) + 1 for k in np.unique(kinds)}
        marked = dmesh.meshtags(tagged.mesh, 3, cells, (kinds + 1).astype(np.int32))
        tagged = replace(tagged, cell_tags=marked, regions=regions)
        materials = [
            {
                "region": name,
                "young": young * float(10 ** chance.uniform(-1, 1)),
                "poisson": float(pick([0.0, 0.3, 0.49])),
            }
            for name in regions
        ]
    scene = {
        "mesh": tagged,
        "element": {"degree": int(pick([1, 1, 1, 2]))},
        "material": materials,
        "displacement": [dict(one) for one in support],
        "traction": loads,
        "contact": {"boundary": "bottom", "gap": str(gap), "friction": friction},
        "solver": {"algorithm": str(pick(["auto", "alm", "alm"]))},
    }
    if chance.random() < 0.3:
        scene["body_force"] = {"z": -stress, "x": stress / 3}
    return parse_scene(scene)


def effectivity(scene, times=1):
    """Guaranteed bound over the true error, this relative to the solution, and both bounds; or why there is none."""
    try:
        solution, reference = alone(scene), on_finer_mesh(scene, times)
    except SignoriniError as failed:
        return str(failed).splitlines()[0]
    bound = solution.error_bound
    if isinstance(bound, str):
        return bound
    true = energy_of_difference(solution, reference)
    return bound.error / true, true / bound.size, bound, reference.error_bound
