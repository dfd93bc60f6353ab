"""Errors of bodies in 3D: estimated against known, from one mesh to the next, and as small as is
asked for.
"""

import numpy as np
import pytest
from mesh_files import write_msh
from mpi4py import MPI
from ranks import same_on_all_ranks
from reference import Reference
from scene_tables import box_mesh
from scenes import table_of
from spaces import block, box

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_vertices
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import History, Status
from signorini_fx.scenes.mesh_sequence import MeshedScene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

WORLD = MPI.COMM_WORLD


LAWS = {"none": {}, "tresca": {"bound": 1.5}, "coulomb": {"coefficient": 0.3}}


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


@pytest.mark.one_quick("n", [6, 10])
@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_pressure_of_hertz(cells, n):
    """With the margin not below 0.7 of the error against Hertz' pressure for the force, at the
    nodes.
    """
    solved = MeshedScene(comm=MPI.COMM_SELF, history=History(), scene=hertz(cells, n)).solved(
        0, None, None
    )
    force, c = 4 * solved.solution.contact.forces[0][2], table_of(solved.solution).columns
    a = (3 * force * (1 - 0.3**2) / (4 * 1000.0)) ** (1 / 3)
    square = np.maximum(1 - (c["x"] ** 2 + c["y"] ** 2) / a**2, 0.0)
    exact = 3 * force / (2 * np.pi * a**2) * np.sqrt(square)
    true = np.sqrt(c["weight"] @ (c["pressure"] - exact) ** 2 / (c["weight"] @ exact**2))
    assert 0.7 * true < 2 * solved.level.pressure < 20 * true


SIDES = {"left": 1.0, "right": 1.0, "front": 3.0, "back": 3.0, "bottom": 3.0, "top": 3.0}


def areas(tagged):
    """Area of every named boundary."""
    found = {}
    for name in SIDES:
        x = facet_vertices(tagged.mesh, tagged.facets(name))
        own = (
            np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1).sum() / 2
            if len(x)
            else 0.0
        )
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
    mesh = box_mesh(nx, nx // 3, nx // 3, cell=cell)
    scene = block(mesh=mesh, gamma="auto", **LAWS[law])
    return solve(scene.model_copy(update={"accuracy": Accuracy(**goal)}), comm, check=False)


@pytest.fixture(scope="module")
def fine():
    """The block without friction on a fine mesh."""
    return Reference(solve(block(24, gamma="auto", algorithm="alm"), MPI.COMM_SELF))


@pytest.mark.one_quick("cell", ["tetrahedron", "hexahedron"])
@pytest.mark.parametrize(("of", "target"), [("energy", 0.5), ("pressure", 0.5)])
def test_asked_for(fine, cell, of, target):
    """Met by tetrahedra that are divided where the error is, and by hexahedra that are all made
    smaller.
    """
    solution = asked(cell, target=target, of=of)
    assert solution.converged
    assert fine.errors(solution)[of] <= target
    assert solution.model.tagged.mesh.topology.cell_name() == cell
    assert solution.model.dofs < 12_000
    assert isinstance(solution.statement.origin["mesh"], TaggedMesh) == (cell == "tetrahedron")


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_every_number_of_ranks_meets_it(cell):
    """All ranks together come to the estimates that one comes to; divided meshes differ a
    little.
    """
    goal = {"target": 0.6, "of": "energy"}
    together, alone = (asked(cell, "tresca", comm=comm, **goal) for comm in (WORLD, MPI.COMM_SELF))
    assert same_on_all_ranks(together.status) is alone.status is Status.CONVERGED
    assert same_on_all_ranks([level.dofs for level in together.levels]) == [
        level.dofs for level in alone.levels
    ]
    for ours, theirs in zip(together.levels, alone.levels, strict=True):
        assert ours.energy == pytest.approx(theirs.energy, rel=1e-4)
        assert ours.pressure == pytest.approx(theirs.pressure, rel=1e-4)


@pytest.mark.slow
def test_no_finite_largest_pressure():
    """Coulomb friction at an edge: the largest pressure is not promised, and the message says where
    it grows.
    """
    solution = asked("hexahedron", "coulomb", target=0.02, of="peak", seconds=60.0)
    assert solution.status is Status.OUT_OF_REACH
    assert any(
        "no finite value" in event and "round off the edge" in event
        for event in solution.history.events
    )


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
    sphere = generate_mesh(
        "half_sphere", {"size": 6.0, "contact_size": 3.0, "order": 2}, MPI.COMM_SELF
    )
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


@pytest.mark.slow
def test_curved_bodies_from_files(tmp_path):
    """A drawing is meshed anew on its true shape and not divided; straight tetrahedra in its place
    are no way to it.
    """
    drawing, straight = tmp_path / "roller.geo", tmp_path / "roller.msh"
    drawing.write_text(ROLLER)
    write_msh(drawing, straight, 1)
    met = solve(roller(drawing, target=0.6), MPI.COMM_SELF)
    on_shape = met.table.columns
    assert np.abs(on_shape["x"] ** 2 + (on_shape["z"] - 1) ** 2 - 1).max() < 1e-6
    polygon = solve(roller(straight, target=0.2, of="pressure"), MPI.COMM_SELF, check=False)
    assert polygon.status is Status.OUT_OF_REACH
    assert any("straight facets" in event for event in polygon.history.events)
