"""Preload of bolts against springs in series and in parallel, by force and by shortening, in 2D and
in 3D.
"""

import numpy as np
import pytest
from bolts import BOLT, COMM, MORE, PULL, SLEEVE, TIGHT, YOUNG, clamped, figures
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed, rectangle_mesh

from signorini_fx import SceneError, solve
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

WAYS = [
    ("quadrilateral", 1, {"linear_algebra": "full"}, (1.0, 1.0)),
    ("triangle", 2, {"linear_algebra": "condensed"}, (1e-3, 1e6)),
    ("quadrilateral", 2, {"linear_algebra": "condensed", "algorithm": "alm"}, (1.0, 1.0)),
    ("hexahedron", 1, {"linear_algebra": "krylov"}, (1.0, 1.0)),
    ("tetrahedron", 1, {"linear_algebra": "full"}, (1.0, 1e-6)),
]


@pytest.mark.one_quick(("cell", "degree", "solver", "unit"), WAYS)
def test_statics(cell, degree, solver, unit):
    """Tightened, locked and pulled: the bolt takes its preload, and then what clamps the sleeves
    and what pulls.
    """
    solution = solve(clamped(cell, degree=degree, solver=solver, unit=unit, poisson=0.3))
    assert solution.converged
    exact = 1e-7 if solver["linear_algebra"] == "krylov" else 1e-9
    bolt, clamp, shortening = figures(solution, 0, unit)
    assert abs(bolt - TIGHT) < 1e-9 * TIGHT
    assert abs(clamp - TIGHT) < exact * TIGHT
    bolt, clamp, kept = figures(solution, 1, unit)
    assert kept == shortening
    assert bolt > TIGHT
    assert abs(bolt - clamp - PULL) < exact * TIGHT
    assert all(step.certificate.worst < 1e-7 for step in solution.steps)


@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron"])
def test_springs(cell):
    """Under a stiff head bolt and sleeves are springs: in series when tightened, in parallel when
    pulled.
    """
    solution = solve(clamped(cell, stiff=1e6, solver={"linear_algebra": "full"}))
    bolt, clamp, shortening = figures(solution, 0)
    assert np.isclose(shortening, TIGHT / BOLT + TIGHT / SLEEVE, rtol=1e-4)
    bolt, clamp, _ = figures(solution, 1)
    assert np.isclose(bolt, TIGHT + MORE * PULL, rtol=1e-4)
    assert np.isclose(clamp, TIGHT - (1 - MORE) * PULL, rtol=1e-4)


def test_force_and_the_shortening_that_it_causes_give_the_same():
    forced = solve(clamped(poisson=0.3, degree=2, friction=FRICTION, gap=0.01))
    _, _, shortening = figures(forced, 0)
    given = solve(
        clamped(poisson=0.3, degree=2, friction=FRICTION, gap=0.01, shortening=shortening)
    )
    for one, other in zip(forced.steps, given.steps, strict=True):
        far, off = (
            np.abs(one.displacement.x.array),
            np.abs(one.displacement.x.array - other.displacement.x.array),
        )
        assert COMM.allreduce(off.max(initial=0.0), op=MPI.MAX) < 1e-6 * COMM.allreduce(
            far.max(initial=0.0), op=MPI.MAX
        )
        assert np.isclose(one.strain_energy, other.strain_energy, rtol=1e-6)


FRICTION = coulomb_friction(0.2)


