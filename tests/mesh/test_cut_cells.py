"""Wedges, pyramids and the hexahedra beside them are cut into tetrahedra that fill the body and meet face to face."""

import itertools

import gmsh
import meshio
import numpy as np
import pytest
from mpi4py import MPI
from scenes import on_mesh

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.formats import read_file
from signorini_fx.mechanics.mesh.files.shape import measures
from signorini_fx.mechanics.mesh.tagged import read_mesh
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

SHAPE, SIZE = (4, 3, 2), (2.0, 1.5, 1.0)
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
# Faces of a hexahedron, each seen from outside.
FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def mixed(folder, seed, suffix="vtu"):
    """A box whose cells are hexahedra, pairs of wedges in whole columns and groups of six pyramids, with nodes in any
    order; its lowest face is a set of quadrilaterals and triangles.
    """
    draw = np.random.default_rng(seed)
    grid = np.array(list(itertools.product(*(range(n + 1) for n in SHAPE))), dtype=float)
    number = {tuple(map(int, x)): k for k, x in enumerate(grid)}
    points = [x / SHAPE * SIZE for x in grid]
    blocks = {"hexahedron": [], "wedge": [], "pyramid": [], "quad": [], "triangle": []}
    column = draw.integers(0, 2, SHAPE[:2])
    for i, j, k in itertools.product(*map(range, SHAPE)):
        nodes = [number[i + a, j + b, k + c] for a, b, c in CORNERS]
        if column[i, j]:
            blocks["wedge"] += [[nodes[n] for n in own] for own in ((0, 1, 2, 4, 5, 6), (4, 6, 7, 0, 2, 3))]
        elif draw.random() < 0.5:
            points.append(np.mean([points[n] for n in nodes], axis=0))
            blocks["pyramid"] += [[*(nodes[n] for n in face[::-1]), len(points) - 1] for face in FACES]
        else:
            blocks["hexahedron"].append(nodes)
        if k == 0 and column[i, j]:
            blocks["triangle"] += [[nodes[n] for n in own] for own in ((0, 2, 1), (0, 3, 2))]
        elif k == 0:
            blocks["quad"].append([nodes[n] for n in FACES[0]])
    order = draw.permutation(len(points))
    place = np.argsort(order)
    cells = [(kind, place[np.array(nodes)]) for kind, nodes in blocks.items() if nodes]
    tags = [np.full(len(nodes), 7 if kind in ("quad", "triangle") else 1) for kind, nodes in cells]
    file = folder / f"mixed.{suffix}"
    mesh = meshio.Mesh(np.array(points)[order], cells, cell_data={"part": tags})
    meshio.write(file, mesh, "gmsh22" if suffix == "msh" else None)
    return file, {kind: len(nodes) for kind, nodes in blocks.items()}


@pytest.mark.parametrize("seed", range(8))
def test_volume_area_and_names(tmp_path, seed):
    """However the nodes are numbered; two cells that cut a face differently would leave facets within the body."""
    file, counts = mixed(tmp_path, seed)
    mesh = read_file(file)
    assert mesh.kind == "tetra"
    assert len(mesh.cells) == 6 * counts["hexahedron"] + 3 * counts["wedge"] + 2 * counts["pyramid"]
    assert measures(mesh.points, mesh.cells, mesh.cell).sum() == pytest.approx(np.prod(SIZE), rel=1e-12)
    area = measures(mesh.points, mesh.facets, mesh.facet)
    a, b, c = SIZE
    assert area.sum() == pytest.approx(2 * (a * b + b * c + c * a), rel=1e-12)
    foot = mesh.boundaries["boundary_7"]
    assert len(foot) == 2 * SHAPE[0] * SHAPE[1]
    assert area[foot].sum() == pytest.approx(a * b, rel=1e-12)
    assert np.abs(mesh.points[mesh.facet_corners[foot], 2]).max() == 0
    assert len(mesh.regions["region_1"]) == len(mesh.cells)


