"""Faults of a solver of linear pairs that its own map hides: the certificate evaluates that anew and refuses them."""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx.mesh import compute_midpoints
from support.sliding_bodies import SlidingBodies, as_linear_bodies
from two_bodies import grid

from signorini_fx import ConvergenceError, Coulomb, Pair
from signorini_fx.errors import FormError
from signorini_fx.mechanics.obstacles.paired_points import FacingSides
from signorini_fx.mechanics.pairs import mortar_coupling
from signorini_fx.results.certificate import partner_points
from signorini_fx.results.certificate.partner_points import NodalFunctions

DEPTH = 0.02


def bodies(dim, kind, degree=1, **pair):
    """A parabola that is driven into a block, and along it with friction; ``pair``: see ``Pair``."""
    up, away = dim - 1, 1e-6

    def height(x):
        return 0.1 * np.sum(x[:up] ** 2, axis=0)

    def bent(x):
        return np.column_stack((x[:, :up], x[:, up] + height(x.T) * (0.3 - x[:, up]) / 0.3))

    meshes = (
        grid(kind, (*[6] * up, 3), [*[-0.75] * up, -1.0], [*[0.75] * up, 0.0]),
        grid(kind, (*[7 - 2 * (dim - 2)] * up, 1), [*[-0.5] * up, away], [*[0.5] * up, 0.3], bent),
    )
    touching = [lambda x: np.isclose(x[up], 0.0), lambda x: x[up] <= height(x) + 2 * away]
    held = [lambda x: np.isclose(x[up], -1.0), lambda x: np.isclose(x[up], 0.3)]
    pair = pair or {"friction": Coulomb(0.3), "sliding": degree * dim != 6}
    scene = SlidingBodies(kind, meshes, touching, held, degree=degree, pair={"reach": 0.5, **pair})
    scene.drive.value[0], scene.drive.value[-1] = DEPTH / 2, -DEPTH
    return scene


def chosen(overlap, slave):
    """The pieces of the two facets over each other that share most, shape (p,)."""
    names = overlap.slave * (overlap.master.max() + 1) + overlap.master
    pair = names == np.bincount(names, overlap.weight.sum(axis=1)).argmax()
    assert 0 < np.count_nonzero(pair) < len(pair)
    return pair


def of_overlap(change):
    """A solver whose overlap is another one."""

    def wrong(monkeypatch):
        right = mortar_coupling.projected

        def projected(slave, master, reach, comm, *, bonded=False, **settings):
            tested, directions = right(slave, master, reach, comm, bonded=bonded, **settings)
            overlap = change(tested.overlap, slave)
            return mortar_coupling.Tested.of(slave, master, overlap, comm, bonded=bonded), directions

        monkeypatch.setattr(mortar_coupling, "projected", projected)

    return wrong


def without_facet(overlap, slave):
    """The overlap without all that is over a facet of the slave."""
    return overlap.chosen(~np.isin(overlap.slave, overlap.slave[chosen(overlap, slave)]))


def without_piece(overlap, slave):
    """The overlap without what two facets share."""
    return overlap.chosen(~chosen(overlap, slave))


def doubled(overlap, slave):
    """The overlap with twice the area of what two facets share."""
    weight = np.array(overlap.weight)
    weight[chosen(overlap, slave)] *= 2.0
    return replace(overlap, weight=weight)


def shifted(overlap, slave):
    """The overlap with partners of a facet that are elsewhere by a hundredth of theirs."""
    over = np.array(overlap.over)
    over[chosen(overlap, slave)] += 0.01
    return replace(overlap, over=over)


def turned_directions(monkeypatch):
    """Directions of projection that enclose 5 degrees with the mean normals."""
    right = mortar_coupling._mean_normals
    c, s = np.cos(np.radians(5.0)), np.sin(np.radians(5.0))

    def wrong(*given, **settings):
        directions = right(*given, **settings)
        first, last = directions[:, 0].copy(), directions[:, -1].copy()
        directions[:, 0], directions[:, -1] = c * first - s * last, s * first + c * last
        return directions

    monkeypatch.setattr(mortar_coupling, "_mean_normals", wrong)


