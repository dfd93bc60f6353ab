"""Errors of bodies in 3D: estimated against known, from one mesh to the next, and as small as is asked for."""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from manufactured_in_space import YOUNG, made_up, stress
from mesh_files import write_msh
from mpi4py import MPI
from ranks import same_on_all_ranks
from reference import Reference
from scenes import table_of
from spaces import block, box
from surfaces import grid

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_vertices
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.materials.orthotropic import OrthotropicElastic
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import History, Status
from signorini_fx.results.accuracy.contact_surface import ContactSurface
from signorini_fx.results.accuracy.convergence_table import border_of, fineness_of, predict
from signorini_fx.results.accuracy.pressure_error import interval_squares, polygon_error
from signorini_fx.scenes.mesh_sequence import meshed_scene, solve_scenes
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.meshed_problem import plane_modulus
from signorini_fx.tuned import CORNER_SHARE, KINK_SHARE

WORLD = MPI.COMM_WORLD


CELLS = pytest.mark.parametrize("cells", ["squares", "triangles"])


@CELLS
def test_a_pressure_along_one_direction_is_that_of_a_curve(cells):
    """The same error as in 2D times the width, on unequal intervals."""
    x = np.linspace(-1.0, 1.0, 21) ** 3
    table = grid(x, np.linspace(0.0, 0.5, 6), cells)
    along = (1 - x**2) ** 3
    weight = np.ones_like(x)
    curve = ContactTable({"s": x + 1, "pressure": along, "weight": weight}, [range(x.size)])
    (expected,) = interval_squares(curve)
    surface = ContactSurface.of(table)
    squares = surface.squares((1 - table.columns["x"] ** 2) ** 3)
    middle = np.abs(surface.x[surface.corners].mean(axis=1)[:, 1] - 0.25) < 0.15  # not at the rim
    assert squares.sum() == pytest.approx(0.5 * expected.sum(), rel=1e-9)
    assert squares[middle].sum() == pytest.approx(0.3 * expected.sum(), rel=1e-9)


@CELLS
def test_a_linear_pressure_has_no_kink_on_a_distorted_surface(cells):
    """In any plane; every side but those at the rim has a neighbour."""
    rng = np.random.default_rng(0)
    table = grid(np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 5), cells)
    for name in "xy":
        table.columns[name] = table.columns[name] + 0.05 * rng.uniform(-1, 1, 25)
    table.columns["z"] = 0.3 * table.columns["x"] - 0.2 * table.columns["y"]
    surface, c = ContactSurface.of(table), table.columns
    assert np.abs(surface.jumps(2 + c["x"] - 3 * c["y"] + c["z"])).max() < 1e-12
    assert np.abs(surface.jumps(np.abs(c["x"] - 0.5))).max() > 0.5
    assert surface.rim.sum() == 16


def test_a_pressure_that_is_convex_at_the_rim():
    """The pieces there have the share of a corner; else no more than others."""
    table = grid(np.arange(6.0), np.arange(6.0), "squares")
    surface, x = ContactSurface.of(table), table.columns["x"]
    first = np.isclose(surface.x[surface.corners].mean(axis=1)[:, 0], 0.5)
    inner = first & (np.abs(surface.x[surface.corners].mean(axis=1)[:, 1] - 2.5) < 1)
    convex, concave = (surface.squares(10 + sign * (5 - x) ** 2) for sign in (1.0, -0.1))
    np.testing.assert_allclose(convex[inner], CORNER_SHARE * 2.0**2)
    np.testing.assert_allclose(concave[inner], KINK_SHARE / 2 * 0.2**2)


def test_a_facet_of_degree_2_is_four_pieces():
    """They cover it, see a kink in its middle, and are added up for it; without its middle nodes it is one piece."""
    points = [(0, 0), (2, 0), (0, 2), (2, 2), (1, 0), (0, 1), (2, 1), (1, 2), (1, 1)]  # as basix has them
    x, y = np.array(points, dtype=float).T
    columns = {"x": x, "y": y, "z": 0 * x, "pressure": 0 * x, "weight": 1 + 0 * x}
    numbers = np.column_stack((np.zeros(9, dtype=np.int64), np.arange(9)))
    table = ContactTable(columns, [], numbers, np.arange(9)[None])
    surface = ContactSurface.of(table)
    np.testing.assert_allclose(surface.area, 1.0)
    assert np.count_nonzero(surface.jumps(np.abs(x - 1))) == 4
    assert surface.rim.sum() == 8
    corners_only = replace(table, facets=np.array([[0, 1, 2, 3, -1, -1, -1, -1, -1]]))
    assert ContactSurface.of(corners_only).area == pytest.approx(4.0)