@pytest.mark.mpi
def test_it_is_solved(tmp_path):
    """A block that a pressure presses down has this pressure below, to round-off."""
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    if comm.rank == 0:
        mixed(folder, 3)
    comm.barrier()
    rules = {"top": lambda x: x[2] > SIZE[2] - 1e-9, "left": lambda x: x[0] < 1e-9, "front": lambda x: x[1] < 1e-9}
    tagged = read_mesh(folder / "mixed.vtu", comm, boundaries={**rules, "foot": 7})
    assert "are cut into tetrahedra" in tagged.note
    scene = {
        "mesh": {"generator": "box"},
        "material": {"young": 10.0, "poisson": 0.3},
        "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "front", "y": 0.0}],
        "traction": [{"boundary": "top", "pressure": 2.0}],
        "contact": [{"boundary": "foot", "gap": 0.0, "friction": {"law": "coulomb", "coefficient": 0.0}}],
        "solver": {"algorithm": "exact"},
    }
    solution = solve(on_mesh(parse_scene(scene), tagged), comm)
    assert solution.converged
    np.testing.assert_allclose(solution.table.columns["pressure"], 2.0, rtol=1e-9)


def bent(x):
    """A map of degree 2 that keeps volumes."""
    y = x[:, 1] + 0.3 * x[:, 2] ** 2
    return np.column_stack((x[:, 0] + 0.2 * y**2 - 0.1 * y * x[:, 2], y, x[:, 2]))


def straight_again(x):
    """Its inverse."""
    return np.column_stack(
        (x[:, 0] - 0.2 * x[:, 1] ** 2 + 0.1 * x[:, 1] * x[:, 2], x[:, 1] - 0.3 * x[:, 2] ** 2, x[:, 2])
    )


@pytest.mark.parametrize(("seed", "complete", "suffix"), [(0, True, "msh"), (1, False, "msh"), (2, False, "vtu")])
def test_nodes_on_edges(tmp_path, monkeypatch, seed, complete, suffix):
    """Where gmsh puts nodes between the corners and a map of degree 2 bends the body, the tetrahedra are bent by it
    exactly: elements of 13, 15 and 20 nodes contain all polynomials of degree 2.
    """
    file, counts = mixed(tmp_path, seed, "msh")
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(file))
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 0 if complete else 1)
        gmsh.model.mesh.setOrder(2)
        for tag in gmsh.model.mesh.getNodes()[0]:
            gmsh.model.mesh.setNode(tag, bent(gmsh.model.mesh.getNode(tag)[0][None])[0], [])
        gmsh.write(str(file))
    finally:
        gmsh.finalize()
    if suffix != "msh":  # meshio knows the order of VTK, but not in each version that these are solid
        for kind in ("wedge15", "pyramid13"):
            monkeypatch.setitem(meshio._mesh.topological_dimension, kind, 3)
        found = meshio.read(file)
        assert {"wedge15", "pyramid13", "hexahedron20"} <= set(found.cells_dict)
        file = file.with_suffix(f".{suffix}")
        meshio.write(file, found)
    mesh = read_file(file)
    assert mesh.kind == "tetra10"
    assert len(mesh.cells) == 6 * counts["hexahedron"] + 3 * counts["wedge"] + 2 * counts["pyramid"]
    assert measures(mesh.points, mesh.cells, mesh.cell).sum() == pytest.approx(np.prod(SIZE), rel=1e-12)
    x = straight_again(mesh.points)
    for k, own in enumerate(mesh.cell.nodes):
        np.testing.assert_allclose(x[mesh.cells[:, k]], x[mesh.cells[:, list(own)]].mean(axis=1), atol=1e-12)
    a, b, c = SIZE
    flat = measures(x, mesh.facets, mesh.facet)
    assert flat.sum() == pytest.approx(2 * (a * b + b * c + c * a), rel=1e-12)


