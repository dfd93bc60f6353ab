"""From a scene and its mesh to assembled operators: exactly the forms that the scene lists, each assembled once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx import forms, parallel
from signorini_fx.boundary import ContactBoundary, join
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.expressions import Expression, sample
from signorini_fx.material import lame_parameters
from signorini_fx.mesh import TaggedMesh
from signorini_fx.results import Inventory, Timings
from signorini_fx.rigid import RigidMotions, rigid_motions
from signorini_fx.scene import BodyForce, PrescribedDisplacement, Scene, SurfaceTraction

# Above this Poisson's ratio the fully integrated elements lock visibly.
LOCKING_POISSON = 0.45


@dataclass(frozen=True)
class LoadCase:
    """The loads and prescribed displacements that share one list of load factors.

    Attributes:
        factors: one number a load step.
        form: the compiled terms of L, None if the case only prescribes displacements.
        load: L minus what its prescribed displacements contribute; E times their value in their rows.
        start: zero, with its prescribed displacements put in.
        resultant: what ``load`` does on the three rigid motions, forces, shape (3,).
    """

    factors: tuple[float, ...]
    form: fem.Form | None
    load: PETSc.Vec
    start: PETSc.Vec
    resultant: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))


def load_resultant(cases: tuple[LoadCase, ...], step: int) -> npt.NDArray[np.float64]:
    """What the loads of a load step do on the three rigid motions, shape (3,)."""
    return sum((case.factors[step] * case.resultant for case in cases), np.zeros(3))


@dataclass(frozen=True)
class Discretisation:
    """The assembled elastic body and its contact boundary.

    Attributes:
        scene: where it comes from.
        tagged: the mesh.
        space: vector Lagrange space Y_h of the displacement.
        forms: the compiled terms of a(., .).
        stiffness: a(., .) on Y_h, prescribed rows and columns eliminated, E on their diagonal; symmetric.
        cases: the loads, by their load factors.
        fixed: which dofs of this rank are prescribed, shape (owned dofs,).
        boundary: the contact nodes, None for a scene without contact.
        motions: rigid motions that the supports leave free.
        lame: Lame parameters as coefficients of the forms.
        reduced: quadrature degree of the volumetric term where it is reduced, else None.
        inventory: what was compiled and assembled.
    """

    scene: Scene
    tagged: TaggedMesh
    space: fem.FunctionSpace
    forms: tuple[fem.Form, ...]
    stiffness: PETSc.Mat
    cases: tuple[LoadCase, ...]
    fixed: npt.NDArray[np.bool_]
    boundary: ContactBoundary | None
    motions: RigidMotions
    lame: tuple[Any, Any]
    reduced: int | None
    inventory: Inventory

    @property
    def dofs(self) -> int:
        """Global number of displacement unknowns."""
        index_map = self.space.dofmap.index_map
        return int(index_map.size_global * self.space.dofmap.index_map_bs)

    def function(self, x: PETSc.Vec, name: str = "displacement") -> fem.Function:
        """The finite element function with the dofs ``x``."""
        function = fem.Function(self.space, name=name)
        function.x.array[: x.getLocalSize()] = x.getArray(readonly=True)
        function.x.scatter_forward()
        return function

    def internal_forces(self, displacement: fem.Function) -> PETSc.Vec:
        """a(y, .) assembled anew, cell by cell, prescribed dofs included; a force per dof, collective."""
        index_map = self.space.dofmap.index_map
        return _action(self.forms, displacement, np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32))

    def external_forces(self, step: int) -> PETSc.Vec:
        """L of a load step assembled anew, a force per dof, collective."""
        total = self.stiffness.createVecRight()
        total.set(0.0)
        for case in self.cases:
            if case.form is not None:
                total.axpy(case.factors[step], _assemble(case.form))
        return total


def discretise(scene: Scene, tagged: TaggedMesh, timings: Timings) -> Discretisation:
    """Compile and assemble what the scene lists.

    Raises:
        SceneError: with every mistake that only the mesh reveals: boundaries and regions that are not there or empty,
            contact and prescribed displacement in conflict, expressions that are not finite.
    """
    mesh = tagged.mesh
    facets = _boundary_facets(scene, tagged)
    inventory = Inventory()
    with timings.phase("compile"):
        space = fem.functionspace(mesh, ("Lagrange", scene.element.degree, (2,)))
        y, z = ufl.TrialFunction(space), ufl.TestFunction(space)
        lame = _lame(scene, tagged)
        reduced = _reduced_degree(scene, mesh)
        terms = forms.elastic_forms(y, z, *lame, reduced)
        names = ("elasticity", "reduced volumetric elasticity")
        elastic = tuple(
            inventory.compile(name, partial(fem.form, term)) for name, term in zip(names, terms, strict=False)
        )
        supports = _supports(scene, space, facets, tagged)
        groups = _load_groups(scene)
        load_forms = [_load_form(loads, space, z, facets, inventory) for loads in groups.values()]
        contact_forms = [
            inventory.compile(f"contact {e.boundary}", partial(_unit_contact_form, space, z, facets[e.boundary]))
            for e in scene.contact
        ]
    with timings.phase("assemble"):
        every = [support for _, support in supports]
        stiffness = fem_petsc.assemble_matrix(elastic[0], every, scene.young)
        for form in elastic[1:]:
            stiffness.assemble()
            fem_petsc.assemble_matrix(stiffness, form, every, scene.young)  # type: ignore[arg-type]
        stiffness.assemble()
        stiffness.setOption(PETSc.Mat.Option.SPD, True)
        inventory.matrices.append("stiffness")
        fixed = _fixed(space, every)
        cases = tuple(
            _load_case(factors, loads, load_form, elastic, stiffness, supports, space, scene)
            for (factors, loads), load_form in zip(groups.items(), load_forms, strict=True)
        )
        parts = [
            _contact_part(space, contact_form, facets[effect.boundary], index, fixed, effect.direction)
            for index, (effect, contact_form) in enumerate(zip(scene.contact, contact_forms, strict=True))
        ]
    boundary = join(parts) if parts else None
    _check_finite(cases)
    owned = space.dofmap.index_map.size_local
    x = space.tabulate_dof_coordinates()[:owned, :2]
    motions = rigid_motions(mesh.comm, x, fixed.reshape(-1, 2), tagged.size)
    cases = tuple(replace(case, resultant=_resultant(case.load, motions, x, fixed)) for case in cases)
    if boundary is not None:
        _check_overlap(scene, boundary, facets, tagged)
    return Discretisation(
        scene, tagged, space, elastic, stiffness, cases, fixed, boundary, motions, lame, reduced, inventory
    )


def _boundary_facets(scene: Scene, tagged: TaggedMesh) -> dict[str, npt.NDArray[np.int32]]:
    """Facets of every boundary that the scene names; all missing and empty ones are reported together."""
    facets: dict[str, npt.NDArray[np.int32]] = {}
    problems: list[tuple[str, str]] = []
    for key in ("displacement", "traction", "contact"):
        for index, effect in enumerate(getattr(scene, key)):
            path = f"{key}[{index}].boundary"
            try:
                found = tagged.facets(effect.boundary)
            except MeshError as error:
                problems.append((path, str(error)))
                continue
            facets[effect.boundary] = found
            if parallel.global_sum(tagged.mesh.comm, np.array(found.size)) == 0:
                problems.append((path, f"boundary {effect.boundary!r} has no exterior facets"))
    for index, material in enumerate(scene.material):
        if material.region is not None and material.region not in tagged.regions:
            known = ", ".join(sorted(tagged.regions)) or "none"
            path = f"material[{index}].region"
            problems.append((path, f"the mesh has no region {material.region!r}; its regions are: {known}"))
    if problems:
        raise SceneError(problems)
    return facets


def _lame(scene: Scene, tagged: TaggedMesh) -> tuple[Any, Any]:
    """Lame parameters: constants for one material, cell-wise functions for several."""
    mesh = tagged.mesh
    if len(scene.material) == 1:
        first, second = lame_parameters(scene.material[0])
        return fem.Constant(mesh, default_scalar_type(first)), fem.Constant(mesh, default_scalar_type(second))
    space = fem.functionspace(mesh, ("DG", 0))
    pair = fem.Function(space), fem.Function(space)
    covered = np.zeros(pair[0].x.array.size, dtype=bool)
    for material in scene.material:
        assert material.region is not None
        dofs = space.dofmap.list[tagged.cells(material.region), 0]
        covered[dofs] = True
        for function, value in zip(pair, lame_parameters(material), strict=True):
            function.x.array[dofs] = value
    bare = int(np.count_nonzero(~covered[: space.dofmap.index_map.size_local]))
    total = int(parallel.global_sum(mesh.comm, np.array(bare)))
    if total:
        raise SceneError([("material", f"{total} cells are in none of the regions that have a material")])
    for function in pair:
        function.x.scatter_forward()
    return pair


def _reduced_degree(scene: Scene, mesh: dmesh.Mesh) -> int | None:
    """Quadrature degree of the volumetric term where it is reduced: Q1/P0, P2/P0 and Q2 with 2 x 2 points."""
    degree, kind = scene.element.degree, mesh.topology.cell_name()
    has_form = not (degree == 1 and kind == "triangle")
    wanted = scene.element.volumetric
    if wanted == "reduced" and not has_form:
        message = "linear triangles have no reduced form: use degree = 2, or quadrilaterals"
        raise SceneError([("element.volumetric", message)])
    nearly = any(m.poisson >= LOCKING_POISSON and m.hypothesis == "plane strain" for m in scene.material)
    if wanted == "full" or not has_form or (wanted == "auto" and not nearly):
        return None
    return 3 if degree == 2 and kind == "quadrilateral" else 1


def _entities(mesh: dmesh.Mesh, facets: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """(cell, facet of the cell) of exterior facets, shape (facets, 2)."""
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    mesh.topology.create_connectivity(dim, dim - 1)
    facet_cells = mesh.topology.connectivity(dim - 1, dim)
    cell_facets = mesh.topology.connectivity(dim, dim - 1)
    if facets.size == 0:  # a rank may have no cells at all
        return np.empty((0, 2), dtype=np.int32)
    cells = facet_cells.array[facet_cells.offsets[facets]]
    per_cell = cell_facets.array.reshape(cell_facets.num_nodes, -1)
    return np.column_stack((cells, np.argmax(per_cell[cells] == facets[:, None], axis=1))).astype(np.int32)


def _measure(mesh: dmesh.Mesh, parts: Sequence[npt.NDArray[np.int32]], metadata: dict[str, Any]) -> Any:
    """Integration over lists of facets, which may overlap, numbered from 1.

    The numbers do not depend on the mesh's own tags, so that forms on different boundaries are compiled once.
    """
    data = [(number, _entities(mesh, facets).ravel()) for number, facets in enumerate(parts, start=1)]
    return ufl.Measure("ds", domain=mesh, subdomain_data=data, metadata=metadata)


def _assemble(form: fem.Form) -> PETSc.Vec:
    vector = fem_petsc.assemble_vector(form)
    vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
    return vector


def _action(elastic: tuple[fem.Form, ...], function: fem.Function, blocks: npt.NDArray[np.int32]) -> PETSc.Vec:
    """a(function, .) where only the nodes ``blocks`` count: the lifting of a displacement prescribed there.

    dolfinx lifts prescribed values by assembling the same form cell by cell, so that no further form is compiled.
    """
    result = fem.Function(function.function_space)
    vector = result.x.petsc_vec
    for form in elastic:
        fem_petsc.apply_lifting(vector, [form], bcs=[[fem.dirichletbc(function, blocks)]])
    vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
    vector.scale(-1.0)
    return vector.copy()


def _ufl_value(value: Any, space: fem.FunctionSpace) -> Any:
    """A scene value as a UFL coefficient; a callable is interpolated at the nodes."""
    mesh = space.mesh
    if isinstance(value, float):
        return fem.Constant(mesh, default_scalar_type(value))
    if isinstance(value, Expression):
        return value.ufl(mesh)
    if hasattr(value, "ufl_domain"):
        return value
    function = fem.Function(fem.functionspace(mesh, ("Lagrange", space.element.basix_element.degree)))
    function.interpolate(lambda x: sample(value, x))
    return function


def _is_zero(*values: Any) -> bool:
    return all(isinstance(value, float) and value == 0.0 for value in values)


_Load = BodyForce | SurfaceTraction | PrescribedDisplacement


def _load_groups(scene: Scene) -> dict[tuple[float, ...], list[_Load]]:
    """The loads of the scene by their load factors; zero loads are no loads."""
    groups: dict[tuple[float, ...], list[_Load]] = {}
    for load in scene.loads:
        values = [load.x, load.y]
        if isinstance(load, SurfaceTraction):
            values.append(load.pressure)
        if isinstance(load, PrescribedDisplacement) or not _is_zero(*values):
            groups.setdefault(load.factors or (1.0,) * scene.steps, []).append(load)
    return groups


def _load_form(
    loads: list[_Load],
    space: fem.FunctionSpace,
    z: Any,
    facets: dict[str, npt.NDArray[np.int32]],
    inventory: Inventory,
) -> fem.Form | None:
    """The terms of L that the loads list, compiled together."""
    mesh = space.mesh
    degree = 2 * space.element.basix_element.degree + 2
    bodies = [load for load in loads if isinstance(load, BodyForce)]
    tractions = [load for load in loads if isinstance(load, SurfaceTraction)]
    if not bodies and not tractions:
        return None
    terms = []
    for body in bodies:
        force = ufl.as_vector([_ufl_value(v, space) for v in (body.x, body.y)])
        terms.append(forms.body_force_form(force, z, degree))
    ds = _measure(mesh, [facets[load.boundary] for load in tractions], {"quadrature_degree": degree})
    for number, load in enumerate(tractions, start=1):
        traction = ufl.as_vector([_ufl_value(v, space) for v in (load.x, load.y)])
        if not _is_zero(load.pressure):
            traction -= _ufl_value(load.pressure, space) * ufl.FacetNormal(mesh)
        terms.append(forms.traction_form(traction, z, ds(number)))
    names = ["body force"] * len(bodies) + [f"traction {load.boundary}" for load in tractions]
    return inventory.compile(" + ".join(names), lambda: fem.form(sum(terms[1:], terms[0])))


def _supports(
    scene: Scene, space: fem.FunctionSpace, facets: dict[str, npt.NDArray[np.int32]], tagged: TaggedMesh
) -> list[tuple[PrescribedDisplacement, fem.DirichletBC]]:
    """Dirichlet conditions, one a component; a later one wins where two meet."""
    dim = space.mesh.topology.dim - 1
    supports = []
    for index, effect in enumerate(scene.displacement):
        for component, value in _components(effect, index, tagged):
            subspace = space.sub(component)
            if isinstance(value, float):
                dofs = fem.locate_dofs_topological(subspace, dim, facets[effect.boundary])
                support = fem.dirichletbc(default_scalar_type(value), dofs, subspace)
            else:
                collapsed, _ = subspace.collapse()
                pair = fem.locate_dofs_topological((subspace, collapsed), dim, facets[effect.boundary])
                function = fem.Function(collapsed)
                function.interpolate(lambda x, value=value: sample(value, x))
                support = fem.dirichletbc(function, pair, subspace)
            supports.append((effect, support))
    return supports


def _components(effect: PrescribedDisplacement, index: int, tagged: TaggedMesh) -> list[tuple[int, Any]]:
    """(component, value) of what a displacement effect prescribes."""
    if effect.normal is None:
        return [(k, value) for k, value in enumerate((effect.x, effect.y)) if value is not None]
    axis, sign = _axis(effect, index, tagged)
    value = effect.normal
    return [(axis, sign * value if isinstance(value, float) else lambda x: sign * sample(value, x))]


def _axis(effect: PrescribedDisplacement, index: int, tagged: TaggedMesh) -> tuple[int, float]:
    """Axis and sign of the outward normal of a boundary that is straight along an axis."""
    mesh = tagged.mesh
    facets = tagged.facets(effect.boundary)
    dim = mesh.topology.dim
    corners = dmesh.entities_to_geometry(mesh, dim - 1, facets).ravel()
    low, high = parallel.global_bounds(mesh.comm, mesh.geometry.x[corners][:, :2].astype(np.float64))
    inside = dmesh.compute_midpoints(mesh, dim, _entities(mesh, facets)[:, 0])
    outward = parallel.global_sum(mesh.comm, (dmesh.compute_midpoints(mesh, dim - 1, facets) - inside).sum(axis=0))
    flat = np.flatnonzero(high - low <= 1e-9 * tagged.size)
    if flat.size != 1:
        message = f"boundary {effect.boundary!r} is not straight along an axis: use bilateral contact without friction"
        raise SceneError([(f"displacement[{index}].normal", message)])
    return int(flat[0]), float(np.sign(outward[flat[0]]))


def _fixed(space: fem.FunctionSpace, supports: list[fem.DirichletBC]) -> npt.NDArray[np.bool_]:
    fixed = np.zeros(space.dofmap.index_map.size_local * space.dofmap.index_map_bs, dtype=bool)
    for support in supports:
        dofs, owned = support.dof_indices()
        fixed[dofs[:owned]] = True
    return fixed


def _load_case(
    factors: tuple[float, ...],
    loads: list[_Load],
    load_form: fem.Form | None,
    elastic: tuple[fem.Form, ...],
    stiffness: PETSc.Mat,
    supports: list[tuple[PrescribedDisplacement, fem.DirichletBC]],
    space: fem.FunctionSpace,
    scene: Scene,
) -> LoadCase:
    """Assemble the right-hand side of the loads that share their factors."""
    load, start = stiffness.createVecRight(), stiffness.createVecRight()
    start.set(0.0)
    load.set(0.0)
    if load_form is not None:
        load.axpy(1.0, _assemble(load_form))
    prescribed = fem.Function(space)
    touched: list[npt.NDArray[np.int32]] = []
    for effect, support in supports:
        dofs, _ = support.dof_indices()
        prescribed.x.array[dofs] = 0.0
        if any(effect is one for one in loads):
            fem_petsc.set_bc(prescribed.x.petsc_vec, [support])
            prescribed.x.scatter_forward()
        touched.append(dofs)
    if supports and parallel.global_max(space.mesh.comm, parallel.local_max(np.abs(prescribed.x.array))) != 0.0:
        blocks = np.unique(np.concatenate(touched) // 2).astype(np.int32)
        load.axpy(-1.0, _action(elastic, prescribed, blocks))
        start.getArray()[:] = prescribed.x.array[: start.getLocalSize()]
    if supports:
        fixed = _fixed(space, [support for _, support in supports])
        load.getArray()[fixed] = scene.young * start.getArray()[fixed]
    return LoadCase(factors, load_form, load, start)


def _resultant(
    load: PETSc.Vec, motions: RigidMotions, x: npt.NDArray[np.float64], fixed: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float64]:
    """What a load does on the rigid motions; only needed, and only taken, where one of them is free."""
    if motions.free.shape[1] == 0:
        return np.zeros(3)
    forces = np.where(fixed, 0.0, load.getArray(readonly=True)).reshape(-1, 2)
    return parallel.global_sum(load.comm.tompi4py(), np.einsum("ij,ijk->k", forces, motions.at(x)))


def _unit_contact_form(space: fem.FunctionSpace, z: Any, facets: npt.NDArray[np.int32]) -> fem.Form:
    """(lambda, tau_N z) for lambda = 1, with the nodal rule: the nodal weights times the normals."""
    ds = _measure(space.mesh, [facets], forms.nodal_rule(space.element.basix_element.degree))(1)
    one = fem.Constant(space.mesh, default_scalar_type(1.0))
    return fem.form(forms.contact_form(one, z, ufl.FacetNormal(space.mesh), ds))


def _contact_part(
    space: fem.FunctionSpace,
    form: fem.Form,
    facets: npt.NDArray[np.int32],
    index: int,
    fixed: npt.NDArray[np.bool_],
    direction: tuple[float, float] | None,
) -> ContactBoundary:
    """Nodes, weights and normals of one contact boundary from the assembled unit contact form."""
    moments = _assemble(form).getArray().reshape(-1, 2)
    weight = np.linalg.norm(moments, axis=1)
    nodes = np.flatnonzero(weight > 0).astype(np.int32)
    normal = moments[nodes] / weight[nodes, None]
    if direction is not None:
        normal = np.tile(np.asarray(direction) / np.hypot(*direction), (nodes.size, 1))
    return ContactBoundary(
        comm=space.mesh.comm,
        nodes=nodes,
        x=space.tabulate_dof_coordinates()[nodes, :2],
        weight=weight[nodes],
        normal=normal,
        part=np.full(nodes.size, index, dtype=np.int32),
        free=~fixed.reshape(-1, 2)[nodes],
        segments=_segments(space, facets, index),
        global_nodes=space.dofmap.index_map.local_to_global(nodes),
    )


def _segments(space: fem.FunctionSpace, facets: npt.NDArray[np.int32], part: int) -> npt.NDArray[np.int64]:
    """The part and the global node numbers of each facet, in order along it, shape (facets, degree + 2)."""
    degree = space.element.basix_element.degree
    layout = space.dofmap.dof_layout
    rows = []
    for cell, local in _entities(space.mesh, facets):
        # Vertices come first, then what is inside the facet.
        closure = layout.entity_closure_dofs(space.mesh.topology.dim - 1, int(local))
        first, last, *middle = space.dofmap.cell_dofs(cell)[closure]
        rows.append([first, *middle, last])
    local_nodes = np.array(rows, dtype=np.int32).reshape(-1, degree + 1)
    nodes = space.dofmap.index_map.local_to_global(local_nodes.ravel()).reshape(local_nodes.shape)
    return np.column_stack((np.full(len(rows), part, dtype=np.int64), nodes))


def _check_finite(cases: tuple[LoadCase, ...]) -> None:
    problems = []
    if not all(np.isfinite(case.start.norm()) for case in cases):
        problems.append(("displacement", "an expression is not finite somewhere on its boundary"))
    elif not all(np.isfinite(case.load.norm()) for case in cases):
        problems.append(
            ("traction, body_force", "an expression is not finite somewhere on its boundary or in the body")
        )
    if problems:
        raise SceneError(problems)


def _check_overlap(
    scene: Scene, boundary: ContactBoundary, facets: dict[str, npt.NDArray[np.int32]], tagged: TaggedMesh
) -> None:
    """A prescribed normal displacement on contact facets leaves nothing for contact to decide."""
    problems = []
    for index, support in enumerate(scene.displacement):
        prescribed = np.zeros(2, dtype=bool)
        prescribed[[component for component, _ in _components(support, index, tagged)]] = True
        for part, effect in enumerate(scene.contact):
            shared = np.intersect1d(facets[support.boundary], facets[effect.boundary]).size
            total = int(parallel.global_sum(boundary.comm, np.array(shared)))
            slope = np.abs(boundary.normal[boundary.part == part][:, prescribed]).max(initial=0.0)
            if total and parallel.global_max(boundary.comm, slope) > 1e-8:
                problems.append(
                    (
                        f"displacement[{index}]",
                        f"boundary {support.boundary!r} prescribes the normal displacement on {total} facets of the "
                        f"contact boundary {effect.boundary!r}: take them out of one of the two",
                    )
                )
    if problems:
        raise SceneError(problems)
