"""Names of units are labels: they stand where a quantity of their kind is shown, and change no
number.
"""

import re

import pytest
from commands import summary_in
from scenes import alone, example1

from signorini_fx.addons.pictures.style import unit_of
from signorini_fx.addons.report.page import page
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.settings import Units
from signorini_fx.mechanics.statement.units import bracketed, labelled, names_of, with_unit
from signorini_fx.results.files import write_results
from signorini_fx.scenes.reading import parse_scene


@pytest.mark.parametrize(
    ("given", "dimension", "expected"),
    [
        ({}, 2, {}),
        (
            {"length": "mm", "stress": "MPa"},
            3,
            {"area": "mm²", "force": "N", "moment": "N mm", "energy": "N mm"},
        ),
        (
            {"length": "mm", "stress": "MPa"},
            2,
            {"area": "mm", "force": "N/mm", "moment": "N", "energy": "N"},
        ),
        ({"length": "m", "stress": "kPa"}, 3, {"force": "kN", "moment": "kN m"}),
        ({"length": "in", "stress": "MPa"}, 3, {}),  # that force has no name
        ({"length": "in", "stress": "MPa", "force": "X"}, 3, {"force": "X", "moment": "X in"}),
        (
            {"force": "N"},
            2,
            {"moment": "N", "energy": "N"},
        ),  # per a thickness whose unit is not known
    ],
)
def test_forces_and_moments(given, dimension, expected):
    found = names_of({"units": given}, dimension)
    assert {name: unit for name, unit in found.items() if name in ("moment", *expected)} == expected
    assert found.get("length") == given.get("length")


def test_labels():
    assert (unit_of(0, "stress"), bracketed("stress"), with_unit("3", "stress")) == ("", "", "3")
    with labelled({"stress": "MPa"}):
        assert unit_of(0, "stress") == " (MPa)"
        assert unit_of(-4, "stress") == " (unit 10⁴ MPa)"
        assert unit_of(-4, "length") == " (unit 10⁴)"
        assert with_unit("3", "stress") == "3 MPa"
        assert with_unit("", "stress") == ""
    assert unit_of(0, "stress") == ""


@pytest.mark.slow
def test_the_page_has_units_and_the_tables_do_not_change(tmp_path):
    scene = example1(coefficient=0.3, nx=12, ny=4)
    named = scene.model_copy(update={"units": Units(length="mm", stress="MPa")})
    for folder, one in (("bare", scene), ("named", named)):
        write_results(alone(one), tmp_path / folder, fields=False, pictures=True)
    summaries = [summary_in(tmp_path / name) for name in ("bare", "named")]
    assert summaries[0]["max_pressure"] == summaries[1]["max_pressure"]
    assert (tmp_path / "bare/contact.csv").read_bytes() == (
        tmp_path / "named/contact.csv"
    ).read_bytes()
    assert (tmp_path / "bare/profiles.png").read_bytes() != (
        tmp_path / "named/profiles.png"
    ).read_bytes()
    bare, text = (re.sub(r"<[^>]*>", " ", page(tmp_path / name)) for name in ("bare", "named"))
    assert re.search(r"largest pressure [\d.]+ \+- [\d.]+ MPa", text)
    assert "(0, 20) N/mm" in text
    assert "Units are those of the scene" in bare
    assert "Units: length mm, stress MPa, " in text
    assert "MPa" not in bare


def test_what_is_no_unit_is_refused():
    data = example1(nx=12, ny=4).model_dump()
    with pytest.raises(SceneError, match=r"units\.length"):
        parse_scene(data | {"units": {"length": 3}})
