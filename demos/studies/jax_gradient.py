# %% [markdown]
# # A contact solve inside a JAX function
#
# A block is pressed on a plane and pushed along it, at temperatures $T_i$. The modulus is known,
# $E(T) = E_0 e^{-T / T_0}$, and the friction coefficient is not: $F(T) = \log(1 + e^{w_0 + w_1 T})$
# is fitted to measured forces $f_i$,
#
# $$\min_w \; \sum_i \bigl(f(E(T_i), F(T_i)) - f_i\bigr)^2 .$$
#
# The sum is a function of JAX, which differentiates all of it: `custom_vjp` tells JAX that the
# derivatives of the solve are those of `ContactProblem.gradient`, one adjoint solve for both
# parameters. It runs on one rank: JAX may call the solves in another order on each.

# %%
import jax
import jax.numpy as jnp
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import create_rectangle, locate_entities_boundary
from scipy.optimize import minimize

from signorini_fx import ContactProblem, Coulomb, Foundation

jax.config.update("jax_enable_x64", True)
E0, T0, TEMPERATURES, TRUE = 1000.0, 4.0, (0.0, 0.5, 1.0), (-1.5, 0.8)
mesh = create_rectangle(MPI.COMM_WORLD, [[0.0, 0.0], [2.0, 1.0]], [16, 8])
V = functionspace(mesh, ("Lagrange", 1, (2,)))
u, v, young, friction = (
    ufl.TrialFunction(V),
    ufl.TestFunction(V),
    Constant(mesh, E0),
    Constant(mesh, 0.3),
)
bottom, top = (
    locate_entities_boundary(mesh, 1, lambda x, at=at: np.isclose(x[1], at)) for at in (0.0, 1.0)
)
a = young * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx
nothing = ufl.inner(Constant(mesh, (0.0, 0.0)), v) * ufl.dx
moved = dirichletbc(Constant(mesh, (0.007, -0.01)), locate_dofs_topological(V, 1, top), V)
foundation = Foundation(bottom, friction=Coulomb(friction))
problem = ContactProblem(
    a, nothing, [moved], foundation, gamma_n=1e7, gamma_t=1e7, coulomb="newton"
)


def solved(parameters):
    """The force along the plane, and its derivatives by E and F."""
    young.value, friction.value = np.asarray(parameters)
    problem.solve()
    found = problem.gradient("force 0 x", by=[young, friction])
    return np.asarray(found.value), np.asarray(found.derivatives)


@jax.custom_vjp
def force(parameters):
    """The force of one solve as a function of JAX of E and F."""
    return forward(parameters)[0]


def forward(parameters):
    """What JAX keeps for the way back: the derivatives."""
    number, pair = (jax.ShapeDtypeStruct(shape, jnp.float64) for shape in ((), (2,)))
    return jax.pure_callback(solved, (number, pair), parameters)


force.defvjp(forward, lambda slopes, weight: (weight * slopes,))


def forces(weights):
    """At all temperatures."""
    return jnp.stack(
        [force(jnp.stack([E0 * jnp.exp(-T / T0), friction_at(weights, T)])) for T in TEMPERATURES]
    )


def friction_at(weights, temperature):
    """F(T)."""
    return jax.nn.softplus(weights[0] + weights[1] * temperature)


# %%
measured = forces(jnp.array(TRUE))


@jax.jit
def misfit(weights):
    """The sum of squares, relative."""
    return jnp.sum((forces(weights) / measured - 1) ** 2)


begin = np.array([-1.0, 0.0])
by_jax = np.asarray(jax.grad(misfit)(begin))
by_difference = [float(misfit(begin + h) - misfit(begin - h)) / 2e-4 for h in 1e-4 * np.eye(2)]
fit = minimize(jax.value_and_grad(misfit), begin, jac=True, method="BFGS", options={"gtol": 1e-10})
print("derivatives by JAX", by_jax, "by differences", by_difference)
print("fitted weights", fit.x, "true ones", TRUE, "after", fit.nfev, "evaluations")
