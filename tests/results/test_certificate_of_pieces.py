"""The certificate judges each piece by its own scale: wrong answers of one that is hardly loaded, on slender bodies."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from certifying import certify
from scenes import alone

from signorini_fx import Status
from signorini_fx.results.certificate.law_of_method import Tractions
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.tuned import CERTIFICATE_TOLERANCE


@cache
def solved(share, dim, algorithm="ssn"):
    """Two blocks beside each other on foundations with friction; loads and gap of the second are a share of those of
    the first.
    """
    sizes = dict.fromkeys(("length", "height") if dim == 2 else ("length", "width", "height"), 1.0)
    counts = dict.fromkeys(("nx", "ny", "nz")[:dim], 6 if dim == 2 else 3)
    mesh = {"generator": "rectangle" if dim == 2 else "box", "parameters": sizes | counts}
    up, held = ("y", "z")[dim - 2], dict.fromkeys(("x", "y", "z")[:dim], 0.0)
    names = {"first": 1.0, "second": share}
    friction = {"law": "coulomb", "coefficient": 0.3}
    scene = {
        "body": [{"name": n, "mesh": mesh, "shift": [3.0 * k] + [0.0] * (dim - 1)} for k, n in enumerate(names)],
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": [{"boundary": f"{name}.left", **held} for name in names],
        "traction": [{"boundary": f"{name}.top", up: -10.0 * part} for name, part in names.items()],
        "contact": [
            {"boundary": f"{name}.bottom", "gap": 0.001 * part, "friction": friction} for name, part in names.items()
        ],
        "solver": {"algorithm": algorithm},
    }
    solution = alone(parse_scene(scene))
    assert solution.certificate.holds
    return solution


def judged(solution, displacement=lambda y: y, pressure=lambda p: p, shear=lambda s: s):
    """The certificate of a solution whose second block has another displacement, pressure or shear."""
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
    return certify(solution.statement, solution.model.tagged, moved, tractions, law=solution.certificate.law)


@pytest.mark.one_quick
@pytest.mark.parametrize(("share", "dim", "algorithm"), [(1e-8, 2, "ssn"), (1e-5, 2, "alm"), (1e-8, 3, "ssn")])
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


def test_figures_do_not_depend_on_the_other_body():
    """They are those of the same body alone, as long as round-off of the larger one is small beside it."""
    whole, part = solved(1.0, 2), solved(1e-7, 2)
    for factor in (1.001, 0.5):
        equal, small = (judged(one, lambda y, factor=factor: factor * y) for one in (whole, part))
        assert small.equilibrium == pytest.approx(equal.equilibrium, rel=1e-6)
        assert small.entered == pytest.approx(equal.entered, rel=1e-3, abs=1e-6)


def test_round_off_of_the_other_body_is_no_fault():
    """The unknowns of both are solved for at once: what is less than the last digit of the larger one is nothing."""
    solution, rng = solved(1e-11, 2), np.random.default_rng(0)
    last_digit = np.finfo(float).eps * np.abs(solution.displacement.x.array).max()
    found = judged(solution, lambda y: y + 0.05 * last_digit * rng.standard_normal(y.shape))
    assert 0 < found.equilibrium < CERTIFICATE_TOLERANCE
    assert not found.unjudged


def test_a_body_between_a_support_and_springs():
    """Without loads and contact the springs alone say how large forces are, when they are wrong by a share."""
    block = {"length": 2.0, "height": 1.0, "nx": 6, "ny": 3}
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": block},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.0, "y": -0.001},
            "springs": {"boundary": "bottom", "x": 100.0, "y": 100.0},
        }
    )
    solution = alone(scene)
    stiffer = scene.springs[0].model_copy(update={"x": 100.0 * (1 + 1e-3), "y": 100.0 * (1 + 1e-3)})
    other = scene.model_copy(update={"springs": (stiffer,)})
    found = certify(other.statement, solution.model.tagged, solution.displacement, None, law=solution.certificate.law)
    assert found.equilibrium == pytest.approx(1e-3, rel=0.01)


def test_a_slender_body():
    """The clamp of a cantilever takes 100 times the load: a load that is wrong by 1e-5 is refused all the same."""
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"length": 100.0, "height": 1.0, "nx": 100, "ny": 2}},
            "material": {"young": 1e6, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0, "y": 0.0},
            "traction": {"boundary": "right", "y": -1.0},
            "contact": {"boundary": "bottom", "gap": 0.1},
        }
    )
    solution = alone(scene)
    assert solution.certificate.holds
    load = scene.traction[0].model_copy(update={"y": -1.0 * (1 + 1e-5)})
    other = scene.model_copy(update={"traction": (load,)})
    tractions, tagged = Tractions.of(solution.contact), solution.model.tagged
    found = certify(other.statement, tagged, solution.displacement, tractions, law=solution.certificate.law)
    assert found.equilibrium > CERTIFICATE_TOLERANCE


def rectangles(
    young, heights, *, moved, bonded, gap=0.0, poisson=0.3, degree=1, cell="triangle", lengths=(1.0,) * 4, **more
):
    """Rectangles upon each other, the lowest held at its bottom, the top of the uppermost moved; some pairs bonded."""
    names = "abcd"[: len(young)]
    bottoms = np.cumsum([0.0, *heights[:-2], heights[-2] + gap])
    pairs = list(zip(names[1:], names, strict=False))
    return parse_scene(
        {
            "body": [
                {
                    "name": name,
                    "mesh": {
                        "generator": "rectangle",
                        "parameters": {
                            "length": lengths[k],
                            "height": heights[k],
                            "nx": 4 + k % 2,
                            "ny": 3,
                            "cell": cell,
                        },
                    },
                    "shift": [0.0, bottoms[k]],
                }
                for k, name in enumerate(names)
            ],
            "element": {"degree": degree},
            "material": [{"region": name, "young": young[k], "poisson": poisson} for k, name in enumerate(names)],
            "displacement": [
                {"boundary": "a.bottom", "x": 0.0, "y": 0.0},
                {"boundary": f"{names[-1]}.top", "x": moved[0], "y": moved[1]},
            ],
            "contact": [
                {"boundary": f"{upper}.bottom", "against": f"{lower}.top", "points": "boundary"}
                | ({"kind": "bonded"} if bonded[k] else {})
                for k, (upper, lower) in enumerate(pairs)
            ],
        }
        | more
    )


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("young", "degree", "cell"), [((180.0, 36.0, 1500.0), 2, "quadrilateral"), ((2800.0, 850.0, 260.0), 1, "triangle")]
)
def test_bodies_at_rest_beside_one_that_moves_away(young, degree, cell):
    """What has no load at all is round-off of what moves: exactly nothing is there, and a rigid motion."""
    away = (0.002, 0.001)
    scene = rectangles(
        young,
        (1.0, 1.0, 1.0),
        moved=away,
        bonded=(True, False),
        gap=1e-4,
        degree=degree,
        cell=cell,
        lengths=(1.0, 1.5, 1.0),
    )
    solution = alone(scene)
    assert solution.status is Status.CONVERGED
    y = solution.displacement.x.array.reshape(-1, 2)
    highest = solution.model.space.tabulate_dof_coordinates()[:, 1] > 2 + 0.5e-4
    assert np.abs(y[~highest]).max() < 1e-8 * np.linalg.norm(away)
    assert np.abs(y[highest] - away).max() < 1e-12 * np.linalg.norm(away)
    # What is no round-off is refused as before.
    wrong, rng = solution.displacement.copy(), np.random.default_rng(0)
    at_rest = np.flatnonzero(~highest)
    wrong.x.array.reshape(-1, 2)[at_rest] += 1e-7 * away[0] * rng.standard_normal((at_rest.size, 2))
    tractions = Tractions.of(solution.contact)
    tagged, law = solution.model.tagged, solution.certificate.law
    assert certify(scene.statement, tagged, wrong, tractions, law=law).worst > 1e-3
    pulled = replace(tractions, pressure=tractions.pressure + 1e-4 * min(young) * away[0])
    assert certify(scene.statement, tagged, solution.displacement, pulled, law=law).worst > 10 * CERTIFICATE_TOLERANCE


def test_a_soft_body_on_a_stiff_one():
    """The digits that a bond loses are those of the largest displacement in both bodies, wherever it is: a bar in
    series, of which the softest part is strained.
    """
    young, heights, squeezed = (8.0, 313.0, 1.76e-3), (1.0, 1.0, 1.0), 4.6e-3
    more = {"displacement": [{"boundary": "a.bottom", "x": 0.0, "y": 0.0}, {"boundary": "c.top", "y": -squeezed}]}
    scene = rectangles(
        young, heights, moved=(0.0, 0.0), bonded=(True, True), poisson=0.0, degree=2, cell="quadrilateral", **more
    )
    solution = alone(scene)
    assert solution.status is Status.CONVERGED
    stress = squeezed / np.sum(np.array(heights) / young)
    assert solution.contact.pressure == pytest.approx(stress, rel=1e-4)
    tractions, rng = Tractions.of(solution.contact), np.random.default_rng(0)
    for name in ("pressure", "shear"):
        values = getattr(tractions, name)
        wrong = replace(tractions, **{name: values + 1e-3 * stress * rng.standard_normal(values.shape)})
        tagged, law = solution.model.tagged, solution.certificate.law
        assert certify(scene.statement, tagged, solution.displacement, wrong, law=law).worst > 5 * CERTIFICATE_TOLERANCE
