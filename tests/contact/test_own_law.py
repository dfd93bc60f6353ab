"""A friction law from outside the package, demos/own_friction.py: one body, two, scenes, and what refuses it."""

import re
from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import fem
from shifted_problems import shifted
from test_contact_problem import Block
from test_two_bodies import blocks
from two_bodies import facets, forms, held

from signorini_fx import (
    ContactProblem,
    ConvergenceError,
    Coulomb,
    FormError,
    Foundation,
    FrictionLaw,
    Pair,
    SceneError,
    sweep,
)
from signorini_fx.algebra.contact.active_sets import ActiveSets, linearised, multipliers, tangent
from signorini_fx.forms.stress import modulus_of_energy
from signorini_fx.mechanics.laws.at_points import fault_of, friction_of
from signorini_fx.mechanics.obstacles import foundations_on_points
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


def test_the_demo_is_short():
    """The law, the solve, the derivatives and the files: at most 40 lines of code."""
    lines = [line for line in SOURCE.splitlines() if line and not line.startswith("#")]
    assert len(lines) <= 40


def solved(friction, counts=(12, 4), **settings):
    """A block pressed down and moved aside, with a gap that leaves it open at one end."""
    block = Block(counts, friction=friction, gap=lambda x: 0.004 * x[0], **settings)
    block.aside.value = 0.004
    block.problem.solve()
    return block


@pytest.mark.parametrize("settings", [{}, {"coulomb": "newton"}, {"algorithm": "alm"}], ids=str)
def test_one_body(settings):
    """Certified; some points stick and some slip, at the bound of the formula; with the linear solves of Coulomb."""
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
    # Newton's method is exact once the sets are right where the bound is a line, and quadratic where it is a curve.
    assert problem.history.linear_solves <= (coulomb.history.linear_solves + 2 if "coulomb" in settings else most)


def test_in_space():
    """Both ways to follow the pressure, and load steps, agree."""
    found = [solved(Saturating(F, K), (6, 3, 3), tolerance=1e-10, coulomb=way).problem for way in ("fp", "newton")]
    assert all(problem.certificate.holds for problem in found)
    np.testing.assert_allclose(found[0].state.shear, found[1].state.shear, atol=1e-6 * K)


def test_gradient():
    """By both parameters, against differences."""
    block = Block(gap=lambda x: 0.004 * x[0], tolerance=1e-12)
    data = fem.Constant(block.mesh, F), fem.Constant(block.mesh, K)
    floor = Foundation(block.bottom, gap=lambda x: 0.004 * x[0], friction=Saturating(*data))
    problem = ContactProblem(block.a, block.L, block.bcs, floor, tolerance=1e-12)
    block.aside.value = 0.004

    def force():
        problem.solve()
        assert problem.certificate.holds
        return problem.state.forces[1][0]

    force()
    found = problem.gradient("force 0 x", data)
    for constant, slope in zip(data, found.derivatives, strict=True):
        value, ends = float(constant.value), []
        for constant.value in (value * (1 + 1e-4), value * (1 - 1e-4)):
            ends.append(force())
        constant.value = value
        assert slope == pytest.approx((ends[0] - ends[1]) / (2e-4 * value), rel=1e-5)


def two_blocks(friction):
    """One block on another one, which does not match: the upper one is pressed down, tilted, and moved aside."""
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
    "mesh": {"generator": "rectangle", "parameters": {"length": 3.0, "height": 1.0, "nx": 12, "ny": 4}},
    "material": {"young": 5000.0, "poisson": 0.4},
    "displacement": [{"boundary": "top", "x": 0.002, "y": -0.002}],
    "contact": {"boundary": "bottom", "gap": "0.001*x[0]", "friction": {"law": "saturating", "coefficient": F}},
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
    (about / "entry_points.txt").write_text("[signorini_fx.laws]\nsaturating = own_package:Saturating\n")
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("installed")
def test_by_name():
    """In a scene file; its parameters may depend on the position, and have derivatives that differences confirm."""
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


@pytest.mark.usefixtures("installed")
def test_what_does_not_know_the_law():
    """Says so, with its name: a sweep over coefficients."""
    scene = named(largest=3.0)
    with pytest.raises(SceneError, match="saturating"):
        sweep(scene, coefficients=[0.1, 0.2])


def test_independent_check():
    """A law whose two statements differ by less than what is noticed beforehand is not certified."""

    class Wrong(Saturating):
        def claimed(self, pressure):
            return (1 - 1e-4) * self.limit(pressure)

    with pytest.raises(ConvergenceError, match="certificate does not hold"):
        solved(Wrong(F, K))


