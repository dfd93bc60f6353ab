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
from signorini_fx.mechanics.loads.initial_strains import initial_strain, total_jump
from signorini_fx.mechanics.model import Model

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ElementStress(LawStress):
    """The stress of a displacement as UFL, linear in the strain, and what follows from its law.

    Attributes:
        displacement: y, whose values may change.
        parts: the cells of each part within which the stress has no jumps, local numbers, ghosts included.
        kinematics: of the displacement.
        move: takes jumps and initial strains to a place in the lists of factors.
    """

    displacement: fem.Function
    parts: Sequence[npt.NDArray[np.int32]]
    kinematics: Kinematics
    move: Callable[[float], None] = lambda place: None

    def refresh(self, step: float) -> None:
        """Take from the displacement anew what ``sigma`` does not see of it, on all cells of this rank, at a place."""
        self.move(step)
        for function, expression in self.interpolated:
            function.interpolate(expression)

    @property
    def around(self) -> Any:
        """By what areas and lengths of the mesh are multiplied, see ``Kinematics.measure``."""
        return self.kinematics.measure(position(self.displacement))

    @property
    def components(self) -> Any:
        """The components of sigma, see ``Kinematics.pairs``, and that out of the plane where it is none of them."""
        pairs = self.kinematics.pairs
        beyond = [] if self.outward is None or (2, 2) in pairs else [self.outward]
        return ufl.as_vector([*(self.in_space[pair] for pair in pairs), *beyond])

    def squared(self, difference: Any, times: Any, dx: Any) -> Any:
        """The form of C^-1 tau : tau for a difference of stresses, its ``components``, times a factor."""
        within = ufl.as_vector([difference[k] for k in range(len(self.kinematics.pairs))])
        return times * self.compliance(within) * self.around * dx

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
    """That of a scene with the initial strains of a place in the lists of factors; collective."""
    initial, move_to = initial_strain(body.statement, body.tagged, body.space, step)
    jump, jump_to = total_jump(body.statement, body.tagged, body.space)

    def move(step: float) -> None:
        move_to(step)
        jump_to(step)

    of_law = body.elastic.stress(displacement, displacement if jump is None else displacement + jump, initial)
    parts = [body.tagged.cells(material.region) for material in body.statement.material]
    of_body = dict[str, Any](displacement=displacement, parts=parts, kinematics=body.kinematics, move=move)
    stress = ElementStress(**vars(of_law), **of_body)
    stress.refresh(step)
    return stress
