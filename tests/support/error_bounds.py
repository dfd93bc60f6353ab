"""True errors of displacements in the plane, against solutions on meshes four times finer."""

from dataclasses import replace

import numpy as np
import ufl
from dolfinx import fem, geometry
from dolfinx import mesh as dmesh
from matplotlib.tri import Triangulation
from mpi4py import MPI
from scenes import alone

from signorini_fx.addons.bounds.error_bound import Bounded, error_bound
from signorini_fx.errors import SignoriniError
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene


def problem(solution):
    """The solution as plain arrays on triangles."""
    return Bounded(solution.model, solution.displacement, solution.contact, solution._position, solution._before)


def energy_of_difference(solution, reference):
    """Energy norm of the difference of two displacements on nested meshes, the second one finer."""
    coarse, fine = problem(solution), problem(reference)
    t = fine.t
    strains = fine.strained(fine.y, fine.middle)
    # Three points inside, exact for linear strains.
    local = (np.ones((3, 3)) + 3 * np.eye(3)) / 6
    x = np.einsum("qc,ncd->nqd", local, t.x[t.corners])
    grid = Triangulation(*coarse.t.x.T, coarse.t.corners)
    where = grid.get_trifinder()(x[..., 0], x[..., 1])
    assert (where >= 0).all()
    c = coarse.t
    first = c.x[c.corners[where, 0]]
    inverse = np.linalg.inv(c.jacobian)[where]
    rest = np.einsum("nqij,nqj->nqi", inverse, x - first)
    barycentric = np.concatenate((1 - rest.sum(axis=2, keepdims=True), rest), axis=2)
    own = np.einsum("nqc,nqck->nqk", barycentric, coarse.strained(coarse.y, coarse.middle)[where])
    difference = np.einsum("qc,nck->nqk", local, strains) - own
    product = (t.stress(difference) * difference * [1, 1, 2]).sum(axis=2)
    return float(np.sqrt((t.volume[:, None] / 3 * product).sum()))


def on_finer_mesh(scene):
    """The scene on triangles that are four times finer, of degree 2, without regularisation."""
    tagged = load_mesh(scene, MPI.COMM_SELF)
    for _ in range(2):
        tagged = refine(tagged)
    element = scene.element.model_copy(update={"degree": 2})
    error = None
    for algorithm in ("alm",) if any(contact.tool for contact in scene.contact) else ("exact", "alm"):
        solver = scene.solver.model_copy(update={"algorithm": algorithm})
        finer = scene.model_copy(update={"mesh": tagged, "element": element, "solver": solver})
        try:
            return alone(finer)
        except SignoriniError as failed:
            error = failed
    raise error


