"""The verdicts on a displacement: whether displacements that contact admits raise the energy, by
the derivative of F; and whether shapes or bodies are inside each other, or have passed through each
other since the last solution, as text.
"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import reduce

import numpy as np
from dolfinx import fem
from petsc4py import PETSc
from scipy.sparse.linalg import LinearOperator, eigsh
from scipy.spatial import cKDTree

from signorini_fx.algebra.linalg.condensed import CondensedSystem
from signorini_fx.algebra.linalg.factorisation import enough_memory, factor_memory, with_inertia
from signorini_fx.algebra.regularised import ContactTangent
from signorini_fx.arrays import Array, Flags, Ints
from signorini_fx.errors import FormError
from signorini_fx.forms.nonlinear.linearised import Bent, MovingFoundations, NonlinearBody, Solved
from signorini_fx.forms.nonlinear.moving_shapes import turning_of
from signorini_fx.forms.nonlinear.residual import is_derivative
from signorini_fx.machine import parallel
from signorini_fx.machine.display import point_in_words
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, block_diagonal
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.obstacles.corner_depths import FACETS_OF_ROUNDING, deepest_corner
from signorini_fx.mechanics.obstacles.corner_points import BoundaryLine
from signorini_fx.mechanics.obstacles.paired_points import FacingSides
from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells, InsideBody
from signorini_fx.mechanics.state import State
from signorini_fx.records import Status
from signorini_fx.tuned import HOLDING_STIFFNESS, MOST_PLACES, NEGLIGIBLE, NO_FORCE, SHAPE_INSIDE


def stable(solved: Solved) -> tuple[Status, str]:
    """Return whether an equilibrium is stable, by the derivative of F, as a status, and where an
    instability begins, as text; collective.
    """
    if _holds(solved):
        return Status.CONVERGED, ""
    if (found := _inertia(solved)) is None:
        return Status.STABILITY_UNKNOWN, ""
    negative, place = found
    if not negative:
        return Status.CONVERGED, ""
    if (
        not solved.linear.iterate.symmetric
    ):  # without an energy, an indefinite symmetric part proves nothing
        return Status.STABILITY_UNKNOWN, ""
    return Status.UNSTABLE, f"it begins at {place}"


def _holds(solved: Solved) -> bool:
    """Return whether the condensed stiffness of the last iteration is positive definite together
    with ``_springs``; collective.
    """
    system = solved.linear.task.system
    condensed = isinstance(system, CondensedSystem) and system.schur.regular
    if not condensed or not leads(solved.body, solved.body.at.x.array.copy()):
        return False
    tangent = ContactTangent(system.matrix, system.contact)
    matrix = tangent.create()
    tangent.insert(matrix, _springs(solved) / system.contact.points.weight[:, None, None])
    return system.is_definite(matrix)


def _inertia(solved: Solved) -> tuple[int, str] | None:
    """Return the number of negative eigenvalues of the derivative of F, and where the unstable
    direction is largest; None if unknown, for lack of memory or of a derivative; collective.
    """
    elastic = solved.linear.elastic
    mesh = elastic.space.mesh
    if not enough_memory(mesh.comm, factor_memory(elastic.dofs, mesh.topology.dim)):
        return None
    body = solved.body
    values = body.at.x.array.copy()
    derives = leads(body, values)
    tangent = body.tangents.leading if derives else body.tangents.derivative
    if not derives and not is_derivative(tangent, body.evaluated, values, ~elastic.fixed):
        return None
    return _negative(tangent, solved, body.bend())


def reason_for_none(body: NonlinearBody, before: Array, tried: Array | None = None) -> str:
    """Return a reason why there may be no solution, as text, or "" if there is no indication;
    collective.

    Args:
        body: the body at the last iterate.
        before: values of ``u`` of the last solution.
        tried: values of ``u`` after the full increment, if no part of it is possible.
    """
    if body.now is None:  # no tangent was assembled
        return ""
    u = body.at
    comm = u.function_space.mesh.comm
    farthest = u.x.array if tried is None else tried
    away, so_far = (
        parallel.largest(comm, np.abs(values)) for values in (farthest - before, before)
    )
    if not away <= max(body.named[1].size, so_far):
        return "the displacement runs away" if leads(body, before) else ""
    with suppress(FormError):
        known = body.evaluated.at(u.x.array.copy()) is not None
        solved = body.solved
        known = known and solved is not None and solved.linear is body.now
        found = _inertia(solved) if known and solved is not None else None
        if found is not None and found[0]:
            return f"the tangent has lost its stiffness, first at {found[1]}"
    return ""


def leads(body: NonlinearBody, values: Array) -> bool:
    """Return whether Newton's tangent is the derivative of F at values of ``u``; collective.

    Other tangents may lead away from the solution.  The derivative by UFL, too, misses what the
    user's ``update`` changes.
    """
    tangents = body.tangents
    residual = body.evaluated
    known = body.trusted or not (tangents.given or residual.update is not None)
    return known or is_derivative(
        tangents.leading, residual, values, ~body.supports()[0][: body.owned]
    )


def jumping(solved: Solved) -> str:
    """Return which point neither sticks nor slides where active sets cycle and nothing else
    changes in them, as text, or ""; collective.
    """
    problem = solved.outcome.problem
    sets, following = problem.sets, problem.next.sets
    changing = sets.changed(following)
    undecided = sets.contact & following.contact & (sets.slip != following.slip)
    boundary = solved.linear.boundary
    places = parallel.gather_rows(boundary.comm, boundary.x[changing])
    if parallel.any_rank(boundary.comm, changing & ~undecided) or not places.size:
        return ""
    return f"the point at {point_in_words(places[0])} neither sticks nor slides"


def _springs(solved: Solved) -> Array:
    """Return springs that represent contact and sticking, independent of units, force per length,
    shape (n, d, d); collective.
    """
    state = solved.state
    springs = turning_of(state, solved.linear.elastic.scales.size)
    components = np.arange(springs.shape[1])
    sticks = np.tile(solved.body.sticks(state), (components.size - 1, 1)).T
    held = np.column_stack((state.in_contact, sticks))
    largest = HOLDING_STIFFNESS * largest_stiffness(solved.linear.elastic)
    springs[:, components, components] += largest * held
    return springs


def _negative(tangent: fem.Form, solved: Solved, bent: Bent) -> tuple[int, str]:
    """Return ``negative_directions`` of a tangent with ``_springs``, and where the direction is
    largest; collective.
    """
    nonlinear = solved.body
    space = nonlinear.space
    elastic = solved.linear.elastic
    fixed = elastic.fixed
    body = nonlinear.body_of(
        tangent,
        solved.state.boundary,
        bent,
        fixed=fixed,
        settings=nonlinear.settings.model_copy(update={"linear_algebra": "full"}),
        definite=False,
        symmetric=False,
        of_body=elastic.of_supports,
    )
    matrix = body.stiffness
    rows = body.contact.operator
    if nonlinear.contact:
        springs = _springs(solved)
        acts = np.flatnonzero(springs.any(axis=(1, 2)))
        dim = space.mesh.geometry.dim
        kept = (dim * acts[:, None] + np.arange(dim)).ravel() + rows.getOwnershipRange()[0]
        rows = rows.createSubMatrix(
            PETSc.IS().createGeneral(kept.astype(PETSc.IntType), comm=matrix.comm)
        )
        added = rows.transposeMatMult(block_diagonal(rows, springs[acts]).matMult(rows))
        held_rows = added.getOwnershipRange()[0] + np.flatnonzero(body.prescribed)
        added.zeroRowsColumns(held_rows.astype(PETSc.IntType), diag=0.0)
        matrix.axpy(1.0, added, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    if not solved.linear.iterate.symmetric:
        matrix.axpy(1.0, matrix.transpose(PETSc.Mat()))
        matrix.scale(0.5)
    if solved.loose:  # loose bodies move without resistance: a small stiffness must hold them
        matrix.shift(NO_FORCE * largest_stiffness(elastic))
    negative, direction = negative_directions(matrix)
    sizes = np.linalg.norm(direction[: fixed.size].reshape(-1, space.mesh.geometry.dim), axis=1)
    rows = np.column_stack((sizes, node_positions(space)[: sizes.size, : space.mesh.geometry.dim]))
    farthest = max(
        map(
            tuple,
            parallel.gather_rows(space.mesh.comm, rows[np.argsort(-sizes, kind="stable")[:1]]),
        )
    )
    return negative, point_in_words(farthest[1:])


def largest_stiffness(elastic: Model) -> float:
    """Return the largest diagonal entry of a stiffness, force per length; collective."""
    diagonal = elastic.stiffness.getDiagonal().getArray(readonly=True)[: elastic.fixed.size]
    return parallel.largest(elastic.comm, np.abs(diagonal)) or 1.0


def negative_directions(matrix: PETSc.Mat) -> tuple[int, Array]:
    """Return the number of negative eigenvalues of a symmetric matrix, by an LDL^T factorisation
    with MUMPS, and an unstable direction, shape (rows of this rank,), zero if there is none;
    collective.

    The matrix is destroyed.
    """
    preconditioner, negative = with_inertia(matrix)
    comm, (x, y), own = (
        matrix.comm.tompi4py(),
        matrix.createVecs(),
        slice(*matrix.getOwnershipRange()),
    )

    def solved(values: Array) -> Array:
        x.getArray()[:] = values[own]
        preconditioner.apply(x, y)
        return parallel.gather_rows(comm, np.array(y.getArray(readonly=True)))

    direction = np.zeros(matrix.getLocalSize()[0])
    if negative:  # the eigenvector of the lowest eigenvalue of the inverse
        inverse = LinearOperator(matrix.getSize(), matvec=solved)
        begin = np.random.default_rng(0)
        _, vectors = eigsh(
            inverse, k=1, which="SA", v0=begin.standard_normal(inverse.shape[0]), tol=NEGLIGIBLE
        )
        direction = vectors[own, 0]
    preconditioner.destroy()
    matrix.destroy()
    return negative, direction


def overlap(foundations: MovingFoundations, last: State) -> str:
    """Return the overlap of the body with a shape as text, or ""; collective.

    It is at the end of the step or on the way from the ``last`` solution.  In the first step,
    shapes that were inside the body from the beginning are not followed on the way.
    """
    cells = foundations.cells
    now = cells.placed(foundations.at.x.array)
    then = cells.placed(last.displacement)
    moved = foundations.moved_shapes(last.placed)
    for number, moving in foundations.moving.items():
        added = parallel.largest(cells.space.mesh.comm, moving.added, -np.inf)
        if (deep := cells.inside(now, moving.shape, added)) is not None:
            return f"contact[{number}]: {deep}"
        _, before = moved.get(number, (None, moving.shape))
        if not last.number and cells.inside(then, before, added) is not None:
            continue
        if (deep := cells.passed((then, before), (now, moving.shape), added)) is not None:
            return f"contact[{number}]: during the step, {deep}"
    return ""


def corner_inside(foundations: MovingFoundations, boundary: ContactBoundary) -> str:
    """Return which corner of a shape is inside the displaced body between its nodes, as text, or
    ""; collective.
    """
    deep = deepest_corner(foundations.placed_shapes, foundations.at, (), boundary)
    return "" if deep is None else f"{deep.path.removesuffix('.shape')}: {deep}"


def sharp_end(foundations: MovingFoundations, displacement: Array) -> str:
    """Return which sharp end of a contact boundary is beside a corner of its shape, as text, or "";
    collective.

    ``displacement``: of the nodes of this rank, from which the end is looked at, length.
    """
    space = foundations.at.function_space
    moved = displacement.reshape(-1, space.dofmap.index_map_bs)
    for number in foundations.moving:
        corners = foundations.corners_of(number)
        if corners is None or not corners.places.size:
            continue
        line = BoundaryLine.of(space, foundations.facets[number], moved)
        for facet, end in line.sharp_ends:
            place = line.x[facet, end]
            k = int(np.linalg.norm(corners.places - place, axis=1).argmin())
            long = float(line.lengths[facet])
            radius = FACETS_OF_ROUNDING * long
            if np.linalg.norm(corners.places[k] - place) <= long:
                at, corner = (f"({x:.4g}, {y:.4g})" for x, y in (place, corners.places[k]))
                return (
                    f"contact[{number}]: a sharp end of the body at {at} is beside the corner of "
                    f"the foundation at {corner}, so that the direction of contact jumps there: "
                    f"chamfer the body or round off the corner, by at least {radius:.2g}"
                )
    return ""


def overlap_of_bodies(foundations: MovingFoundations, last: State) -> str:
    """Return the overlap of sliding pairs as text, or ""; collective.

    The nodes of each side are searched for in the cells of other pieces of the mesh, at the end of
    the step and on the straight way from the ``last`` solution.  Because sides are chords, nodes
    may be inside by up to ``SHAPE_INSIDE`` of a facet of the other side, at the end by at most the
    reach of the contact.
    """
    if not foundations.sliding:
        return ""
    cells = foundations.cells
    comm = cells.space.mesh.comm
    now = cells.placed(foundations.at.x.array)
    then = cells.placed(last.displacement)
    piece = find_pieces(cells.space.mesh).of_cell
    every = cells.space.dofmap.list
    nodal = np.zeros((len(now), 1))
    nodal[every.ravel(), 0] = np.repeat(piece[: len(every)], every.shape[1])
    owned = cells.space.dofmap.index_map.size_local
    lengths = np.linalg.norm(np.ptp(now[cells.nodes], axis=1), axis=1)
    total, count = parallel.global_sum(comm, np.array([lengths.sum(), lengths.size]))
    way = parallel.largest(comm, np.linalg.norm(now - then, axis=1)) / (
        SHAPE_INSIDE * total / count
    )
    steps = math.ceil(min(max(float(way), 1.0), MOST_PLACES))
    for number, pair in foundations.sliding.items():
        of_node = pair.sides.gathered(nodal[:owned])[:, 0]
        added = max(parallel.largest(comm, foundations.given_gap(number)[pair.local_points]), 0.0)
        for share in np.arange(1, steps + 1) / steps:
            # At the end, contact does not find points that are deeper than its reach.
            seen = pair.reach if share == 1.0 else math.inf
            places = (1.0 - share) * then + share * now
            at = pair.sides.gathered(np.ascontiguousarray(places[:owned]))
            found = _within(cells, places, piece[: len(cells.nodes)], at, of_node)
            within = parallel.global_sum(comm, found.astype(np.int64)) > 0
            if (deep := _deepest(pair.sides, at, within, seen, added)) is not None:
                return f"contact[{number}]: {deep}"
    return ""


def _within(cells: BodyCells, places: Array, piece: Ints, at: Array, of_node: Array) -> Flags:
    """Return the flags of points that are in a cell of this rank of another piece, shape (m,).

    Args:
        cells: the cells.
        places: displaced nodes.
        piece: piece of each cell.
        at: the points, shape (m, d).
        of_node: piece of each point, shape (m,).
    """
    within = np.zeros(len(at), dtype=bool)
    corners = cells.corners(places)
    high, low = (reduce(extreme, corners.swapaxes(0, 1)) for extreme in (np.maximum, np.minimum))
    meeting = np.zeros(len(corners), dtype=bool)
    for own in np.unique(piece):  # cells whose boxes meet that of all points of other pieces
        x = at[of_node != own]
        if len(x):
            meeting |= (piece == own) & ((high >= x.min(axis=0)) & (low <= x.max(axis=0))).all(
                axis=1
            )
    point, cell = cells.covering(places, at, np.flatnonzero(meeting))
    within[point[piece[cell] != of_node[point]]] = True
    return within


def _deepest(
    sides: FacingSides, at: Array, within: Flags, at_most: float, added: float
) -> InsideBody | None:
    """Return the node that is deepest in the other body, along the normal there, or None if none is
    too deep.

    Args:
        sides: both sides of the pair.
        at: displaced nodes of both sides.
        within: flags of nodes in the other body.
        at_most: the largest depth that is allowed, length.
        added: length that is added to the distance.
    """
    halves = np.split(np.arange(len(at)), [sides.slave.nodes.size])
    deepest = None
    both = zip((sides.slave.surface, sides.master.surface), halves, strict=True)
    surfaces = [surface.displaced(at[half] - surface.x) for surface, half in both]
    for half, other in zip(halves, surfaces[::-1], strict=True):
        x = at[half][within[half]]
        if not x.size:
            continue
        size = np.full(len(other.x), np.inf)  # of the smallest facet around each node
        extent = np.linalg.norm(np.ptp(other.corners, axis=1), axis=1) / other.functions.degree
        np.minimum.at(size, other.nodes, extent[:, None])
        nearest = cKDTree(other.x).query(x)[1]
        depth = np.einsum("nd,nd->n", other.x[nearest] - x, other.directions[nearest]) - added
        for k in np.flatnonzero(depth > np.minimum(SHAPE_INSIDE * size[nearest], at_most)):
            if deepest is None or depth[k] > deepest.depth:
                deepest = InsideBody(float(depth[k]), tuple(x[k].tolist()))
    return deepest
