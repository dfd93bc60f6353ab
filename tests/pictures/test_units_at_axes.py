"""Figures at an axis: what is written there, times the unit of the label, is the quantity itself."""

import re

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from signorini_fx.addons.pictures import boundary_profiles, load_steps
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.pictures.tones import Tones

mpl.use("Agg")


def unit_in(label):
    """What one unit at the axis stands for."""
    found = re.search(r"\s\(unit \$10\^\{(-?\d+)\}\$\)$", label)
    return 10.0 ** int(found.group(1)) if found else 1.0


@pytest.fixture
def drawn(monkeypatch):
    """The figures that were made."""
    figures = []
    for module in (boundary_profiles, load_steps):
        monkeypatch.setattr(module, "finish", lambda figure, *_: figures.append(figure))
    return figures


@pytest.mark.parametrize("size", [3e-6, 2.0, 4e7])
def test_curves_along_a_boundary(drawn, size):
    s = np.linspace(0.0, 1.0, 5)
    numbers = dict.fromkeys(("gap", "u_n", "u_t", "pressure", "shear", "bound", "y"), np.zeros(5))
    table = numbers | {"x": s, "s": s, "pressure": size * np.array([0.0, 1.0, 2.0, 1.0, 0.0])}
    table |= {name: np.full(5, text) for name, text in (("state", "slip+"), ("friction", "slip+"), ("boundary", "a"))}
    boundary_profiles.boundary_profiles("unused", table)
    axes = drawn[0].axes[0]
    curve = next(line for line in axes.lines if "contact pressure" in line.get_label())
    np.testing.assert_allclose(curve.get_ydata() * unit_in(axes.get_ylabel()), table["pressure"], rtol=1e-12)
    assert 1e-3 <= np.abs(curve.get_ydata()).max() < 1e4


def test_forces_of_load_steps(drawn):
    time = np.array([1.0, 2.0])
    table = {name: np.zeros(2) for name in ("contact_force_x", "friction_force_y")}
    table |= {"time": time, "name": np.array(["", ""]), "status": np.array(["converged"] * 2)}
    table |= {"contact_force_y": 5e6 * time, "friction_force_x": 1e6 * time}
    table["mean_tangential_displacement"] = 2e-5 * time
    load_steps.load_steps("unused", table)
    upper, lower = drawn[0].axes
    np.testing.assert_allclose(upper.lines[0].get_ydata() * unit_in(upper.get_ylabel()), 5e6 * time, rtol=1e-12)
    np.testing.assert_allclose(lower.lines[0].get_xdata() * unit_in(lower.get_xlabel()), 2e-5 * time, rtol=1e-12)
    np.testing.assert_allclose(lower.lines[0].get_ydata() * unit_in(lower.get_ylabel()), 1e6 * time, rtol=1e-12)


def test_colour_bar():
    values = np.array([0.0, 2e8])
    figure = Figure()
    bar = Tones(FIELDS["von_mises"], values, np.ones(2), top=2e8).bar(figure, figure.add_subplot())
    assert bar.vmax == pytest.approx(2.0)
    assert bar.vmax * unit_in(bar.ax.get_xlabel()) == pytest.approx(2e8)
