"""Outcomes that a solve seldom has, in reports: which one it is, what to do, and no figure that nobody may use."""

from typing import ClassVar, Literal

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import example1

from signorini_fx import FrictionLaw, Parameter, solve, write_results
from signorini_fx.addons.report.page import write_report
from signorini_fx.algebra.linalg import krylov
from signorini_fx.algebra.linalg.full import FullSystem
from signorini_fx.records import Status


class Odd(FrictionLaw):
    """Coulomb's law but at the pressures 6.7 to 7.1, none of which is tried before the solve."""

    law: Literal["odd"] = "odd"
    coefficient: Parameter
    factor: ClassVar[float] = 1.0

    def limit(self, pressure):
        within = (pressure > 6.7) & (pressure < 7.1)
        return self.coefficient * pressure * np.where(within, self.factor, 1.0)

    def derivative(self, pressure):
        return self.coefficient * np.ones_like(pressure)


def fails_by(error, monkeypatch):
    def keep(self, *args, **how):
        raise error

    monkeypatch.setattr(FullSystem, "keep_factor", keep)


def scene_of(status, monkeypatch):
    """A scene that ends so, by a fault put in where no scene does."""
    scene = example1(coefficient=0.3, nx=30, ny=10)
    if status in (Status.NOT_FINITE, Status.NOT_CERTIFIED):
        if status is Status.NOT_FINITE:
            monkeypatch.setattr(Odd, "factor", np.nan)
        else:
            monkeypatch.setattr("signorini_fx.results.certificate.certificate.CERTIFICATE_TOLERANCE", 0.0)
        contact = scene.contact[0].model_copy(update={"friction": Odd(0.3)})
        return scene.model_copy(update={"contact": (contact,)})
    if status is Status.LINEAR_SOLVER:
        monkeypatch.setattr(krylov, "KRYLOV_STEPS", 2)
        monkeypatch.setattr(krylov, "enough_memory", lambda *_: False)
        return example1(bound=1.5, nx=30, ny=10, linear_algebra="krylov")
    fails_by(MemoryError() if status is Status.NO_MEMORY else PETSc.Error(76), monkeypatch)
    return example1(bound=1.5, nx=6, ny=2, linear_algebra="full")


@pytest.mark.slow
@pytest.mark.parametrize(
    "status",
    [Status.NOT_FINITE, Status.NOT_CERTIFIED, Status.LINEAR_SOLVER, Status.NO_MEMORY, Status.SINGULAR],
)
def test_a_solve_that_fails_has_a_report(status, monkeypatch, tmp_path):
    """Outcome, advice and the four answers, of which none has a figure."""
    solution = solve(scene_of(status, monkeypatch), MPI.COMM_SELF, check=False)
    assert solution.status is status
    write_results(solution, tmp_path / "result", pictures=False, fields=False)
    page = write_report(tmp_path / "result").read_text(encoding="utf-8")
    assert f"<strong>{status.value}</strong>" in page
    assert "<h1>result</h1>" in page  # the name of the folder, as the scene has no title
    assert "What to do" in page
    own = status in (Status.NOT_FINITE, Status.NOT_CERTIFIED)
    assert ("it may also be that Odd contradicts itself where it was not tried" in page) == own
    assert page.count("not known") >= 2
    nothing = "Nothing was solved, so there are no figures" in page
    assert nothing == (status in (Status.LINEAR_SOLVER, Status.NO_MEMORY, Status.SINGULAR))
    assert page.count("Of the last iterate, which is no solution.") == (0 if nothing else 1)  # without pictures
    # What was never computed cannot violate a condition, nor be warned of.
    assert ("there is no figure" in page) == nothing
    assert ("no figure may be used" in page) == ("the certificate does NOT hold" in page) == (not nothing)
    assert "<h2>Figures</h2>" not in page
