"""From a scene and its mesh to assembled operators: exactly the forms that the scene lists, each assembled once."""

from __future__ import annotations

from dataclasses import dataclass
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
from signorini_fx.results import Timings
from signorini_fx.rigid import RigidMotions, rigid_motions
from signorini_fx.scene import PrescribedDisplacement, Scene, UnilateralContact


@dataclass(frozen=True)
class Discretisation:
    """The assembled elastic body and its contact boundary.

    Attributes:
        scene: where it comes from.
        tagged: the mesh.
        space: vector Lagrange space Y_h of the displacement.
        stiffness: a(., .) on Y_h, prescribed rows and columns eliminated, E on their diagonal; symmetric.
        load: L minus what the prescribed displacements contribute; E times their value in their rows.
        start: zero, with the prescribed displacements put in.
        fixed: which dofs of this rank are prescribed, shape (owned dofs,).
        boundary: the contact nodes, None for a scene without contact.
        motions: rigid motions that the supports leave free.
        lame: Lame parameters as constants of the forms.
        load_terms: the UFL terms of L, None without loads.
    """

    scene: Scene
    tagged: TaggedMesh
    space: fem.FunctionSpace
    stiffness: PETSc.Mat
    load: PETSc.Vec
    start: PETSc.Vec
    fixed: npt.NDArray[np.bool_]
    boundary: ContactBoundary | None
    motions: RigidMotions
    lame: tuple[fem.Constant, fem.Constant]
    load_terms: Any | None

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


def discretise(scene: Scene, tagged: TaggedMesh, timings: Timings) -> Discretisation:
    """Compile and assemble what the scene lists.

    Raises:
        SceneError: with every mistake that only the mesh reveals: boundaries that are not there or empty, contact and
            prescribed displacement in conflict, expressions that are not finite.
    """
    mesh = tagged.mesh
    facets = _boundary_facets(scene, tagged)
    with timings.phase("compile"):
        space = fem.functionspace(mesh, ("Lagrange", scene.element.degree, (2,)))
        y, z = ufl.TrialFunction(space), ufl.TestFunction(space)
        first, second = lame_parameters(scene.material)
        lame = fem.Constant(mesh, default_scalar_type(first)), fem.Constant(mesh, default_scalar_type(second))
        stiffness_form = fem.form(forms.elastic_form(y, z, *lame))
        terms = _load_terms(scene, space, z, facets)
        load_form = fem.form(terms) if terms is not None else None
        supports = _supports(scene, space, facets)
        contact_forms = [_unit_contact_form(space, z, facets[e.boundary], scene.element.degree) for e in scene.contact]
    with timings.phase("assemble"):
        young = scene.material.young
        stiffness = fem_petsc.assemble_matrix(stiffness_form, supports, young)
        stiffness.assemble()
        stiffness.setOption(PETSc.Mat.Option.SPD, True)
        load, start = stiffness.createVecRight(), stiffness.createVecRight()
        if load_form is not None:
            assembled = fem_petsc.assemble_vector(load_form)
            assembled.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
            load.axpy(1.0, assembled)
        fixed = _fixed(space, supports)
        if scene.displacement:
            lifting = fem.Function(space)
            fem_petsc.apply_lifting(lifting.x.petsc_vec, [stiffness_form], bcs=[supports])
            lifting.x.petsc_vec.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
            load.axpy(1.0, lifting.x.petsc_vec)
            fem_petsc.set_bc(load, supports, alpha=young)
            fem_petsc.set_bc(start, supports)
        parts = [
            _contact_part(space, form, facets[effect.boundary], index, fixed, scene.element.degree)
            for index, (effect, form) in enumerate(zip(scene.contact, contact_forms, strict=True))
        ]
    boundary = join(parts) if parts else None
    _check_finite(scene, load, start, mesh.comm)
    if boundary is not None:
        _check_overlap(scene, boundary, facets)
    owned = space.dofmap.index_map.size_local
    x = space.tabulate_dof_coordinates()[:owned, :2]
    motions = rigid_motions(mesh.comm, x, fixed.reshape(-1, 2), tagged.size)
    return Discretisation(scene, tagged, space, stiffness, load, start, fixed, boundary, motions, lame, terms)


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
    if problems:
        raise SceneError(problems)
    return facets


