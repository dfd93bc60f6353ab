"""The contact problem of one iteration of Newton's method, for the whole displacement y.

    a(y, z) = a(u, z) - F(u; z),    a = F'(u) - lambda Hess phi + what turns the shear,

with the gaps and normals of the shapes at X + u.  The right-hand side is assembled from a and F as they are compiled:
a form a(u, .) - F(u; .) would get a quadrature degree of its own, and Newton's method the residual of that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.algorithms.task import Outcome
from signorini_fx.body.assembly import assemble
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.elastic import ElasticBody
from signorini_fx.body.foundations import Foundations
from signorini_fx.body.nodal_stiffness import NodalStiffness
from signorini_fx.forms.contact_problem import ContactProblem
from signorini_fx.forms.elasticity import MatrixError, MatrixFault, elastic_body
from signorini_fx.linalg.factorisation import enough_memory, factor_memory
from signorini_fx.records import Status
from signorini_fx.results.certificate import Certificate
from signorini_fx.results.promised_law import Law, PreviousStep
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.results.step_frames import LastSolution
from signorini_fx.scales import Scales

Array = npt.NDArray[np.float64]


class MovingFoundations(Foundations):
    """Foundations whose shapes are seen from displaced points.

    Attributes:
        motion: how far the shapes have moved at the contact points.
    """

    motion: Callable[[ContactBoundary], Array | None]

    def moved(self, boundary: ContactBoundary) -> Array | None:
        """See ``Foundations``."""
        return self.motion(boundary)


@dataclass(frozen=True)
class LinearSolution:
    """The last solution of the linearised problem; None: there is none.

    Attributes:
        state: the contact points.
        outcome: how it was reached.
        begins: where the next solve may begin.
    """

    state: ContactState | None
    outcome: Outcome | None
    begins: LastSolution | None


class LinearisedProblem(ContactProblem):
    """The contact problem of one iteration.

    Args:
        tangent: F', a compiled form.
        residual: F, a compiled form.
        at: the displacement where both are evaluated.
        bcs, contact, settings: see ``ContactProblem``.

    Attributes:
        curvature: what the shapes add to the tangent.
    """

    _foundations_class = MovingFoundations
    _foundations: MovingFoundations

    def __init__(
        self, tangent: fem.Form, residual: fem.Form, at: fem.Function, bcs: Any, contact: Any, **settings: Any
    ) -> None:
        super().__init__(tangent, residual, bcs, contact, fem.Function(at.function_space), **settings)
        self._at, self._definite = at, True
        self.curvature = NodalStiffness.none(at.function_space.mesh.geometry.dim)

    def begin(
        self,
        motion: Callable[[ContactBoundary], Array | None],
        spin: Callable[[ContactBoundary], Array | None],
    ) -> None:
        """Take the motion of shapes from here, and their rotations."""
        self._foundations.motion, self._spin_of = motion, spin

    # --- what a ContactProblem asks for ---

    def _body(self, fixed: npt.NDArray[np.bool_], boundary: ContactBoundary) -> ElasticBody:
        """See ``ContactProblem``: a tangent that is not definite is factorised whole.  Its contact problem may have no
        solution: then a smaller increment of the load is what helps, not another method.
        """
        indefinite = {"linear_algebra": "full", "fallbacks": False}
        settings = self.settings if self._definite else self.settings.model_copy(update=indefinite)
        beside = {"beside": self.curvature, "definite": self._definite}
        return elastic_body(self._space, self._a, self.bcs, fixed, boundary, settings, **beside)

    def _forces(self) -> Array:
        """See ``ContactProblem``."""
        return self._elastic.forces_of(self._at) - assemble(self._L)

    def _beside(self) -> Sequence[npt.NDArray[Any]]:
        """See ``ContactProblem``."""
        return self.curvature.nodes, self.curvature.blocks

    def _spin(self, boundary: ContactBoundary) -> Array | None:
        """See ``ContactProblem``."""
        return self._spin_of(boundary)

    def _judged(self, outcome: Outcome) -> Certificate | None:
        """None: the solution of the nonlinear problem gets one."""
        return None

    # --- one iteration ---

    def solve_anew(self) -> None:
        """``solve``, the first time for a load: the tangent is definite until a factorisation refuses it."""
        self._definite = True
        self.solve()

    def solve(self) -> fem.Function:
        """See ``ContactProblem``; a tangent that Cholesky's factorisation refuses is factorised as LDL^T."""
        try:
            return super().solve()
        except MatrixError as error:
            if error.fault is not MatrixFault.NOT_POSITIVE:
                raise
        except ConvergenceError:
            if not self._definite or self.status not in (Status.SINGULAR, Status.LINEAR_SOLVER):
                raise
        self._definite, self._last_pattern = False, None
        self.history.add("the tangent is not positive definite: it is factorised as LDL^T")
        return super().solve()

    def internal(self, displacement: fem.Function) -> tuple[Array, Array]:
        """What a(d, .) and the curvature alone are, shapes (owned dofs,); collective."""
        return self._elastic.forces_of(displacement), self.curvature.times(displacement)

    @property
    def solved(self) -> LinearSolution:
        """The last one."""
        return LinearSolution(self._state, self._outcome, self._solution)

    def go_back(self, solution: LinearSolution) -> None:
        """Make an earlier solution the last one; the next solve assembles anew."""
        self._state, self._outcome, self._solution = solution.state, solution.outcome, solution.begins
        self._last_pattern, self.curvature = None, NodalStiffness.none(self._at.function_space.mesh.geometry.dim)

    # --- what the certificate and the verdict on stability ask for ---

    @property
    def prescribed(self) -> tuple[npt.NDArray[np.bool_], Array]:
        """Which unknowns of this rank are prescribed, ghosts included, and to what, shapes (dofs,)."""
        return self._prescribed

    @property
    def scales(self) -> Scales:
        """Of lengths and stresses."""
        return self._scales

    @property
    def foundations(self) -> tuple[Any, Any, Any]:
        """Their data at the nodes, what the user gave, and their facets."""
        return self._data, self.contact, self._named[0]

    @property
    def nodal_values(self) -> Any:
        """Of the foundations: a callable for each that evaluates at its nodes."""
        return self._foundations._values

    def check_shape(self, number: int, shape: Any) -> None:
        """See ``Foundations``."""
        self._foundations.check_shape(number, shape)

    @property
    def law(self) -> Law:
        """That the last solution keeps to."""
        assert self._outcome is not None
        return Law(*self._task.promised(self._outcome))

    @property
    def before(self) -> PreviousStep | None:
        """The end of the last step, with shears along the foundations as they are now.

        Before the first one, if the shapes have moved, the body at rest.
        """
        return self._previous_step

    @property
    def held(self) -> Array:
        """The directions that contact holds at each contact point, zero where it holds none, shape (n, d, d)."""
        assert self._outcome is not None
        boundary, sets = self.state.boundary, self._outcome.problem.sets
        rough = np.array([entry.friction is not None or entry.bonded for entry in self.contact])[boundary.part]
        sticks = sets.contact & ~sets.slip & rough
        normal = boundary.normal[:, None, :] * sets.contact[:, None, None]
        return np.concatenate((normal, boundary.tangents.transpose(0, 2, 1) * sticks[:, None, None]), axis=1)

    @property
    def factor_fits(self) -> bool:
        """Whether the machines have the memory for a factor of the tangent; collective."""
        size = self._elastic.system_size
        return enough_memory(size.comm, factor_memory(size.unknowns, size.dimension))
