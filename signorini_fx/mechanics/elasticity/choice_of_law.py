"""Which elastic law a scene has, and that of materials that are not isotropic: by the stiffness in each cell.

Stress and strain are vectors of the components ``Kinematics.pairs``, of shear strains twice epsilon_ij.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.errors import SceneError, together
from signorini_fx.machine import parallel
from signorini_fx.mechanics.elasticity.elastic_law import ElementStress, IsotropicLaw, SceneLaw, cellwise_stress
from signorini_fx.mechanics.elasticity.moduli import check_covers, graded, lame_coefficients, middles, reduced_degree
from signorini_fx.mechanics.materials.protocol import PAIRS, Array
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import SAME_LENGTH, ZERO_IN_SOLUTION


@dataclass(frozen=True)
class CellwiseStiffness:
    """The stiffness of all cells, with the axes in their middle.

    Attributes:
        stiffness: stresses, of plane strain with a last row for that out of the plane, from strains, shape (rows, m).
        of_free_strain: the stress that takes an initial strain back which is one where a material expands alike in all
            directions, shape (rows,).
        free_energy: the energy per volume of that stress, of a strain of one.
    """

    stiffness: fem.Function
    of_free_strain: fem.Function
    free_energy: fem.Function

    def stress(self, strain: Any, initial: Any = None) -> list[Any]:
        """Its components, of strains as a vector and initial strains, UFL."""
        rows = range(self.stiffness.ufl_shape[0])
        stress = [ufl.dot(self.stiffness[k, :], strain) for k in rows]
        return stress if initial is None else [stress[k] - initial * self.of_free_strain[k] for k in rows]


def cellwise_stiffness(statement: Statement, tagged: TaggedMesh) -> CellwiseStiffness | None:
    """That of a scene; None: all of its materials are isotropic; collective.

    Raises:
        SceneError: the axes have no direction in some cell; or a plane body would not stay plane.
    """
    if all(material.isotropic for material in statement.material):
        return None
    kinematics = statement.kinematics_in(tagged.dimension)
    columns, rows = (list(map(PAIRS.index, pairs)) for pairs in (kinematics.pairs, kinematics.stressed))
    across = [k for k in range(len(PAIRS)) if k not in columns]
    moduli, free, energy = (
        fem.Function(fem.functionspace(tagged.mesh, ("DG", 0, shape)))
        for shape in ((len(rows), len(columns)), (len(rows),), ())
    )
    at_cells, free_at_cells = moduli.x.array.reshape(-1, len(rows), len(columns)), free.x.array.reshape(-1, len(rows))
    problems = []
    for number, material in enumerate(statement.material):
        if material.region is not None and material.region not in tagged.regions:
            continue  # which is reported elsewhere
        cells = tagged.cells(material.region)
        axes = np.asarray(material.axes(middles(tagged, cells)))
        faults = tagged.mesh.comm.allgather(_fault_of_axes(axes, len(cells), material.words))
        if any(faults):
            problems.append((f"material[{number}]", max(faults)))
            continue
        turned = _turned(axes)
        whole = turned @ material.stiffness @ turned.swapaxes(1, 2)
        off = np.abs(whole[:, [4, 5], :4]).max(initial=0.0) if len(columns) < len(PAIRS) else 0.0
        if parallel.any_rank(tagged.mesh.comm, bool(off > ZERO_IN_SOLUTION * np.abs(whole).max(initial=0.0))):
            problems.append(
                (f"material[{number}]", "a plane body needs a plane of symmetry: shear across it is not free")
            )
            continue
        stress = turned @ (material.stiffness[:, :3] @ np.array(material.free_strain))
        stiffness, free_stress = whole[:, rows][:, :, columns], stress[:, rows]
        if kinematics.directions == 2:
            stiffness = np.linalg.inv(np.linalg.inv(whole)[:, rows][:, :, columns])
            held = whole[:, rows][:, :, across] @ np.linalg.inv(whole[:, across][:, :, across])
            free_stress = free_stress - np.einsum("nij,nj->ni", held, stress[:, across])
        at_cells[moduli.function_space.dofmap.list[cells, 0]] = stiffness
        free_at_cells[free.function_space.dofmap.list[cells, 0]] = free_stress
        free_strain = np.einsum("nia,a,nja->nij", axes, np.array(material.free_strain), axes)
        components = np.column_stack([free_strain[:, i, j] * (1 if i == j else 2) for i, j in kinematics.stressed])
        energy.x.array[energy.function_space.dofmap.list[cells, 0]] = np.sum(free_stress * components, axis=1) / 2
    if problems:
        raise SceneError(problems)
    share = graded(statement, tagged)
    if share is not None:
        at_cells *= share.x.array[:, None, None]
        free_at_cells *= share.x.array[:, None]
        energy.x.array[:] *= share.x.array
    return CellwiseStiffness(moduli, free, energy)


def _fault_of_axes(axes: Array, count: int, words: str) -> str:
    """What is wrong with the axes of ``count`` cells on this rank; "": nothing."""
    if axes.shape != (count, 3, 3):
        return f"axes of {words} must have the shape (n, 3, 3) for points of the shape (3, n)"
    if not np.isfinite(axes).all():
        return f"direction and second of {words} must be finite, not zero and not parallel in the middle of each cell"
    if np.abs(axes.swapaxes(1, 2) @ axes - np.eye(3)).max(initial=0.0) > SAME_LENGTH:
        return f"axes of {words} must be unit vectors at right angles"
    return ""


def _turned(axes: Array) -> Array:
    """The components of a stress from those along the axes, shape (cells, 6, 6) (W. L. Bond, Bell Syst. Tech. J. 22
    (1943) 1-72); its transpose turns the strain back.
    """
    bond_matrices = np.empty((len(axes), 6, 6))
    for p, (i, j) in enumerate(PAIRS):
        for q, (a, b) in enumerate(PAIRS):
            bond_matrices[:, p, q] = axes[:, i, a] * axes[:, j, b] + (axes[:, i, b] * axes[:, j, a] if a != b else 0)
    return bond_matrices


@dataclass(frozen=True)
class CellwiseLaw(SceneLaw):
    """By the stiffness of each cell."""

    stiffness: CellwiseStiffness = field(kw_only=True)

    def terms(self, y: Any, z: Any) -> tuple[Any, ...]:
        first, second = self._components(y), self._components(z)
        stress = ufl.as_vector(self.stiffness.stress(first)[: len(first)])
        return (self._integral(ufl.inner(stress, second), self.degree),)

    def strain_terms(self, z: Any, strain: Any, degree: int) -> tuple[Any, ...]:
        test = self._components(z)
        stress = ufl.as_vector([self.stiffness.of_free_strain[k] for k in range(len(test))])
        return (self._integral(strain * ufl.inner(stress, test), degree),)

    def free_terms(self, strain: Any, degree: int) -> tuple[Any, ...]:
        return (self._integral(self.stiffness.free_energy * strain**2, degree),)

    def _components(self, y: Any, *, on_axis: bool = False) -> Any:
        """The components of the strain as a vector, UFL; ``on_axis``: see ``Kinematics.strain``."""
        epsilon = self.kinematics.strain(y, on_axis=on_axis)
        return ufl.as_vector([epsilon[i, j] * (1 if i == j else 2) for i, j in self.kinematics.pairs])

    def stress(self, y: fem.Function, moved: Any, initial: Any) -> ElementStress:
        kinematics, dim = self.kinematics, len(y)
        components = self.stiffness.stress(self._components(moved, on_axis=True), initial)
        at = {pair: k for k, (i, j) in enumerate(kinematics.stressed) for pair in ((i, j), (j, i))}
        sigma = ufl.as_matrix([[components[at[i, j]] for j in range(dim)] for i in range(dim)])
        outward = components[at[2, 2]] if dim == 2 and (2, 2) in at else None
        m = len(kinematics.pairs)
        moduli = self.stiffness.stiffness.x.array.reshape(-1, *self.stiffness.stiffness.ufl_shape)[:, :m]
        return cellwise_stress(y, kinematics, sigma, outward, moduli, self.lame[1])


# Lame parameters, the stiffness of each cell, and the degree of the reduced term, see ``SceneLaw``.
Moduli = tuple[tuple[Any, Any], CellwiseStiffness | None, int | None]


def moduli_of(statement: Statement, tagged: TaggedMesh) -> Moduli:
    """Those of the materials of a scene on its mesh; collective.

    Raises:
        SceneError: with all that the mesh reveals of them, see the functions below.
    """
    lame, stiffness, reduced, _ = together(
        partial(lame_coefficients, statement, tagged),
        partial(cellwise_stiffness, statement, tagged),
        partial(reduced_degree, statement, tagged.mesh),
        partial(check_covers, statement, tagged),
    )
    return lame, stiffness, reduced


def elastic_law(
    statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace, moduli: Moduli | None = None
) -> SceneLaw:
    """That of a scene on its mesh; ``moduli``: those of the scene, None if they are to be computed; collective."""
    lame, stiffness, reduced = moduli or moduli_of(statement, tagged)
    if statement.element.pressed:
        from signorini_fx.mechanics.elasticity.mixed_pressure import MixedLaw

        return MixedLaw(statement, tagged, space, lame=lame)
    if stiffness is not None:
        return CellwiseLaw(statement, tagged, space, lame=lame, stiffness=stiffness)
    return IsotropicLaw(statement, tagged, space, reduced, lame=lame)
