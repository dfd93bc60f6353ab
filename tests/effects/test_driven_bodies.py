"""Foundations that forces move, in scenes and forms: as prescribed motions, statics by hand, named
outcomes.
"""

import forms
import numpy as np
import pytest
import ufl
from boxes import Box, boxes_mesh
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate, trial_and_test
from scene_tables import coulomb_friction, fixed, rectangle_mesh, tresca_friction

from signorini_fx import (
    ContactProblem,
    ConvergenceError,
    Coulomb,
    FormError,
    Foundation,
    SceneError,
    Tresca,
    solve,
)
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
LAWS = {"none": {"law": "none"}, "tresca": tresca_friction(4.0), "coulomb": coulomb_friction(0.3)}


def block(
    dimension=2,
    law="none",
    algebra="full",
    *,
    degree=1,
    cell=None,
    parts=(5, 5, 3),
    unit=(1.0, 1.0),
    times=None,
    solver=None,
    accuracy=None,
    **tool,
):
    """A block on the ground, and a circle or a ball above it that is pressed down; ``unit``: of
    length and force.
    """
    length, force = unit
    stress = force / length**2  # in 2D forces are per thickness
    plane = dimension == 2
    mesh = {
        "generator": "rectangle" if plane else "box",
        "parameters": {
            "length": length,
            "height": length / 2,
            "nx": 12,
            "ny": 6,
            "cell": cell or "quadrilateral",
        }
        if plane
        else {
            "length": length,
            "height": length / 2,
            "width": length,
            **dict(zip(("nx", "ny", "nz"), parts, strict=True)),
            "cell": cell or "hexahedron",
        },
    }
    centre = [0.45 * length, 2.5 * length] if plane else [0.45 * length, 0.5 * length, 2.5 * length]
    friction = dict(LAWS[law])
    if "bound" in friction:
        friction["bound"] *= stress
    ground = dict.fromkeys("xyz"[:dimension], 0.0)
    return parse_scene(
        {
            "mesh": mesh,
            "element": {"degree": degree},
            "material": {"young": 1000.0 * stress, "poisson": 0.3},
            "displacement": {"boundary": "bottom", **ground},
            "contact": {
                "boundary": "top",
                "foundation": {
                    "shape": "circle" if plane else "sphere",
                    "centre": centre,
                    "radius": 2.0 * length,
                    "pivot": centre,
                    **tool,
                },
                "friction": friction,
            },
            "solver": {
                "linear_algebra": algebra,
                "gamma_n": 1e6 * stress / length,
                "gamma_t": 1e6 * stress / length,
                "tolerance": 1e-12,
                **(solver or {}),
            },
            **({} if times is None else {"load_steps": {"times": times}}),
            **({} if accuracy is None else {"accuracy": accuracy}),
        }
    )


NO_TURN = {"rotation_x": 0.0, "rotation_y": 0.0, "rotation_z": 0.0}


def pressed(dimension, law, unit=(1.0, 1.0)):
    """What drives the tool; without friction it may not move sideways."""
    length, force = unit
    per = force / length if dimension == 2 else force
    given = [value * per for value in ([1.0, -20.0] if dimension == 2 else [1.0, 0.5, -20.0])]
    still = {"rotation": 0.0} if dimension == 2 else dict(NO_TURN)
    if law == "none":
        still |= dict.fromkeys("xy"[: dimension - 1], 0.0)
    return {"force": given, "prescribed": still}


def prescribed(tool):
    """The motion of a rigid body as one that is prescribed."""
    names = ("x", "y", "rotation") if tool.reference.size == 2 else ("x", "y", "z", *NO_TURN)
    values = np.append(tool.translation, tool.rotation)
    return {"prescribed": dict(zip(names, map(float, values), strict=True))}


def largest_difference(pairs):
    """The largest one over the ranks, of each pair relative to the largest of its second values."""
    found = []
    for pair in pairs:
        one, other = map(np.asarray, pair)
        sizes = [np.abs(values).max(initial=0.0) for values in (one - other, other)]
        difference, size = (COMM.allreduce(float(value), op=MPI.MAX) for value in sizes)
        found.append(difference / (size or 1.0))
    return max(found)


def apart(one, other):
    """The largest difference of two solutions, relative to the largest displacement or pressure."""
    names = ("pressure", "shear", "u_n", "u_t")
    pairs = [(getattr(other.contact, name), getattr(one.contact, name)) for name in names]
    return largest_difference([(other.displacement.x.array, one.displacement.x.array), *pairs])


