"""Patch tests: constant states of stress on any mesh at any angle, which every element must hold to
round-off (C.4).

The body is a rectangle on a flat foundation in its own frame X; the mesh is distorted, then turned
with all that acts on it, x = R X.  With regularisation the foundation gives way by p / gamma_1 and
t / gamma_2, which a constant state turns into a rigid motion that is known as well.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import turn_by
from scene_tables import coulomb_friction, fixed, tresca_friction
from scenes import alone

from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh, tag_boundaries
from signorini_fx.scenes.reading import parse_scene

LENGTH, HEIGHT = 1.5, 1.0
YOUNG, POISSON = 5000.0, 0.3
PRESSURE, SHEAR, GAP, GAMMA = 20.0, 4.0, 0.002, 1e6
ROUND_OFF = 1e-10
ELEMENTS = [("triangle", 1), ("quadrilateral", 1), ("triangle", 2), ("quadrilateral", 2)]
SIDES = ("left", "right", "left foot", "right foot")
NORMALS = {
    "bottom": (0.0, -1.0),
    "top": (0.0, 1.0),
    **{name: (-1.0 if "left" in name else 1.0, 0.0) for name in SIDES},
}


def patch_mesh(cell, angle, kind="distorted", interface=None):
    """6 x 4 facets, turned.  Distorted: vertices are moved by up to a fifth of a cell, those of the
    boundary along it.

    The lowest facets of the sides have names of their own, so that no node need be in contact with
    two foundations. Vertices at the height ``interface`` stay there, and the cells below and above
    it are the regions low and high.
    """
    layout = "unstructured" if kind == "unstructured" else "structured"
    parameters = {
        "length": LENGTH,
        "height": HEIGHT,
        "nx": 6,
        "ny": 4,
        "cell": cell,
        "layout": layout,
    }
    mesh = generate_mesh("block", parameters, MPI.COMM_SELF).mesh
    step = np.array([LENGTH / 6, HEIGHT / 4])

    def at(axis, value, low=0.0, high=HEIGHT):
        return lambda x: np.isclose(x[axis], value) & (low - 1e-9 <= x[1]) & (x[1] <= high + 1e-9)

    tagged = tag_boundaries(
        mesh,
        {
            "bottom": at(1, 0.0),
            "top": at(1, HEIGHT),
            "left": at(0, 0.0, low=step[1]),
            "right": at(0, LENGTH, low=step[1]),
            "left foot": at(0, 0.0, high=step[1]),
            "right foot": at(0, LENGTH, high=step[1]),
        },
    )
    if interface is not None:
        cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
        high = (dmesh.compute_midpoints(mesh, 2, cells)[:, 1] > interface).astype(np.int32)
        regions = dmesh.meshtags(mesh, 2, cells, high + 1)
        tagged = TaggedMesh(
            mesh, tagged.facet_tags, tagged.boundaries, regions, {"low": 1, "high": 2}
        )
    x = mesh.geometry.x
    moves = (
        0.2
        * step
        * np.random.default_rng(5).uniform(-1.0, 1.0, (len(x), 2))
        * (kind == "distorted")
    )
    moves[np.isclose(x[:, 0, None], [0.0, LENGTH]).any(axis=1), 0] = 0.0
    lines = [0.0, HEIGHT] if interface is None else [0.0, HEIGHT, interface]
    moves[np.isclose(x[:, 1, None], lines).any(axis=1), 1] = 0.0
    x[:, :2] = (x[:, :2] + moves) @ turn_by(angle).T
    return tagged


@dataclass(frozen=True)
class State:
    """Constant stress in the body's frame, and the displacement of its corner (0, 0)."""

    xx: float = 0.0
    yy: float = 0.0
    xy: float = 0.0
    corner: tuple[float, float] = (0.0, 0.0)
    hypothesis: str = "plane strain"

    @property
    def gradient(self):
        """Displacement gradient; horizontal lines stay horizontal."""
        strain = self.hypothesis == "plane strain"
        young = YOUNG / (1 - POISSON**2) if strain else YOUNG
        poisson = POISSON / (1 - POISSON) if strain else POISSON
        angle = self.xy * 2 * (1 + POISSON) / YOUNG
        return np.array(
            [
                [(self.xx - poisson * self.yy) / young, angle],
                [0.0, (self.yy - poisson * self.xx) / young],
            ]
        )

    def displacement(self, angle):
        """At points of the turned body, shape (3, n) to (2, n)."""
        turn = turn_by(angle)
        return lambda x: turn @ (self.gradient @ (turn.T @ x[:2]) + np.array(self.corner)[:, None])

    def tractions(self, angle, *names):
        """What acts on the named sides, in the turned body."""
        stress = np.array([[self.xx, self.xy], [self.xy, self.yy]])
        loads = {name: turn_by(angle) @ stress @ NORMALS[name] for name in names}
        return [{"boundary": name, "x": float(x), "y": float(y)} for name, (x, y) in loads.items()]

    def prescribed(self, angle, name):
        """The displacement of a side."""
        u = self.displacement(angle)
        return {"boundary": name, "x": lambda x: u(x)[0], "y": lambda x: u(x)[1]}


