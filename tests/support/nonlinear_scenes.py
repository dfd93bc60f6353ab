"""Scenes with nonlinear materials for the tests."""

import basix.ufl
import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate, turn_by
from parameters import slow
from scene_tables import box_mesh, circle_shape, coulomb_friction, fixed, rectangle_mesh

from signorini_fx.mechanics.mesh.tagged import tagged_mesh
from signorini_fx.scenes.reading import parse_scene

LAWS = {
    "neo-hooke": {"young": 100.0, "poisson": 0.3},
    "neo-hooke, isochoric": {"young": 100.0, "poisson": 0.3, "isochoric": True},
    "saint-venant-kirchhoff": {"young": 100.0, "poisson": 0.3},
    "mooney-rivlin": {"c10": 12.0, "c01": 7.0, "bulk": 80.0},
    "ogden": {"mu": [40.0, 2.0, -5.0], "alpha": [1.3, 4.0, -2.0], "bulk": 90.0},
    "j2": {"young": 100.0, "poisson": 0.3, "yield_stress": 1e3},
    "j2, finite": {"young": 100.0, "poisson": 0.3, "yield_stress": 1e3, "strains": "finite"},
}


def material(name, **further):
    """One of ``LAWS``, with other constants."""
    return {"law": name.partition(",")[0], **LAWS[name], **further}


def but_slow(names, *quick):
    """All names, of which a few are tried by `make test`."""
    return [name if name in quick else slow(name) for name in names]


def block(law, path, *, length=1.0, cells=(4, 4), unit=1.0, foundation=None, **further):
    """A block on rollers under a plate, whose way down is an expression of the time, or under
    another foundation.
    """
    plate = {
        "shape": "plane",
        "point": [0.0, unit],
        "normal": [0.0, -1.0],
        "shift": [0.0, f"-{unit} * ({path})"],
    }
    size = {"length": length * unit, "height": unit, "nx": cells[0], "ny": cells[1]}
    scene = {
        "mesh": rectangle_mesh(**size),
        "material": law,
        "displacement": [fixed("left", "x"), fixed("bottom", "y")],
        "contact": {"boundary": "top", "foundation": foundation or plate},
        "solver": {
            "algorithm": "alm"
        },  # so that closed forms hold without the penetration of a penalty
    }
    return parse_scene(scene | further)


def cube(law, *further_supports, cells=2, **further):
    """A cube of so many cells along each edge, on rollers."""
    size = {"length": 1.0, "width": 1.0, "height": 1.0, "nx": cells, "ny": cells, "nz": cells}
    rollers = [
        {"boundary": side, key: 0.0}
        for side, key in (("left", "x"), ("front", "y"), ("bottom", "z"))
    ]
    scene = {
        "mesh": box_mesh(**size),
        "material": law,
        "displacement": [*rollers, *further_supports],
    }
    return parse_scene(scene | further)


def pressed_cube(law, path, **further):
    """The same under a plate, whose way down is an expression of the time."""
    plate = {
        "shape": "plane",
        "point": [0.0, 0.0, 1.0],
        "normal": [0.0, 0.0, -1.0],
        "shift": [0.0, 0.0, f"-({path})"],
    }
    further = {
        "contact": {"boundary": "top", "foundation": plate},
        "solver": {"algorithm": "alm"},
    } | further
    return cube(law, **further)


def indented(law, *, depth=0.2, cells=(10, 5), unit=1.0, **further):
    """A clamped block, and a rough circle that is pressed into it up to time 1, and moved sideways
    up to time 2.
    """
    circle = circle_shape([0.8 * unit, 1.5 * unit], 0.5 * unit)
    circle["shift"] = [f"{unit} * max({depth / 2} * (t - 1), 0)", f"-{unit * depth} * min(t, 1)"]
    size = {"length": 2.0 * unit, "height": unit, "nx": cells[0], "ny": cells[1]}
    scene = {
        "mesh": rectangle_mesh(**size),
        "material": law,
        "displacement": fixed("bottom"),
        "contact": {"boundary": "top", "foundation": circle, "friction": coulomb_friction(0.3)},
        "load_steps": {"times": [1.0, 2.0]},
    }
    return parse_scene(scene | further)


def force(step):
    """What contact exerts on the body in a load step, of all ranks."""
    return np.sum(step.contact.forces, axis=0)


