"""The core with matrices of other programs: assembled by scikit-fem, and in the file format of
FCLIB.
"""

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from from_scipy import from_scipy, task_of
from numpy.testing import assert_allclose
from on_meshes import at_coordinate
from scene_tables import coulomb_friction
from scenes import alone
from spaces import box

from signorini_fx.algebra import Settings
from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.algebra.linalg.condensed import CondensedSystem
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene

YOUNG, POISSON, F, SIDE = 1000.0, 0.3, 0.3, 3
PUSH, PULL = (4e-3, 1e-3, -1e-2), (0.0, 2.0, 0.0)
SYSTEMS = {"full": ElasticSystem, "condensed": CondensedSystem}


def gap(x):
    return 0.002 * ((x[0] - 0.4) ** 2 + x[1])


def cube(**solver):
    """A cube whose top is pushed downwards and aside, with a traction on one side, on a curved
    foundation.
    """
    return parse_scene(
        {
            "mesh": box("hexahedra", (SIDE, SIDE, SIDE), size=(1.0, 1.0, 1.0)),
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": [{"boundary": "top", **dict(zip("xyz", PUSH, strict=True))}],
            "traction": [{"boundary": "right", **dict(zip("xyz", PULL, strict=True))}],
            "contact": [{"boundary": "bottom", "gap": gap, "friction": coulomb_friction(F)}],
            "solver": {"tolerance": 1e-12, **solver},
        }
    )


def solved(kind, stiffness, load, operator, weight, gaps, coefficient, **given):
    """The displacement and the state of the contact points of a problem given by matrices."""
    settings = given.pop("settings")
    elasticity, motions = from_scipy(stiffness, load, operator, weight, **given)
    law = PointFriction(np.zeros(weight.size), coefficient)
    task = task_of(SYSTEMS[kind].of(elasticity), motions, gaps, law, settings=settings)
    outcome = solve_task(task, task.start)
    assert outcome.status is Status.CONVERGED
    return outcome.displacement().getArray(readonly=True), task.contact(outcome, task.start)


def matched(x, places):
    """The number of the place of ``places`` that each point is at."""
    distance = np.linalg.norm(x[:, None] - places[None], axis=2)
    assert distance.min(axis=1).max() < 1e-12
    return distance.argmin(axis=1)


def as_in_the_scene(solution, x, nodes, displacement, pressure, shear):
    """Displacement at nodes and tractions at contact nodes, shear as vectors in 3D, are those of
    the scene.
    """
    places = solution.model.space.tabulate_dof_coordinates()
    theirs = solution.displacement.x.array.reshape(-1, 3)[matched(x, places)]
    assert_allclose(displacement, theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())
    contact = solution.contact
    order = matched(x[nodes], contact.boundary.x)
    scale = contact.pressure.max()
    assert (contact.pressure > 0).sum() > 4
    assert {"stick", "slip"} <= set(solution.table.columns["friction"])
    assert_allclose(pressure, contact.pressure[order], rtol=0, atol=1e-10 * scale)
    vectors = np.einsum("nik,nk->ni", contact.boundary.tangents, contact.shear)[order]
    assert_allclose(shear, vectors, rtol=0, atol=1e-10 * scale)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_assembled_by_scikit_fem(kind):
    skfem = pytest.importorskip("skfem")
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    ticks = np.linspace(0.0, 1.0, SIDE + 1)
    mesh = skfem.MeshHex.init_tensor(ticks, ticks, ticks)
    element = skfem.ElementVector(skfem.ElementHex1())
    basis = skfem.Basis(mesh, element)
    stiffness = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis)

    @skfem.LinearForm
    def pulled(v, w):
        return sum(PULL[k] * v[k] for k in range(3))

    @skfem.LinearForm
    def downwards(v, w):
        return v[2]

    load = pulled.assemble(basis.boundary(mesh.facets_satisfying(at_coordinate(0, 1.0))))
    bottom = basis.boundary(mesh.facets_satisfying(at_coordinate(2, 0.0)))
    dofs, x = basis.nodal_dofs, mesh.p.T
    weight = downwards.assemble(bottom)[dofs[2]]
    nodes = np.flatnonzero(weight > 0)
    rows = np.stack((dofs[2, nodes], dofs[0, nodes], dofs[1, nodes]), axis=1).ravel()
    operator = sp.csr_array(
        (np.tile([-1.0, 1.0, 1.0], nodes.size), (np.arange(rows.size), rows)),
        shape=(rows.size, load.size),
    )
    top = np.flatnonzero(np.isclose(x[:, 2], 1.0))
    prescribed = dofs[:, top].ravel(), np.repeat(PUSH, top.size)
    settings = Settings(tolerance=1e-12, gamma_n=1e7, gamma_t=1e7)
    given = {"prescribed": prescribed, "settings": settings}
    friction = np.full(nodes.size, F)
    y, state = solved(
        kind, stiffness, load, operator, weight[nodes], gap(x[nodes].T), friction, **given
    )
    solution = alone(cube(gamma_n=1e7, gamma_t=1e7, linear_algebra=kind))
    shear = np.column_stack((state.shear, np.zeros(nodes.size)))
    as_in_the_scene(solution, x, nodes, y[dofs].T, state.pressure, shear)