def bar(cell, degree=1, *, preload=None, volumetric="full", heat=0.0, **more):
    """A bar of length 3 and section 1, held at both ends without Poisson's effect."""
    plane = cell in ("triangle", "quadrilateral")
    size = (
        {"length": 3.0, "height": 1.0, "nx": 7, "ny": 2}
        if plane
        else {"length": 3.0, "nx": 7, "ny": 2, "nz": 2}
    )
    at = [1.37, *([0.0] * (1 if plane else 2))]
    axis = [1.0, *([0.0] * (1 if plane else 2))]
    law = {"hypothesis": "plane stress"} if plane else {}
    given = {"point": at, "axis": axis, "shortening": 0.03}
    slides = [
        {"boundary": "bottom", "xyz"[len(axis) - 1]: 0.0},
        *([] if plane else [fixed("front", "y")]),
    ]
    return parse_scene(
        {
            "mesh": {
                "generator": "rectangle" if plane else "box",
                "parameters": {**size, "cell": cell},
            },
            "element": {"degree": degree, "volumetric": volumetric},
            "material": {"young": YOUNG, "poisson": 0.0, "expansion": 1e-3, **law},
            "displacement": [*(fixed(name, "x") for name in ("left", "right")), *slides],
            "preload": preload or given,
            **({"temperature": {"change": heat}} if heat else {}),
            **more,
        }
    )


@pytest.mark.one_quick("heat", [4.0, 0.0])
@pytest.mark.parametrize(
    ("cell", "degree"), [("quadrilateral", 2), ("quadrilateral", 1), ("tetrahedron", 2)]
)
def test_a_clamped_bar_has_one_stress_everywhere(cell, degree, heat):
    """Also in the cells beside the section, whose own displacement is not that of their nodes; heat
    lets it go.
    """
    solution = solve(bar(cell, degree, heat=heat))
    wanted, area = YOUNG * (0.03 / 3.0 - 1e-3 * heat), 1.0
    (section,) = solution.preloads
    assert np.isclose(section.force, wanted * area, rtol=1e-10)
    assert np.isclose(solution.last_step.strain_energy, wanted**2 / (2 * YOUNG) * 3.0, rtol=1e-10)
    assert solution.certificate.holds
    assert solution.certificate.worst < 1e-10


def test_axisymmetric():
    """A round bar: the force is that of the whole section."""
    scene = {
        "mesh": rectangle_mesh(3, 7, length=0.5, height=3.0),
        "material": {"young": YOUNG, "poisson": 0.0, "hypothesis": "axisymmetric"},
        "displacement": [fixed("bottom", "y"), fixed("top", "y")],
        "preload": {"point": [0.0, 1.3], "axis": [0.0, 1.0], "shortening": 0.03},
    }
    solution = solve(parse_scene(scene))
    assert np.isclose(solution.preloads[0].force, np.pi * 0.25 * YOUNG * 0.01, rtol=1e-10)
    assert np.isclose(solution.stress.largest().value, YOUNG * 0.01, rtol=1e-8)
    with pytest.raises(SceneError, match="axis: must be that of the body"):
        parse_scene(scene | {"preload": scene["preload"] | {"axis": [1.0, 1.0]}})


DRAWN = """
SetFactory("Built-in");
Point(1) = {0, 0, 0, 0.4}; Point(2) = {1.2, 0, 0, 0.4}; Point(3) = {3, 0, 0, 0.4};
Point(4) = {3, 1, 0, 0.4}; Point(5) = {1.2, 1, 0, 0.4}; Point(6) = {0, 1, 0, 0.4};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 5}; Line(5) = {5, 6}; Line(6) = {6, 1};
Line(7) = {2, 5};
Curve Loop(1) = {1, 7, 5, 6}; Plane Surface(1) = {1};
Curve Loop(2) = {2, 3, 4, -7}; Plane Surface(2) = {2};
Physical Curve("left") = {6}; Physical Curve("right") = {3}; Physical Curve("cut") = {7};
Physical Surface("bar") = {1, 2};
"""


