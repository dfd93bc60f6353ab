"""The mutation check: small mistakes put into a copy of the package one at a time; the tests must notice each.

    ./env python3 -m stability.mutants [--quick] [--only WORD,...] [--out DIR]        (make mutants)

A mutant replaces one piece of text, which must occur exactly once, so that a list that no longer fits the code is an
error and no silent success.  The tests that are quick and matter run against the copy until one fails.  What survives
is listed; exit code 1 if anything does.
"""

from __future__ import annotations

import argparse
import csv
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
# Those that are likely to notice come first, and none of them takes longer than some seconds.
TESTS = (
    "complementarity", "algorithms", "patch", "oracle", "example1", "outcomes", "effects", "forms", "load_steps",
    "invariances", "manufactured", "hertz", "scene", "expressions", "mesh_errors", "ranks", "patch_anywhere",
    "price_list", "paper", "certificate", "nodal_forces", "augmentation", "coulomb_ways",
    "accuracy", "refinement", "boundary_levels", "inexact",
)  # fmt: skip
_SECONDS = 600.0
CAUGHT, SURVIVES, HANGS = "caught", "SURVIVES", "time limit passed"


@dataclass(frozen=True)
class Mutant:
    """A mistake.

    Attributes:
        file: module of the package.
        old: text that occurs exactly once in it.
        new: what takes its place.
        idea: the mistake in words.
    """

    file: str
    old: str
    new: str
    idea: str

    def spoil(self, package: Path) -> None:
        """Put the mistake into a copy of the package.

        Raises:
            ValueError: the list does not fit the code.
        """
        path = package / self.file
        text = path.read_text(encoding="utf-8")
        if text.count(self.old) != 1:
            raise ValueError(f"{self.file}: {self.old!r} occurs {text.count(self.old)} times, not once")
        path.write_text(text.replace(self.old, self.new), encoding="utf-8")


