"""Guaranteed bounds of scenes with several bodies, each of which is held, or rests on its foundation, on its own."""

import numpy as np
import pytest
from scenes import alone

from signorini_fx.mechanics.laws.coulomb import Coulomb
from signorini_fx.results.files import write_results
from signorini_fx.results.summary import lines_of
from signorini_fx.scenes.reading import parse_scene

LOOSE = "a mean displacement has bounds where supports hold the body without its contact"


def blocks(load=1.0, *, nx=6, cell="triangle", names=("a", "b"), young=1000.0):
    """Block a is clamped at its left end, block b rests on its foundation; beside each other, or only one of them."""
    parameters = {"nx": nx, "ny": max(nx // 2, 2), "length": 1.0, "height": 0.5, "cell": cell}
    generator = "rectangle"
    if cell == "tetrahedron":
        generator, parameters = "box", parameters | {"width": 0.5, "nz": 2, "ny": 2, "nx": 3}
    mesh = {"generator": generator, "parameters": parameters}
    space = cell == "tetrahedron"
    normal = "z" if space else "y"
    aside = {"x": 0.0} | ({"y": 0.0} if space else {})
    whole = {
        "a": {
            "displacement": [{"boundary": "a.left", "x": 0.0, "y": 0.0} | ({"z": 0.0} if space else {})],
            "traction": [{"boundary": "a.top", normal: -1.0}],
            "contact": [],
        },
        "b": {
            "displacement": [{"boundary": "b.left", **aside}],
            "traction": [{"boundary": "b.top", normal: f"-{load}*(1 + x[0])"}],
            "contact": [{"boundary": "b.bottom"}],
        },
    }
    scene = {
        "body": [{"name": name, "mesh": mesh, "shift": [2.0 * (name == "b")] + [0.0] * (1 + space)} for name in names],
        "material": [{"region": "b", "young": young, "poisson": 0.3}, {"region": "a", "young": 1000.0, "poisson": 0.3}],
        "solver": {"algorithm": "exact"},
    }
    scene["material"] = [one for one in scene["material"] if one["region"] in names]
    for key in ("displacement", "traction", "contact"):
        scene[key] = [one for name in names for one in whole[name][key]]
    return parse_scene(scene)


@pytest.mark.one_quick
@pytest.mark.parametrize("load", [1.0, 1e-8])
def test_a_body_beside_another_one_has_the_bounds_that_it_has_alone(load):
    """However small its loads are beside those of the other one, which moves with nothing of it."""
    both, b = alone(blocks(load)), alone(blocks(load, names=("b",)))
    weight = 3.5 * load
    low, high = both.force_bounds("b.bottom", (0.0, 1.0))
    assert low <= weight <= high
    assert high - low < 1e-9 * weight
    np.testing.assert_allclose((low, high), b.force_bounds("b.bottom", (0.0, 1.0)), rtol=1e-9)
    aside = both.force_bounds("b.left", (1.0, 0.0))
    assert aside[0] <= 0 <= aside[1]
    assert aside[1] - aside[0] < 1e-9 * weight
    # The squares of the bounds of both bodies add up.
    a = alone(blocks(names=("a",))).error_bound.error
    assert both.error_bound.error == pytest.approx(np.hypot(a, b.error_bound.error), rel=1e-6)


@pytest.mark.one_quick
@pytest.mark.parametrize("nx", [5, 13, 20])
def test_means_are_bounded_of_what_supports_hold(nx):
    """Not of what only its contact holds, whatever the round-off of its mesh is; the other body is as it is alone."""
    both = alone(blocks(nx=nx))
    assert both.mean_displacement_bounds("b.right", (0.0, 1.0)) == LOOSE
    found = both.mean_displacement_bounds("a.right", (0.0, 1.0))
    reference = alone(blocks(nx=nx, names=("a",))).mean_displacement_bounds("a.right", (0.0, 1.0))
    np.testing.assert_allclose(found, reference, rtol=1e-6)


def test_pieces_of_unequal_stiffness():
    """What ties a piece that moves freely is as stiff as this piece."""
    both = alone(blocks(young=1e-3, load=1e-6))
    low, high = both.force_bounds("b.bottom", (0.0, 1.0))
    assert low <= 3.5e-6 <= high
    assert high - low < 1e-9 * 3.5e-6


@pytest.mark.one_quick
@pytest.mark.parametrize("load", [1.0, 1e-8])
def test_bounds_of_pieces_in_space(load):
    """The squares of the bounds of both bodies add up."""
    both, *each = (
        alone(blocks(load, cell="tetrahedron", names=names)).error_bound for names in (("a", "b"), ("a",), ("b",))
    )
    assert both.error == pytest.approx(np.hypot(*(one.error for one in each)), rel=1e-6)
    assert both.size == pytest.approx(np.hypot(*(one.size for one in each)), rel=1e-9)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["error_bound", "safety"])
def test_a_statement_that_fails_costs_no_result(tmp_path, monkeypatch, name):
    """The results are written, with a warning that names it."""
    scene = blocks(names=("b",))
    contact = scene.contact[0].model_copy(update={"friction": Coulomb(law="coulomb", coefficient=0.1)})
    solver = scene.solver.model_copy(update={"error_bound": True, "algorithm": "auto"})
    solution = alone(scene.model_copy(update={"contact": (contact,), "solver": solver}))

    def fails(self):
        raise ArithmeticError("a factorisation broke down")

    monkeypatch.setattr(type(solution), name, property(fails))
    summary = write_results(solution, tmp_path / "results", pictures=False)
    warned = [found for found in summary["findings"] if "a factorisation broke down" in found["message"]]
    assert [found["path"] for found in warned] == [name]
    assert summary["converged"]
    assert (tmp_path / "results" / "contact.csv").is_file()
    assert "a factorisation broke down" in "\n".join(map(str, lines_of(summary)))
