"""Guaranteed bounds on foundations with shapes: each step of the proof at many points, and true errors."""

from dataclasses import replace

import bounds_on_shapes
import error_bounds
import error_bounds_in_space
import numpy as np
import pytest
from bounds_on_shapes import effectivity
from scenes import alone
from spaces import box

from signorini_fx.addons.bounds.cell_pieces import free_motions
from signorini_fx.addons.bounds.facets import WEIGHTS, bernstein, cubic, times_linear
from signorini_fx.addons.bounds.round_foundations import RoundFacets
from signorini_fx.addons.bounds.simplices import moments_of
from signorini_fx.mechanics.shapes.circle import Circle
from signorini_fx.mechanics.shapes.cylinder import Cylinder
from signorini_fx.mechanics.shapes.sphere import Sphere
from signorini_fx.scenes.reading import parse_scene

TABLE = {"boundary": "bottom"}
CIRCLE = {"shape": "circle", "centre": [0.8, -1.5], "radius": 1.5}
SPHERE = {"shape": "sphere", "centre": [0.4, 0.6, -2.0], "radius": 2.0}
PRESSED = [{"boundary": "left", "x": 0.0}, {"boundary": "top", "y": -0.01}]


def block(shape, *, degree=1, friction=None, held=True, **more):
    """A block on a circle, pressed by its support or by a load."""
    return parse_scene(
        {
            "mesh": {
                "generator": "rectangle",
                "parameters": {"length": 2.0, "height": 1.0, "nx": 9, "ny": 4, "cell": "triangle"},
            },
            "element": {"degree": degree},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": PRESSED if held else PRESSED[:1],
            "traction": [{"boundary": "right", "y": -1.0} if held else {"boundary": "top", "y": -4.0}],
            "contact": {"boundary": "bottom", "foundation": shape, "friction": friction or {"law": "none"}} | more,
        }
    )


def in_space(shape, **more):
    """A block of tetrahedra on a foundation, pressed by a load."""
    return parse_scene(
        {
            "mesh": box("tetrahedra", (3, 3, 2)),
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "front", "y": 0.0}],
            "traction": {"boundary": "top", "z": -4.0},
            "contact": {"boundary": "bottom", "foundation": shape} | more,
        }
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_products_of_polynomials(dimension):
    """Of degree 1 and 2 at any points."""
    chance = np.random.default_rng(dimension)
    local = chance.dirichlet(np.ones(dimension), 40)
    linear, nodal = chance.normal(size=(5, dimension, 2)), chance.normal(size=(5, (3, 6)[dimension - 2], 2))
    expected = ((local @ linear) * (bernstein(local) @ nodal)).sum(axis=2)
    np.testing.assert_allclose(times_linear(linear, nodal) @ cubic(local).T, expected, atol=1e-13)


SHAPES = [
    Circle(centre=(0.3, -1.2), radius=1.2),
    Circle(centre=(0.3, -1.2), radius=1.1, shift=(0.1, 0.0), rotation=20.0, pivot=(1.0, 0.0)),
    Circle(centre=(0.3, 4.0), radius=4.2, hollow=True),
    Sphere(centre=(0.3, 0.2, -1.5), radius=1.4),
    Cylinder(centre=(0.3, 0.2, -1.5), axis=(1.0, 0.5, 0.1), radius=1.4, rotation=(0.0, 10.0, 30.0)),
    Cylinder(centre=(0.3, 0.2, 5.0), axis=(1.0, 0.5, 0.1), radius=5.1, hollow=True),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.said)
