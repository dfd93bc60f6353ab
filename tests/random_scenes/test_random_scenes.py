"""Random scenes, valid and invalid: an outcome with a name, or an error with a path; never a
traceback.
"""

import contextlib
import tomllib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from scene_tables import fixed, rectangle_mesh
from scenes import alone

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.records import Status
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.template import starting_scene

FEW = settings(
    max_examples=150, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)
SIDES = ("left", "right", "bottom", "top")


def numbers(*usual):
    """Ordinary values, and now and then those that make trouble."""
    return st.one_of(
        st.sampled_from(usual), st.sampled_from(usual), st.sampled_from((0.0, 1e-12, 1e12, -1.0))
    )


def tables(required, optional):
    """Tables with some of the optional keys."""
    return st.fixed_dictionaries(required, optional=optional)


# Few kinds of expressions: each makes a form that has to be compiled once.
values = st.one_of(
    numbers(0.0, 1.0, -20.0, 300.0),
    st.sampled_from(("-20 if 1 <= x[0] <= 2 else 0", "5*(x[0] - 1.5)")),
)
lengths = st.one_of(
    numbers(0.0, 1e-3, -1e-3), st.sampled_from(("0.003*(x[0] - 1.5)**2 + 0.001", "-1e-3*x[1]"))
)
sides = st.sampled_from(SIDES)
factors = st.sampled_from(([1.0], [0.5, 1.0], [0.5, 1.0], [1.0, -1.0], [0.0, 0.0]))
history = {"factors": factors}
frictions = st.one_of(
    st.just({"law": "none"}),
    tables({"law": st.just("tresca"), "bound": st.one_of(numbers(1.5, 10.0), st.just("x[0]"))}, {}),
    tables(
        {"law": st.just("coulomb"), "coefficient": numbers(0.3, 1.0, 5.0)}, {"cap": numbers(5.0)}
    ),
)
solvers = tables(
    {"max_iterations": st.sampled_from((1, 30)), "max_outer_iterations": st.sampled_from((1, 20))},
    {
        "algorithm": st.sampled_from(("ssn", "continuation", "path-following", "alm")),
        "coulomb": st.sampled_from(("fp", "newton")),
        "gamma_n": numbers(1e4, 1e8, "auto"),
        "gamma_t": numbers(1e4, 1e8, "auto"),
        "sigma": numbers(1.0, "auto"),
        "initial_contact": st.sampled_from(("all", "1 <= x[0] <= 2", "x[0] < 1", "x[0] < -1")),
        "inner_iterations": st.sampled_from((1, "auto")),
        "linear_algebra": st.sampled_from(("auto", "full", "krylov", "condensed")),
        "levels": st.sampled_from((1, 2)),
    },
)
meshes = st.fixed_dictionaries(
    {
        "generator": st.just("rectangle"),
        "parameters": st.fixed_dictionaries(
            {
                "length": st.just(3.0),
                "nx": st.sampled_from((1, 4)),
                "ny": st.sampled_from((1, 3)),
                "cell": st.sampled_from(("quadrilateral", "triangle")),
            }
        ),
    }
)
held = (
    [fixed("left")],
    [{"boundary": "top", "x": 0.0, "y": -0.01}],
    [fixed("left", "x"), fixed("right", "x")],
    [{"boundary": "left", "normal": 0.0}],
)
supports = st.lists(
    st.one_of(
        tables({"boundary": sides, "x": lengths}, {"y": lengths, **history}),
        tables({"boundary": sides, "normal": lengths}, history),
    ),
    max_size=3,
)
contacts = tables(
    {"boundary": st.one_of(st.just("bottom"), sides), "friction": frictions},
    {
        "gap": lengths,
        "kind": st.sampled_from(("unilateral", "unilateral", "bilateral")),
        "direction": st.sampled_from(([0.0, -1.0], [0.3, -1.0], [0.0, 1.0])),
    },
)
tractions = st.lists(
    tables({"boundary": sides, "y": values}, {"pressure": numbers(2.0), **history}), max_size=2
)
pressed = st.just([{"boundary": "top", "y": -20.0}])
materials = tables(
    {
        "young": st.sampled_from((5000.0, 5000.0, 1.0, 2.1e11)),
        "poisson": st.sampled_from((0.3, 0.3, 0.0, 0.49, 0.4999, -0.9)),
    },
    {"hypothesis": st.sampled_from(("plane strain", "plane stress"))},
)
scenes = tables(
    {
        "mesh": meshes,
        "material": materials,
        "displacement": st.one_of(st.sampled_from(held), st.sampled_from(held), supports),
        "traction": st.one_of(pressed, tractions),
        "contact": st.one_of(
            st.lists(contacts, min_size=1, max_size=1), st.lists(contacts, max_size=2)
        ),
    },
    {
        "element": tables(
            {},
            {"degree": st.sampled_from((1, 2)), "volumetric": st.sampled_from(("reduced", "auto"))},
        ),
        "body_force": tables({"y": numbers(-1.0)}, {"x": numbers(1.0), **history}),
        "solver": solvers,
    },
)


