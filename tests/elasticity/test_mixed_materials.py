"""The mixed element with several materials, between which the pressure jumps."""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import tensors
from scenes import alone, rectangle
from spaces import box, moved_inside, tagged_ends

from signorini_fx.errors import SceneError
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

MIXED = {"degree": 2, "volumetric": "mixed"}
PLANE = ("triangle", "quadrilateral")
LEFT, RIGHT = (10.0, 0.5, 0.004), (4.0, 0.3, 0.001)  # Young's modulus, Poisson's ratio, expansion
LIKE_LEFT = (
    10.0 / 0.75 * (1 - 0.3**2),
    0.3,
    0.004 * 1.5 / 1.3,
)  # of which the contact pressure is that of LEFT
DOWN, HALF = 0.05, 1.5


def halves(cell, comm=MPI.COMM_WORLD):
    """A block of uneven cells, 3 by 1 (by 1), of which each half is a region."""
    plane = cell in PLANE
    size = (3.0, 1.0) if plane else (3.0, 1.0, 1.0)
    mesh = (
        rectangle(comm, length=3.0, height=1.0, nx=4, ny=3, cell=cell)
        if plane
        else box(cell, (4, 2, 2), size=size, comm=comm)
    ).mesh
    tagged = tagged_ends(mesh, size)
    cells = mesh.topology.index_map(mesh.topology.dim)
    every = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    middle = dmesh.compute_midpoints(mesh, mesh.topology.dim, every)[:, 0]
    moved_inside(mesh, size, 0.15, twice=0)  # nothing in the middle
    tags = dmesh.meshtags(mesh, mesh.topology.dim, every, (1 + (middle > HALF)).astype(np.int32))
    return replace(tagged, cell_tags=tags, regions={"left": 1, "right": 2})


def columns(tagged, heat=0.0, left=LEFT, right=RIGHT, **more):
    """Both pressed down together onto a foundation without friction; in 3D between two planes."""
    dim = tagged.dimension
    sides = [("low0", "x", 0.0), ("high1", "y", -DOWN), ("low2", "z", 0.0), ("high2", "z", 0.0)][
        : 2 * dim - 2
    ]
    materials = [
        {"young": young, "poisson": poisson, "expansion": expansion, "region": name}
        for name, (young, poisson, expansion) in (("left", left), ("right", right))
    ]
    return parse_scene(
        {
            "mesh": tagged,
            "element": MIXED,
            "material": materials,
            "displacement": [{"boundary": side, axis: value} for side, axis, value in sides],
            "temperature": [{"change": heat, "region": name} for name in ("left", "right") if heat],
            "contact": {"boundary": "low1"},
            "solver": {"algorithm": "alm", **more},
        }
    )


class Column:
    """The uniform state of one of them: compressed by DOWN, sigma_xx = 0, epsilon_zz = 0."""

    def __init__(self, material, heat):
        young, nu, expansion = material
        e, self.young = expansion * heat, young
        self.sigma = young / (1 - nu**2) * (-DOWN - (1 + nu) * e)
        self.out = nu * self.sigma - young * e
        self.along = (nu * DOWN + (1 + nu) * e) / (1 - nu)
        self.pressure = young / (1 + nu) * self.along  # sigma_xx = 2 mu epsilon_xx - p
        elastic = -DOWN - e, -e
        self.density = (self.sigma * elastic[0] + self.out * elastic[1]) / 2


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("heat", [2.0, 0.0])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedra", "hexahedra"])
def test_two_columns(cell, heat):
    """Displacement, pressure, stress, energy and contact are those of each column, to round-off.

    Contact on quadratic tetrahedra has no pressure that jumps.
    """
    tagged, right = halves(cell), LIKE_LEFT if cell == "tetrahedra" else RIGHT
    solution = solve(columns(tagged, heat, right=right), MPI.COMM_WORLD)
    assert solution.converged
    assert solution.certificate.worst < 1e-9
    states, y = [Column(one, heat) for one in (LEFT, right)], solution.displacement
    at = solution.model.space.tabulate_dof_coordinates()[:, : tagged.dimension]
    exact = np.zeros_like(at)
    exact[:, 0] = states[0].along * np.minimum(at[:, 0], HALF) + states[1].along * np.maximum(
        at[:, 0] - HALF, 0
    )
    exact[:, 1] = -DOWN * at[:, 1]
    assert_allclose(y.x.array.reshape(at.shape), exact, rtol=0, atol=1e-10)
    raw, recovered = solution.stress.tensor, solution.stress.recovered.tensor
    for name, state in zip(("left", "right"), states, strict=True):
        cells = tagged.cells(name)
        pressure = y.hydrostatic.x.array[y.hydrostatic.function_space.dofmap.list[cells]]
        assert_allclose(pressure, state.pressure, rtol=1e-8)
        expected = np.diag([0, state.sigma, state.out])
        for tensor, accuracy in ((raw, 1e-9), (recovered, 1e-4)):
            values = tensors(tensor)[tensor.function_space.dofmap.list[cells]]
            assert_allclose(values, np.broadcast_to(expected, values.shape), atol=accuracy)
    contact = solution.contact
    x = contact.boundary.x[:, 0]
    for side, state in ((x < HALF - 1e-6, states[0]), (x > HALF + 1e-6, states[1])):
        assert_allclose(contact.pressure[side], -state.sigma, rtol=1e-7)
    assert contact.forces[0][1] == pytest.approx(
        -HALF * sum(state.sigma for state in states), rel=1e-9
    )
    energy = HALF * sum(state.density for state in states)
    assert solution.last_step.strain_energy == pytest.approx(energy, rel=1e-9)
    assert solution.stress.error < 1e-3


def test_enclosed():
    """Nothing determines the pressure of two incompressible materials together; a compressible one
    does.
    """
    tagged = halves("triangle", MPI.COMM_SELF)

    def held(poisson):
        return parse_scene(
            {
                "mesh": tagged,
                "element": MIXED,
                "material": [
                    {"young": 10.0, "poisson": 0.5, "region": "left"},
                    {"young": 4.0, "poisson": poisson, "region": "right"},
                ],
                "displacement": [
                    {"boundary": f"{end}{k}", "x": 0.0, "y": 0.0}
                    for end in ("low", "high")
                    for k in (0, 1)
                ],
                "body_force": {"x": 1.0},
            }
        )

    with pytest.raises(SceneError, match="the pressure is not determined"):
        alone(held(0.5))
    solution = alone(held(0.3))
    assert solution.converged
    assert solution.certificate.worst < 1e-9
