"""The body on the page of a report that a pointer turns: its surface and fields are those of the
files of the result.
"""

import base64
import json
import re
import tomllib

import numpy as np
import pytest
from numpy.testing import assert_allclose

from signorini_fx import solve, write_results
from signorini_fx.addons.report import turning_body as body
from signorini_fx.addons.report.page import page
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import parse_scene

BOX = """
mesh = { generator = "box", parameters = { nx = 3, ny = 2, nz = 2, cell = "CELL" } }
element = { degree = DEGREE }
material = { young = 100.0, poisson = 0.0 }
displacement = { boundary = "top", x = 0.0, y = 0.0, z = -0.01, factors = [0.5, 1.0] }
contact = { boundary = "bottom" }
"""
PLANE = """
mesh = { generator = "rectangle", parameters = { length = 2.0, nx = 4, ny = 2 } }
material = { young = 100.0, poisson = 0.0 }
displacement = { boundary = "top", x = 0.0, y = -0.01 }
contact = { boundary = "bottom" }
"""


def on_page(text, folder):
    """What the page of a result has of its body."""
    scene = parse_scene(tomllib.loads(text))
    write_results(solve(scene), folder, pictures=False)
    found = re.search(r'<script type="application/json" class="data">(.*?)</script>', page(folder))
    return json.loads(found[1])


def test_view_shows_the_body_alone(tmp_path, monkeypatch):
    """The command writes a page with the outcome and the body, and opens it where it can."""
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setenv("DISPLAY", ":7")
    on_page(PLANE, tmp_path)
    assert cli.main(["view", str(tmp_path)]) == 0
    text = (tmp_path / "view.html").read_text(encoding="utf-8")
    assert re.findall(r"<h2>(.*?)</h2>", text) == ["Body", "Outcome"]
    assert opened == [(tmp_path / "view.html").as_uri()]


def unpacked(text, kind=np.float32):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


@pytest.mark.parametrize(
    ("cell", "degree"), [("hexahedron", 1), ("hexahedron", 2), ("tetrahedron", 1)]
)
def test_the_surface_of_a_block(tmp_path, cell, degree):
    """All facets of its sides and no other, outside its volume; evenly pressed in two steps."""
    found = on_page(BOX.replace("CELL", cell).replace("DEGREE", str(degree)), tmp_path)
    points = unpacked(found["points"]).reshape(-1, 3)
    triangles = unpacked(found["triangles"], np.uint32).reshape(-1, 3)
    assert len(triangles) == 2 * 2 * (3 * 2 + 3 * 2 + 2 * 2)
    assert len(points) == 4 * 3 * 3 - 2  # all corners but the two within
    a, b, c = points[triangles].transpose(1, 0, 2)
    extent = np.ptp(points, axis=0)
    area = 2 * (extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0])
    assert 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() == pytest.approx(area)
    assert [step["name"] for step in found["steps"]] == ["time 1", "time 2"]
    assert next(iter(found["steps"][0]["fields"])) == "recovered von mises"
    for step, share in zip(found["steps"], (0.5, 1.0), strict=True):
        down = unpacked(step["displacement"]).reshape(-1, 3)[:, 2]
        assert_allclose(down, -0.01 * share * points[:, 2] / extent[2], atol=1e-6)
        pressure = unpacked(step["fields"]["contact pressure"])
        at_bottom = points[:, 2] < 1e-9
        assert_allclose(pressure[at_bottom], share * 1.0 / extent[2], rtol=1e-4)
        assert np.isnan(pressure[~at_bottom]).all()
        stress = unpacked(step["fields"]["recovered von mises"])
        assert_allclose(stress, share * 1.0 / extent[2], rtol=1e-4)


def test_a_plane_body(tmp_path):
    """All its cells, in one step."""
    found = on_page(PLANE, tmp_path)
    assert len(unpacked(found["triangles"], np.uint32)) == 3 * 2 * 4 * 2
    assert found["plane"]
    assert len(found["steps"]) == 1
    assert "contact pressure" not in found["steps"][0]["fields"]


def test_without_it(tmp_path, monkeypatch):
    """A page of a result without fields, or with a surface that is too large, has none."""
    scene = parse_scene(tomllib.loads(PLANE))
    write_results(solve(scene), tmp_path / "bare", pictures=False, fields=False)
    assert "<canvas" not in page(tmp_path / "bare")
    monkeypatch.setattr(body, "_MOST_CORNERS", 3)
    write_results(solve(scene), tmp_path / "large", pictures=False)
    assert "<canvas" not in page(tmp_path / "large")


SLID = """
material = { young = 100.0, poisson = 0.0 }
displacement = [
    { boundary = "plate.bottom", x = 0.0, y = 0.0 },
    { boundary = "block.top", x = 0.1, y = -0.01 },
]
contact = { boundary = "block.bottom", against = "plate.top" }
[[body]]
name = "plate"
mesh = { generator = "rectangle", parameters = { length = 2.0, nx = 4, ny = 2 } }
[[body]]
name = "block"
mesh = { generator = "rectangle", parameters = { length = 2.0, nx = 4, ny = 2 } }
shift = [0.0, 1.0]
"""


def test_bodies_that_touch(tmp_path):
    """Each keeps its points: of two plates of which one slides, neither is drawn at their mean."""
    found = on_page(SLID, tmp_path)
    points = unpacked(found["points"]).reshape(-1, 3)
    (step,) = found["steps"]
    aside = unpacked(step["displacement"]).reshape(-1, 3)[:, 0]
    assert len(points) == 2 * 5 * 3
    assert_allclose(sorted(aside[points[:, 1] == 1.0]), [0.0] * 5 + [0.1] * 5, atol=1e-6)