# --- FCLIB: the global problem M v = H r + f, u = H^T v + w, with r in Coulomb's cone -------------


def write_fclib(path, stiffness, local, load, w, coefficient):
    """A global problem in the layout that libfclib 3.1 writes, with matrices by rows."""
    with h5py.File(path, "w") as file:
        root = file.create_group("fclib_global")
        root["spacedim"] = np.array([3], dtype=np.int32)
        for name, matrix in (("M", stiffness), ("H", local)):
            csr, group = sp.csr_array(matrix), root.create_group(name)
            for key, value in (
                ("nzmax", csr.nnz),
                ("m", csr.shape[0]),
                ("n", csr.shape[1]),
                ("nz", -2),
            ):
                group[key] = np.array([value], dtype=np.int32)
            group["p"], group["i"], group["x"] = csr.indptr, csr.indices, csr.data
        vectors = root.create_group("vectors")
        vectors["f"], vectors["w"], vectors["mu"] = load, w, coefficient


def read_fclib(path):
    """M, H, f, w and mu of such a file."""
    with h5py.File(path) as file:
        root = file["fclib_global"]
        assert root["spacedim"][0] == 3
        found = []
        for name in ("M", "H"):
            group = root[name]
            assert group["nz"][0] == -2  # compressed rows
            data = group["x"][()], group["i"][()], group["p"][()]
            found.append(sp.csr_array(data, shape=(int(group["m"][0]), int(group["n"][0]))))
        return *found, *(root["vectors"][name][()] for name in ("f", "w", "mu"))


def missed(reaction, velocity, coefficient):
    """By how much u^ = u + mu |u_T| n and r miss K* and K and being perpendicular: FCLIB's
    conditions.
    """
    lifted = velocity.copy()
    lifted[:, 0] += coefficient * np.linalg.norm(velocity[:, 1:], axis=1)
    outside = np.linalg.norm(reaction[:, 1:], axis=1) - coefficient * reaction[:, 0]
    dual = coefficient * np.linalg.norm(lifted[:, 1:], axis=1) - lifted[:, 0]
    force, length = np.abs(reaction).max(), np.abs(velocity).max()
    work = np.abs(np.sum(lifted * reaction, axis=1)).max() / (force * length)
    return max(outside.max() / force, dual.max() / length, work)


@pytest.mark.one_quick("kind", SYSTEMS)
def test_in_the_form_of_fclib(kind, tmp_path):
    solution = alone(cube(algorithm="alm"))
    body, boundary = solution.model, solution.model.boundary
    # The free unknowns of the cube, from PETSc's matrix; supports are part of the load.
    indptr, indices, data = body.stiffness.getValuesCSR()
    every = sp.csr_array((data, indices, indptr))
    free = np.flatnonzero(~body.fixed)
    case = body.cases[0]
    stiffness, load = every[free][:, free], case.load.getArray()[free]
    place = np.full(every.shape[0], -1)
    place[free] = np.arange(free.size)
    columns = place[(3 * boundary.nodes[:, None] + np.arange(3))]
    assert (columns >= 0).all()
    # Forces of the foundation on the body along the inward normal and two tangents.
    inward = -boundary.normal
    axes = np.concatenate((inward[:, None], boundary.tangents.transpose(0, 2, 1)), axis=1)
    rows = np.repeat(columns[:, None], 3, axis=1).ravel()
    local = sp.csr_array(
        (axes.ravel(), (rows, np.repeat(np.arange(columns.size), 3))),
        shape=(free.size, columns.size),
    )
    w = np.zeros((boundary.size, 3))
    w[:, 0] = gap(boundary.x.T)
    write_fclib(
        tmp_path / "cube.hdf5", stiffness, local, load, w.ravel(), np.full(boundary.size, F)
    )

    m, h, f, w, mu = read_fclib(tmp_path / "cube.hdf5")
    frame = sp.diags_array(np.tile([-1.0, 1.0, 1.0], mu.size))  # towards the foundation
    settings = Settings(algorithm="alm", tolerance=1e-12)
    v, state = solved(kind, m, f, frame @ h.T, np.ones(mu.size), w[::3], mu, settings=settings)
    reaction = np.column_stack((state.pressure, -state.shear))
    velocity = (h.T @ v + w).reshape(-1, 3)
    assert np.linalg.norm(m @ v - h @ reaction.ravel() - f) < 1e-11 * np.linalg.norm(f)
    assert missed(reaction, velocity, mu) < 1e-9
    assert missed(reaction * [1.0, -1.0, -1.0], velocity, mu) > 1e-3  # friction the wrong way
    y = np.array(solution.displacement.x.array)
    y[free] = v
    x = body.space.tabulate_dof_coordinates()
    weight = boundary.weight[:, None]
    shear = np.einsum("nik,nk->ni", boundary.tangents, state.shear) / weight
    as_in_the_scene(
        solution, x, boundary.nodes, y.reshape(-1, 3), state.pressure / weight[:, 0], shear
    )
