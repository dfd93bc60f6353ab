"""Scenes in which two deformable bodies are in contact."""

import json
import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from test_summary_schema import VALIDATOR

from signorini_fx import ConvergenceError, SceneError, read_scene, solve, write_results
from signorini_fx.addons.pictures import load_steps
from signorini_fx.results.short_answer import short_answer
from signorini_fx.results.summary import render, summarise
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.cli import main
from signorini_fx.scenes.reading import parse_scene

DEMO = Path(__file__).parents[2] / "demos" / "scenes" / "two_cylinders.toml"


@pytest.fixture(scope="module")
def cylinders():
    """The demo."""
    return solve(read_scene(DEMO))


def altered(**changes):
    """The demo with other entries."""
    import tomllib

    scene = tomllib.loads(DEMO.read_text(encoding="utf-8"))
    scene["mesh"]["file"] = str(DEMO.parent / scene["mesh"]["file"])
    contact = scene["contact"][0]
    for key, value in changes.items():
        if key in ("solver", "accuracy"):
            scene[key] = value
        elif value is None:
            contact.pop(key, None)
        else:
            contact[key] = value
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("push", [0.02, 0.035])
def test_cattaneo_and_mindlin(push):
    """Cylinders of one material: the zone that sticks has the half width c = a (1 - Q / F P)^(1/2), to a node, and
    the shear is that of the theory, the same on both sides, but next to the ends of this zone, where it has a kink.
    """
    scene = altered()
    scene["material"] = [{"region": name, "young": 200.0, "poisson": 0.3} for name in ("soft", "stiff")]
    scene["displacement"][2]["x"] = push
    found = solve(parse_scene(scene))
    tangential, normal = np.abs(sum(found.contact.forces))
    share = tangential / (0.3 * normal)
    assert 0.5 < share < 0.9
    stiffness, radius = 200.0 / (2 * (1 - 0.3**2)), 1 / (1 / 8 + 1 / 12)
    half = np.sqrt(4 * normal * radius / (np.pi * stiffness))
    table = found.table.columns
    sticking = table["x"][table["state"] == "stick"]
    spacing = np.diff(table["x"][np.abs(table["x"]) < half]).max()
    assert np.ptp(sticking) / 2 == pytest.approx(half * np.sqrt(1 - share), abs=spacing)
    inner, x, shear = half * np.sqrt(1 - share), table["x"], np.abs(table["shear"])
    largest = 0.3 * 2 * normal / (np.pi * half)
    theory = largest * np.sqrt(np.maximum(1 - (x / half) ** 2, 0))
    theory -= largest * inner / half * np.sqrt(np.maximum(1 - (x / inner) ** 2, 0))
    smooth = (np.abs(np.abs(x) - inner) > spacing) & (np.abs(x) < half - spacing)
    assert np.abs(shear - theory)[smooth].max() < 0.05 * largest
    assert np.abs(shear - np.interp(-x, x, shear)).max() < 0.05 * largest


@pytest.mark.parametrize(("young", "warned"), [(200.0, False), (0.2, True)])
def test_gamma_that_is_too_large_for_the_softest_body(young, warned):
    """The digits of its pressures are lost by a gamma of which those of a stiff one are not."""
    scene = altered(solver={"gamma_n": 1e9})
    scene["material"][0]["young"] = young
    found = [
        finding.message for finding in check_scene(parse_scene(scene)).findings if finding.path == "solver.gamma_n"
    ]
    assert ["round-off spoils" in message for message in found] == [True] * warned


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"against": "upper"}, r"contact\[0\].against: is the boundary itself"),
        ({"direction": [0.0, -1.0]}, r"contact\[0\].direction: is that of the normal"),
        ({"against": None, "distance": "nominal"}, r"contact\[0\].distance: is for contact against"),
        ({"kind": "bonded"}, r"contact\[0\].friction: a bond has none"),
        ({"kind": "bonded", "friction": None, "against": None}, r"contact\[0\]: a bond needs the boundary"),
    ],
)
def test_what_a_scene_cannot_say(changes, match):
    """Each is named with its path."""
    with pytest.raises(SceneError, match=match):
        parse_scene(altered(**changes))


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"against": "nowhere"}, r"contact\[0\].against: the mesh has no boundary"),
        ({"against": "top"}, r"contact\[0\]: "),
        ({"against": "bottom"}, r"contact\[0\]: none of its facets finds one"),
    ],
)
def test_what_the_mesh_refuses(changes, match):
    """A boundary that is not there, or that is none of another body within reach."""
    with pytest.raises(SceneError, match=match):
        solve(parse_scene(altered(**changes)))


