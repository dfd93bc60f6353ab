"""What a foreign result is judged against: mesh, moduli, supports, loads and contact as plain arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array, vstack

from signorini_fx.addons.judging.reference_elements import ReferenceElement, gauss, reference_element
from signorini_fx.addons.judging.soft_contact import SoftLaw
from signorini_fx.mechanics.mesh.files.cells import CELLS
from signorini_fx.mechanics.mesh.files.raw import rows_of
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.mechanics.statement.statement import Statement

if TYPE_CHECKING:
    from signorini_fx.results.solution import Solution

# The kind of the facets of each kind of cell; those of serendipity elements are of that family.
_FACET = {"quad8": "line3", "hexahedron20": "quad8"}
_COMPLETE = {"quad8": "quad9", "hexahedron20": "hexahedron27"}


@dataclass(frozen=True)
class JudgedMesh:
    """The mesh of a problem.

    Attributes:
        points: positions, length, shape (n, d).
        kind: of its cells, of ``reference_elements``.
        cells: nodes of each, shape (m, k).
        boundaries: name -> nodes of its facets, shape (f, l).
        regions: name -> cells.
        names: the number of each node in its file, shape (n,).
    """

    points: Floats
    kind: str
    cells: Ints
    boundaries: Mapping[str, Ints]
    regions: Mapping[str, Ints]
    names: Ints

    @property
    def dim(self) -> int:
        """2 in the plane, 3 in space."""
        return self.points.shape[1]

    @property
    def element(self) -> ReferenceElement:
        """That of the cells."""
        return reference_element(self.kind)

    @property
    def facet(self) -> ReferenceElement:
        """That of the facets."""
        return reference_element(_FACET.get(self.kind, CELLS[_COMPLETE.get(self.kind, self.kind)].facet))

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around it, length."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def owners(self, facets: Ints) -> Ints:
        """The cell of each exterior facet, which may be there several times."""
        sides = np.array(CELLS[_COMPLETE.get(self.kind, self.kind)].facets)
        width = sides.shape[1]
        table = self.cells[:, sides].reshape(-1, width)
        distinct, of_facet = np.unique(np.sort(facets[:, :width], axis=1), axis=0, return_inverse=True)
        order = rows_of(table, distinct)
        owner = np.full(len(distinct), -1)
        held = np.flatnonzero(order >= 0)
        owner[order[held]] = held // len(sides)
        return np.asarray(owner[of_facet.ravel()])

    @cached_property
    def bodies(self) -> Ints:
        """The number of the body of each node: bodies share no node."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        first, further = np.repeat(self.cells[:, :1], self.cells.shape[1] - 1, axis=1), self.cells[:, 1:]
        pairs = (np.ones(further.size), (first.ravel(), further.ravel()))
        graph = coo_array(pairs, shape=(len(self.points),) * 2)
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


@dataclass(frozen=True)
class JudgedMaterial:
    """A material.

    Attributes:
        name: its region; "": the whole body.
        cells: that consist of it.
        stiffness: stresses from strains, xx, yy, zz, xy, xz, yz, of shear twice the tensor's, stress, shape (6, 6), or
            where it varies of each of its cells, shape (m, 6, 6).
        young: its natural modulus, stress.
        density: mass per volume; None: not known.
        expansion: coefficient of thermal expansion, 1 / temperature; None: not known.
    """

    name: str
    cells: Ints
    stiffness: Floats
    young: float
    density: float | None
    expansion: float | None = None

    @property
    def varies(self) -> bool:
        """Whether the stiffness is another one in each cell."""
        return self.stiffness.ndim > 2


@dataclass(frozen=True)
class JudgedStrain:
    """A strain without stress, the same in all directions.

    Attributes:
        name: of the effect that has it.
        at_nodes: of each cell at its nodes, without unit, shape (m, k).
        between: (cells, points of each, length, shape (c, q, d)) -> its values there, shape (c, q); None: those of the
            shape functions.
        switches: whether it may have a jump or a kink inside cells, where each rule of quadrature sees another strain.
    """

    name: str
    at_nodes: Floats
    between: Callable[[Ints, Floats], Floats] | None = None
    switches: bool = False

    def values(self, cells: Ints, shape: Floats, x: Floats) -> Floats:
        """At points of cells, shape (c, q).

        Args:
            cells: which.
            shape: of the nodes there, shape (q, k).
            x: the points, length, shape (c, q, d).
        """
        return np.asarray(self.at_nodes[cells] @ shape.T) if self.between is None else self.between(cells, x)


