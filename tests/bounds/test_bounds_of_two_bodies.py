"""Guaranteed bounds of two bodies in contact, in the plane: parts, terms of the proof, and true errors."""

from dataclasses import replace

import numpy as np
import pytest
from bounds_of_pairs import drawn, effectivity, problem, refuted
from scenes import alone

from signorini_fx.addons.bounds import error_bound as proof
from signorini_fx.addons.bounds.equilibrated_stress import Equilibration, Loads
from signorini_fx.addons.bounds.error_bound import error_bound
from signorini_fx.addons.bounds.johnson_mercier import LocalStress
from signorini_fx.addons.bounds.quantity_bounds import force
from signorini_fx.addons.bounds.simplices import IsotropicModuli, Simplices, moments_of
from signorini_fx.addons.bounds.stress_products import energy, square
from signorini_fx.machine.compat import geometry_cells
from signorini_fx.scenes.reading import parse_scene

TRESCA = {"law": "tresca", "bound": 1.5}


def rectangle(nx, ny, length=1.0, height=1.0):
    """A mesh of triangles."""
    parameters = {"nx": nx, "ny": ny, "length": length, "height": height, "cell": "triangle"}
    return {"generator": "rectangle", "parameters": parameters}


def blocks(
    counts=(5, 7),
    young=(1000.0, 1000.0),
    *,
    wide=1.0,
    aside=0.0,
    apart=0.0,
    degree=1,
    poisson=0.3,
    more=None,
    **contact,
):
    """A block pressed onto another one by its top, which is tilted."""
    scene = {
        "body": [
            {"name": "up", "mesh": rectangle(counts[0], counts[0]), "shift": [0.0, 1.0 + apart]},
            {"name": "low", "mesh": rectangle(counts[1], counts[1], wide), "shift": [aside, 0.0]},
        ],
        "element": {"degree": degree},
        "material": [
            {"region": name, "young": e, "poisson": poisson} for name, e in zip(("up", "low"), young, strict=True)
        ],
        "displacement": [
            {"boundary": "low.bottom", "x": 0.0, "y": 0.0},
            {"boundary": "up.top", "x": 0.0, "y": "-0.012 + 0.006*x[0]"},
        ],
        "contact": {"boundary": "up.bottom", "against": "low.top", "points": "boundary", **contact},
        "solver": {"algorithm": "alm"},
    }
    return parse_scene(scene | (more or {}))


@pytest.mark.parametrize("seed", [0, 13])
def test_true_errors_of_random_pairs(seed):
    """One to two times what finer meshes say; energy and force of these are in their intervals."""
    ratio, relative, _, bound, solution, reference = effectivity(drawn(seed))
    assert 1 < ratio < 2
    assert relative < 1
    assert not refuted(solution, reference, bound)


@pytest.mark.slow
@pytest.mark.parametrize("kinds", [{}, {"degree": 2}, {"kind": "bilateral"}, {"kind": "bonded"}, {"held": False}])
def test_true_errors_of_more_random_pairs(kinds):
    """The same of other kinds."""
    ratios = []
    for seed in range(20, 24):
        found = effectivity(drawn(seed, **kinds))
        if isinstance(found, str):
            continue
        ratios.append(found[0])
        assert not refuted(found[4], found[5], found[3])
    assert len(ratios) > 1
    assert min(ratios) > 1
    assert np.median(ratios) < 3


@pytest.mark.parametrize(
    "scene",
    [
        blocks(),
        blocks(wide=1.6, aside=-0.37, degree=2),
        blocks((7, 3), wide=0.8, aside=0.3, young=(10.0, 1000.0), friction=TRESCA),
    ],
    ids=["same width", "wider, degree 2", "narrower"],
)
def test_both_sides_match(scene):
    """Facets lie over each other one to one, cover what the solver's pieces cover, and carry opposite tractions; the
    displacement is the computed one."""
    solution = alone(scene)
    case = problem(solution)
    (surface,), t = case.contacts, case.t
    other = surface.opposite
    np.testing.assert_allclose(t.x[t.facets[surface.facets]], t.x[other.vertices(t)], atol=1e-12)
    assert t.area[surface.facets].sum() == pytest.approx(solution.model.pairs[0].coupling.covered, rel=1e-12)
    assert t.volume.sum() == pytest.approx(case._undivided.volume.sum(), rel=1e-12)
    assert (t.volume > 0).all()
    before = energy(case._undivided, case._undivided.strain_at_corners(*case._on_cells(solution.displacement)))
    assert energy(t, t.strain_at_corners(case.y, case.middle)).sum() == pytest.approx(before.sum(), rel=1e-10)
    stress = case.enclosure.stress
    own, theirs = (stress.tractions[facets] for facets in (surface.facets, other.facets))
    np.testing.assert_allclose(own, -other.over(theirs), atol=1e-9 * np.abs(own).max())
    np.testing.assert_allclose(own, surface.traction, atol=1e-9 * np.abs(own).max())
    assert (surface.pressure >= 0).all()
    assert (np.abs(surface.shear).max(axis=2) <= surface.least).all()


