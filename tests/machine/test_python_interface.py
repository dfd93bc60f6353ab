"""The package from Python: names, help, arguments of another kind, short forms."""

import inspect
import logging
import pydoc
import sys
from types import SimpleNamespace

import gmsh
import meshio
import numpy as np
import pytest
from dolfinx import fem, mesh
from drawing import needs_pictures_in_3d
from matplotlib.collections import TriMesh
from matplotlib.figure import Figure
from mpi4py import MPI
from PIL import Image
from scenes import alone, example1
from scipy.spatial import cKDTree
from spaces import block

import signorini_fx as sfx
import signorini_fx.scenes.sweep as parameter_sweep
from signorini_fx import SceneError
from signorini_fx.mechanics.statement.base import tables
from signorini_fx.mechanics.statement.effect import Effect
from signorini_fx.scenes.template import described

COMM = MPI.COMM_SELF
DOLFINX_MESH = mesh.create_rectangle(COMM, [[0, 0], [3, 1]], [6, 2])
TAGGED = sfx.tag_boundaries(
    DOLFINX_MESH,
    {"left": "x[0] < 1e-9", "bottom": lambda x: np.isclose(x[1], 0), "top": "x[1] > 1 - 1e-9"},
)


def function():
    """A scalar field on the mesh, -20 everywhere."""
    f = fem.Function(fem.functionspace(DOLFINX_MESH, ("Lagrange", 1)))
    f.x.array[:] = -20.0
    return f


def scene(**changed):
    """A block that is pressed on its foundation."""
    entries = {
        "mesh": TAGGED,
        "material": sfx.LinearElastic(young=5000.0, poisson=0.3),
        "displacement": sfx.Displacement(boundary="left", x=0.0, y=0.0),
        "traction": sfx.Traction(boundary="top", y=-20.0),
        "contact": sfx.Contact(boundary="bottom"),
        **changed,
    }
    return sfx.Scene(**entries)


def test_public_names_are_shown():
    """By dir(), hence by completion, and by help(): all of them and nothing else."""
    assert sorted(dir(sfx)) == sorted([*sfx.__all__, "__version__"])
    text = pydoc.render_doc(sfx, renderer=pydoc.plaintext)
    missing = [name for name in sfx.__all__ if name not in text]
    assert not missing


def test_every_effect_is_public():
    """Each class that an entry of a scene is an object of."""
    classes = {kind.__name__ for kind in tables(described()) if issubclass(kind, Effect)}
    assert {"Springs", "Contact"} <= classes <= set(sfx.__all__)


@pytest.mark.parametrize("name", sfx.__all__)
def test_every_public_name_is_explained(name):
    """With a docstring; each field of a table of the scene stands in that of its class, which
    help() shows first.
    """
    thing = getattr(sfx, name)
    explained = (
        "".join(kind.__doc__ for kind in thing.__mro__[:2])
        if isinstance(thing, type)
        else thing.__doc__
    )
    assert explained
    for field in getattr(thing, "model_fields", {}):
        assert f"{field}:" in explained or f"{field}, " in explained, field


def test_what_can_be_accepted(tmp_path):
    """The path of a scene for a scene, NumPy's numbers, a field of the mesh as a traction."""
    path = tmp_path / "scene.toml"
    path.write_text(
        '[mesh]\ngenerator = "rectangle"\nparameters = {nx = 6, ny = 2}\n[material]\nyoung = '
        "5000.0\npoisson = 0.3\n"
        '[displacement]\nboundary = "left"\nx = 0.0\ny = 0.0\n[traction]\nboundary = "top"\ny = '
        "-20.0\n"
        '[contact]\nboundary = "bottom"\n'
    )
    for given in (path, str(path)):
        assert sfx.solve(given, COMM).converged
    plain = alone(scene())
    numbers = alone(
        scene(
            material=sfx.LinearElastic(young=np.float64(5000.0), poisson=np.array(0.3)),
            traction=sfx.Traction(boundary="top", y=np.float32(-20.0)),
        )
    )
    field = alone(scene(traction=sfx.Traction(boundary="top", y=function())))
    for other in (numbers, field):
        np.testing.assert_allclose(other.contact.pressure, plain.contact.pressure, rtol=1e-9)


def test_a_solution_in_words(caplog):
    """``str`` is what solve prints, in a notebook a table; the log has each regularised problem,
    and as details each linear solve.
    """
    caplog.set_level(logging.DEBUG, "signorini_fx")
    solution = alone(scene())
    levels = [record.levelname for record in caplog.records]
    assert levels.count("DEBUG") == solution.history.linear_solves
    assert "converged after" in caplog.messages[-1]
    first, *lines = str(solution).splitlines()
    assert first == "scene: converged"
    assert [line.split()[0] for line in lines if line[2] != " "] == [
        *("force", "contact", "stress", "error", "cost", "certificate", "effort")
    ]
    assert solution.summary()["contact_force"] == solution.contact.forces[0].tolist()
    html = solution._repr_html_()
    assert all(line[14:] in html.replace("&lt;", "<") for line in lines if line.strip())