def quarter_of_disk(cells, comm=MPI.COMM_SELF):
    """A quarter of the unit disk in three blocks of quadrilaterals, with the boundaries left,
    bottom and arc.
    """
    a, b = np.meshgrid(*[np.linspace(0.0, 1.0, cells + 1)] * 2)
    corner = 0.5

    def outer(along, out):
        """From a side of the square to the arc."""
        side, angle = np.array([corner + 0 * along, corner * along]), np.pi / 4 * along
        return (1 - out) * side + out * turn_by(angle)[:, 0]

    points, corners = [], []
    for patch in (corner * np.array([a, b]), outer(b, a), outer(a, b)[::-1]):
        numbers = np.arange(a.size).reshape(a.shape) + len(points) * a.size
        points.append(patch.reshape(2, -1).T)
        corners.append(
            np.stack([numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, :-1], numbers[1:, 1:]], -1)
        )
    points, corners = np.concatenate(points), np.concatenate(corners).reshape(-1, 4)
    _, first, places = np.unique(
        np.round(points, 9), axis=0, return_index=True, return_inverse=True
    )
    element = basix.ufl.element("Lagrange", "quadrilateral", 1, shape=(2,))
    mesh = dmesh.create_mesh(
        comm, cells=places.ravel()[corners].astype(np.int64), x=points[first], e=element
    )

    def side(marker):
        return dmesh.locate_entities_boundary(mesh, 1, marker)

    names = {"left": side(at_coordinate(0, 0.0)), "bottom": side(at_coordinate(1, 0.0))}
    return tagged_mesh(mesh, names | {"arc": side(lambda x: np.isclose(np.hypot(x[0], x[1]), 1.0))})


def flattened_disk(law, cells, path, **load_steps):
    """A disk between two plates, the upper right quarter."""
    plate = {
        "shape": "plane",
        "point": [0.0, 1.0],
        "normal": [0.0, -1.0],
        "shift": [0.0, f"-({path})"],
    }
    scene = {
        "mesh": quarter_of_disk(cells),
        "material": law,
        "displacement": [fixed("left", "x"), fixed("bottom", "y")],
        "contact": {"boundary": "arc", "foundation": plate},
        "load_steps": load_steps,
    }
    return parse_scene(scene)


def energy_of_stretches(name):
    """The stored energy of a law as a function of three principal stretches, written from the
    literature.
    """
    constants = LAWS[name]
    if "young" in constants:
        mu = constants["young"] / 2 / (1 + constants["poisson"])
        lame = 2 * mu * constants["poisson"] / (1 - 2 * constants["poisson"])

    def energy(*stretches):
        along, volume = np.array(stretches), np.prod(stretches)
        same = along * volume ** (-1 / 3)
        if name == "neo-hooke":
            return (
                mu / 2 * np.sum(along**2 - 1) - mu * np.log(volume) + lame / 2 * np.log(volume) ** 2
            )
        if name == "neo-hooke, isochoric":
            return mu / 2 * np.sum(same**2 - 1) + (lame + 2 * mu / 3) / 2 * (volume - 1) ** 2
        if name == "j2, finite":
            bulk = lame + 2 * mu / 3
            return mu * np.sum(np.log(same) ** 2) + bulk / 2 * np.log(volume) ** 2
        if name == "saint-venant-kirchhoff":
            green = (along**2 - 1) / 2
            return mu * np.sum(green**2) + lame / 2 * np.sum(green) ** 2
        bulk = constants["bulk"] / 2 * (volume - 1) ** 2
        if name == "mooney-rivlin":
            return (
                constants["c10"] * (np.sum(same**2) - 3)
                + constants["c01"] * (np.sum(same**-2) - 3)
                + bulk
            )
        terms = zip(constants["mu"], constants["alpha"], strict=True)
        return sum(mu_p / alpha * (np.sum(same**alpha) - 3) for mu_p, alpha in terms) + bulk

    return energy


def grown_energy(name, expansion):
    """The energy of a bar that has expanded, of its stretches along and across."""
    energy, grown = energy_of_stretches(name), 1 + expansion
    return lambda along, across: grown**3 * energy(along / grown, across / grown, across / grown)


def slope(of, at, step=1e-5):
    """The derivative of a function of a number."""
    return (of(at + step) - of(at - step)) / (2 * step)
