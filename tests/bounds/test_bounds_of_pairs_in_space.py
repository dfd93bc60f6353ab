"""The bound of the error of two bodies in space: true errors, and what each of its terms is for."""

from dataclasses import replace

import numpy as np
import pytest
from error_bounds_in_space import energy_of_difference
from pairs_in_space import drawn, effectivity, on_finer_mesh
from scenes import alone

from signorini_fx.addons.bounds.error_bound import Bounded, error_bound
from signorini_fx.addons.bounds.facets import bernstein
from signorini_fx.addons.bounds.stress_products import energy
from signorini_fx.scenes.reading import parse_scene

SLOW = pytest.mark.slow
TRESCA = {"law": "tresca", "bound": 2.0}


def blocks(counts=((1, 2), (1, 2)), *, degree=1, wide=1.0, apart=0.0, young=(1000.0, 1000.0), more=None, **contact):
    """Two boxes without loads of their own, of which the lower one may be wider."""

    def box(length, count):
        cells = {"nx": count[0] if length == 1.0 else 2 * count[0], "ny": count[1], "nz": 1, "cell": "tetrahedron"}
        return {"generator": "box", "parameters": {"length": length, "width": 1.0, "height": 1.0} | cells}

    return parse_scene(
        {
            "body": [
                {"name": "up", "mesh": box(1.0, counts[0]), "shift": [0.0, 0.0, 1.0 + apart]},
                {"name": "low", "mesh": box(wide, counts[1])},
            ],
            "element": {"degree": degree},
            "material": [
                {"region": name, "young": one, "poisson": 0.0} for name, one in zip(("up", "low"), young, strict=True)
            ],
            "displacement": [
                {"boundary": "low.bottom", "x": 0.0, "y": 0.0, "z": 0.0},
                {"boundary": "up.top", "x": 0.0, "y": 0.0, "z": -0.01},
            ],
            "contact": {"boundary": "up.bottom", "against": "low.top"} | contact,
        }
        | (more or {})
    )


def problem(solution, **changed):
    """The solution as plain arrays."""
    one = replace(solution, **changed) if changed else solution
    return Bounded(one.model, one.displacement, one.contact, 0.0)


# --- true errors ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "scene",
    [
        drawn(4),
        drawn(3),
        blocks(wide=2.0, gap="0.004*x[0]"),
        pytest.param(drawn(0), marks=SLOW),
        pytest.param(drawn(5, kind="bonded", degree=1), marks=SLOW),
        pytest.param(drawn(202, kind="bilateral", degree=1), marks=SLOW),
        drawn(15, unmatched=True, degree=1),
        pytest.param(drawn(3, unmatched=True, degree=1), marks=SLOW),
        pytest.param(drawn(0, unmatched=True, degree=2), marks=SLOW),
    ],
    ids=[
        "frictionless",
        "Tresca",
        "wider",
        "degree 2",
        "bonded",
        "bilateral",
        "unmatched",
        "unmatched, Tresca",
        "unmatched, degree 2",
    ],
)
def test_true_errors(scene):
    """The bound is above the true error, and the finer solution does not refute the interval of the energy."""
    found = effectivity(scene)
    assert not isinstance(found, str), found
    ratio, _, _, bound, _, reference = found
    assert 1 < ratio < 3
    assert bound.strain_energy[0] <= reference.last_step.strain_energy <= bound.strain_energy[1]


@pytest.mark.long
@pytest.mark.parametrize("kinds", [{}, {"kind": "bonded"}, {"kind": "bilateral"}, {"unmatched": True}])
def test_true_errors_of_many(kinds):
    """The same of many, with their median."""
    found = [effectivity(drawn(seed, degree=1, **kinds)) for seed in range(20)]
    ratios = [one[0] for one in found if not isinstance(one, str)]
    assert len(ratios) > 10
    assert min(ratios) > 1
    assert np.median(ratios) < 2.5