def unable(monkeypatch):
    """A node of the contact that is said to belong to another one."""
    right = FacingSides.unable.fget

    def wrong(self):
        flags, x = np.array(right(self)), self.slave.surface.x
        flags[np.argmin(np.linalg.norm(x - np.append([0.25] * (x.shape[1] - 1), 0.0), axis=1))] = True
        return flags

    monkeypatch.setattr(FacingSides, "unable", property(wrong))


def farther(monkeypatch):
    """Distances a thousandth larger."""
    couple = mortar_coupling.couple

    def wrong(*given, **settings):
        found = couple(*given, **settings)
        return replace(found, distance=1.001 * found.distance)

    monkeypatch.setattr("signorini_fx.mechanics.obstacles.paired_points.couple", wrong)


FAULTS = {
    "directions": turned_directions,
    "a facet is left out": of_overlap(without_facet),
    "what two facets share is left out": of_overlap(without_piece),
    "an area is doubled": of_overlap(doubled),
    "partners are shifted": of_overlap(shifted),
    "a node is unable": unable,
    "distances are larger": farther,
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize(
    ("kind", "degree"),
    [
        ("quadrilateral", 1),
        ("triangle", 2),
        pytest.param("hexahedron", 1, marks=pytest.mark.slow),
        pytest.param("tetrahedron", 1, marks=pytest.mark.slow),
        pytest.param("tetrahedron", 2, marks=pytest.mark.slow),
    ],
)
def test_faults_of_the_map_are_refused(kind, degree, fault, monkeypatch):
    """What is right is certified, and each fault refused, though forces balance and no rigid motion strains a body."""
    scene = bodies(2 if kind in ("quadrilateral", "triangle") else 3, kind, degree)
    assert as_linear_bodies(scene).certificate.coupling < 1e-9
    FAULTS[fault](monkeypatch)
    with pytest.raises(ConvergenceError, match="certificate does not hold") as raised:
        as_linear_bodies(scene)
    assert raised.value.solution.certificate.coupling > 1e-4


@pytest.mark.slow
def test_functions_of_ties_are_refused_that_are_not_theirs(monkeypatch):
    """Of sides that are tied on quadratic tetrahedra the functions of points are hats: dual ones are refused."""
    scene = bodies(3, "tetrahedron", 2, bonded=True, sliding=False)
    assert as_linear_bodies(scene).certificate.coupling < 1e-9
    right = mortar_coupling.Tested.of
    monkeypatch.setattr(mortar_coupling.Tested, "of", lambda *given, **_: right(*given, bonded=False))
    with pytest.raises(ConvergenceError, match="certificate does not hold") as raised:
        as_linear_bodies(scene)
    assert raised.value.solution.certificate.coupling > 1e-4


@pytest.mark.parametrize("width", [2, 3])
@pytest.mark.parametrize("along", [1, 2])
def test_nodal_functions(along, width):
    """They are one at their own nodes and zero at the others, and their slopes are differences of values."""
    each = np.linspace(0.0, 1.0, width)
    places = np.stack(np.meshgrid(*[each] * along, indexing="ij"), axis=-1).reshape(-1, along)
    functions = NodalFunctions(places)
    assert functions.at(places) == pytest.approx(np.eye(len(places)), abs=1e-12)
    at = np.random.default_rng(0).random((5, along))
    for axis, slopes in enumerate(functions.slopes(at)):
        step = 1e-30j * np.eye(along)[axis]  # a complex step has no differences in it
        assert slopes == pytest.approx(functions.at(at + step).imag / 1e-30, abs=1e-12)


def stacked(kind, counts, low, high, degree):
    """A block below a part of the unit square, which has the points, both 0.3 high."""
    bodies = (
        grid(kind, (*counts[0], 1), [*low, -0.3], [*high, 0.0]),
        grid(kind, (*counts[1], 1), [0.0] * 3, [1.0, 1.0, 0.3]),
    )
    level = [lambda x, z=z: np.isclose(x[2], z) for z in (0.0, -0.3, 0.3)]
    scene = SlidingBodies(kind, bodies, [level[0]] * 2, level[1:], slave=1, degree=degree, pair={"sliding": False})
    scene.drive.value[-1] = -1e-3
    return scene


def test_functions_of_small_parts_of_facets_multiply_round_off():
    """Dual functions on a tenth of the width of 9-node facets are large: distances of sides that touch are round-off
    times these, which is no fault.
    """
    scene = stacked("hexahedron", [(2, 2), (2, 2)], (0.0, 0.0), (0.606, 0.967), 2)
    assert as_linear_bodies(scene).certificate.coupling < 1e-7


def test_whether_a_node_carries_a_point_is_no_matter_of_round_off():
    """The function at the corner keeps the share of its weight below which there is no point, but for round-off."""
    scene = stacked("tetrahedron", [(4, 4), (1, 4)], (0.2, 0.2), (0.7, 0.7), 1)
    assert as_linear_bodies(scene).certificate.coupling < 1e-9


@pytest.mark.parametrize("kind", ["tetrahedron", "hexahedron"])
def test_facets_that_are_looked_at_together_may_see_nothing(kind, monkeypatch):
    """Facet by facet, as on many ranks or of many facets, the certificate finds what it finds of all together."""
    monkeypatch.setattr(partner_points, "_TOGETHER", 8)
    scene = stacked(kind, [(1, 1), (4, 4)], (0.0, 0.0), (0.4, 0.4), 1)
    assert as_linear_bodies(scene).certificate.coupling < 1e-9


@pytest.mark.parametrize("far", [0.1, 0.3, 0.7])
def test_facets_as_far_apart_as_the_reach_are_partners(far):
    """All of them, not those whose distance is more but for round-off."""
    bodies = grid("triangle", (3, 1), [0.0, -0.3], [1.0, 0.0]), grid("triangle", (4, 1), [0.0, far], [1.0, far + 0.3])
    level = [lambda x, y=y: np.isclose(x[1], y) for y in (0.0, far, -0.3, far + 0.3)]
    scene = SlidingBodies("triangle", bodies, level[:2], level[2:], slave=1, pair={"reach": far, "sliding": False})
    scene.drive.value[-1] = -1e-3
    certificate = as_linear_bodies(scene).certificate
    assert certificate.holds
    assert certificate.coupling < 1e-9


def third_of_four(kind, degree=1):
    """A block on another one with four facets along its upper side, of which one contact has the first and the third,
    and a second contact the others: of the second facet all nodes belong to the first contact.
    """
    up = 2 if kind == "hexahedron" else 1
    bodies = (
        grid(kind, (4, *[2] * up), [0.0] * up + [-1.0], [1.0] * up + [0.0]),
        grid(kind, (5, *[2] * up), [0.0] * up + [1e-6], [1.0] * up + [1.0]),
    )
    level = [lambda x, z=z: np.isclose(x[up], z, atol=1e-9) for z in (0.0, 1e-6, -1.0, 1.0)]
    scene = SlidingBodies(kind, bodies, level[:2], level[2:], degree=degree, pair={"sliding": False, "reach": 0.1})
    slave, master = scene.sides
    quarter = np.floor(4 * compute_midpoints(scene.mesh, up, slave)[:, 0]).astype(int)
    parts = [slave[np.isin(quarter, numbers)] for numbers in ((0, 2), (1, 3))]
    scene.drive.value[-1] = -0.01
    scene.pair = [Pair(part, master, reach=0.1, sliding=False) for part in parts]
    return scene


@pytest.mark.parametrize(("kind", "degree"), [("quadrilateral", 1), ("triangle", 1), ("hexahedron", 1)])
def test_facets_of_which_another_contact_owns_all_nodes(kind, degree):
    """Nobody carries what is between both bodies there: an error that names both contacts and the place."""
    scene = third_of_four(kind, degree)
    count = 2 if kind == "hexahedron" else 1
    with pytest.raises(FormError) as raised:
        as_linear_bodies(scene)
    message = f"contact[1]: contact[0] owns all nodes of {count} of its facets"
    assert message in str(raised.value)
    assert "such as that at (0.375, " in str(raised.value)


def test_facets_beside_points_are_carried():
    """In the middle of a facet of degree 2 is a node that the other contact does not own."""
    certificate = as_linear_bodies(third_of_four("triangle", 2)).certificate
    assert certificate.holds
    assert certificate.coupling < 1e-9
