"""States that a run could end in and that are no solution: the figure of the certificate that
refuses each of them.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI
from scene_tables import box_mesh, coulomb_friction, rectangle_mesh
from test_certificate_of_pairs import scene as two_bodies

from signorini_fx.records import Status
from signorini_fx.results.certificate.contact_nodes import Tractions
from signorini_fx.results.mechanics import Mechanics
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.tuned import CERTIFICATE_TOLERANCE

COMM, RIGHT = MPI.COMM_WORLD, Mechanics.certified
BOWL = {"gap": "0.01*(x[0] - 1)**2"}
PULLED = {"boundary": "right", "x": 1.0, "factors": [1.0, 1.0001]}
SLIDING = {
    "foundation": {
        "shape": "plane",
        "point": [0.0, 0.0],
        "normal": [0.0, 1.0],
        "shift": ["1e-3*t", "0"],
    }
}
CUBE = {
    "mesh": box_mesh(**dict.fromkeys(("nx", "ny", "nz"), 2)),
    "displacement": [{"boundary": "top", "x": 0.01, "y": 0.0, "z": -0.003}],
}
ASTRAY = np.array([[0.95, 0.3, 0.0], [-0.3, 0.95, 0.0], [0.0, 0.0, 1.0]])
ROUND = {"shape": "circle", "centre": [1.0, -2.0], "radius": 2.0, "pivot": [1.0, -2.0]}
PRESSED = {"foundation": ROUND | {"force": ["0", "5*t"], "prescribed": {"x": 0.0, "rotation": 0.0}}}


def block(contact=BOWL, coefficient=0.3, factors=None, **more):
    """A block whose top is pressed on a rough foundation and pushed along it."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(12, 6, length=2.0),
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [
                {"boundary": "top", "y": -0.003},
                {"boundary": "top", "x": 0.001, "factors": factors},
            ],
            "contact": {"boundary": "bottom", "friction": coulomb_friction(coefficient), **contact},
            "solver": {"fallbacks": False},
        }
        | more
    )


def of_before(y, tractions, of):
    """The state of the load step before."""
    of["rigid"] = of["last"].rigid if of["step"] else of["rigid"]
    return (of["last"].displacement, of["last"].tractions) if of["step"] else (y, tractions)


def elsewhere(y, tractions, of):
    """A rigid body that is not where contact has met it."""
    of["rigid"] = tuple(
        replace(body, translation=body.translation * 1.0001) for body in of["rigid"]
    )
    return y, tractions


def begun(change):
    """A load step that has begun elsewhere; ``change``: of the end of the one before."""
    return lambda y, tractions, of: (
        of.update(last=of["last"] and change(of["last"])) or (y, tractions)
    )


def of_another(**problem):
    """The state of another problem, or one in which its iteration has not ended."""

    def wrong(y, tractions, of):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Mechanics, "certified", RIGHT)
            found = solve(block(**problem), COMM, check=False)
        y.x.array[:] = found.displacement.x.array
        return y, Tractions.of(found.contact)

    return wrong


def inexact(y, tractions, of):
    """What a linear solve that is said to have converged leaves, on several ranks at the nodes that
    they share.
    """
    first = 2 * y.function_space.dofmap.index_map.size_local if COMM.size > 1 else 0
    y.x.array[first:] *= 1.0 + 1e-4 * np.sin(np.arange(len(y.x.array) - first))
    return y, tractions