@pytest.mark.parametrize(
    ("seed", "kinds"),
    [
        (3, {}),
        pytest.param(4, {}, marks=SLOW),
        pytest.param(15, {"unmatched": True, "degree": 1, "held": True}, marks=SLOW),
    ],
)
def test_displacements_and_pressures_that_are_wrong(seed, kinds):
    """Disturbed by some per cent each: the bound is one of the disturbed displacement."""
    scene, chance = drawn(seed, **kinds), np.random.default_rng(seed)
    solution, reference = alone(scene), on_finer_mesh(scene)
    place = solution.model.space.tabulate_dof_coordinates()[:, 2]
    away = (place - place.min()) * (place.max() - place) / np.ptp(place) ** 2  # which keeps to supports
    for size in (0.1, 1.0):
        wrong = solution.displacement.copy()
        values = wrong.x.array.reshape(-1, 3)
        values += size * np.abs(values).max() * away[:, None] * chance.normal(size=values.shape)
        factor = 1 + 0.2 * size * chance.normal(size=solution.contact.pressure.shape)
        contact = replace(solution.contact, pressure=solution.contact.pressure * factor)
        bound = error_bound(solution.model, wrong, contact)
        assert energy_of_difference(replace(solution, displacement=wrong), reference) < bound.error


# --- both sides -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("points", ["boundary", pytest.param("against", marks=SLOW)])
def test_both_sides_match(points):
    """Facets lie over each other one to one, vertex over vertex in any order, and carry opposite tractions."""
    case = problem(alone(blocks(((2, 3), (2, 3)), points=points, friction=TRESCA, degree=2, gap="4e-3*x[0]*x[1]")))
    (surface,), t = case.contacts, case.t
    other = surface.opposite
    twice = np.take_along_axis(other.order, other.order, axis=1)
    assert (twice != np.arange(3)).any()  # some orders are no exchange of two
    assert (np.ptp(surface.pressure, axis=1) > 0.1 * surface.pressure.max()).any()
    np.testing.assert_allclose(t.x[t.facets[surface.facets]], t.x[other.vertices(t)], atol=1e-12)
    assert t.area[surface.facets].sum() == pytest.approx(1.0)
    own, theirs = (case.enclosure.stress.tractions[facets] for facets in (surface.facets, other.facets))
    np.testing.assert_allclose(own, -other.over(theirs), atol=1e-9 * np.abs(own).max())
    np.testing.assert_allclose(own, surface.traction, atol=1e-9 * np.abs(own).max())
    # A displacement of degree 2 that is the same function on both sides does not jump.
    chance = np.random.default_rng(1)
    slope, bend = chance.normal(size=(3, 3)), chance.normal(size=(3, 3, 3))

    def field(x):
        return x @ slope.T + np.einsum("kij,ni,nj->nk", bend, x, x)

    y, middle = field(t.x), field(t.x[t.edges].mean(axis=1))
    np.testing.assert_allclose(case.relative(surface, y, middle), 0.0, atol=1e-12)
    # Nor where it is turned: of vertices in an order that is no exchange of two, edges go with theirs.
    order = np.array([[1, 2, 0]])
    turned = replace(other, facets=other.facets[:1], order=order)
    assert (np.sort(turned.edges(t)[0]) == np.sort(t.edges_of_facets[other.facets[0]])).all()
    for column in range(3):
        ends = set(t.edges[turned.edges(t)[0, column]])
        assert set(turned.vertices(t)[0]) - ends == {turned.vertices(t)[0, column]}
    values = chance.normal(size=(1, 3, 2))
    np.testing.assert_array_equal(turned.under(turned.over(values)), values)
    np.testing.assert_array_equal(turned.over(values), values[:, [1, 2, 0]])


def test_a_displacement_that_does_not_enter():
    """At many points of all facets, along both directions of friction where it sticks."""
    solution = alone(blocks(((2, 2), (2, 2)), degree=2, gap="-2e-4 - 3e-3*x[0]*x[1]", friction=TRESCA))
    case = problem(solution)
    (surface,), chance = case.contacts, np.random.default_rng(2)
    y = case.enclosure.v
    local = chance.dirichlet(np.ones(3), 200)
    jump = np.einsum("fqd,fd->fq", bernstein(local) @ case.relative(surface, y.y, y.middle), surface.normal)
    x = np.einsum("qa,fad->fqd", local, case.t.x[case.t.facets[surface.facets]])
    gap = -2e-4 - 3e-3 * x[..., 0] * x[..., 1]
    assert (jump <= gap + 1e-12).all()
    assert np.abs(jump - gap).min() < 1e-6


