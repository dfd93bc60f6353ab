"""Nonlinear materials at points: their two opinions of stress, and what is found of materials of a user's own."""

from typing import ClassVar, Literal

import numpy as np
import pytest
from mpi4py import MPI
from pydantic import TypeAdapter
from support.nonlinear_scenes import LAWS, block, force, material

from signorini_fx import Hyperelastic, PathDependent, SceneError, extensions, solve
from signorini_fx.extensions import MATERIALS
from signorini_fx.mechanics.materials.registry import OneMaterial
from signorini_fx.mechanics.materials.trial import fault_of


def named(name, **changes):
    """One of the materials of the tests."""
    return TypeAdapter(OneMaterial).validate_python(material(name, **changes))


@pytest.mark.one_quick
@pytest.mark.parametrize("name", LAWS)
def test_both_opinions(name):
    """The stress is the derivative of the energy, does not rotate with the body, and has the moduli at rest; that of
    metal is the same by radial return and by bisection, with its derivative.
    """
    assert fault_of(named(name)) == ""
    assert fault_of(named("j2", yield_stress=0.1, hardening=[[0.001, 0.3], [0.05, 0.5]])) == ""


def test_flow_that_ends_at_a_row():
    """Metal whose flow ends at a point of its table, to round-off, has the yield stress of that point, with the same
    plastic strain by both opinions.
    """
    rows = np.array([[0.0031, 0.37], [0.0123, 0.61], [0.0255, 0.61]])
    for young in np.linspace(30.0, 90.0, 25):
        metal = named("j2", young=young, yield_stress=0.1, hardening=rows.tolist())
        shear, _ = metal.constants_at_rest
        angle = (rows[:, 1] / (3 * shear) + rows[:, 0]) * np.sqrt(3) / 2  # of simple shear, half of it
        angle = (angle[:, None] * (1 + np.finfo(float).eps * np.arange(-4, 5))).ravel()
        strain = np.zeros((angle.size, 3, 3))
        strain[:, 0, 1] = strain[:, 1, 0] = angle
        stress, _, state = metal.respond(strain, np.zeros((angle.size, metal.state_size)))
        reached, yields = np.repeat(rows, 9, axis=0).T
        assert np.allclose(metal.plastic_strain(state), reached, rtol=1e-12)
        assert np.allclose(np.sqrt(3) * stress[:, 0, 1], yields, rtol=1e-12)
        assert np.allclose(stress, metal.respond_at(strain, np.zeros_like(state)), rtol=1e-12)


class Soft(Hyperelastic):
    """Hencky's material, whose energy is quadratic in the logarithms of the stretches of a body without shear."""

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

    def shape_stress_at(self, gradient):
        """By the left stretches."""
        left = gradient @ gradient.swapaxes(-1, -2) * np.linalg.det(gradient)[..., None, None] ** (-2 / 3)
        mean = np.trace(left, axis1=-2, axis2=-1)[..., None, None] / 3
        return self.shear * (left - mean * np.eye(3)) @ np.linalg.inv(gradient).swapaxes(-1, -2)

    def volume_stress_at(self, volume):
        """Of the logarithm."""
        return self.bulk * np.log(volume) / volume


WRONG = {
    "is not the derivative of its shape_energy": {
        "shape_stress_at": lambda self, gradient: 1.01 * Soft.shape_stress_at(self, gradient)
    },
    "is not the derivative of its volume_energy": {"volume_stress_at": lambda self, volume: self.bulk * (volume - 1)},
    "constants_at_rest of Wrong are not those of its energy": {
        "constants_at_rest": property(lambda self: (self.shear, 1.1 * self.bulk))
    },
    "both must be positive": {"constants_at_rest": property(lambda self: (self.shear, -self.bulk))},
    "does not say all": {"shape_energy": Hyperelastic.shape_energy},
    "fails: ZeroDivisionError": {"volume_energy": lambda self, volume: 1 / 0},
}


def test_a_material_of_ones_own(monkeypatch):
    """Of another package, by its name in a scene: a block of it has the force of a neo-Hookean one at first."""
    monkeypatch.setattr(extensions, "_registered", {MATERIALS: {"soft": Soft}})
    law = {"law": "soft", "shear": 3.0, "bulk": 10.0}
    (step,) = solve(block(law, "1e-4*t"), MPI.COMM_SELF).steps
    plane = 4 * 3.0 * (10.0 + 1.0) / (10.0 + 4.0)
    assert force(step)[1] == pytest.approx(-plane * 1e-4, rel=1e-3)


@pytest.mark.parametrize("message", WRONG)
def test_what_is_found_of_it(message, monkeypatch):
    """Before anything is solved."""
    wrong = type("Wrong", (Soft,), WRONG[message])
    monkeypatch.setattr(extensions, "_registered", {MATERIALS: {"soft": wrong}})
    with pytest.raises(SceneError, match="material.*" + message):
        solve(block({"law": "soft", "shear": 3.0, "bulk": 10.0}, "0.1*t"), MPI.COMM_SELF)


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

    constants = metal.model_dump(exclude={"poisson_grading"}, exclude_unset=True)
    assert issubclass(Wrong, PathDependent)
    for fault, words in (("", ""), ("mean", "not deviatoric"), ("tangent", "is not that of its stress")):
        Wrong.fault = fault
        assert words in fault_of(Wrong(**constants))
        assert bool(fault_of(Wrong(**constants))) == bool(fault)
