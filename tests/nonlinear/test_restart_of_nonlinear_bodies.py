"""Checkpoints of nonlinear bodies: what goes on from there ends as what was not interrupted."""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from parameters import slow
from ranks import shared
from scenes import alone
from support.nonlinear_bodies import Killed, rectangle, residual
from support.nonlinear_scenes import indented, material

from signorini_fx import FormError, Foundation, NonlinearContactProblem, SceneError, solve
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.records import StepRecord

LAWS = {
    "rubber": material("neo-hooke"),
    "metal": material("j2", yield_stress=2.0, hardening=[[0.2, 6.0]]),
    "finite": material("j2", yield_stress=2.0, hardening=[[0.2, 6.0]], strains="finite"),
}
METHODS = {"fp": {}, "driven": {}, "newton": {"coulomb": "newton"}}
# Pressed, moved sideways and lifted by half; a wall closes in from the side and rises.
ROLL = {
    "shape": "circle",
    "centre": [0.8, 1.5],
    "radius": 0.5,
    "shift": ["max(0.1 * (min(t, 2) - 1), 0)", "-0.1 * min(t, 1) + 0.05 * max(t - 2, 0)"],
}
WALL = {
    "shape": "plane",
    "point": [2.005, 0.0],
    "normal": [-1.0, 0.0],
    "shift": ["-0.01 * t", "0.02 * t"],
}


DRIVEN = {
    "force": ["0", "-1.5 * min(t, 2) + max(t - 2, 0)"],
    "prescribed": {"rotation": 0.0, "x": "0.03 * t"},
}


def pressed(law="rubber", steps=2, driven=False, **further):
    """A block between two rough foundations that move; ``driven``: below one that a force moves."""
    rough = [("top", ROLL, 0.3), ("right", WALL, 0.4)]
    if driven:
        rough = [("top", {key: ROLL[key] for key in ("shape", "centre", "radius")} | DRIVEN, 0.3)]
    contact = [
        {
            "boundary": name,
            "foundation": shape,
            "friction": {"law": "coulomb", "coefficient": coefficient},
        }
        for name, shape, coefficient in rough
    ]
    steps = {"times": [1.0, 2.0, 3.0], "names": ["press", "slide", "lift"], "steps": steps}
    return indented(
        LAWS[law], cells=(6, 3), **({"contact": contact, "load_steps": steps} | further)
    )


def interrupted(scene, comm, folder, at):
    """A run that ends where a load step begins."""

    def watch(record):
        if isinstance(record, StepRecord) and record.step == at:
            raise Killed

    with pytest.raises(Killed):
        solve(scene, comm, checkpoint=folder, observers=[watch])


def assert_same(solution, reference, tolerance):
    """All load steps have the same contact, on any number of ranks."""
    assert solution.converged
    assert not any("solved again" in event for event in solution.history.events)
    assert [step.linear_solves > 0 for step in solution.steps] == [
        step.linear_solves > 0 for step in reference.steps
    ]
    sides = reference.statement.sides
    for ours, theirs in zip(solution.steps, reference.steps, strict=True):
        assert (ours.step, ours.place, ours.time, ours.name) == (
            theirs.step,
            theirs.place,
            theirs.time,
            theirs.name,
        )
        assert ours.certificate.holds
        for one, other in zip(ours.rigid_bodies, theirs.rigid_bodies, strict=True):
            assert one.translation == pytest.approx(other.translation, abs=1e-9)
        table, wanted = (contact_table(step.contact, *sides).columns for step in (ours, theirs))
        size = np.abs(wanted["pressure"]).max()
        for name in ("pressure", "shear"):
            np.testing.assert_allclose(table[name], wanted[name], rtol=0, atol=tolerance * size)
        for name in ("u_n", "u_t"):
            np.testing.assert_allclose(table[name], wanted[name], rtol=0, atol=tolerance)


@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize(
    ("law", "method", "at"),
    [
        ("metal", "fp", 4),
        ("finite", "fp", 4),
        slow("metal", "driven", 4),
        slow("rubber", "newton", 2),
        slow("metal", "newton", 6),
    ],
)
def test_with_as_many_ranks(tmp_path, law, method, at):
    """Metal keeps what has flowed, friction where it began: all figures are those of the run in one
    go.
    """
    folder = shared(tmp_path)
    scene = pressed(law, driven=method == "driven", solver=METHODS[method])
    interrupted(scene, MPI.COMM_WORLD, folder, at)
    solution, reference = solve(scene, checkpoint=folder, restart=True), solve(scene)
    assert solution.history.events[0].startswith(f"restart: {at - 1} complete load step")
    assert_same(solution, reference, 1e-8 if method == "driven" else 1e-10)
    largest = max(np.abs(step.contact.shear).max(initial=0.0) for step in solution.steps)
    assert MPI.COMM_WORLD.allreduce(largest, MPI.MAX) > 0
    if method != "driven":
        assert solution.history.linear_solves == reference.history.linear_solves


def test_another_scene_is_refused(tmp_path):
    """By what differs, before anything is solved; so is a folder of another problem of forms."""
    interrupted(pressed(), MPI.COMM_SELF, tmp_path, 2)
    stiffer = pressed(material=LAWS["rubber"] | {"young": 110.0})
    with pytest.raises(
        SceneError, match=r"material\[0\].*: was .* in the run to go on from"
    ) as refused:
        alone(stiffer, checkpoint=tmp_path, restart=True)
    assert "solve without restart" in str(refused.value)
    space, side = rectangle([1.0, 1.0], [2, 2])
    u = fem.Function(space)
    problem = NonlinearContactProblem(residual(u), u, contact=Foundation(side(1, 0.0)))
    with pytest.raises(FormError, match="restart: needs the folder"):
        problem.run((1.0,), lambda time: None, restart=True)
    with pytest.raises(FormError, match="in the run to go on from"):
        problem.run((1.0,), lambda time: None, folder=tmp_path, restart=True)