MUTANTS = (
    # The pointwise maps.
    Mutant("complementarity.py", "data.gamma_n * (u_n - data.gap)", "data.gamma_n * (u_n + data.gap)", "gap, sign"),
    Mutant(
        "complementarity.py",
        "np.where(sets.contact, trial_pressure(u_n, data), 0.0)",
        "trial_pressure(u_n, data)",
        "open nodes are pulled: max dropped",
    ),
    Mutant(
        "complementarity.py",
        "data.mu_hat + data.gamma_t * slip_of(u_t, data)\n    return pressure",
        "data.mu_hat - data.gamma_t * slip_of(u_t, data)\n    return pressure",
        "friction drives the slip: sign",
    ),
    Mutant(
        "complementarity.py",
        "return sets.slip * np.where(sets.slip == 0, 0.0, bound)",
        "return -sets.slip * np.where(sets.slip == 0, 0.0, bound)",
        "slip sets swapped",
    ),
    Mutant(
        "complementarity.py",
        "plus = (mu > bound) | ((mu == bound) & (xi > 0))",
        "plus = mu > bound",
        "a slip node never stays in its set",
    ),
    Mutant(
        "complementarity.py",
        "minus = (mu < -bound) | ((mu == -bound) & (xi < 0))",
        "minus = (mu < -bound) | ((mu == -bound) & (xi > 0))",
        "slip against mu is kept",
    ),
    Mutant(
        "complementarity.py",
        "plus = xi + data.sigma * (mu - bound) > 0",
        "plus = xi + data.sigma * (mu + bound) > 0",
        "finite sigma: wrong bound",
    ),
    Mutant(
        "complementarity.py",
        "self.bound + self.coupling * np.maximum(pressure, 0.0)",
        "self.bound + self.coupling * pressure",
        "friction bound of a negative pressure",
    ),
    Mutant(
        "complementarity.py",
        "normal = np.where(sets.contact, data.gamma_n, 0.0)",
        "normal = np.where(~sets.contact, data.gamma_n, 0.0)",
        "tangent: contact set swapped",
    ),
    Mutant(
        "complementarity.py",
        "tangential = np.where(sets.slip == 0, data.gamma_t, 0.0)",
        "tangential = np.where(sets.slip == 0, data.gamma_n, 0.0)",
        "tangent: gamma_n for gamma_t",
    ),
    Mutant(
        "complementarity.py",
        "None if data.coupling is None else sets.slip * data.coupling * normal",
        "None if data.coupling is None else -sets.slip * data.coupling * normal",
        "monolithic tangent: sign of F",
    ),
    Mutant(
        "complementarity.py",
        "pressure = pushing if data.bilateral",
        "pressure = pressure if data.bilateral",
        "projection drops its max",
    ),
    Mutant(
        "complementarity.py", "np.clip(shear, -bound, bound)", "np.minimum(shear, bound)", "projection clips one side"
    ),
    Mutant(
        "complementarity.py",
        "self.given + self.coefficient * np.abs(pressure)",
        "self.given + self.coefficient * pressure",
        "bilateral Coulomb: |lambda| dropped",
    ),
    Mutant("complementarity.py", "np.minimum(bound, self.cap)", "np.maximum(bound, self.cap)", "cap: min for max"),
    Mutant("complementarity.py", "contact | data.bilateral", "contact", "bilateral contact may open"),
    Mutant("complementarity.py", "u_t - data.slip_origin", "u_t", "load steps: slip from zero"),
    # The data of a scene.
    Mutant(
        "contact_data.py",
        'coefficient[here] = _nodal(value, boundary, here, f"{path}.coefficient", minimum=0.0)',
        'given[here] = _nodal(value, boundary, here, f"{path}.coefficient", minimum=0.0)',
        "Coulomb taken for Tresca",
    ),
    Mutant(
        "contact_data.py",
        'gamma_t=automatic if settings.gamma_t == "auto" else settings.gamma_t',
        'gamma_t=automatic if settings.gamma_t == "auto" else settings.gamma_n',
        "gamma_t of the scene ignored",
    ),
    Mutant(
        "contact_data.py",
        'np.inf if settings.sigma == "auto" else settings.sigma',
        "np.inf",
        "sigma of the scene ignored",
    ),
    Mutant(
        "contact_data.py",
        "AUTOMATIC_GAMMA * scene.young / discretisation.tagged.size",
        "AUTOMATIC_GAMMA * scene.young",
        "automatic gamma without its length",
    ),
    Mutant(
        "contact_data.py",
        "~np.isfinite(values) | (values < minimum)",
        "~np.isfinite(values)",
        "negative friction is let in",
    ),
    # The boundary.
    Mutant(
        "boundary.py",
        "np.column_stack((-self.normal[:, 1], self.normal[:, 0]))",
        "np.column_stack((self.normal[:, 1], self.normal[:, 0]))",
        "tangent not orthogonal",
    ),
    Mutant(
        "boundary.py",
        "(self.weight * shear)[:, None] * self.tangent",
        "shear[:, None] * self.tangent",
        "shear without its weight",
    ),
    Mutant(
        "boundary.py",
        "normal = np.tile(np.asarray(direction) / np.hypot(*direction), (nodes.size, 1))",
        "normal = np.tile(np.asarray(direction), (nodes.size, 1))",
        "direction not made a unit vector",
    ),
    Mutant(
        "boundary.py",
        "free=~fixed.reshape(-1, 2)[nodes]",
        "free=np.ones((nodes.size, 2), dtype=bool)",
        "contact acts on prescribed components",
    ),
    Mutant("boundary.py", "np.dot(self.weight, values**2)", "np.dot(self.weight, np.abs(values))", "norm: no square"),
    # The forms.
    Mutant(
        "forms.py",
        "volumetric = lame * ufl.tr(strain(y)) * ufl.tr(strain(z))",
        "volumetric = mu * ufl.tr(strain(y)) * ufl.tr(strain(z))",
        "reduced element: mu for lambda",
    ),
    Mutant("forms.py", "return ufl.inner(traction, z) * ds", "return -ufl.inner(traction, z) * ds", "traction, sign"),
    Mutant("forms.py", "return ufl.inner(force, z)", "return -ufl.inner(force, z)", "body force, sign"),
    Mutant(
        "forms.py",
        '{"quadrature_rule": "vertex", "quadrature_degree": 1}',
        '{"quadrature_degree": 2}',
        "Gauss points instead of the nodes",
    ),
    Mutant(
        "material.py", 'if material.hypothesis == "plane stress":', "if False:", "plane stress taken for plane strain"
    ),
    Mutant(
        "loads.py",
        "traction -= _ufl_value(load.pressure, space)",
        "traction += _ufl_value(load.pressure, space)",
        "pressure pulls",
    ),
    Mutant(
        "loads.py",
        "load.axpy(-1.0, action(elastic, prescribed, blocks))",
        "load.axpy(1.0, action(elastic, prescribed, blocks))",
        "lifting, sign",
    ),
    Mutant(
        "supports.py",
        "sign * value if isinstance(value, float)",
        "value if isinstance(value, float)",
        "normal support without its sign",
    ),
    # The exact limit.
    Mutant(
        "exact.py",
        "np.where(self.sets.contact, pressure > 0, u_n > self.data.gap)",
        "np.where(self.sets.contact, pressure > 0, u_n < self.data.gap)",
        "open nodes close where they are apart",
    ),
    Mutant(
        "exact.py",
        "np.where(self.sets.contact, pressure > 0, u_n > self.data.gap)",
        "self.sets.contact | (u_n > self.data.gap)",
        "contact is never given up",
    ),
    Mutant("exact.py", "np.where(slip * moved < 0, 0, slip)", "slip", "slip is never given up"),
    Mutant("exact.py", "(self._n_sign * self.data.gap)[normal]", "self.data.gap[normal]", "gap without its direction"),
    Mutant("exact.py", "(self._t_sign * origin)[stick]", "np.zeros(stick.size)[stick]", "stick forgets its origin"),
    # The algorithms.
    Mutant("algorithms/ssn.py", "elif fingerprint in self._seen:", "elif False:", "cycles are not seen"),
    Mutant("algorithms/ssn.py", "if residual <= snes.getTolerances()[0]:", "if True:", "residual is not looked at"),
    Mutant("algorithms/ssn.py", "if problem.kept:", "if False:", "sets that were forced count as found"),
    Mutant(
        "algorithms/ssn.py",
        "problem.moved if self._may_keep or problem.moved == 0 else None",
        "0",
        "the first factor is kept for ever",
    ),
    Mutant("algorithms/ssn.py", "if problem.loose is not None:", "if False:", "a loose body is not seen"),
    Mutant(
        "algorithms/augmentation.py",
        "max(self.left, self.violation) <= self.tolerance",
        "True",
        "ALM-FP ends with the pressure",
    ),
    Mutant(
        "algorithms/fp.py",
        "change = norm(following - g) / size",
        "change = norm(following - following) / size",
        "fixed point stops at once",
    ),
    Mutant(
        "algorithms/fp.py",
        "replace(data, bound=law.bound(g))",
        "replace(data, bound=law.bound(start[0]))",
        "the bound is never updated",
    ),
    Mutant("algorithms/augmentation.py", "mu_hat=shear,", "mu_hat=data.mu_hat,", "ALM does not shift mu"),
    Mutant(
        "algorithms/augmentation.py", "lambda_hat=pressure,", "lambda_hat=data.lambda_hat,", "ALM does not shift lambda"
    ),
    Mutant(
        "algorithms/augmentation.py",
        "pressure, shear = self.newton.shifts(data)",
        "pressure, shear = self.newton.multipliers()",
        "inexact ALM does not project",
    ),
    Mutant(
        "algorithms/augmentation.py",
        "gamma_t=grown(data.gamma_t, self.slow[1])",
        "gamma_t=data.gamma_t",
        "gamma_t does not grow",
    ),
    Mutant("strategy.py", "state.copy(newton.x)", "pass", "fall-back from the diverged iterate"),
    Mutant(
        "algorithms/coulomb_newton.py",
        "coupling=law.coefficient",
        "coupling=0.5 * law.coefficient",
        "monolithic: half of F",
    ),
    Mutant(
        "algorithms/continuation.py",
        "gamma_t=gamma_t)\n        if step",
        "gamma_t=gamma_n)\n        if step",
        "continuation: gamma_n for gamma_t",
    ),
    Mutant("algorithms/path_following.py", "if left <= allowed or", "if", "path-following: never content"),
    Mutant(
        "algorithms/path_following.py",
        "ksp.solve(-2.0 * contact_force(first, nothing, nothing), second)",
        "ksp.solve(2.0 * contact_force(first, nothing, nothing), second)",
        "path-following: curvature, sign",
    ),
    Mutant(
        "algorithms/path_following.py",
        "reach * distance, reach * pressure_slope",
        "distance, pressure_slope",
        "path-following: distance without its reach",
    ),
    # Linear algebra.
    Mutant("linalg/condensed.py", "residual.aypx(-1.0, load)", "residual.aypx(1.0, load)", "condensed load, sign"),
    Mutant("linalg/condensed.py", "result.scale(-1.0)", "result.scale(1.0)", "interior recovered with the wrong sign"),
    Mutant("linalg/condensed.py", "d.fixed[kept]", "np.zeros(kept.size, dtype=bool)", "condensed: supports forgotten"),
    Mutant(
        "linalg/schur.py",
        "values[here, k + block :] = values[k + block :, here].T",
        "pass",
        "Schur complement: blocks not mirrored",
    ),
    Mutant(
        "linalg/full.py",
        "kept = moved is not None and moved <= _LAG",
        "kept = moved is not None and moved == 0",
        "no lagged factor: slower, same answer",
    ),
    Mutant(
        "linalg/full.py",
        "self.start.axpy(scale * case.factors[step], case.start)",
        "self.start.axpy(scale, case.start)",
        "prescribed displacements without their factor",
    ),
    Mutant(
        "linalg/rotated.py",
        "blocks = np.stack([boundary.normal, boundary.tangent], axis=2)",
        "blocks = np.stack([boundary.normal, boundary.tangent], axis=1)",
        "rotation transposed",
    ),
    Mutant("linalg/choice.py", "if d.tagged.mesh.comm.size > 1:", "if False:", "condenses on several ranks"),
    # Residual, Jacobian, what holds the body, the certificate.
    Mutant(
        "problem.py",
        "self.boundary.nodal_forces(*self.multipliers(x, sets)) * self.boundary.free",
        "self.boundary.nodal_forces(*self.multipliers(x, sets))",
        "contact forces on supports",
    ),
    Mutant(
        "problem.py",
        "contact += coupling[:, None, None] * self._tn",
        "contact -= coupling[:, None, None] * self._tn",
        "Jacobian: coupling, sign",
    ),
    Mutant("problem.py", "((n, n), (t, t), (t, n))", "((n, n), (t, t), (n, t))", "Jacobian: coupling transposed"),
    Mutant(
        "holding.py",
        "Status.SLIDES if data.has_friction and pressing else Status.OPEN",
        "Status.OPEN",
        "sliding is called opening",
    ),
    Mutant(
        "holding.py",
        "bounds=[(None if sign else 0.0, None) for sign in bilateral]",
        "bounds=[(None, None) for sign in bilateral]",
        "statics: the foundation may pull",
    ),
    Mutant(
        "certificate.py",
        "(np.abs(shear) - nodes.bound, stress)",
        "(np.abs(shear) - 2 * nodes.bound, stress)",
        "certificate: cone twice as wide",
    ),
    Mutant(
        "certificate.py",
        "(-pressure[~bilateral], stress)",
        "(0 * pressure[~bilateral], stress)",
        "certificate: tension not seen",
    ),
    Mutant(
        "certificate.py",
        "-shear * np.sign(xi), stress)",
        "0 * shear * np.sign(xi), stress)",
        "certificate: slip the wrong way not seen",
    ),
    Mutant(
        "certificate.py",
        "np.where(fixed, 0.0, residual)[nodes.nodes]",
        "np.where(fixed, 0.0, 0 * residual)[nodes.nodes]",
        "certificate: equilibrium of a contact node not seen",
    ),
    # From mesh to mesh and step to step.
    Mutant(
        "task.py",
        "replace(self.data, mu_hat=shear, bound=self.law.bound(pressure))",
        "replace(self.data, bound=self.law.bound(pressure))",
        "load steps forget the shear",
    ),
    Mutant("task.py", "self.data = replace(self.data, slip_origin=u_t)", "pass", "load steps forget the slip"),
    Mutant(
        "nested.py",
        "slip[here] = np.where((slips == slips[:, :1]).all(axis=1), slips[:, 0], 0)",
        "slip[here] = -np.where((slips == slips[:, :1]).all(axis=1), slips[:, 0], 0)",
        "nested: slip carried over the wrong way",
    ),
)