# --- what each term is needed for -------------------------------------------------------------------------------------


def at_rest(counts=((1, 2), (1, 2)), *, friction=None, gap=0.0, down=0.0):
    """Two blocks without loads, which are not strained, the upper one moved down."""
    held = [
        {"boundary": "low.bottom", "x": 0.0, "y": 0.0, "z": 0.0},
        {"boundary": "up.top", "x": 0.0, "y": 0.0, "z": -down},
    ]
    contact = {"gap": gap} | ({} if friction is None else {"friction": friction})
    return alone(blocks(counts, more={"displacement": held}, **contact))


def with_field(solution, field):
    """Its displacement exchanged by a function of the position and whether the point is in the upper block, and the
    norm."""
    y = solution.displacement.copy()
    case = problem(solution)
    values = y.x.array.reshape(-1, 3)
    at, dofs = y.function_space.tabulate_dof_coordinates(), y.function_space.dofmap.list
    upper = np.zeros(len(at), dtype=bool)
    upper[dofs[at[dofs].mean(axis=1)[:, 2] > 1]] = True
    values[:] = [field(point, up) for point, up in zip(at, upper, strict=True)]
    case = problem(solution, displacement=y)
    return y, float(np.sqrt(energy(case.t, case.t.strain_at_corners(case.y, case.middle)).sum()))


@pytest.mark.parametrize("counts", [((1, 2), (1, 2)), ((1, 2), (2, 1))], ids=["matching", "unmatched"])
@pytest.mark.parametrize("sign", [1, 0, -1])
def test_pressure_over_an_open_gap(monkeypatch, sign, counts):
    """A pressure on both sides with the strains that belong to it, while the gap is open: nothing else tells that the
    true solution is zero."""
    pressure = 2.0
    solution, lift = at_rest(counts, gap=0.05, down=2 * pressure / 1000.0), pressure / 1000.0
    contact = replace(solution.contact, pressure=np.full_like(solution.contact.pressure, pressure))
    y, true = with_field(solution, lambda x, up: (0.0, 0.0, -lift * x[2]))
    original = Bounded._on_contact
    monkeypatch.setattr(Bounded, "_on_contact", lambda self, *given: sign * original(self, *given))
    monkeypatch.setattr(Bounded, "_balance", lambda self: None)
    enclosure = Bounded(solution.model, y, contact, 0.0).enclosure
    bound = float(np.sqrt(max(enclosure.duality.sum() + enclosure.v.moved.sum(), 0.0)))
    assert (bound >= true) == (sign == 1)
    assert true > 0.01


@pytest.mark.parametrize("counts", [((1, 2), (1, 2)), ((1, 2), (2, 1))], ids=["matching", "unmatched"])
@pytest.mark.parametrize("axis", [1, pytest.param(0, marks=SLOW)])
@pytest.mark.parametrize("sign", [1, 0, -1])
def test_shear_against_the_slip(monkeypatch, sign, axis, counts):
    """A friction stress with its strains along each axis, and slip in the wrong direction, in blocks whose sides across
    it are held along x[2]."""
    solution, shear = at_rest(counts, friction=TRESCA), 1.0
    (surface,) = problem(solution).contacts
    # On the side with the points mu pulls along minus the axis.
    turn = -2 * shear / 1000.0 * surface.normal[0, 2] * np.eye(3)[axis]
    y, true = with_field(solution, lambda x, up: (x[2] - 2) * turn if up else x[2] * turn)
    original = Bounded._on_contact
    monkeypatch.setattr(Bounded, "_on_contact", lambda self, *given: sign * original(self, *given))
    case = Bounded(solution.model, y, solution.contact, 0.0)
    (surface,) = case.contacts
    surface.shear = np.broadcast_to(shear * np.eye(3)[axis], surface.shear.shape)
    case.held[case.t.outer] += np.abs(case.t.normal[case.t.outer, axis])[:, None, None] * np.diag([0.0, 0.0, 1.0])
    found = case.enclosure
    bound = float(np.sqrt(max(found.duality.sum() + found.v.moved.sum(), 0.0)))
    assert (bound >= true) == (sign == 1)
    assert true > 0.01


# --- facets that do not match -----------------------------------------------------------------------------------------