def test_envelope():
    """Of a concave law its tangent at zero and its limit; of another one nothing is known."""
    law = Saturating(F, K).sampled(np.zeros((3, 2)))
    given, coefficient, cap = law.envelope(np.zeros(2))
    np.testing.assert_array_equal([given, coefficient, cap], [[0, 0], [F, F], [K, K]])

    class Unknown(Saturating):
        concave = False

    assert np.isinf(Unknown(F, K).envelope(np.zeros(2)).given).all()
    with pytest.raises(FormError, match="largest: must not be negative"):
        Saturating(F, -K)


def test_tangent():
    """The shear of a slipping point follows the pressure by the derivative of the bound, and beyond it."""
    friction = friction_of(Saturating(F, K).sampled(np.zeros((3, 1))), 1)
    none = np.zeros(1)
    data = shifted(none, 10.0, 10.0, np.inf, none, none[:, None], none, follows=friction)
    sets = linearised(ActiveSets.of(np.array([True]), np.array([[1.0]])), np.array([5.0]), data)
    (_, (low,)), (_, (high,)) = (multipliers(sets, np.array([u]), np.ones((1, 1)), data) for u in (0.4, 0.6))
    slope = F * np.exp(-F * 5.0 / K)
    assert (high - low) / 0.2 == pytest.approx(10 * slope)
    assert tangent(sets, data)[0, 1, 0] == pytest.approx(10 * slope)
    assert multipliers(sets, np.array([0.5]), np.ones((1, 1)), data)[1] == pytest.approx(bound(5.0))


class Quotient(Saturating):
    """F lambda / (1 + F lambda / k), which is no number at a pressure without limit."""

    def limit(self, pressure):
        return self.coefficient * pressure / (1 + self.coefficient * pressure / self.largest)

    def derivative(self, pressure):
        return self.coefficient / (1 + self.coefficient * pressure / self.largest) ** 2

    def claimed(self, pressure):
        return self.largest - self.largest**2 / (self.largest + self.coefficient * pressure)


def pushed(law, push, **solver):
    """A block that lies on its foundation, pressed with 20 and pushed aside: nothing but friction holds it."""
    scene = {"displacement": (), "traction": {"boundary": "top", "x": push, "y": -20.0}, "solver": solver}
    return solve(parse_scene(SCENE | scene | {"contact": {"boundary": "bottom", "friction": law}}))


def test_a_quotient():
    """Statics knows nothing of its limit, so that it does not prove that a block slides which the law holds."""
    assert pushed(Quotient(F, K), 1.2).converged


class Root(Saturating):
    """k sqrt(lambda), with a vertical tangent where contact opens."""

    def limit(self, pressure):
        return self.largest * np.sqrt(pressure)

    def derivative(self, pressure):
        with np.errstate(divide="ignore"):
            return self.largest / 2 / np.sqrt(pressure)

    def claimed(self, pressure):
        return self.largest * pressure**0.5


def test_a_root():
    """Newton's method follows it, and the derivatives are those of differences."""
    block = Block(gap=lambda x: 0.004 * x[0], tolerance=1e-12)
    largest = fem.Constant(block.mesh, 0.3)
    floor = Foundation(block.bottom, gap=lambda x: 0.004 * x[0], friction=Root(F, largest))
    problem = ContactProblem(block.a, block.L, block.bcs, floor, tolerance=1e-12, coulomb="newton")
    block.aside.value = 0.004
    forces = []
    for largest.value in (0.2999, 0.3001, 0.3):
        problem.solve()
        forces.append(problem.state.forces[1][0])
    assert not problem.state.in_contact.all()
    slope = problem.gradient("force 0 x", [largest]).derivatives[0]
    assert slope == pytest.approx((forces[1] - forces[0]) / 2e-4, rel=1e-5)
    assert slope != 0


def lying(**methods):
    """A law with other methods."""
    return type("Lying", (Saturating,), {"__module__": __name__, **methods})(F, K)


