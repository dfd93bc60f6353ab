"""A friction law from outside the package, demos/own_friction.py: one body, two, scenes, and what
refuses it.
"""

import re
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
import pytest
from dolfinx import fem
from forms import Block
from numpy.testing import assert_allclose, assert_array_equal
from on_meshes import at_coordinate, no_load
from scene_tables import rectangle_mesh
from two_bodies import blocks, facets, forms, held

from signorini_fx import ContactProblem, Coulomb, FormError, NoFriction, Pair, SceneError, Tresca
from signorini_fx.mechanics.laws.at_points import fault_of
from signorini_fx.mechanics.laws.protocol import FrictionLaw, Parameter
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
    assert_allclose(shear[slips], bound(state.pressure)[slips], rtol=1e-6, atol=1e-9)
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
    bottom, top = (facets(mesh, at_coordinate(1, at)) for at in (-1, 1))
    moved = held(space, top, value=lambda x: np.array([0.004 + 0 * x[0], -0.01 + 0.012 * x[0]]))
    bcs = [*(held(space, bottom, k) for k in (0, 1)), moved]
    load = no_load(mesh, v)
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
    "mesh": rectangle_mesh(12, 4, length=3.0, height=1.0),
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

    def evaluate(self, pressure, slip, dt):
        share = 1 + self.coefficient * pressure / self.largest
        return self.coefficient * pressure / share, self.coefficient / share**2, 0.0


class Root(Saturating):
    """k sqrt(lambda), with a vertical tangent where contact opens."""

    def evaluate(self, pressure, slip, dt):
        with np.errstate(divide="ignore"):
            return self.largest * np.sqrt(pressure), self.largest / 2 / np.sqrt(pressure), 0.0


class Weakening(FrictionLaw):
    """F lambda (1 + exp(-v / k)) / 2, which falls with the speed."""

    law: Literal["weakening"] = "weakening"
    coefficient: Parameter
    largest: Parameter
    follows_slip = True

    def evaluate(self, pressure, slip, dt):
        falls = np.exp(-slip / dt / self.largest)
        by_pressure = self.coefficient * (1 + falls) / 2
        by_slip = -self.coefficient * pressure * falls / 2 / self.largest / dt
        return by_pressure * pressure, by_pressure, by_slip


def lying(limit=None, derivative=None, kind=Saturating, **methods):
    """A law with other functions of the pressure, or other methods."""

    def changed(law, pressure, slip, dt):
        found, by_pressure, by_slip = kind.evaluate(law, pressure, slip, dt)
        found = found if limit is None else limit(law, pressure)
        by_pressure = by_pressure if derivative is None else derivative(law, pressure)
        return found, by_pressure, by_slip

    methods = {"evaluate": changed} | methods
    return type("Lying", (kind,), {"__module__": __name__, **methods})(F, K)


def of_slip(of):
    """A bound whose value or derivative by the slip ``of`` changes."""
    return {"kind": Weakening, "evaluate": lambda *at: of(*Weakening.evaluate(*at), at[2])}