def test_the_master_has_the_length_of_its_facets():
    """Sides that are nominally in contact, at an angle, so that facets that match have different lengths: the same
    forces act on both of them."""
    case = problem(alone(wedge(15.0, distance="nominal")))
    (surface,), t = case.contacts, case.t
    other = surface.opposite
    np.testing.assert_allclose(other.ratio, np.cos(np.radians(15.0)), rtol=1e-9)
    moments = moments_of(t, case.enclosure.stress.tractions)
    forces = [moments[facets].sum(axis=(0, 1)) for facets in (surface.facets, other.facets)]
    assert np.abs(forces[0]).max() > 0.1
    np.testing.assert_allclose(forces[0], -forces[1], rtol=1e-9)
    assert "polygons, paired at their nodes" in str(case.bound())
    assert "polygons" not in str(problem(alone(blocks())).bound())


def wedge(angle=1.5, **contact):
    """A block whose lower side is turned by some degrees."""
    scene = blocks((4, 6), **contact)
    upper = scene.body[0].model_copy(update={"rotation": angle, "pivot": (0.0, 0.0), "shift": (0.0, 1.0)})
    return scene.model_copy(update={"body": (upper, scene.body[1])})


@pytest.mark.parametrize("kind", ["wedge", pytest.param("disk", marks=pytest.mark.slow)])
def test_sides_at_an_angle(kind):
    """A wedge between both sides, and a round side on a flat one: nested meshes keep the polygons."""
    ratio, relative, _, bound, solution, reference = effectivity(wedge() if kind == "wedge" else disk())
    assert 1 < ratio < 2
    assert relative < 1
    assert not refuted(solution, reference, bound)


def disk():
    """A half disk on a block."""
    return parse_scene(
        {
            "body": [
                {
                    "name": "up",
                    "mesh": {
                        "generator": "half_disk",
                        "parameters": {"radius": 2.0, "size": 0.5, "contact_size": 0.1, "contact_zone": 0.3},
                    },
                },
                {"name": "low", "mesh": rectangle(10, 4, 2.0, 1.0), "shift": [-1.0, -1.0]},
            ],
            "material": [{"region": name, "young": 1000.0, "poisson": 0.3} for name in ("up", "low")],
            "displacement": [
                {"boundary": "low.bottom", "x": 0.0, "y": 0.0},
                {"boundary": "up.top", "x": 0.0, "y": -0.02},
            ],
            "contact": {"boundary": "up.arc", "against": "low.top", "points": "boundary"},
        }
    )


def test_a_turned_pair_has_the_bound_of_the_upright_one():
    """Of an interface along no axis."""
    upright = blocks((4, 5))
    c, s = np.cos(np.radians(37)), np.sin(np.radians(37))
    bodies = tuple(body.model_copy(update={"rotation": 37.0, "pivot": (0.0, 0.0)}) for body in upright.body)
    # The shift follows the rotation.
    bodies = (bodies[0].model_copy(update={"shift": (-s, c)}), bodies[1])
    down = f"(-0.012 + 0.006*({c}*x[0] + {s}*x[1]))"
    top = {"boundary": "up.top", "x": f"{-s}*{down}", "y": f"{c}*{down}"}
    turned = blocks((4, 5), more={"displacement": [{"boundary": "low.bottom", "x": 0.0, "y": 0.0}, top]})
    found, reference = (alone(one).error_bound for one in (turned.model_copy(update={"body": bodies}), upright))
    assert found.error == pytest.approx(reference.error, rel=1e-6)
    assert found.size == pytest.approx(reference.size, rel=1e-8)