WAYS = [
    (2, "none", "full", {}),
    (2, "tresca", "condensed", {}),
    (2, "coulomb", "full", {"degree": 2, "cell": "triangle"}),
    (2, "coulomb", "condensed", {}),
    (3, "coulomb", "condensed", {}),
    (3, "tresca", "full", {"degree": 2, "cell": "tetrahedron"}),
]


@pytest.mark.one_quick(("dimension", "law", "algebra", "element"), WAYS)
def test_a_force_and_the_motion_that_it_causes_give_the_same(dimension, law, algebra, element):
    forced = solve(block(dimension, law, algebra, **element, **pressed(dimension, law)))
    (tool,) = forced.last_step.rigid_bodies
    row = tool.as_dict(forced.contact, forced.statement.contact, forced.model.kinematics)
    given = np.array(pressed(dimension, law)["force"])
    free = np.arange(dimension) if law != "none" else [dimension - 1]
    assert np.abs(np.array(row["force"]) + given)[free].max() < 1e-9 * np.abs(given).max()
    assert forced.contact.in_contact.any() or COMM.size > 1
    driven = solve(block(dimension, law, algebra, **element, **prescribed(tool)))
    assert apart(forced, driven) < 1e-10 + 10 * (
        forced.certificate.worst + driven.certificate.worst
    )
    if law != "coulomb":  # whose fixed point contracts faster where the motion is prescribed
        assert forced.history.linear_solves <= 1.2 * driven.history.linear_solves + 1
    assert forced.certificate.worst < 1e-9


def test_multigrid_moves_the_nodes_that_a_tool_holds():
    """On the finer of two nested meshes, as on the coarser one: a Krylov method ends, and nothing
    is factorised.
    """
    solution = solve(
        block(
            3, "coulomb", "krylov", parts=(4, 4, 2), solver={"levels": 2}, **pressed(3, "coulomb")
        )
    )
    assert solution.linear_algebra.startswith("krylov")
    assert "linear solver failed: the matrix is factorised" not in solution.history.events


@pytest.mark.one_quick(
    ("dimension", "algebra", "poisson"),
    [(2, "condensed", 0.49), (2, "full", 0.5), (3, "full", 0.5)],
)
def test_an_incompressible_body_under_a_tool(dimension, algebra, poisson):
    """The mixed element, whose pressure stands behind the unknowns of the tool: force, statics and
    motion agree.
    """

    def made(**tool):
        cell = {2: "triangle", 3: "tetrahedron"}[dimension]
        scene = block(dimension, "coulomb", algebra, degree=2, cell=cell, parts=(3, 3, 2), **tool)
        rubber = scene.material[0].model_copy(update={"poisson": poisson})
        element = scene.element.model_copy(update={"volumetric": "mixed"})
        return scene.model_copy(update={"material": (rubber,), "element": element})

    given = pressed(dimension, "coulomb")
    forced = solve(made(**given))
    (tool,) = forced.last_step.rigid_bodies
    row = tool.as_dict(forced.contact, forced.statement.contact, forced.model.kinematics)
    assert np.allclose(row["force"], -np.array(given["force"]), atol=1e-9 * 20.0)
    assert forced.certificate.worst < 1e-9
    driven = solve(made(**prescribed(tool)))
    assert apart(forced, driven) < 1e-10
    hydrostatic = [one.displacement.hydrostatic.x.array for one in (forced, driven)]
    assert np.abs(hydrostatic[0] - hydrostatic[1]).max(initial=0.0) < 1e-8 * np.abs(
        hydrostatic[1]
    ).max(initial=1e-300)


def posts(apart_by=10.0, width=0.1, height=1.0):
    """Two columns with one contact boundary, their tops."""
    both = [
        Box("1", -width / 2, 0.0, width, height, 4, 6),
        Box("2", apart_by - width / 2, 0.0, width, height, 4, 6),
    ]
    mesh = boxes_mesh(COMM, both).mesh
    return tag_boundaries(
        mesh, {"tops": at_coordinate(1, height), "bottoms": at_coordinate(1, 0.0)}
    )


def on_posts(force=(0.0, -3.0), at=2.5, law=None, algebra="full", **solver):
    """A plate on two columns without Poisson's effect, under a force beside its middle."""
    tool = {
        "shape": "plane",
        "point": [0.0, 1.0],
        "normal": [0.0, -1.0],
        "pivot": [at, 1.0],
        "force": list(force),
    }
    return parse_scene(
        {
            "mesh": posts(),
            "material": {"young": 1e5, "poisson": 0.0},
            "displacement": fixed("bottoms"),
            "contact": {"boundary": "tops", "foundation": tool, "friction": law or LAWS["coulomb"]},
            "solver": {"linear_algebra": algebra, **solver},
        }
    )


