"""An effect in time: the energy that friction dissipates at each point, in a scene and in forms."""

from pathlib import Path

import ufl
from mpi4py import MPI
from dolfinx import fem

import signorini_fx as sfx


class Dissipation(sfx.StepEffect):
    """Energy per area, added up in a field of the state."""

    def after(self, state, new, ended):
        """Add that of the step that has ended."""
        return self.added(new, "dissipated", "points", ended.contact.friction_energy)


scene = Path(__file__).parents[1] / "scenes" / "press_and_slide.toml"
solution = sfx.solve(scene, MPI.COMM_WORLD, effects=[Dissipation()])
total = solution.contact.boundary.weight @ solution.state.fields["dissipated"].values
work = sum(step.contact.friction_work for step in solution.steps)
print(f"scene: {solution.status.value}, {total:.6g} of {work:.6g} dissipated")

tagged = solution.model.tagged
V = fem.functionspace(tagged.mesh, ("Lagrange", 1, (2,)))
u, v, aside = ufl.TrialFunction(V), ufl.TestFunction(V), fem.Constant(tagged.mesh, (0.0, -0.003))
a = 5000.0 * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx
L = ufl.inner(fem.Constant(tagged.mesh, (0.0, 0.0)), v) * ufl.dx
held = fem.dirichletbc(aside, fem.locate_dofs_topological(V, 1, tagged.facets("top")), V)
floor = sfx.Foundation(tagged.facets("bottom"), friction=sfx.Coulomb(0.3))
problem = sfx.ContactProblem(a, L, [held], floor, effects=[Dissipation()])
state, work = problem.initial(), 0.0
for time, x in enumerate((0.0, 0.004, 0.0, -0.004)):
    aside.value[0] = x
    state, result = problem.step(state, float(time))
    work += result.contact.friction_work
total = problem.state.boundary.weight @ state.fields["dissipated"].values
print(f"forms: {result.status.value}, {total:.6g} of {work:.6g} dissipated")
