"""The residual F at values of the displacement, with the material's state there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import assemble, determinants
from signorini_fx.mechanics.body.deformation import CellSlopes

Array = npt.NDArray[np.float64]


@dataclass
class Residual:
    """F, and what a user's function does before it is assembled.

    Attributes:
        form: F, compiled.
        u: the displacement that it depends on.
        update: the user's function; None: the material has no state.
        loads: forces on the body beside F, at the owned unknowns, shape (owned dofs,); a number: the same at all.
    """

    form: fem.Form
    u: fem.Function
    update: Callable[[], object] | None
    loads: Array | float = 0.0
    _slopes: CellSlopes | None = field(default=None, init=False)  # of the mesh where it is

    @property
    def has_state(self) -> bool:
        """Whether the material may have a state that ``update`` finds."""
        return self.update is not None

    def assembled(self) -> Array:
        """F less the loads at ``u`` as it is, at the owned unknowns; collective."""
        return np.asarray(assemble(self.form) - self.loads)

    def at(self, values: Array) -> Array | None:
        """F at the owned unknowns for values of ``u``, ghosts included, which it gets; None: it is not finite there, or
        cells are turned inside out; collective.

        Raises FormError: ``update`` has raised an exception.
        """
        self.go_to(values)
        forces = self.assembled()
        fails = not np.isfinite(forces).all() or self._turned_inside_out()
        return None if parallel.any_rank(self.u.function_space.mesh.comm, fails) else forces

    def _turned_inside_out(self) -> bool:
        """Whether det(I + grad u) is not positive at a quadrature point of some cell of this rank, in the plane of
        sections.
        """
        space = self.u.function_space
        if self._slopes is None or not self._slopes.fits:
            cell, degree = space.mesh.topology.cell_name(), space.element.basix_element.degree
            self._slopes = CellSlopes(space, basix.make_quadrature(getattr(basix.CellType, cell), 2 * degree)[0])
        # The determinant of the product I + grad u = (x + u)' / x', with derivatives along the reference cell.
        return any(
            bool((determinants(place + moved[: len(place)]) * np.sign(determinants(place)) <= 0).any())
            for place, moved in self._slopes.along_reference(self.u)
        )

    def go_to(self, values: Array) -> None:
        """Give ``u`` values, and the material its state there; for the arguments and errors see ``at``; collective."""
        self.u.x.array[:] = values
        self.updated()

    def updated(self) -> None:
        """Call ``update``; a FormError says that it has raised an exception on some rank; collective."""
        if self.update is None:
            return
        error: Exception | None = None
        try:
            self.update()
        except Exception as raised:  # whatever a user's function may raise
            error = raised
        named = None if error is None else FormError([("update", f"raised {type(error).__name__}: {error}")])
        try:
            parallel.raise_together(self.u.function_space.mesh.comm, named)
        except FormError as failed:
            raise failed from error