def test_both_choices_of_the_points():
    """Either side may carry them: two bounds of two solutions, both valid and alike."""
    scene = blocks((5, 8), wide=1.5, aside=-0.2, young=(1000.0, 300.0), friction=TRESCA)
    contact = scene.contact[0].model_copy(update={"points": "against"})
    found = [effectivity(one) for one in (scene, scene.model_copy(update={"contact": (contact,)}))]
    assert all(1 < one[0] < 1.6 for one in found)
    assert found[0][3].error == pytest.approx(found[1][3].error, rel=0.1)


@pytest.mark.one_quick
@pytest.mark.parametrize("friction", [None, TRESCA])
def test_nodes_that_nearly_meet(friction):
    """A corner of one body near a node of a wider one, where the traction jumps: the bound hardly depends on the
    distance, from round-off to a part of a facet."""
    more = {} if friction is None else {"friction": friction}
    far = alone(blocks((5, 8), wide=1.6, aside=-0.4, **more)).error_bound.error
    for offset in (1e-12, 1e-6, 1e-3, 5e-2):
        found = alone(blocks((5, 8), wide=1.6, aside=-0.4 + 0.2 * offset, **more)).error_bound
        assert 0.85 * far < found.error < 1.15 * far


def test_corners_that_nearly_meet():
    """Neither can be moved: refused where the triangle between them is too thin, with the place."""
    near = alone(blocks((4, 4), aside=0.02)).error_bound
    assert near.error == pytest.approx(alone(blocks((4, 4))).error_bound.error, rel=0.1)
    reason = alone(blocks((4, 4), aside=1e-5)).error_bound
    assert "do not nearly meet" in reason
    assert "near (1, 1)" in reason or "near (1e-05, 1)" in reason


def chained(**more):
    """Three blocks on each other, of which contact alone holds the one between."""
    names, counts = ("top", "middle", "base"), (4, 5, 3)
    return parse_scene(
        {
            "body": [
                {"name": name, "mesh": rectangle(n, n), "shift": [0.0, 2.0 - k]}
                for k, (name, n) in enumerate(zip(names, counts, strict=True))
            ],
            "material": [{"region": name, "young": 1000.0, "poisson": 0.3} for name in names],
            "displacement": [{"boundary": "base.bottom", "x": 0.0, "y": 0.0}],
            "traction": {"boundary": "top.top", "y": "where(x[0] < 0.5, -4, -2)", "x": 0.5},
            "contact": [
                {"boundary": "top.bottom", "against": "middle.top", "friction": TRESCA},
                {"boundary": "middle.bottom", "against": "base.top", "friction": TRESCA},
            ],
        }
        | more
    )


def test_a_chain_that_contact_alone_holds():
    """Pressures of both contacts balance loads together; statics determines the forces."""
    ratio, _, _, bound, solution, reference = effectivity(chained())
    assert 1 < ratio < 2
    assert not refuted(solution, reference, bound)
    for name in ("top.bottom", "middle.bottom"):
        low, high = solution.force_bounds(name, (0.0, 1.0))
        assert low <= 3.0 <= high
        assert high - low < (1e-6 if name == "top.bottom" else 3.0)
    assert len(np.unique(problem(solution).group_of_piece)) == 1


@pytest.mark.parametrize("factor", [0.0, 1.0, 1e4])
def test_tractions_in_balance_from_anywhere(factor):
    """From none and from random ones that are much too large: admissible, and the bound holds."""
    solution, chance = alone(chained()), np.random.default_rng(1)
    wrong = factor * chance.uniform(size=solution.contact.pressure.shape)
    case = proof.Bounded(solution.model, solution.displacement, replace(solution.contact, pressure=wrong), 0.0)
    assert case.enclosure.stress.missing < 1e-6 * case.enclosure.size
    for surface in case.contacts:
        assert (surface.pressure >= 0).all()
        assert (np.linalg.norm(surface.shear, axis=2) <= surface.least).all()
    forces = [(one.pressure.mean(axis=1) * case.t.area[one.facets]).sum() for one in case.contacts]
    np.testing.assert_allclose(forces, 3.0, rtol=1e-9)
    assert case.bound().error > 0.9 * solution.error_bound.error


def test_forces_of_both_sides():
    """The force on one side has bounds, the force on the other one opposite ones; friction as well."""
    solution = alone(blocks((5, 7), friction=TRESCA))
    for direction in ((0.0, 1.0), (0.6, 0.8)):
        own, theirs = (solution.force_bounds(name, direction) for name in ("up.bottom", "low.top"))
        force = np.array(sum(solution.contact.forces)) @ direction
        assert own[0] < force < own[1]
        assert theirs[0] < -force < theirs[1]
    support = solution.force_bounds("low.bottom", (0.0, 1.0))
    assert support[0] < np.array(sum(solution.contact.forces))[1] < support[1]
    low, high = solution.mean_displacement_bounds("low.left", (1.0, 0.0))
    assert low < high