def test_facets_instead_of_a_curved_surface():
    """Facets of a cylinder turn by the same angle everywhere, and the error follows it as in 2D."""
    angle = np.linspace(-0.2, 0.2, 9)
    table = grid(np.sin(angle), np.linspace(0.0, 1.0, 3), "squares", z=np.tile(1 - np.cos(angle), 3))
    surface = ContactSurface.of(table)
    turns = surface.turns()
    assert np.allclose(turns[turns > 1e-6], 0.05)
    columns = {**table.columns, "pressure": np.full(27, 4.0)}
    assert polygon_error(replace(table, columns=columns), 100.0) == pytest.approx(100 * 0.05 / 4)
    assert polygon_error(grid(np.arange(3.0), np.arange(3.0), "squares"), 100.0) == 0.0


@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
@pytest.mark.parametrize("poisson", [-0.3, 0.0, 0.3, 0.5])
def test_modulus_of_facets(hypothesis, poisson):
    """E / (1 - nu^2) of a half-plane, in plane stress E, and no less of a material with directions."""
    material = LinearElastic(young=7.0, poisson=poisson, hypothesis=hypothesis)
    assert plane_modulus(material) == pytest.approx(7.0 if hypothesis == "plane stress" else 7.0 / (1 - poisson**2))
    wood = OrthotropicElastic(orthotropic={"young": [9.0, 2.0, 1.0], "poisson": [0.3] * 3, "shear": [1.0] * 3})
    assert plane_modulus(wood) >= 9.0


def true_energy_error(solution):
    """Of the made-up solution, relative."""
    mesh = solution.model.tagged.mesh
    exact = stress(mesh)
    wrong = YOUNG * ufl.sym(ufl.grad(solution.displacement)) - exact

    def norm(tau):
        return fem.assemble_scalar(fem.form(ufl.inner(tau, tau) * ufl.dx(metadata={"quadrature_degree": 6})))

    return np.sqrt(norm(wrong) / norm(exact))


@pytest.mark.slow
@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_energy_of_a_known_solution(cells):
    """Within a tenth of the truth, on two meshes: nu = 0, and the stress is smooth but for the rim of the disc."""
    for n in (4, 8):
        solved = meshed_scene(made_up(cells, n), MPI.COMM_SELF, History()).solved(0, None, None)
        assert solved.level.energy == pytest.approx(true_energy_error(solved.solution), rel=0.1)


LAWS = {"none": {}, "tresca": {"bound": 1.5}, "coulomb": {"coefficient": 0.3}}


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_estimates_of_the_block(law):
    """With the margin of an asked-for accuracy none is below 0.7 of what a finer mesh says, and few are far above.

    The largest pressure has no limit with Coulomb friction, and after two refinements none is given.
    """
    reference = Reference(solve(block(24, gamma=1e8, **LAWS[law]), MPI.COMM_SELF))
    for cells in ("hexahedra", "tetrahedra"):
        found = []
        meshes = [block(n, cells, gamma=1e8, **LAWS[law]) for n in (3, 6, 12)]
        found.append(solve_scenes(meshes, MPI.COMM_SELF, History(), found.append))
        for solution, level, row in list(zip(found, found[-1].levels, found[-1].convergence_table, strict=False))[1:]:
            true = reference.errors(solution)
            assert 0.7 < 1.7 * level.energy / true["energy"] < 2.5
            assert 0.7 < 2 * row.pressure / true["pressure"] < 9
            if true["force"] > 1e-9 and level.level > 1:
                assert 2 * row.force > 0.7 * true["force"]
            assert row.zone > 0.7 * true["zone"]


def hertz(cells, n):
    """A quarter of a block on a sphere (as a paraboloid), with small cells where contact begins."""
    tagged = box(cells, (n, n, n), size=(1.0, 1.0, 1.0))
    tagged.mesh.geometry.x[:] = tagged.mesh.geometry.x**1.8
    return parse_scene(
        {
            "mesh": tagged,
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [
                {"boundary": "left", "normal": 0.0},
                {"boundary": "front", "normal": 0.0},
                {"boundary": "top", "z": -0.012},
            ],
            "contact": {"boundary": "bottom", "gap": "(x[0]**2 + x[1]**2) / 2"},
        }
    )


