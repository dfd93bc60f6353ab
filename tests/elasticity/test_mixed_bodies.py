"""The mixed element in contact of two bodies: exact states on meshes that do not match, friction,
and what encloses.
"""

from functools import partial

import numpy as np
import pytest
from mpi4py import MPI
from numpy.testing import assert_allclose
from scene_tables import coulomb_friction, fixed
from scenes import rectangle
from spaces import box
from two_cylinders import altered, in_balance, sticking_half_width

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
MIXED = {"degree": 2, "volumetric": "mixed"}
PLANE = ("triangle", "quadrilateral")
PRESSURE, FRICTION = 0.5, 0.3
RUBBER = (10.0, 0.5)


def block(cell, counts, unit=1.0):
    """A unit block of uneven cells; low0 is across x[0] = 0, high0 opposite."""
    plane = cell in PLANE
    mesh = (
        rectangle(COMM, length=1.0, height=1.0, nx=counts[0], ny=counts[1], cell=cell)
        if plane
        else box(cell, counts, size=(1.0, 1.0, 1.0), comm=COMM)
    ).mesh
    x, dim = mesh.geometry.x, mesh.topology.dim
    x[:, 0] += 0.1 * np.prod(np.sin(np.pi * x[:, :dim]), axis=1)
    x *= unit
    ends = {
        f"{name}{k}": (k, at) for k in range(dim) for name, at in (("low", 0.0), ("high", unit))
    }
    return tag_boundaries(
        mesh,
        {
            name: partial(lambda x, k, at: np.isclose(x[k], at, atol=1e-9 * unit), k=k, at=at)
            for name, (k, at) in ends.items()
        },
    )


def stacked(cell, below=RUBBER, above=RUBBER, unit=(1.0, 1.0), push=None, solver=None, **contact):
    """One block on another, pressed together; in 3D between two planes.  The second step pushes the
    upper one.
    """
    (length, force), plane = unit, cell in PLANE
    stress, counts = force / length**2, ((3, 2), (4, 2)) if plane else ((2, 1, 1), (1, 2, 1))
    names = ("below", "above")
    walls = [
        fixed(f"{name}.{side}2", "z") for name in names for side in ("low", "high") if not plane
    ]
    guided = ["below.low0"] if push else ["below.low0", "above.low0"]
    loads = [{"boundary": "above.high1", "y": -PRESSURE * stress}]
    if push:
        loads += [{"boundary": "above.low0", "x": push * stress, "factors": [0.0, 1.0]}]
    return parse_scene(
        {
            "body": [
                {
                    "name": name,
                    "mesh": block(cell, n, length),
                    "shift": [0.0, y * length] + [0.0] * (not plane),
                }
                for name, n, y in zip(names, counts, (-1, 0), strict=True)
            ],
            "element": MIXED,
            "material": [
                {"region": name, "young": young * stress, "poisson": poisson}
                for name, (young, poisson) in zip(names, (below, above), strict=True)
            ],
            "displacement": [fixed("below.low1", "y")]
            + [fixed(side, "x") for side in guided]
            + walls,
            "traction": loads,
            "contact": {"boundary": "above.low1", "against": "below.high1", **contact},
            "solver": {"algorithm": "alm", **(solver or {})},
        }
    )


def strains(young, poisson):
    """Along x and y under the pressure, where strains along z are prevented."""
    return PRESSURE / young * np.array([poisson * (1 + poisson), -(1 - poisson**2)])


KINDS = [
    ("triangle", "full"),
    ("quadrilateral", "condensed"),
    ("tetrahedra", "full"),
    ("hexahedra", "full"),
]


@pytest.mark.mpi
@pytest.mark.one_quick(("cell", "linear_algebra"), KINDS)
@pytest.mark.parametrize("contact", ["sliding", "bonded"])
def test_patch(cell, linear_algebra, contact):
    """The pressure passes from one to the other to round-off; each has its own strains and pressure
    inside.
    """
    joined = contact == "bonded"
    other = (
        (10.0 * 0.3 * 1.3 / 0.75, 0.3) if joined else (4.0, 0.3)
    )  # bonded, of the same strain along x
    solution = solve(
        stacked(
            cell,
            above=other,
            solver={"linear_algebra": linear_algebra},
            **({"kind": "bonded"} if joined else {}),
        ),
        COMM,
    )
    assert solution.converged
    assert solution.certificate.worst < 1e-9
    y, dim = solution.displacement, solution.model.tagged.dimension
    x = solution.model.space.tabulate_dof_coordinates()[:, :dim]
    found, (soft, stiff) = y.x.array.reshape(x.shape), (strains(*RUBBER), strains(*other))
    cells, tagged = y.hydrostatic.function_space.dofmap.list, solution.model.tagged
    nodes = solution.model.space.dofmap.list
    for name, strain, (young, poisson) in (("below", soft, RUBBER), ("above", stiff, other)):
        here = np.unique(nodes[tagged.cells(name)])
        exact = np.zeros((here.size, dim))
        exact[:, 0] = strain[0] * x[here, 0]
        exact[:, 1] = (
            soft[1] + strain[1] * x[here, 1] if name == "above" else soft[1] * (x[here, 1] + 1)
        )
        assert_allclose(found[here], exact, rtol=0, atol=1e-10)
        inside = y.hydrostatic.x.array[cells[tagged.cells(name)]]
        assert_allclose(inside, young / (1 + poisson) * strain[0], rtol=1e-8)  # sigma_xx = 0
    assert_allclose(solution.contact.pressure, PRESSURE, rtol=1e-8)
    assert np.abs(solution.contact.shear).max(initial=0.0) < 1e-9


@pytest.mark.mpi
@pytest.mark.one_quick("unit", [(1e-6, 1.0), (1e3, 1e-3)])
@pytest.mark.parametrize("linear_algebra", ["full", "condensed"])
def test_friction(unit, linear_algebra):
    """Incompressible blocks, pressed and then pushed over two load steps: forces of statics in any
    units.
    """
    push, (length, force) = 0.12, unit
    friction = coulomb_friction(FRICTION)
    solution = solve(
        stacked(
            "quadrilateral",
            unit=unit,
            push=push,
            friction=friction,
            solver={"linear_algebra": linear_algebra},
        ),
        COMM,
    )
    assert solution.converged
    assert all(step.certificate.worst < 1e-6 for step in solution.steps)
    for step, sideways in zip(solution.steps, (0.0, push), strict=True):
        found = solution.at(step)
        every = in_balance(found)
        assert every["below.high1"].force * length / force == pytest.approx(
            [sideways, -PRESSURE], abs=1e-7
        )
        bound = FRICTION * found.contact.pressure + 1e-6 * PRESSURE * force / length**2
        assert (np.abs(found.contact.shear).ravel() <= bound).all()


@pytest.mark.slow
def test_cattaneo_and_mindlin():
    """Cylinders of nu = 1/2, pressed and pushed: Hertz's pressure, and the half-width that sticks,
    to a node.
    """
    scene = altered()
    scene["element"] = MIXED
    scene["material"] = [
        {"region": name, "young": 200.0, "poisson": 0.5} for name in ("soft", "stiff")
    ]
    found = solve(parse_scene(scene))
    half, _, normal, _ = sticking_half_width(found, 0.5)
    peak = 2 * normal / (np.pi * half)
    assert found.contact.pressure.max() == pytest.approx(peak, rel=5e-3)
    in_balance(found)
