"""Terms of proofs that matter for special data only: data that need each of them, drawn at random."""

from dataclasses import replace

import error_bounds
import error_bounds_in_space
import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, example1
from spaces import box
from test_orthotropic import pressed
from test_springs import body

from signorini_fx.addons.bounds.bounded_scene import moduli_of, why_estimated
from signorini_fx.addons.bounds.error_bound import Bounded, error_bound
from signorini_fx.addons.bounds.facets import POINTS, SEEN, bernstein, linear_below
from signorini_fx.addons.bounds.johnson_mercier import constant_forces
from signorini_fx.addons.bounds.korn import korn, on_edges
from signorini_fx.addons.bounds.simplices import ROWS, IsotropicModuli, Simplices
from signorini_fx.addons.bounds.stress_products import energy as energy_of
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.mechanics.effects.body_force import BodyForce
from signorini_fx.mechanics.laws.none import NoFriction
from signorini_fx.mechanics.laws.tresca import Tresca
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving import to_accuracy


def uniform(seed, *, dip, dimension=2, degree=1):
    """A block in a uniform state, pressed and sheared by its top, which each mesh with these nodes holds exactly.

    Its foundation comes up inside one facet (``dip = "gap"``), or its friction bound falls there below what sticking
    needs (``dip = "bound"``): only then there is an error.
    """
    chance = np.random.default_rng(seed)
    size, nx = chance.uniform(0.6, 1.5, dimension), 2 if dimension == 3 else int(chance.integers(2, 5))
    young, poisson = float(10 ** chance.uniform(1, 5)), float(chance.choice([0.0, 0.3]))
    first, second = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    pressed, sheared = 1e-3 * chance.uniform(0.5, 1.5, 2) * [1, dip == "bound"]
    height, up = size[-1], "xyz"[dimension - 1]
    assert dip in ("gap", "bound", "none")
    across, along, shear = -first * pressed, -(first + 2 * second) * pressed, second * sheared
    if dimension == 2:
        shape = {"length": float(size[0]), "height": float(height), "nx": nx, "ny": 2, "cell": "triangle"}
        mesh = {"generator": "rectangle", "parameters": shape}
        # At a quarter of a facet: the nodes and the middles of facets do not see it.
        middle = [size[0] / nx * (chance.integers(nx) + chance.choice([0.25, 0.75]))]
        width = float(size[0]) / nx / 6
    else:
        mesh = box("tetrahedra", (nx, nx, 1), size=tuple(size))
        # Inside a face for the gap, a quadratic from its edges; for the bound, which is linear, on the diagonal of two
        # faces, where a finer mesh has a node.
        inside = np.array([0.5, 0.25 if dip == "gap" else 0.5])
        middle = size[:2] / nx * (chance.integers(nx, size=2) + inside)
        width = float(size[:2].min()) / nx / 8
    far = " + ".join(f"(x[{k}] - {float(at)!r})**2" for k, at in enumerate(middle))
    hump = f"max(0, 1 - (({far})**0.5 / {width!r})**2)"
    bound = f"{float(1.2 * shear)!r} * (1 - {hump})"
    sides = [
        {"boundary": name, "x": float(sign * across), up: float(sign * shear)}
        for name, sign in (("left", -1), ("right", 1))
    ]
    if dimension == 3:
        sides += [{"boundary": name, "y": float(sign * across)} for name, sign in (("front", -1), ("back", 1))]
    top = dict.fromkeys("xyz"[:dimension], 0.0) | {"x": float(sheared * height), up: float(-pressed * height)}
    assert along < 0
    return parse_scene(
        {
            "mesh": mesh,
            "element": {"degree": degree},
            "material": {"young": young, "poisson": poisson},
            "displacement": {"boundary": "top", **top},
            "traction": sides,
            "contact": {
                "boundary": "bottom",
                "gap": f"{-float(0.3 * pressed * height)!r} * {hump}" if dip == "gap" else 0.0,
                "friction": {"law": "tresca", "bound": bound} if dip == "bound" else {"law": "none"},
            },
            "solver": {"algorithm": "exact"},
        }
    )


@pytest.mark.parametrize("dip", ["gap", "bound"])
@pytest.mark.parametrize("seed", [1, 2])
def test_what_dips_inside_a_facet(dip, seed):
    """The computed state is uniform; the bound holds what the body does at the places that no node sees."""
    scene = uniform(seed, dip=dip)
    ratio, _, true, _ = error_bounds.effectivity(scene)
    assert true > 1e-3
    assert 1 < ratio < 50


