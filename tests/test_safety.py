"""The safety factor against statics and against ramps: sliding, tipping, a plinth, a preload and a hub."""

from dataclasses import replace

import numpy as np
import pytest
from boxes import Box, boxes_mesh
from mpi4py import MPI
from scenes import alone
from test_pieces import scene_on

from signorini_fx.records import Status
from signorini_fx.results.safety import safety_of
from signorini_fx.scene.model import PrescribedDisplacement, SurfaceTraction
from signorini_fx.scene.reading import parse_scene

WEIGHT, LENGTH, HEIGHT = 3.0, 3.0, 2.0


def block(push, friction, *, ny=4, **more):
    """A heavy block that is pushed at half its height."""
    return parse_scene(
        {
            "mesh": {
                "generator": "rectangle",
                "parameters": {"length": LENGTH, "height": HEIGHT, "nx": 12, "ny": ny},
            },
            "material": {"young": 1e6, "poisson": 0.3},
            "body_force": {"y": -WEIGHT / (LENGTH * HEIGHT)},
            "traction": {"boundary": "left", "x": push / HEIGHT},
            "contact": {"boundary": "bottom", "friction": friction, **more},
        }
    )


COULOMB = {"law": "coulomb", "coefficient": 0.8}
ROUGH = {"law": "coulomb", "coefficient": 5.0}
TRESCA = {"law": "tresca", "bound": 1.0}


@pytest.mark.parametrize(
    ("friction", "limit", "status", "motion"),
    [
        (COULOMB, 0.8 * WEIGHT, Status.SLIDES, "the translation along (1, 0)"),
        (ROUGH, WEIGHT * LENGTH / HEIGHT, Status.TIPS, "the rotation about (3, 0)"),
        (TRESCA, 1.0 * LENGTH, Status.SLIDES, "the translation along (1, 0)"),
    ],
    ids=["slides", "tips", "tresca"],
)
def test_factor_and_ramp_agree(friction, limit, status, motion):
    """The factor is the limit of statics, whatever the push was; just below it there is a solution, above none."""
    for push in (0.3 * limit, 0.7 * limit):
        safety = alone(block(push, friction)).safety
        assert safety.factor * push == pytest.approx(limit, rel=1e-6)
        assert safety.statics * push == pytest.approx(limit, rel=1e-6)
        assert safety.motion == motion
        assert safety.exact is (friction is TRESCA)
    assert alone(block(0.998 * limit, friction)).safety.factor == pytest.approx(1 / 0.998, rel=1e-5)
    beyond = alone(block(1.002 * limit, friction), check=False)
    assert beyond.status is status
    assert beyond.safety is None


@pytest.mark.parametrize("depth", [0.2, 1e-3])
def test_a_block_on_a_plinth(depth):
    """Where the foundation is below the plinth the body would have to tip first: it does so over the edge at 2."""
    safety = alone(block(1.2, ROUGH, gap=f"0 if 0.99 <= x[0] <= 2.01 else {depth}")).safety
    assert safety.factor == pytest.approx(WEIGHT * 0.5 / (1.2 * HEIGHT / 2), rel=1e-6)
    assert safety.motion == "the rotation about (2, 0)"


@pytest.mark.parametrize("gap", [0.0, 0.02])
def test_what_the_body_rests_on_counts(gap):
    """A block that a dead push has nearly tipped over one edge is pushed back, until it tips over the other one, which
    does not touch the foundation yet; the gap that it has closed before does not matter.
    """
    dead, live = 0.9 * WEIGHT * LENGTH / HEIGHT, 0.1
    scene = block(dead, ROUGH, gap=gap)
    back = SurfaceTraction(boundary="right", x=-live / HEIGHT)
    pushed = scene.traction[0].model_copy(update={"live": False})
    solution = alone(scene.model_copy(update={"traction": (pushed, back)}))
    contact = solution.contact
    assert not contact.in_contact[contact.boundary.x[:, 0] < 1.0].any()
    assert solution.safety.factor * live == pytest.approx(dead + WEIGHT * LENGTH / HEIGHT, rel=1e-6)
    broken = replace(contact, pressure=np.full_like(contact.pressure, np.nan))
    assert safety_of(solution.discretisation, broken, 0.0) is None