def bottom(**friction):
    return {"boundary": "bottom", "gap": GAP, "friction": friction or {"law": "none"}}


def symmetry(*names):
    """Planes that the sides stay on, at any angle."""
    return [{"boundary": name, "kind": "bilateral"} for name in names]


def run(tagged, degree, algorithm="alm", **scene):
    """Solve on that mesh."""
    data = {
        "mesh": tagged,
        "element": {"degree": degree},
        "material": {"young": YOUNG, "poisson": POISSON},
        "solver": {
            "algorithm": algorithm,
            "gamma_n": GAMMA,
            "gamma_t": 2 * GAMMA,
            "tolerance": 1e-12,
        },
    }
    for key, value in scene.items():
        data[key] = (
            data[key] | value
            if isinstance(data.get(key), dict) and isinstance(value, dict)
            else value
        )
    return alone(parse_scene(data))


def assert_displacement(solution, exact, tolerance=ROUND_OFF):
    expected = exact(solution.model.space.tabulate_dof_coordinates().T).T
    found = solution.displacement.x.array.reshape(-1, 2)
    assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())


def assert_contact(solution, pressure, shear=0.0, state="stick", part=0, tolerance=ROUND_OFF):
    """The same pressure, shear and state at all nodes of a contact boundary."""
    names = [effect.boundary for effect in solution.statement.contact]
    columns = contact_table(solution.contact, names).columns
    here = columns["boundary"] == names[part]
    assert_allclose(columns["pressure"][here], pressure, rtol=0, atol=tolerance * PRESSURE)
    assert_allclose(columns["shear"][here], shear, rtol=0, atol=tolerance * PRESSURE)
    assert set(columns["friction"][here]) == {state}


def assert_state(state, angle, tagged, degree, pressure, *contact, algorithm="alm", **scene):
    """The solution of a scene has this displacement, pressure, shear and state."""
    solution = run(tagged, degree, algorithm, **scene)
    assert_displacement(solution, state.displacement(angle))
    assert_contact(solution, pressure, *contact)
    return solution


def yielding(algorithm):
    """(1 / gamma_1, 1 / gamma_2): how far the foundation gives way under a unit stress."""
    return (1 / GAMMA, 0.5 / GAMMA) if algorithm == "ssn" else (0.0, 0.0)