@pytest.mark.one_quick
@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_pressure_of_hertz(cells):
    """With the margin not below 0.7 of the error against Hertz' pressure for the force, at the nodes."""
    for n in (6, 10):
        solved = meshed_scene(hertz(cells, n), MPI.COMM_SELF, History()).solved(0, None, None)
        force, c = 4 * solved.solution.contact.forces[0][2], table_of(solved.solution).columns
        a = (3 * force * (1 - 0.3**2) / (4 * 1000.0)) ** (1 / 3)
        square = np.maximum(1 - (c["x"] ** 2 + c["y"] ** 2) / a**2, 0.0)
        exact = 3 * force / (2 * np.pi * a**2) * np.sqrt(square)
        true = np.sqrt(c["weight"] @ (c["pressure"] - exact) ** 2 / (c["weight"] @ exact**2))
        assert 0.7 * true < 2 * solved.level.pressure < 20 * true


def test_rows_of_the_convergence_table():
    """Unknowns grow eightfold, time and memory by the powers of space; h is a length."""
    found = []
    found.append(solve_scenes([block(n) for n in (3, 6, 12)], MPI.COMM_SELF, History(), found.append))
    rows = found[-1].convergence_table
    assert rows[-1].dofs == pytest.approx(rows[-2].dofs ** 2 / rows[-3].dofs, rel=1e-3)
    assert rows[2].h == pytest.approx(np.sqrt(3.0 / (13 * 5)))
    assert rows[-1].h == pytest.approx(rows[2].h / fineness_of(rows[2].dofs / rows[1].dofs, 3))
    assert all(len(level.force) == 6 for level in found[-1].levels)
    assert [row.force is None for row in rows] == [True, True, False, False]

    def mesh(dofs):
        return replace(rows[0], dofs=dofs, seconds=0.1 + 1e-6 * dofs**1.6, memory=200 + 1e-3 * dofs**1.3)

    following = predict([mesh(10_000), mesh(80_000)], 150.0, dimension=3)
    assert following.dofs == 640_000
    assert following.seconds == pytest.approx(mesh(640_000).seconds)
    assert following.memory == pytest.approx(mesh(640_000).memory)
    assert following.pressure == pytest.approx(rows[0].pressure / 2**1.25)


def test_the_contact_area():
    """The half of the pieces that it ends in."""
    tables = []
    for pressed in (4, 8):
        table = grid(np.arange(4.0), np.arange(4.0), "squares")
        table.columns["pressure"][:pressed] = 1.0
        tables.append(table)
    # A row of three squares of nine, with four nodes or eight in contact.
    assert [border_of(table) for table in tables] == pytest.approx([3 / 2 / 4, 3 / 2 / 8])


SIDES = {"left": 1.0, "right": 1.0, "front": 3.0, "back": 3.0, "bottom": 3.0, "top": 3.0}


def areas(tagged):
    """Area of every named boundary."""
    found = {}
    for name in SIDES:
        x = facet_vertices(tagged.mesh, tagged.facets(name))
        own = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1).sum() / 2 if len(x) else 0.0
        found[name] = float(parallel.global_sum(tagged.mesh.comm, own))
    return found


@pytest.mark.mpi
def test_names_of_refined_tetrahedra_are_kept():
    """Marked and all, twice: boundaries are whole and nothing else."""
    tagged = box("tetrahedra", (6, 2, 2), comm=WORLD)
    cells = [tagged.mesh.topology.index_map(3).size_global]
    for marked in (np.arange(2, dtype=np.int32), None):
        tagged = refine(tagged, marked)
        assert areas(tagged) == pytest.approx(SIDES)
        cells.append(tagged.mesh.topology.index_map(3).size_global)
    assert cells[2] == 8 * cells[1] > 8 * cells[0]