@pytest.mark.parametrize(
    ("methods", "message"),
    [
        ({"limit": lambda _, p: 0.1 * p**2, "derivative": lambda _, p: 0.2 * p}, "exceeds.* not concave"),
        ({"limit": lambda law, p: -law.claimed(p)}, "negative"),
        ({"limit": lambda _, p: np.ones((p.size, 1))}, r"limit of Lying has the shape \(\d+, 1\)"),
        ({"derivative": lambda *_: 0.3}, r"derivative of Lying has the shape \(\)"),
        ({"claimed": lambda *_: None}, "claimed of Lying has the shape"),
        ({"claimed": FrictionLaw.claimed}, "Lying does not say its claimed"),
        ({"follows_pressure": False}, "follows the pressure, which it denies"),
        ({"limit": lambda _, p: p + np.nan}, "limit of Lying is not finite at the pressure 0"),
        ({"limit": lambda law, p: np.where(p > 20, np.nan, law.claimed(p))}, "limit of Lying is not finite at .* 2"),
        ({"limit": lambda _, p: p // 0}, "limit of Lying is not finite"),
        ({"limit": lambda law, p: np.multiply(p, law.coefficient, out=p)}, "limit of Lying fails: .* read-only"),
        ({"limit": lambda law, p: law.claimed(p) + law.steepness}, "limit of Lying fails: AttributeError"),
        ({"derivative": lambda _, p: p + np.nan}, "derivative of Lying is not finite at the pressure 0"),
        ({"derivative": lambda law, p: law.coefficient + 0 * p}, "derivative of Lying is not that of its limit"),
        ({"derivative": lambda law, p: F * np.sign(0.5 - p)}, "derivative of Lying is not that of its limit"),
        ({"claimed": lambda law, p: 0.9 * law.limit(p)}, "claimed of Lying is not its limit"),
        (
            {
                "limit": lambda _, p: 0.1 * p + 0.1 * np.clip(p - 3, 0, 6),
                "claimed": lambda law, p: law.limit(p),
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


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_bound_above_its_tangent_in_between(unit):
    """A coefficient of .6 between 2 and 9.9, and else .3, is below its tangent at all powers of ten: statics would say
    that a block slides which this law holds; in every unit of stress.
    """

    def steep(p):
        return np.where((p > 2 * unit) & (p < 9.9 * unit), 0.6, 0.3)

    law = type(
        "Lying",
        (Coulomb,),
        {
            "__module__": __name__,
            "concave": True,
            "unknown": property(lambda _: "the bound"),
            "envelope": FrictionLaw.envelope,
            "limit": lambda _, p: steep(p) * p,
            "derivative": lambda _, p: steep(p),
            "claimed": lambda _, p: p * steep(p),
        },
    )(0.3).sampled(np.zeros((3, 4)))
    assert re.search(r"exceeds, at the pressure 2\.\d+(e[+-]09)?, its tangent", fault_of(law, 4, 1000.0 * unit))
    assert not fault_of(Saturating(0.3, 3.0 * unit).sampled(np.zeros((3, 4))), 4, 1000.0 * unit)


def test_a_law_of_the_package_with_another_limit():
    """Is not taken for that of the package, whose envelope it has."""

    class Half(Coulomb):
        def limit(self, pressure):
            return 0.5 * super().limit(pressure)

    with pytest.raises(FormError, match="less than its envelope"):
        solved(Half(F))


class Steeper(Saturating):
    """Twice what its tangent at zero says in a band between two of the pressures at which laws are tried."""

    def limit(self, pressure):
        return super().limit(pressure) * np.where((pressure > 15) & (pressure < 25), 2.0, 1.0)

    def claimed(self, pressure):
        return super().claimed(pressure) * (1 + ((pressure > 15) & (pressure < 25)))


def test_at_the_pressures_of_the_solution(monkeypatch):
    """Nothing rests on what a law says of itself and does not keep there, and it is named."""
    monkeypatch.setattr(foundations_on_points, "fault_of", lambda *_: "")
    solution, honest = pushed(Steeper(F, 1e4), 1.2), pushed(Saturating(F, 1e4), 1.2)
    assert solution.converged
    assert honest.safety is not None
    assert solution.safety is None
    told = {finding.path: finding.message for finding in solution.findings}
    assert "the friction law saturating is larger than it says at pressures" in told["contact[0].friction"]


def test_a_wrong_derivative(monkeypatch):
    """Solves do not need it, gradients do: these compare it with differences at the pressures of the solution, too."""
    monkeypatch.setattr(foundations_on_points, "fault_of", lambda *_: "")
    problem = solved(lying(derivative=lambda law, p: law.coefficient + 0 * p)).problem
    assert problem.certificate.holds
    with pytest.raises(FormError, match=r"derivative is 0\.4 at the pressure"):
        problem.gradient("force 0 x", [])


@pytest.mark.parametrize("kind", [Saturating, Quotient, Root])
@pytest.mark.parametrize("modulus", [1e-9, 1e-6, 1.0, 1e6])
def test_honest_laws(kind, modulus):
    """Are not refused, however far their bounds bend from the modulus of the body."""
    law = kind(F, K).sampled(np.zeros((3, 2)))
    assert not fault_of(law, 2, modulus)


@pytest.mark.parametrize("more", [{}, {"cap": 2.0}])
def test_a_law_derived_from_coulomb(more):
    """Has the bound, the derivative and the independent check of Coulomb's law, beyond its cap too."""
    law = type("Mine", (Coulomb,), {"__module__": __name__})(F, **more).sampled(np.zeros((3, 2)))
    assert law.of_a_user
    assert not fault_of(law, 2, 1000.0)


def between(p, modulus=5000.0):
    """Whether a pressure is in the middle between two of those at which laws are tried in a body of this modulus."""
    places = np.log10(np.maximum(p, 1e-30) / modulus) * 32
    return (p > 0.1) & (np.abs(places - np.floor(places) - 0.5) < 0.25)


class InBetween(FrictionLaw):
    """0.3 times the pressure, which is true at all pressures that are tried before the solve."""

    law: str = "in between"
    concave = True

    def limit(self, pressure):
        return 0.3 * pressure

    def derivative(self, pressure):
        return 0.3 + 0 * pressure

    def claimed(self, pressure):
        return pressure * 0.3


FALSE_IN_BETWEEN = {
    "claimed of Lying is not its limit": {"claimed": lambda _, p: np.where(between(p), 0.29, 0.3) * p},
    "limit of Lying is not finite": {"limit": lambda _, p: np.where(between(p), np.nan, 0.3 * p)},
    "limit of Lying is negative": {"limit": lambda _, p: np.where(between(p), -1.0, 0.3 * p)},
    "derivative of Lying is not finite": {"derivative": lambda _, p: np.where(between(p), np.nan, 0.3)},
    "derivative of Lying is not that of its limit": {"derivative": lambda _, p: np.where(between(p), -3.0, 0.3)},
    "the bound of the friction law in between is larger than it says": {
        "limit": lambda _, p: np.where(between(p), 0.6, 0.3) * p,
        "claimed": lambda _, p: p * np.where(between(p), 0.6, 0.3),
        "derivative": lambda _, p: np.where(between(p), 0.6, 0.3),
    },
}


@pytest.mark.one_quick
@pytest.mark.parametrize("coulomb", ["auto", "newton"])
@pytest.mark.parametrize("reason", FALSE_IN_BETWEEN)
def test_what_is_false_between_the_pressures_that_are_tried(reason, coulomb):
    """It is tried at the pressures of the result, too: whatever the outcome is, a warning names law and statement."""
    law = type("Lying", (InBetween,), {"__module__": __name__, **FALSE_IN_BETWEEN[reason]})()
    try:
        said = "\n".join(f"{found.path}: {found.message}" for found in pushed(law, 3.0, coulomb=coulomb).findings)
    except ConvergenceError as error:
        said = str(error)
    assert re.search(rf"contact\[0\]\.friction: .*{reason}", said)


def test_a_true_law_is_not_doubted():
    """At the pressures of a result, also where they change their order of magnitude from point to point."""
    solution = pushed(InBetween(), 3.0)
    assert solution.converged
    assert not [found for found in solution.findings if found.path == "contact[0].friction"]


@pytest.mark.parametrize("converges", [True, False])
def test_forms_name_a_false_law(converges):
    """In the error, and in the findings of a solution."""
    plain = Block((12, 4))
    modulus = modulus_of_energy(plain.a, plain.V)
    methods = {"derivative": lambda _, p: np.where(between(p, modulus), -3.0, 0.3)}
    if not converges:
        methods = {"claimed": lambda _, p: np.where(between(p, modulus), 0.29, 0.3) * p}
    block = Block((12, 4), friction=type("Lying", (InBetween,), methods)(), gap=lambda x: 0.004 * x[0])
    block.aside.value = 0.004
    said = r"contact\[0\]\.friction: .* in between is not what it says: .* of Lying"
    if converges:
        block.problem.solve()
        (told,) = block.problem.findings
        assert re.search(said, f"{told.path}: {told.message}")
    else:
        with pytest.raises(ConvergenceError, match=said):
            block.problem.solve()


def test_a_proof_that_rests_on_what_a_law_says():
    """Statics knows no more of the law than it says: the outcome names it, and that it was tried at samples alone."""
    with pytest.raises(ConvergenceError, match=r"law in between only the bound is known.*, provided that this bound"):
        pushed(InBetween(), 7.0)
