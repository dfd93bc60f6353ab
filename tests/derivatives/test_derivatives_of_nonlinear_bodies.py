"""Derivatives of results of nonlinear bodies, against central differences of solves, and by
translations.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate, vector_space
from scene_tables import (
    box_mesh,
    circle_shape,
    coulomb_friction,
    fixed,
    rectangle_mesh,
    tresca_friction,
)

from signorini_fx import (
    Coulomb,
    FormError,
    Foundation,
    NonlinearContactProblem,
    SceneError,
    Tresca,
    sensitivity,
)
from signorini_fx.scenes.reading import changed, parse_scene

COMM = MPI.COMM_WORLD
COULOMB = coulomb_friction(0.3)
STEP = 1e-4  # of differences, relative
# Moved and turned to and fro.
STEPS = {"load_steps": {"times": [0.5, 1.0, 1.5]}}
MOVED = {"shift": ["0.06*t*(2 - t)", "0.05*t"], "rotation": "0.2*t"}
TURNED = {"shift": ["0.06*t*(2 - t)", "0.05*t"], "rotation": "15*t", "pivot": [1.05, -0.45]}
MOVED_IN_SPACE = {
    "shift": ["0.06*t*(2 - t)", "0.02*t", "0.05*t"],
    "rotation": ["0.1*t", "0.05*t", "0.2*t"],
}


def rubber(friction=None, moved=None, algorithm="alm", **tables):
    """A block of rubber that hangs, pushed to one side, over a circle that is pressed into it."""
    foundation = circle_shape([1.05, -0.45], 0.5) | (moved or {})
    contact = {"boundary": "bottom", "gap": 0.0, "foundation": foundation}
    gamma = {"gamma_n": 1e5, "gamma_t": 1e5} if algorithm == "ssn" else {}
    return {
        "mesh": rectangle_mesh(12, 6, length=2.0, height=1.0),
        "material": [{"law": "neo-hooke", "young": 100.0, "poisson": 0.3}],
        "displacement": [fixed("top")],
        "traction": [{"boundary": "right", "x": 1.5}],
        "contact": [contact if friction is None else contact | {"friction": friction}],
        "solver": {"algorithm": algorithm, **gamma},
        **tables,
    }


def in_space(friction=None, moved=None, **tables):
    """The same in 3D, over a sphere."""
    scene = rubber(friction, moved, **tables)
    scene["mesh"] = box_mesh(5, 5, 2, length=2.0, width=2.0, height=1.0)
    scene["displacement"][0] |= {"z": 0.0}
    scene["contact"][0]["foundation"] |= {
        "shape": "sphere",
        "centre": [1.05, 0.98, -0.6],
        "radius": 0.7,
    }
    return scene


def held_beside(**held):
    """A rough circle under all of the block, whose side is pushed up to its corner."""
    foundation = {"centre": [1.0, -10.0], "radius": 10.0, "shift": ["0.03*t*(2 - t)", "0.1*t"]}
    scene = rubber(COULOMB, foundation, **STEPS)
    scene["displacement"].append(
        {"boundary": "left", "x": 0.02, "factors": [0.5, 1.0, 1.2], **held}
    )
    return scene


def of_revolution():
    """A disc of rubber over a ball, without and with steps."""
    scene = rubber(COULOMB, {"shift": [0.0, "0.05*t"]}, **STEPS)
    scene["material"][0]["hypothesis"] = "axisymmetric"
    scene["contact"][0]["foundation"] |= {"centre": [0.0, -1.95], "radius": 2.0}
    scene["displacement"].append(fixed("left", "x"))
    return scene


BOTH = ["traction[0].x", "material[0].young", "material[0].poisson", "contact[0].gap"]
PLACES = ["contact[0].foundation.centre[0]", "displacement[0].x", "displacement[0].y"]
HELD = ["displacement[1].x", "contact[0].gap"]
COEFFICIENT = ["contact[0].friction.coefficient"]
MOONEY = [{"law": "mooney-rivlin", "c10": 12.0, "c01": 5.0, "bulk": 100.0}]
SCENES = {
    "friction": (rubber(COULOMB), [*BOTH, *PLACES, *COEFFICIENT]),
    "friction without pressure": (
        rubber(tresca_friction(2.0)),
        [*BOTH, "contact[0].friction.bound"],
    ),
    "steps that turn": (rubber(COULOMB, TURNED, **STEPS), [BOTH[0], *COEFFICIENT]),
    "steps, regularised": (
        rubber(COULOMB, MOVED, "ssn", **STEPS),
        [*BOTH, PLACES[0], *COEFFICIENT],
    ),
    "of revolution": (of_revolution(), [*BOTH[1:], *COEFFICIENT]),
    "space": (in_space(COULOMB, MOVED_IN_SPACE, **STEPS), [*BOTH, PLACES[0], *COEFFICIENT]),
    "held beside contact in one step": (held_beside(holds=[False, True, False]), HELD),
    "another material": (rubber(COULOMB, material=MOONEY), ["material[0].c10", "material[0].bulk"]),
}

ON_RANKS = ("steps that turn", "space", "held beside contact in one step")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "by"),
    [
        pytest.param(*SCENES[name], id=name, marks=[pytest.mark.mpi] * (name in ON_RANKS))
        for name in SCENES
    ],
)
def test_differences_of_solves(scene, by):
    across = "z" if scene["mesh"]["generator"] == "box" else "y"
    of = ["force bottom x", f"force bottom {across}", "pressure bottom 8", "mean right x"]
    of += ["force bottom x step 2"] if "load_steps" in scene else []
    found = sensitivity(parse_scene(scene), of, by, COMM)
    for path in by:
        value = found[0].data[by.index(path)]
        step = STEP * (abs(value) or 1.0)
        ends = [
            [
                entry.value
                for entry in sensitivity(
                    parse_scene(changed(scene, {path: value + sign * step})), of, [], COMM
                )
            ]
            for sign in (1.0, -1.0)
        ]
        differences = (np.array(ends[0]) - ends[1]) / (2 * step)
        for entry, difference in zip(found, differences, strict=True):
            digits = 1e-9 * abs(entry.value) / step
            assert entry[path] == pytest.approx(difference, rel=3e-5, abs=digits), (entry.of, path)


DRIVEN = {"shape": "circle", "centre": [1.05, -0.45], "radius": 0.5, "force": [0.0, 1.0]}
REFUSED = {
    "state": (
        {"material": [{"law": "j2", "young": 100.0, "poisson": 0.3, "yield_stress": 5.0}]},
        "has a state",
    ),
    "tool": (
        {"contact[0].foundation": DRIVEN | {"prescribed": {"x": 0.0, "rotation": 0.0}}},
        r"contact\[0\].foundation: .* where a force moves it",
    ),
    "bodies": (
        {"contact[0]": {"boundary": "bottom", "against": "right"}},
        r"contact\[0\].against: .* where two nonlinear bodies touch",
    ),
    "data": ({}, r"material\[0\].isochoric: is no number"),
}


@pytest.mark.parametrize(("change", "why"), REFUSED.values(), ids=list(REFUSED))
def test_what_has_no_derivatives_is_refused_by_name(change, why):
    with pytest.raises(SceneError, match=why):
        sensitivity(
            parse_scene(changed(rubber(), change)), "force bottom y", ["material[0].isochoric"]
        )


# --- forms ----------------------------------------------------------------------------------------


class Pressed:
    """A block of rubber into which a circle, or in 3D a sphere, is pressed and moved."""

    def __init__(self, friction, dim=2, **settings):
        counts, size = ([12, 6], [2.0, 1.0]) if dim == 2 else ([5, 5, 2], [2.0, 2.0, 1.0])
        make, cell = (
            (dmesh.create_rectangle, dmesh.CellType.quadrilateral)
            if dim == 2
            else (dmesh.create_box, dmesh.CellType.hexahedron)
        )
        domain = make(COMM, [[0.0] * dim, size], counts, cell)
        V = vector_space(domain)
        self.u, self.dim = fem.Function(V), dim
        self.data = {
            name: fem.Constant(domain, value)
            for name, value in (("mu", 40.0), ("body", 2.0), ("gap", 0.01), ("friction", 0.3))
        }
        mu, body, self.gap = (self.data[name] for name in ("mu", "body", "gap"))
        gradient = ufl.Identity(dim) + ufl.grad(self.u)
        volume, dx = ufl.det(gradient), ufl.dx(metadata={"quadrature_degree": 2})
        energy = (
            mu / 2 * (ufl.inner(gradient, gradient) - dim)
            - mu * ufl.ln(volume)
            + 30 * ufl.ln(volume) ** 2
        )
        v = ufl.TestFunction(V)
        self.F = ufl.derivative(energy * dx, self.u, v) - body * v[0] * dx
        bottom, self.top = (
            dmesh.locate_entities_boundary(
                domain, dim - 1, lambda x, at=at: np.isclose(x[dim - 1], at)
            )
            for at in (0.0, 1.0)
        )
        self.fixed = fem.dirichletbc(
            np.zeros(dim), fem.locate_dofs_topological(V, dim - 1, bottom), V
        )
        side = dmesh.locate_entities_boundary(domain, dim - 1, at_coordinate(0, 0.0))
        across = fem.locate_dofs_topological(V.sub(0), dim - 1, side)
        self.data["pushed"] = fem.Constant(domain, 0.02)
        self.pushed = fem.dirichletbc(self.data["pushed"], across, V.sub(0))
        self.shape = (
            circle_shape((1.05, 1.5), 0.5)
            if dim == 2
            else {"shape": "sphere", "centre": (1.05, 0.98, 1.7), "radius": 0.7}
        )
        laws = {"coulomb": Coulomb, "tresca": Tresca}
        self.law = {} if friction is None else {"friction": laws[friction](self.data["friction"])}
        self.settings = {"algorithm": "alm"} | settings
        ds = ufl.Measure("ds", domain=domain)
        self.of = [self.u[0] ** 2 * ds + self.u[dim - 1] * ds, "force 0 x", "pressure 0 8"]

    def at(self, t):
        return (0.03 * t, *[0.0] * (self.dim - 2), -0.1 * t)

    def problem(self, **changes):
        contact = Foundation(self.top, shape=self.shape, gap=self.gap, **self.law)
        return NonlinearContactProblem(
            **(
                {"F": self.F, "u": self.u, "bcs": [self.fixed], "contact": contact}
                | self.settings
                | changes
            )
        )

    def solved(self, **changes):
        self.u.x.array[:] = 0.0
        problem = self.problem(**changes)
        problem.place(0, shift=self.at(1.0))
        problem.solve()
        return problem


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick(
    ("friction", "dim"), [(None, 2), ("coulomb", 2), ("tresca", 2), ("coulomb", 3)]
)
def test_constants_of_a_residual(friction, dim):
    pressed = Pressed(friction, dim)
    names = ["mu", "body", "gap"] + ([] if friction is None else ["friction"])
    by = [pressed.data[name] for name in names]
    problem = pressed.solved()
    found = [problem.gradient(of, by) for of in pressed.of]
    for column, constant in enumerate(by):
        ends, value = [], float(constant.value)
        for sign in (1.0, -1.0):
            constant.value = value + sign * STEP * value
            varied = pressed.solved()
            ends.append([varied.gradient(of, []).value for of in pressed.of])
        constant.value = value
        for gradient, ahead, behind in zip(found, *ends, strict=True):
            difference, digits = (
                (ahead - behind) / (2 * STEP * value),
                1e-9 * abs(gradient.value) / (STEP * value),
            )
            assert gradient.derivatives[column] == pytest.approx(difference, rel=3e-5, abs=digits)


def test_arguments_are_refused_by_name():
    pressed = Pressed(None)
    with pytest.raises(RuntimeError, match="no solution to differentiate"):
        pressed.problem().gradient(pressed.of[1], [])
    problem = pressed.solved()
    with pytest.raises(FormError, match="of: a moment at displaced points"):
        problem.gradient("moment 0 z", [])
    with pytest.raises(FormError, match=r"of: .* is no result"):
        problem.gradient("torque 0", [])
    other = 1.5 * ufl.derivative(pressed.F, pressed.u, ufl.TrialFunction(pressed.u.function_space))

    def follows():
        pressed.data["body"].value = 2.0 + 10.0 * np.abs(pressed.u.x.array).max()

    for changed_by, why in (
        ({"J": other}, "J: is not the derivative of F"),
        ({"update": follows}, "J: is needed"),
    ):
        wrong = pressed.solved(**changed_by, stability=False)
        with pytest.raises(FormError, match=why):
            wrong.gradient(pressed.of[1], [pressed.data["mu"]])
