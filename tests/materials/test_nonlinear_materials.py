"""Nonlinear materials at points: their energies and stresses, and what is found of materials of a
user's own.
"""

from typing import ClassVar, Literal

import numpy as np
import pytest
import ufl
from pydantic import TypeAdapter
from scenes import alone
from support.nonlinear_scenes import LAWS, block, force, material
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

from signorini_fx import Hyperelastic, PathDependent, SceneError, extensions
from signorini_fx.extensions import MATERIALS
from signorini_fx.mechanics.effects.material import Entry as OneMaterial
from signorini_fx.mechanics.materials.trial import fault_of


def named(name, **changes):
    """One of the materials of the tests."""
    return TypeAdapter(OneMaterial).validate_python(material(name, **changes))


@pytest.mark.one_quick("name", LAWS)
def test_what_they_say_of_themselves(name):
    """The energy does not change when the body turns, and has the moduli at rest; the stress of
    metal has its derivative.
    """
    assert fault_of(named(name)) == ""
    assert fault_of(named("j2", yield_stress=0.1, hardening=[[0.001, 0.3], [0.05, 0.5]])) == ""


def test_flow_that_ends_at_a_row():
    """Metal whose flow ends at a point of its table, to round-off, has the yield stress of that
    point, with the same plastic strain.
    """
    rows = np.array([[0.0031, 0.37], [0.0123, 0.61], [0.0255, 0.61]])
    for young in np.linspace(30.0, 90.0, 25):
        metal = named("j2", young=young, yield_stress=0.1, hardening=rows.tolist())
        shear, _ = metal.constants_at_rest
        angle = (
            (rows[:, 1] / (3 * shear) + rows[:, 0]) * np.sqrt(3) / 2
        )  # of simple shear, half of it
        angle = (angle[:, None] * (1 + np.finfo(float).eps * np.arange(-4, 5))).ravel()
        strain = np.zeros((angle.size, 3, 3))
        strain[:, 0, 1] = strain[:, 1, 0] = angle
        stress, _, state = metal.respond(strain, np.zeros((angle.size, metal.state_size)))
        reached, yields = np.repeat(rows, 9, axis=0).T
        assert np.allclose(metal.plastic_strain(state), reached, rtol=1e-12)
        assert np.allclose(np.sqrt(3) * stress[:, 0, 1], yields, rtol=1e-12)


MU, LAME, KAPPA = 100.0 / 2.6, 300.0 / 5.2, 50.0
ENERGIES = {
    "neo-hooke": (
        {"young": 100.0, "poisson": 0.3},
        lambda s, J: MU / 2 * (np.sum(s**2) - 3) - MU * np.log(J) + LAME / 2 * np.log(J) ** 2,
    ),
    "neo-hooke, isochoric": (
        {"young": 100.0, "poisson": 0.3, "isochoric": True},
        lambda s, J: (
            MU / 2 * (J ** (-2 / 3) * np.sum(s**2) - 3) + (LAME + 2 * MU / 3) / 2 * (J - 1) ** 2
        ),
    ),
    "mooney-rivlin": (
        {"c10": 7.0, "c01": 3.0, "bulk": KAPPA},
        lambda s, J: (
            7 * (J ** (-2 / 3) * np.sum(s**2) - 3)
            + 3 * (J ** (-4 / 3) * np.sum((J / s) ** 2) - 3)
            + KAPPA / 2 * (J - 1) ** 2
        ),
    ),
    "ogden": (
        {"mu": [3.0, -0.4], "alpha": [1.7, -2.0], "bulk": KAPPA},
        lambda s, J: (
            sum(
                m / a * (np.sum((s * J ** (-1 / 3)) ** a) - 3)
                for m, a in ((3.0, 1.7), (-0.4, -2.0))
            )
            + KAPPA / 2 * (J - 1) ** 2
        ),
    ),
    "saint-venant-kirchhoff": (
        {"young": 100.0, "poisson": 0.3},
        lambda s, J: MU * np.sum((s**2 - 1) ** 2) / 4 + LAME / 2 * (np.sum(s**2 - 1) / 2) ** 2,
    ),
}


