"""Fluids in open contact as the certificate sees them: from the scene, the mesh and the pressure of the contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from signorini_fx import parallel
from signorini_fx.body.assembly import facet_nodes
from signorini_fx.results.contact_nodes import ContactNodes, ContactSide
from signorini_fx.results.nodal_forces import NodalForces
from signorini_fx.results.promised_law import Tractions

Array = npt.NDArray[np.float64]

# Pressures that differ by a smaller share are the same.
_ROUND_OFF = 1e-9


def forces_of_fluid(forces: NodalForces, sides: Sequence[ContactSide], tractions: Tractions) -> Array:
    """The forces of the fluids on the body, shape (owned nodes, d); collective."""
    assert tractions.fluid is not None
    alone = replace(tractions, pressure=tractions.fluid, shear=np.zeros_like(tractions.shear))
    reached, pushing, _ = ContactNodes.of(forces, sides, alone).forces()
    found = np.zeros((forces.owned, forces.dimension))
    np.subtract.at(found, reached, pushing)
    return found


def forces_entered(forces: NodalForces, sides: Sequence[ContactSide], tractions: Tractions, place: float) -> Array:
    """The same of a pressure that has entered; of one that has not there are none: they leave the body unbalanced."""
    found = forces_of_fluid(forces, sides, tractions)
    return np.zeros_like(found) if astray(forces, tractions, place) else found


def astray(forces: NodalForces, tractions: Tractions, place: float) -> bool:
    """Whether a pressure of fluids is not that of fluids that have entered; collective.

    Its points must be connected with points at which the boundary of a fluid meets the contact, and have the pressure
    of one that enters there.  All points must have it at which a fluid enters, and those of facets with an open point
    that has it.

    Args:
        forces: of the scene on its mesh.
        tractions: those of the contact; a point is open where its pressure is not positive.
        place: the load step, or a place between two.
    """
    return any(_astray(forces, tractions, place, part) for part in range(len(forces.scene.contact)))


def _astray(forces: NodalForces, tractions: Tractions, place: float, part: int) -> bool:
    """The same for one contact."""
    scene, numbers, name = forces.scene, forces.space.dofmap.index_map, forces.scene.contact[part].boundary
    assert tractions.fluid is not None
    here = np.flatnonzero(tractions.part == part)
    nodes, fluids = tractions.nodes[here], [fluid for fluid in scene.fluids if name in fluid.enters]
    known = np.zeros((int(numbers.size_global), 2 + len(fluids)))
    pressures = []
    for fluid in fluids:
        factor, now = scene.now(fluid, place)
        pressures.append(np.maximum(factor * now.pressure(forces.at_nodes[nodes, : forces.dimension]), 0.0))
    columns = (numbers.local_to_global(nodes), tractions.fluid[here], tractions.pressure[here] <= 0, *pressures)
    rows = parallel.gather_rows(forces.space.mesh.comm, np.column_stack(columns))
    known[rows[:, 0].astype(np.int64)] = rows[:, 1:]
    pressure, open_, offered = known[:, 0], known[:, 1] > 0, known[:, 2:]
    wet, facets = pressure > 0, _facets(forces, name)
    facet, node = np.nonzero(wet[facets])
    shape = (len(facets) + len(known),) * 2
    graph = coo_array((np.ones(facet.size), (facet, facets[facet, node] + len(facets))), shape=shape)
    component = connected_components(graph, directed=False)[1][len(facets) :]
    right = ~wet
    for number, fluid in enumerate(fluids):
        begins = np.intersect1d(_facets(forces, fluid.boundary), facets)
        begins = begins[offered[begins, number] > 0]
        if not wet[begins].all():
            return True
        same = np.abs(pressure - offered[:, number]) <= _ROUND_OFF * pressure
        right |= same & np.isin(component, component[begins])
    filled = (wet & open_)[facets].any(axis=1)
    dry = (facets[filled].size > 0) and not (wet | (offered <= 0).all(axis=1))[facets[filled]].all()
    return bool(dry or not right.all())


def _facets(forces: NodalForces, boundary: str) -> npt.NDArray[np.int64]:
    """Global numbers of the nodes of the facets of a boundary, shape (facets, nodes of a facet); collective."""
    own = facet_nodes(forces.space, forces.tagged.facets(boundary))
    numbers = forces.space.dofmap.index_map.local_to_global(own.ravel()).reshape(own.shape)
    return parallel.gather_rows(forces.space.mesh.comm, numbers)
