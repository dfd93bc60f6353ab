"""The number of ranks changes nothing: not the counts, not the numbers, not the errors.

Every test solves on all ranks together and, for reference, on each rank alone.
"""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import PATCH, energy, example1, table_of

from signorini_fx.errors import MeshError, SceneError, SignoriniError
from signorini_fx.mechanics.effects.contact import UnilateralContact
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.effects.traction import SurfaceTraction
from signorini_fx.mechanics.laws.tresca import Tresca
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.records import Status
from signorini_fx.scenes.solver import solve

pytestmark = pytest.mark.mpi
WORLD = MPI.COMM_WORLD

SCENES = {
    "tresca": example1(bound=1.5, nx=60, ny=20, patch=PATCH),
    "coulomb": example1(coefficient=0.3, nx=60, ny=20),
    "frictionless": example1(nx=60, ny=20),
    "triangles": example1(coefficient=0.3, nx=30, ny=10, cell="triangle"),
    "P2": example1(bound=1.5, nx=30, ny=10, cell="triangle", degree=2),
    "Q2": example1(coefficient=1.0, nx=30, ny=10, degree=2),
    "gmsh": example1(bound=1.5, nx=30, ny=10, generator="block", cell="triangle", layout="unstructured"),
    "automatic gamma": example1(bound=1.5, nx=30, ny=10, gamma="auto"),
    "held by friction": example1(bound=1.5, nx=30, ny=10).model_copy(update={"displacement": ()}),
}


def same_on_all_ranks(value):
    """The value, which all ranks must share."""
    assert all(other == value for other in WORLD.allgather(value))
    return value


def agree(scene):
    """All ranks together get what one rank gets: status, counts, and numbers to 1e-9 of the largest."""
    together, alone = solve(scene, WORLD, check=False), solve(scene, MPI.COMM_SELF, check=False)
    assert same_on_all_ranks(together.status) is alone.status
    sets = [[(r.active_contact, r.slip_plus, r.slip_minus) for r in s.history.iterations] for s in (together, alone)]
    assert same_on_all_ranks(sets[0]) == sets[1]
    ours, theirs = table_of(together).columns, table_of(alone).columns
    for names in (("x", "s"), ("weight",), ("gap", "u_n", "u_t"), ("pressure", "shear", "bound")):
        close = 1e-9 * max(np.abs(theirs[name]).max() for name in names)
        for name in names:
            np.testing.assert_allclose(ours[name], theirs[name], rtol=0, atol=close, err_msg=name)
    for name in ("state", "friction"):
        assert ours[name].tolist() == theirs[name].tolist()
    assert same_on_all_ranks(energy(together)) == pytest.approx(energy(alone), rel=1e-9)
    assert same_on_all_ranks(together.certificate.holds) == alone.certificate.holds
    np.testing.assert_allclose(together.contact.forces, alone.contact.forces, atol=1e-8)
    return together


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("name", SCENES)
def test_one_rank_or_many(name):
    """Scenes of every kind."""
    assert agree(SCENES[name]).converged


@pytest.mark.parametrize("law", [{}, {"bound": 1.5}, {"coefficient": 0.3}])
@pytest.mark.parametrize(("nx", "ny"), [(2, 2), (1, 3), (1, 1)])
def test_more_ranks_than_contact_facets(nx, ny, law):
    """Some ranks have no contact facet, or no cell at all; a node may live on a rank that owns none of its facets."""
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
            {"contact": (UnilateralContact(boundary="foot"),)},
            r"contact\[0\].boundary.*'foot'.*bottom, left, right, top",
        ),
        ({"displacement": (PrescribedDisplacement(boundary="bottom", y=0.0),)}, r"displacement\[0\].*6 facets"),
        (
            {"displacement": (PrescribedDisplacement(boundary="left", x="sqrt(x[1] - 0.1)"),)},
            "displacement.*not finite",
        ),
        ({"traction": (SurfaceTraction(boundary="top", y="log(x[0] - 2.9)"),)}, "traction.*not finite"),
        (with_contact(gap=Expression("sqrt(x[0] - 0.1)")), r"contact\[0\].gap: is nan at \("),
        (with_contact(friction=Tresca(bound="2.5 - x[0]")), r"contact\[0\].friction.bound: is -0.5 at \(3, "),
        ({"solver": SMALL.solver.model_copy(update={"initial_contact": lambda x: x[0] - 9})}, "holds no contact node"),
        ({"mesh": SMALL.mesh.model_copy(update={"generator": "torus"})}, "mesh.generator.*'torus'"),
        ({"mesh": SMALL.mesh.model_copy(update={"parameters": {"nx": -1}})}, r"mesh\.parameters\.nx"),
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
    loose = SMALL.model_copy(update={"displacement": (), "traction": (SurfaceTraction(boundary="top", y=20.0),)})
    with pytest.raises(SignoriniError) as caught:
        solve(loose, WORLD)
    assert same_on_all_ranks(caught.value.solution.status) is Status.OPEN
