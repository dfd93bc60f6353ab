"""The moduli of the materials on the mesh: cell by cell if there are several materials, gradings or
axes.

Stress and strain are vectors of the components ``Kinematics.stressed``, with shear strains 2
epsilon_ij.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh

from signorini_fx.arrays import Array, Indices
from signorini_fx.errors import SceneError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.materials.protocol import PAIRS, Material
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import SAME_LENGTH, SAME_NUMBER, ZERO_IN_SOLUTION

# A material parameter on the mesh: a constant for one material, a function for several.
Coefficient = fem.Constant | fem.Function


def check_covers(statement: Statement, tagged: TaggedMesh) -> None:
    """Raise an error if some cells are in no region with a material, or in several; collective."""
    regions = [material.region for material in statement.material]
    if None in regions:  # all of the body
        return
    comm = tagged.mesh.comm
    cells = tagged.mesh.topology.index_map(tagged.mesh.topology.dim)
    covered = np.zeros(cells.size_local + cells.num_ghosts, dtype=np.int32)
    for region in regions:
        covered[tagged.cells(str(region))] += 1
    bare = np.flatnonzero(covered[: cells.size_local] == 0)
    if count := int(parallel.total(comm, bare.size)):
        names = list(statement.bodies)
        names = [
            name for name in names if parallel.any_rank(comm, np.isin(bare, tagged.cells(name)))
        ]
        of_bodies = f" of {' and '.join(map(repr, names))}" if names else ""
        raise SceneError.at(
            "material", f"{count} cells{of_bodies} are in none of the regions that have a material"
        )
    if twice := int(parallel.total(comm, covered[: cells.size_local] > 1)):
        raise SceneError.at(
            "material", f"{twice} cells are in several of the regions that have a material"
        )


def of_materials(
    statement: Statement,
    tagged: TaggedMesh,
    numbers: Callable[[Material, Array | float], tuple[npt.ArrayLike, ...]],
) -> tuple[Coefficient, ...]:
    """Return coefficients from the data of the materials: constants for one material, cell-wise
    functions for several or graded ones; collective.

    Args:
        statement: with the materials.
        tagged: the mesh.
        numbers: returns the numbers of a material, multiplied by the values of its grading in its
            cells.
    """
    mesh = tagged.mesh
    share = graded(statement, tagged)
    of_first = numbers(statement.material[0], 1.0)
    if len(statement.material) == 1 and share is None:
        return tuple(fem.Constant(mesh, default_scalar_type(number)) for number in of_first)
    space = fem.functionspace(mesh, ("DG", 0))
    functions = tuple(fem.Function(space) for _ in of_first)
    for material in statement.material:
        dofs = space.dofmap.list[tagged.cells(material.region), 0]
        values = numbers(material, 1.0 if share is None else share.x.array[dofs])
        for function, value in zip(functions, values, strict=True):
            function.x.array[dofs] = value
    for function in functions:
        function.x.scatter_forward()
    return functions


def lame_coefficients(statement: Statement, tagged: TaggedMesh) -> tuple[Coefficient, Coefficient]:
    """Return the Lame parameters as coefficients, see ``of_materials``; collective."""
    first, second = of_materials(
        statement, tagged, lambda material, share: tuple(share * number for number in material.lame)
    )
    return first, second


def middles(tagged: TaggedMesh, cells: Indices) -> Array:
    """Return the mean of the vertices of each cell, shape (3, n).

    Other nodes are not used, because they depend on how curved cells are interpolated.
    """
    mesh = tagged.mesh
    corners = len(basix.geometry(getattr(basix.CellType, mesh.topology.cell_name())))
    middle = mesh.geometry.x[compat.geometry_cells(mesh)[cells, :corners]].mean(axis=1)
    return np.asarray(middle.T, dtype=np.float64)


def graded(statement: Statement, tagged: TaggedMesh) -> fem.Function | None:
    """Return the factor of the moduli in each cell, above 0 and at most 1; None if no material is
    graded; collective.

    Raises:
        SceneError: a factor is out of range.
    """
    problems = []
    mesh = tagged.mesh
    if all(material.grading is None for material in statement.material):
        return None
    grading = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    grading.x.array[:] = 1.0
    for index, material in enumerate(statement.material):
        if material.grading is None:
            continue
        cells = tagged.cells(material.region)
        values = sample(material.grading, middles(tagged, cells))
        if parallel.any_rank(mesh.comm, not ((values > 0) & (values <= 1 + SAME_NUMBER)).all()):
            bounds = (
                "must be above 0 and at most 1 in the middle of each cell: young is the "
                "largest Young's modulus"
            )
            problems.append((f"material[{index}].grading", bounds))
        grading.x.array[grading.function_space.dofmap.list[cells, 0]] = values
    if problems:
        raise SceneError(problems)
    return grading


def reduced_degree(statement: Statement, mesh: dmesh.Mesh, *, nearly: bool = False) -> int | None:
    """Return the quadrature degree of the volumetric term if it is reduced, else None: Q1/P0,
    P2/P0, Q2 with two points per axis.

    Args:
        statement: with materials and element.
        mesh: the mesh.
        nearly: whether a material is nearly incompressible for another reason than Poisson's ratio,
            such as plastic flow.

    Raises:
        SceneError: reduction is requested for linear triangles or tetrahedra.
    """
    degree = statement.element.degree
    kind = mesh.topology.cell_name()
    has_form = not (degree == 1 and kind in ("triangle", "tetrahedron"))
    volumetric = statement.element.volumetric
    if volumetric == "reduced" and not has_form:
        plane = kind == "triangle"
        cure = "use degree = 2, or quadrilaterals" if plane else "use hexahedra"
        message = f"linear {'triangles' if plane else 'tetrahedra'} have no reduced form: {cure}"
        raise SceneError.at("element.volumetric", message)
    nearly = nearly or any(material.locks for material in statement.material)
    apart = all(material.isotropic for material in statement.material)
    asked = volumetric == "reduced" or (volumetric == "auto" and nearly)
    if not (asked and has_form and apart):
        return None
    return 3 if degree == 2 and kind in ("quadrilateral", "hexahedron") else 1


@dataclass(frozen=True)
class CellwiseStiffness:
    """The elastic stiffness of each cell, with material axes at its midpoint."""

    stiffness: fem.Function  # stresses from strains, see ``Kinematics.stressed``, shape (m, m)
    # Strain of a unit initial strain, 1 in all directions for isotropic expansion, shape (m,).
    free_strain: fem.Function


def cellwise_stiffness(statement: Statement, tagged: TaggedMesh) -> CellwiseStiffness | None:
    """Return the stiffness of each cell; None if all materials are isotropic; collective.

    Raises:
        SceneError: axes are not orthonormal, or a plane body has no plane of symmetry across x[2].
    """
    if all(material.isotropic for material in statement.material):
        return None
    kinematics = statement.kinematics_in(tagged.dimension)
    rows = list(map(PAIRS.index, kinematics.stressed))
    m = len(rows)
    moduli, free = (
        fem.Function(fem.functionspace(tagged.mesh, ("DG", 0, shape))) for shape in ((m, m), (m,))
    )
    at_cells = moduli.x.array.reshape(-1, m, m)
    free_at_cells = free.x.array.reshape(-1, m)
    problems = []
    for number, material in enumerate(statement.material):
        cells = tagged.cells(material.region)
        axes = np.asarray(material.axes(middles(tagged, cells)))
        faults = tagged.mesh.comm.allgather(_fault_of_axes(axes, len(cells), material.words))
        if any(faults):
            problems.append((f"material[{number}]", max(faults)))
            continue
        turned = _turned(axes)
        whole = turned @ material.stiffness @ turned.swapaxes(1, 2)
        off = np.abs(whole[:, [4, 5], :4]).max(initial=0.0) if m < len(PAIRS) else 0.0
        if parallel.any_rank(
            tagged.mesh.comm, bool(off > ZERO_IN_SOLUTION * np.abs(whole).max(initial=0.0))
        ):
            problems.append(
                (
                    f"material[{number}]",
                    "a plane body needs a plane of symmetry: shear across it is not free",
                )
            )
            continue
        # All other stresses are zero, so the compliance is restricted to ``rows`` and inverted; the
        # shears across a plane body are decoupled.
        at_cells[moduli.function_space.dofmap.list[cells, 0]] = np.linalg.inv(
            np.linalg.inv(whole)[:, rows][:, :, rows]
        )
        expansion = np.einsum("nia,a,nja->nij", axes, np.array(material.free_strain), axes)
        strains = np.column_stack([expansion[:, i, j] for i, j in kinematics.stressed])
        free_at_cells[free.function_space.dofmap.list[cells, 0]] = strains
    if problems:
        raise SceneError(problems)
    share = graded(statement, tagged)
    if share is not None:
        at_cells *= share.x.array[:, None, None]
    return CellwiseStiffness(moduli, free)


def _fault_of_axes(axes: Array, count: int, words: str) -> str:
    """Return what is wrong with the axes of ``count`` cells on this rank; "" if nothing is."""
    if axes.shape != (count, 3, 3):
        return f"axes of {words} must have the shape (n, 3, 3) for points of the shape (3, n)"
    if not np.isfinite(axes).all():
        return (
            f"direction and second of {words} must be finite, not zero and not parallel in the "
            "middle of each cell"
        )
    if np.abs(axes.swapaxes(1, 2) @ axes - np.eye(3)).max(initial=0.0) > SAME_LENGTH:
        return f"axes of {words} must be unit vectors at right angles"
    return ""


def _turned(axes: Array) -> Array:
    """Return matrices that rotate stresses from material axes to the coordinate axes, shape (cells,
    6, 6); their transposes rotate strains back (Bond, Bell Syst. Tech. J. 22 (1943) 1).
    """
    bond_matrices = np.empty((len(axes), 6, 6))
    for p, (i, j) in enumerate(PAIRS):
        for q, (a, b) in enumerate(PAIRS):
            bond_matrices[:, p, q] = axes[:, i, a] * axes[:, j, b] + (
                axes[:, i, b] * axes[:, j, a] if a != b else 0
            )
    return bond_matrices