# --- what each term is needed for -------------------------------------------------------------------------------------


def at_rest(*, friction=None, gap=0.0, apart=0.0, down=0.0):
    """Two blocks without loads, which are not strained, the upper one moved down: any strain of a displacement is an
    error."""
    contact = {"gap": gap} | ({} if friction is None else {"friction": friction})
    held = [
        {"boundary": "low.bottom", "x": 0.0, "y": 0.0},
        {"boundary": "up.top", "x": 0.0, "y": -down},
    ]
    sides = [{"boundary": f"{name}.{side}", "y": 0.0} for name in ("up", "low") for side in ("left", "right")]
    held += sides if friction is not None else []
    solution = alone(blocks((3, 4), poisson=0.0, apart=apart, more={"displacement": held}, **contact))
    assert np.abs(solution.displacement.x.array).max() == pytest.approx(down, abs=1e-12)
    return solution


def with_field(solution, field):
    """Its displacement exchanged by a function of x, y and whether the point is in the upper block, and the norm."""
    y = solution.displacement.copy()
    mesh = y.function_space.mesh
    x = mesh.geometry.x[:, :2]
    cells = geometry_cells(mesh)
    upper = np.zeros(len(y.x.array) // 2, dtype=bool)
    for cell, corners in enumerate(cells):
        upper[y.function_space.dofmap.list[cell]] = x[corners].mean(axis=0)[1] > 1
    at = y.function_space.tabulate_dof_coordinates()
    y.x.array.reshape(-1, 2)[:] = [field(*point[:2], up) for point, up in zip(at, upper, strict=True)]
    case = problem(replace(solution, displacement=y))
    strain = case._undivided.strain_at_corners(*case._on_cells(y))
    return y, float(np.sqrt(energy(case._undivided, strain).sum()))


def without(monkeypatch, change):
    """The next bounds have another term of the contact; ``change``: of what the proof takes."""
    original = proof.Bounded._on_contact
    monkeypatch.setattr(proof.Bounded, "_on_contact", lambda self, *given: change(self, original(self, *given)))


@pytest.mark.parametrize("apart", [0.0, 0.05], ids=["gap", "geometry"])
@pytest.mark.parametrize("sign", [1, 0, -1])
def test_pressure_over_an_open_gap(monkeypatch, sign, apart):
    """A pressure on both sides with the strains that belong to it, while the gap is open: nothing else tells that the
    true solution is zero."""
    pressure = 2.0
    solution = at_rest(gap=0.05 - apart, apart=apart, down=2 * pressure / 1000.0)
    contact = replace(solution.contact, pressure=np.full_like(solution.contact.pressure, pressure))
    lift = pressure / 1000.0
    y, true = with_field(solution, lambda x, z, up: (0.0, lift * (apart - z) if up else -lift * z))
    without(monkeypatch, lambda self, work: sign * work)
    monkeypatch.setattr(proof.Bounded, "_balance", lambda self: None)
    case = proof.Bounded(solution.model, y, contact, 0.0)
    enclosure = case.enclosure
    bound = float(np.sqrt(max(enclosure.duality.sum() + enclosure.v.moved.sum(), 0.0)))
    assert (bound >= true) == (sign == 1)
    assert true > 0.01
    # Nor does the force on the lower body, where stress and strain are those of each other.
    if sign == 1:
        low, high = force(solution.model, y, contact, "low.top", (0.0, 1.0))
        assert low <= 0 <= high


@pytest.mark.parametrize("sign", [1, 0, -1])
def test_shear_against_the_slip(monkeypatch, sign):
    """A friction stress with its strains, and slip in the wrong direction."""
    solution, shear = at_rest(friction=TRESCA), 1.0
    contact = replace(solution.contact, shear=np.full_like(solution.contact.shear, shear))
    # On the upper side mu pulls along minus the tangent, which is minus x.
    tangent = problem(replace(solution, contact=contact)).contacts[0].tangents[0][0, 0]
    turn = 2 * shear / 1000.0 * tangent
    y, true = with_field(solution, lambda x, z, up: ((z - 2) * turn if up else z * turn, 0.0))
    wrong = error_bound(solution.model, y, contact)
    without(monkeypatch, lambda self, work: sign * work)
    found = proof.Bounded(solution.model, y, contact, 0.0).enclosure
    assert found.duality.sum() - found.v.contact.sum() < 1e-12 or sign == 1
    bound = float(np.sqrt(max(found.duality.sum() + found.v.moved.sum(), 0.0)))
    assert (bound >= true) == (sign == 1)
    assert wrong.error >= true > 0.01


@pytest.mark.parametrize("counted", [True, False])
def test_nodes_that_are_moved(monkeypatch, counted):
    """What moves with a node near a corner of the other body is more after that, where the triangles beside it get
    thinner: the difference counts."""
    held = [{"boundary": "low.bottom", "x": 0.0, "y": 0.0}, {"boundary": "up.top", "x": 0.0, "y": 0.0}]
    solution = alone(blocks((3, 8), wide=1.6, aside=-0.4 - 1e-3, poisson=0.0, more={"displacement": held}, gap=0.01))
    case = problem(solution)
    (node,) = np.flatnonzero((case.placed.x != case.given_x).any(axis=1))[:1]
    at = case.given_x[node]

    def hat(x, z, up):
        return (1e-3 * (not up and abs(x - at[0]) + abs(z - at[1]) < 1e-6), 0.0)

    y, true = with_field(solution, hat)
    found = proof.Bounded(solution.model, y, solution.contact, 0.0)
    assert found.moved_nodes > 0
    if not counted:
        found.moved_nodes = 0.0
    assert (found.bound().error >= true) == counted


@pytest.mark.parametrize("degree", [1, 2])
def test_a_gap_that_dips_inside_a_facet(degree):
    """The computed state is uniform; only the displacement without penetration knows what the bodies do where no node
    sees the gap."""
    hump = "max(0, 1 - ((x[0] - 0.28)/0.03)**2)"
    held = [
        {"boundary": "low.bottom", "x": 0.0, "y": 0.0},
        {"boundary": "up.top", "x": 0.0, "y": -2e-5},
    ]
    scene = blocks((4, 4), poisson=0.0, degree=degree, more={"displacement": held}, gap=f"-6e-4*{hump}")
    ratio, _, true, bound, _, _ = effectivity(scene)
    error = bound.error / ratio
    assert true > 1e-3
    assert 1 < ratio < 20
    # Neither the stress nor what is left of the gap tells of it.
    assert bound.duality < 0.9 * error


def test_what_stress_and_strain_tell():
    """Without their difference the bound would be too small."""
    ratio, _, _, bound, solution, _ = effectivity(drawn(4))
    contact = float(problem(solution).enclosure.v.contact.sum())
    assert np.sqrt(contact + bound.moved**2) + bound.data + bound.round_off < 0.9 * bound.error / ratio


@pytest.mark.parametrize("d", [2, 3])
def test_compliance_of_a_cell(d):
    """The forces per displacement of the vertices of its facets do the work that is the energy of their stress."""
    chance = np.random.default_rng(d)
    x = np.concatenate((np.zeros((1, d)), np.eye(d))) + 0.2 * chance.normal(size=(d + 1, d))
    t = Simplices(x, np.arange(d + 1)[None], IsotropicModuli(np.full(1, 1.3), np.full(1, 0.7), d))
    local, y = LocalStress(t), chance.normal(size=d * d * (d + 1))
    moments = (local.compliance[0] @ y).reshape(d + 1, d, d)
    tractions = (d * (d + 1) * moments - d * moments.sum(axis=1, keepdims=True)) / t.area[t.facets_of[0]][:, None, None]
    stress, missed = local.stress(tractions[None], np.zeros((1, d + 1, d)))
    assert missed.max() < 1e-12
    assert square(t, stress)[0] == pytest.approx(float(y @ moments.ravel()), rel=1e-9)


@pytest.mark.parametrize("base", [1e-1, 1e-2, 1e-3])
def test_thin_triangles(base):
    """What a sliver misses of its balance grows with the fourth power of its aspect, not with the eighth."""
    x = np.array([[0.0, 0.0], [0.5, 0.0], [0.5 + base, 0.0], [1.0, 0.0], [0.5, 1.0]])
    corners = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4]])
    t = Simplices(x, corners, IsotropicModuli(np.full(3, 1.3), np.full(3, 0.7), 2))
    held, traction = np.zeros((len(t.facets), 2, 2)), np.zeros((len(t.facets), 2, 2))
    low = np.abs(t.x[t.facets]).max(axis=1)[:, 1] < 1e-12
    held[low] = np.eye(2)
    traction[np.setdiff1d(t.outer, np.flatnonzero(low))] = [1.0, 2.0]
    stress = Equilibration(t, held).stress(Loads(np.zeros((3, 3, 2)), traction), np.zeros_like(traction))
    assert stress.missing < 1e-11 * base**-4


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        (blocks(apart=0.01, friction=TRESCA), "sides are apart"),
        (blocks(apart=0.01, distance="nominal", friction=TRESCA), "sides are apart"),
        (blocks(kind="bilateral", gap="1e-4*abs(x[0] - 0.33)"), "no polynomial of degree 2"),
        (blocks(apart=0.01, gap="where(x[0] < 0.5, 0, -0.02)", adjust=0.02), ""),
    ],
)
def test_what_has_no_bound(scene, reason):
    """Each with its reason; or a bound."""
    found = alone(scene).error_bound
    assert (reason in found) if reason else not isinstance(found, str)