@pytest.mark.parametrize("dip", ["gap", "bound"])
def test_what_dips_inside_a_facet_in_space(dip):
    """The same on a face of a tetrahedron."""
    found = error_bounds_in_space.effectivity(uniform(3, dip=dip, dimension=3))
    assert not isinstance(found, str), found
    assert found[1] > 1e-3
    assert 1 < found[0] < 100


@pytest.mark.parametrize("seed", range(3))
def test_constants_of_thin_triangles(seed):
    """|w| on edges, and |w| and |grad w| in them, of polynomials across the triangle; sums by a rule that is exact."""
    chance = np.random.default_rng(seed)
    slope, turn = chance.uniform(0.2, 0.8), chance.uniform(0, 2 * np.pi)
    flat = np.array([[0.0, 0.0], [1.0, 0.0], [slope, 10 ** chance.uniform(-2.5, -1)]])
    turned = flat @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    t = Simplices(turned, np.array([[0, 1, 2]]), IsotropicModuli(np.ones(1), np.ones(1), 2))
    s, w = (np.polynomial.legendre.leggauss(12)[k] / 2 + 0.5 * (k == 0) for k in (0, 1))
    a, b = (grid.ravel() for grid in np.meshgrid(s, s))
    local = np.column_stack(((1 - a) * (1 - b), a * (1 - b), b))
    area = np.outer(w * (1 - s), w).ravel() * 2 * t.volume[0]
    inside, gradient = (float(one[0]) for one in korn(t))
    for _ in range(6):
        for power in range(6):
            weights = np.array([0.0, 1.0, chance.uniform()])[chance.permutation(3)]
            values = (local @ weights) ** power
            slopes = power * (local @ weights)[:, None] ** max(power - 1, 0) * (weights @ t.gradients[0])
            size = np.sqrt(area @ values**2)
            steep = np.sqrt(area @ (slopes**2).sum(axis=1))
            bounds = on_edges(t, np.array([size]), np.array([steep]))[0]
            for i in range(3):
                ends = weights[[(i + 1) % 3, (i + 2) % 3]]
                there = (ends[0] * (1 - s) + ends[1] * s) ** power
                on_edge = np.sqrt(t.area[t.facets_of[0, i]] * (w @ there**2))
                assert on_edge <= bounds[i] * (1 + 1e-9)
            away = values - area @ values / t.volume[0]
            assert np.sqrt(area @ away**2) <= inside / gradient * steep * (1 + 1e-9) + 1e-12 * size


@pytest.mark.parametrize("seed", [0, 1])
def test_the_regularisation_counts_once(monkeypatch, seed):
    """The bound holds it already: what exceeds the target by a part of it is too much, what just meets it is enough."""
    chance, met = np.random.default_rng(seed), seed == 0
    scene = example1(bound=1.5, nx=9, ny=3, cell="triangle", gamma=float(10 ** chance.uniform(4, 4.3)))
    target, bounds = float(chance.uniform(0.6, 0.8)), []

    def bounded(solved, **_):
        left = solved.level.regularisation
        beyond = -1e-9 if met or bounds else float(chance.uniform(0.2, 0.8)) * left
        bounds.append(target + beyond)
        assert left > 0.1 * target
        return solved, bounds[-1], ""

    monkeypatch.setattr(to_accuracy, "_certified", bounded)
    asked = alone(scene.model_copy(update={"accuracy": Accuracy(target=target, certified=True)}))
    assert len(bounds) == len(asked.levels) == 2 - met
    assert bounds[-1] < target


def jumping(seed):
    """A solution of a random scene whose load jumps inside a facet, where no expression says so."""
    scene = error_bounds.drawn(seed)
    size = 1e-3 * scene.material[0].young
    load = scene.traction[0].model_copy(update={"y": lambda x: np.where(x[0] < 0.77, -2.0 * size, -0.1 * size)})
    contact = scene.contact[0].model_copy(update={"friction": NoFriction()})
    return alone(scene.model_copy(update={"traction": (load, *scene.traction[1:]), "contact": (contact,)}))