@pytest.mark.parametrize(
    ("methods", "message"),
    [
        (
            {"limit": lambda _, p: 0.1 * p**2, "derivative": lambda _, p: 0.2 * p},
            "exceeds.* not concave",
        ),
        ({"limit": lambda law, p: -bound(p)}, "negative"),
        ({"limit": lambda _, p: np.ones((p.size, 1))}, r"bound of Lying has the shape \(\d+, 1\)"),
        ({"derivative": lambda _, p: p[:1]}, r"by_pressure of Lying has the shape \(1,\)"),
        ({"follows_pressure": False}, "follows_pressure is False, but bound"),
        ({"limit": lambda _, p: p + np.nan}, "bound of Lying is not finite at the pressure 0"),
        (
            {"limit": lambda law, p: np.where(p > 20, np.nan, bound(p))},
            "bound of Lying is not finite at .* 2",
        ),
        ({"limit": lambda _, p: p // 0}, "bound of Lying is not finite"),
        (
            {"limit": lambda law, p: np.multiply(p, law.coefficient, out=p)},
            "evaluate of Lying fails: .* read-only",
        ),
        (
            {"limit": lambda law, p: bound(p) + law.steepness},
            "evaluate of Lying fails: AttributeError",
        ),
        (
            {"derivative": lambda _, p: p + np.nan},
            "by_pressure of Lying is not finite at the pressure 0",
        ),
        (
            {"derivative": lambda law, p: law.coefficient + 0 * p},
            "by_pressure of Lying is not the derivative",
        ),
        (
            {"derivative": lambda law, p: F * np.sign(0.5 - p)},
            "by_pressure of Lying is not the derivative",
        ),
        ({"evaluate": lambda law, p, s, dt: bound(p)}, "evaluate of Lying must return three"),
        (
            {"evaluate": lambda law, p, s, dt: (F * p / (1 + s), F / (1 + s), 0.0)},
            "set its follows_slip",
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


@pytest.mark.parametrize(
    ("methods", "message"),
    [
        (
            of_slip(lambda found, by_p, by_s, s: (found, by_p, 0.9 * by_s)),
            "by_slip of Lying at the pressure .* and the speed .* is not the derivative",
        ),
        (
            of_slip(lambda found, by_p, by_s, s: (found - s, by_p, by_s - 1)),
            "is negative or not finite",
        ),
        ({"follows_slip": True, "follows_pressure": False}, "leave its follows_pressure out"),
        (
            {"kind": Weakening, "envelope": lambda law, zero: (zero, 0.2 + zero, None)},
            "exceeds, at the pressure .*, its envelope",
        ),
    ],
)
def test_laws_of_the_slip_that_are_not_what_they_say(methods, message):
    """Are tried at speeds of all sizes."""
    law = lying(**methods).with_values(lambda _, value: np.full(2, value))
    assert re.search(message, fault_of(law, 2, 1e3))


@pytest.mark.parametrize("settings", [{}, {"algorithm": "alm"}], ids=str)
def test_a_law_of_the_slip_without_times(settings):
    """A loop of a user's own has none, and says which call has."""
    with pytest.raises(
        FormError, match=r"contact\[0\].friction: follows the slip, .* solve by run"
    ):
        solved(Weakening(F, K), **settings)


def test_laws_answer():
    """Every law says its bound, and what it is without slip, at numbers and at points."""
    pressure = np.array([0.0, 2.0, 9.0])
    assert_array_equal(Coulomb(0.3).limit(pressure), 0.3 * pressure)
    capped = Coulomb(0.5, cap=2.0, cohesion=0.25)
    bounds, by_pressure, by_slip = capped.evaluate(pressure, np.ones(3), 0.1)
    assert_array_equal(bounds, [0.25, 1.25, 2.0])
    assert_array_equal(by_pressure, [0.5, 0.5, 0.0])
    assert_array_equal(by_slip, 0.0)
    assert_array_equal(Tresca(3.0).limit(pressure), 3.0)
    assert_array_equal(Tresca(3.0).evaluate(pressure, pressure, 1.0)[1], 0.0)
    assert_array_equal(NoFriction().evaluate(pressure, pressure, 0.0)[0], 0.0)
    assert_allclose(Saturating(F, K).limit(pressure), bound(pressure))
    with pytest.raises(NotImplementedError):
        type("Silent", (FrictionLaw,), {"__module__": __name__})(law="silent").limit(pressure)


@pytest.mark.parametrize("kind", [Saturating, Quotient, Root, Weakening])
@pytest.mark.parametrize("modulus", [1.0, 1e6])
def test_honest_laws(kind, modulus):
    """Are not refused, however far their bounds bend from the modulus of the body."""
    law = kind(F, K).with_values(lambda _, value: np.full(2, value))
    assert not fault_of(law, 2, modulus)


def test_a_law_that_does_not_say_its_bound():
    """Is refused, also where the pressure leaves its bound as it is."""
    keys = {"law": "silent", "__annotations__": {"law": str, "follows_pressure": ClassVar[bool]}}
    silent = type(
        "Silent", (FrictionLaw,), {"__module__": __name__, "follows_pressure": False, **keys}
    )
    with pytest.raises(FormError, match=r"Silent must define evaluate\(\)"):
        solved(silent())


def test_a_law_derived_from_coulomb():
    """Its bound is its envelope, so that it need not say it again."""
    kind = type("Worn", (Coulomb,), {"__module__": __name__})
    assert solved(kind(F)).problem.certificate.holds


CAPPED = Coulomb(F, cap=1.5)


@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
def test_a_cap_by_newton(algorithm):
    """The monolithic method solves it where it is wanted: the shear of the fixed point."""
    by = {
        coulomb: solved(CAPPED, coulomb=coulomb, algorithm=algorithm, tolerance=1e-10).problem
        for coulomb in ("fp", "newton")
    }
    for coulomb, problem in by.items():
        assert problem.certificate.holds
        assert ("newton" in problem.solution.algorithm) == (coulomb == "newton")
    shears = [problem.state.shear for problem in by.values()]
    assert_allclose(*shears, rtol=1e-6, atol=1e-6)
    assert np.isclose(np.abs(shears[1]), 1.5).any()


def test_a_cohesion_by_newton():
    """Its bound jumps where contact opens: the fixed point takes its place, and this is said."""
    problem = solved(Coulomb(F, cohesion=0.2), coulomb="newton").problem
    assert "newton" not in problem.solution.algorithm
    assert any("a cohesion ends with a jump" in event for event in problem.history.events)
