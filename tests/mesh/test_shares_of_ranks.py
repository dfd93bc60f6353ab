"""How the cells of several bodies are divided among the ranks: equal shares, each with both sides of its contact."""

from itertools import pairwise
from pathlib import Path

import meshio
import numpy as np
import pytest
from mpi4py import MPI
from test_two_bodies_on_ranks import points_of
from test_two_bodies_scenes import DEMO
from two_bodies import grid

from signorini_fx import read_scene, solve
from signorini_fx.mechanics.mesh import distribution, shares_of_ranks
from signorini_fx.mechanics.mesh.tagged import generate_mesh
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

WORLD = MPI.COMM_WORLD


class Ranks:
    """As many ranks as wanted, all in this process: sums over the ranks are those of this one."""

    def __init__(self, size):
        self.size = size

    def Allreduce(self, given, found, op=None):
        if given is not MPI.IN_PLACE:
            found[...] = given


def boxes(*given):
    """Middles of the cells of boxes, each (counts, low, high), and the body of each."""
    found = []
    for counts, low, high in given:
        ticks = [a + (b - a) * (np.arange(n) + 0.5) / n for n, a, b in zip(counts, low, high, strict=True)]
        found.append(np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, len(counts)))
    return np.concatenate(found), np.repeat(np.arange(len(found)), [len(x) for x in found])


def flat(normal, at, length=1.0):
    """Corners of facets with a normal along an axis at points along another one."""
    dim = len(at)
    along = (normal + 1) % dim
    others = [axis for axis in range(dim) if axis != normal]
    corners = np.array(at) + 0.1 * np.array([[0.0] * dim, *np.eye(dim)[others]])
    return corners + np.linspace(0, length, 12)[:, None, None] * np.eye(dim)[along]


@pytest.mark.parametrize("ranks", [1, 2, 3, 4, 6, 7])
def test_two_blocks(ranks):
    """Slices of both blocks, as many cells of each in all of them but for a column."""
    counts = (30, 10), (24, 8)
    middles, body = boxes((counts[0], (0, 0), (3, 1)), (counts[1], (0, -1), (3, 0)))
    owner = shares_of_ranks.shares(Ranks(ranks), middles, flat(1, (0, 0), 3.0))
    assert np.ptp(np.bincount(owner, minlength=ranks)) <= 2
    for number, (_, column) in enumerate(counts):
        own = np.bincount(owner[body == number], minlength=ranks)
        assert np.abs(own - (body == number).sum() / ranks).max() <= column
    if ranks in (2, 3, 6):  # whole columns
        np.testing.assert_array_equal(owner, np.floor(middles[:, 0] * ranks / 3))


@pytest.mark.parametrize(
    ("size", "normal", "cut"),
    [((3, 1, 1), 2, 0), ((1, 1, 3), 2, None), ((1, 2, 3), 2, 1), ((1, 1, 30), 2, 2), ((1, 2, 3), None, 2)],
)
def test_along_the_contact(size, normal, cut):
    """Two ranks are cut apart along the contact of two stacked blocks, unless these are ten times as high as long."""
    size = np.array(size, dtype=float)
    middles, _ = boxes(((4, 4, 5), (0, 0, 0), size * (1, 1, 0.5)), ((4, 4, 5), size * (0, 0, 0.5), size))
    sides = np.empty((0, 3, 3)) if normal is None else flat(normal, (0, 0, size[2] / 2))
    owner = shares_of_ranks.shares(Ranks(2), middles, sides)
    apart = [middles[owner == 0, axis].max() < middles[owner == 1, axis].min() for axis in range(3)]
    assert np.flatnonzero(apart).tolist() == [0 if cut is None else cut]


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_few_cells(dim, scale):
    """No rank is without cells if there are enough; equal columns in a row are cut between their cells."""
    cells = ((1,) * dim, (0,) * dim, (scale,) * dim), ((1,) * dim, (0,) * (dim - 1) + (scale,), (scale,) * dim)
    middles, _ = boxes(*cells)
    assert sorted(shares_of_ranks.shares(Ranks(2), middles, scale * flat(dim - 1, (0,) * dim))) == [0, 1]
    middles, _ = boxes(((3, 3, 3)[:dim], (0,) * dim, (scale,) * dim))
    for ranks in range(1, len(middles) + 1):
        assert (
            np.bincount(
                shares_of_ranks.shares(Ranks(ranks), middles, scale * flat(0, (0,) * dim)), minlength=ranks
            ).min()
            >= 1
        )


