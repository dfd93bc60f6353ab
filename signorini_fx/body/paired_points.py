"""The contact points of a pair of bodies: both sides as surfaces for ``pairs``, and its coupling as a boundary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import basix
import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem

from signorini_fx import compat
from signorini_fx.body.assembly import adjugates, facet_entities
from signorini_fx.body.averages import Averages
from signorini_fx.body.contact_boundary import ContactBoundary, segments_of
from signorini_fx.body.foundation import Pair
from signorini_fx.body.turned_supports import TurnedNodes
from signorini_fx.errors import FormError
from signorini_fx.pairs.coupling import Coupling, PairingError, couple
from signorini_fx.pairs.surface import Lagrange, Surface

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]

# A normal has a component along an axis if it is larger than this.
_ALONG = 1e-8


@dataclass(frozen=True)
class Side:
    """Facets of the body as a surface.

    Attributes:
        surface: with nodes numbered from 0.
        nodes: local number of each of them in the space, shape (N,).
        facets: local numbers, shape (f,).
    """

    surface: Surface
    nodes: npt.NDArray[np.int64]
    facets: Indices

    def columns(self, among: npt.NDArray[np.int64]) -> sp.csr_array:
        """The matrix that takes values at the nodes of the surface from those at some nodes, ascending."""
        places = (np.arange(self.nodes.size), np.searchsorted(among, self.nodes))
        return sp.csr_array(sp.coo_array((np.ones(self.nodes.size), places), shape=(self.nodes.size, among.size)))

    @classmethod
    def of(cls, space: fem.FunctionSpace, facets: Indices) -> Side:
        """Those facets; one rank.  Positions interpolate those of the nodes of the displacement."""
        mesh, element = space.mesh, space.element.basix_element
        dim, entities = mesh.topology.dim, facet_entities(space.mesh, facets)
        vertices, topology = basix.geometry(element.cell_type), basix.topology(element.cell_type)[dim - 1]
        geometry, corners = compat.geometry_element(mesh), compat.geometry_cells(mesh)
        layout, functions = space.dofmap.dof_layout, None
        found, sign = [], np.zeros(len(facets))
        order = []
        for number, corner in enumerate(topology):
            here = np.flatnonzero(entities[:, 1] == number)
            start, *ends = vertices[corner[:dim]]
            along = np.array(ends) - start
            closure = np.array(layout.entity_closure_dofs(dim - 1, number))
            places = np.linalg.lstsq(along.T, (element.points[closure] - start).T, rcond=None)[0].T
            if functions is None:
                functions = Lagrange(places)
            # The nodes of every facet in the same order.
            apart = np.linalg.norm(functions.places[:, None] - places[None], axis=2)
            cells = entities[here, 0]
            found.append(space.dofmap.list[cells][:, closure[apart.argmin(axis=1)]])
            order.append(here)
            middle = start + along.sum(axis=0) / 2
            slopes = geometry.tabulate(1, middle[None])[1:, 0, :, 0]
            jacobian = np.einsum("kg,cgi->ikc", slopes, mesh.geometry.x[corners[cells], :dim])
            across = np.array([along[0, 1], -along[0, 0]]) if dim == 2 else np.cross(*along)
            sign[here] = np.sign(adjugates(jacobian)[1] * (across @ (start - vertices.mean(axis=0))))
        assert functions is not None
        every = np.concatenate(found)[np.argsort(np.concatenate(order))]
        nodes, numbers = np.unique(every, return_inverse=True)
        x = np.array(space.tabulate_dof_coordinates()[nodes, :dim], dtype=np.float64)
        surface = Surface(numbers.reshape(every.shape).astype(np.int64), x, functions, sign)
        return cls(surface, nodes.astype(np.int64), facets)


@dataclass(frozen=True)
class PairedSides:
    """Both sides of a pair, and what joins them.

    Attributes:
        slave: the side with the contact points.
        master: the other one.
        coupling: of both.
        by_geometry: whether the gap is the distance of both sides.
    """

    slave: Side
    master: Side
    coupling: Coupling
    by_geometry: bool

    @classmethod
    def of(
        cls,
        space: fem.FunctionSpace,
        pair: Pair,
        facets: tuple[Indices, Indices],
        name: str,
        fixed: npt.NDArray[np.bool_],
        taken: Sequence[Indices],
        turned: TurnedNodes | None = None,
    ) -> PairedSides:
        """Pair two parts of the boundary; one rank.

        Args:
            space: the displacements.
            pair: the pair.
            facets: of the slave and of the master, local numbers.
            name: of the pair, for errors.
            fixed: which displacement components are prescribed, shape (nodes, d).
            taken: facets of other contacts, whose nodes carry no points of this one.
            turned: nodes for which ``fixed`` is told in their own frames; None: there are none.

        Raises:
            FormError: the sides do not fit together, or are curved and the displacement is linear.
        """
        if compat.geometry_degree(space.mesh) > space.element.basix_element.degree:
            raise FormError([(name, "two bodies with curved cells need a space of degree 2")])
        slave, master = (Side.of(space, here) for here in facets)
        normals = slave.surface.nodal_normals
        if turned is not None:
            normals = np.einsum("nij,ni->nj", turned.frames_at(slave.nodes), normals)
        normals = np.abs(normals)
        unable = np.where(fixed[slave.nodes], 0.0, normals).max(axis=1) <= _ALONG
        unable[~normals.any(axis=1)] = False  # nodes that no point belongs to
        dim = space.mesh.topology.dim
        for others in (*taken, facets[1]):
            unable |= np.isin(slave.nodes, fem.locate_dofs_topological(space, dim - 1, others))
        try:
            found = couple(slave.surface, master.surface, unable, bonded=pair.bonded, reach=pair.reach)
        except PairingError as error:
            raise FormError([(name, str(error))]) from None
        return cls(slave, master, found, not pair.bonded and isinstance(pair.gap, str))

    def boundary(
        self, space: fem.FunctionSpace, facets: Indices, index: int, fixed: npt.NDArray[np.bool_]
    ) -> ContactBoundary:
        """The contact points.

        Args:
            space: the displacements.
            facets: of the slave, local numbers.
            index: of the pair among the contacts.
            fixed: which displacement components are prescribed, shape (nodes, d).
        """
        found, dim = self.coupling, space.mesh.geometry.dim
        nodes = self.slave.nodes[found.nodes]
        reached = np.unique(np.concatenate((self.slave.nodes, self.master.nodes)))
        own, others = (side.columns(reached) for side in (self.slave, self.master))
        shares = sp.csr_array(found.slave @ own - found.master @ others)
        turning = sp.csr_array(found.turning @ sp.kron(others, sp.eye_array(dim)))
        x = space.tabulate_dof_coordinates()[:, :dim]
        centre = np.asarray(found.slave @ self.slave.surface.x)
        lift = sp.csr_array(own.T @ found.lift(self.slave.surface))
        averages = Averages(shares, reached, x[reached], fixed[reached], turning, centre, lift)
        return ContactBoundary(
            comm=space.mesh.comm,
            nodes=nodes.astype(np.int32),
            x=x[nodes],
            weight=found.weight,
            normal=found.normal,
            part=np.full(nodes.size, index, dtype=np.int32),
            free=averages.any_of(~averages.fixed),
            segments=segments_of(space, facets, index, vertices=len(self.slave.surface.tests.places) < self._width),
            global_nodes=nodes,
            averages=averages,
        )

    @property
    def _width(self) -> int:
        return len(self.slave.surface.functions.places)
