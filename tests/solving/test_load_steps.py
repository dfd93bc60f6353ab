"""The limit of friction, and load steps: press, push and pull back."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pushed_block import FRICTION, LENGTH, LIMIT, PRESSURE, block, friction_force
from scenes import alone

from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.laws.coulomb import Tresca
from signorini_fx.records import Status

METHODS = [
    {},
    {"coulomb": "newton"},
    {"algorithm": "alm"},
    {"algorithm": "continuation"},
    {"algorithm": "path-following"},
]
each_method = pytest.mark.parametrize("method", METHODS, ids=lambda m: "-".join(m.values()) or "fp")


def by_force(push, factors=None, *, where="left", nx=30, **solver):
    """Pressed with 20 on its top, pushed with the share ``push`` of the limit of friction."""
    traction = push * LIMIT / (LENGTH if where == "top" else 1.0)
    pushed = {"boundary": where, "x": traction} | ({} if factors is None else {"factors": factors})
    return block(nx, {"traction": [{"boundary": "top", "y": -PRESSURE}, pushed]}, **solver)


def by_displacement(push, factors=None, *, nx=30, **solver):
    """Its top moved down by 0.003 and sideways by ``push``."""
    pushed = {"boundary": "top", "x": push} | ({} if factors is None else {"factors": factors})
    return block(nx, {"displacement": [{"boundary": "top", "y": -0.003}, pushed]}, **solver)


def states(contact):
    return set(contact_table(contact, ["bottom"]).columns["friction"])


@each_method
@pytest.mark.one_quick("where", ["left", "top"])
def test_below_the_limit(method, where):
    """At 0.99 of F times the normal force the block stays, slips in part, and friction balances the
    push.
    """
    solution = alone(by_force(0.99, where=where, nx=60, **method))
    assert {"stick", "slip+"} <= states(solution.contact)
    assert friction_force(solution.contact) == pytest.approx(0.99 * LIMIT, rel=1e-8)
    contact, _ = solution.contact.forces
    assert contact[1] == pytest.approx(PRESSURE * LENGTH, rel=1e-8)


@each_method
@pytest.mark.one_quick("where", ["left", "top"])
@pytest.mark.parametrize("push", [1.01, -1.01])
def test_above_the_limit(method, where, push):
    """At 1.01 of it nothing holds the block, and the outcome says so."""
    solution = alone(by_force(push, where=where, nx=60, **method), check=False)
    assert solution.status is Status.SLIDES


UP = [0.0, 0.3, 0.6, 0.9]
BACK, AGAIN = [0.6, 0.3, 0.0, -0.3, -0.6, -0.9], [-0.6, -0.3, 0.0, 0.3, 0.6, 0.9]
CYCLE = len(BACK + AGAIN)
LOOPS = UP + 3 * (BACK + AGAIN)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("loading", "method"),
    [
        (by_force, {"coulomb": "newton"}),
        (by_displacement, {"algorithm": "alm"}),
        (by_displacement, METHODS[4]),
    ],
)
def test_hysteresis_loop(loading, method):
    """Pushed to and fro, the block runs through one loop from the first full cycle on; friction
    never gives work.
    """
    steps = alone(loading(1.0 if loading is by_force else 0.004, LOOPS, **method)).steps
    assert len(steps) == len(LOOPS)
    assert all(step.status is Status.CONVERGED and step.certificate.holds for step in steps)
    work = np.array([step.contact.friction_work for step in steps])
    assert work.min() >= -1e-12 * work.max()
    shear, slip = (
        np.array([getattr(step.contact, name) for step in steps]) for name in ("shear", "u_t")
    )
    close = {"rtol": 0, "atol": 1e-5 if method.get("algorithm") == "path-following" else 1e-6}
    second, third = (
        slice(len(UP) + CYCLE - 1, len(UP) + 2 * CYCLE),
        slice(len(UP) + 2 * CYCLE - 1, None),
    )
    assert_allclose(shear[third] / PRESSURE, shear[second] / PRESSURE, **close)
    assert_allclose(slip[third] / np.abs(slip).max(), slip[second] / np.abs(slip).max(), **close)
    assert work[third][1:].sum() == pytest.approx(work[second][1:].sum(), rel=1e-4)
    assert work[third][1:].sum() > 0
    # At the push 0 on the way back the block is further to the right than on the way there.
    back, there = (
        steps[k].contact.mean_tangential_displacement for k in (len(UP) + 2 * CYCLE + 2, -4)
    )
    assert back > there
    # The first branch is not part of the loop.
    assert np.abs(shear[0] - shear[-4]).max() > 0.01 * PRESSURE


@each_method
@pytest.mark.one_quick("loading", [by_force, by_displacement])
def test_one_step_is_the_static_law(loading, method):
    """A single load step with factors is the scene without them."""
    push = 0.9 if loading is by_force else 0.0036
    one, static = alone(loading(push / 0.9, [0.9], **method)), alone(loading(push, **method))
    scales = {"u_n": 0.003, "u_t": 0.003, "pressure": PRESSURE, "shear": PRESSURE}
    for name, scale in scales.items():
        ours, theirs = getattr(one.contact, name), getattr(static.contact, name)
        assert_allclose(ours, theirs, rtol=0, atol=1e-9 * scale)
    assert one.history.linear_solves == static.history.linear_solves


def test_order_of_loading_matters():
    """Pressed and pushed at once (the static law) is another state than pressed first, whose slip
    stays.
    """
    first = alone(by_displacement(0.0036, [0.0, 1.0], algorithm="alm")).contact
    at_once = alone(by_displacement(0.0036, algorithm="alm")).contact
    assert 0.01 < np.linalg.norm(first.shear - at_once.shear) / np.linalg.norm(first.shear) < 0.2


@pytest.mark.one_quick("method", [{}, {"coulomb": "newton"}, {"algorithm": "alm"}])
def test_work_of_sliding(method):
    """Once everything slides, each increment costs F times the normal force times its length."""
    steps = alone(by_displacement(0.02, [0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0], **method)).steps
    for number in (2, 3, 5, 6):
        contact = steps[number].contact
        assert states(contact) == {"slip+" if number < 4 else "slip-"}
        normal = contact.forces[0][1]
        assert contact.friction_work == pytest.approx(FRICTION * normal * 0.02, rel=1e-6)
        assert friction_force(contact) == pytest.approx(
            (1 if number < 4 else -1) * FRICTION * normal, rel=1e-8
        )


def test_a_step_that_slides_ends_the_history():
    """What was reached before stays in the solution."""
    solution = alone(by_force(1.0, [0.0, 0.5, 1.2, 0.3]), check=False)
    assert solution.status is Status.SLIDES
    assert [step.status for step in solution.steps] == [
        Status.CONVERGED,
        Status.CONVERGED,
        Status.SLIDES,
    ]
    assert solution.shown_steps == solution.steps[:2]
    for step in solution.shown_steps:
        one = solution.at(step)
        assert (one.contact, one.displacement, one.last_step) == (
            step.contact,
            step.displacement,
            step,
        )
    with pytest.raises(ValueError, match="must be one of the 3 steps"):
        solution.at(2)


def test_tresca_steps():
    """Given friction forgets nothing either: full slip there and back, the shear ends at the other
    bound.
    """
    scene = by_displacement(0.02, [0.0, 1.0, 0.0], algorithm="alm")
    contact = scene.contact[0].model_copy(update={"friction": Tresca(bound=2.0)})
    steps = alone(scene.model_copy(update={"contact": (contact,)})).steps
    assert_allclose(steps[1].contact.shear, 2.0, rtol=1e-9)
    assert_allclose(steps[2].contact.shear, -2.0, rtol=1e-9)


LAWS = {
    "frictionless": {},
    "coulomb": {"friction": {"law": "coulomb", "coefficient": FRICTION}},
    "tresca": {"friction": {"law": "tresca", "bound": FRICTION * PRESSURE}},
}


@pytest.mark.one_quick(
    ("law", "method", "factors"),
    [
        *((law, {}, factors) for law in LAWS for factors in ([0.0, 1.0], [0.0, 0.0, 1.0])),
        *(("coulomb", method, [0.0, 1.0]) for method in METHODS[1:]),
    ],
)
def test_a_loose_body_waits_for_its_load(law, method, factors):
    """Before it is loaded it is at rest where it is, which is a solution, and then deforms as if it
    had not waited.
    """
    held = {"displacement": {"boundary": "left", "x": 0.0}} if law == "frictionless" else {}
    # Half of what friction can hold.
    pulled = {"boundary": "right", "x": LIMIT / 2}
    contact = {"contact": {"boundary": "bottom"} | LAWS[law]}

    def loaded(factors):
        loads = [{"boundary": "top", "y": -PRESSURE}, pulled]
        return alone(
            block(
                6,
                {"traction": [load | {"factors": factors} for load in loads]} | held | contact,
                **method,
            )
        )

    waited, at_once = loaded(factors), loaded([1.0])
    *first, last = waited.steps
    for step in first:
        assert not step.displacement.x.array.any()
        assert not step.contact.pressure.any()
        assert step.linear_solves == 0
    counted = "load step 1:" if len(first) == 1 else "load steps 1, 2:"
    assert [
        f.level for f in waited.findings if f"{counted} nothing presses on the body" in f.message
    ] == ["note"]
    assert not [f for f in at_once.findings if "nothing presses on the body" in f.message]
    expected = at_once.steps[-1].displacement.x.array
    # Path-following and augmentation stop within their own tolerances, on other ways.
    assert_allclose(last.displacement.x.array, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