@pytest.mark.parametrize("added", [0.0, 0.05, -3.0, 6.0])
def test_the_gap_of_a_facet(shape, added):
    """m is along the normal of the foundation, G the gap in its length, B below it, and what quadrature misses is not
    more than it says; long facets too, and gaps so large that the sign of c changes."""
    chance, d = np.random.default_rng(4), shape.exists_in[0]
    for length in (0.03, 0.2, 0.7, 3.0):
        x = chance.uniform(0, 1, (40, 1, d)) + length * chance.uniform(-0.5, 0.5, (40, d, d))
        x[:, :, -1] *= 0.2
        found = RoundFacets.of(x, shape, added)
        local = chance.dirichlet(np.ones(d), 300)
        at = local @ x
        signed, normal = (part.reshape(40, 300, -1) for part in shape.distance(at.reshape(-1, d)))
        m = local @ found.direction
        size = np.linalg.norm(m, axis=2)
        np.testing.assert_allclose(m, -normal * size[..., None], atol=1e-12)
        gap = size * (signed[..., 0] + added)
        above = gap - (bernstein(local) @ found.below[..., None])[..., 0]
        assert above.min() >= -1e-12
        if length < 0.1:  # and not far below it
            assert above.max() < 4 * length**2


@pytest.mark.one_quick
@pytest.mark.parametrize("dimension", [2, 3])
def test_what_quadrature_misses(dimension):
    """Its bounds hold, and are small on short facets; with many points."""
    chance, d = np.random.default_rng(8), dimension
    shape = SHAPES[0] if d == 2 else SHAPES[3]
    if d == 2:
        s = (np.arange(20000) + 0.5) / 20000
        local = np.column_stack((1 - s, s))
    else:
        n = 150
        grid = np.array(
            [(i + k, j + k) for k in (1 / 3, 2 / 3) for i in range(n) for j in range(n) if i + j + 3 * k - 1 < n]
        )
        local = np.column_stack((n - grid.sum(axis=1), grid)) / n
    rests = list[float]()
    for length in (0.2, 0.7, 4.0):
        x = chance.uniform(0, 1, (30, 1, d)) + length * chance.uniform(-0.5, 0.5, (30, d, d))
        x[:, :, -1] *= 0.2
        found = RoundFacets.of(x, shape, 0.0)
        signed = shape.distance((local @ x).reshape(-1, d))[0].reshape(30, -1)
        size = np.linalg.norm(local @ found.direction, axis=2)
        assert found.short.all() == (length < 1)
        for values, at_points, missed in (
            (size * signed, found.gap, found.missed_gap),
            (1 / size, found.stretch, found.missed_stretch),
        ):
            off = np.abs(values.mean(axis=1) - at_points @ WEIGHTS[d])
            few = 1e-5 * np.abs(values).max()  # of these points
            assert (off <= missed + few)[found.short].all()
        rests.append(float(found.missed_gap[found.short].max(initial=0.0)))
    assert rests[0] < 1e-7 < rests[1]


@pytest.mark.parametrize(
    ("scene", "study"),
    [
        (block(CIRCLE), error_bounds),
        (block(CIRCLE, degree=2, held=False), error_bounds),
        (block({"shape": "circle", "centre": [0.8, 4.0], "radius": 4.12, "hollow": True}), error_bounds),
        (in_space(SPHERE), error_bounds_in_space),
    ],
)
def test_the_displacement_keeps_to_the_foundation(scene, study):
    """At many points of each facet, where the computed one does not; the pressure does not pull."""
    case = study.problem(alone(scene))
    d, one = case.t.dimension, case.contacts[0]
    local = np.random.default_rng(0).dirichlet(np.ones(d), 200)
    at = local @ case.t.x[case.t.facets[one.facets]]
    signed, normal = scene.contact[0].foundation.distance(at.reshape(-1, d))

    def beyond(y, middle):
        own = bernstein(local) @ case.on_facets(y, middle, one.facets)
        return -(own * normal.reshape(own.shape)).sum(axis=2) - signed.reshape(own.shape[:2])

    entered = beyond(case.y, case.middle).max()
    for removed in ((np.zeros_like(case.y),), (case._entered(),), case._withdrawn()):
        assert beyond(*case._admissible(*removed)).max() <= 1e-12
    assert scene.contact[0].foundation.hollow or entered > 1e-6
    assert (one.pressure >= 0).all()
    assert one.pressure.any()