@pytest.mark.parametrize("kinds", [("triangle6", "quad8"), ("triangle6", "quad9")])
def test_quadrilaterals_beside_triangles(tmp_path, kinds):
    """A bent square of 3 quadrilaterals and 2 triangles, and a line of it that has a number."""
    corners = [(x, y) for y in (0, 1, 2) for x in (0, 1, 2)]
    elements = {kinds[0]: [[1, 2, 5], [5, 4, 1]], kinds[1]: [[0, 1, 4, 3], [4, 5, 8, 7], [3, 4, 7, 6]]}
    places = {}

    def nodes(kind, own):
        """Corners, then the middles of edges, then that of the element."""
        around = [*((c,) for c in own), *zip(own, own[1:] + own[:1], strict=True), own]
        count = int(kind[-1]) if kind[-1].isdigit() else len(own)
        where = [tuple(np.mean([corners[c] for c in group], axis=0)) for group in around[:count]]
        return [places.setdefault(x, len(places)) for x in where]

    cells = [(kind, [nodes(kind, own) for own in every]) for kind, every in elements.items()]
    cells.append(("line", [[places[0, 0], places[1, 0]], [places[1, 0], places[2, 0]]]))
    x = np.array(list(places))
    x[:, 0] += 0.2 * x[:, 1] ** 2
    tags = [np.full(2, 1), np.full(3, 1), np.full(2, 7)]
    meshio.write(tmp_path / "some.vtu", meshio.Mesh(np.column_stack((x, 0 * x[:, 0])), cells, cell_data={"part": tags}))
    mesh = read_file(tmp_path / "some.vtu")
    assert mesh.kind == kinds[0]
    assert mesh.note == "3 quadrilaterals are cut into triangles"
    assert len(mesh.cells) == 8
    assert measures(mesh.points, mesh.cells, mesh.cell).sum() == pytest.approx(4.0, rel=1e-12)
    assert measures(mesh.points, mesh.facets, mesh.facet)[mesh.boundaries["boundary_7"]].sum() == pytest.approx(2.0)
    again = mesh.points.copy()
    again[:, 0] -= 0.2 * again[:, 1] ** 2
    for k, own in enumerate(mesh.cell.nodes):
        np.testing.assert_allclose(again[mesh.cells[:, k]], again[mesh.cells[:, list(own)]].mean(axis=1), atol=1e-12)


def mixed_in_plane(folder, *, triangles):
    """A plate of squares, of which so many are pairs of triangles, and one of four squares beside it; its lowest side
    has a number, and its right part is a region.
    """
    corners = [(x, y) for y in range(4) for x in range(4)] + [(x + 9, y) for y in range(3) for x in range(3)]
    quads = [[k, k + 1, k + 5, k + 4] for k in (0, 1, 2, 4, 5, 6, 8, 9, 10)]
    halves = [half for a, b, c, d in quads[:triangles] for half in ([a, b, c], [a, c, d])]
    apart = [[16 + k, 17 + k, 20 + k, 19 + k] for k in (0, 1, 3, 4)]
    cells = [("triangle", halves), ("quad", quads[triangles:] + apart), ("line", [[0, 1], [2, 1], [2, 3], [16, 17]])]
    points = np.array([(x + 0.1 * y, y, 0.0) for x, y in corners])
    tags = [np.full(len(nodes), 1) for _, nodes in cells[:2]]
    tags[1][2] = 2
    meshio.write(folder / "plate.vtu", meshio.Mesh(points, cells, cell_data={"part": [*tags, np.full(4, 7)]}))
    return read_file(folder / "plate.vtu")


def test_few_triangles_are_divided(tmp_path):
    """All cells are quadrilaterals, those of a body without triangles as they are; measures and names stay."""
    mesh = mixed_in_plane(tmp_path, triangles=2)
    assert mesh.kind == "quad"
    assert mesh.note.startswith("7 quadrilaterals into four each and 4 triangles into three each are divided")
    assert len(mesh.cells) == 7 * 4 + 4 * 3 + 4
    sizes = measures(mesh.points, mesh.cells, mesh.cell)
    assert sizes.sum() == pytest.approx(9 + 4, rel=1e-12)
    assert sizes[mesh.regions["region_2"]] == pytest.approx(np.full(4, 0.25))
    right = mesh.points[mesh.cells][:, :, 0].min(axis=1) > 8
    assert right.sum() == 4
    assert sizes[right] == pytest.approx(1.0)
    lengths = measures(mesh.points, mesh.facets, mesh.facet)
    assert lengths.sum() == pytest.approx(3 * 2 * (1 + np.hypot(1, 0.1)) + 2 * 2 * (1 + np.hypot(1, 0.1)), rel=1e-12)
    assert np.sort(lengths[mesh.boundaries["boundary_7"]]) == pytest.approx([0.5] * 6 + [1.0], abs=1e-12)
    first = len(mesh.points) - len(mesh.ends)
    for node, ends in enumerate(mesh.ends, start=first):
        np.testing.assert_allclose(mesh.points[node], mesh.points[ends[ends >= 0]].mean(axis=0), atol=1e-12)