def asked(cell, law="none", nx=12, comm=MPI.COMM_SELF, **goal):
    """The block from the generator, with gamma left to the program, asked for an accuracy."""
    mesh = {"generator": "box", "parameters": {"nx": nx, "ny": nx // 3, "nz": nx // 3, "cell": cell}}
    scene = block(mesh=mesh, gamma="auto", **LAWS[law])
    return solve(scene.model_copy(update={"accuracy": Accuracy(**goal)}), comm, check=False)


@pytest.fixture(scope="module")
def fine():
    """The block without friction on a fine mesh."""
    return Reference(solve(block(24, gamma="auto", algorithm="alm"), MPI.COMM_SELF))


@pytest.mark.one_quick
@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
@pytest.mark.parametrize(("of", "target"), [("energy", 0.5), ("pressure", 0.5)])
def test_asked_for(fine, cell, of, target):
    """Met by tetrahedra that are divided where the error is, and by hexahedra that are all made smaller."""
    solution = asked(cell, target=target, of=of)
    assert solution.status is Status.CONVERGED
    assert fine.errors(solution)[of] <= target
    assert solution.model.tagged.mesh.topology.cell_name() == cell
    assert solution.model.dofs < 12_000
    assert isinstance(solution.statement.origin["mesh"], TaggedMesh) == (cell == "tetrahedron")


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_every_number_of_ranks_meets_it(cell):
    """All ranks together come to the estimates that one comes to; divided meshes differ a little."""
    goal = {"target": 0.6, "of": "energy"}
    together, alone = (asked(cell, "tresca", comm=comm, **goal) for comm in (WORLD, MPI.COMM_SELF))
    assert same_on_all_ranks(together.status) is alone.status is Status.CONVERGED
    assert same_on_all_ranks([level.dofs for level in together.levels]) == [level.dofs for level in alone.levels]
    for ours, theirs in zip(together.levels, alone.levels, strict=True):
        assert ours.energy == pytest.approx(theirs.energy, rel=1e-4)
        assert ours.pressure == pytest.approx(theirs.pressure, rel=1e-4)


@pytest.mark.slow
def test_no_finite_largest_pressure():
    """Coulomb friction at an edge: the largest pressure is not promised, and the message says where it grows."""
    solution = asked("hexahedron", "coulomb", target=0.02, of="peak", seconds=60.0)
    assert solution.status is Status.OUT_OF_REACH
    assert any("no finite value" in event and "round off the edge" in event for event in solution.history.events)


REFUSED = [
    ("box", {"cell": "hexahedron"}, "hexahedra cannot be divided one by one"),
    ("cylinder", {"cell": "tetrahedron"}, "the arcs of cylinder"),
]


@pytest.mark.parametrize(("generator", "parameters", "reason"), REFUSED)
def test_what_cannot_be_divided(generator, parameters, reason):
    """Said before anything is solved."""
    scene = block(mesh={"generator": generator, "parameters": parameters}, gamma="auto")
    goal = Accuracy(target=0.1, refinement="adaptive")
    with pytest.raises(SceneError, match=reason):
        solve(scene.model_copy(update={"accuracy": goal}), MPI.COMM_SELF)


def test_own_meshes_that_cannot_be_divided():
    """Hexahedra of one's own, and curved tetrahedra."""
    with pytest.raises(MeshError, match="only tetrahedra"):
        refine(box("hexahedra", (1, 1, 1)))
    sphere = generate_mesh("half_sphere", {"size": 6.0, "contact_size": 3.0, "order": 2}, MPI.COMM_SELF)
    with pytest.raises(MeshError, match="straight sides"):
        refine(sphere)


ROLLER = """SetFactory("OpenCASCADE");
Cylinder(1) = {0, 0, 1, 0, 0.5, 0, 1}; Box(2) = {-1, 0, 0, 2, 0.5, 0.5};
BooleanIntersection(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Physical Volume("body") = {3}; Physical Surface("all") = Surface{:};
Mesh.MeshSizeMax = 0.3;
"""


def roller(file, **goal):
    """The lower part of a cylinder, pressed onto a plane."""
    lip = "x[0]**2 + (x[2] - 1)**2 - 0.99999"
    return parse_scene(
        {
            "mesh": {"file": str(file), "boundaries": {"top": "x[2] - 0.499999", "lip": lip}},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.0, "y": 0.0, "z": -0.02},
            "contact": {"boundary": "lip", "gap": "x[2]", "direction": [0.0, 0.0, -1.0]},
            "accuracy": goal,
        }
    )


def test_curved_bodies_from_files(tmp_path):
    """A drawing is meshed anew on its true shape and not divided; straight tetrahedra in its place are no way to it."""
    drawing, straight = tmp_path / "roller.geo", tmp_path / "roller.msh"
    drawing.write_text(ROLLER)
    write_msh(drawing, straight, 1)
    met = solve(roller(drawing, target=0.6), MPI.COMM_SELF)
    on_shape = met.table.columns
    assert np.abs(on_shape["x"] ** 2 + (on_shape["z"] - 1) ** 2 - 1).max() < 1e-6
    polygon = solve(roller(straight, target=0.2, of="pressure"), MPI.COMM_SELF, check=False)
    assert polygon.status is Status.OUT_OF_REACH
    assert any("straight facets" in event for event in polygon.history.events)