@pytest.mark.parametrize("seed", [2, 24])
def test_parts_of_the_bound(seed):
    """What is added up, by what the largest distances have to satisfy."""
    case = error_bounds.problem(jumping(seed))
    found = case.enclosure
    assert found.missed > 1e-3 * found.size
    gap, missed, distance, contact = found.gap, found.missed, found.distance, found.v.contact.sum()
    # The largest A with A^2 <= gap + 2 missed A; the hypercircle has half of |C eps(v) - tau|, and half of the contact.
    assert distance**2 == pytest.approx(gap + 2 * missed * distance, rel=1e-9)
    assert found.radius**2 == pytest.approx((gap + contact) / 4 + missed * distance, rel=1e-9)
    # The functional at v is at most this above its least value.
    above, energy = gap / 2 + missed * distance, energy_of(case.t, found.v.strain).sum() / 2
    bound = case.bound()
    assert (
        bound.work[1]
        >= (bound.size + bound.error) ** 2 / 2 - energy + case.loads.work(found.v.y, found.v.middle) + above
    )
    # A stress that is known badly.
    squares = found.stress.squares + found.size**2 / len(found.stress.squares)
    case.enclosure = found = replace(found, stress=replace(found.stress, squares=squares))
    bound = case.bound()
    assert found.round_off > found.size
    assert bound.error >= np.hypot(bound.duality, bound.moved) + bound.data + found.round_off


@pytest.mark.parametrize("seed", range(4))
def test_the_work_of_a_displacement_that_is_wrong(seed):
    """A block pressed evenly between a load and its foundation, and a multiple of its displacement: larger ones need
    the error in the lower bound, smaller ones how far the functional is above its least value in the upper one."""
    chance = np.random.default_rng(seed)
    pressed = uniform(seed, dip="none")
    rollers = pressed.displacement[0].model_copy(update={"boundary": "left", "x": 0.0, "y": None})
    load = pressed.traction[0].model_copy(update={"boundary": "top", "x": 0.0, "y": -pressed.material[0].young * 1e-3})
    solution = alone(pressed.model_copy(update={"displacement": (rollers,), "traction": (load,)}))
    case, wrong = error_bounds.problem(solution), solution.displacement.copy()
    wrong.x.array[:] *= 1 + (-1) ** seed * float(chance.uniform(0.05, 0.2))
    found = error_bound(solution.model, wrong, solution.contact)
    assert found.work[0] <= case.loads.work(case.y, case.middle) <= found.work[1]
    assert 0.01 * found.size < found.error < found.size


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("power", [0, 0.5, 1, 2, 20])
def test_shear_is_at_most_a_bound_that_vanishes_on_a_part_of_a_facet(dimension, power):
    """A linear function below it that is raised to zero at a vertex is above it beside this."""
    chance, seen = np.random.default_rng(4), SEEN[dimension]
    slopes = chance.normal(size=(200, dimension))
    values = (slopes @ seen.T).clip(min=0.0) ** power if power else (slopes @ seen.T > 0).astype(float)
    values[100:] += chance.uniform(size=100)[:, None]
    linear = linear_below(values, dimension)
    assert (linear >= 0).all()
    assert (linear @ seen.T <= values * (1 + 1e-12) + 1e-15).all()
    # In the mean it is no less than the least value, and what is linear stays.
    assert (linear.mean(axis=1) >= values.min(axis=1) * (1 - 1e-12) - 1e-15).all()
    same = np.exp(chance.normal(size=(5, dimension)))
    np.testing.assert_allclose(linear_below(same @ seen.T, dimension), same, rtol=1e-12)


def test_shear_beside_the_end_of_friction():
    """A block that slides over the place where its friction begins: the admissible shear is below the bound there."""
    scene = uniform(5, dip="bound")
    contact = scene.contact[0]
    length = scene.mesh.parameters["length"]
    bound = Expression(f"max(0, x[0] - {0.3 * length!r}) ** 2 * 0.01")
    rough = contact.model_copy(update={"friction": Tresca(bound=bound)})
    (surface,) = error_bounds.problem(alone(scene.model_copy(update={"contact": (rough,)}))).contacts
    shear = np.linalg.norm(np.einsum("qc,fcd->fqd", POINTS[2], surface.shear), axis=2)
    assert shear.max() > 0
    assert (shear <= surface.bound + 1e-3 * surface.bound.max()).all()  # which is seen at points


