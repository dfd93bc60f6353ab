"""The number of ranks changes nothing: not the counts, not the numbers, not the errors.

Every test solves on all ranks together and, for reference, on each rank alone.
"""

import numpy as np
import pytest
from ranks import WORLD, agree, same_on_all_ranks
from scenes import PATCH, example1
from spaces import block, box, friction_of, pushed_brick, rotation

from signorini_fx.errors import MeshError, SceneError, SignoriniError
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.effects.loads import Traction
from signorini_fx.mechanics.laws.coulomb import Tresca
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

pytestmark = pytest.mark.mpi


def foot(comm, cells, degree=1):
    """Three cells in a row, of which the middle one stands on the foundation: by one square, or two
    triangles.
    """
    mesh = box(cells, (3, 1, 1), comm=comm)
    tagged = tag_boundaries(
        mesh.mesh,
        {
            "top": lambda x: np.abs(x[2] - 1) < 1e-9,
            "foot": lambda x: (np.abs(x[2]) < 1e-9) & (np.abs(x[0] - 1.5) < 0.5 + 1e-9),
        },
    )
    return parse_scene(
        {
            "mesh": tagged,
            "element": {"degree": degree},
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "pressure": 1.0, "x": 0.1, "y": 0.05},
            "contact": {"boundary": "foot", "friction": friction_of(coefficient=0.5)},
        }
    )


def between_walls(comm, cells, degree=1):
    """A brick turned in 3D between two walls that are across no axis, pushed along both of them."""
    back = rotation(0.9, (0.3, -0.8, 0.5))
    tagged = box(cells, (4, 3, 3), size=(1.5, 1.2, 1.0), comm=comm)
    tagged.mesh.geometry.x[:] = tagged.mesh.geometry.x @ back.T
    return parse_scene(
        {
            "mesh": tagged,
            "element": {"degree": degree},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [
                {"boundary": "left", "normal": 0.001},
                {"boundary": "front", "normal": 0.0},
            ],
            "traction": {
                "boundary": "top",
                **dict(zip("xyz", map(float, back @ [1.0, 2.0, -10.0]), strict=True)),
            },
            "contact": {"boundary": "bottom", "friction": friction_of(coefficient=0.3)},
        }
    )


SCENES = {
    "tresca": example1(bound=1.5, nx=60, ny=20, patch=PATCH),
    "coulomb": example1(coefficient=0.3, nx=60, ny=20),
    "frictionless": example1(nx=60, ny=20),
    "triangles": example1(coefficient=0.3, nx=30, ny=10, cell="triangle"),
    "P2": example1(bound=1.5, nx=30, ny=10, cell="triangle", degree=2),
    "Q2": example1(coefficient=1.0, nx=30, ny=10, degree=2),
    "gmsh": example1(
        bound=1.5, nx=30, ny=10, generator="block", cell="triangle", layout="unstructured"
    ),
    "automatic gamma": example1(bound=1.5, nx=30, ny=10, gamma="auto"),
    "held by friction": example1(bound=1.5, nx=30, ny=10).model_copy(update={"displacement": ()}),
    "space, tresca": lambda comm: block(12, bound=1.5, comm=comm),
    "coulomb, tetrahedra": lambda comm: block(12, "tetrahedra", coefficient=0.3, comm=comm),
    "monolithic": lambda comm: block(12, coefficient=0.3, coulomb="newton", comm=comm),
    "alm": lambda comm: block(12, bound=1.5, gamma="auto", algorithm="alm", comm=comm),
    "quadratic tetrahedra": lambda comm: block(6, "tetrahedra", bound=1.5, degree=2, comm=comm),
    "quadratic, monolithic": lambda comm: block(
        6, "tetrahedra", coefficient=0.3, coulomb="newton", degree=2, comm=comm
    ),
    "walls across no axis": lambda comm: between_walls(comm, "hexahedra"),
    "walls across no axis, quadratic": lambda comm: between_walls(comm, "tetrahedra", degree=2),
    "one facet": lambda comm: foot(comm, "hexahedra"),
    "two facets": lambda comm: foot(comm, "tetrahedra"),
    "two quadratic facets": lambda comm: foot(comm, "tetrahedra", degree=2),
    "held by friction in 3D": pushed_brick,
    "slides": lambda comm: pushed_brick(comm, body_force={"x": 4.0}),
}


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("name", SCENES)
def test_one_rank_or_many(name):
    """Scenes of every kind."""
    agree(SCENES[name])


@pytest.mark.parametrize("law", [{}, {"bound": 1.5}, {"coefficient": 0.3}])
@pytest.mark.parametrize(("nx", "ny"), [(2, 2), (1, 3), (1, 1)])
def test_more_ranks_than_contact_facets(nx, ny, law):
    """Some ranks have no contact facet, or no cell at all; a node may live on a rank that owns none
    of its facets.
    """
    together = agree(example1(**law, nx=nx, ny=ny, gamma=1e6))
    assert sum(WORLD.allgather(len(together.contact.boundary.segments))) == nx


SMALL = example1(bound=1.5, nx=6, ny=6)


def with_contact(**changes):
    """SMALL with other data of contact."""
    return {"contact": (SMALL.contact[0].model_copy(update=changes),)}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"contact": (Contact(boundary="foot"),)},
            r"contact\[0\].boundary.*'foot'.*bottom, left, right, top",
        ),
        (
            {"displacement": (Displacement(boundary="bottom", y=0.0),)},
            r"displacement\[0\].*6 facets",
        ),
        (
            {"displacement": (Displacement(boundary="left", x="sqrt(x[1] - 0.1)"),)},
            r"displacement\[0\].x: is nan at \(",
        ),
        (
            {"traction": (Traction(boundary="top", y="log(x[0] - 2.9)"),)},
            r"traction\[0\].y: is nan at \(",
        ),
        (with_contact(gap=Expression("sqrt(x[0] - 0.1)")), r"contact\[0\].gap: is nan at \("),
        (
            with_contact(friction=Tresca(bound="2.5 - x[0]")),
            r"contact\[0\].friction.bound: is -0.5 at \(3, ",
        ),
        (
            {"solver": SMALL.solver.model_copy(update={"initial_contact": lambda x: x[0] - 9})},
            "holds no contact node",
        ),
        ({"mesh": SMALL.mesh.model_copy(update={"generator": "torus"})}, "mesh.generator.*'torus'"),
        (
            {"mesh": SMALL.mesh.model_copy(update={"parameters": {"nx": -1}})},
            r"mesh\.parameters\.nx",
        ),
        ({"mesh": MeshFile(file="/nonexistent.msh")}, "no such file"),
    ],
)
def test_errors_are_raised_alike(changes, message):
    """A mistake that one rank sees, or rank 0 only, is raised on all ranks, with the same words."""
    with pytest.raises((SceneError, MeshError), match=message) as caught:
        solve(SMALL.model_copy(update=changes), WORLD)
    same_on_all_ranks((type(caught.value).__name__, str(caught.value)))


def test_no_solution_is_no_solution_everywhere():
    """A status is the same on all ranks."""
    loose = SMALL.model_copy(
        update={"displacement": (), "traction": (Traction(boundary="top", y=20.0),)}
    )
    with pytest.raises(SignoriniError) as caught:
        solve(loose, WORLD)
    assert same_on_all_ranks(caught.value.solution.status) is Status.OPEN
