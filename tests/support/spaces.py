"""Bodies and scenes in 3D that several tests share, as plain functions."""

from __future__ import annotations

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate, turn_by
from scene_tables import fixed, tresca_friction
from scenes import rectangle

from signorini_fx.mechanics.contact_points import contact_boundary
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.scenes.reading import parse_scene

CELLS = {"hexahedra": dmesh.CellType.hexahedron, "tetrahedra": dmesh.CellType.tetrahedron}
LAWS = {"none": {}, "tresca": {"bound": 1.5}, "coulomb": {"coefficient": 0.3, "coulomb": "newton"}}


def box(cells, shape, *, size=(3.0, 1.0, 1.0), comm=MPI.COMM_SELF):
    """A box from the origin with boundaries left, right (across x[0]), front, back (x[1]), bottom,
    top (x[2]).
    """
    mesh = dmesh.create_box(comm, [(0.0, 0.0, 0.0), size], shape, CELLS[cells])
    near = 1e-9 * max(size)
    names = (("left", "right"), ("front", "back"), ("bottom", "top"))
    markers = {}
    for axis, pair in enumerate(names):
        for name, place in zip(pair, (0.0, size[axis]), strict=True):
            markers[name] = lambda x, axis=axis, place=place: np.abs(x[axis] - place) < near
    return tag_boundaries(mesh, markers)


def tagged_ends(mesh, size):
    """The mesh of a box with names for its sides: low0 is across x[0] = 0, high0 opposite."""
    ends = {
        f"{name}{k}": at_coordinate(k, at)
        for k, end in enumerate(size)
        for name, at in (("low", 0.0), ("high", end))
    }
    return tag_boundaries(mesh, ends)


def moved_inside(mesh, size, *ways, twice=None):
    """Move the nodes inside a block by these ways along the first axes, times a bump, which along
    the axis ``twice`` has two arcs.
    """
    x = mesh.geometry.x
    arcs = [np.sin((1 + (k == twice)) * np.pi * x[:, k] / end) for k, end in enumerate(size)]
    x[:, : len(ways)] += np.multiply.outer(np.prod(arcs, axis=0), ways)


def uneven(cell, comm=MPI.COMM_SELF, length=1.0):
    """A block of uneven cells, 3 by 1 (by 1)."""
    plane = cell not in CELLS
    size = (3.0, 1.0) if plane else (3.0, 1.0, 1.0)
    if plane:
        mesh = rectangle(comm, length=3.0, height=1.0, nx=4, ny=3, cell=cell).mesh
    else:
        mesh = box(cell, (3, 2, 2), size=size, comm=comm).mesh
    tagged = tagged_ends(mesh, size)
    moved_inside(mesh, size, 0.2, -0.1)
    mesh.geometry.x[:] *= length
    return tagged


def disc(cells="hexahedra", n=12, radius=1.0, height=0.5, layers=3):
    """A cylinder on its base around the origin: a box whose squares are blown up to circles."""
    mesh = dmesh.create_box(
        MPI.COMM_SELF, [(-1.0, -1.0, 0.0), (1.0, 1.0, height)], (n, n, layers), CELLS[cells]
    )
    x = mesh.geometry.x
    square = np.abs(x[:, :2]).max(axis=1)
    size = np.hypot(x[:, 0], x[:, 1])
    grown = 1.0 - square + square * np.divide(square, size, out=np.ones_like(size), where=size > 0)
    x[:, :2] *= radius * grown[:, None]
    return tag_boundaries(
        mesh,
        {"bottom": lambda x: np.abs(x[2]) < 1e-9, "top": lambda x: np.abs(x[2] - height) < 1e-9},
    )


def friction_of(bound=None, coefficient=None, **more):
    """The table of a friction law."""
    if bound is not None:
        return tresca_friction(bound)
    return (
        {"law": "none"}
        if coefficient is None
        else {"law": "coulomb", "coefficient": coefficient, **more}
    )


def block(
    nx=12,
    cells="hexahedra",
    *,
    bound=None,
    coefficient=None,
    gamma=1e6,
    comm=MPI.COMM_SELF,
    mesh=None,
    degree=1,
    **solver,
):
    """The block 3 x 1 x 1 over a paraboloid, pressed in the middle of its top and pulled along
    x[1].
    """
    return parse_scene(
        {
            "mesh": mesh or box(cells, (nx, nx // 3, nx // 3), comm=comm),
            "element": {"degree": degree},
            "material": {"young": 5000.0, "poisson": 0.4},
            "displacement": [fixed(name) for name in ("left", "right")],
            "traction": {
                "boundary": "top",
                "y": "4 if 1 <= x[0] <= 2 else 0",
                "z": "-20 if 1 <= x[0] <= 2 else 0",
            },
            "contact": {
                "boundary": "bottom",
                "gap": "0.003 * ((x[0] - 1.5)**2 + (x[1] - 0.5)**2) + 0.001",
                "friction": friction_of(bound, coefficient),
            },
            "solver": {"gamma_n": gamma, "gamma_t": gamma, "initial_contact": "all", **solver},
        }
    )


TANGENTS_OF = contact_boundary.tangents_of


def turned_tangents(normal, rng):
    """Tangents turned at random at every node."""
    angle = rng.uniform(0.0, 2 * np.pi, len(normal))
    turn = turn_by(angle)
    return np.einsum("nij,jkn->nik", TANGENTS_OF(normal), turn)


def rotation(angle, axis):
    """The matrix that turns by an angle about an axis."""
    a, b, c = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def brick(law, *, mesh=None, press=10.0, **effects):
    """A brick 2 x 2 x 1 on its foundation, pressed on, and held by nothing else."""
    return parse_scene(
        {
            "mesh": mesh or box("hexahedra", (6, 6, 3), size=(2.0, 2.0, 1.0)),
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "pressure": press},
            "contact": {"boundary": "bottom", "friction": friction_of(**law)},
            **effects,
        }
    )


def pushed_brick(comm, **effects):
    """A coarser one that friction alone holds, pushed obliquely."""
    mesh = box("hexahedra", (4, 4, 2), size=(2.0, 2.0, 1.0), comm=comm)
    return brick(
        {"coefficient": 0.3}, mesh=mesh, **({"body_force": {"x": 2.0, "y": 1.5}} | effects)
    )