def punch(wide=0.15):
    """A small stiff block that is pressed into a large facet of another one."""

    def box(length, high):
        counts = {"nx": 1, "ny": 1, "nz": 1, "cell": "tetrahedron"}
        return {"generator": "box", "parameters": {"length": length, "width": length, "height": high} | counts}

    return parse_scene(
        {
            "body": [
                {"name": "up", "mesh": box(wide, wide), "shift": [0.6, 0.2, 1.0]},
                {"name": "low", "mesh": box(1.0, 1.0)},
            ],
            "material": [
                {"region": "up", "young": 1e6, "poisson": 0.0},
                {"region": "low", "young": 1000.0, "poisson": 0.3},
            ],
            "displacement": [
                {"boundary": "low.bottom", "x": 0.0, "y": 0.0, "z": 0.0},
                {"boundary": "up.top", "x": 0.0, "y": 0.0, "z": -0.01},
            ],
            "contact": {"boundary": "up.bottom", "against": "low.top"},
        }
    )


@pytest.mark.parametrize("lifted", [True, False])
def test_what_tractions_have_beside_linear_ones(monkeypatch, lifted):
    """Under a punch inside of a facet neither the displacement nor the stress that is linear there knows the dent: only
    the stress that is lifted tells how large it may be."""
    scene = punch()
    if not lifted:
        monkeypatch.setattr(Bounded, "_lifted", lambda self, size: np.zeros(len(self.t.corners)))
    found = effectivity(scene)
    assert not isinstance(found, str), found
    assert (found[0] > 1) == lifted
    assert found[0] < 5


def test_nodes_that_nearly_meet():
    """Slivers between the facets of both sides change nothing: the bound is that of facets that match."""
    down = {"boundary": "up.top", "x": 0.0, "y": 0.0, "z": "-0.01 + 0.005*x[0]"}
    held = [{"boundary": "low.bottom", "x": 0.0, "y": 0.0, "z": 0.0}, down]
    scene, bounds = blocks(((2, 2), (2, 2)), more={"displacement": held}), []
    for apart in (0.0, 1e-7):
        moved = scene.body[0].model_copy(update={"shift": (apart, apart / 2, 1.0)})
        case = problem(alone(scene.model_copy(update={"body": (moved, scene.body[1])})))
        assert (case.contacts[0].refined is None) == (apart == 0.0)
        bounds.append(case.bound().error)
    assert bounds[1] == pytest.approx(bounds[0], rel=0.01)


def refined_case(**more):
    """Two blocks of other meshes, the lower one wider, turned and shifted."""
    return problem(alone(drawn(64, unmatched=True, degree=1, **more)))


def test_triangles_that_both_sides_share():
    """They are at the same places on both sides, cover what both do, and polynomials do not jump."""
    case = refined_case()
    (surface,), t = case.contacts, case.t
    refined = surface.refined
    corners = [refined.local[side] @ t.x[t.facets[refined.facet(side)]] for side in (0, 1)]
    np.testing.assert_allclose(corners[0][..., :2], corners[1][..., :2], atol=1e-12)
    edges = corners[0][:, 1:] - corners[0][:, :1]
    np.testing.assert_allclose(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2, refined.area, atol=1e-14)
    assert min(local.min() for local in refined.local) > -1e-12
    assert refined.covered(0).sum() == pytest.approx(refined.covered(1).sum())
    for side in (0, 1):
        assert (refined.covered(side) <= t.area[refined.facets[side]] * (1 + 1e-12)).all()
    assert (refined.covered(1) < 0.9 * t.area[refined.facets[1]]).any()
    chance = np.random.default_rng(1)
    slope, bend = chance.normal(size=(2, 3)), chance.normal(size=(2, 2, 3))

    def field(x):
        return x[:, :2] @ slope + np.einsum("ijk,ni,nj->nk", bend, x[:, :2], x[:, :2])

    y, middle = field(t.x), field(t.x[t.edges].mean(axis=1))
    np.testing.assert_allclose(case.relative(surface, y, middle), 0.0, atol=1e-12)
    assert np.abs(case.relative(surface, y * [[1, 1, 2]], middle)).max() > 1e-3