@pytest.mark.parametrize("degree", [1, 2])
def test_the_traction_leans_on_the_foundation(degree):
    """What the stress holds of it has its moments, the rest the size that is said; friction keeps to its bound, and the
    works of both are no less than the integrals by many points, for any displacement."""
    bound = 0.7
    case = error_bounds.problem(
        alone(block(CIRCLE, degree=degree, friction={"law": "tresca", "bound": bound}, held=False))
    )
    case._balance()
    one, chance, count = case.contacts[0], np.random.default_rng(1), 4000
    s = (np.arange(count) + 0.5) / count
    local = np.column_stack((1 - s, s))
    at = local @ case.t.x[case.t.facets[one.facets]]
    signed, outwards = (
        part.reshape(*at.shape[:2], -1) for part in block(CIRCLE).contact[0].foundation.distance(at.reshape(-1, 2))
    )
    n, gap = -outwards, signed[..., 0]
    t = np.stack((-n[..., 1], n[..., 0]), axis=2)
    size = np.linalg.norm(local @ one.round.direction, axis=2)
    turned = np.stack((-one.round.direction[..., 1], one.round.direction[..., 0]), axis=2)
    scaled = (one.shear * turned).sum(axis=2) / (turned**2).sum(axis=2)
    assert np.abs(one.shear - scaled[..., None] * turned).max() < 1e-12
    pressure, shear = (one.pressure @ local.T) * size, (scaled @ local.T) * size
    assert np.abs(shear).max() <= bound
    assert np.abs(shear).max() > 0.9 * bound
    traction = -pressure[..., None] * n - shear[..., None] * t
    rest = traction - local @ one.traction
    assert np.abs(np.einsum("qa,fqd->fad", local, rest)).max() / count < 1e-6 * np.abs(traction).max()
    assert (rest**2).sum(axis=2).mean(axis=1) == pytest.approx(one.missed, rel=1e-5)
    assert one.missed.max() > 1e-4
    sums = []
    for size_of_change in [0.0, *[1e-3] * 20]:
        y = case.y + size_of_change * chance.normal(size=case.y.shape)
        middle = case.middle + size_of_change * chance.normal(size=case.middle.shape)
        v = bernstein(local) @ case.on_facets(y, middle, one.facets)
        along, slip = (v * n).sum(axis=2), (v * t).sum(axis=2)
        works = np.stack((pressure * (gap - along), bound * np.abs(slip) - shear * slip))
        work = case.t.area[one.facets] * works.mean(axis=2).clip(min=0.0).sum(axis=0)
        found = case._on_contact(one, y, middle)
        assert (found >= work * (1 - 1e-4) - 1e-12).all()
        sums.append((found.sum(), work.sum()))
    assert sums[0][0] < 1.1 * sums[0][1]


@pytest.mark.parametrize(
    ("scene", "study"),
    [
        (block(CIRCLE, held=False), error_bounds),
        (block(CIRCLE, degree=2, held=False, friction={"law": "tresca", "bound": 0.7}), error_bounds),
        (in_space(SPHERE), error_bounds_in_space),
        (in_space({"shape": "plane", "point": [0.0, 0.0, 0.0], "normal": [0.05, 0.0, 1.0]}), error_bounds_in_space),
    ],
)
def test_balance_on_a_foundation(scene, study):
    """Tractions that the stress is given balance the loads of a body that is free along its foundation's normal."""
    case = study.problem(alone(scene))
    case._balance()
    modes = free_motions(case.t, case.held).reshape(len(case.t.x), case.t.dimension, -1)
    assert modes.shape[2]
    traction = case.loads.traction.copy()
    for one in case.contacts:
        traction[one.facets] += one.traction
    work = np.einsum("fad,fadk->k", traction, moments_of(case.t, modes[case.t.facets]))
    loads = np.einsum("fad,fadk->k", case.loads.traction, moments_of(case.t, modes[case.t.facets]))
    assert np.abs(loads).max() > 0.1
    assert np.abs(work).max() < 1e-12 * np.abs(loads).max()