@pytest.mark.parametrize("several", [False, True])
def test_a_section_that_a_file_names(tmp_path, several):
    """Facets inside the mesh, of a drawing, and of one of several bodies."""
    file, mpi = COMM.bcast(tmp_path) / "bar.geo", COMM
    if mpi.rank == 0:
        file.write_text(DRAWN)
    mpi.barrier()
    name = "bar." if several else ""
    scene = parse_scene(
        {
            **(
                {"body": [{"name": "bar", "mesh": {"file": str(file)}}]}
                if several
                else {"mesh": {"file": str(file)}}
            ),
            "material": {"young": YOUNG, "poisson": 0.0},
            "displacement": [fixed(f"{name}left"), fixed(f"{name}right", "x")],
            "preload": {"section": f"{name}cut", "shortening": 0.03},
        }
    )
    assert np.isclose(solve(scene).preloads[0].force, YOUNG * 0.03 / 3.0, rtol=1e-10)
    tagged = load_mesh(scene, COMM)
    assert not COMM.allreduce(tagged.facets(f"{name}cut").size)  # nothing of the boundary


MISTAKES = {
    "no section": (
        {"section": "nowhere", "shortening": 0.1},
        "preload[0].section: the mesh has no facets 'nowhere'",
    ),
    "outside": (
        {"section": "left", "shortening": 0.1},
        "preload[0].section: 'left' has no facets inside the mesh",
    ),
    "beside": (
        {"point": [9.0, 0.0], "axis": [1.0, 0.0], "shortening": 0.1},
        "the plane does not cut the mesh",
    ),
    "at a support": (
        {"point": [0.2, 0.0], "axis": [1.0, 0.0], "shortening": 0.1},
        "holds nodes of the section",
    ),
    "three": (
        {"point": [1.0, 0.0, 0.0], "axis": [1.0, 0.0], "shortening": 0.1},
        "give 2 numbers, not 3",
    ),
    "both": (
        {"point": [1.0, 0.0], "axis": [1.0, 0.0], "shortening": 0.1, "force": 1.0},
        "give either force or",
    ),
    "neither": ({"section": "cut"}, "give either force or shortening"),
    "nowhere": ({"point": [1.0, 0.0], "shortening": 0.1}, "give either section"),
    "pushes": ({"section": "cut", "force": -1.0}, "force must be positive"),
    "field": (
        {"section": "cut", "shortening": "x[0]"},
        "a number or an expression of the time t is expected",
    ),
    "locks": (
        {"section": "cut", "shortening": 1.0, "locked_after": 2},
        "locked_after needs a force",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes(name):
    preload, words = MISTAKES[name]
    with pytest.raises(SceneError) as raised:
        solve(bar("triangle", preload=preload))
    assert words in str(raised.value).replace("\n", " ")


def pressed_pair(points="boundary", axis=(0.0, 1.0), **contact):
    """A coarse block on a fine one, of which one has a section between its only rows of nodes, in
    contact both.
    """

    def block(nx, ny):
        parameters = {"length": 1.0, "height": 1.0, "nx": nx, "ny": ny, "cell": "triangle"}
        return rectangle_mesh(**parameters)

    bodies = [("lower", block(5, 4), 0.0), ("upper", block(3, 1), 1.0)]
    return parse_scene(
        {
            "body": [{"name": name, "mesh": mesh, "shift": [0.0, y]} for name, mesh, y in bodies],
            "material": {"young": YOUNG, "poisson": 0.3},
            "displacement": [fixed("lower.bottom", "y")]
            + [fixed(f"{name}.left", "x") for name in ("lower", "upper")],
            "traction": {"boundary": "upper.top", "y": -0.01 * YOUNG},
            "contact": {
                "boundary": "lower.top",
                "against": "upper.bottom",
                "points": points,
                **contact,
            },
            "preload": {
                "point": [0.52, 1.47],
                "axis": list(axis),
                "region": "upper",
                "shortening": 0.01,
            },
        }
    )


@pytest.mark.mpi
@pytest.mark.parametrize("points", ["boundary", "against"])
def test_a_section_across_a_contact_of_two_bodies(points):
    """Along the contact a bond holds the section, and contact without friction does not."""
    with pytest.raises(SceneError, match="holds nodes of the section"):
        solve(pressed_pair(points, axis=(1.0, 0.0), kind="bonded"))
    assert solve(pressed_pair(points, axis=(1.0, 0.0))).converged