@pytest.mark.parametrize("law", ENERGIES)
@pytest.mark.parametrize("stretches", [(1.3, 0.8, 1.1), (1.001, 0.9995, 1.0), (0.6, 1.9, 1.9)])
def test_energies_of_stretches(law, stretches):
    """By their formulas in principal stretches, of a body that turns before and after."""
    constants, formula = ENERGIES[law]
    made = TypeAdapter(OneMaterial).validate_python({"law": law.partition(",")[0], **constants})
    first, second = (
        [[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]] for a in (0.4, -1.1)
    )
    change = np.array(first) @ np.diag(stretches) @ np.array(second) - np.eye(3)
    J = float(np.prod(stretches))
    energy = apply_algebra_lowering(made.shape_energy_by_change(ufl.as_matrix(change.tolist())))(())
    energy += apply_algebra_lowering(ufl.as_ufl(made.volume_energy_by_change(ufl.as_ufl(J - 1))))(
        ()
    )
    assert energy == pytest.approx(formula(np.array(stretches), J), rel=1e-9)


class Soft(Hyperelastic):
    """Hencky's material, whose energy is quadratic in the logarithms of the stretches of a body
    without shear.
    """

    law: Literal["soft"] = "soft"
    shear: float
    bulk: float

    @property
    def constants_at_rest(self):
        """Its constants."""
        return self.shear, self.bulk

    def shape_energy(self, gradient):
        """Of the neo-Hookean one."""
        import ufl

        return self.shear / 2 * (ufl.inner(gradient, gradient) * ufl.det(gradient) ** (-2 / 3) - 3)

    def volume_energy(self, volume):
        """Logarithmic."""
        import ufl

        return self.bulk / 2 * ufl.ln(volume) ** 2


WRONG = {
    "is not objective": {
        "shape_energy": lambda self, gradient: self.shear * (gradient[0, 0] - 1) ** 2
    },
    "has a stress without strain": {"volume_energy": lambda self, volume: self.bulk * volume},
    "is not finite": {
        "volume_energy": lambda self, volume: self.bulk * (volume - 1) ** 2 + float("nan")
    },
    "constants_at_rest of Wrong are not those of its energy": {
        "constants_at_rest": property(lambda self: (self.shear, 1.1 * self.bulk))
    },
    "both must be positive": {"constants_at_rest": property(lambda self: (self.shear, -self.bulk))},
    "inf.*both must be positive": {
        "constants_at_rest": property(lambda self: (self.shear, float("inf")))
    },
    "must define all methods": {"shape_energy": Hyperelastic.shape_energy},
    "fails: ZeroDivisionError": {"volume_energy": lambda self, volume: 1 / 0},
}


def test_a_material_of_ones_own(monkeypatch):
    """Of another package, by its name in a scene: a block of it has the force of a neo-Hookean one
    at first.
    """
    monkeypatch.setattr(extensions, "_registered", {MATERIALS: {"soft": Soft}})
    law = {"law": "soft", "shear": 3.0, "bulk": 10.0}
    (step,) = alone(block(law, "1e-4*t")).steps
    plane = 4 * 3.0 * (10.0 + 1.0) / (10.0 + 4.0)
    assert force(step)[1] == pytest.approx(-plane * 1e-4, rel=1e-3)


@pytest.mark.parametrize("message", WRONG)
def test_what_is_found_of_it(message, monkeypatch):
    """Before anything is solved."""
    wrong = type("Wrong", (Soft,), WRONG[message])
    monkeypatch.setattr(extensions, "_registered", {MATERIALS: {"soft": wrong}})
    with pytest.raises(SceneError, match="material.*" + message):
        alone(block({"law": "soft", "shear": 3.0, "bulk": 10.0}, "0.1*t"))


def test_a_path_dependent_one_of_ones_own():
    """A tangent that is not the derivative, and a stress that has a mean."""
    metal = named("j2", yield_stress=0.5)

    class Wrong(type(metal)):
        fault: ClassVar[str] = ""

        def respond(self, strain, state):
            stress, tangent, after = super().respond(strain, state)
            if self.fault == "mean":
                stress = stress + 1e-3 * np.eye(3)
            return stress, tangent * (1.1 if self.fault == "tangent" else 1.0), after

    constants = metal.model_dump(exclude_unset=True)
    assert issubclass(Wrong, PathDependent)
    for fault, words in (
        ("", ""),
        ("mean", "not deviatoric"),
        ("tangent", "is not that of its stress"),
    ):
        Wrong.fault = fault
        assert words in fault_of(Wrong(**constants))
        assert bool(fault_of(Wrong(**constants))) == bool(fault)