@dataclass(frozen=True)
class JudgedContact:
    """Contact of two surfaces, or of one with a rigid foundation.

    Attributes:
        name: of the boundary that carries it.
        against: of that of the other body; "": a rigid foundation.
        facets: nodes, shape (f, l).
        opposite: of the other side, shape (g, l); none with a rigid foundation.
        entry: that of the scene.
        bonded: whether both sides are tied.
        of_nodes: whether it is a tie of an input file, whose nodes programs link to the other side.
        stiffness: stress per length that the deck gives; None: hard.
        stick: the same of sticking.
        nodal: whether a node of one side touches a surface, as *TYPE=NODE TO SURFACE* says.
        law: by which pressure and overclosure belong together; None: contact is hard.
    """

    name: str
    against: str
    facets: Ints
    opposite: Ints
    entry: Any
    bonded: bool
    stiffness: float | None = None
    stick: float | None = None
    nodal: bool = False
    law: SoftLaw | None = None
    of_nodes: bool = False

    @property
    def nodes(self) -> Ints:
        """Of both sides."""
        return np.unique(np.concatenate((self.facets.ravel(), self.opposite.ravel())))

    @property
    def rubs(self) -> bool:
        """Whether it has friction."""
        return not self.bonded and bool(self.entry.friction.acts)


@dataclass(frozen=True)
class JudgedProblem:
    """A problem.

    Attributes:
        mesh: its mesh.
        hypothesis: plane strain, plane stress, axisymmetric or space.
        thickness: of a body under plane stress, length.
        materials: of which each cell has one.
        prescribed: displacements, length, NaN where they are free, shape (n, d).
        loads: name -> forces at the nodes, in the plane per thickness, of revolution per radian, shape (n, d).
        contacts: its contacts.
        element: how a deck calls the elements, such as CPE4; "": not known.
        hard: stress per length by which the program of the deck makes hard contact; 0: it is hard.
        printed_share: of these forces those that the program of the deck prints.
        several_steps: whether slip counts from a load step before the last one.
        time: at the end of the last step; None: not known.
        begun: when the last one of several steps began; None: there is one alone, or it is not known.
        prescribed_before: the same as ``prescribed`` at the end of the step before; None: there is none.
        statement: what is stated of it.
        solve: solves it with other entries of the keys that it is called with, to the last iterate.
        deck: what was read from the input file; None: the problem is none.
        lost: what the problem lacks of the deck.
        links: C of the relations C v = 0 of equations and of ties that are no bonds, without unit, shape (links, n d).
        bonds: the same of ties that are bonds of ``contacts``, too.
        strains: initial strains, such as thermal ones.
        springs: name -> stiffness of springs on a boundary, force per length, shape (n d, n d).
        other_readings: makes the fields that differ where a program integrates loads or strains otherwise, by what is
            to be said of it.
        rigid_bodies: numbers of bodies all of whose nodes are held.
    """

    mesh: JudgedMesh
    hypothesis: str
    thickness: float
    materials: tuple[JudgedMaterial, ...]
    prescribed: Floats
    loads: Mapping[str, Floats]
    contacts: tuple[JudgedContact, ...]
    element: str
    hard: float
    printed_share: float
    several_steps: bool
    time: float | None
    statement: Statement
    solve: Callable[..., Solution]
    deck: Any
    lost: tuple[str, ...] = ()
    links: csr_array = field(default_factory=lambda: csr_array((0, 0)))
    bonds: csr_array = field(default_factory=lambda: csr_array((0, 0)))
    begun: float | None = None
    prescribed_before: Floats | None = None
    strains: tuple[JudgedStrain, ...] = ()
    springs: Mapping[str, csr_array] = field(default_factory=dict)
    other_readings: Callable[[], Mapping[str, Mapping[str, Any]]] = dict

    def linked_in(self, v: Floats, allowed: float) -> Self:
        """The problem whose ties are links of nodes if a displacement keeps to these, else are bonds.

        Programs tie in either way; the links say more, as what they exert is known.

        Args:
            v: the displacement, length, shape (n, d).
            allowed: by how much it may miss a link, length.
        """
        if not self.bonds.shape[0] or np.abs(self.bonds @ v.ravel()).max() > allowed:
            return self
        contacts = tuple(contact for contact in self.contacts if not contact.of_nodes)
        return replace(
            self, contacts=contacts, links=csr_array(vstack((self.links, self.bonds))), bonds=csr_array((0, 0))
        )

    @cached_property
    def rigid_bodies(self) -> Ints:
        """Numbers of bodies all of whose nodes are held."""
        bodies = self.mesh.bodies
        loose = np.unique(bodies[np.isnan(self.prescribed).any(axis=1)])
        return np.setdiff1d(np.unique(bodies), loose)

    @cached_property
    def deformable(self) -> npt.NDArray[np.bool_]:
        """Which nodes are of a body that is not held everywhere, shape (n,)."""
        return ~np.isin(self.mesh.bodies, self.rigid_bodies)

    @cached_property
    def touching(self) -> npt.NDArray[np.bool_]:
        """Which nodes are on a surface in contact, shape (n,)."""
        marked = np.zeros(len(self.mesh.points), dtype=bool)
        for contact in self.contacts:
            marked[contact.nodes] = True
        return marked

    @cached_property
    def linked(self) -> npt.NDArray[np.bool_]:
        """Which nodes are in a tie or an equation, shape (n,)."""
        marked = np.zeros(self.mesh.points.size, dtype=bool)
        marked[self.links.nonzero()[1]] = True
        return np.asarray(marked.reshape(self.mesh.points.shape).any(axis=1))

    @cached_property
    def free(self) -> npt.NDArray[np.bool_]:
        """Which components are neither held nor of a node in contact, shape (n, d)."""
        return np.isnan(self.prescribed) & ~self.touching[:, None] & self.deformable[:, None]