def _entities(mesh: dmesh.Mesh, facets: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """(cell, facet of the cell) of exterior facets, shape (facets, 2)."""
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    mesh.topology.create_connectivity(dim, dim - 1)
    facet_cells = mesh.topology.connectivity(dim - 1, dim)
    cell_facets = mesh.topology.connectivity(dim, dim - 1)
    cells = facet_cells.array[facet_cells.offsets[facets]]
    per_cell = cell_facets.array.reshape(cell_facets.num_nodes, -1)
    return np.column_stack((cells, np.argmax(per_cell[cells] == facets[:, None], axis=1))).astype(np.int32)


def _measure(mesh: dmesh.Mesh, parts: list[npt.NDArray[np.int32]], metadata: dict[str, Any]) -> Any:
    """Integration over lists of facets, which may overlap, numbered from 1.

    The numbers do not depend on the mesh's own tags, so that forms on different boundaries are compiled once.
    """
    data = [(number, _entities(mesh, facets).ravel()) for number, facets in enumerate(parts, start=1)]
    return ufl.Measure("ds", domain=mesh, subdomain_data=data, metadata=metadata)


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


def _load_terms(scene: Scene, space: fem.FunctionSpace, z: Any, facets: dict[str, npt.NDArray[np.int32]]) -> Any | None:
    """The terms of L that the scene lists; zero loads are no loads."""
    degree = 2 * scene.element.degree + 2
    terms = []
    if scene.body_force is not None and not _is_zero(scene.body_force.x, scene.body_force.y):
        force = ufl.as_vector([_ufl_value(v, space) for v in (scene.body_force.x, scene.body_force.y)])
        terms.append(forms.body_force_form(force, z, degree))
    tractions = [effect for effect in scene.traction if not _is_zero(effect.x, effect.y)]
    ds = _measure(space.mesh, [facets[effect.boundary] for effect in tractions], {"quadrature_degree": degree})
    for number, effect in enumerate(tractions, start=1):
        traction = ufl.as_vector([_ufl_value(v, space) for v in (effect.x, effect.y)])
        terms.append(forms.traction_form(traction, z, ds(number)))
    return sum(terms[1:], terms[0]) if terms else None


def _supports(
    scene: Scene, space: fem.FunctionSpace, facets: dict[str, npt.NDArray[np.int32]]
) -> list[fem.DirichletBC]:
    """Dirichlet conditions, one a component; a later one wins where two meet."""
    dim = space.mesh.topology.dim - 1
    supports = []
    for effect in scene.displacement:
        for component, value in enumerate((effect.x, effect.y)):
            if value is None:
                continue
            subspace = space.sub(component)
            if isinstance(value, float):
                dofs = fem.locate_dofs_topological(subspace, dim, facets[effect.boundary])
                supports.append(fem.dirichletbc(default_scalar_type(value), dofs, subspace))
            else:
                collapsed, _ = subspace.collapse()
                pair = fem.locate_dofs_topological((subspace, collapsed), dim, facets[effect.boundary])
                function = fem.Function(collapsed)
                function.interpolate(lambda x, value=value: sample(value, x))
                supports.append(fem.dirichletbc(function, pair, subspace))
    return supports


def _fixed(space: fem.FunctionSpace, supports: list[fem.DirichletBC]) -> npt.NDArray[np.bool_]:
    fixed = np.zeros(space.dofmap.index_map.size_local * space.dofmap.index_map_bs, dtype=bool)
    for support in supports:
        dofs, owned = support.dof_indices()
        fixed[dofs[:owned]] = True
    return fixed


def _unit_contact_form(space: fem.FunctionSpace, z: Any, facets: npt.NDArray[np.int32], degree: int) -> fem.Form:
    """(lambda, tau_N z) for lambda = 1, with the nodal rule: the nodal weights times the normals."""
    ds = _measure(space.mesh, [facets], forms.nodal_rule(degree))(1)
    one = fem.Constant(space.mesh, default_scalar_type(1.0))
    return fem.form(forms.contact_form(one, z, ufl.FacetNormal(space.mesh), ds))


def _contact_part(
    space: fem.FunctionSpace,
    form: fem.Form,
    facets: npt.NDArray[np.int32],
    index: int,
    fixed: npt.NDArray[np.bool_],
    degree: int,
) -> ContactBoundary:
    """Nodes, weights and normals of one contact boundary from the assembled unit contact form."""
    assembled = fem_petsc.assemble_vector(form)
    assembled.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
    moments = assembled.getArray().reshape(-1, 2)
    weight = np.linalg.norm(moments, axis=1)
    nodes = np.flatnonzero(weight > 0).astype(np.int32)
    index_map = space.dofmap.index_map
    return ContactBoundary(
        comm=space.mesh.comm,
        nodes=nodes,
        x=space.tabulate_dof_coordinates()[nodes, :2],
        weight=weight[nodes],
        normal=moments[nodes] / weight[nodes, None],
        part=np.full(nodes.size, index, dtype=np.int32),
        free=~fixed.reshape(-1, 2)[nodes],
        segments=_segments(space, facets, index, degree),
        global_nodes=index_map.local_to_global(nodes),
    )


def _segments(space: fem.FunctionSpace, facets: npt.NDArray[np.int32], part: int, degree: int) -> npt.NDArray[np.int64]:
    """The part and the global node numbers of each facet, in order along it, shape (facets, degree + 2)."""
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


def _check_finite(scene: Scene, load: PETSc.Vec, start: PETSc.Vec, comm: Any) -> None:
    problems = []
    if not np.isfinite(load.norm()):
        problems.append(
            ("traction, body_force", "an expression is not finite somewhere on its boundary or in the body")
        )
    if not np.isfinite(start.norm()):
        problems.append(("displacement", "an expression is not finite somewhere on its boundary"))
    if problems:
        raise SceneError(problems)


def _check_overlap(scene: Scene, boundary: ContactBoundary, facets: dict[str, npt.NDArray[np.int32]]) -> None:
    """A prescribed normal displacement on contact facets leaves nothing for contact to decide."""
    problems = []
    for index, support in enumerate(scene.displacement):
        for part, effect in enumerate(scene.contact):
            problem = _overlap(support, effect, part, boundary, facets)
            if problem is not None:
                problems.append((f"displacement[{index}]", problem))
    if problems:
        raise SceneError(problems)


def _overlap(
    support: PrescribedDisplacement,
    effect: UnilateralContact,
    part: int,
    boundary: ContactBoundary,
    facets: dict[str, npt.NDArray[np.int32]],
) -> str | None:
    shared = np.intersect1d(facets[support.boundary], facets[effect.boundary]).size
    total = int(parallel.global_sum(boundary.comm, np.array(shared)))
    prescribed = [value is not None for value in (support.x, support.y)]
    slope = np.abs(boundary.normal[boundary.part == part][:, prescribed]).max(initial=0.0)
    if total == 0 or parallel.global_max(boundary.comm, slope) < 1e-8:
        return None
    return (
        f"boundary {support.boundary!r} prescribes the normal displacement on {total} facets of the contact boundary "
        f"{effect.boundary!r}: take them out of one of the two"
    )
