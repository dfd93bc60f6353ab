"""Refinement of triangles: names are kept, marks are few, and adaptive meshes win where the solution is singular."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.errors import MeshError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_vertices
from signorini_fx.mechanics.mesh.refinement import mark, refine
from signorini_fx.mechanics.mesh.tagged import generate_mesh, tag_boundaries
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve

SIDES = {"bottom": 3.0, "right": 1.0, "top": 3.0, "left": 1.0}


def lengths(tagged):
    """Length of every named boundary."""
    mesh = tagged.mesh
    result = {}
    for name in SIDES:
        x = facet_vertices(mesh, tagged.facets(name))
        result[name] = float(parallel.global_sum(mesh.comm, np.linalg.norm(x[:, 0] - x[:, 1], axis=1).sum()))
    return result


@pytest.mark.mpi
@pytest.mark.parametrize("everything", [True, False], ids=["all", "marked"])
def test_names_are_kept(everything):
    """Boundaries of a refined mesh are those of the mesh, whole and nothing else, and so is the region."""
    tagged = generate_mesh("block", {"nx": 6, "ny": 3, "cell": "triangle"}, MPI.COMM_WORLD)
    fine = refine(tagged, None if everything else np.arange(min(2, len(tagged.cells("body"))), dtype=np.int32))
    assert lengths(fine) == pytest.approx(SIDES)
    index_map = fine.mesh.topology.index_map(2)
    assert len(fine.cells("body")) == index_map.size_local + index_map.num_ghosts
    assert index_map.size_global > tagged.mesh.topology.index_map(2).size_global


def test_quadrilaterals_are_refused():
    """Only triangles can be bisected, and that is said."""
    with pytest.raises(MeshError, match="only triangles"):
        refine(generate_mesh("rectangle", {"nx": 2, "ny": 2}, MPI.COMM_SELF))


def test_marks_are_the_fewest_that_hold_half():
    """One cell of 10 that holds more than half is enough; equal cells are marked half and half at the least."""
    assert mark(MPI.COMM_SELF, np.array([1.0, 1.0, 9.0, 1.0])).tolist() == [2]
    assert len(mark(MPI.COMM_SELF, np.ones(10))) >= 5


def example2():
    """Example 2 of section 7.2 with Tresca friction g = 1 on triangles, its singular corners included."""
    near = 1e-9
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [np.zeros(2), np.array([3.0, 1.0])], [30, 10])
    tagged = tag_boundaries(
        mesh,
        {
            "left": lambda x: (np.abs(x[0]) < near) & (x[1] > 0.2 - near),
            "right": lambda x: (np.abs(x[0] - 3) < near) & (x[1] > 0.2 - near),
            "bottom": lambda x: np.abs(x[1]) < near,
        },
    )
    return Scene(
        mesh=tagged,
        material={"young": 1e4, "poisson": 0.45},
        displacement=[
            {"boundary": "left", "x": "0.003*(1 - x[1])", "y": -0.004},
            {"boundary": "right", "x": "-0.003*(1 - x[1])", "y": -0.004},
        ],
        contact={
            "boundary": "bottom",
            "gap": "max(0.0015, 0.003*(x[0] - 1.5)**2 + 0.001)",
            "friction": {"law": "tresca", "bound": 1.0},
        },
    )


@pytest.mark.slow
def test_adaptive_meshes_need_a_fifth_of_the_unknowns():
    """The same estimated energy error as on uniform meshes, with at most a fifth of the dofs, at the optimal rate."""
    solutions = {}
    for refinement in ("uniform", "adaptive"):
        goal = Accuracy(target=0.06, of="energy", refinement=refinement)
        solutions[refinement] = solve(example2().model_copy(update={"accuracy": goal}), MPI.COMM_SELF)
    uniform, adaptive = (solutions[name].levels for name in ("uniform", "adaptive"))
    enough = next(level for level in adaptive if level.energy <= uniform[-1].energy)
    assert 5 * enough.dofs <= uniform[-1].dofs
    growth = np.log(adaptive[-1].dofs / adaptive[-4].dofs)
    assert np.log(adaptive[-4].energy / adaptive[-1].energy) / growth == pytest.approx(0.5, abs=0.1)
