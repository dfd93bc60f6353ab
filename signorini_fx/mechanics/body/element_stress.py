"""The stress that the elements work with: everything that shows or judges a stress takes it from here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from signorini_fx.mechanics.elasticity.elastic_law import LawStress
from signorini_fx.mechanics.kinematics.protocol import Kinematics, position
from signorini_fx.mechanics.loads.initial_strains import initial_strain
from signorini_fx.mechanics.loads.jumps import total_jump
from signorini_fx.mechanics.model import Model

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ElementStress:
    """The stress of a displacement as UFL, linear in the strain, and what follows from its law.

    Attributes:
        displacement: y, whose values may change.
        sigma: the stress, shape (d, d); of the displacement at the time of the last ``refresh``.
        outward: the stress out of the plane; None: there is none.
        outward_of: (which of ``parts``, components of stresses at the vertices of its cells, shape (c, v, m)) -> the
            stress out of the plane that belongs to them, shape (c, v).
        compliance: components tau of a difference of stresses -> C^-1 tau : tau.
        modulus: the largest normal stress per strain, lambda + 2 mu.
        shear_modulus: mu, the mean one of an orthotropic material; None: the body is not known to be isotropic.
        parts: the cells of each part within which the stress has no jumps, local numbers, ghosts included.
        kinematics: of the displacement.
        refresh: takes from the displacement anew what ``sigma`` does not see of it, on all cells of this rank, and
            moves initial strains to a place in the lists of factors.
    """

    displacement: fem.Function
    sigma: Any
    outward: Any
    outward_of: Callable[[int, _Floats], _Floats]
    compliance: Callable[[Any], Any]
    modulus: Any
    shear_modulus: Any
    parts: Sequence[npt.NDArray[np.int32]]
    kinematics: Kinematics
    refresh: Callable[[float], None] = lambda place: None

    @property
    def around(self) -> Any:
        """By what areas and lengths of the mesh are multiplied, see ``Kinematics.measure``."""
        return self.kinematics.measure(position(self.displacement))

    @property
    def components(self) -> Any:
        """The components of sigma, see ``Kinematics.pairs``."""
        return self.kinematics.components(self.in_space)

    def squared(self, difference: Any, times: Any, dx: Any) -> Any:
        """The form of C^-1 tau : tau for a difference of stresses, its components, times a factor."""
        return times * self.compliance(difference) * self.around * dx

    @property
    def in_space(self) -> Any:
        """Sigma with all components in 3D, shape (3, 3)."""
        dim = self.kinematics.dimension
        out = 0 * self.sigma[0, 0] if self.outward is None else self.outward
        components = [[self.sigma[i, j] if max(i, j) < dim else 0 * out for j in range(3)] for i in range(3)]
        if dim < 3:
            components[2][2] = out
        return ufl.as_tensor(components)


def element_stress(body: Model, displacement: fem.Function, step: float = 0.0) -> ElementStress:
    """That of a scene, by the law of its body; collective.

    Args:
        body: the scene.
        displacement: y.
        step: the place of the initial strains in the lists of factors.
    """
    initial, move_to = initial_strain(body.statement, body.tagged, body.space, step)
    jump, jump_to = total_jump(body.statement, body.tagged, body.space)

    def move(step: float) -> None:
        move_to(step)
        jump_to(step)

    move(step)
    of_law = body.elastic.stress(displacement, displacement if jump is None else displacement + jump, initial)
    stress = stress_by(of_law, displacement, cells_of_materials(body), body.kinematics, move)
    stress.refresh(step)
    return stress


def stress_by(
    of_law: LawStress,
    y: fem.Function,
    parts: Sequence[npt.NDArray[np.int32]],
    kinematics: Kinematics,
    move: Callable[[float], None] = lambda place: None,
) -> ElementStress:
    """The stress of a displacement y by its law.

    Args:
        of_law: the stress.
        y: see ``ElementStress``.
        parts: see ``ElementStress``.
        kinematics: see ``ElementStress``.
        move: takes jumps and initial strains to a place in the lists of factors.
    """
    sigma, axes, prevented = of_law.sigma, range(len(y)), of_law.prevented
    if sigma.ufl_shape[0] > len(y):
        sigma = ufl.as_matrix([[sigma[i, j] for j in axes] for i in axes])

    def refresh(step: float) -> None:
        move(step)
        for function, expression in (*of_law.interpolated, *(() if prevented is None else (prevented,))):
            function.interpolate(expression)

    def outward_of(part: int, tau: _Floats) -> _Floats:
        if of_law.out_of_plane is None:
            return tau[..., kinematics.pairs.index((2, 2))]
        out_of_plane = of_law.out_of_plane(part, parts[part], tau)
        if prevented is not None:
            out_of_plane -= prevented[0].x.array[prevented[0].function_space.dofmap.list[parts[part]]]
        return out_of_plane

    return ElementStress(
        y,
        sigma,
        of_law.outward,
        outward_of,
        of_law.compliance,
        of_law.modulus,
        of_law.shear_modulus,
        parts,
        kinematics,
        refresh,
    )


def cells_of_materials(model: Model) -> list[npt.NDArray[np.int32]]:
    """The cells of each material, ghosts included."""
    if len(model.statement.material) > 1:
        return [model.tagged.cells(str(material.region)) for material in model.statement.material]
    index_map = model.tagged.mesh.topology.index_map(model.tagged.dimension)
    return [np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)]
