"""The residual F at values of the displacement, with the material's state there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.forms.nonlinear.inversion import InsideOut
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import assemble

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

    @property
    def has_state(self) -> bool:
        """Whether the material may have a state that ``update`` finds."""
        return self.update is not None

    @cached_property
    def _inside_out(self) -> InsideOut:
        return InsideOut(self.u)

    def assembled(self) -> Array:
        """F less the loads at ``u`` as it is, at the owned unknowns; collective."""
        return np.asarray(assemble(self.form) - self.loads)

    def at(self, values: Array) -> Array | None:
        """F at the owned unknowns for values of ``u``, which it gets; None: it is not finite there, or cells are turned
        inside out; collective.

        Args:
            values: of all unknowns of this rank, ghosts included, shape (dofs,).

        Raises:
            FormError: ``update`` has raised an exception.
        """
        self.go_to(values)
        forces = self.assembled()
        comm = self.u.function_space.mesh.comm
        if parallel.any_rank(comm, not np.isfinite(forces).all()) or self._inside_out.found():
            return None
        return forces

    def go_to(self, values: Array) -> None:
        """Give ``u`` values, and the material its state there; for the arguments and errors see ``at``; collective."""
        self.u.x.array[:] = values
        self.updated()

    def updated(self) -> None:
        """Call ``update``; collective.

        Raises:
            FormError: it has raised an exception on some rank.
        """
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