def test_friction_of_a_slip_that_changes_its_sign():
    """No less than its integral by many points, for any displacement and shear."""
    solution, chance = alone(uniform(5, dip="bound")), np.random.default_rng(5)
    case = error_bounds.problem(solution)
    one, s = case.contacts[0], (np.arange(4000) + 0.5) / 4000
    for _ in range(20):
        y, middle = chance.normal(size=case.y.shape), chance.normal(size=case.middle.shape)
        least = chance.uniform(size=one.least.shape)
        shear = (least * chance.uniform(-1, 1, least.shape))[:, :, None] * one.tangents[0][:, None]
        bounds = least @ POINTS[2].T
        some = replace(one, pressure=np.zeros_like(least), least=least, bound=bounds, shear=shear)
        local = np.column_stack((1 - s, s))
        v = bernstein(local) @ case.on_facets(y, middle, one.facets)
        slip = v - np.einsum("fqd,fd,fe->fqe", v, one.normal, one.normal)
        work = (least @ local.T * np.linalg.norm(slip, axis=2) - (local @ shear * slip).sum(axis=2)).mean(axis=1)
        work *= case.t.area[one.facets]
        assert (case._on_contact(some, y, middle) >= work * (1 - 1e-6)).all()


def test_the_softest_strain():
    """sigma : eps is at least alpha |eps|^2, for Poisson's ratios of both signs."""
    chance = np.random.default_rng(3)
    for poisson in (-0.9, -0.3, 0.0, 0.3, 0.49):
        lame = np.array([[poisson / (1 + poisson) / (1 - 2 * poisson), 0.5 / (1 + poisson)]])
        t = Simplices(
            np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([[0, 1, 2]]), IsotropicModuli(*lame.T, 2)
        )
        strain = np.concatenate((chance.normal(size=(1, 50, 3)), [[[1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]]), axis=1)
        size = (strain**2 * [1, 1, 2]).sum(axis=2)
        share = (t.stress(strain) * strain * [1, 1, 2]).sum(axis=2) / size
        assert share.min() == pytest.approx(t.moduli.softest[0], rel=1e-9)


@pytest.mark.parametrize(("cells", "dimension"), [("triangle", 2), ("tetrahedra", 3)])
def test_the_softest_strain_of_an_anisotropic_material(cells, dimension):
    """sigma : eps is at least alpha |eps|^2, for strains at random, and little more for the softest one."""
    material = {"orthotropic": {"young": [9.0, 2.0, 1.0], "poisson": [0.3, 0.2, 0.1], "shear": [0.5, 0.7, 0.9]}}
    scene = pressed(body(cells), material)
    d = prepare(scene.statement, load_mesh(scene, MPI.COMM_WORLD), Timings())
    moduli = moduli_of(d, np.arange(1))
    weight = np.where(np.arange(len(ROWS[dimension])) < dimension, 1, 2)
    strain = np.random.default_rng(3).normal(size=(1, 200, len(weight)))
    strain[0, ::2, :dimension] *= 1e-3  # mostly shear, which is soft
    size = (strain**2 * weight).sum(axis=2)
    share = (moduli.stress(strain) * strain * weight).sum(axis=2) / size
    assert moduli.softest[0] <= share.min() <= 1.1 * moduli.softest[0]


def test_a_function_of_python_is_no_proof():
    """Data that are known at points alone make an estimate, those that are expressions a bound."""
    scene = uniform(0, dip="none")
    for load, reason in (("-x[0]", ""), (lambda x: -x[0], "the body force is a function of Python")):
        loaded = scene.model_copy(update={"body_force": (BodyForce(x=load),)})
        d = prepare(loaded.statement, load_mesh(loaded, MPI.COMM_WORLD), Timings())
        assert why_estimated(d) == reason
        if MPI.COMM_WORLD.size == 1:  # bounds are computed on one rank
            assert alone(loaded).error_bound.as_dict()["guaranteed"] is not bool(reason)


@pytest.mark.parametrize("seed", range(2))
def test_what_constants_miss_of_a_body_force(seed):
    """The square of the difference from the constants on thirds that the stress is in equilibrium with."""
    chance = np.random.default_rng(seed)
    a, b, c = (float(one) for one in chance.normal(size=3))
    scene = uniform(seed, dip="none")
    load = BodyForce(x=f"{a} + {b} * x[0]**3", y=f"{c} * x[0] * x[1]**2")
    case = error_bounds.problem(alone(scene.model_copy(update={"body_force": (load,)})))
    t, constants = case.t, constant_forces(case.t, case.loads.body)
    s, w = (np.polynomial.legendre.leggauss(6)[k] / 2 + 0.5 * (k == 0) for k in (0, 1))
    g, h = (grid.ravel() for grid in np.meshgrid(s, s))
    local, weight = np.column_stack(((1 - g) * (1 - h), g * (1 - h), h)), np.outer(w * (1 - s), w).ravel() * 2
    square = np.zeros(len(t.corners))
    for third in range(3):
        corners = t.x[t.corners].copy()
        corners[:, third] = corners.mean(axis=1)
        x = np.einsum("qc,ncd->nqd", local, corners)
        force = np.stack((a + b * x[..., 0] ** 3, c * x[..., 0] * x[..., 1] ** 2), axis=2)
        square += t.volume / 3 * np.einsum("q,nqd->n", weight, (force - constants[:, third][:, None]) ** 2)
    np.testing.assert_allclose(case.loads.missed_inside, square, rtol=1e-6, atol=1e-12 * square.max())


@pytest.mark.parametrize("place", [0.37, 0.41])
def test_a_body_force_that_jumps_unseen(place):
    """A callable is not cut where it jumps inside cells: statics is within the bounds, as two rules are compared."""
    scene = uniform(2, dip="none")
    size = scene.material[0].young * 1e-3
    rollers = scene.displacement[0].model_copy(update={"boundary": "left", "x": 0.0, "y": None})
    force = BodyForce(x=0.0, y=lambda x: np.where(x[0] + x[1] < place, -size, 0.0))
    top = scene.traction[0].model_copy(update={"boundary": "top", "x": 0.0, "y": -size})
    given = scene.model_copy(update={"displacement": (rollers,), "body_force": (force,), "traction": (top,)})
    solution = alone(given)
    width = solution.model.tagged.mesh.geometry.x[:, 0].max()
    exact = size * (place**2 / 2 + width)
    low, high = solution.force_bounds("bottom", (0.0, 1.0))
    assert low <= exact <= high
    assert high - low < 0.1 * exact


def test_round_off_in_space(monkeypatch):
    """What is not in equilibrium with the loads is a part of the bounds of the error and of the work."""
    solution = alone(uniform(4, dip="none", dimension=3))
    plain = solution.error_bound
    original, missing = Bounded._stress, plain.size

    def unbalanced(self):
        stress = original(self)
        return replace(stress, squares=np.full_like(stress.squares, missing**2 / stress.squares.size))

    monkeypatch.setattr(Bounded, "_stress", unbalanced)
    found = error_bound(solution.model, solution.displacement, solution.contact)
    assert found.error >= missing
    # (|u| + e)^2 / 2 alone is 3/2 of |u|^2 wider; that the functional may be 2 |u|^2 higher comes on top.
    assert found.work[1] - plain.work[1] >= (1.5 + 1.9) * plain.size**2


def curved(chance):
    """A block in space with a rough bottom that is pushed aside with Tresca friction."""
    mesh = box("tetrahedra", (2, 2, 1), size=(1.0, 1.0, 0.6))
    x = mesh.mesh.geometry.x
    low = x[:, 2] < 1e-9
    x[low, 2] += 0.1 * chance.uniform(size=np.count_nonzero(low))
    return parse_scene(
        {
            "mesh": mesh,
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0, "y": 0.0, "z": 0.0},
            "traction": {"boundary": "top", "z": -1.0, "y": 0.5},
            "contact": {"boundary": "bottom", "friction": {"law": "tresca", "bound": 0.3}},
        }
    )