def test_a_support_takes_the_pressure():
    """It presses a corner into the foundation, whatever the push is: the friction bound there is the limit."""
    scene = block(2.0, {"law": "coulomb", "coefficient": "0.8 if x[0] < 0.01 else 0"}, gap=-1e-4)
    sides = tuple(PrescribedDisplacement(boundary=name, y=0.0) for name in ("left", "right"))
    solution = alone(scene.model_copy(update={"displacement": sides}))
    contact, safety = solution.contact, solution.safety
    limit = contact.boundary.weight @ contact.bound
    assert limit > 3.0
    assert (safety.factor * 2.0, safety.statics * 2.0) == (pytest.approx(limit), pytest.approx(limit))


@pytest.mark.parametrize("pushes", [(0.1, 0.2), (0.2, 0.1)])
def test_of_several_pieces_the_weakest_counts(pushes):
    """Each slides at its own limit."""
    boxes = [Box("one", 0.0, 0.0, 1.0, 1.0, 2, 2), Box("other", 2.0, 0.0, 1.0, 1.0, 2, 2)]
    tractions = [{"boundary": f"left {box.name}", "x": push} for box, push in zip(boxes, pushes, strict=True)]
    contact = [{"boundary": f"bottom {box.name}", "friction": COULOMB} for box in boxes]
    weight = {"y": -1.0, "live": False}
    scene = scene_on(boxes_mesh(MPI.COMM_SELF, boxes), body_force=weight, traction=tractions, contact=contact)
    assert alone(scene).safety.factor == pytest.approx(0.8 / 0.2, rel=1e-6)


def test_a_preload_does_not_grow():
    """Friction under a pressure that is not live: F N over the push; if it grew as well, there would be no limit."""
    press, push = {"boundary": "top", "pressure": 2.0}, {"boundary": "left", "x": 0.5}
    mesh = {"generator": "rectangle", "parameters": {"length": LENGTH, "height": 1.0, "nx": 12, "ny": 4}}
    contact = {"boundary": "bottom", "friction": COULOMB}
    common = {"mesh": mesh, "material": {"young": 1e6, "poisson": 0.3}, "contact": contact}
    dead = alone(parse_scene({**common, "traction": [press | {"live": False}, push]})).safety
    assert dead.statics == pytest.approx(0.8 * 2.0 * LENGTH / 0.5, rel=1e-6)
    grown = alone(parse_scene({**common, "traction": [press, push]})).safety
    assert grown.statics == np.inf
    assert grown.factor == pytest.approx(0.8 * 2.0 * LENGTH / 0.5, rel=1e-6)


def hub(torque, **solver):
    """A ring pressed onto a shaft that turns it."""
    return parse_scene(
        {
            "mesh": {"generator": "ring", "parameters": {"nr": 2, "nt": 4, "nz": 1}},
            "material": {"young": 1e5, "poisson": 0.3},
            "displacement": {"boundary": "bottom", "z": 0.0},
            "traction": {"boundary": "outer", "x": f"{-torque} * x[1]", "y": f"{torque} * x[0]"},
            "contact": {"boundary": "inner", "gap": -1e-3, "friction": {"law": "coulomb", "coefficient": 0.3}},
            "solver": solver,
        }
    )


def test_a_hub_at_its_slip_torque():
    """The fit presses whatever the torque is: statics sets no limit, the friction bounds of the solution do."""
    limits = []
    for torque in (0.5, 1.5, 1.95, 2.0):
        safety = alone(hub(torque)).safety
        assert safety.statics == np.inf
        limits.append(torque * safety.factor)
    # The torque itself takes a per cent of the pressure away.
    np.testing.assert_allclose(limits, 2.02, rtol=0.01)
    assert limits == sorted(limits, reverse=True)
    assert not alone(hub(1.01 * limits[-1], fallbacks=False), check=False).converged
