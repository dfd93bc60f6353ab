"""A bolt between two sleeves that is tightened and pulled."""

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.results.contact_figures import section_forces
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD


CELLS = {
    "triangle": dmesh.CellType.triangle,
    "quadrilateral": dmesh.CellType.quadrilateral,
    "tetrahedron": dmesh.CellType.tetrahedron,
    "hexahedron": dmesh.CellType.hexahedron,
}


YOUNG, HEIGHT, SHANK, SLEEVES, TIGHT, PULL = 1000.0, 4.0, 1.0, 2.0, 20.0, 6.0


BOLT, SLEEVE = YOUNG * SHANK / HEIGHT, YOUNG * SLEEVES / HEIGHT  # stiffnesses; the thickness is 1


MORE = BOLT / (BOLT + SLEEVE)  # the share of an external load that the bolt takes


def bodies(cell, length):
    """A shank with a head, and a sleeve with the same height, both standing at x[1] = 0."""
    plane = cell in ("triangle", "quadrilateral")
    make, deep = (dmesh.create_rectangle, []) if plane else (dmesh.create_box, [length])

    def block(low, high, parts):
        corners = [
            np.array([*(length * np.array(low)), *(0.0 for _ in deep)]),
            [*(length * np.array(high)), *deep],
        ]
        return make(COMM, corners, (*parts, *(2 for _ in deep)), CELLS[cell])

    whole = block((-2.0, 0.0), (2.0, 5.0), (8, 10))
    dim = whole.topology.dim
    middle = dmesh.compute_midpoints(
        whole, dim, np.arange(whole.topology.index_map(dim).size_local, dtype=np.int32)
    )
    kept = (np.abs(middle[:, 0]) < 0.5 * length) | (middle[:, 1] > HEIGHT * length)
    bolt = dmesh.create_submesh(whole, dim, np.flatnonzero(kept).astype(np.int32))[0]
    foot = {"foot": lambda x: np.isclose(x[1], 0.0, atol=1e-9 * length)}
    under = {"under": lambda x: np.isclose(x[1], HEIGHT * length) & (np.abs(x[0]) > 0.49 * length)}
    top = {"top": at_coordinate(1, HEIGHT * length)}
    over = {"over": at_coordinate(1, 5.0 * length)}
    return tag_boundaries(bolt, foot | under | over), tag_boundaries(
        block((0.0, 0.0), (1.0, HEIGHT), (3, 4)), foot | top
    )


def clamped(
    cell="quadrilateral",
    *,
    degree=1,
    unit=(1.0, 1.0),
    solver=None,
    friction=None,
    gap=0.0,
    poisson=0.0,
    stiff=1.0,
    more=None,
    expansion=0.0,
    **preload,
):
    """A bolt between two sleeves, all of which stand on the ground; in the second step its head is
    pulled; ``stiff``: by how much the head is stiffer than the rest.
    """
    (length, force), plane = unit, cell in ("triangle", "quadrilateral")
    stress = force / length**2
    axes, (bolt, sleeve) = "xy" if plane else "xyz", bodies(cell, length)
    still, at = dict.fromkeys(axes, 0.0), [0.0] * (len(axes) - 2)
    section = {"region": "bolt", "point": [0.0, 1.8 * length, *at], "axis": [0.0, -3.0, *at]}
    soft = {"young": YOUNG * stress, "poisson": poisson, "expansion": expansion}
    head = soft
    if stiff != 1.0:
        head = soft | {
            "young": stiff * soft["young"],
            "grading": f"{1 / stiff} if x[1] < {HEIGHT * length} else 1",
        }
    under = {"against": "bolt.under", "gap": gap * length, "friction": friction or {"law": "none"}}
    return parse_scene(
        {
            "body": [
                {"name": "bolt", "mesh": bolt},
                {"name": "left", "mesh": sleeve, "shift": [-2.0 * length, 0.0, *at]},
                {"name": "right", "mesh": sleeve, "shift": [1.0 * length, 0.0, *at]},
            ],
            "element": {"degree": degree},
            "material": [
                {"region": "bolt", **head},
                {"region": "left", **soft},
                {"region": "right", **soft},
            ],
            "displacement": [
                {"boundary": name, **still} for name in ("bolt.foot", "left.foot", "right.foot")
            ],
            "force": {"boundary": "over", "y": PULL * force, "factors": [0.0, 1.0]},
            "contact": [{"boundary": f"{side}.top", **under} for side in ("left", "right")],
            "preload": {**section, **(preload or {"force": TIGHT * force})},
            "solver": {
                "gamma_n": 1e7 * stress / length,
                "gamma_t": 1e7 * stress / length,
                **(solver or {}),
            },
            **(more or {}),
        }
    )


def figures(solution, step, unit=(1.0, 1.0)):
    """Bolt force, clamp force and shortening of a load step, in units of force and length."""
    result = solution.steps[step]
    (section,) = section_forces(solution.model, result.displacement, result.place)
    clamp = np.linalg.norm(result.contact.forces[0])
    return section.force / unit[1], clamp / unit[1], section.shortening / unit[0]
