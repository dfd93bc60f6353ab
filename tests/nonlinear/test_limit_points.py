"""An arch that snaps through: a circle whose displacement is prescribed follows it, and a force
takes it to its end.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from support.nonlinear_bodies import held, neo_hooke, rectangle

from signorini_fx import Foundation, NonlinearContactProblem, Status

FORCE, HELD = 0.15, {"x": 0.0, "rotation": 0.0}


def arch(**shape):
    """The right half of a shallow arch that is clamped at its end, below a circle."""
    space, side = rectangle([4.0, 0.3], [12, 1], degree=2)
    top, middle, end = side(1, 0.3), side(0, 0.0), side(0, 4.0)
    x = space.mesh.geometry.x
    x[:, 1] += 0.8 * np.cos(np.pi * x[:, 0] / 8)
    u = fem.Function(space)
    circle = {"shape": "circle", "centre": (0.0, 1.6), "radius": 0.5, "pivot": (0.0, 1.6)} | shape
    F = ufl.derivative(
        neo_hooke(u) * ufl.dx(metadata={"quadrature_degree": 4}), u, ufl.TestFunction(space)
    )
    bcs = [held(space, end), held(space, middle, 0)]
    return NonlinearContactProblem(
        F, u, bcs=bcs, contact=Foundation(top, shape=circle), algorithm="alm"
    )


@pytest.mark.slow
def test_an_arch_snaps_through():
    """The force on the prescribed circle rises, falls and rises again.  A force on the circle
    beyond the limit point takes it to where the prescribed one needs the same force.
    """
    driven = arch(force=(0.0, 0.0), prescribed=HELD)
    times = np.linspace(0.1, 1.0, 10)
    driven.run(times, lambda load: driven.place(0, force=(0.0, -FORCE * load), prescribed=HELD))
    assert driven.status is Status.CONVERGED
    end = float(driven.rigid_bodies[0].translation[1])
    placed, forces = arch(), []
    for place in np.linspace(0.0, end, 13)[1:]:
        placed.place(0, shift=(0.0, float(place)))
        placed.solve()
        placed.advance()
        forces.append(-float(sum(placed.state.forces)[1]))
    falling = np.flatnonzero(np.diff(forces) < 0)
    assert falling.size > 2
    assert forces[falling[0]] > 1.2 * forces[falling[-1] + 1]
    assert forces[-1] == pytest.approx(FORCE, rel=1e-6)
