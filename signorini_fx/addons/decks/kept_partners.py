"""Whether it matters that points of contact keep their partners where a deck asks for finite strains.

Sides of degree 2 in space, and those that are nominally in contact or adjusted, keep the partners of the undeformed
bodies.  That is right where they slide by little of their length.  Where they slide farther the scene is solved once
more in two ways, with straight cells half as large of degree 1: with partners that are kept, and with sides that slide.
"""

from __future__ import annotations

from dataclasses import replace

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np
from mpi4py import MPI

from signorini_fx.addons.decks.draft import Draft
from signorini_fx.addons.decks.keywords import PARTNERS, Grade
from signorini_fx.addons.decks.tagged_arrays import tagged
from signorini_fx.errors import SignoriniError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.mesh.halving import halved
from signorini_fx.records import Finding
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.reading import read_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.tuned import FINER_AT_MOST, LINEAR_IN_DECK


def judged_partners(solution: Solution, draft: Draft | None) -> Solution:
    """The solution with what it says of contact that keeps its partners: it lacks that sides slide, where that changes
    the answer of the deck, or has a note that it does not; collective.

    Args:
        solution: of the scene that was drafted.
        draft: on the first rank; its scene has been written.

    Returns:
        The same, if no contact keeps its partners, or there is no solution.
    """
    small_pairs = [entry for entry in solution.statement.contact if entry.sliding == "small" and not entry.bonded]
    origin = parallel.on_root(
        solution.comm, lambda: "" if draft is None or draft.deck.nonlinear is None else draft.deck.nonlinear.origin
    )
    if not (small_pairs and origin and solution.converged):
        return solution
    slip = max(_largest_slip(solution.at(step)) for step in solution.shown_steps)

    def told() -> tuple[str, bool]:
        assert draft is not None
        names = {name for entry in small_pairs for name in (entry.boundary, entry.against) if name is not None}
        length = min(_extent(draft, name) for name in names)
        words = f"{PARTNERS}, and slide by {slip:.2g}, {100 * slip / length:.2g} % of the shortest side"
        if slip <= LINEAR_IN_DECK * length:
            return words, False
        share = _share_of_sliding(draft, solution.model.dofs)
        if share is None:
            return words, True
        return f"{words}, and on cells of degree 1 that changes displacements by {100 * share:.2g} %", (
            share > LINEAR_IN_DECK
        )

    words, lost = parallel.on_root(solution.comm, told)
    if lost:
        incomplete = (*solution.statement.incomplete, f"{origin}: {words}")
        model = replace(solution.model, statement=replace(solution.statement, incomplete=incomplete))
        return replace(solution, model=model)
    note = Finding("note", "contact", f"{origin}: {words}: it {Grade.NOTED}")
    return replace(solution, found=lambda: (*solution.found(), note))


def _extent(draft: Draft, name: str) -> float:
    """The largest size of a boundary along an axis, length."""
    mesh = draft.deck.mesh
    corners = mesh.points[np.unique(mesh.facet_corners[mesh.boundaries[name]])]
    return float(np.ptp(corners, axis=0).max())


def _largest_slip(moment: Solution) -> float:
    """How far points that touch have moved along the other side, length; collective."""
    columns = moment.table.columns
    names = [name for name in columns if name == "u_t" or name.startswith("u_t_")]
    slips = np.column_stack([columns[name] for name in names])[np.asarray(columns["state"]) != "open"]
    return float(np.linalg.norm(slips, axis=1).max(initial=0.0))


def _share_of_sliding(draft: Draft, unknowns: int) -> float | None:
    """By how much displacements of cells of degree 1 change where sides slide, of the largest of all steps; None: this
    cannot be told.
    """
    mesh, target = draft.deck.mesh, next(path for path, text in draft.files.items() if text is draft.text)
    scene = read_scene(target)
    has_files = any(getattr(entry, "file", None) for _, entry in scene.statement.listed())
    if has_files or (2 / mesh.degree) ** mesh.dim * unknowns > FINER_AT_MOST:
        return None
    element = scene.element.model_copy(update={"degree": 1})
    ends = []
    try:
        for sliding in ("small", "finite"):
            contact = tuple(
                entry if entry.bonded or entry.against is None else entry.model_copy(update={"sliding": sliding})
                for entry in scene.contact
            )
            finer = scene.remade(mesh=tagged(halved(mesh), straight=True), element=element, contact=contact)
            solution = solve(finer, MPI.COMM_SELF, check=False)
            if not solution.converged:
                return None
            ends.append([solution.at(step).displacement.x.array.copy() for step in solution.shown_steps])
    except SignoriniError:
        return None
    if len(ends[0]) != len(ends[1]):  # steps of automatic size
        return None
    small, finite = (np.array(values) for values in ends)
    largest = float(np.abs(finite).max())
    return float(np.abs(small - finite).max() / largest) if largest > 0.0 else None
