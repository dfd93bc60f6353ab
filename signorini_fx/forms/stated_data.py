"""The data of forms as a scene states them, for guaranteed bounds, which have to know them between points.

Loads are read off the integrals of L, supports off the prescribed dofs, and the moduli off the stress, of which it is
checked that a is its energy.  What cannot be read is refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from ufl.corealg.traversal import unique_pre_traversal

from signorini_fx.forms.given_forms import Facets, GivenForms
from signorini_fx.forms.named_parts import tagged_mesh
from signorini_fx.forms.stated_values import stated
from signorini_fx.forms.stress import cellwise_moduli, exterior_facets, isotropic_moduli
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import action, facet_nodes, over_ranks
from signorini_fx.mechanics.effects.body_force import BodyForce
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.effects.traction import SurfaceTraction
from signorini_fx.mechanics.elasticity.elastic_law import IsotropicLaw
from signorini_fx.mechanics.model import Model
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.results.mechanics import StatedBody
from signorini_fx.tuned import SAME_DIRECTION, SAME_ENTRY

Nodal = npt.NDArray[np.float64]


def stated_body(forms: GivenForms, fixed: npt.NDArray[np.bool_], values: Nodal, body: Model) -> StatedBody:
    """The body of forms with its loads, supports and moduli as a scene states them; collective.

    Args:
        forms: what is assembled.
        fixed: which dofs of this rank are prescribed, ghosts included, shape (dofs,).
        values: to what, shape (dofs,).
        body: with its contact.

    Raises:
        Refused: something of the data cannot be stated, on all ranks what cannot on one.
    """
    if not forms.in_ufl:
        raise Refused("compiled forms do not say what their loads are between points of quadrature: give UFL")
    contact = [_contact(entry, stated) for entry, stated in zip(body.statement.contact, forms.contact, strict=True)]
    parts: dict[str, Facets] = {name: body.tagged.facets(name) for name in body.tagged.boundaries}
    loads = {"traction": [], "body_force": []}  # type: dict[str, list[Any]]
    for key, load in _loads(forms.original[1], body, parts):
        loads[key].append(load)
    statement = body.statement.changed(
        contact=tuple(contact),
        displacement=tuple(_supports(forms.space, (fixed, values), parts)),
        traction=tuple(loads["traction"]),
        body_force=tuple(loads["body_force"]),
    )
    tagged = tagged_mesh(body.tagged.mesh, parts)
    law = IsotropicLaw(statement, tagged, body.space, lame=_lame(forms, body))
    return StatedBody.of(replace(body, statement=statement, tagged=tagged, elastic=law, of_body={}, of_contact={}))


def _stated(value: Any, what: str) -> Any:
    try:
        return stated(value)
    except ValueError as error:
        raise Refused(f"{what} is not known between points of quadrature: {error}") from None


def _contact(entry: Any, given: Any) -> Any:
    """An entry with its values as numbers and expressions."""
    if getattr(given, "measure", None) is not None:
        raise Refused("forms that are multiplied by a measure have no guaranteed bound")
    if getattr(given, "shape", None) is not None:
        raise Refused("of forms a guaranteed bound is for gaps along given directions, not for shapes: scenes have it")
    direction = entry.direction
    if direction is not None:
        if not isinstance(direction, tuple | list | np.ndarray):
            raise Refused("a guaranteed bound is for a direction that is the same everywhere")
        direction = tuple(map(float, direction))
    law = entry.friction
    parameters = {
        key: _stated(value, f"{key} of {entry.boundary!r}")
        for key, value in law.parameters.items()
        if hasattr(value, "ufl_shape")
    }
    gap = _stated(entry.gap, f"the gap of {entry.boundary!r}")
    return entry.model_copy(
        update={
            "gap": gap,
            "direction": direction,
            "friction": law.model_copy(update=parameters) if parameters else law,
        }
    )


def _loads(L: ufl.Form, body: Model, parts: dict[str, Facets]) -> Iterator[tuple[str, BodyForce | SurfaceTraction]]:
    """The loads with their keys; the parts of the boundary that they act on are added to ``parts``."""
    dim, force = body.dimension, [ufl.as_ufl(0.0)] * body.dimension
    (test,) = L.arguments()
    for integral in L.integrals():
        kind, integrand = integral.integral_type(), integral.integrand()
        if any(
            isinstance(node, ufl.differentiation.Derivative) and test in ufl.algorithms.extract_arguments(node)
            for node in unique_pre_traversal(integrand)
        ):
            raise Refused("a load that works on strains has no guaranteed bound")
        components = [ufl.replace(integrand, {test: ufl.unit_vector(k, dim)}) for k in range(dim)]
        if kind == "cell" and integral.subdomain_id() in ("everywhere", ("everywhere",)):
            force = [total + component for total, component in zip(force, components, strict=True)]
        elif kind == "exterior_facet":
            facets = exterior_facets(integral, body.space.mesh)
            for part, normal in _flat_parts(components, facets, body.space.mesh):
                name = f"load {len(parts)}"
                parts[name] = part
                acting = [ufl.replace(component, normal) for component in components]
                values = [_stated(component, "a traction") for component in acting]
                yield "traction", SurfaceTraction(boundary=name, **dict(zip("xyz", values, strict=False)))
        else:
            raise Refused(f"a load that is an integral over a part of the body, or of the kind {kind!r}, has no bound")
    values = [_stated(component, "the body force") for component in force]
    if any(value != 0.0 for value in values):
        yield "body_force", BodyForce(**dict(zip("xyz", values, strict=False)))


def _flat_parts(components: Sequence[Any], facets: Facets, mesh: dmesh.Mesh) -> Iterator[tuple[Facets, dict[Any, Any]]]:
    """Straight facets, those of one outward normal together, and what stands for the normal in a load there; as many
    parts on all ranks; collective.

    Args:
        components: of the load; without the normal in them the facets are one part.
        facets: of this rank, local numbers.
        mesh: with straight cells.
    """
    normals = {node for component in components for node in unique_pre_traversal(component) if _is_normal(node)}
    if not normals:
        yield facets, {}
        return
    outward = _outward(mesh, facets)
    rounded = np.round(outward / SAME_DIRECTION)
    every = parallel.gather_rows(mesh.comm, rounded), parallel.gather_rows(mesh.comm, outward)
    kinds, first = np.unique(every[0], axis=0, return_index=True)
    for kind, row in zip(kinds, first, strict=True):
        part = facets[(rounded == kind).all(axis=1)]
        yield part, dict.fromkeys(normals, ufl.as_vector(every[1][row].tolist()))


def _is_normal(node: Any) -> bool:
    return isinstance(node, ufl.FacetNormal)


def _outward(mesh: dmesh.Mesh, facets: Facets) -> npt.NDArray[np.float64]:
    """Outward unit normals of exterior facets with straight edges, shape (f, d)."""
    dim = mesh.topology.dim
    if facets.size == 0:  # dolfinx divides by their number
        return np.empty((0, dim))
    corners = mesh.geometry.x[dmesh.entities_to_geometry(mesh, dim - 1, facets)][:, :dim, :dim]
    along = corners[:, 1:] - corners[:, :1]
    normals = np.column_stack((along[:, 0, 1], -along[:, 0, 0])) if dim == 2 else np.cross(along[:, 0], along[:, 1])
    mesh.topology.create_connectivity(dim - 1, dim)
    cells = mesh.topology.connectivity(dim - 1, dim)
    inside = dmesh.compute_midpoints(mesh, dim, cells.array[cells.offsets[facets]])[:, :dim]
    normals *= np.sign(np.sum(normals * (corners[:, 0] - inside), axis=1, keepdims=True))
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _supports(
    space: fem.FunctionSpace, prescribed: tuple[npt.NDArray[np.bool_], Nodal], parts: dict[str, Facets]
) -> Iterator[PrescribedDisplacement]:
    """The supports, one for each component and value, as many on all ranks; the facets that they hold are added to
    ``parts``; collective.
    """
    mesh, dim = space.mesh, space.mesh.geometry.dim
    fixed, values = (array.reshape(-1, dim) for array in prescribed)
    facets = dmesh.exterior_facet_indices(mesh.topology)
    nodes, comm = facet_nodes(space, facets), mesh.comm
    for k in range(dim):
        held = fixed[nodes, k].all(axis=1)
        reached = np.zeros(fixed.shape)
        reached[nodes[held]] = 1.0
        alone = over_ranks(reached.ravel(), space).reshape(-1, dim)[:, k] == 0.0
        if parallel.any_rank(comm, bool((fixed[: len(alone), k] & alone).any())):
            raise Refused("a displacement at a point, or a rotation, has no guaranteed bound")
        if parallel.any_rank(comm, bool((np.ptp(values[nodes[held], k], axis=1) != 0).any())):
            raise Refused("a prescribed displacement that varies is known at the nodes alone")
        at_facets = values[nodes[held][:, 0], k]
        for number, value in enumerate(np.unique(parallel.gather_rows(comm, np.unique(at_facets)))):
            name = f"support {'xyz'[k]} {number}"
            parts[name] = facets[held][at_facets == value]
            yield PrescribedDisplacement(boundary=name, **{"xyz"[k]: float(value)})


def _lame(forms: GivenForms, body: Model) -> tuple[fem.Function, fem.Function]:
    """Both parameters of Lame in each cell, of a stress whose energy the form is."""
    law = forms.stress
    if law is None:
        raise Refused("the forms do not say what the stress is: give stress=")
    moduli = cellwise_moduli(law, body.space)
    if moduli.varies:
        raise Refused("graded moduli have no guaranteed bound")
    lame = isotropic_moduli(moduli.values, body.dimension, body.space.mesh)
    if lame is None:
        raise Refused("an orthotropic material has no guaranteed bound")
    at_rest = law(fem.Function(body.space))
    with compiling():
        stressed = fem.assemble_scalar(fem.form(ufl.inner(at_rest, at_rest) * ufl.dx(body.space.mesh))) > 0
        if parallel.any_rank(body.comm, bool(stressed)):
            raise Refused("a stress without a strain has no guaranteed bound")
    trial, test = forms.original[0].arguments()[::-1]
    sigma, d = law(trial), body.dimension
    within = ufl.as_matrix([[sigma[i, j] for j in range(d)] for i in range(d)])
    with compiling():
        energy = fem.form(ufl.inner(within, ufl.sym(ufl.grad(test))) * ufl.dx(body.space.mesh))
    y = fem.Function(body.space)
    y.x.array[:] = np.random.default_rng(0).standard_normal(y.x.array.size)
    y.x.scatter_forward()
    nodes = np.arange(y.x.array.size // d, dtype=np.int32)
    forces, of_stress = (action((form,), y, nodes) for form in (forms.compiled[0], energy))
    apart, size = (parallel.largest(body.comm, np.abs(values)) for values in (forces - of_stress, forces))
    if apart > SAME_ENTRY * size:
        raise Refused("a is not the energy of the stress: springs, or another law, have no guaranteed bound")
    return lame