@pytest.mark.mpi
def test_one_rank_prints_a_solution():
    """It does not wait for the others; after ``summary`` it has the lines of them all."""
    comm = MPI.COMM_WORLD
    solution = sfx.solve(scene(mesh={"generator": "rectangle"}), comm)
    if comm.rank == 0:
        assert ("<Solution" in str(solution)) == (comm.size > 1)
        assert "<table>" in solution._repr_html_()
    solution.summary()
    assert str(solution).startswith("scene: converged\n")


def test_tables_for_pandas(monkeypatch, tmp_path):
    """Contact boundaries, tables of a result folder, sweeps; without pandas one error says so."""
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(sfx.InstallationError, match="pip install pandas"):
        sfx.sweep(scene(), {"material.young": [1000.0]}, COMM).to_dataframe()
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=lambda table: table))
    solution = alone(scene())
    sfx.write_results(solution, tmp_path, fields=False, pictures=False)
    stored = sfx.read_results(tmp_path).to_dataframe("contact")
    np.testing.assert_allclose(stored["pressure"], solution.table.to_dataframe()["pressure"])
    rows = sfx.sweep(scene(), {"traction[0].y": [-1.0, -2.0]}, COMM).to_dataframe()
    # Without a gap all is proportional to the load, -20 in ``scene``.
    forces = solution.contact.forces[0][1] * np.array([0.05, 0.1])
    np.testing.assert_allclose([row["contact_force"] for row in rows], forces, rtol=1e-9)


def test_figures_of_a_sweep_are_those_that_are_asked_for(monkeypatch):
    """Who goes through the solutions alone pays for none."""
    monkeypatch.setattr(parameter_sweep, "row_of", lambda *_: pytest.fail("nobody asked"))
    solutions = list(sfx.sweep(scene(), {"traction[0].y": [-1.0, -2.0]}, COMM))
    assert [solution.converged for solution in solutions] == [True, True]


def test_meshes_of_other_programs_in_memory(tmp_path):
    """The model of gmsh, what meshio reads of it and a grid of PyVista: one answer."""
    pyvista = pytest.importorskip("pyvista")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        with pytest.raises(sfx.MeshError, match=r"call gmsh\.model\.mesh\.generate"):
            sfx.solve(scene(mesh=gmsh.model), COMM)
        face = gmsh.model.occ.addRectangle(0.0, 0.0, 0.0, 3.0, 1.0)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [face], name="body")
        for line, name in zip((1, 2, 3, 4), ("bottom", "right", "top", "left"), strict=True):
            gmsh.model.addPhysicalGroup(1, [line], name=name)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "block.msh"))
        solutions = [alone(scene(mesh=gmsh.model))]
    finally:
        gmsh.finalize()
    mesh = meshio.read(tmp_path / "block.msh")
    solutions.append(alone(scene(mesh=mesh)))
    grid = pyvista.from_meshio(meshio.Mesh(mesh.points, mesh.cells))
    with pytest.raises(sfx.MeshError, match="name some by read_mesh"):
        sfx.solve(scene(mesh=grid), COMM)
    rules = {"left": "x[0] < 1e-9", "bottom": "x[1] < 1e-9", "top": "x[1] > 1 - 1e-9"}
    solutions.append(alone(scene(mesh=sfx.read_mesh(grid, COMM, boundaries=rules))))
    of_file = alone(scene(mesh={"file": str(tmp_path / "block.msh")}))
    for solution in solutions:
        np.testing.assert_allclose(
            solution.contact.pressure, of_file.contact.pressure, rtol=1e-9, atol=1e-9
        )


WRONG = {
    "young": (
        lambda: sfx.LinearElastic(young=function(), poisson=0.3),
        "young: must be a number, not dolfinx's Function",
    ),
    "gap": (
        lambda: sfx.Contact(boundary="bottom", gap=function()),
        "gap: dolfinx's Function cannot be",
    ),
    "bound": (
        lambda: sfx.Contact(boundary="bottom", friction=sfx.Tresca(function())),
        "friction: bound: dolfinx's Function cannot be",
    ),
    "negative": (lambda: sfx.Coulomb(-0.1), "Coulomb: coefficient: must not be negative, got -0.1"),
    "displacement": (
        lambda: sfx.Displacement(boundary="left", x=function()),
        "x: dolfinx's Function cannot",
    ),
    "array": (
        lambda: sfx.Traction(boundary="top", y=np.ones(2)),
        "y: must be a number, not numpy's ndarray",
    ),
    "mesh": (lambda: scene(mesh=DOLFINX_MESH), "mesh: .* see tag_boundaries"),
    "file": (lambda: scene(mesh="body.msh"), "mesh: a table with file or generator"),
    "key": (lambda: sfx.Traction(boundary="top", yy=3.0), "yy: unknown key"),
    "kind": (lambda: scene(contact=sfx.Traction(boundary="top")), "contact: must be a table"),
}


