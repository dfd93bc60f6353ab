"""A material from outside the package, demos/extensions/material.py, beside the orthotropic one
with its constants.
"""

import runpy
from pathlib import Path

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scenes import alone
from steel_blocks import body, pushed_down

from signorini_fx import InstallationError, SceneError, extensions, solve
from signorini_fx.extensions import MATERIALS
from signorini_fx.mechanics.materials.protocol import Material

DEMO = Path(__file__).parents[2] / "demos" / "extensions" / "material.py"
COMM = MPI.COMM_WORLD
Fibres = runpy.run_path(str(DEMO))["Fibres"]
MODULI = {"n": 9000.0, "c": 1500.0, "k": 2000.0, "m": 600.0, "p": 900.0}
AXES = {2: {"direction": [1.0, 0.5]}, 3: {"direction": [1.0, 0.5, -0.3], "second": [0.2, 1.0, 0.7]}}


@pytest.fixture(autouse=True)
def _registered(monkeypatch):
    """For one test."""
    monkeypatch.setattr(extensions, "_registered", {MATERIALS: {"fibres": Fibres}})


def hill(n, c, k, m, p):
    """Young's moduli, Poisson's ratios and shear moduli by R. Hill, J. Mech. Phys. Solids 12 (1964)
    199-212.
    """
    along = n - c**2 / k
    across = 4 * m * (k * n - c**2) / (k * n - c**2 + m * n)
    nu, nu_across = c / (2 * k), across / (2 * m) - 1
    return {"young": [along, across, across], "poisson": [nu, nu, nu_across], "shear": [p, p, m]}


def own(dimension, kind=Fibres, **more):
    """The material of the demo."""
    return kind(**MODULI, **AXES[dimension], **more)


def orthotropic(dimension, **more):
    """The same once more."""
    return {"orthotropic": hill(**MODULI) | AXES[dimension], **more}


@pytest.mark.mpi
@pytest.mark.one_quick(
    "hypothesis", ["plane strain", "plane stress", "axisymmetric", None], ids=str
)
def test_as_the_orthotropic_one(hypothesis):
    """Displacement, recovered stress, energies, and iterations; with heat, and in 3D."""
    tagged = body("tetrahedra" if hypothesis is None else "triangle")
    more = {} if hypothesis is None else {"hypothesis": hypothesis}
    dimension = tagged.dimension
    held = {"displacement": [{"boundary": "left", "x": 0.0}], "temperature": {"change": 3.0}}
    first, second = (
        solve(pushed_down(tagged, material, **held), COMM)
        for material in (
            own(dimension, **more, expansion=1e-4),
            orthotropic(dimension, **more, expansion=1e-4),
        )
    )
    assert first.certificate.holds
    assert len(first.history.iterations) == len(second.history.iterations)
    size = np.abs(second.displacement.x.array).max()
    np.testing.assert_allclose(
        first.displacement.x.array, second.displacement.x.array, atol=1e-9 * size
    )
    stresses = [solution.stress.recovered.tensor.x.array for solution in (first, second)]
    np.testing.assert_allclose(*stresses, atol=1e-8 * np.abs(stresses[1]).max())
    assert first.certificate.strain_energy == pytest.approx(
        second.certificate.strain_energy, rel=1e-9
    )


def lying(**methods):
    """The material of the demo with other methods."""
    return type("Lying", (Fibres,), {"__module__": __name__, **methods})


def constant(value):
    """A property."""
    return property(lambda _: value)


def halved(self, x):
    """Axes that are half as long."""
    return 0.5 * Fibres.axes(self, x)


def isotropic(self, strain):
    """An isotropic stress."""
    return 2 * strain + ufl.tr(strain) * ufl.Identity(3)


@pytest.mark.parametrize(
    ("methods", "message"),
    [
        ({"stress": lambda law, e: law.p * e * np.nan}, "stress of Lying is not finite"),
        ({"stress": lambda law, e: -law.p * e}, "does no work on some strain"),
        ({"stress": lambda law, e: law.p * e * (2 + e[0, 0])}, "no linear function of the strain"),
        ({"stress": lambda law, e: law.p * e + law.m}, "Lying fails: ValueError"),
        ({"stress": Material.stress}, r"Lying must define stress\(\)"),
        ({"isotropic": constant(True)}, "Lying.isotropic is True, but its stress depends"),
        ({"isotropic": True, "stress": isotropic}, "derive it from LinearElastic"),
        ({"free_strain": constant((1.0, np.inf, 1.0))}, "free_strain of Lying"),
        ({"axes": halved}, "must be unit vectors at right angles"),
        ({"axes": lambda *_: np.eye(3)}, "must have the shape"),
    ],
)
def test_materials_that_are_not_what_they_say(methods, message):
    """Are refused by name before anything is assembled."""
    scene = pushed_down(body("triangle", comm=MPI.COMM_SELF), own(2, lying(**methods)))
    with pytest.raises(SceneError, match=message):
        alone(scene)


def test_by_name():
    """As a scene file has it; wrong names, wrong keys and what is no material are named."""
    table = {"law": "fibres", **MODULI, "direction": [1.0, 0.5]}
    assert pushed_down(body(), table).material[0] == own(2)
    for wrong, message in (
        ({"law": "fibre"}, r"material.*there is no material 'fibre'.*fibres"),
        ({**table, "n": "many"}, r"material.*n: must be a number"),
        ({**table, "young": 1.0}, r"material.*young: unknown key"),
    ):
        with pytest.raises(SceneError, match=message):
            pushed_down(body(), wrong)
    extensions.register(MATERIALS, "fibres", dict)
    with pytest.raises(InstallationError, match="is not a Material"):
        pushed_down(body(), table)