@pytest.mark.parametrize("algebra", ["full", "condensed"])
def test_a_plate_on_two_posts_tilts_as_statics_says(algebra):
    """The posts take 3/4 and 1/4 of the force, sink by N H / (E A) each, and the plate turns by the
    difference.
    """
    solution = solve(on_posts(algebra=algebra))
    x, pressure, weight = (
        solution.contact.boundary.x,
        solution.contact.pressure,
        solution.contact.boundary.weight,
    )
    taken = [
        COMM.allreduce(float((weight * pressure)[half].sum()))
        for half in (x[:, 0] < 5, x[:, 0] > 5)
    ]
    assert np.allclose(taken, [2.25, 0.75], rtol=1e-4)
    (tool,) = solution.last_step.rigid_bodies
    sunk = np.array(taken) / (1e5 * 0.1)
    # The force follows no motion: it stays where it is given.
    assert np.isclose(tool.rotation[0], (sunk[0] - sunk[1]) / 10.0, rtol=1e-3)
    assert np.isclose(tool.translation[1], -(0.75 * sunk[0] + 0.25 * sunk[1]), rtol=1e-3)
    assert solution.friction_used is not None


OUTCOMES = [
    ((1.0, -3.0), 2.5, LAWS["coulomb"], Status.SLIDES),  # more than 0.3 * 3
    ((0.0, -3.0), 10.2, LAWS["coulomb"], Status.TIPS),  # beside the last post
    ((0.0, 3.0), 2.5, LAWS["coulomb"], Status.OPEN),
    ((0.0, -3.0), 2.5, LAWS["none"], Status.NOT_HELD),
]


@pytest.mark.parametrize(("force", "at", "law", "status"), OUTCOMES)
def test_a_tool_that_nothing_holds_ends_with_its_name(force, at, law, status):
    with pytest.raises(ConvergenceError) as raised:
        solve(on_posts(force, at, law))
    assert raised.value.solution.status is status
    assert raised.value.solution.history.linear_solves == 0


def test_a_force_just_below_the_limit_of_friction_is_held():
    assert solve(on_posts((0.89, -3.0))).converged


def three_posts():
    """Three columns of hexahedra, cut out of a box, and the positions of their axes."""
    mesh = dmesh.create_box(
        COMM, [(0.0, 0.0, 0.0), (2.1, 2.1, 0.5)], (21, 21, 2), dmesh.CellType.hexahedron
    )
    axes = np.array([[0.15, 0.25], [1.95, 0.45], [0.65, 1.95]])
    middle = dmesh.compute_midpoints(
        mesh, 3, np.arange(mesh.topology.index_map(3).size_local, dtype=np.int32)
    )
    near = (np.abs(middle[:, None, :2] - axes).max(axis=2) < 0.06).any(axis=1)
    columns = dmesh.create_submesh(mesh, 3, np.flatnonzero(near).astype(np.int32))[0]
    tops = {"tops": at_coordinate(2, 0.5), "bottoms": at_coordinate(2, 0.0)}
    return tag_boundaries(columns, tops), axes


@pytest.mark.parametrize("pivot", [(0.8, 0.7), (0.2, 1.5)])
def test_a_plate_on_three_posts_tilts_as_statics_says(pivot):
    """In 3D: three unknown forces from a force and two moments, and the plane through what sinks;
    the same with the force at another point, and its moment.
    """
    mesh, axes = three_posts()
    at, force = np.array([0.8, 0.7]), 2.0
    moment = np.cross([*(at - pivot), 0.0], [0.0, 0.0, -force])
    tool = {
        "shape": "plane",
        "point": [0.0, 0.0, 0.5],
        "normal": [0.0, 0.0, -1.0],
        "pivot": [*pivot, 0.5],
    }
    if moment.any():
        tool["moment"] = moment.tolist()
    scene = parse_scene(
        {
            "mesh": mesh,
            "material": {"young": 1e5, "poisson": 0.0},
            "displacement": fixed("bottoms", "xyz"),
            "contact": {
                "boundary": "tops",
                "foundation": {**tool, "force": [0.0, 0.0, -force]},
                "friction": LAWS["coulomb"],
            },
        }
    )
    solution = solve(scene)
    wanted = np.linalg.solve(np.vstack((np.ones(3), axes.T)), force * np.array([1.0, *at]))
    boundary, pressure = solution.contact.boundary, solution.contact.pressure
    of = np.abs(boundary.x[:, None, :2] - axes).max(axis=2).argmin(axis=1)
    taken = COMM.allreduce(np.bincount(of, boundary.weight * pressure, minlength=3))
    assert np.allclose(taken, wanted, rtol=5e-3)
    (motion,) = solution.last_step.rigid_bodies
    sunk = wanted * 0.5 / (1e5 * 0.01)
    assert np.allclose(motion.at(np.column_stack((axes, np.full(3, 0.5))))[:, 2], -sunk, rtol=5e-3)


