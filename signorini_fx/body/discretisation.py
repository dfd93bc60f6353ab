"""From a scene and its mesh to assembled operators: exactly the forms that the scene lists, each assembled once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from signorini_fx import parallel
from signorini_fx.body.cellwise_stiffness import cellwise_stiffness
from signorini_fx.body.elastic_laws import elastic_law
from signorini_fx.body.foundations import Foundations, NodalFriction
from signorini_fx.body.initial_strains import check_strains
from signorini_fx.body.jumps import holds, jump_loads, jumps_in
from signorini_fx.body.loads import (
    AppliedLoad,
    FormCoefficients,
    applied_load,
    check_finite,
    check_resistances,
    compile_resistance,
    driving_load,
    group_of,
    load_groups,
)
from signorini_fx.body.moduli import check_covers, lame_coefficients, reduced_degree
from signorini_fx.body.named_body import NamedBody
from signorini_fx.body.pieces import find_pieces
from signorini_fx.body.rigid_bodies import RigidBodies
from signorini_fx.body.scene_contact import foundations_of
from signorini_fx.body.shared_values import shared_in
from signorini_fx.body.supports import Conditions, Supports, at_rest, check_overlap
from signorini_fx.contact.friction import PointFriction
from signorini_fx.contact.laws import RegularisedData
from signorini_fx.errors import FormError, MeshError, SceneError, together
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.elasticity import LoadCase
from signorini_fx.machine.petsc_objects import free_unused
from signorini_fx.materials.trial import check_materials
from signorini_fx.mesh.tagged import TaggedMesh, check_fits
from signorini_fx.method import Settings
from signorini_fx.records import Inventory, Timings
from signorini_fx.scales import Scales
from signorini_fx.scene.effect import Load
from signorini_fx.scene.model import Scene
from signorini_fx.tuned import LARGEST_MULTIGRID_POISSON

if TYPE_CHECKING:
    from signorini_fx.body.paired_points import PairedSides


@dataclass(frozen=True, kw_only=True)
class Discretisation(NamedBody):
    """A scene on its mesh: the elastic body that its effects make, and all data of it.

    Attributes:
        supports: the prescribed displacements, one component each; ``bcs`` with their effects.
        applied: the loads, by their load factors.
        data: the regularised problem at the contact points, without shifts; None for a scene without contact.
        resisting: name of the form ``resists``; empty without.
        coefficients: of the forms of loads and resistances.
    """

    supports: Conditions
    applied: tuple[AppliedLoad, ...]
    data: RegularisedData | None
    resisting: str
    coefficients: FormCoefficients

    @property
    def scales(self) -> Scales:
        """What its lengths and stresses are compared with."""
        scene, tagged = self.scene, self.tagged
        return Scales(tagged.dimension, scene.young, tagged.size, self.kinematics.depth(tagged.size))

    def factors(self, step: float) -> npt.NDArray[np.float64]:
        """The factors of the applied loads at a place in the lists of factors, see ``scene.load_steps``."""
        return np.array([load.factor(step) for load in self.applied])

    def applied_at(self, step: float) -> list[tuple[float, AppliedLoad]]:
        """The applied loads at a place with their factors; collective."""
        return [(load.factor(step), load.at(step)) for load in self.applied]

    @shared_in("of_body")
    def cases(self) -> tuple[LoadCase, ...]:
        """The right-hand sides of the applied loads, in their order; those of the first load step; collective."""
        return tuple(map(self._case, self.applied))

    def _case(self, load: AppliedLoad) -> LoadCase:
        return self.case(load.forces, load.prescribed, load.driven, load.pushing, load.swelling)

    def placed(self, step: float) -> Discretisation:
        """The same with foundations and friction of a place where they depend on the time; itself if none does;
        collective.
        """
        scene = self.scene.placed(step)
        if scene is self.scene or self.boundary is None:
            return self
        if not any(effect.moves for effect in scene.contact):
            return replace(self, scene=scene, law=self.law_of(scene))
        aligned = scene.solver.algorithm == "exact"  # whose unknowns are along the normals
        of_body = {} if aligned else self.of_body
        return replace(self, scene=scene, of_body=of_body, **self.contact_of(scene))

    def contact_of(self, scene: Scene) -> dict[str, Any]:
        """``boundary``, ``data`` and ``law`` of another scene that differs in its contact only; collective."""
        foundations = _foundations(scene, self.space, boundary_facets(scene, self.tagged), Inventory())
        shapes = foundations.shapes()
        rests = at_rest(self.space, self.supports, self.turned, self.fixed)
        boundary = foundations.boundary(shapes, self.fixed, self.turned, rests)
        data, law = foundations.problem(boundary, foundations.data(shapes), Settings.of(scene.solver), self.scales)
        return {"boundary": boundary, "data": data, "law": law}

    def law_of(self, scene: Scene) -> PointFriction | None:
        """``law`` of another scene that differs in its friction only; collective."""
        assert self.boundary is not None
        foundations = _foundations(scene, self.space, boundary_facets(scene, self.tagged), Inventory())
        return foundations.law(self.boundary, self.scales.modulus)

    def friction(self) -> list[NodalFriction]:
        """That of each contact at the nodes; collective."""
        return _foundations(self.scene, self.space, boundary_facets(self.scene, self.tagged), Inventory()).friction()

    def with_gap_and_friction(self, scene: Scene) -> Discretisation:
        """The same contact points with gap and friction of another scene that differs in nothing else, and has no
        friction with axes; collective.
        """
        assert self.boundary is not None
        foundations = _foundations(scene, self.space, boundary_facets(scene, self.tagged), Inventory())
        values = foundations.data(foundations.shapes())
        scales = Scales(self.tagged.dimension, scene.young, self.tagged.size)
        data, law = foundations.problem(self.boundary, values, Settings.of(scene.solver), scales)
        return replace(self, scene=scene, data=data, law=law)

    def moved_since(self, earlier: Scene) -> npt.NDArray[np.float64]:
        """How far the foundations have moved at the contact points from where they are in another scene, length, shape
        (n, d).
        """
        assert self.boundary is not None
        moved, dimension = np.zeros_like(self.boundary.x), self.tagged.dimension
        for number, (contact, earlier_contact) in enumerate(zip(self.scene.contact, earlier.contact, strict=True)):
            if contact.moves:
                on_part = self.boundary.part == number
                x = self.boundary.x[on_part, :dimension]
                moved[on_part, :dimension] = contact.foundation.moved_from(earlier_contact.foundation, x)
        return moved

    def alone(self, scene: Scene, load: Load) -> AppliedLoad:
        """A load of another scene on the same mesh, one that prescribes no displacement; collective."""
        on = replace(self.coefficients, scene=scene.placed(0), inventory=Inventory())
        return applied_load(group_of(scene, load), [load], on, ufl.TestFunction(self.space), _no_supports)

    def load(self, system: ElasticSystem, step: float) -> npt.NDArray[np.float64]:
        """Give a system the loads that depend on the time as they are at a place; collective.

        Returns:
            The factors of all loads, for ``system.set_load``.
        """
        for number, load in enumerate(self.applied):
            if load.again is not None:
                system.set_case(number, self._case(load.at(step)))
        return self.factors(step)


def discretise(scene: Scene, tagged: TaggedMesh, timings: Timings) -> Discretisation:
    """Compile and assemble the effects that the scene lists; collective.

    Raises:
        SceneError: see ``prepare``.
        MeshError: see ``prepare``.
    """
    free_unused(tagged.mesh)
    discretised = prepare(scene, tagged, timings)
    with timings.phase("compile"):
        assert discretised.forms
    with timings.phase("assemble"):
        assert discretised.cases is not None
    return discretised


def prepare(scene: Scene, tagged: TaggedMesh, timings: Timings) -> Discretisation:
    """Compile and assemble loads and contact boundaries, and find all errors; collective.

    Raises:
        SceneError: with all errors that only the mesh reveals: boundaries and regions that do not exist or are empty,
            contact and prescribed displacement in conflict, expressions that are not finite.
        MeshError: the cells of the mesh are not connected.
    """
    if scene.kinematics.out_of_section and tagged.dimension == tagged.mesh.geometry.dim == 2:
        from signorini_fx.mesh.section import section_in_space

        tagged = replace(tagged, mesh=section_in_space(tagged.mesh))
    try:
        return _prepared(scene.placed(0), tagged, timings)
    except FormError as error:  # of a foundation; the allowance of a pair is the gap of a scene
        raise SceneError([(path.replace("].allowance", "].gap"), wrong) for path, wrong in error.problems]) from None


def _prepared(scene: Scene, tagged: TaggedMesh, timings: Timings) -> Discretisation:
    check_materials(scene.material)
    facets, lame, stiffness, reduced, *_ = together(
        partial(boundary_facets, scene, tagged),
        partial(lame_coefficients, scene, tagged),
        partial(cellwise_stiffness, scene, tagged),
        partial(reduced_degree, scene, tagged.mesh),
        partial(check_fits, scene, tagged),
        partial(check_strains, scene, tagged),
        partial(check_covers, scene, tagged),
    )
    if scene.sides[1] is not None:
        from signorini_fx.body.carrying_side import with_chosen_sides

        scene = with_chosen_sides(scene, tagged, facets, lame[1])
    pieces = find_pieces(tagged.mesh)
    if scene.body:
        pieces = pieces.of_bodies(tagged.mesh.comm, {body.name: tagged.cells(body.name) for body in scene.body})
    space = fem.functionspace(tagged.mesh, ("Lagrange", scene.element.degree, (tagged.mesh.geometry.dim,)))
    inventory = Inventory()
    elastic = elastic_law(scene, tagged, space, inventory, pieces, (lame, stiffness, reduced))
    inventory.forms.extend(elastic.names)
    z = ufl.TestFunction(space)
    kinematics = scene.kinematics_in(tagged.dimension)
    with timings.phase("compile"):
        supports = Supports.of(scene, space, facets, tagged)
        fixed, turned = supports.fixed, supports.turned
        on_mesh = FormCoefficients(scene, tagged, space, inventory)
        resisting, resistance = compile_resistance(on_mesh, z)
        applied = [applied_load(group, loads, on_mesh, z, supports.at) for group, loads in load_groups(scene).items()]
        on = [facets[effect.boundary] for effect in scene.contact]
        foundations = _foundations(scene, space, facets, inventory)
        assert len(foundations.forms) == len(on)
    with timings.phase("assemble"):
        shapes = foundations.shapes()
        rests = at_rest(space, supports.conditions, turned, fixed) if scene.sides[1] is not None else None
        boundary = foundations.boundary(shapes, fixed, turned, rests) if on else None
        rigid = RigidBodies(scene.rigid_bodies, kinematics, tagged.size)
        if boundary is not None:
            boundary = rigid.on(boundary)
            applied += [driving_load(rigid, number, scene, space) for number in range(len(rigid.bodies))]
        if jumps := jumps_in(scene, tagged, space):
            bonded = [k for k, contact in enumerate(scene.contact) if contact.kind == "bonded"]
            held = partial(holds, fixed=fixed, turned=turned, boundary=boundary, bonded=bonded)
            applied += jump_loads(jumps, scene, space, elastic, inventory, held)
        if boundary is not None:
            applied += [load for interface in scene.interfaces for load in interface.loads(tagged, space, boundary)]
    together(
        partial(check_finite, tagged.mesh.comm, applied),
        partial(check_resistances, scene, tagged),
        lambda: None if boundary is None else check_overlap(scene, boundary, facets, tagged),
    )
    data = law = None
    if boundary is not None:
        if scene.solver.algorithm == "exact":
            boundary.aligned()
        scales = Scales(tagged.dimension, scene.young, tagged.size)
        data, law = foundations.problem(boundary, foundations.data(shapes), Settings.of(scene.solver), scales)
        for step in range(1, scene.steps if any(effect.friction.timed for effect in scene.contact) else 1):
            # Errors are found before the first step.
            _foundations(scene.placed(step), space, facets, inventory).friction()
    resists = () if resistance is None else (resistance,)

    return Discretisation(
        space=space,
        terms=lambda: (*elastic.compiled(space, inventory), *resists),
        resists=resists,
        bcs=[support for _, support in supports.conditions],
        turned=turned,
        fixed=fixed,
        pieces=pieces,
        boundary=boundary,
        settings=scene.solver,
        inventory=inventory,
        kinematics=kinematics,
        compressible=max(material.mean_poisson for material in scene.material) <= LARGEST_MULTIGRID_POISSON,
        elastic=elastic,
        scene=scene,
        tagged=tagged,
        lame=lame,
        moduli=stiffness,
        supports=supports.conditions,
        applied=tuple(applied),
        data=data,
        law=law,
        resisting=resisting,
        coefficients=on_mesh,
        pairs=foundations.pairs,
        rigid=rigid,
    )


def _no_supports(step: float) -> tuple[Conditions, None]:
    return [], None


def _foundations(
    scene: Scene, space: fem.FunctionSpace, facets: Mapping[str, npt.NDArray[np.int32]], inventory: Inventory
) -> Foundations:
    """The contact of a scene, from the facets of all boundaries."""
    on = [facets[effect.boundary] for effect in scene.contact]
    masters = {
        number: facets[effect.against] for number, effect in enumerate(scene.contact) if effect.against is not None
    }
    names = [f"contact {effect.boundary}" for effect in scene.contact]
    return Foundations(space, foundations_of(scene, on, masters), on, names, inventory, masters)


def pairs_of(scene: Scene, tagged: TaggedMesh, space: fem.FunctionSpace) -> dict[int, PairedSides]:
    """Both sides of each contact of two bodies, paired anew, by its place in ``scene.contact``."""
    facets = boundary_facets(scene, tagged)
    supports = Supports.of(scene, space, facets, tagged)
    rests = at_rest(space, supports.conditions, supports.turned, supports.fixed)
    foundations = _foundations(scene, space, facets, Inventory())
    foundations.boundary(foundations.shapes(), supports.fixed, supports.turned, rests)
    return foundations.pairs


def boundary_facets(scene: Scene, tagged: TaggedMesh) -> dict[str, npt.NDArray[np.int32]]:
    """Facets of every boundary that the scene names; all missing and empty ones are reported together."""
    facets: dict[str, npt.NDArray[np.int32]] = {}
    problems: list[tuple[str, str]] = []
    for path, effect in scene.listed():
        for key, name in (("boundary", effect.where), ("against", getattr(effect, "against", None))):
            if name is None:
                continue
            try:
                indices = tagged.facets(name)
            except MeshError as error:
                problems.append((f"{path}.{key}", str(error)))
                continue
            facets[name] = indices
            if parallel.global_sum(tagged.mesh.comm, np.array(indices.size)) == 0:
                problems.append((f"{path}.{key}", f"boundary {name!r} has no exterior facets"))
    sides = [(f"contact[{index}].boundary", effect.boundary) for index, effect in enumerate(scene.contact)]
    sides += [
        (f"contact[{index}].against", effect.against)
        for index, effect in enumerate(scene.contact)
        if effect.against is not None
    ]
    for number, (path, name) in enumerate(sides):
        for earlier_path, earlier_name in sides[:number]:
            # A body may carry several others on the same facets, if these have the contact points.
            if path.endswith("against") and earlier_path.endswith("against"):
                continue
            if name in facets and earlier_name in facets:
                shared = np.intersect1d(facets[name], facets[earlier_name]).size
                total = parallel.global_sum(tagged.mesh.comm, np.array(shared))
                if total:
                    message = f"boundary {name!r} shares {total} facets with the contact boundary {earlier_name!r}: "
                    message += "a facet can touch one foundation only"
                    if path.rpartition(".")[0] == earlier_path.rpartition(".")[0]:
                        message += "; where two bodies touch, an expression finds the facets of both: take names of the"
                        message += " mesh file, or a [[body]] for each"
                    elif scene.sides[1] is not None:
                        message += "; of a body that several others touch there, all contacts name it in 'against'"
                    problems.append((path, message))
    for path, effect in scene.listed():
        region = getattr(effect, "region", None)
        if region is not None and region not in tagged.regions:
            region_names = ", ".join(sorted(tagged.regions)) or "none"
            problems.append((f"{path}.region", f"the mesh has no region {region!r}; its regions are: {region_names}"))
    if problems:
        raise SceneError(problems)
    return facets
