"""The files of fields: their formats, what a reader finds in them, and what is left of older ones."""

from xml.etree import ElementTree

import numpy as np
import pytest
from mpi4py import MPI
from spaces import box

from signorini_fx import cli, compat
from signorini_fx.errors import InstallationError
from signorini_fx.results import fields as fields_module
from signorini_fx.results.files import write_results
from signorini_fx.scene.reading import parse_scene
from signorini_fx.scene.template import starting_scene
from signorini_fx.solving.solver import solve

COMM = MPI.COMM_WORLD
YOUNG, POISSON = 5000.0, 0.3
GRADIENT = 1e-3 * np.array([[1.0, 0.5, 0.0], [-0.2, 0.7, 0.3], [0.1, 0.0, -0.4]])
# Cells, degree -> kind of cell in VTK (a Lagrange cell of any degree), and how many there are.
CELLS = {
    ("triangle", 1): (69, 12),
    ("triangle", 2): (69, 12),
    ("quadrilateral", 2): (70, 6),
    ("hexahedra", 1): (72, 8),
    ("tetrahedra", 2): (71, 48),
}


@pytest.fixture
def folder(tmp_path):
    """One for all ranks."""
    return COMM.bcast(tmp_path)


def stretched(cells, degree):
    """A body with a constant displacement gradient."""
    dim = 2 if cells in ("triangle", "quadrilateral") else 3
    moves = {"xyz"[i]: " + ".join(f"{GRADIENT[i, j]} * x[{j}]" for j in range(dim)) for i in range(dim)}
    sides = ["left", "right", "bottom", "top", "front", "back"][: 2 * dim]
    mesh = {"generator": "rectangle", "parameters": {"nx": 3, "ny": 2, "cell": cells}}
    return parse_scene(
        {
            "mesh": mesh if dim == 2 else box(cells, (2, 2, 2), comm=COMM),
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": [{"boundary": name, **moves} for name in sides],
        }
    )


def arrays_of(file):
    """The arrays of a piece by name, those of cells after "cell ", one row per point, cell or corner."""
    found = {}
    for kind in next(ElementTree.parse(file).iter("Piece")):
        for array in kind:
            values = np.array((array.text or "").split(), dtype=float)
            name = f"{'cell ' if kind.tag == 'CellData' else ''}{array.get('Name') or 'points'}"
            found[name] = values.reshape(-1, int(array.get("NumberOfComponents") or 1))
    return found


@pytest.mark.mpi
@pytest.mark.parametrize(("cells", "degree"), CELLS)
def test_vtu(folder, cells, degree):
    """Pieces of all ranks have every cell once, ghosts apart, in VTK's kind for the degree, with every field."""
    summary = write_results(solve(stretched(cells, degree), COMM), folder, fields="vtu", pictures=False)
    assert summary["fields"] == ["vtu/fields.pvd"]
    files = sorted((folder / "vtu").glob("*.vtu"))
    assert len(files) == COMM.size
    (part,) = (folder / "vtu").glob("*.pvtu")
    assert {piece.get("Source") for piece in ElementTree.parse(part).iter("Piece")} == {file.name for file in files}
    (listed,) = ElementTree.parse(folder / "vtu" / "fields.pvd").iter("DataSet")
    assert listed.get("file") == part.name
    kind, count = CELLS[cells, degree]
    own = 0
    dim = 3 if cells in ("hexahedra", "tetrahedra") else 2
    gradient = np.zeros((3, 3))
    gradient[:dim, :dim] = GRADIENT[:dim, :dim]
    strain = (gradient + gradient.T) / 2
    mu, lame = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    stress = 2 * mu * strain + lame * np.trace(strain) * np.eye(3)
    for file in files:
        arrays = arrays_of(file)
        assert set(arrays["types"].ravel()) == {kind}
        own += np.count_nonzero(arrays["cell vtkGhostType"] == 0)
        points = arrays["points"]
        np.testing.assert_allclose(arrays["displacement"], points @ gradient.T, atol=1e-12)
        for name in ("stress", "recovered_stress"):
            expected = np.tile(stress.ravel(), (len(points), 1))
            np.testing.assert_allclose(arrays[name], expected, atol=1e-6 * np.abs(stress).max())
        principal = np.linalg.eigvalsh(stress)[::-1]
        np.testing.assert_allclose(arrays["principal_stresses"], np.tile(principal, (len(points), 1)), atol=1e-6)
        mises = np.sqrt(1.5) * np.linalg.norm(stress - np.trace(stress) / 3 * np.eye(3))
        for name in ("von_mises", "recovered_von_mises"):
            np.testing.assert_allclose(arrays[name][:, 0], mises, rtol=1e-6)
        np.testing.assert_allclose(arrays["density"][:, 0], mises**2 / (6 * mu), rtol=1e-6)
    assert own == count


def test_formats(tmp_path, monkeypatch):
    """VTX where it can be written; files of another format go; what cannot be written is refused before."""
    solution = solve(stretched("triangle", 1), MPI.COMM_SELF)
    out = tmp_path / "out"
    names = [*("displacement", "stress", "von_mises", "principal_stresses", "density")]
    names += ["recovered_stress", "recovered_von_mises"]
    assert write_results(solution, out, pictures=False)["fields"] == [f"{name}.bp" for name in names]
    write_results(solution, out, fields="vtu", pictures=False)
    assert list(out.glob("*.bp")) == []
    assert (out / "vtu" / "fields.pvd").exists()
    write_results(solution, out, fields=False, pictures=False)
    assert not (out / "vtu").exists()
    with pytest.raises(ValueError, match="'vtx' or 'vtu' is expected, got 'xdmf'"):
        write_results(solution, out, fields="xdmf")
    monkeypatch.setattr(compat, "has_vtx", lambda: False)
    assert fields_module.chosen_format(True) == "vtu"
    with pytest.raises(InstallationError, match="no ADIOS2"):
        write_results(solution, out, fields="vtx")


def test_command(tmp_path, capsys):
    """The format is an option of ``solve``, which cannot be given together with --no-fields."""
    scene = tmp_path / "scene.toml"
    scene.write_text(starting_scene(), encoding="utf-8")
    solved = ["solve", str(scene), "--out", str(tmp_path / "out"), "--no-pictures"]
    assert cli.main([*solved, "--fields", "vtu", "--quiet"]) == 0
    assert (tmp_path / "out" / "vtu" / "fields.pvd").exists()
    with pytest.raises(SystemExit) as end:
        cli.main([*solved, "--fields", "vtu", "--no-fields"])
    assert end.value.code == 2
    assert "not allowed with" in capsys.readouterr().err


def test_size_of_files(tmp_path):
    """The space that is reserved is enough, and not ten times too much."""
    solution = solve(stretched("tetrahedra", 2), MPI.COMM_SELF)
    write_results(solution, tmp_path, fields="vtu", pictures=False)
    size = sum(file.stat().st_size for file in (tmp_path / "vtu").iterdir())
    assert size < fields_module.size_of_fields(solution, "vtu") < 10 * size
