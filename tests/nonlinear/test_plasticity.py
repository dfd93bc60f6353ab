"""The plasticity of demos/dent.py against radial return by hand, in a block whose strain is uniform."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from support.nonlinear_scenes import indented
from test_nonlinear import PLATE, held, rectangle

from signorini_fx import Foundation, NonlinearContactProblem, solve

DEMO = Path(__file__).parents[2] / "demos" / "dent.py"


@pytest.fixture
def metal(monkeypatch, tmp_path):
    """The names of the demo, on its coarsest mesh."""
    monkeypatch.setenv("CELLS", "2")
    monkeypatch.chdir(tmp_path)
    return runpy.run_path(str(DEMO))


def by_hand(depths, bulk, mu, yields, hardening):
    """Pressure of a confined block and its hardening: the deviator of the strain is 2/3 of it along one axis."""
    plastic = hardened = 0.0
    for depth in depths:
        mises = 2 * mu * (depth - 1.5 * plastic)
        flow = max(abs(mises) - yields - hardening * hardened, 0.0) / (3 * mu + hardening)
        plastic, hardened = plastic + flow * np.sign(mises), hardened + flow
        yield bulk * depth + 2 / 3 * (mises - 3 * mu * flow * np.sign(mises)), hardened


@pytest.mark.slow
@pytest.mark.mpi
def test_a_block_between_smooth_walls(metal):
    """Pressed beyond yield, unloaded, and pressed again, with the quadratic convergence of the consistent tangent."""
    space, side = rectangle([1.0, 1.0], [3, 3], cell="triangle")
    u, v, du = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    material = metal["VonMises"](u)
    problem = NonlinearContactProblem(
        ufl.inner(material.stress, metal["strain"](v)) * ufl.dx,
        u,
        J=ufl.inner(material.tangent(metal["strain"](du)), metal["strain"](v)) * ufl.dx,
        bcs=[held(space, side(1, 0.0), 1), held(space, side(0, 0.0), 0), held(space, side(0, 1.0), 0)],
        contact=Foundation(side(1, 1.0), shape=PLATE),
        update=material.update,
        commit=material.commit,
        algorithm="alm",
    )
    depths = (0.001, 0.004, 0.0035, 0.006)
    constants = (metal[name] for name in ("BULK", "MU", "YIELD", "HARDENING"))
    for depth, (pressure, hardened) in zip(depths, by_hand(depths, *constants), strict=True):
        problem.place(0, shift=(0.0, -depth))
        problem.solve()
        problem.advance()
        assert problem.certificate.holds
        assert -problem.state.forces[0][1] == pytest.approx(pressure, rel=1e-8)
        np.testing.assert_allclose(material.state[1], hardened, rtol=1e-7, atol=1e-12)
        assert problem.iterations <= 6
    assert hardened > 0.002


@pytest.mark.slow
@pytest.mark.parametrize("driven", ["by a force at its end", "by a circle under a force"])
def test_load_steps_of_metal_that_yields(driven):
    """Hardening is a tenth of the modulus: each time is one load step, and no unit of length changes the result."""
    metal = {"law": "j2", "young": 100.0, "poisson": 0.3, "yield_stress": 2.0, "hardening": 10.0}
    ends = []
    for unit in (1.0, 2.0**-9, 3.7):
        if driven == "by a force at its end":
            scene = {
                "contact": [],
                "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "bottom", "y": 0.0}],
                "traction": {"boundary": "right", "x": 1.0, "factors": [1.5, 5.0, 3.0, 6.0]},
                "load_steps": {"times": [1.0, 2.0, 3.0, 4.0]},
            }
        else:
            centre = [unit, 1.5 * unit]
            circle = {"shape": "circle", "centre": centre, "radius": 0.5 * unit, "pivot": centre}
            circle |= {"force": ["0", f"-{unit}*t"], "prescribed": {"x": 0.0, "rotation": 0.0}}
            scene = {
                "contact": {"boundary": "top", "foundation": circle},
                "load_steps": {"times": [0.2, 1.5, 4.0, 7.0]},
            }
        solution = solve(indented(metal, unit=unit, cells=(8, 4), **scene), MPI.COMM_SELF)
        assert [step.time for step in solution.steps] == scene["load_steps"]["times"]
        assert solution.findings == ()
        ends.append(solution.displacement.x.array / unit)
    assert max(abs(end - ends[0]).max() for end in ends) <= 1e-9 * abs(ends[0]).max()
