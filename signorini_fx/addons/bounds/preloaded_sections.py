"""What preloaded sections add to the strain of a displacement: their sides are apart by a jump that is known.

With the unit vector n across a section and its shortening s the displacement is that of the elements, which is
continuous, less s n in all cells beyond the section; ``loads.jumps`` takes it from the nodes on the section in cells
beyond it that have such nodes, which is the same function but for a continuous one of the elements.  The jump is the
same for all displacements that are compared, so that differences of these are continuous, and the proof is that of a
body without sections with the strain of the jump as a part of each strain, (B15) of docs/bounds.md.

Where a force tightens a section its shortening is an unknown, and the jumps differ.  Then the stress needs to have the
resultant of this force on the section, (B16).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.cell_pieces import pieces_of_cells, rigid_motions
from signorini_fx.addons.bounds.simplices import Simplices
from signorini_fx.mechanics.effects.preload import Preload
from signorini_fx.mechanics.loads.jumps import Jump, jumps_in
from signorini_fx.mechanics.model import Model
from signorini_fx.tuned import SAME_LENGTH, SINGULAR


@dataclass(frozen=True)
class SectionJump:
    """A section that is shortened.

    Attributes:
        moved: J: what a shortening of one adds to the displacement of cells beyond the section, of the elements, zero
            at all nodes but those on the section.
        amount: s, length.
        beyond: which cells of the mesh are beyond it, and have nodes on it, shape (cells,).
        axis: n, shape (d,).
        force: the tension that determines s, force; None: s is given.
    """

    moved: fem.Function
    amount: float
    beyond: npt.NDArray[np.bool_]
    axis: Array
    force: float | None


@dataclass(frozen=True)
class TightenedSection:
    """A section that a force tightens, on simplices.

    Attributes:
        moved: J at the corners of cells, linear between them and zero but in cells beyond the section, shape
            (n, d + 1, d).
        facets: those of the section, shape (m,).
        far: the cell beyond it at each of them, shape (m,).
        axis: n, shape (d,).
        force: the tension, force.
    """

    moved: Array
    facets: Ints
    far: Ints
    axis: Array
    force: float

    @classmethod
    def of(cls, t: Simplices, section: SectionJump, y: Array, beyond: npt.NDArray[np.bool_]) -> TightenedSection:
        """From J at the vertices, shape (v, d), and which cells are beyond it, shape (n,)."""
        assert section.force is not None
        on_it = y @ section.axis < SAME_LENGTH - 1
        moved = np.where((beyond[:, None] & on_it[t.corners])[:, :, None], -section.axis, 0.0)
        inner = np.flatnonzero((t.sides >= 0).all(axis=1) & on_it[t.facets].all(axis=1))
        far = beyond[t.sides[inner]]
        facets, far = inner[far[:, 0] != far[:, 1]], far[far[:, 0] != far[:, 1]]
        return cls(moved, facets, t.sides[facets, far.argmax(axis=1)], section.axis, section.force)


@dataclass(frozen=True)
class MovedCells:
    """What a section adds to the displacement of simplices beyond it, s J, in some of n cells.

    Attributes:
        y: at vertices, and at the middles of edges, length, shapes (v, d) and (e, d).
        middle: see ``y``.
        cells: in which it is added, shape (n,).
    """

    y: Array
    middle: Array
    cells: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class JumpStrain:
    """What sections add to the strain of n cells.

    Attributes:
        strain: at corners, shape (n, d + 1, 3 or 6).
        rounded: squares of the norm of its round-off, energies, shape (n,).
        moved: what each section adds to the displacement.
        tightened: the sections that forces tighten.
    """

    strain: Array
    rounded: Array
    moved: list[MovedCells]
    tightened: list[TightenedSection]


@dataclass(frozen=True)
class LooseMotions:
    """Rigid motions of the parts that sections divide pieces into, which open or close these: k of them.

    Attributes:
        corners: at the corners of cells, shape (n, d + 1, d, k).
        closing: by how much the tightened sections are shortened, shape (sections, k).
        piece: the piece that moves, shape (k,).
    """

    corners: Array
    closing: Array
    piece: Ints

    def on_facets(self, t: Simplices, facets: Ints) -> Array:
        """At the vertices of facets of the boundary, shape (m, d, d, k)."""
        cells = t.sides[facets, 0]
        places = (t.corners[cells][:, None] == t.facets[facets][:, :, None]).argmax(axis=2)
        return np.asarray(self.corners[cells[:, None], places])


def preloaded_sections(model: Model, space: fem.FunctionSpace, step: float) -> list[SectionJump]:
    """Those of a scene that are shortened at a place in the lists of factors, or that a force tightens there."""
    sections = [
        _section(jump, jump.entry.force_at(model.statement, step), space, step)
        for jump in jumps_in(model.statement, model.tagged, space)
        if isinstance(jump.entry, Preload)
    ]
    return [section for section in sections if section.amount != 0 or section.force is not None]


def _section(jump: Jump, force: float | None, space: fem.FunctionSpace, step: float) -> SectionJump:
    moved = fem.Function(space)
    moved.x.array[:] = jump.at_nodes.ravel()
    beyond = np.zeros(len(space.dofmap.list), dtype=bool)
    beyond[jump.cells] = True
    return SectionJump(moved, jump.amount(step), beyond, jump.axis, force)


def loose_motions(t: Simplices, sections: list[TightenedSection], stopped: Array) -> LooseMotions:
    """The rigid motions that supports leave to the parts of each piece, beyond those that move the piece as a whole.

    Parts are joined across a section in all directions but its axis.

    Args:
        t: the cells.
        sections: that forces tighten.
        stopped: projector onto the directions in which each facet is held, shape (f, d, d).
    """
    n, d, kinds = len(t.corners), t.dimension, t.dimension * (t.dimension + 1) // 2
    sides = t.sides.copy()
    for section in sections:
        sides[section.facets, 1] = -1
    part = pieces_of_cells(sides, n)
    stopped_facets = np.flatnonzero(stopped.any(axis=(1, 2)))
    at_corners: list[Array] = [np.zeros((n, d + 1, d, 0))]
    closings: list[Array] = [np.zeros((len(sections), 0))]
    pieces = list[int]()
    for piece in np.unique([t.piece[section.far[0]] for section in sections if len(section.far)]):
        inside = t.piece_of_vertex == piece
        modes = np.zeros((len(t.x), d, kinds))
        modes[inside] = rigid_motions(t.x[inside])
        parts = np.unique(part[t.piece == piece])
        width = len(parts) * kinds + len(sections)
        rows = list[Array]()

        def of_part(cells: Ints, motion: Array, parts: Ints = parts, width: int = width) -> Array:
            """Components of the motions of the parts of m cells from those of one, shape (m, ..., width)."""
            spread = np.zeros((*motion.shape[:-1], width))
            for number, column in enumerate(np.searchsorted(parts, part[cells])):
                spread[number, ..., column * kinds : (column + 1) * kinds] = motion[number]
            return spread

        held = stopped_facets[t.piece[t.sides[stopped_facets, 0]] == piece]
        motion = np.einsum("fij,fajk->faik", stopped[held], modes[t.facets[held]])
        rows.append(of_part(t.sides[held, 0], motion).reshape(-1, width))
        for number, section in enumerate(sections):
            facets = section.facets[t.piece[section.far] == piece]
            far = section.far[t.piece[section.far] == piece]
            near = t.sides[facets].sum(axis=1) - far
            apart = of_part(far, modes[t.facets[facets]]) - of_part(near, modes[t.facets[facets]])
            apart[..., len(parts) * kinds + number] += section.axis
            rows.append(apart.reshape(-1, width))
            if not len(facets):
                rows.append(np.eye(width)[len(parts) * kinds + number][None])
        matrix = np.concatenate(rows)
        values, vectors = np.linalg.eigh(matrix.T @ matrix / len(matrix))
        free = vectors[:, values <= SINGULAR * max(values[-1], 1.0)]
        # Those that shorten no section are motions of the whole piece.
        _, sizes, turned = np.linalg.svd(free[len(parts) * kinds :], full_matrices=False)
        free = free @ turned[sizes > np.sqrt(SINGULAR)].T
        of_cells = np.zeros((n, kinds, free.shape[1]))
        moving = np.flatnonzero(t.piece == piece)
        of_parts = free[: len(parts) * kinds].reshape(len(parts), kinds, -1)
        of_cells[moving] = of_parts[np.searchsorted(parts, part[moving])]
        at_corners.append(np.einsum("ncdj,njk->ncdk", modes[t.corners], of_cells))
        closings.append(free[len(parts) * kinds :])
        pieces += [int(piece)] * free.shape[1]
    corners = np.concatenate(at_corners, axis=3)
    # Of the size of the other free motions, whose components at the vertices have squares with a sum of one.
    size = np.sqrt((corners**2).sum(axis=(0, 1, 2)) / (corners.shape[0] * (d + 1)) * len(t.x))
    return LooseMotions(corners / size, np.concatenate(closings, axis=1) / size, np.array(pieces, dtype=np.int64))