@pytest.mark.one_quick
@pytest.mark.parametrize("seed", [1, 2, 4, 9, 11])
def test_true_errors(seed):
    """At most the bound, in the plane."""
    found = effectivity(2, seed)
    assert not isinstance(found, str), found
    assert found[0] > 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2, 3, 4, 5])
def test_true_errors_in_space(seed):
    """At most the bound."""
    found = effectivity(3, seed)
    assert not isinstance(found, str), found
    assert found[0] > 1


@pytest.mark.long
@pytest.mark.parametrize(("dimension", "many", "median"), [(2, 150, 2.5), (3, 40, 3.0)])
def test_many_true_errors(dimension, many, median):
    """The same in many scenes, and how much more than the error the bound is."""
    found = [effectivity(dimension, seed) for seed in range(1000, 1000 + many)]
    ratios = [one[0] for one in found if not isinstance(one, str)]
    assert len(ratios) > many / 2
    assert min(ratios) > 1
    assert np.median(ratios) < median


TOOL = {"force": [0.0, 5.0], "pivot": [0.8, -1.5], "prescribed": {"x": 0.0, "rotation": 0.0}}
BOARD = {
    "shape": "plane",
    "point": [1.0, -0.001],
    "normal": [0.05, 1.0],
    "force": [0.0, 5.0],
    "pivot": [0.9, 0.0],
    "moment": 0.4,
    "prescribed": {"x": 1e-3},
}
HELD = {"displacement": [{"boundary": "top", "x": 0.0, "y": 0.0}]}


def on_tool(shape, *, degree=1, **more):
    """A block that is held at its top, on a foundation that a force presses onto it."""
    scene = {key: getattr(block(CIRCLE, degree=degree), key) for key in ("mesh", "element", "material")}
    return parse_scene(scene | HELD | {"contact": {"boundary": "bottom", "foundation": shape} | more})


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("shape", [CIRCLE | TOOL, BOARD], ids=["circle", "board"])
def test_balance_of_a_tool(shape, degree):
    """The tractions that the stress is given balance its force, and its moment where it may turn; its motion is that of
    the solution."""
    solution = alone(on_tool(shape, degree=degree))
    case = error_bounds.problem(solution)
    computed = solution.steps[-1].tools[0]
    (tool,), x = case.tools, np.random.default_rng(0).normal(size=(5, 2))
    free_turning = 2 in tool.free
    assert tool.displacement(x) == pytest.approx(computed.at(x), rel=1e-6, abs=1e-9)
    case._balance()
    (one,), t = case.contacts, case.t
    traction = np.zeros((len(t.facets), 2, 2))
    traction[one.facets] = one.traction
    forces = moments_of(t, traction)
    assert forces[..., 1].sum() == pytest.approx(5.0, rel=1e-9)
    if free_turning:
        arm = t.x[t.facets] - np.array(shape["pivot"])
        moment = (arm[..., 0] * forces[..., 1] - arm[..., 1] * forces[..., 0]).sum()
        assert moment == pytest.approx(0.4, rel=1e-9)


@pytest.mark.parametrize(
    ("shape", "degree", "largest"),
    [(CIRCLE | TOOL, 1, 3.0), (CIRCLE | TOOL, 2, 3.0), (BOARD, 1, 1.2), (BOARD, 2, 1.5)],
)
def test_true_errors_on_a_tool(shape, degree, largest):
    """At most the bound; without balance, or with a tool that stays where it was, it would be another one."""
    scene = on_tool(shape, degree=degree)
    found = error_bounds.effectivity(scene)
    assert not isinstance(found, str), found
    assert 1 < found[0] < largest
    assert found[3].work is None  # of the force on the tool, too


@pytest.mark.one_quick
@pytest.mark.parametrize(("dimension", "seed"), [(2, 19), (2, 22), (3, 2)])
def test_true_errors_on_driven_shapes(dimension, seed):
    """At most the bound: foundations of any kind that a force moves."""
    found = effectivity(dimension, seed, "driven")
    assert not isinstance(found, str), found
    assert found[0] > 1