PLACES = {
    "plain": (0.0, "structured"),
    "unstructured": (0.0, "unstructured"),
    "distorted": (0.0, "distorted"),
    "upright": (np.pi / 2, "distorted"),
    "inclined": (0.7, "distorted"),
}
# Each element in each place, by one or the other method: all pairs, not all products.
CASES = [
    (*element, ("alm", "ssn")[(k + n) % 2], *PLACES[place])
    for k, element in enumerate(ELEMENTS)
    for n, place in enumerate(PLACES)
]
everywhere = pytest.mark.parametrize(("cell", "degree", "algorithm", "angle", "kind"), CASES)
two_angles = pytest.mark.parametrize("angle", [0.0, 0.7])
each_element = pytest.mark.parametrize(("cell", "degree"), ELEMENTS)
each_limit = pytest.mark.parametrize("algorithm", ["alm", "ssn"])


@pytest.mark.one_quick
@everywhere
def test_pressed_with_free_sides(cell, degree, algorithm, angle, kind):
    """(a) The top pressed, frictionless, one side a plane of symmetry: lambda = p, the body widens
    freely.
    """
    give, _ = yielding(algorithm)
    state = State(yy=-PRESSURE, corner=(0.0, -GAP - give * PRESSURE))
    solution = assert_state(
        *(state, angle, patch_mesh(cell, angle, kind), degree, PRESSURE, 0.0, "none"),
        algorithm=algorithm,
        traction={"boundary": "top", "pressure": PRESSURE},
        contact=[bottom(), *symmetry("left")],
    )
    assert_contact(solution, 0.0, state="none", part=1)


@pytest.mark.one_quick
@everywhere
def test_pressed_with_fixed_sides(cell, degree, algorithm, angle, kind):
    """(b) The same between two frictionless walls, which give way to the regularised body by s /
    gamma_1 each.
    """
    give, _ = yielding(algorithm)
    side = POISSON * (1 + POISSON) * PRESSURE / (1 - POISSON**2 + 2 * give * YOUNG / LENGTH)
    state = State(xx=-side, yy=-PRESSURE, corner=(-give * side, -GAP - give * PRESSURE))
    solution = assert_state(
        *(state, angle, patch_mesh(cell, angle, kind), degree, PRESSURE, 0.0, "none"),
        algorithm=algorithm,
        traction=state.tractions(angle, "top", "left foot", "right foot"),
        contact=[bottom(), *symmetry("left", "right")],
    )
    for part in (1, 2):
        assert_contact(solution, side, state="none", part=part)


FRICTION = [tresca_friction(SHEAR), coulomb_friction(SHEAR / PRESSURE)]
COULOMB = FRICTION[1]
law_and_way = pytest.mark.parametrize(
    ("friction", "sign"), [(FRICTION[0], 1), (FRICTION[1], -1)], ids=["tresca", "coulomb"]
)
CONFINED = {
    "xx": -POISSON / (1 - POISSON) * PRESSURE,
    "yy": -PRESSURE,
}  # stress of a body that cannot widen


@pytest.mark.one_quick
@law_and_way
@everywhere
def test_full_stick(cell, degree, algorithm, angle, kind, friction, sign):
    """(c) Tractions of the constant state, |mu| at 0.9 of its bound: nothing but friction holds the
    body sideways.
    """
    give, give_way = yielding(algorithm)
    shear = 0.9 * sign * SHEAR
    state = State(**CONFINED, xy=shear, corner=(give_way * shear, -GAP - give * PRESSURE))
    assert_state(
        *(state, angle, patch_mesh(cell, angle, kind), degree, PRESSURE, shear),
        algorithm=algorithm,
        traction=state.tractions(angle, "top", *SIDES),
        contact=bottom(**friction),
    )


def sliding(sign, algorithm, shear=SHEAR):
    """(d) The whole bottom slips by 0.01."""
    return State(
        **CONFINED, xy=sign * shear, corner=(0.01 * sign, -GAP - yielding(algorithm)[0] * PRESSURE)
    )


def slide(state, angle, **contact):
    """What moves the body that far: the top is displaced, the sides are loaded."""
    return {
        "displacement": state.prescribed(angle, "top"),
        "traction": state.tractions(angle, *SIDES),
        "contact": bottom(**COULOMB) | contact,
    }