@pytest.mark.slow
def test_bonded_cylinders():
    """A bond takes tension: pulled apart, the force is the opposite of that when pressed."""

    def force(y):
        scene = altered(kind="bonded", friction=None)
        scene["displacement"] = [
            {"boundary": "bottom", "x": 0.0, "y": 0.0},
            {"boundary": "top", "x": 0.0, "y": y},
        ]
        scene.pop("load_steps")
        found = solve(parse_scene(scene))
        return sum(found.contact.forces)[1]

    assert force(0.01) == pytest.approx(-force(-0.01), rel=1e-6)
    assert force(-0.01) > 0.1


def test_check_says_so(capsys):
    """The other body is named, and the bodies are counted."""
    assert main(["check", str(DEMO)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "unilateral, against lower" in told
    assert "there are 2 bodies" in told


def test_one_body_does_not_pay():
    """A scene with one body has no form, no matrix and no entry of B more, and does not import what pairs need."""
    import subprocess
    import sys

    program = (
        "import sys; sys.path.insert(0, 'tests/support')\n"
        "from scenes import alone, example1\n"
        "from signorini_fx.algebra.linalg.assembled import AssembledSystem\n"
        "of = AssembledSystem.of.__func__\n"
        "def watched(cls, elasticity):\n"
        "    system = of(cls, elasticity)\n"
        "    assert system.matrix.handle == elasticity.matrix.handle\n"
        "    assert system.contact.lift is None\n"
        "    _, _, entries = system.contact.operator.getValuesCSR()\n"
        "    assert (entries != 0).sum() == system.contact.operator.getSize()[0] > 0\n"
        "    return system\n"
        "AssembledSystem.of = classmethod(watched)\n"
        "for kind in 'full', 'krylov':\n"
        "    found = alone(example1(nx=12, ny=4, coefficient=0.3, linear_algebra=kind))\n"
        "    assert found.converged\n"
        "    inventory = found.model.inventory\n"
        "    assert inventory.forms == ['elasticity', 'traction top', 'contact bottom'], inventory.forms\n"
        "    assert inventory.matrices == ['stiffness']\n"
        "stated = 'signorini_fx.mechanics.interfaces.pair'  # plain data, by which a pair is known\n"
        "print([name for name in {*sys.modules} - {stated} if 'signorini_fx' in name and 'pair' in name])\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=DEMO.parent.parent.parent
    )
    assert ended.stdout.strip().endswith("[]"), ended.stdout


def test_pictures_tell_bodies_from_foundations(cylinders):
    """Both sides have the colour of contact and no strokes of a foundation; curves are named for what they are."""
    from mpi4py import MPI

    from signorini_fx.addons.picture_data.of_setup import gather_setup
    from signorini_fx.addons.pictures.boundary_profiles import boundaries_of, panels_of
    from signorini_fx.scenes.mesh import load_mesh

    scene = read_scene(DEMO)
    sides = {one.name: one for one in gather_setup(load_mesh(scene, MPI.COMM_SELF), scene.statement).boundaries}
    assert "contact" in sides["upper"].kinds
    assert "contact" in sides["lower"].kinds
    assert not sides["upper"].grounded
    assert not sides["lower"].grounded
    columns = cylinders.table.columns
    assert set(columns["against"]) == {"lower"}
    (boundary,) = boundaries_of(columns)
    panels = [panel for side in ("contact", "friction") for panel in panels_of(boundary, side)]
    names = [curve.name for panel in panels for curve in panel.curves]
    assert "the other body" in names
    assert "relative tangential displacement" in names
    assert not any("foundation" in name for name in names)


def test_the_other_side(cylinders, tmp_path):
    """Pressures and distances are those of the side with the points, shear is the opposite; the file has them."""
    from signorini_fx import write_results
    from signorini_fx.machine.result_files import read_csv

    write_results(cylinders, tmp_path / "out", fields=False, pictures=False)
    other, table = read_csv(tmp_path / "out" / "contact_other_side.csv"), cylinders.table.columns
    assert set(other["boundary"]) == {"lower"}
    assert set(other["against"]) == {"upper"}
    assert other["y"] == pytest.approx(-12.0 + np.sqrt(144.0 - other["x"] ** 2), abs=1e-6)
    assert other["pressure"].max() == pytest.approx(table["pressure"].max(), rel=0.03)
    touching = other["x"][other["pressure"] > 0]
    both = table["x"][table["pressure"] > 0]
    assert (touching.min(), touching.max()) == pytest.approx((both.min(), both.max()), abs=0.2)
    # To the right, on the tangent of the upper side.
    mine = np.interp(0.0, table["x"], table["shear"] * -table["n_y"])
    assert np.interp(0.0, other["x"], other["shear_x"]) == pytest.approx(-mine, rel=0.1)
    closed = np.abs(other["x"]) < 0.2
    assert np.abs(other["distance"][closed]).max() < 1e-4
    assert other["distance"].max() > 0.1


STACKED = """
import numpy as np
from two_bodies import assembled, grid

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.meshes import generator


@generator(counts=("n",))
def generate(comm, /, *, n: int = 4, space: bool = False):
    kind, dim = ("hexahedron", 3) if space else ("quadrilateral", 2)
    up, ones = np.eye(dim)[1], np.ones(dim)
    low = grid(kind, (n,) * dim, -up, ones - up)
    high = grid(kind, (3 * n // 2,) * dim, -0.001 * up, ones)
    tagged = tag_boundaries(
        assembled(kind, low, high, comm=comm),
        {
            "bottom": lambda x: np.isclose(x[1], -1),
            "top": lambda x: np.isclose(x[1], 1),
            "lower": lambda x: np.isclose(x[1], 0),
            "upper": lambda x: np.isclose(x[1], -0.001),
        },
    )
    return tagged
"""


@pytest.fixture
def stacked(tmp_path, monkeypatch):
    """A generator of two blocks, of which one begins a little inside the other."""
    data = tmp_path / "stacked-1.0.dist-info"
    data.mkdir()
    (data / "METADATA").write_text("Metadata-Version: 2.1\nName: stacked\nVersion: 1.0\n", encoding="utf-8")
    (data / "entry_points.txt").write_text("[signorini_fx.generators]\nstacked = stacked:generate", encoding="utf-8")
    (tmp_path / "stacked.py").write_text(STACKED, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "stacked", raising=False)

    def scene(n, space=False, **solver):
        axes = "xyz"[: 3 if space else 2]
        contact = {"boundary": "upper", "against": "lower", "friction": {"law": "coulomb", "coefficient": 0.3}}
        return parse_scene(
            {
                "mesh": {"generator": "stacked", "parameters": {"n": n, "space": space}},
                "material": [{"young": 100.0, "poisson": 0.3}],
                "displacement": [
                    {"boundary": "bottom", **dict.fromkeys(axes, 0.0)},
                    {"boundary": "top", **dict.fromkeys(axes, 0.0), "x": 0.001, "y": -0.002},
                ],
                "contact": [contact],
                "solver": solver,
            }
        )

    return scene


def test_pieces_keep_their_nodes(stacked):
    """The interpolation from a coarser mesh moves no body with the other one."""
    from mpi4py import MPI

    from signorini_fx.mechanics.body.discretisation import discretise
    from signorini_fx.records import Timings
    from signorini_fx.scenes.mesh import load_mesh

    coarse, fine = (
        discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings()) for scene in map(stacked, (4, 8))
    )
    shares = fine.level(coarse.level())._shares(coarse.level()).tocoo()
    assert (fine.motions.piece[shares.row] == coarse.motions.piece[shares.col]).all()


def in_balance(solution):
    """Forces and moments of both sides of every contact sum to zero; the resultants by their boundaries."""
    every = {one.boundary: one for one in solution.resultants.every()}
    for effect in solution.statement.contact:
        one, other = every[effect.boundary], every[effect.against]
        assert one.force + other.force == pytest.approx(np.zeros(2), abs=1e-9 * one.size[0])
        assert one.moment + other.moment == pytest.approx(0.0, abs=1e-9 * one.size[1])
    return every


def drawn_steps(steps, monkeypatch):
    """Labels, values and the axis labels of the picture of load steps: of the upper axes, then of the lower ones."""
    seen = []
    monkeypatch.setattr(load_steps, "finish", lambda figure, *_: seen.append(figure))
    load_steps.load_steps("unused", steps)
    return [
        ({line.get_label(): np.asarray(line.get_ydata()) for line in axes.lines}, axes.get_ylabel())
        for axes in seen[0].axes
    ]


def test_shrink_fit(monkeypatch, tmp_path):
    """Lame's pressure, and both sides carry the torque; the gap by geometry of straight facets is warned of.

    The seat closes around the shaft: resultants on it are round-off, and friction transmits the torque.
    """
    solution = solve(read_scene(DEMO.parent / "shrink_fit.toml"))
    weight = solution.contact.boundary.weight
    assert solution.contact.pressure @ weight / weight.sum() == pytest.approx(92.87, rel=1e-3)
    torque = 3.0 * 2 * np.pi * 40.0**2
    every = in_balance(solution)
    assert every["seat"].moment == pytest.approx(torque, rel=2e-3)
    assert every["bore"].moment == pytest.approx(-torque, rel=2e-3)
    summary = summarise(solution)
    (figures,) = summary["contact_boundaries"]
    assert figures["friction_moment"] == pytest.approx(torque, rel=1e-5)
    assert figures["moment_limit"] == pytest.approx(0.15 * 92.87 * 2 * np.pi * 20.0**2, rel=1e-3)
    text = render(summary)
    assert f"seat: a moment of {torque:.4f}"[:-5] in text
    assert "about its middle of at most 350" in text
    assert re.search(r"rim: \(0, 0\) by traction, a couple of -?301\d\d", text)
    write_results(solution, tmp_path / "out", fields=False, pictures=False)
    VALIDATOR.validate(json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8")))
    steps = {name: np.array([row[name] for row in summary["steps"]]) for name in summary["steps"][0]}
    assert steps["pressure_integral"] == pytest.approx([92.87 * 40 * np.pi] * 2, rel=1e-3)
    assert steps["friction_moment"] == pytest.approx([0.0, figures["friction_moment"]], abs=1e-6 * torque)
    (upper, _), (lower, name) = drawn_steps(steps, monkeypatch)
    assert set(upper) >= {"integral of the pressure"}
    assert not [label for label in upper if "contact force" in label]
    assert name.startswith("moment of friction")
    assert lower["moment of friction"][1] / figures["friction_moment"] == pytest.approx(1e-4)


def test_a_ring_on_a_rigid_shaft(monkeypatch):
    """In 3D: friction carries the torque about the axis; pushed too, the ring has a resultant, which is drawn."""

    def ring(push):
        return solve(
            parse_scene(
                {
                    "mesh": {
                        "generator": "ring",
                        "parameters": {"nr": 2, "nt": 4, "nz": 2},
                    },
                    "material": {"young": 1000.0, "poisson": 0.3},
                    "traction": [
                        {"boundary": "outer", "x": "-0.1 * x[1]", "y": "0.1 * x[0]", "factors": [0.0, 1.0]},
                        {"boundary": "outer", "x": push, "factors": [0.0, 1.0]},
                    ],
                    "contact": {
                        "boundary": "inner",
                        "foundation": {"shape": "cylinder", "centre": [0, 0, 0], "axis": [0, 0, 1], "radius": 1.0},
                        "gap": -0.01,
                        "friction": {"law": "coulomb", "coefficient": 0.3},
                    },
                }
            )
        )

    solution = ring(0.0)
    outer = next(one for one in solution.resultants.every() if one.boundary == "outer")
    summary = summarise(solution)
    (figures,) = summary["contact_boundaries"]
    assert figures["friction_moment"] == pytest.approx([0.0, 0.0, -outer.moment[2]], abs=1e-7 * abs(outer.moment[2]))
    assert abs(outer.moment[2]) < figures["moment_limit"] < 1.05 * 0.3 * figures["pressure_integral"]
    steps = {name: np.array([row[name] for row in summary["steps"]]) for name in summary["steps"][0]}
    _, (lower, name) = drawn_steps(steps, monkeypatch)
    assert name.startswith("moment of friction")
    assert lower["moment of friction z"][1] < 0
    summary = summarise(ring(0.05))
    steps = {name: np.array([row[name] for row in summary["steps"]]) for name in summary["steps"][0]}
    (upper, _), (_, name) = drawn_steps(steps, monkeypatch)
    assert "contact force x" in upper
    assert name.startswith("friction force")


def test_check_compares_facets_with_the_fit(tmp_path, capsys):
    """Chords of a circle are off it by as much as the interference: said of a distance by geometry only."""
    text = (DEMO.parent / "shrink_fit.toml").read_text(encoding="utf-8")
    text = text.replace('"shrink_fit.geo"', f'"{DEMO.parent / "shrink_fit.geo"}"')
    text = text.replace("factors = [0.0, 1.0]", "").replace("degree = 2", "degree = 1")
    told = []
    for name, scene in (("nominal", text), ("geometry", text.replace("nominal", "geometry"))):
        path = tmp_path / f"{name}.toml"
        path.write_text(scene[: scene.index("[load_steps]")], encoding="utf-8")
        main(["check", str(path), "--verbose"])
        told.append(" ".join(capsys.readouterr().out.split()))
    assert "off the curved sides" not in told[0]
    assert "contact[0].distance: straight facets of 'seat' and 'hole' are up to 0.0" in told[1]
    assert "much beside the gap of about 0.02:" in told[1]


@pytest.mark.slow
def test_the_softer_side_carries_the_points(cylinders):
    """Whichever the scene names first: the same points and tractions, and the log and the notes say so."""
    solution = solve(parse_scene(altered(boundary="lower", against="upper")))
    ours, theirs = solution.table.columns, cylinders.table.columns
    for name in ("x", "y", "weight", "pressure", "shear", "boundary", "against", "state"):
        assert ours[name].tolist() == theirs[name].tolist()
    assert "the contact points are on 'upper', not on 'lower': see contact.points" in solution.history.events
    (told,) = (found.message for found in solution.findings if found.path == "contact[0].points")
    assert told.startswith("the contact points are on 'upper', which is 3.2 times softer than 'lower'")


def test_the_side_can_be_set(cylinders):
    """The points on the stiffer side: pressure and force are those of the other one within the error of both."""
    solution = solve(parse_scene(altered(points="against")))
    assert set(solution.table.columns["boundary"]) == {"lower"}
    ours, theirs = (one.at(one.steps[0]).contact for one in (solution, cylinders))
    assert ours.pressure.max() == pytest.approx(theirs.pressure.max(), rel=0.03)
    assert ours.forces[0] == pytest.approx(-theirs.forces[0], abs=0.01 * abs(theirs.forces[0][1]))
    (told,) = (found.message for found in solution.findings if found.path == "contact[0].points")
    assert "'upper' is 3.2 times softer: results have less error" in told


@pytest.mark.parametrize(
    ("changes", "side"),
    [({}, "upper"), ({"points": "boundary"}, "lower"), ({"points": "against"}, "upper"), ({"gap": "0*x[0]"}, "lower")],
)
def test_where_points_are(changes, side):
    """By rule only where no value is a function, which was written for ``boundary``."""
    from mpi4py import MPI

    from signorini_fx.mechanics.body.discretisation import prepare
    from signorini_fx.records import Timings
    from signorini_fx.scenes.mesh import load_mesh

    scene = parse_scene(altered(boundary="lower", against="upper", **changes))
    found = prepare(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings()).statement.contact[0]
    assert found.boundary == side
    assert found.against == {"upper": "lower", "lower": "upper"}[side]


NARROW_ON_WIDE = """
[[body]]
name = "block"
shift = [3.0, 0.0]
mesh = { generator = "rectangle", parameters = { length = 4.0, height = 2.0, nx = 8, ny = 4 } }

[[body]]
name = "base"
shift = [0.0, -2.0]
mesh = { generator = "rectangle", parameters = { length = 10.0, height = 2.0, nx = 20, ny = 4 } }

[material]
law = "neo-hooke"
young = 1000.0
poisson = 0.3

[[displacement]]
boundary = "base.bottom"
x = 0.0
y = 0.0

[[displacement]]
boundary = "block.top"
y = -0.1

[[displacement]]
boundary = "block.top"
x = 1.5
factors = [0.0, 0.5, 1.0]

[[contact]]
boundary = "base.top"
against = "block.bottom"
friction = { law = "coulomb", coefficient = 0.3 }

[load_steps]
names = ["press", "half", "slid"]
"""


def test_the_side_that_ends_carries_the_points():
    """A narrow rubber block slides on a wide one with its corners in contact: no increment is halved."""
    solution = solve(parse_scene(tomllib.loads(NARROW_ON_WIDE)))
    assert solution.converged
    assert len(solution.steps) == 3
    assert set(solution.table.columns["boundary"]) == {"block.bottom"}


@pytest.mark.slow
def test_bolted_joint():
    """Head, joint and nut carry the same when it is tightened; then the joint carries less by the load."""
    solution = solve(read_scene(DEMO.parent / "bolted_joint.toml"))
    assert solution.converged
    tightened = solution.at(solution.steps[0])
    before = [one.force[1] for one in tightened.resultants.every() if one.boundary in ("head", "joint above", "under")]
    assert before == pytest.approx([before[0]] * 3, rel=1e-6)
    assert before[0] > 100
    every = in_balance(solution)
    assert every["head"].force[1] - every["joint above"].force[1] == pytest.approx(5.0, rel=1e-6)
    assert every["head"].force[1] < 1.1 * before[0]


def test_bonded_pad():
    """The bond transmits shear without a bound, which is told as such."""
    from signorini_fx.results.contact_boundaries import contact_figures
    from signorini_fx.results.summary import render, summarise

    solution = solve(read_scene(DEMO.parent / "bonded_pad.toml"))
    every = in_balance(solution)
    (figures,) = contact_figures(solution.statement, solution.contact)
    assert figures.tangential_force == pytest.approx(abs(every["pad"].force[0]), rel=1e-6)
    assert figures.friction_limit == np.inf
    assert "in a bond" in render(summarise(solution))


@pytest.mark.slow
@pytest.mark.parametrize("carried", [0.0, 0.5])
def test_no_gamma_makes_wrong_pressures_pass(carried):
    """However large gamma is, also where bodies move far together: pressures are right, or it does not converge."""

    def pressures(**gamma):
        low, up = (
            {
                "name": name,
                "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": n, "ny": n}},
                "shift": [0.0, y],
            }
            for name, n, y in (("low", 6, 0.0), ("up", 8, 1.0))
        )
        scene = {
            "body": [low, up],
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [
                {"boundary": "low.bottom", "x": carried, "y": 0.0},
                {"boundary": "up.top", "x": carried, "y": -0.001},
            ],
            "contact": {"boundary": "up.bottom", "against": "low.top", "friction": {"law": "tresca", "bound": 0.1}},
            "solver": gamma,
        }
        return solve(parse_scene(scene)).contact.pressure

    right = pressures()
    failed = 0
    for power in range(10, 18, 2):
        try:
            np.testing.assert_allclose(pressures(gamma_n=10.0**power, gamma_t=10.0**power), right, rtol=3e-4)
        except ConvergenceError:
            failed += 1
    assert failed < 3