def drawn(seed):
    """A random scene: triangles, one load step, frictionless contact or Tresca friction."""
    chance = np.random.default_rng(seed)
    nx, ny = int(chance.integers(3, 9)), int(chance.integers(2, 5))
    length, height = float(chance.uniform(1, 3)), float(chance.uniform(0.5, 1.5))
    pick = chance.choice
    young = float(10 ** chance.uniform(1, 5))
    size = young * 1e-3
    loads = [
        {"boundary": "top", "y": -size * float(chance.uniform(0.2, 2)), "x": size * float(pick([0.0, 0.0, 0.5, -0.3]))}
    ]
    if chance.random() < 0.3:
        middle = length / nx * int(nx // 2) if chance.random() < 0.7 else 0.47 * length
        loads[0] = {"boundary": "top", "y": f"where(x[0] < {middle}, {-2 * size}, {-0.1 * size})"}
    if chance.random() < 0.2:
        loads.append({"boundary": "right", "x": size * float(chance.normal())})
    deep = 2e-3 * float(chance.uniform(0, 1))
    gap = pick(
        [
            "0.0",
            f"{deep}*(x[0] - {length / 2})**2",
            f"{deep}*abs(x[0] - {length / 3})",
            f"{deep}*x[0]",
            f"{deep}*(1 - cos(4*x[0]))",
            f"{deep} - {deep}*(x[0] - {length / 2})**2",
        ]
    )
    friction = {"law": "none"}
    if chance.random() < 0.6:
        bound = pick(
            [f"{size * chance.uniform(0.01, 1)}", f"{size}*abs(x[0])", f"where(x[0] < {length / 2}, {size}, 0)"]
        )
        friction = {"law": "tresca", "bound": str(bound)}
    side = str(pick(["left", "right"]))
    support = pick([{"x": 0.0, "y": 0.0}, {"x": 0.0}, {"normal": 0.0}, {"x": 1e-4, "y": -1e-4}])
    scene = {
        "mesh": {
            "generator": "rectangle",
            "parameters": {"length": length, "height": height, "nx": nx, "ny": ny, "cell": "triangle"},
        },
        "element": {"degree": int(pick([1, 1, 2]))},
        "material": {"young": young, "poisson": float(pick([0.0, 0.3, 0.3, 0.45, 0.49, -0.2]))},
        "displacement": {"boundary": side, **support},
        "traction": loads,
        "contact": {"boundary": "bottom", "gap": str(gap), "friction": friction},
    }
    if chance.random() < 0.4:
        scene["body_force"] = {"y": -size / height} if chance.random() < 0.6 else {"y": f"{-size}*x[0]", "x": size / 3}
    if chance.random() < 0.5:
        scene["solver"] = {"algorithm": str(pick(["exact", "alm", "ssn"]))}
    return parse_scene(scene)


def pressed(seed):
    """A random block whose top is moved down and aside onto its foundation, with loads: its forces are not those of
    statics."""
    chance, scene = np.random.default_rng([seed, 2]), drawn(seed)
    size = float(np.abs(scene.material[0].young)) * 1e-3
    down, aside = 4e-3 * float(chance.uniform(0.5, 1.5)), 1e-3 * float(chance.normal())
    held = scene.displacement[0].model_copy(update={"boundary": "top", "normal": None, "x": aside, "y": -down})
    side = scene.traction[0].model_copy(update={"boundary": "right", "x": size * float(chance.normal()), "y": 0.0})
    return scene.model_copy(update={"displacement": (held,), "traction": (side,)})


def of_several_materials(scene, seed):
    """The scene with two or three materials: in layers, beside each other, or any one in each cell; in half of the
    scenes one of them has nu = 0.49."""
    chance = np.random.default_rng([seed, 1])
    tagged = load_mesh(scene, MPI.COMM_SELF)
    cells = np.arange(tagged.mesh.topology.index_map(2).size_local, dtype=np.int32)
    x = dmesh.compute_midpoints(tagged.mesh, 2, cells)
    corners = tagged.mesh.geometry.x
    count, kind = int(chance.integers(2, 4)), int(chance.integers(3))
    if kind == 2:
        tags = chance.integers(count, size=len(cells))
    else:
        low, high = corners[:, kind].min(), corners[:, kind].max()
        tags = np.minimum(((x[:, kind] - low) / (high - low) * count).astype(int), count - 1)
    used = np.unique(tags)
    regions = {f"part {k}": int(k) + 1 for k in used}
    marked = dmesh.meshtags(tagged.mesh, 2, cells, (tags + 1).astype(np.int32))
    first = scene.material[0]
    poissons = [
        0.49 if k == used[0] and chance.random() < 0.5 else float(chance.choice([0.0, 0.3, 0.45])) for k in used
    ]
    material = tuple(
        first.model_copy(
            update={"region": name, "poisson": nu, "young": first.young * float(10 ** chance.uniform(-1.0, 1.0))}
        )
        for name, nu in zip(regions, poissons, strict=True)
    )
    return scene.model_copy(update={"mesh": replace(tagged, cell_tags=marked, regions=regions), "material": material})


def effectivity(scene):
    """Guaranteed bound over the true error, and both relative to the solution; or why there is none."""
    try:
        solution = alone(scene)
        reference = on_finer_mesh(scene)
    except SignoriniError as failed:
        return str(failed).splitlines()[0]
    bound = error_bound(solution.model, solution.displacement, solution.contact)
    if isinstance(bound, str):
        return bound
    true = energy_of_difference(solution, reference)
    return bound.error / true, bound.error / bound.size, true / bound.size, bound


def on_quadrilaterals(seed):
    """A random scene on parallelograms of degree 2 that lean, and the same on cells four times finer."""
    scene, lean = drawn(seed), float(np.random.default_rng([seed, 5]).choice([0.0, 0.3, -0.4]))
    scenes = []
    for times in (1, 4):
        parameters = scene.mesh.parameters | {"cell": "quadrilateral"}
        parameters |= {key: times * parameters[key] for key in ("nx", "ny")}
        mesh = scene.mesh.model_copy(update={"parameters": parameters})
        tagged = load_mesh(scene.model_copy(update={"mesh": mesh}), MPI.COMM_SELF)
        tagged.mesh.geometry.x[:, 0] += lean * tagged.mesh.geometry.x[:, 1]
        element = scene.element.model_copy(update={"degree": 2})
        solver = scene.solver.model_copy(update={"algorithm": "alm"})
        scenes.append(scene.model_copy(update={"mesh": tagged, "element": element, "solver": solver}))
    return scenes


def energy_between(solution, reference):
    """Energy norm of the difference of two displacements of degree 2, the second one on divided cells of the first."""
    space = reference.model.space
    difference, mesh = fem.Function(space), solution.model.tagged.mesh
    x, dofs = space.tabulate_dof_coordinates(), space.dofmap.list
    # The cell of the same body that the middle of a divided cell is in.
    middles, tree = x[dofs].mean(axis=1), geometry.bb_tree(mesh, mesh.topology.dim)
    around = geometry.compute_colliding_cells(mesh, geometry.compute_collisions_points(tree, middles), middles)
    cells = np.zeros(len(x), dtype=np.int32)
    cells[dofs] = np.array([around.links(k)[0] for k in range(len(dofs))])[:, None]
    own = solution.displacement.eval(x, cells)
    difference.x.array[:] = reference.displacement.x.array - own.ravel()
    lame, mu = reference.model.elastic.lame
    strain = ufl.sym(ufl.grad(difference))
    product = 2 * mu * ufl.inner(strain, strain) + lame * ufl.tr(strain) ** 2
    return float(np.sqrt(fem.assemble_scalar(fem.form(product * ufl.dx))))


def effectivity_on_quadrilaterals(seed):
    """Guaranteed bound over the true error, both relative to the solution, and the bound; or why there is none."""
    try:
        solution, reference = map(alone, on_quadrilaterals(seed))
    except SignoriniError as failed:
        return str(failed).splitlines()[0]
    bound = error_bound(solution.model, solution.displacement, solution.contact)
    if isinstance(bound, str):
        return bound
    true = energy_between(solution, reference)
    return bound.error / true, bound.error / bound.size, true / bound.size, bound
