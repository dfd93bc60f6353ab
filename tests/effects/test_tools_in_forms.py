"""Foundations that forces move in ``ContactProblem``: the same as in scenes."""

import forms
import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from test_tools import block, pressed

from signorini_fx import ContactProblem, Coulomb, FormError, Foundation, Tresca, solve

COMM = MPI.COMM_WORLD
FRICTION = {"none": None, "tresca": Tresca(4.0), "coulomb": Coulomb(0.3)}


def same_as(solution, law, **others):
    """The problem of a scene of ``test_tools``, by forms."""
    d, scene = solution.model, solution.statement
    space = fem.functionspace(d.tagged.mesh, ("Lagrange", scene.element.degree, (d.dimension,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    bottom = np.unique(np.concatenate([d.tagged.facets(entry.boundary) for entry in scene.displacement]))
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
    settings = scene.solver.model_dump(include={"linear_algebra", "gamma_n", "gamma_t", "tolerance"})
    return ContactProblem(
        forms.hooke(u, v, material.young, material.poisson), nothing, bcs, foundations, algorithm=algorithm, **settings
    )


def differ(problem, result):
    """The largest difference to a load step of a scene, relative to the largest displacement, pressure or motion."""
    (tool,), (other,) = problem.tools, result.tools
    pairs = [
        (problem.u.x.array, result.displacement.x.array),
        *((getattr(problem.state, name), getattr(result.contact, name)) for name in ("pressure", "shear")),
        (np.append(tool.translation, tool.rotation), np.append(other.translation, other.rotation)),
    ]
    found = []
    for one, another in pairs:
        size = COMM.allreduce(float(np.abs(another).max(initial=0.0)), op=MPI.MAX)
        found.append(COMM.allreduce(float(np.abs(one - another).max(initial=0.0)), op=MPI.MAX) / (size or 1.0))
    return max(found)


def tilting(dimension, law):
    """What drives a tool that may turn; its pivot is above the surface, where a force across tilts it."""
    given = pressed(dimension, law)
    still = {"x": 0.0} if law == "none" else {}
    if dimension == 3:
        still |= {"rotation_z": 0.0} | ({"y": 0.0} if law == "none" else {})
    moment = 0.5 if dimension == 2 else [0.3, 0.2, 0.0]
    return {"force": given["force"], "moment": moment, "prescribed": still, "pivot": [0.4, 0.5, 0.6][:dimension]}


WAYS = [
    (2, "none", "full", {}),
    (2, "coulomb", "condensed", {}),
    (2, "tresca", "full", {"degree": 2, "cell": "triangle"}),
    (3, "coulomb", "krylov", {"cell": "tetrahedron"}),
]


@pytest.mark.one_quick
@pytest.mark.parametrize(("dimension", "law", "algebra", "element"), WAYS)
def test_forms_and_scenes_give_the_same(dimension, law, algebra, element):
    """Driven by force and moment, tilting; then by another force, without a new system."""
    given = tilting(dimension, law)
    solution = solve(block(dimension, law, algebra, **element, **given))
    problem = same_as(solution, law)
    problem.solve()
    close = 1e-7 if algebra == "krylov" else 1e-9
    assert np.abs(problem.tools[0].rotation).max() > 1e-5
    assert differ(problem, solution.last_step) < close
    assert problem.certificate.worst < 1e-7
    system, more = problem.assembled.task.system, [1.5 * one for one in given["force"]]
    problem.place(0, force=more)
    problem.solve()
    assert problem.assembled.task.system is system
    other = solve(block(dimension, law, algebra, **element, **{**given, "force": more}))
    assert differ(problem, other.last_step) < close


def test_steps_with_friction():
    """Pressed, then pulled: friction acts on the increment of the slip, as in load steps of a scene."""
    force = {"force": ["3 * max(0, t - 1)", "-20"], "prescribed": {"rotation": 0.0}}
    solution = solve(block(2, "coulomb", times=[1.0, 2.0, 3.0], **force))
    still = block(2, "coulomb", force=[0.0, -20.0], prescribed={"rotation": 0.0}).contact[0].foundation
    problem = same_as(solution, "coulomb", shape=still)
    for pull, step in zip((0.0, 3.0, 6.0), solution.steps, strict=True):
        problem.place(0, force=[pull, -20.0])
        problem.solve()
        assert differ(problem, step) < 1e-8
        problem.advance()


def test_a_bond_to_a_tool():
    """A column with a coupled top under a force and a moment: its mean strains are those of statics."""
    solution = solve(block(2, "none", prescribed={"x": 0.0, "y": -0.01, "rotation": 0.0}))
    tied = {"shape": "plane", "point": [0.0, 0.5], "normal": [0.0, -1.0], "pivot": [0.5, 0.5], "force": [0.0, 3.0]}
    problem = same_as(solution, "none", shape=tied, bonded=True)
    problem.solve()
    (tool,) = problem.tools
    assert tool.translation[1] > 0.0
    assert abs(tool.translation[0]) + abs(tool.rotation[0]) < 1e-7 * tool.translation[1]
    contact = problem.state
    pull = COMM.allreduce(contact.boundary.nodal_forces(contact.pressure, contact.shear).sum(axis=0))
    assert np.allclose(pull, [0.0, -3.0], atol=1e-8)


MISTAKES = [
    ({"bonded": True, "shape": None}, r"contact\[0\].bonded: needs a shape"),
    ({"shape": "timed"}, r"contact\[0\].shape: depends on t"),
    ({"measure": 1.0}, r"contact\[0\].measure: is not possible yet"),
]


@pytest.mark.parametrize(("others", "words"), MISTAKES)
def test_mistakes(others, words):
    solution = solve(block(2, "none", prescribed={"x": 0.0, "y": -0.01, "rotation": 0.0}))
    if others.get("shape") == "timed":
        others = {"shape": block(2, "none", prescribed={"y": "t"}).contact[0].foundation}
    with pytest.raises(FormError, match=words):
        same_as(solution, "none", **others)
    if "measure" in others:
        problem = same_as(solution, "none")
        with pytest.raises(FormError, match="shift: stays"):
            problem.place(0, shift=[0.0, 1.0])
        problem.solve()
        with pytest.raises(RuntimeError, match="those of scenes"):
            problem.gradient("force 0 y", [])
