"""Scenes in which two deformable bodies are in contact."""

import re

import jsonschema
import numpy as np
import pytest
from commands import summary_in
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import prepared
from two_cylinders import DEMO, altered, in_balance, sticking_half_width

from signorini_fx import SceneError, read_scene, solve, write_results
from signorini_fx.results.summary import lines_of, summary_of
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.template import summary_schema


@pytest.mark.slow
@pytest.mark.parametrize("push", [0.02, 0.035])
def test_cattaneo_and_mindlin(push):
    """Cylinders of one material: the zone that sticks has the half width c = a (1 - Q / F P)^(1/2),
    to a node, and the shear is that of the theory, the same on both sides, but next to the ends of
    this zone, where it has a kink.
    """
    scene = altered()
    scene["material"] = [
        {"region": name, "young": 200.0, "poisson": 0.3} for name in ("soft", "stiff")
    ]
    scene["displacement"][1]["factors"] = [1.0, 1.0]  # the theory has no shear before the push
    scene["displacement"][2] |= {"x": push, "factors": [0.0, 1.0]}
    scene["load_steps"] = {}
    found = solve(parse_scene(scene))
    half, inner, normal, spacing = sticking_half_width(found, 0.3, least=0.5)
    table = found.table.columns
    x, shear = table["x"], np.abs(table["shear"])
    largest = 0.3 * 2 * normal / (np.pi * half)
    theory = largest * np.sqrt(np.maximum(1 - (x / half) ** 2, 0))
    theory -= largest * inner / half * np.sqrt(np.maximum(1 - (x / inner) ** 2, 0))
    smooth = (np.abs(np.abs(x) - inner) > spacing) & (np.abs(x) < half - spacing)
    assert np.abs(shear - theory)[smooth].max() < 0.05 * largest
    assert np.abs(shear - np.interp(-x, x, shear)).max() < 0.05 * largest


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"against": "upper"}, r"contact\[0\].against: is the boundary itself"),
        (
            {"direction": [0.0, -1.0]},
            r"contact\[0\].direction: between two bodies it is the normal",
        ),
        (
            {"against": None, "distance": "nominal"},
            r"contact\[0\].distance: is for contact against",
        ),
        ({"kind": "bonded"}, r"contact\[0\].friction: must be left out: a bond has no friction"),
        (
            {"kind": "bonded", "friction": None, "against": None},
            r"contact\[0\]: a bond needs the boundary.*\[\[displacement\]\]",
        ),
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
        ({"against": "bottom"}, r"contact\[0\]: no facet faces the other side"),
    ],
)
def test_what_the_mesh_refuses(changes, match):
    """A boundary that is not there, or that is none of another body within reach."""
    with pytest.raises(SceneError, match=match):
        solve(parse_scene(altered(**changes)))


@pytest.mark.slow
def test_shrink_fit(tmp_path):
    """Lame's pressure, and both sides carry the torque; the gap by geometry of straight facets is
    warned of.

    The seat closes around the shaft: resultants on it are round-off, and friction transmits the
    torque.
    """
    solution = solve(read_scene(DEMO.parent / "shrink_fit.toml"))
    weight = solution.contact.boundary.weight
    assert solution.contact.pressure @ weight / weight.sum() == pytest.approx(92.87, rel=1e-3)
    torque = 3.0 * 2 * np.pi * 40.0**2
    every = in_balance(solution)
    assert every["seat"].moment == pytest.approx(torque, rel=2e-3)
    assert every["bore"].moment == pytest.approx(-torque, rel=2e-3)
    summary = summary_of(solution)
    (figures,) = summary["contact_boundaries"]
    assert figures["friction_moment"] == pytest.approx(torque, rel=1e-5)
    assert figures["moment_limit"] == pytest.approx(0.15 * 92.87 * 2 * np.pi * 20.0**2, rel=1e-3)
    text = "\n".join(map(str, lines_of(summary, tmp_path)))
    assert f"seat: a moment of {torque:.4f}"[:-5] in text
    assert "about its middle, at most 350" in text
    assert re.search(r"rim: \(0, 0\) by traction, moment -?301\d\d", text)
    write_results(solution, tmp_path / "out", fields=False, pictures=False)
    written = summary_in(tmp_path / "out")
    jsonschema.Draft202012Validator(summary_schema()).validate(written)
    steps = {
        name: np.array([row[name] for row in summary["steps"]]) for name in summary["steps"][0]
    }
    assert steps["pressure_integral"] == pytest.approx([92.87 * 40 * np.pi] * 2, rel=1e-3)
    assert steps["friction_moment"] == pytest.approx(
        [0.0, figures["friction_moment"]], abs=1e-6 * torque
    )