@pytest.mark.parametrize("what", WRONG)
@pytest.mark.timeout(60)
def test_wrong_kinds_in_a_scene(what):
    """One sentence that names the key, and no search without end in a field of FEniCSx."""
    build, told = WRONG[what]
    with pytest.raises(SceneError) as error:
        build()
    assert all(part in str(error.value) for part in told.split(" .* "))


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: sfx.solve(None), "a Scene or the path of a scene file"),
        (lambda: sfx.solve(scene(), 2), "a communicator of mpi4py"),
        (lambda: sfx.sweep(scene(), {"contact.gap": [0.0]}, 2), "a communicator of mpi4py"),
        (lambda: sfx.read_scene(scene()), "the path of a scene file"),
        (lambda: sfx.tag_boundaries(TAGGED, {}), "a mesh of dolfinx is expected, not TaggedMesh"),
        (lambda: sfx.tag_boundaries(DOLFINX_MESH, {"left": 3}), "boundary 'left'"),
        (lambda: sfx.write_results("a", "b"), "a Solution and a folder, not str"),
        (lambda: sfx.LinearElastic(5000.0, 0.3), "keyword arguments: young, poisson, grading"),
    ],
)
def test_wrong_kinds_of_arguments(call, told):
    """A TypeError that says what is expected."""
    with pytest.raises(TypeError, match=told):
        call()


def test_numbers_of_numpy_in_settings():
    """Where a word would do as well."""
    settings = sfx.SolverSettings(
        gamma_n=np.float64(1e6), gamma_t=np.float32(2e6), inner_iterations=np.int64(3)
    )
    assert (settings.gamma_n, settings.gamma_t, settings.inner_iterations) == (1e6, 2e6, 3)


def test_signature_of_a_table():
    """Keys and defaults, as help and a notebook show them."""
    shown = (
        "(*, boundary, against=None, points='auto', distance='geometry', adjust=None, "
        "sliding='finite', reach=None, gap=0.0, "
        "direction=None, foundation=None, friction=NoFriction(law='none'), contact_size=None, "
        "kind='unilateral', "
        "overclosure=None, "
        "wear=None, cohesion=None, conductance=None, friction_heat=None, seeping=None)"
    )
    assert str(inspect.signature(sfx.Contact)) == shown
    assert str(inspect.signature(sfx.LinearElastic)).startswith(
        "(*, young, poisson, grading=None, hypothesis='plane strain', torsion=False, density=None, "
    )


@pytest.mark.one_quick(
    "scene", [lambda: example1(nx=6, ny=2), lambda: block(3, "tetrahedra", degree=2)]
)
def test_grid_for_pyvista(scene, monkeypatch):
    """Its volume is that of the body, and the fields are those of the solution where they are;
    without PyVista an error says what to install.
    """
    pytest.importorskip("pyvista")
    solution = alone(scene())
    grid = sfx.pyvista_grid(solution)
    whole = grid.compute_cell_sizes()
    assert whole["Area"].sum() + whole["Volume"].sum() == pytest.approx(3.0)
    space = solution.displacement.function_space
    size = space.dofmap.bs
    away, at = cKDTree(space.tabulate_dof_coordinates()).query(grid.points)
    assert away.max() < 1e-12
    np.testing.assert_allclose(
        grid["displacement"][:, :size],
        solution.displacement.x.array.reshape(-1, size)[at],
        atol=1e-15,
    )
    assert {"von_mises", "recovered_von_mises", "stress", "density"} <= set(grid.point_data)
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(sfx.PictureError, match="pip install pyvista"):
        sfx.pyvista_grid(solution)


def test_pictures_of_ones_own(tmp_path):
    """A field on axes of a user's, the body in a window of PyVista, and load steps that move."""
    needs_pictures_in_3d()
    factors = {"displacement": sfx.Displacement(boundary="left", x=0.0, y=0.1, factors=[0.0, 1.0])}
    solution = alone(scene(**factors))
    ax = Figure().subplots()
    assert solution.plot("displacement", ax=ax) is ax
    drawn = next(one for one in ax.collections if isinstance(one, TriMesh))
    assert drawn.get_array().max() == pytest.approx(0.1, rel=0.02)
    window = solution.plotter("displacement", times=3.0, off_screen=True)
    grid = sfx.pyvista_grid(solution)
    places = grid.points + 3.0 * grid["displacement"]
    np.testing.assert_allclose(window.actors["body"].mapper.dataset.points, places, atol=1e-6)
    window.close()
    solution.animate(tmp_path / "steps.gif", window_size=(120, 90))
    with Image.open(tmp_path / "steps.gif") as moving:
        assert moving.n_frames == 2
    for wrong in (solution.plotter, lambda name: solution.plot(name, ax=ax)):
        with pytest.raises(ValueError, match=r"'heat': there are .*displacement"):
            wrong("heat")
    with pytest.raises(sfx.SignoriniError, match=r"is \.gif"):
        solution.animate(tmp_path / "steps.png")