# Some from every module.
QUICK = MUTANTS[::6]


@dataclass(frozen=True)
class Fate:
    """What became of a mutant: caught or not, and by which test."""

    mutant: Mutant
    fate: str
    by: str


def try_mutant(mutant: Mutant, tests: Sequence[str] = TESTS) -> Fate:
    """Run the tests against a copy of the package with the mistake in it."""
    with tempfile.TemporaryDirectory(prefix="mutant-") as name:
        copy = Path(name)
        for folder in ("signorini_fx", "meshes", "tests", "demos"):
            shutil.copytree(
                ROOT / folder, copy / folder, symlinks=True, ignore=shutil.ignore_patterns("__pycache__", "results")
            )
        shutil.copy(ROOT / "pyproject.toml", copy)
        mutant.spoil(copy / "signorini_fx")
        # A mutant may need for ever, or all memory: both are limited, and both count as noticed.
        command = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-p", "no:cacheprovider", "--timeout=120"]
        files = [f"tests/test_{test}.py" for test in tests]
        environment = {**os.environ, "PYTHONPATH": name, "PYTHONDONTWRITEBYTECODE": "1"}
        try:
            process = subprocess.run(
                [*command, *files],
                cwd=copy,
                env=environment,
                capture_output=True,
                text=True,
                timeout=_SECONDS,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return Fate(mutant, HANGS, "")
        if process.returncode == 0:
            return Fate(mutant, SURVIVES, "")
        failed = [line for line in process.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        return Fate(mutant, CAUGHT, failed[0].split(" - ")[0].split(" ", 1)[1] if failed else "the process died")


def main(arguments: Sequence[str] | None = None) -> int:
    """Try the mutants."""
    parser = argparse.ArgumentParser(prog="python3 -m stability.mutants", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--quick", action="store_true", help=f"{len(QUICK)} of the {len(MUTANTS)}")
    parser.add_argument("--only", metavar="WORD,...", default="", help="those with one of the words in module or idea")
    parser.add_argument("--out", type=Path, default=Path("results/stability"), metavar="DIR")
    given = parser.parse_args(arguments)
    chosen = QUICK if given.quick else MUTANTS
    fates = []
    for mutant in chosen:
        if any(word in f"{mutant.file} {mutant.idea}" for word in given.only.split(",")):
            fates.append(try_mutant(mutant))
            print(f"{fates[-1].fate:18s} {mutant.file:32s} {mutant.idea:45s} {fates[-1].by}", flush=True)
    survivors = [fate for fate in fates if fate.fate == SURVIVES]
    print(f"{len(fates)} mutants, {len(survivors)} survive")
    given.out.mkdir(parents=True, exist_ok=True)
    with (given.out / "mutants.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["module", "mistake", "fate", "test"])
        writer.writerows([f.mutant.file, f.mutant.idea, f.fate, f.by] for f in fates)
    return int(bool(survivors))


if __name__ == "__main__":
    sys.exit(main())
