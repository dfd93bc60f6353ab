"""The files of fields: their formats, what a reader finds in them, and what is left of older
ones.
"""

from xml.etree import ElementTree

import numpy as np
import pytest
from mesh_files import arrays_of
from mpi4py import MPI
from numpy.testing import assert_allclose
from scene_tables import fixed, rectangle_mesh
from scenes import alone
from spaces import box

from signorini_fx.results.fields import write_vtu
from signorini_fx.results.files import write_results
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
YOUNG, POISSON = 5000.0, 0.3
GRADIENT = 1e-3 * np.array([[1.0, 0.5, 0.0], [-0.2, 0.7, 0.3], [0.1, 0.0, -0.4]])
# Cells, degree -> kind of cell in VTK (from degree 2 on a Lagrange cell of any degree), and how
# many there are.
CELLS = {
    ("triangle", 1): (5, 12),
    ("triangle", 2): (69, 12),
    ("quadrilateral", 2): (70, 6),
    ("hexahedra", 1): (12, 8),
    ("tetrahedra", 2): (71, 48),
}


@pytest.fixture
def folder(tmp_path):
    """One for all ranks."""
    return COMM.bcast(tmp_path)


def stretched(cells, degree):
    """A body with a constant displacement gradient."""
    dim = 2 if cells in ("triangle", "quadrilateral") else 3
    moves = {
        "xyz"[i]: " + ".join(f"{GRADIENT[i, j]} * x[{j}]" for j in range(dim)) for i in range(dim)
    }
    sides = ["left", "right", "bottom", "top", "front", "back"][: 2 * dim]
    mesh = rectangle_mesh(3, 2, cell=cells)
    return parse_scene(
        {
            "mesh": mesh if dim == 2 else box(cells, (2, 2, 2), comm=COMM),
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": [{"boundary": name, **moves} for name in sides],
        }
    )


@pytest.mark.mpi
@pytest.mark.one_quick(("cells", "degree"), CELLS)
def test_vtu(folder, cells, degree):
    """One file of all ranks has every cell once, in VTK's kind for the degree, and every field at
    its points.
    """
    summary = write_results(solve(stretched(cells, degree), COMM), folder, pictures=False)
    assert summary["fields"] == ["fields.vtu"]
    kind, count = CELLS[cells, degree]
    dim = 3 if cells in ("hexahedra", "tetrahedra") else 2
    gradient = np.zeros((3, 3))
    gradient[:dim, :dim] = GRADIENT[:dim, :dim]
    strain = (gradient + gradient.T) / 2
    mu, lame = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    stress = 2 * mu * strain + lame * np.trace(strain) * np.eye(3)
    arrays = arrays_of(folder / "fields.vtu")
    assert arrays["types"].ravel().tolist() == [kind] * count
    points = arrays["points"]
    corners = len(points) // count
    assert arrays["offsets"].ravel().tolist() == list(range(corners, len(points) + 1, corners))
    assert sorted(arrays["connectivity"].ravel()) == list(range(len(points)))
    assert_allclose(arrays["displacement"], points @ gradient.T, atol=1e-12)
    for name in ("stress", "recovered_stress"):
        expected = np.tile(stress.ravel(), (len(points), 1))
        assert_allclose(arrays[name], expected, atol=1e-6 * np.abs(stress).max())
    principal = np.linalg.eigvalsh(stress)[::-1]
    assert_allclose(arrays["principal_stresses"], np.tile(principal, (len(points), 1)), atol=1e-6)
    mises = np.sqrt(1.5) * np.linalg.norm(stress - np.trace(stress) / 3 * np.eye(3))
    for name in ("von_mises", "recovered_von_mises"):
        assert_allclose(arrays[name][:, 0], mises, rtol=1e-6)
    assert_allclose(arrays["density"][:, 0], mises**2 / (6 * mu), rtol=1e-6)


@pytest.mark.one_quick("cells", ["quadrilateral", "tetrahedra"])
def test_other_readers(tmp_path, cells):
    """PyVista and meshio find the same cells and fields, and the volume of the body."""
    meshio, pyvista = pytest.importorskip("meshio"), pytest.importorskip("pyvista")
    write_results(alone(stretched(cells, 2)), tmp_path, pictures=False)
    grid, read = pyvista.read(tmp_path / "fields.vtu"), meshio.read(tmp_path / "fields.vtu")
    sizes = grid.compute_cell_sizes()
    assert sizes["Area"].sum() + sizes["Volume"].sum() == pytest.approx(3.0)
    assert np.array_equal(read.cells[0].data.ravel(), grid.cell_connectivity)
    for name, values in read.point_data.items():
        assert np.array_equal(values.ravel(), grid.point_data[name].ravel()), name


@pytest.mark.mpi
@pytest.mark.parametrize("counts", [(1, 2, 4), (0, 1, 1), (5, 0, 1), (2, 3, 0), (0, 0, 7)])
def test_ranks_write_one_file(folder, counts):
    """Byte by byte that of one rank, however few cells a rank has."""
    ends = np.cumsum((0, *counts))
    x = np.random.default_rng(0).normal(size=(3 * ends[-1], 3))
    own = slice(*ends[[COMM.rank, COMM.rank + 1]]) if COMM.size > 1 else slice(0, ends[COMM.size])
    for name, comm, cells in (
        ("ranks.vtu", COMM, own),
        ("one.vtu", MPI.COMM_SELF, slice(0, ends[COMM.size])),
    ):
        points = x[3 * cells.start : 3 * cells.stop]
        numbers = np.arange(len(points)).reshape(-1, 3)
        if comm is COMM or COMM.rank == 0:
            write_vtu(folder / name, comm, points, numbers, 5, {"first": points[:, 0]})
    COMM.barrier()
    assert (folder / "ranks.vtu").read_bytes() == (folder / "one.vtu").read_bytes()


def test_load_steps(tmp_path):
    """A file for each load step with a solution, and their times."""
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(3, 2),
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": [fixed("left"), {"boundary": "right", "x": "t"}],
            "load_steps": {"times": [0.5, 1.0]},
        }
    )
    summary = write_results(alone(scene), tmp_path, pictures=False)
    assert summary["fields"] == ["fields.pvd"]
    listed = [
        (row.get("timestep"), row.get("file"))
        for row in ElementTree.parse(tmp_path / "fields.pvd").iter("DataSet")
    ]
    assert listed == [("0.5", "fields/0001.vtu"), ("1.0", "fields/0002.vtu")]
    largest = [arrays_of(tmp_path / file)["displacement"][:, 0].max() for _, file in listed]
    assert largest == pytest.approx([0.5, 1.0])


def test_without_fields(tmp_path):
    """Those of an earlier run go; there is one format."""
    solution, out = alone(stretched("triangle", 1)), tmp_path / "out"
    write_results(solution, out, pictures=False)
    assert (out / "fields.vtu").exists()
    write_results(solution, out, fields=False, pictures=False)
    assert not (out / "fields.vtu").exists()
    with pytest.raises(
        ValueError, match=r"True or False is expected, got 'vtx': all of them are in fields\.vtu"
    ):
        write_results(solution, out, fields="vtx")