@dataclass(frozen=True)
class FacetPoints:
    """Points of quadrature on facets.

    Attributes:
        x: positions, shape (f, q, d).
        normal: outward, shape (f, q, d).
        weight: area (in the plane: length; of revolution: per radian), shape (f, q).
        shape: of the nodes of a facet there, shape (q, l).
    """

    x: Floats
    normal: Floats
    weight: Floats
    shape: Floats


def facet_points(
    mesh: JudgedMesh, facets: Ints, count: int, *, revolved: bool, rule: tuple[Floats, Floats] | None = None
) -> FacetPoints:
    """Points of a rule of quadrature on facets.

    Args:
        mesh: the mesh.
        facets: nodes, shape (f, l).
        count: of points along each axis of Gauss's rule.
        revolved: whether the mesh is a section whose points lie on circles.
        rule: places and weights on each facet instead of Gauss's, shapes (f, q, dim - 1) and (f, q).
    """
    element = mesh.facet
    places, weights = gauss(count, element.dim, simplex=element.simplex) if rule is None else rule
    flat = places.reshape(-1, element.dim)
    shape = element.shape(flat).reshape(*places.shape[:-1], -1)
    gradient = element.gradient(flat).reshape(*shape.shape, element.dim)
    x = np.einsum("...qk,...kd->...qd", shape, mesh.points[facets])
    tangents = np.einsum("...qkj,...kd->...qdj", gradient, mesh.points[facets])
    if mesh.dim == 2:
        normal = np.stack((tangents[..., 1, 0], -tangents[..., 0, 0]), axis=2)
    else:
        normal = np.cross(tangents[..., 0], tangents[..., 1])
    size = np.linalg.norm(normal, axis=2)
    inside = mesh.points[mesh.cells[mesh.owners(facets)]].mean(axis=1)
    toward = np.einsum("fqd,fqd->fq", normal, x - inside[:, None])
    normal = normal / size[..., None] * np.where(toward < 0, -1.0, 1.0)[..., None]
    weight = size * weights * (x[..., 0] if revolved else 1.0)
    return FacetPoints(x, normal, weight, shape)