@pytest.mark.mpi
def test_whoever_brings_the_cells():
    """The shares are those of one process, also where a rank brings nothing."""
    middles, _ = boxes(((9, 4), (0, 0), (3, 1)), ((7, 3), (0, -1), (3, 0)))
    sides = flat(1, (0, 0), 3.0)
    expected = shares_of_ranks.shares(Ranks(WORLD.size), middles, sides)
    for start in (0, 1):
        first, step = (WORLD.rank - start, WORLD.size - start) if WORLD.size > 1 else (0, 1)
        own = slice(first, None, step) if first >= 0 else slice(0)
        np.testing.assert_array_equal(shares_of_ranks.shares(WORLD, middles[own], sides[own]), expected[own])


def block(kind, counts):
    """The mesh of a block 3 x 1 or 3 x 1 x 1 with so many cells along its axes."""
    generator, sizes, names = (
        ("rectangle", ("length", "height"), ("nx", "ny")),
        ("box", ("length", "width", "height"), ("nx", "ny", "nz")),
    )[len(counts) - 2]
    parameters = {
        "cell": kind,
        **dict(zip(sizes, (3.0, 1.0, 1.0), strict=False)),
        **dict(zip(names, counts, strict=True)),
    }
    return {"generator": generator, "parameters": parameters}


def stack(kind, *counts, **more):
    """Blocks on each other, the lowest held, the highest pressed and pushed."""
    dim = len(counts[0])
    names = [f"block {number}" for number in range(len(counts))]
    below = [0.0] * (dim - 1)
    return parse_scene(
        {
            "body": [
                {"name": name, "mesh": block(kind, count), "shift": [*below, float(height)]}
                for height, (name, count) in enumerate(zip(names, counts, strict=True))
            ],
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": {"boundary": f"{names[0]}.bottom", **dict.fromkeys("xyz"[:dim], 0.0)},
            "traction": {"boundary": f"{names[-1]}.top", "x": 0.1, "xyz"[dim - 1]: "-1 - 0.2 * x[0]"},
            "contact": [
                {"boundary": f"{upper}.bottom", "against": f"{lower}.top", "friction": COULOMB}
                for lower, upper in pairwise(names)
            ],
            **more,
        }
    )


COULOMB = {"law": "coulomb", "coefficient": 0.3}
# Two bodies, three, in 3D, with fewer cells than some numbers of ranks, and on two meshes.
STACKS = {
    "quadrilaterals": ("quadrilateral", (10, 3), (7, 2)),
    "triangles": ("triangle", (6, 2), (4, 2), (8, 2)),
    "hexahedra": ("hexahedron", (6, 2, 2), (4, 1, 1)),
    "tetrahedra": ("tetrahedron", (3, 1, 1), (4, 1, 1)),
    "few": ("quadrilateral", (1, 1), (1, 1)),
}


@pytest.mark.mpi
@pytest.mark.parametrize("name", STACKS)
def test_meshes_of_their_own(name):
    """Equal shares of the cells and, but for a layer of cells, of the facets of each side of each contact."""
    scene = stack(*STACKS[name])
    tagged = load_mesh(scene, WORLD)
    assert np.ptp(WORLD.allgather(tagged.mesh.topology.index_map(tagged.dimension).size_local)) <= 2
    for side in scene.statement.touching:
        own, along = np.array(WORLD.allgather(len(tagged.facets(side)))), STACKS[name][1 + int(side[6])][0]
        assert np.abs(own - own.sum() / WORLD.size).max() <= own.sum() / along


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize(("name", "more"), [*((name, {}) for name in STACKS), ("quadrilaterals", {"levels": 2})])
def test_the_same_as_on_one_rank(name, more):
    """Positions, weights and tractions of all contact points."""
    scene = stack(*STACKS[name], solver=more)
    together, alone = solve(scene, WORLD), solve(scene, MPI.COMM_SELF)
    assert together.certificate.holds
    assert len(together.levels) == len(alone.levels)
    ours, theirs = points_of(together.contact), points_of(alone.contact)
    assert np.abs(alone.contact.shear).max() > 0.01
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


