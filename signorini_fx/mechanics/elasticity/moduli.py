"""The numbers of the materials on the mesh: cell by cell where there are several."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh

from signorini_fx.errors import SceneError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.settings import treatment_of
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import SAME_NUMBER

_BOUNDS = {
    "grading": "must be above 0 and at most 1 in the middle of each cell: young is the largest Young's modulus",
    "poisson_grading": "must be from 0 to 1 in the middle of each cell: poisson is the largest Poisson's ratio",
}


def check_covers(statement: Statement, tagged: TaggedMesh) -> None:
    """Of several materials ``of_materials`` knows it; one material with a region must not be that of other cells too.

    Raises:
        SceneError: the only material has a region, in which some cells are not.
    """
    region, owned_cells = (
        statement.material[0].region,
        tagged.mesh.topology.index_map(tagged.mesh.topology.dim).size_local,
    )
    if len(statement.material) == 1 and region in tagged.regions:
        _check_bare(statement, tagged, np.setdiff1d(np.arange(owned_cells), tagged.cells(str(region))))


def _check_bare(statement: Statement, tagged: TaggedMesh, bare: npt.NDArray[Any]) -> None:
    """Refuse cells of this rank without a material, and name the bodies that they are of; collective."""
    comm = tagged.mesh.comm
    count = int(parallel.global_sum(comm, np.array(bare.size)))
    if not count:
        return
    names = list(statement.bodies)
    names = [name for name in names if parallel.any_rank(comm, bool(np.isin(bare, tagged.cells(name)).any()))]
    of_bodies = f" of {' and '.join(map(repr, names))}" if names else ""
    raise SceneError([("material", f"{count} cells{of_bodies} are in none of the regions that have a material")])


def of_materials(
    statement: Statement, tagged: TaggedMesh, numbers: Callable[[Any], tuple[float, ...]]
) -> tuple[Any, ...]:
    """Numbers of the materials: constants for one material, cell-wise functions for several.

    Raises:
        SceneError: a cell is in no region that has a material, or in several.
    """
    mesh = tagged.mesh
    if len(statement.material) == 1:
        return tuple(fem.Constant(mesh, default_scalar_type(number)) for number in numbers(statement.material[0]))
    space = fem.functionspace(mesh, ("DG", 0))
    functions = tuple(fem.Function(space) for _ in numbers(statement.material[0]))
    covered = np.zeros(space.dofmap.list.shape[0], dtype=np.int32)
    named = [material for material in statement.material if material.region in tagged.regions]
    if len(named) < len(statement.material):  # which is reported elsewhere
        return functions
    for material in named:
        assert material.region is not None
        dofs = space.dofmap.list[tagged.cells(material.region), 0]
        covered[dofs] += 1
        for function, value in zip(functions, numbers(material), strict=True):
            function.x.array[dofs] = value
    owned = covered[space.dofmap.list[: space.dofmap.index_map.size_local, 0]]
    _check_bare(statement, tagged, np.flatnonzero(owned == 0))
    if twice := int(parallel.global_sum(mesh.comm, np.array(np.sum(owned > 1)))):
        raise SceneError([("material", f"{twice} cells are in several of the regions that have a material")])
    for function in functions:
        function.x.scatter_forward()
    return functions


def lame_coefficients(statement: Statement, tagged: TaggedMesh) -> tuple[Any, Any]:
    """Lame parameters: constants for one material, cell-wise functions for several and for graded ones; collective.

    Raises:
        SceneError: see ``of_materials``; a grading is not between 0 and 1.
    """
    if any(_grading(material, "poisson_grading") is not None for material in statement.material):
        with np.errstate(divide="ignore"):  # lambda is infinite for nu = 1/2, which a pressure does not use
            first, second = isotropic(statement, tagged, statement.material[0].lame_of)
        return first, second
    share = graded(statement, tagged, "grading")
    first, second = of_materials(statement, tagged, lambda material: material.lame)
    return (first, second) if share is None else (_times(first, share), _times(second, share))


def isotropic(
    statement: Statement, tagged: TaggedMesh, numbers: Callable[[Any, Any], tuple[Any, ...]]
) -> tuple[Any, ...]:
    """Numbers that follow from Young's modulus and Poisson's ratio, like ``of_materials``; collective.

    Args:
        statement: what is stated of the problem.
        tagged: its mesh.
        numbers: of both, which are floats or arrays.

    Raises:
        SceneError: see ``lame_coefficients``.
    """
    shares = [graded(statement, tagged, key) for key in ("grading", "poisson_grading")]
    space = next((share.function_space for share in shares if share is not None), None)
    if space is None:
        return of_materials(statement, tagged, lambda material: numbers(material.young, material.poisson))
    moduli = of_materials(statement, tagged, lambda material: (material.young, material.poisson))
    values = numbers(
        *(
            _values(modulus) * (1.0 if share is None else share.x.array)
            for modulus, share in zip(moduli, shares, strict=True)
        )
    )
    functions = tuple(fem.Function(space) for _ in values)
    for function, value in zip(functions, values, strict=True):
        function.x.array[:] = value
    return functions


def poisson_of(material: Any, tagged: TaggedMesh, cells: npt.NDArray[np.int32]) -> Any:
    """Poisson's ratio of cells of a material: a number, or one of each where it varies, shape (cells,)."""
    if (grading := _grading(material, "poisson_grading")) is None:
        return material.poisson
    return material.poisson * _in_the_middle(grading, tagged, cells)


