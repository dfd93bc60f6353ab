"""Which features go together: each pair is drawn into a small scene, and is refused in the words
that it declares.
"""

from functools import cache
from itertools import combinations

import declared_refusals as refusals
import pytest
from mpi4py import MPI
from scene_tables import box_mesh, coulomb_friction, fixed, floor, rectangle_mesh

from signorini_fx import SceneError, sensitivity
from signorini_fx.mechanics.statement.features import features
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_SELF
GRID = {"nx": 4, "ny": 4, "length": 2.0, "height": 1.0}
BASE = {
    "mesh": rectangle_mesh(**GRID),
    "material": {"young": 1000.0, "poisson": 0.3},
    "displacement": [{"boundary": "top", "x": 0.0, "y": -0.001}],
    "contact": {"boundary": "bottom", "friction": coulomb_friction(0.3)},
}
PLANE = floor()
ORTHOTROPIC = {"young": [1000.0, 900.0, 800.0], "poisson": [0.3] * 3, "shear": [300.0] * 3}
SECTION = {"point": [1.0, 0.37], "axis": [0.0, 1.0]}
TRIANGLES = {"mesh": {"parameters": {"cell": "triangle"}}}
TURNED = {"hypothesis": "axisymmetric"}
# What makes the block one with a feature; several of them are merged.
WITH = {
    "plane stress": {"material": {"hypothesis": "plane stress"}},
    "axisymmetric": {"material": TURNED},
    "axisymmetric, torsion": {"material": TURNED | {"torsion": True}},
    "heat": {
        "heat": [{"boundary": "top", "temperature": 1.0}],
        "material": {"conductivity": 1.0},
    },
    "inertia": {
        "inertia": {"time_step": 0.1},
        "material": {"density": 1.0},
        "load_steps": {"times": [0.0, 1.0]},
    },
    "mixed element": {"element": {"degree": 2, "volumetric": "mixed"}},
    "reduced integration": {"element": {"volumetric": "reduced"}},
    "krylov": {"solver": {"linear_algebra": "krylov"}},
    "nested iteration": {"solver": {"levels": 2}},
    "requested accuracy": {"accuracy": {"target": 0.3}},
    "accuracy of the energy": {"accuracy": {"target": 0.3, "of": "energy"}},
    "accuracy of the zone or the peak": {"accuracy": {"target": 0.3, "of": "peak"}},
    "accuracy of contact on cells that lock": {
        "accuracy": {"target": 0.3, "of": "pressure"},
        "material": {"poisson": 0.49},
    },
    "local refinement": TRIANGLES | {"accuracy": {"target": 0.3, "refinement": "adaptive"}},
    "local refinement for contact": TRIANGLES
    | {"accuracy": {"target": 0.3, "refinement": "adaptive", "of": "pressure"}},
    "several bodies": {"body": ["upper"]},
    "two bodies": {"body": ["upper", "lower"]},
    "contact of two bodies": {"body": ["upper", "lower"], "contact": {"against": "lower.top"}},
    "mesh that no generator makes": {"mesh": "tagged"},
    "driven foundation": {"contact": {"foundation": PLANE | {"force": [0.0, 1.0], "pivot": [0.0, 0.0]}}},
    "moving foundation": {
        "contact": {"foundation": PLANE | {"shift": [0.0, "1e-4*t"]}},
        "load_steps": {"times": [0.0, 1.0]},
    },
    "foundation with a shape": {"contact": {"foundation": PLANE}},
    "friction axes": {"contact": {"friction": {"ratio": 2.0, "along": [1.0, 0.0, 0.0]}}},
    "contact in time": {"contact": {"friction": {"coefficient": "0.3*t"}}, "load_steps": {"times": [1.0, 2.0]}},
    "contact that cannot open": {"contact": {"kind": "bilateral"}},
    "anisotropic material": {"material": {"orthotropic": ORTHOTROPIC, "young": None, "poisson": None}},
    "graded material": {"material": {"grading": "1 - 0.1*x[1]"}},
    "initial strain": {"material": {"expansion": 1e-5}, "temperature": {"change": 1.0}},
    "shortening by force": {"preload": [SECTION | {"force": 1e-3}]},
    "preload": {"preload": [SECTION | {"shortening": 1e-4}]},
    "several load steps": {"displacement": [BASE["displacement"][0] | {"factors": [0.5, 1.0]}]},
    "load in time": {"traction": [{"boundary": "left", "y": "-0.1*t"}]},
    "support of a point": {"displacement": [*BASE["displacement"], {"at": [0.0, 0.5], "x": 0.0}]},
    "prescribed rotation": {"displacement": [{"boundary": "top", "rotation": 1e-4}]},
    "springs": {"springs": [{"boundary": "right", "x": 1.0}]},
    "point force": {"point_force": [{"at": [0.0, 0.5], "y": -1.0}]},
    "soft contact": {"contact": {"overclosure": {"stiffness": 1e3}}},
    "cohesion": {"contact": {"cohesion": {"strength": 1.0, "energy": 0.1}}},
    "wear": {"contact": {"wear": {"coefficient": 1e-9, "distance": "t"}}},
    "seeping": {"contact": {"seeping": {"pressure": 1.0, "side": "left"}}},
    "gravity": {"gravity": {"y": -1.0}, "material": {"density": 1e-3}},
    "nonlinear material": {"material": {"law": "neo-hooke"}},
}  # fmt: skip
# What only something that is computed refuses: with other features it is as another of ``WITH``.
FOR_COMPUTED = {"material with a state": {"material": {"law": "j2", "yield_stress": 1e3}}}