def test_load_steps_with_friction():
    """A tool that is pressed and then pulled by functions of the time, and the same by prescribed
    motions.
    """
    force = {"force": ["3 * max(0, t - 1)", "-20"], "prescribed": {"rotation": 0.0}}
    forced = solve(block(2, "coulomb", times=[1.0, 2.0, 3.0], **force))
    assert [step.status for step in forced.steps] == [Status.CONVERGED] * 3
    names = ("x", "y", "rotation")
    motion = [
        np.append(step.rigid_bodies[0].translation, step.rigid_bodies[0].rotation)
        for step in forced.steps
    ]

    def through(values):
        a, b, c = map(float, values)  # the parabola through them at t = 1, 2, 3
        return (
            f"{a!r} * (t - 2) * (t - 3) / 2 - {b!r} * (t - 1) * (t - 3) + {c!r} * (t - 1) * (t "
            "- 2) / 2"
        )

    given = {name: through([one[k] for one in motion]) for k, name in enumerate(names)}
    driven = solve(block(2, "coulomb", times=[1.0, 2.0, 3.0], prescribed=given))
    assert apart(forced, driven) < 1e-9
    assert all(step.certificate.holds for step in forced.steps)


REFUSED = [
    ({"moment": [0.0, 0.0, 1.0]}, "moment: the mesh is plane"),
    ({"force": [0.0, 0.0, 1.0]}, "force: the mesh is plane"),
    ({"prescribed": {"z": 0.0}}, "prescribed.z"),
    ({"force": [0.0, "x[0]"]}, "number or an expression of the time t"),
    ({"force": [0.0, -1.0], "shift": ["0.1 * t", 0.0]}, "choose one of both"),
    ({"force": [0.0, -1.0], "pivot": None}, "pivot: give the point where the force acts"),
]


@pytest.mark.parametrize(("entry", "words"), REFUSED)
def test_bad_input_is_one_error(entry, words):
    with pytest.raises(SceneError, match=words):
        solve(block(**entry))


@pytest.mark.parametrize("algebra", ["full", "condensed"])
def test_rigid_coupling_bends_a_column_as_a_beam(algebra):
    """Force and moment through the top of a column without Poisson's effect: u_y = (N / A + M x /
    I) y / E is exact.
    """
    young, half, height, push, pull = 1000.0, 0.5, 4.0, -3.0, 0.2
    tool = {
        "shape": "plane",
        "point": [0.0, 7.0],
        "normal": [1.0, -1.0],
        "pivot": [half, height],
        "force": [0.0, push],
    }
    mesh = {"length": 2 * half, "height": height, "nx": 2, "ny": 4}
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(**mesh),
            "element": {"degree": 2},
            "material": {"young": young, "poisson": 0.0},
            "displacement": fixed("bottom"),
            "contact": {
                "boundary": "top",
                "kind": "bonded",
                "foundation": {**tool, "moment": pull},
            },
            "solver": {"linear_algebra": algebra, "algorithm": "alm", "tolerance": 1e-9},
        }
    )
    solution = solve(scene)
    (moved,) = solution.last_step.rigid_bodies
    turned = -pull * height / (young * (2 * half) ** 3 / 12)
    row = moved.as_dict(solution.contact, scene.contact, solution.model.kinematics)
    # What the body does to the rigid body balances what drives it.
    assert np.allclose([*row["force"], row["moment"]], [0.0, -push, -pull], atol=1e-9)
    assert row["gap_error"] is None  # there is no gap
    assert np.isclose(moved.rotation[0], -turned, rtol=1e-8)
    assert np.allclose(moved.translation, [height / 2 * turned, push * height / young], rtol=1e-8)
    x = solution.contact.boundary.x
    relative = np.column_stack((solution.contact.u_n, solution.contact.u_t))
    assert np.abs(relative).max(initial=0.0) < 1e-10 * np.abs(moved.at(x)).max(initial=1.0)
    assert solution.certificate.worst < 1e-8


# --- forms ----------------------------------------------------------------------------------------

FRICTION = {"none": None, "tresca": Tresca(4.0), "coulomb": Coulomb(0.3)}