def test_a_plane_is_a_gap_along_its_normal():
    """The bound of a plane at an angle is that of an expression along the same direction."""
    plane = {"shape": "plane", "point": [0.0, 0.01], "normal": [0.02, 1.0]}
    size = float(np.hypot(0.02, 1.0))
    table = {"boundary": "bottom", "gap": f"(0.02*x[0] + x[1] - 0.01)/{size}", "direction": [-0.02, -1.0]}
    first, second = (
        alone(scene).error_bound
        for scene in (
            block(plane),
            block(plane).model_copy(update={"contact": parse_scene({**bare(), "contact": table}).contact}),
        )
    )
    assert first.error == pytest.approx(second.error, rel=1e-6)
    assert first.error < 0.5 * first.size


def bare():
    """A scene without contact."""
    return {
        "mesh": {"generator": "rectangle", "parameters": {"length": 2.0, "height": 1.0, "nx": 9, "ny": 4}},
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": PRESSED,
    }


def test_a_large_circle_is_a_plane():
    """Its bound is that of a plane, up to what the curvature of a thousand times the block makes."""
    far = 2000.0
    circle, plane = (
        alone(block(shape)).error_bound.error
        for shape in (
            {"shape": "circle", "centre": [1.0, -far + 0.002], "radius": far},
            {"shape": "plane", "point": [0.0, 0.002], "normal": [0.0, 1.0]},
        )
    )
    assert circle == pytest.approx(plane, rel=0.02)


def test_forces_of_a_circle():
    """Those of a finer mesh lie within their bounds."""

    def finer(nx, degree):
        mesh = block(CIRCLE).mesh
        mesh = mesh.model_copy(update={"parameters": mesh.parameters | {"nx": nx, "ny": nx // 2}})
        return alone(block(CIRCLE, degree=degree).model_copy(update={"mesh": mesh}))

    force = float(finer(72, 2).contact.forces_of_each[0].sum(axis=0)[1])
    for nx, degree, width in ((9, 1, 4.0), (18, 2, 0.6)):
        low, high = finer(nx, degree).force_bounds("bottom", (0.0, 1.0))[:2]
        assert low < force < high
        assert high - low < width * force


@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        (block({"shape": "cone", "tip": [1.0, 0.0], "axis": [0.0, -1.0], "angle": 80.0}), "for planes"),
        (block(CIRCLE, gap="1e-3*x[0]"), "a gap that is a number"),
        (block(CIRCLE, kind="bilateral"), "that contact can leave"),
        (in_space(SPHERE, friction={"law": "tresca", "bound": 0.1}), "in space without friction"),
        (on_tool(CIRCLE | TOOL | {"spring": {"y": 10.0}}), "have no springs"),
        (on_tool(CIRCLE | TOOL, kind="bonded"), "are no bonds"),
        (on_tool(BOARD, friction={"law": "tresca", "bound": 0.1}), "friction has one where none of them moves"),
        (
            block({"shape": "circle", "centre": [0.9, -0.1], "radius": 0.1}, friction={"law": "tresca", "bound": 0.1}),
            "facets that are shorter",
        ),
    ],
)
def test_what_has_no_bound(scene, reason):
    """It is refused with the reason."""
    assert reason in alone(scene, check=False).error_bound


def test_a_shape_of_ones_own():
    """What is made from a circle may have another distance."""

    class Egg(Circle):
        """Not round."""

        def initial(self, x):
            return super().initial(x * [1.0, 1.1])

    scene = block(CIRCLE)
    egg = Egg(centre=(0.8, -1.5), radius=1.5)
    contact = (scene.contact[0].model_copy(update={"foundation": egg}),)
    solution = alone(scene)
    model = replace(solution.model, statement=solution.model.statement.changed(contact=contact))
    assert "for planes" in str(bounds_on_shapes.error_bounds.error_bound(model, solution.displacement, None))
