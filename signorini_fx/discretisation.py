"""From a scene and its mesh to assembled operators: exactly the forms that the scene lists, each assembled once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx import compat, forms, parallel
from signorini_fx.boundary import ContactBoundary, contact_part, join, unit_contact_form
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.loads import LoadCase, check_finite, compile_load, load_case, load_groups, rigid_resultant
from signorini_fx.material import lame_parameters
from signorini_fx.mesh import TaggedMesh
from signorini_fx.results import Inventory, Timings
from signorini_fx.rigid import RigidMotions, rigid_motions
from signorini_fx.scene import Scene
from signorini_fx.supports import check_overlap, dirichlet_conditions, fixed_dofs

# Above this Poisson's ratio the fully integrated elements lock visibly.
LOCKING_POISSON = 0.45


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


def discretise(scene: Scene, tagged: TaggedMesh, timings: Timings) -> Discretisation:
    """Compile and assemble what the scene lists.

    Raises:
        SceneError: with every mistake that only the mesh reveals: boundaries and regions that are not there or empty,
            contact and prescribed displacement in conflict, expressions that are not finite.
    """
    mesh = tagged.mesh
    facets = boundary_facets(scene, tagged)
    inventory = Inventory()
    with timings.phase("compile"):
        space = fem.functionspace(mesh, ("Lagrange", scene.element.degree, (2,)))
        y, z = ufl.TrialFunction(space), ufl.TestFunction(space)
        lame = lame_coefficients(scene, tagged)
        reduced = reduced_degree(scene, mesh)
        exact = forms.elastic_degree(mesh.topology.cell_name(), scene.element.degree, compat.geometry_degree(mesh))
        terms = forms.elastic_forms(y, z, *lame, exact, reduced)
        names = ("elasticity", "reduced volumetric elasticity")
        elastic = tuple(
            inventory.compile(name, partial(fem.form, term)) for name, term in zip(names, terms, strict=False)
        )
        supports = dirichlet_conditions(scene, space, facets, tagged)
        groups = load_groups(scene)
        load_forms = [compile_load(loads, space, z, facets, inventory) for loads in groups.values()]
        contact_forms = [
            inventory.compile(f"contact {e.boundary}", partial(unit_contact_form, space, z, facets[e.boundary]))
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
        fixed = fixed_dofs(space, every)
        cases = tuple(
            load_case(factors, loads, load_form, elastic, stiffness, supports, space, scene)
            for (factors, loads), load_form in zip(groups.items(), load_forms, strict=True)
        )
        parts = [
            contact_part(space, contact_form, facets[effect.boundary], index, fixed, effect.direction)
            for index, (effect, contact_form) in enumerate(zip(scene.contact, contact_forms, strict=True))
        ]
    boundary = join(parts) if parts else None
    check_finite(cases)
    owned = space.dofmap.index_map.size_local
    x = space.tabulate_dof_coordinates()[:owned, :2]
    motions = rigid_motions(mesh.comm, x, fixed.reshape(-1, 2), tagged.size)
    cases = tuple(replace(case, resultant=rigid_resultant(case.load, motions, x, fixed)) for case in cases)
    if boundary is not None:
        check_overlap(scene, boundary, facets, tagged)
    return Discretisation(
        scene, tagged, space, elastic, stiffness, cases, fixed, boundary, motions, lame, reduced, inventory
    )


def boundary_facets(scene: Scene, tagged: TaggedMesh) -> dict[str, npt.NDArray[np.int32]]:
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
    for index, effect in enumerate(scene.contact):
        for other in scene.contact[:index]:
            if effect.boundary in facets and other.boundary in facets:
                shared = np.intersect1d(facets[effect.boundary], facets[other.boundary]).size
                total = parallel.global_sum(tagged.mesh.comm, np.array(shared))
                if total:
                    message = f"boundary {effect.boundary!r} shares {total} facets with the contact boundary "
                    message += f"{other.boundary!r}: a facet can touch one foundation only"
                    problems.append((f"contact[{index}].boundary", message))
    for index, material in enumerate(scene.material):
        if material.region is not None and material.region not in tagged.regions:
            known = ", ".join(sorted(tagged.regions)) or "none"
            path = f"material[{index}].region"
            problems.append((path, f"the mesh has no region {material.region!r}; its regions are: {known}"))
    if problems:
        raise SceneError(problems)
    return facets


def lame_coefficients(scene: Scene, tagged: TaggedMesh) -> tuple[Any, Any]:
    """Lame parameters: constants for one material, cell-wise functions for several."""
    mesh = tagged.mesh
    if len(scene.material) == 1:
        first, second = lame_parameters(scene.material[0])
        return fem.Constant(mesh, default_scalar_type(first)), fem.Constant(mesh, default_scalar_type(second))
    space = fem.functionspace(mesh, ("DG", 0))
    pair = fem.Function(space), fem.Function(space)
    covered = np.zeros(pair[0].x.array.size, dtype=np.int32)
    for material in scene.material:
        assert material.region is not None
        dofs = space.dofmap.list[tagged.cells(material.region), 0]
        covered[dofs] += 1
        for function, value in zip(pair, lame_parameters(material), strict=True):
            function.x.array[dofs] = value
    owned = covered[: space.dofmap.index_map.size_local]
    counts = parallel.global_sum(mesh.comm, np.array([np.sum(owned == 0), np.sum(owned > 1)]))
    bare, twice = (int(count) for count in counts)
    if bare:
        raise SceneError([("material", f"{bare} cells are in none of the regions that have a material")])
    if twice:
        raise SceneError([("material", f"{twice} cells are in several of the regions that have a material")])
    for function in pair:
        function.x.scatter_forward()
    return pair


def reduced_degree(scene: Scene, mesh: dmesh.Mesh) -> int | None:
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