STEPS, BACK = {"load_steps": {"times": [1.0, 1.001]}}, [1.0, 0.9]
WRONG = {
    "support of the step before": (block(factors=[1.0, 1.00001]), of_before, "supports"),
    "load of the step before": (block(traction=PULLED), of_before, "equilibrium"),
    "gap of the step before, nearer": (block({"gap": "-1e-4*t"}, **STEPS), of_before, "entered"),
    "gap of the step before, farther": (
        block({"gap": "1e-4*t"}, **STEPS),
        of_before,
        "pressure_at_distance",
    ),
    "friction bound of the step before": (
        block(coefficient="0.3/t", **STEPS),
        of_before,
        "friction_cone",
    ),
    "restart without the step before": (
        block(factors=BACK),
        begun(lambda last: None),
        "slip_below_bound",
    ),
    "restart from another shear": (
        block(factors=BACK),
        begun(
            lambda last: replace(
                last, tractions=replace(last.tractions, shear=0.0 * last.tractions.shear)
            )
        ),
        "wrong_way_slip",
    ),
    "foundation that has not moved": (
        block(SLIDING, load_steps={"times": [1.0, 2.0]}),
        begun(lambda last: replace(last, moved=None)),
        "wrong_way_slip",
    ),
    "force on a rigid body of the step before": (block(PRESSED, **STEPS), of_before, "equilibrium"),
    "rigid body elsewhere": (block(PRESSED), elsewhere, "pressure_at_distance"),
    "linear solver that lies": (block(), inexact, "equilibrium"),
    "ranks that disagree": (
        block(),
        lambda y, t, of: (y, replace(t, pressure=t.pressure * (1.0 + 1e-3 * (COMM.rank + 1)))),
        "equilibrium",
    ),
    "shear across its slip": (
        block({}, **CUBE),
        lambda y, t, of: (y, replace(t, shear=t.shear @ ASTRAY)),
        "wrong_way_slip",
    ),
    "stopped early": (block(), of_another(solver={"max_iterations": 2}), "negative_pressure"),
    "open points are closed": (
        block(),
        of_another(contact=BOWL | {"kind": "bilateral"}),
        "negative_pressure",
    ),
    "closed points are open": (block(), of_another(contact={"gap": 0.1}), "entered"),
    "slip points stick": (block(), of_another(coefficient=100.0), "friction_cone"),
    "stick points slip": (block(), of_another(coefficient=0.1), "slip_below_bound"),
}
# What joins two bodies, spoilt after it was set up.
MAPS = {
    "forces of the slave": lambda map: {
        "both": sp.hstack((1.001 * map.slave, -map.master), format="csr")
    },
    "forces of the master": lambda map: {
        "both": sp.hstack((map.slave, -1.001 * map.master), format="csr")
    },
    "moments of both": lambda map: {
        "turning": map.turning + 1e-3 * sp.eye_array(*map.turning.shape)
    },
    "distance": lambda map: {"distance": map.distance + 1e-3},
    "area": lambda map: {"weight": 1.001 * map.weight},
}


@pytest.mark.mpi
@pytest.mark.parametrize("state", WRONG)
def test_states(state, monkeypatch):
    """No status says that one has converged, and all ranks say the same."""
    scene, wrong, figure = WRONG[state]
    assert solve(scene, COMM).converged
    monkeypatch.setattr(
        Mechanics, "certified", lambda self, y, t, **of: RIGHT(self, *wrong(y, t, of), **of)
    )
    step = solve(scene, COMM, check=False).steps[-1]
    assert COMM.allgather(step.status) == [Status.NOT_CERTIFIED] * COMM.size
    assert getattr(step.certificate, figure) > CERTIFICATE_TOLERANCE


@pytest.mark.mpi
@pytest.mark.parametrize("part", MAPS)
def test_maps_of_pairs(part, monkeypatch):
    """Forces and moments of both bodies balance, and the points are as far apart as their sides."""

    def spoilt(self, y):
        ((number, pair),) = self.model.pairs.items()
        coupling = replace(pair.coupling, **MAPS[part](pair.coupling))
        pairs = {number: replace(pair, coupling=coupling)}
        return conditions(replace(self, model=replace(self.model, pairs=pairs)), y)

    conditions = Mechanics.conditions
    monkeypatch.setattr(Mechanics, "conditions", spoilt)
    found = solve(two_bodies(), COMM, check=False)
    assert found.status is Status.NOT_CERTIFIED
    assert found.certificate.worst_name == "coupling"