def pushed_back(aside=0.0, counts=(3, 4)):
    """A block that slides in uniform states on one as wide, and slides back in the second load step."""
    size, pressed, bound = 1000.0, 2e-3, 0.7
    sides = [
        {"boundary": f"{name}.{side}", "x": 0.0, "y": f"{sign * bound}*(3 - 2*t)", "factors": [1.0, 1.0]}
        for name in ("up", "low")
        for side, sign in (("left", -1), ("right", 1))
    ]
    top = {"boundary": "up.top", "x": "0.01*(2 - t)", "y": -2 * pressed, "factors": [1.0, 1.0]}
    more = {
        "displacement": [{"boundary": "low.bottom", "x": 0.0, "y": 0.0}, top],
        "traction": sides,
        "load_steps": {"times": [1.0, 2.0]},
    }
    return blocks(counts, (size, size), aside=aside, poisson=0.0, more=more, friction={"law": "tresca", "bound": bound})


def test_slip_that_turns_back():
    """The second load step is exact, and its slip counts from the first one; where a node is moved it is not known."""
    solution = alone(pushed_back())
    bound = solution.error_bound
    assert bound.relative < 1e-5
    assert "the computed displacement of the one before" in str(bound)
    assert (solution.contact.shear * solution.contact.u_t).sum() < 0
    held = [
        {"boundary": "low.bottom", "x": 0.0, "y": 0.0, "factors": [1.0, 1.0]},
        {"boundary": "up.top", "x": 0.0, "y": -0.01, "factors": [1.0, 1.5]},
    ]
    more = {"displacement": held, "load_steps": {"times": [1.0, 2.0]}}
    steps = blocks((3, 8), wide=1.6, aside=-0.4 - 1e-3, friction=TRESCA, more=more)
    assert "do not nearly meet" in alone(steps).error_bound