@pytest.mark.one_quick
@law_and_way
@everywhere
def test_full_slip(cell, degree, algorithm, angle, kind, friction, sign):
    """(d) The top moved so far that everything slips: mu = F p against the motion."""
    state = sliding(sign, algorithm)
    contact = (PRESSURE, sign * SHEAR, "slip+" if sign > 0 else "slip-")
    scene = slide(state, angle, friction=friction)
    tagged = patch_mesh(cell, angle, kind)
    assert_state(state, angle, tagged, degree, *contact, algorithm=algorithm, **scene)


# What an update leaves of the error here, 0.56 to 0.82, depends on the distorted mesh, which
# differs between releases of dolfinx: up to 130 updates for twelve digits.
@pytest.mark.one_quick(
    ("algorithm", "settings", "tolerance"),
    [
        ("alm", {"tolerance": 1e-12, "max_outer_iterations": 200}, 1e-9),
        ("path-following", {"regularisation_error": 1e-7, "tolerance": 1e-7}, 1e-6),
    ],
)
@each_element
def test_full_slip_in_the_limit(cell, degree, algorithm, settings, tolerance):
    """Augmented Lagrangian and path-following approach the unregularised state as far as they are
    told to.
    """
    state = sliding(1, "alm")
    solution = run(patch_mesh(cell, 0.7), degree, algorithm, solver=settings, **slide(state, 0.7))
    assert_displacement(solution, state.displacement(0.7), tolerance)
    assert_contact(solution, PRESSURE, SHEAR, "slip+", tolerance=100 * tolerance)


@pytest.mark.parametrize("cap", [0.6, 1.5])
@each_limit
def test_cap(algorithm, cap):
    """The shear of a Coulomb contact ends at its cap where that is below F p, and only there."""
    shear = SHEAR * min(cap, 1.0)
    state = sliding(-1, algorithm, shear)
    scene = slide(state, 0.7, friction=COULOMB | {"cap": cap * SHEAR})
    contact = (PRESSURE, -shear, "slip-")
    tagged = patch_mesh("quadrilateral", 0.7)
    assert_state(state, 0.7, tagged, 1, *contact, algorithm=algorithm, **scene)


@pytest.mark.one_quick
@each_element
@each_limit
@two_angles
def test_pulled(cell, degree, algorithm, angle):
    """Bilateral contact holds what pulls at it: lambda = -p, and friction acts with |lambda|."""
    give, _ = yielding(algorithm)
    state = State(-CONFINED["xx"], PRESSURE, SHEAR, corner=(0.01, -GAP + give * PRESSURE))
    solution = assert_state(
        *(state, angle, patch_mesh(cell, angle), degree, -PRESSURE, SHEAR, "slip+"),
        algorithm=algorithm,
        **slide(state, angle, kind="bilateral"),
    )
    assert solution.certificate.holds


@pytest.mark.one_quick
@each_element
@two_angles
def test_two_foundations(cell, degree, angle):
    """Coulomb friction below, Tresca friction at the right, sliding on both; they share the corner,
    and nothing else holds the body.
    """
    give, side = 1 / GAMMA, 1.5 * PRESSURE
    state = State(
        xx=-side, yy=-PRESSURE, xy=SHEAR, corner=(0.02 + give * side, -GAP - give * PRESSURE)
    )
    end = 0.02 + state.gradient[0, 0] * LENGTH
    turn = turn_by(angle)

    def wall(x):
        """The wall stands where the deformed side presses with ``side``."""
        return end + state.gradient[0, 1] * (turn.T @ x[:2])[1]

    right = {"gap": wall, "friction": FRICTION[0]}
    solution = run(
        patch_mesh(cell, angle),
        degree,
        "ssn",
        traction=state.tractions(angle, "top", "left", "left foot"),
        contact=[
            bottom(**COULOMB),
            {"boundary": "right", **right},
            {"boundary": "right foot", **right},
        ],
    )
    assert_displacement(solution, state.displacement(angle))
    assert_contact(solution, PRESSURE, SHEAR, "slip+")
    columns = contact_table(solution.contact, ["bottom", "right", "right foot"]).columns
    right = columns["boundary"] != "bottom"
    assert_allclose(columns["pressure"][right], side, rtol=0, atol=ROUND_OFF * PRESSURE)
    assert_allclose(columns["shear"][right], -SHEAR, rtol=0, atol=ROUND_OFF * PRESSURE)


