"""From a scene and its mesh to assembled operators: exactly the forms that the scene lists, each assembled once."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx import compat, parallel
from signorini_fx.body.averages import averaging, averaging_forms
from signorini_fx.body.contact_boundary import ContactBoundary, contact_part, join, unit_contact_form
from signorini_fx.body.loads import (
    AppliedLoad,
    ResistanceForm,
    applied_load,
    check_finite,
    compile_resistance,
    load_case,
    load_groups,
    turned_case,
)
from signorini_fx.body.pieces import find_pieces
from signorini_fx.body.rigid import RigidMotions, rigid_motions, unresisted
from signorini_fx.body.supports import check_overlap, dirichlet_conditions, fixed_dofs, skew_supports, turned_nodes
from signorini_fx.body.turned_supports import TurnedNodes
from signorini_fx.effects.displacement import PrescribedDisplacement
from signorini_fx.effects.material import elastic_degree, elastic_forms
from signorini_fx.errors import MeshError, SceneError, together
from signorini_fx.linalg.choice import SystemSize
from signorini_fx.linalg.elasticity import LoadCase
from signorini_fx.machine.petsc_objects import free_unused
from signorini_fx.mesh.tagged import TaggedMesh, check_fits
from signorini_fx.records import Inventory, Timings
from signorini_fx.scales import Scales
from signorini_fx.scene.load_steps import factor_at
from signorini_fx.scene.model import Scene
from signorini_fx.tuned import LARGEST_MULTIGRID_POISSON


@dataclass(frozen=True)
class Body:
    """A scene on its mesh before any stiffness is assembled: all data of the body.

    Attributes:
        scene: the scene.
        tagged: the mesh.
        space: vector Lagrange space Y_h of the displacement.
        lame: Lame parameters as coefficients of the forms.
        reduced: quadrature degree of the volumetric term where it is reduced, else None.
        supports: the prescribed displacements, one component each.
        fixed: which dofs of this rank are prescribed, shape (owned dofs,).
        applied: the loads, by their load factors.
        boundary: the contact nodes; None for a scene without contact.
        motions: motions without strain that the supports leave free.
        inventory: what was compiled and assembled; the elastic forms are named and compiled later.
        resistance: what resists the displacement on the boundary.
        turned: nodes with supports along no axis, for which ``fixed`` is told in their own frames; None: none.
    """

    scene: Scene
    tagged: TaggedMesh
    space: fem.FunctionSpace
    lame: tuple[Any, Any]
    reduced: int | None
    supports: list[tuple[PrescribedDisplacement, fem.DirichletBC]]
    fixed: npt.NDArray[np.bool_]
    applied: tuple[AppliedLoad, ...]
    boundary: ContactBoundary | None
    motions: RigidMotions
    inventory: Inventory
    resistance: ResistanceForm
    turned: TurnedNodes | None

    @property
    def comm(self) -> MPI.Comm:
        """The ranks that share the body."""
        comm: MPI.Comm = self.tagged.mesh.comm
        return comm

    @property
    def scales(self) -> Scales:
        """What its lengths and stresses are compared with."""
        return Scales(self.tagged.dimension, self.scene.young, self.tagged.size)

    @property
    def dofs(self) -> int:
        """Global number of displacement unknowns."""
        index_map = self.space.dofmap.index_map
        return int(index_map.size_global * self.space.dofmap.index_map_bs)

    def factors(self, place: float) -> npt.NDArray[np.float64]:
        """The factors of the applied loads at a place in the lists of factors, see ``scene.load_steps``."""
        return np.array([factor_at(load.factors, place) for load in self.applied])

    @property
    def system_size(self) -> SystemSize:
        """The figures that decide which kind of elastic system it gets; collective."""
        dim, boundary = self.tagged.dimension, self.boundary
        retained, held = 0, False
        if boundary is not None:
            retained = dim * int(parallel.global_sum(self.comm, np.array(np.unique(boundary.reached).size)))
            everywhere = boundary.points.everywhere
            held = self.motions.at(boundary).held_by(everywhere, everywhere)
        compressible = max(material.poisson for material in self.scene.material) <= LARGEST_MULTIGRID_POISSON
        return SystemSize(self.comm, self.dofs, dim, retained, held, compressible)


@dataclass(frozen=True)
class Discretisation(Body):
    """The assembled elastic body and its contact boundary.

    Attributes:
        forms: the compiled terms of a(., .).
        stiffness: a(., .) on Y_h, symmetric; prescribed rows and columns are eliminated and have its
            largest entry on their diagonal.
        cases: the right-hand sides of the applied loads, in their order.
        rotation: Q from the unknowns of ``stiffness`` and ``cases`` to displacements; None: they are the same.
    """

    forms: tuple[fem.Form, ...]
    stiffness: PETSc.Mat
    cases: tuple[LoadCase, ...]
    rotation: PETSc.Mat | None

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """The dofs along the axes of space."""
        if self.rotation is None:
            return x
        result = x.duplicate()
        self.rotation.mult(x, result)
        return result

    def function(self, x: PETSc.Vec, name: str = "displacement") -> fem.Function:
        """The finite element function with the unknowns ``x``."""
        x = self.displacement(x)
        function = fem.Function(self.space, name=name)
        function.x.array[: x.getLocalSize()] = x.getArray(readonly=True)
        function.x.scatter_forward()
        return function

    def unknowns(self, function: fem.Function) -> PETSc.Vec:
        """The unknowns x of a finite element function, the inverse of ``function``."""
        x = self.stiffness.createVecRight()
        x.getArray()[:] = function.x.array[: x.getLocalSize()]
        if self.rotation is None:
            return x
        result = x.duplicate()
        self.rotation.multTranspose(x, result)
        return result


def discretise(scene: Scene, tagged: TaggedMesh, timings: Timings) -> Discretisation:
    """Compile and assemble the effects that the scene lists.

    Raises:
        SceneError: see ``prepare``.
        MeshError: see ``prepare``.
    """
    free_unused(tagged.mesh)
    return assemble_body(prepare(scene, tagged, timings), timings)


def prepare(scene: Scene, tagged: TaggedMesh, timings: Timings) -> Body:
    """Compile and assemble loads and contact boundaries, and find all errors; collective.

    Raises:
        SceneError: with all errors that only the mesh reveals: boundaries and regions that do not exist or are empty,
            contact and prescribed displacement in conflict, expressions that are not finite.
        MeshError: the cells of the mesh are not connected.
    """
    facets, lame, reduced, _ = together(
        partial(boundary_facets, scene, tagged),
        partial(lame_coefficients, scene, tagged),
        partial(reduced_degree, scene, tagged.mesh),
        partial(check_fits, scene, tagged),
    )
    pieces = find_pieces(tagged.mesh)
    space = fem.functionspace(tagged.mesh, ("Lagrange", scene.element.degree, (tagged.dimension,)))
    inventory = Inventory(list(_ELASTIC[: 1 if reduced is None else 2]))
    z = ufl.TestFunction(space)
    with timings.phase("compile"):
        supports = dirichlet_conditions(scene, space, facets, tagged)
        fixed = fixed_dofs(space, [support for _, support in supports])
        skew = skew_supports(scene, space, facets, tagged)
        turned = turned_nodes(scene, space, supports, skew, fixed)
        resistance = compile_resistance(scene, space, z, facets.__getitem__, inventory)
        applied = [
            applied_load(factors, loads, space, z, facets.__getitem__, supports, inventory, turned)
            for factors, loads in load_groups(scene).items()
        ]
        contact_forms = [
            averaging_forms(space, facets[e.boundary], inventory, f"contact {e.boundary}")
            if averaging(scene, tagged)
            else inventory.compile(f"contact {e.boundary}", partial(unit_contact_form, space, z, facets[e.boundary]))
            for e in scene.contact
        ]
    with timings.phase("assemble"):
        parts = [
            contact_part(space, contact_form, facets[effect.boundary], index, fixed, effect.direction, turned)
            for index, (effect, contact_form) in enumerate(zip(scene.contact, contact_forms, strict=True))
        ]
        boundary = join(parts) if parts else None
        motions = rigid_motions(space, fixed.reshape(-1, tagged.dimension), pieces, turned)
        if resistance.form is not None:
            motions = unresisted(motions, resistance.form)
    together(
        partial(check_finite, tagged.mesh.comm, applied),
        lambda: None if boundary is None else check_overlap(scene, boundary, facets, tagged),
    )
    return Body(
        scene,
        tagged,
        space,
        lame,
        reduced,
        supports,
        fixed,
        tuple(applied),
        boundary,
        motions,
        inventory,
        resistance,
        turned,
    )


_ELASTIC = ("elasticity", "reduced volumetric elasticity")


def assemble_body(body: Body, timings: Timings) -> Discretisation:
    """Compile and assemble the stiffness of a body, and the right-hand sides that need it; collective."""
    scene, space = body.scene, body.space
    with timings.phase("compile"):
        y, z = ufl.TrialFunction(space), ufl.TestFunction(space)
        mesh = space.mesh
        degree = elastic_degree(mesh.topology.cell_name(), scene.element.degree, compat.geometry_degree(mesh))
        terms = elastic_forms(y, z, *body.lame, degree, body.reduced)
        elastic = tuple(
            body.inventory.compile(name, partial(fem.form, term)) for name, term in zip(_ELASTIC, terms, strict=False)
        )
        if body.resistance.form is not None:
            elastic = (*elastic, body.resistance.form)
    with timings.phase("assemble"):
        every = [support for _, support in body.supports] if body.turned is None else []
        stiffness = fem_petsc.assemble_matrix(elastic[0], every, 0.0)
        for form in elastic[1:]:
            stiffness.assemble()
            fem_petsc.assemble_matrix(stiffness, form, every, 0.0)  # type: ignore[arg-type]
        stiffness.assemble()
        body.inventory.matrices.append("stiffness")
        rotation = None
        if body.turned is None:
            diagonal = _fill_prescribed(stiffness, body)
            cases = tuple(
                load_case(load, elastic, stiffness, body.supports, body.fixed, diagonal, body.motions)
                for load in body.applied
            )
        else:
            whole, rotation = stiffness, body.turned.matrix(stiffness)
            stiffness = whole.ptap(rotation)
            stiffness.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
            first = stiffness.getOwnershipRange()[0]
            stiffness.zeroRowsColumns((first + np.flatnonzero(body.fixed)).astype(PETSc.IntType), diag=0.0)
            diagonal = _fill_prescribed(stiffness, body)
            cases = tuple(
                turned_case(load, whole, rotation, body.fixed, diagonal, body.motions, body.turned)
                for load in body.applied
            )
        stiffness.setOption(PETSc.Mat.Option.SPD, True)
    known = {field.name: getattr(body, field.name) for field in fields(body)}
    return Discretisation(**known, forms=elastic, stiffness=stiffness, cases=cases, rotation=rotation)


def _fill_prescribed(stiffness: PETSc.Mat, body: Body) -> float:
    """Put a stiffness on the diagonal of the prescribed rows, which are empty so far, and return it; collective.

    It is the largest one of the body, so that it is neither small nor large beside the others in any unit.
    """
    diagonal = stiffness.getDiagonal()
    values = diagonal.getArray()
    largest = parallel.global_max(body.comm, parallel.local_max(values)) or body.scales.stiffness(body.scales.size)
    values[body.fixed] = largest
    stiffness.setDiagonal(diagonal)
    return largest


def boundary_facets(scene: Scene, tagged: TaggedMesh) -> dict[str, npt.NDArray[np.int32]]:
    """Facets of every boundary that the scene names; all missing and empty ones are reported together."""
    facets: dict[str, npt.NDArray[np.int32]] = {}
    problems: list[tuple[str, str]] = []
    for path, effect in scene.listed():
        if effect.where is None:
            continue
        path += ".boundary"
        try:
            found = tagged.facets(effect.where)
        except MeshError as error:
            problems.append((path, str(error)))
            continue
        facets[effect.where] = found
        if parallel.global_sum(tagged.mesh.comm, np.array(found.size)) == 0:
            problems.append((path, f"boundary {effect.where!r} has no exterior facets"))
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
        first, second = scene.material[0].lame
        return fem.Constant(mesh, default_scalar_type(first)), fem.Constant(mesh, default_scalar_type(second))
    space = fem.functionspace(mesh, ("DG", 0))
    pair = fem.Function(space), fem.Function(space)
    covered = np.zeros(pair[0].x.array.size, dtype=np.int32)
    named = [material for material in scene.material if material.region in tagged.regions]
    if len(named) < len(scene.material):  # which is reported elsewhere
        return pair
    for material in named:
        assert material.region is not None
        dofs = space.dofmap.list[tagged.cells(material.region), 0]
        covered[dofs] += 1
        for function, value in zip(pair, material.lame, strict=True):
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
    """Quadrature degree of the volumetric term where it is reduced: Q1/P0, P2/P0, Q2 with two points per axis."""
    degree, kind = scene.element.degree, mesh.topology.cell_name()
    has_form = not (degree == 1 and kind in ("triangle", "tetrahedron"))
    requested = scene.element.volumetric
    if requested == "reduced" and not has_form:
        plane = kind == "triangle"
        cure = "use degree = 2, or quadrilaterals" if plane else "use hexahedra"
        message = f"linear {'triangles' if plane else 'tetrahedra'} have no reduced form: {cure}"
        raise SceneError([("element.volumetric", message)])
    nearly = any(material.locks for material in scene.material)
    if requested == "full" or not has_form or (requested == "auto" and not nearly):
        return None
    return 3 if degree == 2 and kind in ("quadrilateral", "hexahedron") else 1