def same_as(solution, law, **others):
    """The problem of a scene, by forms."""
    d, scene = solution.model, solution.statement
    space = fem.functionspace(d.tagged.mesh, ("Lagrange", scene.element.degree, (d.dimension,)))
    u, v = trial_and_test(space)
    bottom = np.unique(
        np.concatenate([d.tagged.facets(entry.boundary) for entry in scene.displacement])
    )
    held = fem.locate_dofs_topological(space, d.dimension - 1, bottom)
    bcs = [fem.dirichletbc(np.zeros(d.dimension), held, space)]
    nothing = ufl.inner(fem.Constant(d.tagged.mesh, np.zeros(d.dimension)), v) * ufl.dx
    shape, algorithm = others.pop("shape", ...), others.pop("algorithm", "auto")
    foundations = [
        Foundation(
            d.tagged.facets(contact.boundary),
            shape=contact.foundation if shape is ... else shape,
            friction=FRICTION[law],
            **others,
        )
        for contact in scene.contact
    ]
    (material,) = scene.material
    settings = scene.solver.model_dump(
        include={"linear_algebra", "gamma_n", "gamma_t", "tolerance"}
    )
    return ContactProblem(
        forms.hooke(u, v, material.young, material.poisson),
        nothing,
        bcs,
        foundations,
        algorithm=algorithm,
        **settings,
    )


def differ(problem, result):
    """The largest difference to a load step of a scene, relative to the largest displacement,
    pressure or motion.
    """
    motions = [
        np.append(t.translation, t.rotation) for (t,) in (problem.rigid_bodies, result.rigid_bodies)
    ]
    names = ("pressure", "shear")
    pairs = [(getattr(problem.state, name), getattr(result.contact, name)) for name in names]
    return largest_difference([(problem.u.x.array, result.displacement.x.array), *pairs, motions])


def tilting(dimension, law):
    """What drives a tool that may turn; its pivot is above the surface, where a force across tilts
    it.
    """
    given = pressed(dimension, law)
    still = {"x": 0.0} if law == "none" else {}
    if dimension == 3:
        still |= {"rotation_z": 0.0} | ({"y": 0.0} if law == "none" else {})
    moment = 0.5 if dimension == 2 else [0.3, 0.2, 0.0]
    return {
        "force": given["force"],
        "moment": moment,
        "prescribed": still,
        "pivot": [0.4, 0.5, 0.6][:dimension],
    }


WAYS_OF_FORMS = [
    (2, "none", "full", {}),
    (2, "coulomb", "condensed", {}),
    (2, "tresca", "full", {"degree": 2, "cell": "triangle"}),
    (3, "coulomb", "krylov", {"cell": "tetrahedron"}),
]


@pytest.mark.one_quick(("dimension", "law", "algebra", "element"), WAYS_OF_FORMS)
def test_forms_and_scenes_give_the_same(dimension, law, algebra, element):
    """Driven by force and moment, tilting; then by another force, without a new system."""
    given = tilting(dimension, law)
    solution = solve(block(dimension, law, algebra, **element, **given))
    problem = same_as(solution, law)
    problem.solve()
    close = 1e-7 if algebra == "krylov" else 1e-9
    assert np.abs(problem.rigid_bodies[0].rotation).max() > 1e-5
    assert differ(problem, solution.last_step) < close
    assert problem.certificate.worst < 1e-7
    system, more = problem.assembled.task.system, [1.5 * one for one in given["force"]]
    problem.place(0, force=more)
    problem.solve()
    assert problem.assembled.task.system is system
    other = solve(block(dimension, law, algebra, **element, **{**given, "force": more}))
    assert differ(problem, other.last_step) < close


MISTAKES_OF_FORMS = [
    ({"kind": "bonded", "shape": None}, r"contact\[0\].kind: 'bonded' needs a shape"),
    ({"shape": "timed"}, r"contact\[0\].shape: depends on t"),
    ({"measure": 1.0}, r"contact\[0\].measure: is not possible yet"),
]


@pytest.mark.parametrize(("others", "words"), MISTAKES_OF_FORMS)
def test_mistakes_of_forms(others, words):
    solution = solve(block(2, "none", prescribed={"x": 0.0, "y": -0.01, "rotation": 0.0}))
    if others.get("shape") == "timed":
        others = {"shape": block(2, "none", prescribed={"y": "t"}).contact[0].foundation}
    with pytest.raises(FormError, match=words):
        same_as(solution, "none", **others)
    if "measure" in others:
        problem = same_as(solution, "none")
        with pytest.raises(FormError, match="shift: cannot be changed"):
            problem.place(0, shift=[0.0, 1.0])
        problem.solve()
        with pytest.raises(FormError, match="forces move a foundation"):
            problem.gradient("force 0 y", [])