def merged(data, more):
    """Tables key by key."""
    if not (isinstance(data, dict) and isinstance(more, dict)):
        return more
    return {**data, **{key: merged(data.get(key), value) for key, value in more.items()}}


def leaves(data, path=()):
    """Paths of what is not a table, with the values."""
    for key, value in data.items():
        yield from (
            leaves(value, (*path, key)) if isinstance(value, dict) else [((*path, key), value)]
        )


@cache
def tagged():
    """The mesh of the block, as one that no generator makes."""
    return load_mesh(parse_scene(BASE), COMM)


def scene_of(*names):
    """The data of a scene with features."""
    data = BASE
    for name in names:
        data = merged(data, (WITH | FOR_COMPUTED)[name])
    if "mesh that no generator makes" in names:
        data = data | {"mesh": tagged()}
    contact = {key: value for key, value in data["contact"].items() if value is not None}
    material = {key: value for key, value in data["material"].items() if value is not None}
    bodies = data.get("body")
    data = {key: value for key, value in data.items() if key != "body"} | {
        "material": material,
        "contact": contact,
    }
    return of_bodies(data, bodies) if bodies else data


def of_bodies(data, bodies):
    """The same with bodies, the first of which has the boundaries of the block."""
    data = {key: renamed(value) for key, value in data.items()}
    mesh = data.pop("mesh")
    data["body"] = [
        {"name": name, "mesh": mesh, "shift": [0.0, -float(k)]} for k, name in enumerate(bodies)
    ]
    if len(bodies) > 1:
        data["displacement"] = [*data["displacement"], fixed("lower.bottom")]
    return data


def renamed(entry):
    """With the boundaries of the first body."""
    if isinstance(entry, list):
        return [renamed(item) for item in entry]
    if not isinstance(entry, dict):
        return f"upper.{entry}" if entry == "bottom" else entry
    return {
        key: f"upper.{value}" if key == "boundary" else renamed(value) if key != "mesh" else value
        for key, value in entry.items()
    }


@cache
def used(name):
    """The features of a scene with one of them, which may bring others."""
    return frozenset(feature for feature, _ in features(parse_scene(scene_of(name)).statement)) | {
        name
    }


@cache
def declared():
    """The reasons of all pairs within scenes."""
    return {
        (one, other): why for one, refused in refusals.declared() for other, why in refused.items()
    }


def refused(names):
    """The words in which a scene with these features is refused; none: it is not."""
    try:
        parse_scene(scene_of(*names))
    except SceneError as error:
        return {why for _, reasons in error.problems for why in reasons.split("; or: ")}
    return set()


def compatible(one, other):
    """Whether both can be asked for at once: they give no key two values, and contact has one
    partner.
    """
    first, second = dict(leaves(WITH[one])), dict(leaves(WITH[other]))
    if any(first[key] != second[key] for key in first.keys() & second.keys()):
        return False
    partners = {("contact", "foundation"), ("contact", "against")}
    return len(partners & {path[:2] for path in (*first, *second)}) < 2


# A foundation is driven or moved, a body with torsion turns about its axis
# alone, one material is of one kind, and the mesh has quadrilaterals, which are not divided one by
# one.
ONE_OF_BOTH = {
    ("contact that cannot open", "soft contact"),
    ("contact that cannot open", "cohesion"),
    ("moving foundation", "cohesion"),
    ("contact that cannot open", "wear"),
    ("contact that cannot open", "seeping"),
    ("local refinement", "mesh that no generator makes"),
    ("driven foundation", "moving foundation"),
    ("axisymmetric, torsion", "prescribed rotation"),
    *((kind, "nonlinear material") for kind in ("anisotropic material", "graded material")),
}
PAIRS = [pair for pair in combinations(WITH, 2) if compatible(*pair) and pair not in ONE_OF_BOTH]


def test_pairs():
    """Each is refused in the words of the declaration, and every other one is accepted."""
    entered = set()
    for pair in PAIRS:
        both = frozenset().union(*map(used, pair))
        expected = {key: why for key, why in declared().items() if both.issuperset(key)}
        assert refused(pair) == set(expected.values()), pair
        entered |= expected.keys()
    # What is computed of a solution, or depends on the values of a key.
    within = {pair for pair in declared() if set(pair) <= WITH.keys()}
    assert within - entered == set()
    assert len(entered) >= 12


def message_of(function):
    """Of one that refuses a scene."""

    def message(scene):
        try:
            function(scene)
        except SceneError as error:
            return str(error)

    return message


COMPUTED = {
    "derivatives": message_of(lambda scene: sensitivity(scene, "force bottom y", [], comm=COMM))
}
SPACE = {
    "mesh": box_mesh(2, 2, 2, cell="tetrahedron"),
    "displacement": {"boundary": "top", "z": -0.001},
}


@pytest.mark.parametrize(
    ("what", "name"),
    [(what, name) for what, refuses in refusals.COMPUTED.items() for name in refuses],
)
def test_what_is_computed(what, name):
    """It says so of a scene with this feature, in the words that it declares."""
    data = scene_of(name)
    if name == "friction axes":
        data = {
            key: value
            for key, value in data.items()
            if key not in BASE or key in ("material", "contact")
        } | SPACE
    assert refusals.COMPUTED[what][name] in COMPUTED[what](parse_scene(data))