def attempt(function, *arguments):
    """The result and no problems, or no result and the problems; any other error goes through."""
    try:
        return function(*arguments), []
    except SceneError as error:
        problems = error.problems
    assert problems
    for path, message in problems:
        assert path.strip(), message
        assert len(message) > 5, path
    return None, problems


def ends_well(data):
    """A scene ends with a certificate, with another outcome that has a name, or with the paths of
    its mistakes.
    """
    scene, problems = attempt(parse_scene, data)
    if problems:
        return
    solution, problems = attempt(lambda: alone(scene, check=False))
    check, foreseen = attempt(check_scene, scene, MPI.COMM_SELF)
    assert foreseen == problems
    if problems:
        return
    assert isinstance(solution.status, Status)
    assert solution.converged == (solution.converged)
    if solution.converged:
        assert solution.certificate.holds
        assert len(solution.steps) == scene.statement.steps
    said = [finding.message for finding in check.warnings]
    if any("nothing holds the body" in message for message in said):
        assert solution.status is Status.NOT_HELD
    if any("no static equilibrium" in message for message in said):
        assert not solution.converged


@pytest.mark.slow
@settings(FEW)
@given(scenes)
def test_random_scenes(data):
    """Effects of all kinds, thrown together."""
    ends_well(data)


junk = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(max_size=5),
        st.sampled_from(
            ("auto", "x[0]", "1/0", "x[2]", "1e400", "__import__('os')", "exit()", "nan")
        ),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=4,
)
GOOD = tomllib.loads(starting_scene())


@settings(FEW, max_examples=30)
@given(
    st.dictionaries(
        st.sampled_from(("length", "height", "nx", "ny", "cell", "diagonal", "x")), junk, max_size=3
    )
)
def test_spoilt_meshes(parameters):
    """A generator refuses its parameters by their paths, or makes a mesh of them."""
    parameters = {"nx": 4, "ny": 3, **parameters}
    data = {**GOOD, "mesh": rectangle_mesh(**parameters)}
    scene, problems = attempt(parse_scene, data)
    if problems:
        return
    with contextlib.suppress(MeshError):
        attempt(lambda: alone(scene, check=False))


@pytest.mark.one_quick(("nx", "ny", "levels"), [(1, 1, 2), (1, 3, 2), (4, 4, 3), (1, 1, 12)])
@pytest.mark.parametrize("algorithm", ["ssn", "path-following"])
def test_meshes_that_get_no_coarser(nx, ny, levels, algorithm):
    """A mesh of one cell has no coarser one: the levels that there are count."""
    parameters = {"length": 3.0, "nx": nx, "ny": ny, "cell": "quadrilateral"}
    ends_well(
        {
            "mesh": rectangle_mesh(**parameters),
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [fixed("left")],
            "traction": [{"boundary": "top", "y": -20.0}],
            "contact": [{"boundary": "bottom", "friction": {"law": "none"}}],
            "solver": {"levels": levels, "algorithm": algorithm},
        }
    )