def test_many_triangles_stay(tmp_path):
    """Where most cells are triangles the others are cut, and no node is added."""
    mesh = mixed_in_plane(tmp_path, triangles=7)
    assert mesh.kind == "triangle"
    assert mesh.note == "6 quadrilaterals are cut into triangles"
    assert len(mesh.ends) == 0
    assert len(mesh.cells) == 14 + 2 * 6


def test_it_is_said(tmp_path, capsys):
    """By ``mesh-info`` and by ``check``."""
    file, counts = mixed(tmp_path, 0)
    said = f"{counts['pyramid']} pyramids and {counts['wedge']} wedges and {counts['hexahedron']} hexahedra are cut"
    assert cli.main(["mesh-info", str(file)]) == 0
    assert f"  note          {said} into tetrahedra\n" in capsys.readouterr().out
    scene = tmp_path / "scene.toml"
    scene.write_text(
        '[mesh]\nfile = "mixed.vtu"\n[mesh.boundaries]\nfoot = 7\ntop = "x[2] > 0.99"\n'
        "[material]\nyoung = 1.0\npoisson = 0.3\n"
        '[[displacement]]\nboundary = "top"\nx = 0.0\ny = 0.0\nz = -0.1\n[[contact]]\nboundary = "foot"\n'
    )
    assert cli.main(["check", str(scene)]) == 0
    assert said in " ".join(capsys.readouterr().out.split())


def test_wedges_either_way_round(tmp_path):
    """Programs do not agree which way round the first triangle goes; a folded cell is refused all the same."""
    points = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (0, 1))], dtype=float)
    for nodes in ([0, 1, 2, 3, 4, 5], [0, 2, 1, 3, 5, 4]):
        meshio.write(tmp_path / "one.vtu", meshio.Mesh(points, [("wedge", [nodes])]))
        mesh = read_file(tmp_path / "one.vtu")
        assert measures(mesh.points, mesh.cells, mesh.cell).sum() == pytest.approx(0.5)
    meshio.write(tmp_path / "one.vtu", meshio.Mesh(points, [("wedge", [[0, 1, 2, 4, 3, 5]])]))
    with pytest.raises(MeshError, match=r"1 wedges are folded, the first at \(0.3333"):
        read_file(tmp_path / "one.vtu")


@pytest.mark.slow
def test_an_abaqus_deck(tmp_path):
    """A hexahedron with a wedge beside it and a pyramid on top; surfaces on faces of each."""
    points = [*CORNERS, (2, 0, 0), (2, 0, 1), (0.5, 0.5, 2)]
    lines = ["*NODE", *(f"{n}, {x}, {y}, {z}" for n, (x, y, z) in enumerate(points, 1))]
    lines += ["*ELEMENT, TYPE=C3D8", "1, 1, 2, 3, 4, 5, 6, 7, 8", "*ELEMENT, TYPE=C3D6", "2, 2, 9, 3, 6, 10, 7"]
    lines += ["*ELEMENT, TYPE=C3D5", "3, 5, 6, 7, 8, 11", "*SURFACE, NAME=low", "1, S1", "2, S1"]
    lines += ["*SURFACE, NAME=front", "1, S3", "2, S3", "*SURFACE, NAME=roof", "3, S2", "3, S4", "2, S2"]
    lines += ["*SURFACE, NAME=slope", "2, S4"]
    (tmp_path / "part.inp").write_text("\n".join(lines) + "\n")
    mesh = read_file(tmp_path / "part.inp")
    area = measures(mesh.points, mesh.facets, mesh.facet)
    found = {name: area[rows].sum() for name, rows in mesh.boundaries.items()}
    side = np.sqrt(1 + 0.25) / 2
    assert found == pytest.approx({"low": 1.5, "front": 2.0, "roof": 2 * side + 0.5, "slope": np.sqrt(2)})
    assert measures(mesh.points, mesh.cells, mesh.cell).sum() == pytest.approx(1 + 0.5 + 1 / 3)