LOW, HIGH = (
    {"young": 5000.0, "poisson": 0.3, "region": "low"},
    {"young": 800.0, "poisson": 0.1, "region": "high"},
)


def confined_modulus(material):
    """Stress over strain of a layer that cannot widen."""
    young, poisson = material["young"], material["poisson"]
    return young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))


@each_element
@pytest.mark.one_quick(("algorithm", "angle"), [("alm", 0.0), ("alm", 0.7), ("ssn", 0.0)])
def test_layers(cell, degree, algorithm, angle):
    """Two materials on top of each other between frictionless walls: springs in series.

    Walls that give way would do so differently for the two layers: no constant state, hence no ssn
    at an angle.
    """
    give, _ = yielding(algorithm)
    turn = turn_by(angle)
    scene = {"traction": [{"boundary": "top", "pressure": PRESSURE}], "contact": [bottom()]}
    if angle == 0.0:
        scene["displacement"] = [fixed(name, "x") for name in SIDES]
    else:
        scene["contact"] += symmetry("left", "right")
        scene["traction"] += State(xx=CONFINED["xx"]).tractions(angle, "left foot", "right foot")
    solution = run(
        patch_mesh(cell, angle, interface=0.5), degree, algorithm, material=[LOW, HIGH], **scene
    )

    def exact(x):
        height = (turn.T @ x[:2])[1]
        parts = (
            np.minimum(height, 0.5) / confined_modulus(LOW),
            np.maximum(height - 0.5, 0.0) / confined_modulus(HIGH),
        )
        return turn @ np.array([np.zeros_like(height), -GAP - PRESSURE * (give + sum(parts))])

    assert_displacement(solution, exact)
    assert_contact(solution, PRESSURE, state="none")


@pytest.mark.one_quick(("cell", "degree"), ELEMENTS[1:])
@two_angles
def test_reduced_volumetric_term(cell, degree, angle):
    """Reduced integration keeps constant states."""
    state = sliding(1, "alm")
    scene = slide(state, angle) | {"element": {"volumetric": "reduced"}}
    assert_state(state, angle, patch_mesh(cell, angle), degree, PRESSURE, SHEAR, "slip+", **scene)


def test_plane_stress():
    """The other hypothesis: u_y = -p y / E."""
    state = State(yy=-PRESSURE, corner=(0.0, -GAP), hypothesis="plane stress")
    assert_state(
        *(state, 0.7, patch_mesh("quadrilateral", 0.7), 1, PRESSURE, 0.0, "none"),
        material={"hypothesis": "plane stress"},
        traction=state.tractions(0.7, "top"),
        contact=[bottom(), *symmetry("left")],
    )


@each_element
def test_gravity(cell, degree):
    """A body force presses the block down by its weight; the displacement is quadratic, exact for
    degree 2.
    """
    weight = 12.0
    solution = run(
        patch_mesh(cell, 0.0),
        degree,
        displacement=[fixed(name, "x") for name in SIDES],
        body_force={"y": -weight},
        contact=bottom(),
    )
    contact, _ = solution.contact.forces
    assert_allclose(contact[1], weight * LENGTH * HEIGHT, rtol=ROUND_OFF)
    if degree == 2:
        stiffness = confined_modulus(LOW)
        assert_displacement(
            solution,
            lambda x: np.array(
                [0 * x[0], -GAP - weight * (HEIGHT * x[1] - x[1] ** 2 / 2) / stiffness]
            ),
        )
        assert_contact(solution, weight * HEIGHT, state="none")