def test_friction_on_faces_that_lean():
    """Shears of nodes lie in each face; their work is no less than the integral for any displacement."""
    chance = np.random.default_rng(6)
    case = error_bounds_in_space.problem(alone(curved(chance)))
    one, faces = case.contacts[0], np.arange(1)
    assert np.ptp(one.normal, axis=0).max() > 0.05
    assert np.abs(np.einsum("fad,fd->fa", one.shear, one.normal)).max() < 1e-12 * np.abs(one.shear).max()
    n = 160
    grid = np.array(
        [(i + k, j + k) for k in (1 / 3, 2 / 3) for i in range(n) for j in range(n) if i + j + 3 * k - 1 < n]
    )
    local = np.column_stack((n - grid.sum(axis=1), grid)) / n
    assert len(local) == n * n
    some = replace(one, **{name: getattr(one, name)[faces] for name in ("facets", "normal", "gap", "bound", "before")})
    for _ in range(20):
        y, middle = chance.normal(size=case.y.shape), chance.normal(size=case.middle.shape)
        some = replace(some, pressure=np.zeros((1, 3)), shear=np.zeros((1, 3, 3)))
        v = np.einsum("qc,fcd->fqd", bernstein(local), case.on_facets(y, middle, some.facets))
        slip = v - np.einsum("fqd,fd,fe->fqe", v, some.normal, some.normal)
        work = 0.3 * np.linalg.norm(slip, axis=2).mean(axis=1) * case.t.area[some.facets]
        assert (case._on_contact(some, y, middle) >= work * (1 - 1e-6)).all()
