"""A friction law from outside the package, demos/own_friction.py: one body, two, scenes, and what
refuses it.
"""

from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
import ufl
from dolfinx import fem
from forms import Block
from two_bodies import blocks, facets, forms, held

from signorini_fx import (
    ContactProblem,
    Coulomb,
    FormError,
    Pair,
    SceneError,
)
from signorini_fx.mechanics.laws.at_points import fault_of
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

DEMO = Path(__file__).parent.parent.parent / "demos" / "own_friction.py"
SOURCE = DEMO.read_text(encoding="utf-8")
# The law without what the demo does with it.
LAW = SOURCE[SOURCE.index("from typing") : SOURCE.index("# %% [markdown]\n# It stands")]
scope: dict = {"__name__": "own_friction"}
exec(LAW, scope)
Saturating = scope["Saturating"]
F, K = 0.4, 3.0


def bound(pressure, coefficient=F, largest=K):
    """The formula once more."""
    return largest - largest / np.exp(coefficient * pressure / largest)


def solved(friction, counts=(12, 4), **settings):
    """A block pressed down and moved aside, with a gap that leaves it open at one end."""
    block = Block(counts, friction=friction, gap=lambda x: 0.004 * x[0], **settings)
    block.aside.value = 0.004
    block.problem.solve()
    return block


@pytest.mark.parametrize("settings", [{}, {"coulomb": "newton"}, {"algorithm": "alm"}], ids=str)
def test_one_body(settings):
    """Certified; some points stick and some slip, at the bound of the formula; with the linear
    solves of Coulomb.
    """
    block = solved(Saturating(F, K), tolerance=1e-10, **settings)
    state, problem = block.problem.state, block.problem
    assert problem.status is Status.CONVERGED
    assert problem.certificate.holds
    shear = np.abs(state.shear[:, 0])
    slips = shear >= bound(state.pressure) * (1 - 1e-7)
    np.testing.assert_allclose(shear[slips], bound(state.pressure)[slips], rtol=1e-6, atol=1e-9)
    assert 0 < np.count_nonzero(slips & (state.pressure > 0)) < np.count_nonzero(state.pressure > 0)
    coulomb = solved(Coulomb(F), tolerance=1e-10, **settings).problem
    assert np.abs(coulomb.state.shear).max() > 1.3 * shear.max()
    most = 1.3 * coulomb.history.linear_solves
    # Newton's method is exact once the sets are right where the bound is a line, and quadratic
    # where it is a curve.
    assert problem.history.linear_solves <= (
        coulomb.history.linear_solves + 2 if "coulomb" in settings else most
    )


def two_blocks(friction):
    """One block on another one, which does not match: the upper one is pressed down, tilted, and
    moved aside.
    """
    mesh, both = blocks("quadrilateral", np.eye(2), ((6, 4), (4, 4)))
    space, a, v = forms(mesh, 1, fem.Constant(mesh, 1000.0))
    bottom, top = (facets(mesh, lambda x, at=at: np.isclose(x[1], at)) for at in (-1, 1))
    moved = held(space, top, value=lambda x: np.array([0.004 + 0 * x[0], -0.01 + 0.012 * x[0]]))
    bcs = [*(held(space, bottom, k) for k in (0, 1)), moved]
    load = ufl.inner(fem.Constant(mesh, (0.0, 0.0)), v) * ufl.dx
    problem = ContactProblem(a, load, bcs, Pair(*both, friction=friction), tolerance=1e-10)
    problem.solve()
    return problem


def test_two_bodies():
    """A pair, certified, with the solves of Coulomb friction."""
    solves = []
    for friction in (Saturating(F, K), Coulomb(F)):
        problem = two_blocks(friction)
        assert problem.certificate.holds
        solves.append(problem.history.linear_solves)
        if isinstance(friction, Saturating):
            state = problem.state
            shear = np.abs(state.shear[:, 0])
            assert (shear <= bound(state.pressure) * (1 + 1e-7)).all()
            assert (shear >= bound(state.pressure) * (1 - 1e-7)).any()
    assert solves[0] <= 1.3 * solves[1]


SCENE = {
    "mesh": {
        "generator": "rectangle",
        "parameters": {"length": 3.0, "height": 1.0, "nx": 12, "ny": 4},
    },
    "material": {"young": 5000.0, "poisson": 0.4},
    "displacement": [{"boundary": "top", "x": 0.002, "y": -0.002}],
    "contact": {
        "boundary": "bottom",
        "gap": "0.001*x[0]",
        "friction": {"law": "saturating", "coefficient": F},
    },
    "solver": {"tolerance": 1e-10},
}