def _grading(material: Any, key: str) -> Any:
    """That of a modulus, which materials that are not isotropic may not have."""
    return getattr(material, key, None)


def middles(tagged: TaggedMesh, cells: npt.NDArray[np.int32]) -> npt.NDArray[np.float64]:
    """The middles of the corners of cells, whose other nodes depend on how curves are drawn, shape (3, n)."""
    mesh = tagged.mesh
    corners = len(basix.geometry(getattr(basix.CellType, mesh.topology.cell_name())))
    middle = mesh.geometry.x[compat.geometry_cells(mesh)[cells, :corners]].mean(axis=1)
    return np.asarray(middle.T, dtype=np.float64)


def _in_the_middle(value: Any, tagged: TaggedMesh, cells: npt.NDArray[np.int32]) -> npt.NDArray[np.float64]:
    return sample(value, middles(tagged, cells))


def graded(statement: Statement, tagged: TaggedMesh, key: str) -> fem.Function | None:
    """By what a modulus is multiplied in each cell; None: by nothing."""
    problems, mesh = [], tagged.mesh
    if all(_grading(material, key) is None for material in statement.material):
        return None
    grading = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    grading.x.array[:] = 1.0
    for index, material in enumerate(statement.material):
        value = _grading(material, key)
        if value is None or (material.region is not None and material.region not in tagged.regions):
            continue  # the latter is reported elsewhere
        cells = tagged.cells(material.region)
        values = _in_the_middle(value, tagged, cells)
        pressed = treatment_of(statement).pressed
        least = values > 0 if key == "grading" or pressed else values >= 0
        if parallel.any_rank(mesh.comm, not (least & (values <= 1 + SAME_NUMBER)).all()):
            bounds = _BOUNDS[key].replace("from 0 to 1", "above 0 and at most 1") if pressed else _BOUNDS[key]
            problems.append((f"material[{index}].{key}", bounds))
        grading.x.array[grading.function_space.dofmap.list[cells, 0]] = values
    if problems:
        raise SceneError(problems)
    return grading


def _times(modulus: fem.Constant | fem.Function, share: fem.Function) -> fem.Function:
    product = fem.Function(share.function_space)
    product.x.array[:] = share.x.array * _values(modulus)
    return product


def _values(modulus: fem.Constant | fem.Function) -> Any:
    return modulus.x.array.copy() if isinstance(modulus, fem.Function) else float(modulus.value)


def reduced_degree(statement: Statement, mesh: dmesh.Mesh) -> int | None:
    """Quadrature degree of the volumetric term where it is reduced: Q1/P0, P2/P0, Q2 with two points per axis."""
    degree, kind = statement.element.degree, mesh.topology.cell_name()
    has_form = not (degree == 1 and kind in ("triangle", "tetrahedron"))
    requested = treatment_of(statement).reduced
    if requested and not has_form:
        plane = kind == "triangle"
        cure = "use degree = 2, or quadrilaterals" if plane else "use hexahedra"
        message = f"linear {'triangles' if plane else 'tetrahedra'} have no reduced form: {cure}"
        raise SceneError([("element.volumetric", message)])
    nearly = any(material.locks for material in statement.material)
    apart = all(material.isotropic for material in statement.material)
    if requested is False or not has_form or not apart or (requested is None and not nearly):
        return None
    return 3 if degree == 2 and kind in ("quadrilateral", "hexahedron") else 1