RING = """Point(1) = {{0, 0, 0}}; Point(2) = {{{0}, 0, 0}}; Point(3) = {{{1}, 0, 0}}; Point(4) = {{0, {1}, 0}};
Point(5) = {{0, {0}, 0}}; Line(1) = {{2, 3}}; Circle(2) = {{3, 1, 4}}; Line(3) = {{4, 5}}; Circle(4) = {{5, 1, 2}};
Transfinite Curve{{2, 4}} = {2}; Transfinite Curve{{1, 3}} = 5; Curve Loop(1) = {{1, 2, 3, 4}};
Plane Surface(1) = {{1}}; Transfinite Surface{{1}} = {{2, 3, 4, 5}}; Physical Surface("body") = {{1}};
Physical Curve("bottom") = {{1}}; Physical Curve("outer") = {{2}}; Physical Curve("left") = {{3}};
Physical Curve("inner") = {{4}};
"""


@pytest.mark.parametrize(
    ("facets", "distance", "wrong"),
    [((24, 36), "geometry", True), ((24, 36), "nominal", False), ((24, 24), "geometry", False)],
)
def test_chords_of_round_sides_that_change_the_pressure(tmp_path, facets, distance, wrong):
    """Two rings of one material under pressure, which are one body (Lame): the first lines say where the distances
    between facets decide the pressure, and say nothing where the nodes of both sides match.
    """
    for name, ends, count in (("small", (4, 10), facets[0]), ("large", (10, 20), facets[1])):
        (tmp_path / f"{name}.geo").write_text(RING.format(*ends, count + 1))
    scene = {
        "body": [{"name": name, "mesh": {"file": str(tmp_path / f"{name}.geo")}} for name in ("small", "large")],
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": [
            {"boundary": f"{name}.{side}", axis: 0.0}
            for name in ("small", "large")
            for side, axis in (("bottom", "y"), ("left", "x"))
        ],
        "traction": {"boundary": "large.outer", "pressure": 1.0},
        "contact": {"boundary": "small.outer", "against": "large.inner", "distance": distance},
    }
    solution = solve(parse_scene(scene))
    lame = (1 - 4**2 / 10**2) * 20**2 / (20**2 - 4**2)
    largest = solution.table.columns["pressure"].max()
    assert (largest > 2 * lame) == wrong
    assert wrong or largest == pytest.approx(lame, rel=0.05)
    lines = [str(line) for line in short_answer(summarise(solution), tmp_path)]
    assert any("straight facets" in line for line in lines) == wrong