def named(**friction):
    """The scene with the law by its name."""
    contact = SCENE["contact"] | {"friction": SCENE["contact"]["friction"] | friction}
    return parse_scene(SCENE | {"contact": contact})


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """The law as another package has it: with an entry point."""
    (tmp_path / "own_package.py").write_text(LAW, encoding="utf-8")
    about = tmp_path / "own_package-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: own_package\nVersion: 1\n")
    (about / "entry_points.txt").write_text(
        "[signorini_fx.laws]\nsaturating = own_package:Saturating\n"
    )
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("installed")
def test_by_name():
    """In a scene file; its parameters may depend on the position, and have derivatives that
    differences confirm.
    """
    solution = solve(named(largest="3 + x[0]"))
    assert solution.converged
    columns = solution.table.columns
    limit = bound(columns["pressure"], largest=3 + columns["x"])
    assert (np.abs(columns["shear"]) <= limit * (1 + 1e-7)).all()
    assert (np.abs(columns["shear"]) >= limit * (1 - 1e-7)).any()
    with pytest.raises(SceneError, match=r"friction\.largest: is missing"):
        named()
    with pytest.raises(SceneError, match=r"friction\.most: unknown key"):
        named(largest=1.0, most=3.0)


class Quotient(Saturating):
    """F lambda / (1 + F lambda / k), which is no number at a pressure without limit."""

    def limit(self, pressure):
        return self.coefficient * pressure / (1 + self.coefficient * pressure / self.largest)

    def derivative(self, pressure):
        return self.coefficient / (1 + self.coefficient * pressure / self.largest) ** 2


class Root(Saturating):
    """k sqrt(lambda), with a vertical tangent where contact opens."""

    def limit(self, pressure):
        return self.largest * np.sqrt(pressure)

    def derivative(self, pressure):
        with np.errstate(divide="ignore"):
            return self.largest / 2 / np.sqrt(pressure)


def lying(**methods):
    """A law with other methods."""
    return type("Lying", (Saturating,), {"__module__": __name__, **methods})(F, K)


@pytest.mark.parametrize(
    ("methods", "message"),
    [
        (
            {"limit": lambda _, p: 0.1 * p**2, "derivative": lambda _, p: 0.2 * p},
            "exceeds.* not concave",
        ),
        ({"limit": lambda law, p: -bound(p)}, "negative"),
        ({"limit": lambda _, p: np.ones((p.size, 1))}, r"limit of Lying has the shape \(\d+, 1\)"),
        ({"derivative": lambda *_: 0.3}, r"derivative of Lying has the shape \(\)"),
        ({"follows_pressure": False}, "follows_pressure is False, but limit"),
        ({"limit": lambda _, p: p + np.nan}, "limit of Lying is not finite at the pressure 0"),
        (
            {"limit": lambda law, p: np.where(p > 20, np.nan, bound(p))},
            "limit of Lying is not finite at .* 2",
        ),
        ({"limit": lambda _, p: p // 0}, "limit of Lying is not finite"),
        (
            {"limit": lambda law, p: np.multiply(p, law.coefficient, out=p)},
            "limit of Lying fails: .* read-only",
        ),
        (
            {"limit": lambda law, p: bound(p) + law.steepness},
            "limit of Lying fails: AttributeError",
        ),
        (
            {"derivative": lambda _, p: p + np.nan},
            "derivative of Lying is not finite at the pressure 0",
        ),
        (
            {"derivative": lambda law, p: law.coefficient + 0 * p},
            "derivative of Lying is not that of its limit",
        ),
        (
            {"derivative": lambda law, p: F * np.sign(0.5 - p)},
            "derivative of Lying is not that of its limit",
        ),
        (
            {
                "limit": lambda _, p: 0.1 * p + 0.1 * np.clip(p - 3, 0, 6),
                "derivative": lambda _, p: 0.1 + 0.1 * ((p >= 3) & (p < 9)),
                "envelope": lambda law, zero: Coulomb.envelope(Coulomb(0.3), zero),
            },
            "is not concave: it grows faster beyond the pressure [23]",
        ),
    ],
)
def test_laws_that_are_not_what_they_say(methods, message):
    """Are refused, with what is wrong, before statics proves anything of them."""
    with pytest.raises(FormError, match=message):
        solved(lying(**methods))


@pytest.mark.parametrize("kind", [Saturating, Quotient, Root])
@pytest.mark.parametrize("modulus", [1.0, 1e6])
def test_honest_laws(kind, modulus):
    """Are not refused, however far their bounds bend from the modulus of the body."""
    law = kind(F, K).with_values(lambda _, value: np.full(2, value))
    assert not fault_of(law, 2, modulus)


def test_a_law_that_does_not_say_its_limit():
    """Is refused, also where the pressure leaves its bound as it is."""
    keys = {"law": "silent", "__annotations__": {"law": str, "follows_pressure": ClassVar[bool]}}
    silent = type(
        "Silent", (FrictionLaw,), {"__module__": __name__, "follows_pressure": False, **keys}
    )
    with pytest.raises(FormError, match=r"Silent must define limit\(\)"):
        solved(silent())


def test_a_law_derived_from_coulomb():
    """Its bound is its envelope, so that it need not say it again."""
    kind = type("Worn", (Coulomb,), {"__module__": __name__})
    assert solved(kind(F)).problem.certificate.holds
