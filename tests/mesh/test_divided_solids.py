"""Wedges and tetrahedra beside more hexahedra are divided with them into hexahedra that fill the body and meet."""

import itertools

import meshio
import numpy as np
import pytest
from mpi4py import MPI
from scenes import on_mesh

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files import dividing
from signorini_fx.mechanics.mesh.files.formats import read_file
from signorini_fx.mechanics.mesh.files.shape import measures
from signorini_fx.mechanics.mesh.halving import halved
from signorini_fx.mechanics.mesh.tagged import read_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

SHAPE, SIZE = (4, 3, 2), (2.0, 1.5, 1.0)
AREA = SIZE[0] * SIZE[1]
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
# Faces of a hexahedron, each seen from outside, and the halves of it.
FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
HALVES = [(0, 1, 2, 4, 5, 6), (2, 3, 0, 6, 7, 4)]
HEIGHT = 0.2


def mixed_solid(seed, *, apart=True):
    """A box of hexahedra and pairs of wedges in whole columns, with tetrahedra on some wedges at its top, and beside it
    a body of two hexahedra; nodes in any order.  Its foot has the number 7, the rest of its surface 8, and the first
    half of its hexahedra is the part 2.

    Returns:
        The mesh, and how many cells of each kind the box has.
    """
    draw = np.random.default_rng(seed)
    grid = np.array(list(itertools.product(*(range(n + 1) for n in SHAPE))), dtype=float)
    number = {tuple(map(int, x)): k for k, x in enumerate(grid)}
    points = [*(grid / SHAPE * SIZE)]
    blocks = {"hexahedron": [], "wedge": [], "tetra": []}
    foot, rest = {"quad": [], "triangle": []}, {"quad": [], "triangle": []}
    halved = draw.permutation(SHAPE[0] * SHAPE[1]).reshape(SHAPE[:2]) < 3
    for i, j, k in itertools.product(*map(range, SHAPE)):
        nodes = [number[i + a, j + b, k + c] for a, b, c in CORNERS]
        sides = [[nodes[n] for n in face] for face in FACES]
        outer = (False, False, j == 0, i == SHAPE[0] - 1, j == SHAPE[1] - 1, i == 0)
        rest["quad"] += [side for side, chosen in zip(sides, outer, strict=True) if chosen]
        if not halved[i, j]:
            blocks["hexahedron"].append(nodes)
            foot["quad"] += [sides[0]] * (k == 0)
            rest["quad"] += [sides[1]] * (k == SHAPE[2] - 1)
            continue
        for half in HALVES:
            wedge = [nodes[n] for n in half]
            a, b, c = wedge[3:]
            blocks["wedge"].append(wedge)
            foot["triangle"] += [wedge[:3]] * (k == 0)
            if k < SHAPE[2] - 1:
                continue
            if half == HALVES[0]:
                points.append(np.mean([points[n] for n in (a, b, c)], axis=0) + np.array([0, 0, HEIGHT]))
                top = len(points) - 1
                blocks["tetra"].append([a, b, c, top])
                rest["triangle"] += [[a, b, top], [b, c, top], [c, a, top]]
            else:
                rest["triangle"].append([a, b, c])
    counts = {kind: len(nodes) for kind, nodes in blocks.items()}
    if apart:
        first = len(points)
        points += [(9.0 + x, y, z) for x, y, z in itertools.product((0, 1, 2), (0, 1), (0, 1))]
        blocks["hexahedron"] += [[first + m + n for n in (0, 4, 6, 2, 1, 5, 7, 3)] for m in (0, 4)]
    order = draw.permutation(len(points))
    place = np.argsort(order)
    kinds = [*blocks.items(), *foot.items(), *rest.items()]
    tags = [np.full(len(nodes), value) for value, (_, nodes) in zip((1, 1, 1, 7, 7, 8, 8), kinds, strict=True)]
    tags[0][: counts["hexahedron"] // 2] = 2
    cells = [(kind, place[np.array(nodes)]) for kind, nodes in kinds]
    return meshio.Mesh(np.array(points)[order], cells, cell_data={"part": tags}), counts


def areas_of(source):
    """Those of the triangles and flat quadrilaterals of a source, together."""
    total = 0.0
    for kind, share in (("quad", 1.0), ("triangle", 0.5)):
        x = source.points[source.cells_dict[kind]]
        total += share * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, -1] - x[:, 0]), axis=1).sum()
    return total