@pytest.mark.mpi
def test_meshes_of_the_caller():
    """Each rank brings the cells that it owns."""
    scene = stack(*STACKS["triangles"])
    made = [generate_mesh(body.mesh.generator, body.mesh.parameters, WORLD) for body in scene.body]
    bodies = [body.model_copy(update={"mesh": mesh}) for body, mesh in zip(scene.body, made, strict=True)]
    together = solve(scene.model_copy(update={"body": tuple(bodies)}), WORLD)
    ours, theirs = points_of(together.contact), points_of(solve(scene, MPI.COMM_SELF).contact)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


@pytest.mark.mpi
def test_bodies_in_one_file():
    """The shares are equal; half of the contact of the demo is on each of two ranks, on both sides."""
    scene = read_scene(DEMO)
    tagged = load_mesh(scene, WORLD)
    shares = WORLD.allgather(tagged.mesh.topology.index_map(2).size_local)
    assert np.ptp(shares) <= 2
    for side in scene.statement.touching:
        own = np.array(WORLD.allgather(len(tagged.facets(side))))
        assert WORLD.size != 2 or own[0] == pytest.approx(own[1], rel=0.1)


@pytest.mark.mpi(slow=True)
def test_a_file_whose_cells_are_halved(tmp_path):
    """The finer meshes of a requested accuracy are divided anew, alike."""
    file = Path(WORLD.bcast(str(tmp_path))) / "blocks.vtu"
    if WORLD.rank == 0:
        (cells, x), (more, y) = grid("triangle", (5, 2), (0, 0.01), (3, 1)), grid("triangle", (4, 2), (0, -1), (3, 0))
        points = np.pad(np.concatenate([x, y]), ((0, 0), (0, 1)))
        meshio.write(file, meshio.Mesh(points, [("triangle", np.concatenate([cells, more + len(x)]))]))
    WORLD.barrier()
    heights = {"top": 1.0, "upper": 0.01, "lower": 0.0, "bottom": -1.0}
    marks = {name: f"abs(x[1] - {height}) < 0.001" for name, height in heights.items()}
    scene = {
        "mesh": {"file": str(file), "boundaries": marks},
        "material": {"young": 100.0, "poisson": 0.3},
        "displacement": [{"boundary": "bottom", "x": 0.0, "y": 0.0}, {"boundary": "top", "x": 0.0, "y": -0.03}],
        "contact": {"boundary": "upper", "against": "lower"},
        "accuracy": {"target": 0.8, "of": "energy", "refinement": "uniform"},
    }
    found = solve(parse_scene(scene), WORLD)
    assert len(found.levels) > 1
    tagged = found.model.tagged
    assert np.ptp(WORLD.allgather(tagged.mesh.topology.index_map(2).size_local)) <= 2
    for side in ("upper", "lower"):
        own = np.array(WORLD.allgather(len(tagged.facets(side))))
        assert np.ptp(own) <= 2


@pytest.mark.slow
@pytest.mark.mpi
def test_one_body(monkeypatch):
    """Nothing is cut without two bodies that touch."""

    def cut(*_):
        raise AssertionError("cut")

    monkeypatch.setattr(distribution, "shares", cut)
    alone = read_scene(DEMO)
    alone = alone.model_copy(
        update={"contact": tuple(one.model_copy(update={"against": None}) for one in alone.contact)}
    )
    load_mesh(alone, WORLD)
    if WORLD.size > 1:
        with pytest.raises(AssertionError, match="cut"):
            load_mesh(read_scene(DEMO), WORLD)