@pytest.mark.one_quick(
    ("changes", "side"),
    [
        ({}, "upper"),
        ({"points": "boundary"}, "lower"),
        ({"points": "against"}, "upper"),
        ({"gap": "0*x[0]"}, "lower"),
    ],
)
def test_where_points_are(changes, side):
    """By rule only where no value is a function, which was written for ``boundary``."""

    scene = parse_scene(altered(boundary="lower", against="upper", **changes))
    found = prepared(scene).statement.contact[0]
    assert found.boundary == side
    assert found.against == {"upper": "lower", "lower": "upper"}[side]


@pytest.mark.parametrize("holds", [[False, True], [True, False]])
def test_a_plane_of_symmetry_that_comes_or_goes(holds):
    """The slip of points on it counts from where both bodies were; points on either side give one
    answer.
    """

    def body(name, height, cells):
        sizes = {"length": 1.0, "height": 0.5, "nx": cells, "ny": 3}
        return {"name": name, "shift": [0.0, height], "mesh": rectangle_mesh(**sizes)}

    def forces(boundary, against):
        contact = {"boundary": boundary, "against": against, "friction": coulomb_friction(0.4)}
        found = solve(parse_scene(scene | {"contact": contact}))
        return np.abs(found.contact.forces)[[0, 1], [1, 0]]

    scene = {
        "title": "a support of one load step",
        "body": [body("lower", 0.0, 6), body("upper", 0.5, 5)],
        "material": {"young": 100.0, "poisson": 0.3},
        "displacement": [
            fixed("lower.bottom"),
            *(
                {"boundary": f"{name}.left", "x": 0.0, "holds": holds}
                for name in ("lower", "upper")
            ),
            {"boundary": "upper.top", "y": -0.01, "factors": [0.5, 1.0]},
            {"boundary": "upper.right", "x": 0.004, "factors": [1.0, 1.0]},
        ],
    }
    normal, friction = np.transpose(
        [forces("lower.top", "upper.bottom"), forces("upper.bottom", "lower.top")]
    )
    assert normal[0] == pytest.approx(normal[1], rel=1e-3)
    assert friction[0] == pytest.approx(friction[1], rel=0.05)


@pytest.mark.mpi
@pytest.mark.parametrize("law", [None, "neo-hooke"])
def test_a_body_on_two_others(law):
    """Their boundaries are the other side together, which the names of results say."""

    def body(name, shift, length):
        mesh = rectangle_mesh(6, 2, length=length)
        return {"name": name, "mesh": mesh, "shift": shift}

    bodies = [
        body("left", [0.0, 0.0], 1.0),
        body("right", [1.5, 0.0], 1.0),
        body("beam", [0.0, 1.0], 2.5),
    ]
    scene = {
        "body": bodies,
        "material": {"young": 1000.0, "poisson": 0.3} | ({"law": law} if law else {}),
        "displacement": [fixed(f"{name}.bottom") for name in ("left", "right")]
        + [fixed("beam.left", "x")],
        "traction": {"boundary": "beam.top", "y": -1.0},
        "contact": {"boundary": "beam.bottom", "against": ["left.top", "right.top"]},
    }
    found = solve(parse_scene(scene))
    assert abs(sum(found.contact.forces)[1]) == pytest.approx(2.5, rel=1e-6)
    contact = found.statement.contact[0]
    assert {contact.boundary, contact.against} == {"beam.bottom", "left.top + right.top"}
    assert found.certificate.holds
    with pytest.raises(SceneError, match=r"contact\[0\].against: .* no boundary 'left.top \+ no'"):
        solve(
            parse_scene(
                scene | {"contact": {"boundary": "beam.bottom", "against": ["left.top", "no"]}}
            )
        )


@pytest.mark.mpi
def test_a_rank_without_facets_of_a_pair():
    """It takes part in what all ranks do together: two ranks waited for each other for ever."""
    scene = read_scene("demos/scenes/ball_in_groove.toml")
    assert solve(scene, check=False).converged
