"""A scene in 3D whose solution was made up beforehand: slip turns from node to node.

On the bottom of a box, with r the position from its middle and R = |r|,

    mu = q r / sqrt(1 + R^2),    tau_T u = c (r / R) max(R - 1, 0)^2,    bound = |mu| + q max(1 - R,
    0),

so that the disc R < 1 sticks, with a shear that reaches its bound at R = 1, and all else slips
outwards.  With nu = 0 the displacement (tau_T u + z mu / G, - e z) has these tractions and a
constant pressure E e.
"""

import numpy as np
import ufl
from spaces import box

from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.effects.loads import BodyForce
from signorini_fx.mechanics.laws.coulomb import Tresca
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.scenes.scene import Scene, SolverSettings

YOUNG, BOUND, FAR, PRESSED = 100.0, 2.0, 0.05, 0.1


SHEAR_MODULUS = YOUNG / 2


def slip_and_shear(x):
    """(tau_T u, mu) at points (3, n), shape (2, n) each."""
    size = np.maximum(np.hypot(x[0], x[1]), 1e-300)
    return FAR * x[:2] / size * np.maximum(size - 1, 0.0) ** 2, BOUND * x[:2] / np.sqrt(1 + size**2)


def bound(x):
    """At points (3, n), shape (n,)."""
    return np.linalg.norm(slip_and_shear(x)[1], axis=0) + BOUND * np.maximum(
        1 - np.hypot(x[0], x[1]), 0.0
    )


def displacement(x):
    """At points (3, n), shape (3, n)."""
    slip, shear = slip_and_shear(x)
    return np.vstack((slip + x[2] * shear / SHEAR_MODULUS, -PRESSED * x[2]))


def stress(mesh):
    """Sigma of the displacement, by UFL."""
    x = ufl.SpatialCoordinate(mesh)
    size = ufl.sqrt(x[0] ** 2 + x[1] ** 2 + 1e-18)  # its derivative at 0 must be a number
    away = ufl.conditional(ufl.ge(size, 1.0), FAR * (size - 1) ** 2 / size, 0.0)
    sheared = BOUND / ufl.sqrt(1 + size**2)
    u = ufl.as_vector(
        [(away + x[2] * sheared / SHEAR_MODULUS) * x[k] for k in (0, 1)] + [-PRESSED * x[2]]
    )
    return YOUNG * ufl.sym(ufl.grad(u))


def made_up(cells, n, algorithm="auto"):
    """The scene with this solution, on 2 n by 2 n by n / 2 cells."""
    tagged = box(cells, (2 * n, 2 * n, n // 2), size=(4.0, 4.0, 1.0))
    tagged.mesh.geometry.x[:, :2] -= 2.0
    fx, fy, fz = (-value for value in ufl.div(stress(tagged.mesh)))
    sides = ("left", "right", "front", "back", "top")
    return Scene(
        mesh=tagged,
        material=LinearElastic(young=YOUNG, poisson=0.0),
        body_force=BodyForce(x=fx, y=fy, z=fz),
        displacement=[
            Displacement(
                boundary=name,
                **{axis: lambda x, k=k: displacement(x)[k] for k, axis in enumerate("xyz")},
            )
            for name in sides
        ],
        contact=Contact(boundary="bottom", friction=Tresca(bound=bound)),
        solver=SolverSettings(algorithm=algorithm),
    )
