"""The certificate judges each piece by its own scale: wrong answers of one that is hardly loaded,
on slender bodies.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from certifying import certify
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone

from signorini_fx.results.certificate.contact_nodes import Tractions
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.tuned import CERTIFICATE_TOLERANCE


@cache
def solved(share, dim, algorithm="ssn"):
    """Two blocks beside each other on foundations with friction; loads and gap of the second are a
    share of those of the first.
    """
    sizes = dict.fromkeys(("length", "height") if dim == 2 else ("length", "width", "height"), 1.0)
    counts = dict.fromkeys(("nx", "ny", "nz")[:dim], 6 if dim == 2 else 3)
    mesh = {"generator": "rectangle" if dim == 2 else "box", "parameters": sizes | counts}
    up, held = ("y", "z")[dim - 2], dict.fromkeys(("x", "y", "z")[:dim], 0.0)
    names = {"first": 1.0, "second": share}
    friction = coulomb_friction(0.3)
    scene = {
        "body": [
            {"name": n, "mesh": mesh, "shift": [3.0 * k] + [0.0] * (dim - 1)}
            for k, n in enumerate(names)
        ],
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": [{"boundary": f"{name}.left", **held} for name in names],
        "traction": [{"boundary": f"{name}.top", up: -10.0 * part} for name, part in names.items()],
        "contact": [
            {"boundary": f"{name}.bottom", "gap": 0.001 * part, "friction": friction}
            for name, part in names.items()
        ],
        "solver": {"algorithm": algorithm},
    }
    solution = alone(parse_scene(scene))
    assert solution.certificate.holds
    return solution


def judged(solution, displacement=lambda y: y, pressure=lambda p: p, shear=lambda s: s):
    """The certificate of a solution whose second block has another displacement, pressure or
    shear.
    """
    moved, dim = solution.displacement.copy(), solution.model.tagged.mesh.geometry.dim
    y, x = moved.x.array.reshape(-1, dim), solution.model.space.tabulate_dof_coordinates()
    second = x[:, 0] > 2
    y[second] = displacement(y[second])
    tractions, there = Tractions.of(solution.contact), solution.contact.boundary.x[:, 0] > 2
    changed = {name: getattr(tractions, name).copy() for name in ("pressure", "shear")}
    for (name, values), change in zip(changed.items(), (pressure, shear), strict=True):
        values[there] = change(values[there])
        assert np.abs(values).max() > 0, name
    tractions = replace(tractions, **changed)
    return certify(
        solution.statement, solution.model.tagged, moved, tractions, law=solution.certificate.law
    )


@pytest.mark.one_quick(
    ("share", "dim", "algorithm"), [(1e-8, 2, "ssn"), (1e-5, 2, "alm"), (1e-8, 3, "ssn")]
)
def test_a_body_that_is_hardly_loaded(share, dim, algorithm):
    """Its displacement, pressure and shear may be no more wrong than those of the other one."""
    solution, rng = solved(share, dim, algorithm), np.random.default_rng(0)
    zero = lambda values: 0.0 * values  # noqa: E731
    assert judged(solution, zero, zero, zero).equilibrium > 0.5
    tenth = lambda values: 1.1 * values  # noqa: E731
    assert judged(solution, tenth, tenth, tenth).worst > 0.05
    for name in ("displacement", "pressure", "shear"):
        for _ in range(10):

            def wrong(values):
                return values + 1e-4 * np.abs(values).max() * rng.standard_normal(values.shape)

            assert judged(solution, **{name: wrong}).worst > 5 * CERTIFICATE_TOLERANCE, name


def test_round_off_of_the_other_body_is_no_fault():
    """The unknowns of both are solved for at once: what is less than the last digit of the larger
    one is nothing.
    """
    solution, rng = solved(1e-11, 2), np.random.default_rng(0)
    last_digit = np.finfo(float).eps * np.abs(solution.displacement.x.array).max()
    found = judged(solution, lambda y: y + 0.05 * last_digit * rng.standard_normal(y.shape))
    assert 0 < found.equilibrium < CERTIFICATE_TOLERANCE
    assert not found.unjudged


def test_a_body_between_a_support_and_springs():
    """Without loads and contact the springs alone say how large forces are, when they are wrong by
    a share.
    """
    block = {"length": 2.0, "height": 1.0, "nx": 6, "ny": 3}
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(**block),
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.0, "y": -0.001},
            "springs": {"boundary": "bottom", "x": 100.0, "y": 100.0},
        }
    )
    solution = alone(scene)
    stiffer = scene.springs[0].model_copy(update={"x": 100.0 * (1 + 1e-3), "y": 100.0 * (1 + 1e-3)})
    other = scene.model_copy(update={"springs": (stiffer,)})
    found = certify(
        other.statement,
        solution.model.tagged,
        solution.displacement,
        None,
        law=solution.certificate.law,
    )
    assert found.equilibrium == pytest.approx(1e-3, rel=0.01)


def test_a_slender_body():
    """The clamp of a cantilever takes 100 times the load: a load that is wrong by 1e-5 is refused
    all the same.
    """
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(100, 2, length=100.0, height=1.0),
            "material": {"young": 1e6, "poisson": 0.3},
            "displacement": fixed("left"),
            "traction": {"boundary": "right", "y": -1.0},
            "contact": {"boundary": "bottom", "gap": 0.1},
        }
    )
    solution = alone(scene)
    assert solution.certificate.holds
    load = scene.traction[0].model_copy(update={"y": -1.0 * (1 + 1e-5)})
    other = scene.model_copy(update={"traction": (load,)})
    tractions, tagged = Tractions.of(solution.contact), solution.model.tagged
    found = certify(
        other.statement, tagged, solution.displacement, tractions, law=solution.certificate.law
    )
    assert found.equilibrium > CERTIFICATE_TOLERANCE