def test_a_part_that_adjust_closes():
    """A gap that is closed in one part of a contact alone has no bound."""
    scene = wedge(adjust=0.01)
    assert "adjust that closes a part" in alone(scene).error_bound
    assert not isinstance(alone(wedge(adjust=0.2)).error_bound, str)


@pytest.mark.slow
def test_a_certified_accuracy():
    """The strain energy of both bodies to one per cent, on the third mesh."""
    bodies = [
        {"name": "up", "mesh": rectangle(5, 5), "shift": [0.0, 1.0]},
        {"name": "low", "mesh": rectangle(7, 7)},
    ]
    held = [{"boundary": "low.bottom", "y": 0.0}, {"boundary": "up.top", "y": -0.012}]
    held += [{"boundary": f"{name}.left", "x": 0.0} for name in ("up", "low")]
    scene = {
        "body": bodies,
        "element": {"degree": 2},
        "material": [
            {"region": "up", "young": 1000.0, "poisson": 0.3},
            {"region": "low", "young": 3000.0, "poisson": 0.3},
        ],
        "displacement": held,
        "contact": {"boundary": "up.bottom", "against": "low.top", "gap": "0.02*x[0]**2"},
        "accuracy": {"target": 0.005, "certified": True},
    }
    solution = alone(parse_scene(scene))
    low, high = solution.error_bound.strain_energy
    assert len(solution.levels) == 3
    assert (high - low) / (high + low) < 0.01