def test_tractions_of_both_sides():
    """The linear ones have the moments of what acts, opposite on both sides, and what is left is counted."""
    case = refined_case(friction=True)
    enclosure = case.enclosure
    (surface,), t = case.contacts, case.t
    refined, acting = surface.refined, surface.traction
    assert np.abs(surface.shear).max() > 0
    work = []
    for side, sign in ((0, 1), (1, -1)):
        faces = refined.facets[side]
        linear, squares = refined.projected(acting, side, t.area)
        np.testing.assert_allclose(enclosure.stress.tractions[faces], sign * linear, atol=1e-9 * np.abs(linear).max())
        x = t.x[t.facets[faces]][..., :2]
        ones = np.concatenate((np.ones((*x.shape[:2], 1)), x), axis=2)
        mass = (np.ones((3, 3)) + np.eye(3)) / 12
        work.append(np.einsum("f,fai,ab,fbk->ik", t.area[faces], linear, mass, ones))
        # The square of the traction is that of both parts.
        whole = np.einsum("m,mai,ab,mbj->ij", refined.area, acting, mass, acting)
        kept = np.einsum("f,fai,ab,fbj->ij", t.area[faces], linear, mass, linear)
        np.testing.assert_allclose(squares.sum(axis=0), whole - kept, atol=1e-10 * np.abs(whole).max())
        assert np.linalg.eigvalsh(squares).min() >= 0
        rows = np.arange(len(faces))
        closest, left = refined.projected_on_parts(acting, side, rows, np.eye(3)[None], t.area[faces])
        np.testing.assert_allclose(closest[:, 0], linear, atol=1e-10 * np.abs(linear).max())
        np.testing.assert_allclose(left, np.trace(squares, axis1=1, axis2=2), atol=1e-10 * np.abs(whole).max())
    np.testing.assert_allclose(work[0], work[1], atol=1e-10 * np.abs(work[0]).max())
    assert enclosure.lifted.max() > 0


@pytest.mark.parametrize("kinds", [{}, {"held": False, "degree": 2}], ids=["held", "degree 2"])
def test_a_displacement_that_does_not_enter_other_facets(kinds):
    """At many points of the triangles, on which both sides are found by their places."""
    case = problem(alone(drawn(17, unmatched=True, **({"degree": 1} | kinds))))
    (surface,), t, chance = case.contacts, case.t, np.random.default_rng(2)
    v, local = case.enclosure.v, chance.dirichlet(np.ones(3), 50)
    sides = []
    for side in (0, 1):
        facets = surface.refined.facet(side)
        at = local @ surface.refined.local[side]
        sides.append(
            np.einsum(
                "mqc,mcd->mqd",
                bernstein(at.reshape(-1, 3)).reshape(*at.shape[:2], 6),
                case.on_facets(v.y, v.middle, facets),
            )
        )
    jump = (sides[0] - sides[1]) @ surface.normal[0]
    x = case.on(surface.facets, local, surface.refined)
    gap = (
        x.value(case._statement.contact[0].gap_in(3))
        + np.einsum(
            "mqd,d->mq",
            local @ surface.refined.local[1] @ t.x[t.facets[surface.refined.facet(1)]] - x.x,
            surface.normal[0],
        )
        * case._model.pairs[0].by_geometry
    )
    assert (jump <= gap + 1e-12).all()
    assert np.abs(jump - gap).min() < 1e-5


# --- what is refused --------------------------------------------------------------------------------------------------


def test_what_has_no_bound():
    """Bonds of meshes that do not match, and sides that are not parallel; friction of sides that are apart."""
    assert "meshes that match" in alone(blocks(((1, 2), (2, 2)), kind="bonded")).error_bound
    assert "meshes that match" in alone(blocks(((1, 2), (1, 1)), kind="bilateral")).error_bound
    scene = blocks(((1, 2), (2, 1)), apart=0.05)
    tilted = scene.body[1].model_copy(update={"rotation": (1.0, 0.0, 0.0)})
    bound = alone(scene.model_copy(update={"body": (scene.body[0], tilted)})).error_bound
    assert "flat parallel sides" in bound
    assert "sides are apart" in alone(blocks(((1, 2), (2, 1)), apart=0.005, friction=TRESCA)).error_bound
    assert "sides are apart" in alone(blocks(apart=0.005, friction=TRESCA)).error_bound
    assert not isinstance(alone(blocks(apart=0.001)).error_bound, str)