@pytest.mark.parametrize("seed", range(4))
def test_few_wedges_and_tetrahedra_are_divided(tmp_path, seed):
    """Volumes, areas and names stay; a body of hexahedra alone keeps its cells."""
    source, counts = mixed_solid(seed)
    meshio.write(tmp_path / "some.vtu", source)
    mesh = read_file(tmp_path / "some.vtu")
    assert mesh.kind == "hexahedron"
    assert mesh.subdivided
    many, few, some = counts["hexahedron"], counts["wedge"], counts["tetra"]
    assert mesh.note.startswith(
        f"{many} hexahedra into eight each and {some} tetrahedra into four each and {few} wedges into six each are"
    )
    assert len(mesh.cells) == 8 * many + 6 * few + 4 * some + 2
    sizes = measures(mesh.points, mesh.cells, mesh.cell)
    pyramid = AREA / (SHAPE[0] * SHAPE[1]) / 2 * HEIGHT / 3
    assert sizes.sum() == pytest.approx(AREA * SIZE[2] + some * pyramid + 2, rel=1e-12)
    assert np.sort(sizes)[-2:] == pytest.approx(1.0)
    cell = AREA * SIZE[2] / np.prod(SHAPE)
    assert sizes[mesh.regions["region_2"]] == pytest.approx(np.full(8 * (many // 2), cell / 8), rel=1e-9)
    areas = measures(mesh.points, mesh.facets, mesh.facet)
    surface = areas_of(source)
    assert areas.sum() == pytest.approx(surface + 10, rel=1e-12)  # faces within would add to it
    foot, rest = mesh.boundaries["boundary_7"], mesh.boundaries["boundary_8"]
    assert areas[foot].sum() == pytest.approx(AREA, rel=1e-12)
    assert np.abs(mesh.points[mesh.facets[foot], 2]).max() < 1e-12
    assert areas[rest].sum() == pytest.approx(surface - AREA, rel=1e-12)
    for node, ends in enumerate(mesh.ends, start=len(mesh.points) - len(mesh.ends)):
        np.testing.assert_allclose(mesh.points[node], mesh.points[ends[ends >= 0]].mean(axis=0), atol=1e-12)


def test_shells_inside_divided_cells(tmp_path):
    """Triangles that are no side of a cell cannot be divided with them: that they are left out is said."""
    source, counts = mixed_solid(3)
    inside = source.cells[0].data[: counts["hexahedron"]][:2, [0, 2, 6]]
    data = [*source.cell_data["part"], np.full(2, 9)]
    cells = [*source.cells, meshio.CellBlock("triangle", inside)]
    meshio.write(tmp_path / "some.vtu", meshio.Mesh(source.points, cells, cell_data={"part": data}))
    mesh = read_file(tmp_path / "some.vtu")
    assert mesh.note.endswith("; 2 triangles that are no side of a cell are left out")
    assert mesh.boundaries.keys() == {"boundary_7", "boundary_8"}
    source, _ = mixed_solid(3)
    meshio.write(tmp_path / "none.vtu", source)
    assert read_file(tmp_path / "none.vtu").note == mesh.note.partition(";")[0]


def test_a_divided_mesh_that_is_halved(tmp_path):
    """The finer mesh says, too, that its cells are not those of the file."""
    source, _ = mixed_solid(4)
    meshio.write(tmp_path / "some.vtu", source)
    mesh = read_file(tmp_path / "some.vtu")
    finer = halved(mesh)
    assert mesh.note
    assert (finer.note, finer.subdivided) == (mesh.note, True)


def test_a_set_of_nodes_of_divided_cells(tmp_path):
    """It has the parts of the faces all of whose corners it has, and no others."""
    source, _ = mixed_solid(5)
    below = source.cells[3].data[0]
    sets = {"foot": np.flatnonzero(source.points[:, 2] < 1e-9), "one": below, "three": below[:3]}
    meshio.write(tmp_path / "some.inp", meshio.Mesh(source.points, source.cells[:3], point_sets=sets))
    mesh = read_file(tmp_path / "some.inp")
    areas = measures(mesh.points, mesh.facets, mesh.facet)
    assert areas[mesh.boundaries["foot"]].sum() == pytest.approx(AREA + 2, rel=1e-12)
    assert areas[mesh.boundaries["one"]] == pytest.approx(np.full(4, AREA / (SHAPE[0] * SHAPE[1]) / 4))
    assert "three" not in mesh.boundaries


def test_as_many_wedges_as_hexahedra_at_most(tmp_path):
    """With more of them all are cut, and no node is added."""
    source, counts = mixed_solid(2, apart=False)
    rows = counts["wedge"] + counts["tetra"]
    for kept, kind in ((rows, "hexahedron"), (rows - 1, "tetra")):
        cells = [("hexahedron", source.cells[0].data[:kept]), *source.cells[1:3]]
        meshio.write(tmp_path / "some.vtu", meshio.Mesh(source.points, cells))
        assert read_file(tmp_path / "some.vtu").kind == kind


@pytest.mark.parametrize("wedge", [False, True])
def test_cells_that_do_not_meet_are_not_divided(tmp_path, wedge):
    """A tetrahedron on half of a quadrilateral: with a wedge all is cut, alone it is refused."""
    cubes = [list(range(8)), [4, 5, 6, 7, 8, 9, 10, 11], [8, 9, 10, 11, 12, 13, 14, 15]]
    points = [*CORNERS, *((x, y, z) for z in (2, 3) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))), (0.7, 0.3, 4)]
    points += [(2.0, 0.5, 0.0), (2.0, 0.5, 1.0)]
    cells = [("hexahedron", cubes), ("tetra", [[12, 13, 14, 16]])]
    cells += [("wedge", [[1, 17, 2, 5, 18, 6]])] if wedge else []
    meshio.write(tmp_path / "some.vtu", meshio.Mesh(np.array(points, dtype=float), cells))
    if wedge:
        assert read_file(tmp_path / "some.vtu").kind == "tetra"
    else:
        with pytest.raises(MeshError, match="would not be conforming"):
            read_file(tmp_path / "some.vtu")


@pytest.mark.mpi
def test_a_uniform_pressure_on_divided_cells(tmp_path):
    """All around a body, slopes of tetrahedra included, and from its foundation below, to round-off; displacements are
    those of a uniform strain.
    """
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    if comm.rank == 0:
        source, _ = mixed_solid(1, apart=False)
        meshio.write(folder / "some.vtu", source)
    comm.barrier()
    rules = {"left": lambda x: x[0] < 1e-9, "front": lambda x: x[1] < 1e-9}
    tagged = read_mesh(folder / "some.vtu", comm, boundaries={"foot": 7, "around": 8, **rules})
    assert tagged.subdivided
    scene = {
        "mesh": {"generator": "box"},
        "material": {"young": 10.0, "poisson": 0.3},
        "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "front", "y": 0.0}],
        "traction": [{"boundary": "around", "pressure": 2.0}],
        "contact": [{"boundary": "foot", "gap": 0.0, "friction": {"law": "coulomb", "coefficient": 0.0}}],
        "solver": {"algorithm": "exact"},
    }
    solution = solve(on_mesh(parse_scene(scene), tagged), comm)
    assert solution.converged
    np.testing.assert_allclose(solution.table.columns["pressure"], 2.0, rtol=1e-9)
    x = solution.displacement.function_space.tabulate_dof_coordinates()
    values = solution.displacement.x.array.reshape(len(x), -1)
    np.testing.assert_allclose(values, -2.0 * (1 - 2 * 0.3) / 10.0 * x, atol=1e-9)


def test_a_mesh_that_would_be_too_large_is_cut(tmp_path, monkeypatch):
    """At the limit it is divided."""
    source, _ = mixed_solid(0)
    meshio.write(tmp_path / "some.vtu", source)
    count = len(read_file(tmp_path / "some.vtu").points)
    for limit, kind in ((count, "hexahedron"), (count - 1, "tetra")):
        monkeypatch.setattr(dividing, "DIVIDED_AT_MOST", limit)
        assert read_file(tmp_path / "some.vtu").kind == kind
