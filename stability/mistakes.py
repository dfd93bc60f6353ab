"""The mistakes of the mutation check (``stability/mutants.py``): what a programmer may well get wrong.

A mutant names a module by its stem, wherever in the package it stands, and an expression, keyword argument or statement
that the module holds exactly once.  It is found by its syntax, so that layout and what stands around it may change; a
list that no longer fits the code is an error and no silent success (``python3 -m stability.mutants --check``).
"""

from __future__ import annotations

import ast
import builtins
from dataclasses import dataclass
from pathlib import Path

from stability import syntax

ROOT = Path(__file__).parent.parent


@dataclass(frozen=True)
class Mutant:
    """A mistake.

    Attributes:
        module: stem of a module of the package; with the folder before it, as in ``linalg/full``, if two share a stem.
        old: an expression, a keyword argument or statements that occur exactly once in it.
        new: what takes its place, of the same kind; an expression is a statement where the other one is.
        idea: the mistake in words; no two mutants share them.
        within: the function, or Class.method, to look in, where the module holds ``old`` more than once.
        ranks: the number of ranks on which it is tried; above 1 only tests that are marked mpi run.
        tests: tests that are likely to notice it: ``ranks`` for tests/test_ranks.py, or ``ranks::test_...`` in it.
        equivalent: why it changes no result, so that no test can notice it; "": it must be noticed.
    """

    module: str
    old: str
    new: str
    idea: str
    within: str = ""
    ranks: int = 1
    tests: tuple[str, ...] = ()
    equivalent: str = ""

    @property
    def named(self) -> list[str]:
        """``tests`` as pytest wants them."""
        parts = [name.partition("::") for name in self.tests]
        return [f"tests/test_{file}.py{colons}{test}" for file, colons, test in parts]

    def path(self, package: Path) -> Path:
        """The file.

        Raises:
            ValueError: no module has the name, or several.
        """
        parts = self.module.split("/")
        found = [
            path
            for path in sorted(package.rglob(f"{parts[-1]}.py"))
            if list(path.relative_to(package).with_suffix("").parts[-len(parts) :]) == parts
        ]
        if len(found) != 1:
            raise ValueError(f"{len(found)} modules are named {self.module}")
        return found[0]

    def _piece(self, source: str) -> syntax.Piece:
        statements = isinstance(syntax.parse(self.new)[0], ast.stmt)
        found = syntax.find(ast.parse(source), self.old, self.within, statements=statements)
        if len(found) != 1:
            where = f" in {self.within}" if self.within else ""
            raise ValueError(f"{self.module}: {self.old!r} occurs {len(found)} times{where}, not once")
        return found[0]

    def place(self, package: Path) -> str:
        """Module and function, as ``module.function``."""
        scope = self._piece(self.path(package).read_text(encoding="utf-8")).scope
        return f"{self.module}.{scope}" if scope else self.module

    def spoilt(self, package: Path) -> str:
        """The source of the module with the mistake in it.

        Raises:
            ValueError: the list does not fit the code.
        """
        source = self.path(package).read_text(encoding="utf-8")
        unknown = syntax.needs(self.new) - syntax.names(source) - set(dir(builtins))
        if unknown:  # any test would notice that
            raise ValueError(f"{self.module}: {self.new!r}: the module knows no {', '.join(sorted(unknown))}")
        return syntax.replace(source, self._piece(source), self.new)

    def spoil(self, package: Path) -> None:
        """Put the mistake into a copy of the package.

        Raises:
            ValueError: the list does not fit the code.
        """
        self.path(package).write_text(self.spoilt(package), encoding="utf-8")


MUTANTS = (
    # --- pointwise maps ----------------------------------------------------------------------------------------------
    Mutant("contact/laws", "u_n - data.gap", "u_n + data.gap", "gap, sign"),
    Mutant(
        "contact/laws",
        "np.where(sets.contact, trial_pressure(u_n, data), 0.0)",
        "trial_pressure(u_n, data)",
        "open nodes are pulled: max dropped",
    ),
    Mutant(
        "contact/laws",
        "data.mu_hat + data.gamma_t * slip_of(u_t, data)",
        "data.mu_hat - data.gamma_t * slip_of(u_t, data)",
        "friction drives the slip: sign",
    ),
    Mutant(
        "contact/laws",
        "np.where(sets.slip, bound, 0.0)[:, None] * sets.direction",
        "-np.where(sets.slip, bound, 0.0)[:, None] * sets.direction",
        "slip sets swapped",
    ),
    Mutant(
        "contact/laws",
        "slip_of(u_t, data) + (data.mu_hat - mu) / data.gamma_t",
        "slip_of(u_t, data) - mu / data.gamma_t",
        "slip multiplier without its shift",
    ),
    Mutant(
        "contact/laws",
        "leaning > 0",
        "leaning > np.inf",
        "a slip node never stays in its set",
    ),
    Mutant("contact/laws", "2.0 * inner(mu, xi)", "-2.0 * inner(mu, xi)", "slip against mu is kept"),
    Mutant("contact/laws", "size - bound", "size + bound", "finite sigma: wrong bound"),
    Mutant(
        "contact/laws",
        "np.maximum(pressure, 0.0)",
        "pressure",
        "friction bound of a negative pressure",
        within="RegularisedData.friction_bound",
    ),
    Mutant(
        "contact/laws",
        "np.where(sets.contact, data.gamma_n, 0.0)",
        "np.where(~sets.contact, data.gamma_n, 0.0)",
        "tangent: contact set swapped",
    ),
    Mutant(
        "contact/laws",
        "data.gamma_t * identity",
        "data.gamma_n * identity",
        "tangent: gamma_n for gamma_t",
    ),
    Mutant(
        "contact/laws",
        "sets.direction * (data.coupling * blocks[:, 0, 0])[:, None]",
        "-sets.direction * (data.coupling * blocks[:, 0, 0])[:, None]",
        "monolithic tangent: sign of F",
    ),
    Mutant(
        "contact/laws",
        "pushing if data.bilateral is None else np.where(data.bilateral, pressure, pushing)",
        "pressure",
        "projection drops its max",
    ),
    Mutant(
        "contact/laws",
        "length(shear) > bound",
        "inner(shear, np.abs(shear)) > bound * length(shear)",
        "projection clips one side",
        within="onto_disc",
    ),
    Mutant(
        "contact/laws",
        "np.abs(pressure)",
        "pressure",
        "bilateral Coulomb: |lambda| dropped",
        tests=("complementarity",),
    ),
    Mutant("contact/laws", "np.minimum(bound, self.cap)", "np.maximum(bound, self.cap)", "cap: max for min"),
    Mutant("contact/laws", "contact | data.bilateral", "contact", "bilateral contact may open"),
    Mutant("contact/laws", "u_t - data.slip_origin", "u_t", "load steps: slip from zero", tests=("load_steps",)),
    # --- the data of a scene -----------------------------------------------------------------------------------------
    Mutant(
        "contact/data",
        'coefficient[here] = _nodal(value, boundary, here, f"{path}.coefficient", minimum=0.0)',
        'given[here] = _nodal(value, boundary, here, f"{path}.coefficient", minimum=0.0)',
        "Coulomb taken for Tresca",
    ),
    Mutant(
        "contact/data",
        'automatic if settings.gamma_t == "auto" else settings.gamma_t',
        'automatic if settings.gamma_t == "auto" else settings.gamma_n',
        "gamma_t of the scene ignored",
        tests=("strategy::test_path_following_keeps_the_ratio_of_gammas",),
    ),
    Mutant(
        "contact/data",
        'np.inf if settings.sigma == "auto" else settings.sigma',
        "np.inf",
        "sigma of the scene ignored",
        tests=("outcomes",),
    ),
    Mutant(
        "contact/data",
        "AUTOMATIC_GAMMA * scene.young / body.tagged.size",
        "AUTOMATIC_GAMMA * scene.young",
        "automatic gamma without its length",
        tests=("invariances",),
    ),
    Mutant("contact/data", "values < minimum", "values < -np.inf", "negative friction is let in"),
    Mutant(
        "contact/data",
        "boundary.part == index",
        "boundary.part <= index",
        "gap of a boundary on those before it",
        within="regularised_data",
        tests=("patch_anywhere::test_two_foundations",),
    ),
    # --- the boundary ------------------------------------------------------------------------------------------------
    Mutant("body/contact_boundary", "-normal[:, 1]", "normal[:, 1]", "tangent not orthogonal"),
    Mutant(
        "body/contact_boundary",
        "self.weight[:, None] * traction",
        "np.where(shear.any(axis=1), 1.0, self.weight)[:, None] * traction",
        "shear without its weight",
    ),
    Mutant(
        "body/contact_boundary",
        "np.asarray(direction) / np.hypot.reduce(direction)",
        "np.asarray(direction)",
        "direction not made a unit vector",
        tests=("patch_anywhere::test_direction_equal_to_the_normal",),
    ),
    Mutant(
        "body/contact_boundary",
        "~fixed.reshape(-1, dim)[nodes]",
        "np.ones((nodes.size, dim), dtype=bool)",
        "contact acts on prescribed components",
    ),
    Mutant("body/contact_boundary", "values**2", "np.abs(values)", "norm: no square"),
    Mutant(
        "body/contact_boundary",
        "parallel.global_sum(self.comm, squares)",
        "squares",
        "norm of the contact boundary of this rank only",
        ranks=2,
        tests=("parts_on_ranks::test_norm_of_the_contact_boundary",),
    ),
    Mutant(
        "body/contact_boundary",
        "closures = closures[:, [0, *range(2, closures.shape[1]), 1]]",
        "pass",
        "middle node at the end of its facet",
        tests=("quantities::test_arc_length",),
    ),
    Mutant(
        "body/contact_boundary",
        "self._components * self.free",
        "self._components * ~self.free",
        "free and prescribed directions swapped",
        tests=("patch_anywhere::test_full_slip_in_the_limit",),
    ),
    Mutant(
        "body/contact_boundary",
        "self._components * self.held",
        "self._components * ~self.held",
        "size of the pressure: only of supported nodes",
        tests=("augmentation::test_nodes_that_a_support_presses_are_no_measure",),
    ),
    # --- forms, loads, supports --------------------------------------------------------------------------------------
    Mutant(
        "body/assembly",
        "vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)",
        "pass",
        "loads of other ranks on shared nodes forgotten",
        within="assemble",
        ranks=2,
        tests=("ranks::test_one_rank_or_many",),
    ),
    Mutant(
        "body/forms",
        "lame * ufl.tr(strain(y)) * ufl.tr(strain(z))",
        "mu * ufl.tr(strain(y)) * ufl.tr(strain(z))",
        "reduced element: mu for lambda",
        tests=("patch_anywhere",),
    ),
    Mutant("body/forms", "ufl.inner(traction, z) * ds", "-ufl.inner(traction, z) * ds", "traction, sign"),
    Mutant("body/forms", "ufl.inner(force, z)", "-ufl.inner(force, z)", "body force, sign", within="body_force_form"),
    Mutant(
        "body/forms",
        '{"quadrature_rule": "vertex", "quadrature_degree": 1}',
        '{"quadrature_degree": 2}',
        "Gauss points instead of the nodes",
    ),
    Mutant(
        "body/material",
        'material.hypothesis == "plane stress"',
        "False",
        "plane stress taken for plane strain",
        tests=("patch_anywhere::test_plane_stress",),
    ),
    Mutant(
        "body/material",
        "4 * mu",
        "2 * mu",
        "shear energy density doubled",
        tests=("quantities::test_cells_for_pictures",),
    ),
    Mutant(
        "body/material",
        "mean = (ufl.tr(sigma) + sigma_33) / 3",
        "mean = ufl.tr(sigma) / 3",
        "shear energy density: mean stress without its third part",
        tests=("quantities::test_cells_for_pictures",),
    ),
    Mutant(
        "body/material",
        "(sigma_33 - mean) ** 2",
        "0 * mean",
        "shear energy density: third deviator forgotten",
        tests=("quantities::test_cells_for_pictures",),
    ),
    Mutant(
        "body/loads",
        "traction -= ufl_value(load.pressure, space) * ufl.FacetNormal(mesh)",
        "traction += ufl_value(load.pressure, space) * ufl.FacetNormal(mesh)",
        "pressure pulls",
        tests=("patch_anywhere",),
    ),
    Mutant(
        "body/loads",
        "load.components[: space.mesh.geometry.dim]",
        "load.components[: space.mesh.geometry.dim][::-1]",
        "components of a load swapped",
        tests=("patch", "patch_anywhere"),
    ),
    Mutant(
        "body/loads",
        "load.axpy(-1.0, action(elastic, applied.prescribed, blocks))",
        "load.axpy(1.0, action(elastic, applied.prescribed, blocks))",
        "lifting, sign",
    ),
    Mutant(
        "body/loads",
        "case.factors[step] * case.resultant",
        "case.factors[0] * case.resultant",
        "resultant of the first load step for all",
        tests=("parts_on_ranks::test_resultant",),
    ),
    Mutant(
        "body/rigid",
        "parallel.sums_by(comm, self.piece[owned], work, self.pieces.count)",
        "parallel.sums_by(MPI.COMM_SELF, self.piece[owned], work, self.pieces.count)",
        "resultant of this rank only",
        ranks=2,
        tests=("parts_on_ranks::test_resultant",),
    ),
    Mutant("body/supports", "sign * value", "value", "normal support without its sign", tests=("algorithms",)),
    Mutant(
        "body/supports",
        "sign * sample(value, x)",
        "sample(value, x)",
        "normal support given as a text: sign",
        tests=("algorithms",),
    ),
    # --- the exact limit ---------------------------------------------------------------------------------------------
    Mutant("problem/exact", "u_n > self.data.gap", "u_n < self.data.gap", "open nodes close where they are apart"),
    Mutant(
        "problem/exact",
        "np.where(self.sets.contact, pressure > 0, u_n > self.data.gap)",
        "self.sets.contact | (u_n > self.data.gap)",
        "contact is never given up",
    ),
    Mutant("problem/exact", "~(inner(self.sets.direction, motion) < 0)", "True", "slip is never given up"),
    Mutant(
        "problem/exact",
        "np.where(self._free[:, 1:].any(axis=1)[:, None], direction, moves)",
        "direction + 0.0 * moves",
        "the limit iterates on slip that a support decides",
        tests=("algorithms::test_exact_method_sees_where_a_support_drags_a_node",),
    ),
    Mutant(
        "problem/exact",
        "self._sign * target",
        "np.abs(self._sign) * target",
        "gap without its direction",
        tests=("algorithms",),
    ),
    Mutant(
        "problem/exact",
        "target[:, 0], target[:, 1:] = self.data.gap, origin",
        "target[:, 0], target[:, 1:] = self.data.gap, 0.0 * origin",
        "stick forgets its origin",
        tests=("load_steps",),
    ),
    Mutant(
        "problem/exact",
        "-self._sign * reaction / self.boundary.weight[:, None]",
        "-self._sign * np.array([1.0, -1.0]) * reaction / self.boundary.weight[:, None]",
        "reaction of a stick node, sign",
    ),
    Mutant(
        "problem/exact",
        "first + dofs",
        "dofs",
        "constraints on the rows of the first rank",
        ranks=2,
        tests=("parts_on_ranks::test_the_limit",),
    ),
    # --- algorithms --------------------------------------------------------------------------------------------------
    Mutant("ssn", "fingerprint in self._seen", "False", "cycles are not seen", tests=("outcomes", "fall_backs")),
    Mutant(
        "ssn",
        "if self._settled(residual, law):\n    return int(_SNES.CONVERGED_FNORM_RELATIVE)",
        "return int(_SNES.CONVERGED_FNORM_RELATIVE)",
        "residual of repeated sets is not looked at",
        tests=("inexact",),
    ),
    Mutant(
        "ssn",
        "problem.accept(self.x, problem.next.trial, snes.getTolerances()[0])",
        "True",
        "sets that were forced count as found",
        tests=("strategy::test_sets_that_are_forced_are_no_solution",),
    ),
    Mutant(
        "ssn",
        "problem.moved if self._may_keep or problem.moved == 0 else None",
        "0",
        "the first factor is kept for ever",
        tests=("example1",),
    ),
    Mutant(
        "ssn",
        "if problem.next.escapes is not None:\n    return self._stop(problem.next.escapes)",
        "pass",
        "a loose body is not seen",
        tests=("outcomes",),
    ),
    Mutant(
        "fp",
        "augmentation.next(data)",
        "replace(augmentation.next(data), mu_hat=data.mu_hat)",
        "ALM-FP does not shift mu",
        tests=("augmentation::test_the_fixed_point_needs_no_help",),
    ),
    Mutant(
        "fp",
        "boundary.norm(following - g) / size",
        "boundary.norm(following - following) / size",
        "fixed point stops at once",
        tests=("invariances::test_tresca_with_the_bound_of_the_fixed_point",),
    ),
    Mutant("fp", "law.bound(g)", "law.bound(start[0])", "the bound is never updated"),
    Mutant("fp", "damping * (pressure - g)", "pressure - g", "damping has no effect", tests=("fall_backs",)),
    Mutant("augmentation", "mu_hat=shear", "mu_hat=data.mu_hat", "ALM does not shift mu", tests=("algorithms",)),
    Mutant(
        "augmentation",
        "lambda_hat=pressure",
        "lambda_hat=data.lambda_hat",
        "ALM does not shift lambda",
        tests=("algorithms",),
    ),
    Mutant(
        "augmentation",
        "self.newton.shifts(data)",
        "self.newton.multipliers()",
        "inexact ALM does not project",
        within="Augmentation.next",
        tests=("algorithms",),
    ),
    Mutant(
        "augmentation",
        "gamma_t=grown(data.gamma_t, self.slow[1])",
        "gamma_t=data.gamma_t",
        "gamma_t does not grow",
        tests=("strategy::test_both_gammas_grow",),
    ),
    Mutant(
        "augmentation",
        "min(GAMMA_GROWTH * gamma, enough) if slow else gamma",
        "gamma",
        "augmentation: gamma not raised where it is slow",
        tests=("augmentation",),
    ),
    Mutant(
        "augmentation",
        "grown(data.gamma_t, self.slow[1])",
        "grown(data.gamma_t, self.slow[0])",
        "augmentation: gamma_t raised where the pressure is slow",
        tests=("augmentation",),
    ),
    Mutant(
        "augmentation",
        "self.left, self.violation = sum(lefts), max(violations)",
        "self.left, self.violation = lefts[0], violations[0]",
        "augmentation: shear not asked for",
        tests=("augmentation",),
    ),
    Mutant(
        "augmentation",
        "max(self.left, self.violation) <= self.tolerance",
        "self.left <= self.tolerance",
        "augmentation: violation not judged",
        tests=("augmentation::test_settled_is_both",),
    ),
    Mutant(
        "augmentation",
        "change * max(1.0, float(np.nanmin([beyond, self._stiffness / gamma]))) / (size or 1.0)",
        "change / (size or 1.0)",
        "augmentation: the last change taken for what is left",
        tests=("augmentation::test_what_is_left_after_one_problem",),
    ),
    Mutant(
        "augmentation",
        "length_of(after[1] - before[1]) * sticks",
        "length_of(after[1] - before[1])",
        "augmentation: slip at the bound counts as elastic",
        tests=("augmentation::test_what_is_left_after_one_problem",),
    ),
    Mutant(
        "augmentation",
        "gamma_t=min(data.gamma_t, largest)",
        "gamma_t=data.gamma_t",
        "augmentation: too large a gamma_t is kept",
        tests=("augmentation::test_no_more_gamma_than_digits",),
    ),
    Mutant(
        "augmentation",
        "parallel.global_max(problem.system.comm, largest)",
        "largest",
        "augmentation: stiffness of the contact nodes of this rank",
        ranks=2,
        tests=("augmentation::test_every_rank_judges_alike",),
    ),
    Mutant(
        "coulomb_newton",
        "coupling=law.coefficient",
        "coupling=0.5 * law.coefficient",
        "monolithic: half of F",
        tests=("patch_anywhere::test_full_slip_by_monolithic_newton",),
    ),
    Mutant(
        "continuation", "gamma_t=gamma_t", "gamma_t=gamma_n", "continuation: gamma_n for gamma_t", tests=("algorithms",)
    ),
    Mutant("path_following", "left <= allowed", "False", "path-following: never content"),
    Mutant(
        "path_following",
        "-2.0 * contact_force(first, np.zeros_like(data.gap), np.zeros_like(origin))",
        "2.0 * contact_force(first, np.zeros_like(data.gap), np.zeros_like(origin))",
        "path-following: curvature, sign",
        tests=("strategy::test_model_of_the_path",),
    ),
    Mutant(
        "path_following",
        "reach * distance",
        "distance",
        "path-following: distance without its reach",
        tests=("strategy::test_model_of_the_path",),
    ),
    Mutant(
        "path_following",
        "u_n - data.gap + data.gamma_n * slope_n",
        "u_n - data.gap",
        "path-following: pressure does not follow gamma",
        tests=("strategy::test_model_of_the_path",),
    ),
    Mutant(
        "descent",
        "parallel.global_sum(self.comm, work)",
        "work",
        "slope of the energy on this rank only",
        ranks=2,
        tests=("parts_on_ranks::test_slope_of_the_energy",),
    ),
    Mutant(
        "descent",
        "t * self.stiffness",
        "self.stiffness",
        "line search: slope is not that of the step",
        tests=("parts_on_ranks::test_slope_of_the_energy",),
    ),
    Mutant(
        "descent",
        "trial_pressure(u_n + t * p_n, data)",
        "trial_pressure(u_n, data)",
        "line search: pressure at the start of the step",
        tests=("parts_on_ranks::test_slope_of_the_energy",),
    ),
    Mutant(
        "fall_backs",
        "stage = replace(data, gamma_n=share * data.gamma_n, gamma_t=share * data.gamma_t)",
        "stage = replace(data, gamma_n=share * data.gamma_n)",
        "smaller gamma_n only",
        tests=("strategy::test_the_path_to_gamma_keeps_the_ratio_of_gammas",),
    ),
    Mutant(
        "fall_backs",
        "newton.restore(start)",
        "pass",
        "fall-backs that fail leave their own iterate",
        tests=("fall_backs",),
    ),
    Mutant(
        "fall_backs",
        "replace(data, sigma=np.inf)",
        "data",
        "through stick: with the sigma that failed",
        tests=("fall_backs",),
    ),
    # --- strategy ----------------------------------------------------------------------------------------------------
    Mutant(
        "solving/strategy",
        "newton.restore(checkpoint)",
        "pass",
        "fall-back from the diverged iterate",
        tests=("strategy::test_fall_backs_begin_where_the_first_method_began",),
    ),
    Mutant(
        "solving/strategy",
        "Outcome(status, newton, given, augmented=True)",
        "replace(failed, status=status, newton=newton, augmented=True)",
        "augmentation reports the error of the path before",
        tests=("fall_backs",),
    ),
    Mutant(
        "solving/strategy",
        "Outcome(status, newton, given, augmented=True)",
        "Outcome(status, newton, given)",
        "augmentation promises the regularised law",
        tests=("fall_backs",),
    ),
    Mutant(
        "solving/strategy",
        "_no_balance(task, data, law) is not None",
        "True",
        "one Tresca problem proves that a body slides",
        within="_proved",
        tests=("coulomb_ways::test_one_bound_proves_nothing",),
    ),
    Mutant(
        "solving/strategy",
        "task.history.allow(PROBLEMS_PER_STEP * task.settings.max_iterations)",
        "pass",
        "no end of linear solves",
        tests=("coulomb_ways",),
    ),
    Mutant(
        "solving/strategy",
        "gamma_t=ratio * first",
        "gamma_t=first",
        "path-following: both gammas equal",
        tests=("strategy::test_path_following_keeps_the_ratio_of_gammas",),
    ),
    Mutant(
        "solving/strategy",
        "float(np.clip(data.gamma_t / data.gamma_n, 1 / LARGEST_GAMMA_RATIO, LARGEST_GAMMA_RATIO))",
        "data.gamma_t / data.gamma_n",
        "path-following: ratio of gammas without limits",
        tests=("strategy",),
    ),
    Mutant(
        "solving/strategy",
        "s.gamma_first / data.gamma_n",
        "1 / s.gamma_first",
        "continuation: share of gamma inverted",
        tests=("strategy::test_continuation_begins_with_the_first_gamma_that_is_given",),
    ),
    Mutant(
        "solving/strategy",
        "Status.SLIDES if balanced(rough) else Status.OPEN",
        "Status.OPEN if balanced(rough) else Status.SLIDES",
        "slides and opens swapped",
        tests=("outcomes",),
    ),
    Mutant(
        "solving/strategy",
        "task.motions.free.shape[1] > 0",
        "False",
        "a loose body without load is called at rest",
        within="_nothing_acts",
        tests=("strategy::test_a_loose_body_without_load_is_not_at_rest",),
    ),
    Mutant(
        "solving/strategy",
        "given.slip_origin - start.elastic_slip",
        "given.slip_origin",
        "elastic slip of earlier load steps counts as slip",
        tests=("load_steps::test_elastic_slip_of_earlier_steps_is_no_slip",),
    ),
    # --- the state of a solve ----------------------------------------------------------------------------------------
    Mutant("solving/task", "mu_hat=shear", "mu_hat=data.mu_hat", "load steps forget the shear", tests=("load_steps",)),
    Mutant(
        "solving/task",
        "replace(self.data, slip_origin=u_t)",
        "self.data",
        "load steps forget the slip",
        tests=("load_steps",),
    ),
    Mutant(
        "solving/task",
        "data.gap + rest_n",
        "data.gap",
        "gap counted from where the body rests",
        tests=("quantities::test_displacement_of_a_body_that_comes_to_rest",),
    ),
    Mutant(
        "solving/task",
        "u_t + rest_t",
        "u_t",
        "slip reported from where the body rests",
        tests=("quantities::test_displacement_of_a_body_that_comes_to_rest",),
    ),
    Mutant(
        "solving/one_mesh",
        "discretisation.motions.displacement(rest.motion)",
        "discretisation.motions.displacement(rest.motion * np.tile([1.0, 1.0, 0.0], rest.motion.size // 3))",
        "displacement from rest without its rotation",
        tests=(
            "certificate::test_faults_of_the_solver_are_refused",
            "quantities::test_displacement_of_a_body_that_comes_to_rest",
        ),
    ),
    Mutant(
        "solving/one_mesh",
        "Status.NOT_CERTIFIED if status is Status.CONVERGED and not certificate.holds else status",
        "status",
        "the certificate has no say",
        tests=("certificate::test_faults_of_the_solver_are_refused",),
    ),
    Mutant(
        "solving/one_mesh",
        "before=last",
        "before=None",
        "certificate: the step before is not handed over",
        tests=("load_steps",),
    ),
    Mutant(
        "solving/one_mesh",
        "deformation.largest > scene.solver.largest_deformation",
        "deformation.gradient > scene.solver.largest_deformation",
        "a body may travel",
        tests=("traps",),
    ),
    Mutant(
        "solving/one_mesh",
        "deformation.largest > scene.solver.largest_deformation",
        "deformation.displacement > scene.solver.largest_deformation",
        "a body may be strained at will",
        tests=("traps",),
    ),
    Mutant(
        "solving/one_mesh",
        "parallel.any_rank(discretisation.comm, bool(np.any(contacts)))",
        "bool(np.any(contacts))",
        "touches nothing where this rank says so",
        ranks=3,
        tests=("traps::test_findings_are_the_same_on_every_rank",),
    ),
    # --- residual and Jacobian ---------------------------------------------------------------------------------------
    Mutant(
        "contact/map",
        "self._force.getArray()[self.fixed] = 0.0",
        "pass",
        "contact forces on supports",
    ),
    Mutant(
        "problem/tangent",
        "self._elastic + np.bincount(self._place, added.ravel(), minlength=self._elastic.size)",
        "self._elastic - np.bincount(self._place, added.ravel(), minlength=self._elastic.size)",
        "Jacobian: coupling, sign",
    ),
    Mutant(
        "problem/tangent",
        'np.einsum("nia,nij,njb->nab", self._weighted, blocks, self._blocks)',
        'np.einsum("nia,nji,njb->nab", self._weighted, blocks, self._blocks)',
        "Jacobian: coupling transposed",
    ),
    Mutant(
        "problem/tangent",
        "np.bincount(self._place, added.ravel(), minlength=self._elastic.size)",
        "np.put(values := np.zeros(self._elastic.size), self._place, added.ravel()) or values",
        "Jacobian: one of two boundaries at a common node",
    ),
    Mutant(
        "problem/tangent",
        "first + rows",
        "0 * first + rows",
        "Jacobian: blocks in the rows of the first rank",
        ranks=2,
        tests=("ranks::test_one_rank_or_many",),
    ),
    Mutant(
        "problem/regularised",
        "largest * np.finfo(float).eps > tolerance * self.force_scale",
        "False",
        "residuals at round-off have no name",
        tests=("outcomes", "fall_backs"),
    ),
    # --- linear algebra ----------------------------------------------------------------------------------------------
    Mutant("condensed", "residual.aypx(-1.0, load)", "residual.aypx(1.0, load)", "condensed load, sign"),
    Mutant("condensed", "result.scale(-1.0)", "result.scale(1.0)", "interior recovered with the wrong sign"),
    Mutant(
        "condensed",
        "d.fixed[retained]",
        "np.zeros(retained.size, dtype=bool)",
        "condensed: supports forgotten",
        tests=("boundary_levels::test_coarse_matrix_is_galerkins",),
    ),
    Mutant(
        "condensed",
        "scale * np.array([case.factors[step] for case in self.cases])",
        "np.array([case.factors[step] for case in self.cases])",
        "condensed: loads without their scale",
        tests=("linalg::test_scaled_loads",),
    ),
    Mutant(
        "schur",
        "values[here, k + block :] = values[k + block :, here].T",
        "pass",
        "Schur complement: blocks not mirrored",
        tests=("linalg::test_one_triangle_makes_a_symmetric_matrix",),
    ),
    Mutant(
        "full",
        "moved is not None and moved <= LAGGED_NODES",
        "moved is not None and moved == 0",
        "no lagged factor: slower, same answer",
        tests=("linalg::test_an_old_factor_serves_where_few_nodes_have_moved",),
    ),
    Mutant(
        "full",
        "self.start.axpy(scale * case.factors[step], case.start)",
        "self.start.axpy(scale, case.start)",
        "prescribed displacements without their factor",
        tests=("load_steps",),
    ),
    Mutant(
        "full",
        "matrix.setNearNullSpace(_rigid_modes(d))",
        "pass",
        "multigrid without rigid motions",
        tests=("inexact",),
    ),
    Mutant(
        "full",
        "INEXACT_TOLERANCE if self.inexact else KRYLOV_TOLERANCE",
        "INEXACT_TOLERANCE",
        "Krylov: loose to the end",
        tests=("inexact",),
    ),
    Mutant(
        "rotated",
        "np.ascontiguousarray(blocks[off].transpose(0, 2, 1))",
        "np.ascontiguousarray(blocks[off])",
        "rotation transposed",
        tests=("patch_anywhere::test_full_slip",),
    ),
    Mutant(
        "rotated",
        "_in_place(blocks, system.fixed[unknowns])",
        "blocks",
        "prescribed unknowns of turned nodes in the wrong place",
        tests=("space_patch::test_in_the_limit_beside_a_support",),
    ),
    Mutant(
        "rotated",
        "first + unknowns[off]",
        "0 * first + unknowns[off]",
        "rotation in the rows of the first rank",
        ranks=2,
        tests=("parts_on_ranks::test_the_limit",),
    ),
    Mutant(
        "rotated",
        "q.T @ matrix.getDenseArray() @ q",
        "q @ matrix.getDenseArray() @ q.T",
        "condensed matrix turned the other way",
        tests=("linalg::test_condensed_with_turned_nodes",),
    ),
    Mutant(
        "choice",
        "d.tagged.mesh.comm.size > 1",
        "False",
        "condenses on several ranks",
        ranks=2,
        tests=("parts_on_ranks::test_condensing_is_for_one_rank",),
    ),
    Mutant(
        "choice",
        'requested != "krylov" and not d.motions.held_by(d.boundary, everywhere, everywhere)',
        "False",
        "condenses a loose piece",
        tests=("pieces",),
    ),
    Mutant(
        "coarsened",
        "self.prolongation.T @ self.inner.load.getArray(readonly=True)",
        "self.inner.load.getArray(readonly=True)[self.kept]",
        "coarse load taken, not gathered",
        tests=("boundary_levels::test_coarse_matrix_is_galerkins",),
    ),
    Mutant(
        "solving/boundary_levels",
        "interpolation.T @ boundary.weight",
        "boundary.weight[rows]",
        "weights of few nodes are those of all",
        tests=("boundary_levels::test_coarse_matrix_is_galerkins",),
    ),
    # --- space -------------------------------------------------------------------------------------------------------
    Mutant(
        "ssn",
        "0.0 if problem.affine or k == 0 else problem.law_residual(self.x)",
        "0.0",
        "space: equal sets are the end",
        tests=("space_block::test_equal_sets_are_not_the_end",),
    ),
    Mutant(
        "body/rigid",
        "found += [*across.swapaxes(0, 1)]",
        "pass",
        "space: a slip that cannot turn holds nothing",
        tests=("space_statics::test_limit_push",),
    ),
    Mutant(
        "contact/statics",
        "1 / np.cos(np.pi / _SIDES) if outer else 1.0",
        "1.0",
        "space: what the inner polygon does not hold slides",
        tests=("space_statics::test_between_the_polygons",),
    ),
    Mutant(
        "contact/laws",
        "sets.turning[:, None, None] * across",
        "0 * across",
        "space: the tangent does not know that slip turns",
        tests=("space_block::test_linear_solves",),
    ),
    Mutant(
        "problem/exact",
        "jacobian.setValues(tangential, tangential, turning[point], addv=PETSc.InsertMode.ADD_VALUES)",
        "pass",
        "space: the tangent of the limit does not know that slip turns",
        tests=("space_effects::test_limit_takes_few_solves",),
    ),
    Mutant(
        "body/forms",
        '{"quadrature_degree": lumped_degree(degree, geometry)}',
        '{"quadrature_rule": "vertex", "quadrature_degree": 1}',
        "space: vertex rule on quadrilaterals",
        tests=("space_patch",),
    ),
    Mutant(
        "results/certificate",
        "np.linalg.norm(shear - np.maximum(along, 0.0)[:, None] * way, axis=1)",
        "np.maximum(-along, 0.0)",
        "space: slip across the shear not seen",
        tests=("space_known::test_certificate_sees_a_shear_astray",),
    ),
    Mutant(
        "contact/state",
        "np.cross(boundary.centre, forces)",
        "np.cross(forces, boundary.centre)",
        "space: moments with the wrong sign",
        tests=("space_results",),
    ),
    Mutant(
        "contact/data",
        "np.asarray(shares @ found)",
        "sample(value, in_space(boundary.x[here]))",
        "averages: the gap at the vertex",
        tests=("space_patch::test_tilted_plane",),
    ),
    Mutant(
        "body/contact_boundary",
        "np.asarray(self.averages.shares @ self.averages.x)",
        "self.x",
        "averages: forces act at the vertex",
        tests=("space_results::test_moment_of_a_push",),
    ),
    Mutant(
        "problem/tangent",
        "self._operator.diagonalScale(R=free)",
        "pass",
        "averages: supports move in the Jacobian",
        tests=("space_block::test_linear_solves_on_quadratic_tetrahedra",),
    ),
    Mutant(
        "results/contact_nodes",
        "gap / weight[nodes]",
        "sample(effect.gap, points)",
        "certificate: the gap at the vertex",
        tests=("space_patch::test_tilted_plane",),
    ),
    Mutant(
        "results/contact_nodes",
        "abs(products).sum(axis=0)",
        "products.sum(axis=0)",
        "certificate: nodes whose basis function integrates to zero left out",
        tests=("space_block::test_linear_solves_on_quadratic_tetrahedra",),
    ),
    Mutant(
        "body/turned_supports",
        "np.linalg.inv(r[:count]).T",
        "np.linalg.inv(r[:count])",
        "walls that are not at right angles: values along each other",
        tests=("turned_supports::test_an_edge_of_two_walls",),
    ),
    Mutant(
        "contact/map",
        "found.operator.chop(_ROUND_OFF)",
        "pass",
        "turned supports: round-off across a tangent is a shear",
        tests=("space_extruded::test_table_1",),
    ),
    Mutant(
        "results/supports",
        "vectors[row] - np.linalg.pinv(basis) @ (basis @ vectors[row])",
        "vectors[row]",
        "certificate: reactions of walls across no axis are not known",
        tests=("turned_supports::test_the_limit",),
    ),
    # --- rigid motions, statics --------------------------------------------------------------------------------------
    Mutant("body/rigid", "-arm[:, second]", "arm[:, second]", "rotation is a shear"),
    Mutant(
        "body/rigid",
        "parallel.global_sum(boundary.comm, np.vstack((rows.T @ rows, moved)))",
        "np.vstack((rows.T @ rows, moved))",
        "a body is held by the contact nodes of this rank",
        ranks=2,
        tests=("parts_on_ranks::test_what_holds_a_body",),
    ),
    Mutant(
        "body/rigid",
        "parallel.global_sum(comm, supported)",
        "supported",
        "a body is held by the supports of this rank",
        ranks=2,
        tests=("parts_on_ranks::test_free_motions",),
    ),
    Mutant("body/rigid", "gram += rows.T @ rows", "pass", "hinges do not hold", tests=("pieces",)),
    Mutant(
        "body/rigid",
        "piece[cells.ravel()] = np.repeat(pieces.of_cell, cells.shape[1])",
        "pass",
        "one piece moves",
        tests=("pieces",),
    ),
    Mutant(
        "body/rigid",
        "((one, 1.0), (other, -1.0))",
        "((one, 1.0), (other, 1.0))",
        "hinges: pieces move against each other",
        tests=("pieces",),
    ),
    Mutant(
        "body/rigid",
        "parallel.sums_by(comm, piece[owned], sums, pieces.count)",
        "parallel.sums_by(MPI.COMM_SELF, piece[owned], sums, pieces.count)",
        "centre of the nodes of this rank",
        ranks=2,
        tests=("pieces::test_motions_do_not_depend_on_the_ranks",),
    ),
    Mutant(
        "body/pieces",
        "np.unique(parallel.gather_rows(comm, np.unique(shared[:, 1:], axis=0)), axis=0)",
        "np.empty((0, 2), dtype=np.int64)",
        "pieces: sides between ranks forgotten",
        ranks=2,
        tests=("pieces::test_pieces_are_the_same_on_every_rank",),
    ),
    Mutant(
        "body/pieces",
        "parallel.gather_rows(comm, np.unique(shared[:, 1:], axis=0))",
        "np.unique(shared[:, 1:], axis=0)",
        "pieces: labels of other ranks forgotten",
        ranks=3,
        tests=("pieces::test_pieces_are_the_same_on_every_rank",),
    ),
    Mutant(
        "body/pieces",
        "local += comm.exscan(numbered) or 0",
        "pass",
        "pieces: labels of every rank begin with zero",
        ranks=2,
        tests=("pieces::test_pieces_are_the_same_on_every_rank",),
    ),
    Mutant(
        "body/pieces", "np.concatenate((here, between))", "between", "pins within a rank forgotten", tests=("pieces",)
    ),
    Mutant(
        "body/pieces",
        "np.concatenate((here, between))",
        "here",
        "pins between ranks forgotten",
        ranks=2,
        tests=("pieces::test_pieces_are_the_same_on_every_rank",),
    ),
    Mutant(
        "body/pieces",
        "_, assembly = _components(count, pins)",
        "assembly = np.arange(count)",
        "pinned pieces are assemblies of their own",
        tests=("pieces",),
    ),
    Mutant(
        "body/pieces",
        "_pins(mesh, place[of_cell])",
        "_pins(mesh, of_cell)",
        "pins by numbers that are no longer in force",
        tests=("pieces",),
    ),
    Mutant(
        "body/pieces",
        "np.count_nonzero(here[:owned])",
        "np.count_nonzero(here)",
        "pieces: ghosts are counted",
        ranks=2,
        tests=("pieces::test_one_piece", "pieces::test_pieces_are_the_same_on_every_rank"),
    ),
    Mutant(
        "body/deformation",
        "np.column_stack((squares * areas, areas))",
        "np.column_stack((squares, np.ones_like(areas)))",
        "deformation: small cells count like large ones",
        tests=("traps",),
    ),
    Mutant(
        "body/deformation",
        'squares = np.einsum("cik,kjc->cij", reference, adjugate) ** 2',
        'slopes_of = np.einsum("cik,kjc->cij", reference, adjugate)\n'
        "squares = ((slopes_of + slopes_of.transpose(0, 2, 1)) / 2) ** 2",
        "deformation: rotation not counted",
        tests=("traps",),
    ),
    Mutant(
        "body/deformation",
        "min(body.tagged.size, float(np.hypot.reduce(np.ptp(corners, axis=0))))",
        "body.tagged.size",
        "deformation: a small piece may travel",
        tests=("pieces::test_a_small_piece_has_not_far_to_go",),
    ),
    Mutant(
        "body/deformation",
        "parallel.global_max(body.comm, parallel.local_max(moved[assembly == number]))",
        "parallel.local_max(moved[assembly == number])",
        "deformation: displacement of this rank only",
        ranks=2,
        tests=("traps::test_figures_of_known_fields",),
    ),
    Mutant(
        "contact/holding_sets",
        "Status.SLIDES if data.has_friction and pressing else Status.OPEN",
        "Status.OPEN",
        "sliding is called opening",
        tests=("outcomes",),
    ),
    Mutant(
        "contact/holding_sets",
        "parallel.global_sum(boundary.comm, np.dot(boundary.weight[here], pressure[here])) > 0",
        "np.dot(boundary.weight[here], pressure[here]) > 0",
        "a body presses where this rank says so",
        ranks=3,
        tests=("parts_on_ranks::test_how_a_body_gets_away",),
    ),
    Mutant(
        "statics",
        "(None if sign else 0.0, None)",
        "(None, None)",
        "statics: the foundation may pull",
        tests=("outcomes",),
    ),
    Mutant(
        "statics",
        "boundary.weight * bound",
        "bound",
        "statics: friction bound without its weight",
        tests=("invariances::test_statics_have_no_unit",),
    ),
    Mutant(
        "statics",
        "-sparse.diags(coupling).tocsr()[finite]",
        "sparse.diags(coupling).tocsr()[finite]",
        "statics: friction falls with the pressure",
    ),
    Mutant(
        "statics",
        "max(float(np.abs(load).max()), 1e-300)",
        "1.0",
        "statics in the units of the scene",
        tests=("invariances::test_statics_have_no_unit",),
    ),
    Mutant(
        "contact/holding_sets",
        "escaping() & unresisted",
        "escaping()",
        "a piece that the sets hold gets away",
        tests=("pieces",),
    ),
    Mutant(
        "contact/resting_place",
        "motion += 0.0 if moved is None else free @ moved",
        "motion = motion if moved is None else free @ moved",
        "only the last piece comes to rest",
        tests=("pieces::test_each_piece_comes_to_rest_by_itself",),
    ),
    Mutant("contact/resting_place", "data.gap - self.u_n", "data.gap + self.u_n", "gap from the resting place, sign"),
    Mutant(
        "contact/resting_place",
        "(0.0 if slip_origin is None else slip_origin) - self.u_t",
        "(0.0 if slip_origin is None else slip_origin) + self.u_t",
        "slip from the resting place, sign",
        tests=("boundary_levels",),
    ),
    Mutant(
        "contact/resting_place",
        "along > _SMALL * along.max(initial=0.0)",
        "along != 0",
        "round-off of a wall stops the body",
        tests=("fall_backs",),
    ),
    Mutant(
        "contact/resting_place",
        "(gap[stops] / along[stops]).min()",
        "(gap[stops] / along[stops]).max()",
        "the body rests where the last node would touch",
        tests=("fall_backs",),
    ),
    # --- nested iteration --------------------------------------------------------------------------------------------
    Mutant(
        "solving/nested",
        "np.where(together[:, None], sliding.sum(axis=1), 0.0)",
        "-np.where(together[:, None], sliding.sum(axis=1), 0.0)",
        "nested: slip carried over the wrong way",
        tests=("nested",),
    ),
    Mutant(
        "solving/nested",
        "distance[:, ::-1]",
        "distance",
        "nested: the farther neighbour counts more",
        tests=("nested",),
    ),
    Mutant(
        "solving/nested",
        "(share * load[:, :, 0]).sum(axis=1)",
        "(share * sheared[:, :, 0]).sum(axis=1)",
        "nested: pressure and shear swapped",
        tests=("nested",),
    ),
    Mutant(
        "solving/nested",
        "rows[rows[:, 0] == part]",
        "rows",
        "nested: neighbours on another boundary",
        tests=("nested",),
    ),
    Mutant(
        "solving/nested",
        "touching[:, :, 0] > 0",
        "touching[:, :, 0] <= 0",
        "nested: contact and distance swapped",
        tests=("nested",),
    ),
    # --- certificate, functionals, resultants ------------------------------------------------------------------------
    Mutant(
        "results/certificate",
        "sheared - nodes.bound",
        "sheared - 2 * nodes.bound",
        "certificate: cone twice as wide",
        tests=("certificate",),
    ),
    Mutant(
        "results/certificate",
        "-pressure[~bilateral]",
        "0 * pressure[~bilateral]",
        "certificate: tension not seen",
        tests=("certificate",),
    ),
    Mutant(
        "results/certificate",
        "_smaller(slipped, length, astray, stress)",
        "0 * astray",
        "certificate: slip the wrong way not seen",
        tests=("certificate",),
    ),
    Mutant(
        "results/certificate",
        "nodes.bound - along",
        "0 * along",
        "certificate: slip below the bound not seen",
        tests=("certificate",),
    ),
    Mutant(
        "results/certificate",
        "np.where(bilateral, np.abs(entered), entered)",
        "0 * entered",
        "certificate: penetration not seen",
        tests=("certificate",),
    ),
    Mutant(
        "results/certificate",
        "np.where(bilateral, np.abs(entered), entered)",
        "entered",
        "certificate: bilateral contact may open",
        tests=("certificate::test_bilateral_contact_does_not_open",),
    ),
    Mutant(
        "results/certificate",
        "np.maximum(-entered, 0.0)",
        "np.maximum(entered, 0.0)",
        "certificate: pressure at a distance not seen",
        tests=("certificate",),
    ),
    Mutant(
        "results/contact_nodes",
        "np.minimum(bound, sample(cap, points))",
        "bound",
        "certificate: cap not judged",
        tests=("certificate", "patch_anywhere::test_cap"),
    ),
    Mutant(
        "results/certificate",
        "pressure / law.gamma_n",
        "2 * pressure / law.gamma_n",
        "certificate: twice the penetration that gamma allows for",
        tests=("certificate",),
    ),
    Mutant(
        "results/certificate",
        "np.add.at(residual, reached, contact_forces)",
        "residual[nodes.nodes] = 0.0",
        "certificate trusts the solver at the contact nodes",
        tests=("certificate",),
    ),
    Mutant(
        "results/certificate",
        "np.add.at(residual, reached, contact_forces)",
        "pass",
        "certificate: equilibrium without the contact forces",
        tests=("certificate",),
    ),
    Mutant(
        "results/certificate",
        "np.add.at(residual, reached, contact_forces)",
        "residual[reached] += contact_forces",
        "certificate: one of two boundaries at a common node",
        tests=("certificate", "patch_anywhere::test_two_foundations"),
    ),
    Mutant(
        "results/certificate",
        "_share(_largest(comm, np.linalg.norm(unbalanced, axis=1)), stress)",
        "0.0",
        "certificate: single contact nodes not judged",
        tests=("certificate::test_one_node_of_many",),
    ),
    Mutant(
        "results/supports",
        "(y - self.value)[self.fixed]",
        "(y - y)[self.fixed]",
        "certificate: supports not judged",
        tests=("certificate",),
    ),
    Mutant(
        "results/supports",
        "scale * (1.0 if effect.factors is None else effect.factors[step])",
        "scale",
        "certificate: load factor of the supports forgotten",
        tests=("certificate", "load_steps"),
    ),
    Mutant(
        "results/supports",
        "sign * factor * sample(given, x[nodes].T)",
        "factor * sample(given, x[nodes].T)",
        "certificate: normal support without its sign",
        tests=("algorithms", "certificate"),
    ),
    Mutant(
        "results/certificate",
        "last.traces(before.displacement.x.array.reshape(-1, dim))[1]",
        "0.0",
        "certificate: slip from zero",
        tests=("certificate", "load_steps"),
    ),
    Mutant(
        "results/certificate",
        "(shear - origin) / law.gamma_t",
        "shear / law.gamma_t",
        "certificate: elastic slip from zero",
        tests=("certificate", "load_steps"),
    ),
    Mutant(
        "results/certificate",
        "motion - turned @ angles",
        "motion",
        "certificate: a body that turns counts as deformed",
        tests=("certificate::test_a_rigid_motion_is_no_deformation",),
    ),
    Mutant(
        "results/certificate",
        "parallel.global_sum(comm, np.sum(values**2))",
        "np.sum(values**2)",
        "certificate: residual of this rank only",
        ranks=2,
        tests=("parts_on_ranks::test_certificate_of_a_wrong_displacement",),
    ),
    Mutant(
        "results/certificate",
        "parallel.global_sum(comm, np.array([np.sum(internal * y), np.sum(external * y)]))",
        "np.array([np.sum(internal * y), np.sum(external * y)])",
        "certificate: energy of this rank only",
        ranks=2,
        tests=("parts_on_ranks::test_certificate", "ranks::test_one_rank_or_many"),
    ),
    Mutant(
        "results/nodal_forces",
        "function.x.petsc_vec.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)",
        "pass",
        "nodal forces of other ranks forgotten",
        ranks=2,
        tests=("nodal_forces::test_against_compiled_forms",),
    ),
    Mutant(
        "results/nodal_forces",
        "scale * (1.0 if load.factors is None else load.factors[step])",
        "scale",
        "nodal forces: load factor forgotten",
        tests=("load_steps", "certificate"),
    ),
    Mutant(
        "results/nodal_forces",
        "np.array(hooke(material))[:, None]",
        "np.array(hooke(materials[0]))[:, None]",
        "nodal forces: one material for all",
        tests=("nodal_forces::test_several_materials",),
    ),
    Mutant(
        "results/nodal_forces",
        "normal *= np.sign(np.sum(normal * outward, axis=2, keepdims=True))",
        "pass",
        "nodal forces: normals may point inwards",
        tests=("nodal_forces",),
    ),
    Mutant(
        "results/nodal_forces",
        "[1 / 6, 1 / 6, 2 / 3]",
        "[1 / 6, 2 / 3, 1 / 6]",
        "nodal forces: weights of Simpson's rule swapped",
        tests=("nodal_forces",),
    ),
    Mutant(
        "results/nodal_forces",
        "pressure[:, :, None] * facets.moment",
        "-pressure[:, :, None] * facets.moment",
        "nodal forces: pressure pulls",
        tests=("nodal_forces", "patch_anywhere"),
    ),
    Mutant(
        "results/nodal_forces",
        "first * (gradient + gradient.swapaxes(0, 1)) / 2",
        "first * gradient",
        "nodal forces: a rotation is a strain",
        tests=("nodal_forces",),
    ),
    Mutant(
        "results/nodal_forces",
        'material.hypothesis == "plane strain"',
        "True",
        "nodal forces: plane stress taken for plane strain",
        tests=("nodal_forces", "patch_anywhere::test_plane_stress"),
    ),
    Mutant(
        "results/nodal_forces",
        "self._stress_work(displacement, reduced, np.zeros(1), b)",
        "self._stress_work(displacement, degree, np.zeros(1), b)",
        "nodal forces: volumetric term not reduced",
        tests=("nodal_forces", "patch_anywhere::test_reduced_volumetric_term"),
    ),
    Mutant(
        "contact/state",
        "-self.boundary.nodal_forces(self.pressure, np.zeros_like(self.shear)).sum(axis=0)",
        "self.boundary.nodal_forces(self.pressure, np.zeros_like(self.shear)).sum(axis=0)",
        "contact force on the foundation",
    ),
    Mutant(
        "contact/state",
        "parallel.global_sum(comm, friction)",
        "friction",
        "friction force of this rank only",
        ranks=2,
        tests=("ranks::test_one_rank_or_many",),
    ),
    Mutant(
        "contact/state",
        "inner(self.shear, self.xi)",
        "inner(self.shear, self.u_t)",
        "work of friction on the whole displacement",
        tests=("load_steps",),
    ),
    Mutant(
        "contact/state",
        "weight @ self.tangential(self.u_t)",
        "self.tangential(self.u_t).sum(axis=0)",
        "mean displacement without weights",
        tests=("quantities::test_mean_tangential_displacement",),
    ),
    Mutant(
        "results/certificate", "float(energy) / 2", "float(energy)", "strain energy without its half", tests=("oracle",)
    ),
    Mutant(
        "results/certificate",
        "strain_energy - float(work)",
        "strain_energy + float(work)",
        "potential energy: work of the loads, sign",
        tests=("certificate::test_potential_energy",),
    ),
    Mutant(
        "contact/state",
        "trial - bound / 2",
        "trial - bound",
        "primal functional: friction beyond the bound",
        tests=("example1",),
    ),
    Mutant(
        "contact/state",
        "data.lambda_hat**2 - (pressure - data.lambda_hat) ** 2",
        "data.lambda_hat**2 + (pressure - data.lambda_hat) ** 2",
        "dual functional: compliance, sign",
        tests=("example1",),
    ),
    # --- estimates ---------------------------------------------------------------------------------------------------
    Mutant(
        "accuracy/stress_recovery",
        "2 * tau[dim] ** 2",
        "tau[dim] ** 2",
        "estimate: shear stress counted once",
        tests=("quantities::test_compliance_is_the_inverse_of_the_stiffness",),
    ),
    Mutant(
        "accuracy/stress_recovery",
        "lame / (dim * lame + 2 * mu) * trace**2",
        "2 * lame / (dim * lame + 2 * mu) * trace**2",
        "estimate: compliance of the trace doubled",
        tests=("quantities::test_compliance_is_the_inverse_of_the_stiffness",),
    ),
    Mutant(
        "accuracy/stress_recovery",
        "assemble(self._moments)",
        "fem_petsc.assemble_vector(self._moments)",
        "estimate: moments of other ranks forgotten",
        ranks=2,
        tests=("parts_on_ranks::test_error_estimate",),
    ),
    Mutant(
        "accuracy/stress_recovery",
        "self._recovered.x.scatter_forward()",
        "pass",
        "estimate: recovered stress of ghosts not sent",
        ranks=2,
        tests=("parts_on_ranks::test_error_estimate",),
    ),
    Mutant(
        "accuracy/stress_recovery",
        "parallel.global_sum(self._comm, self.squares(x).sum())",
        "self.squares(x).sum()",
        "estimate of this rank only",
        ranks=2,
        tests=("parts_on_ranks::test_error_estimate",),
    ),
    Mutant(
        "accuracy/pressure_error",
        "KINK_SHARE / 2 * h[:-1] ** 3 * kinks",
        "KINK_SHARE * h[:-1] ** 3 * kinks",
        "pressure: kinks count twice",
        tests=("estimates::test_kinks_of_a_smooth_pressure",),
    ),
    Mutant(
        "accuracy/pressure_error",
        "np.where(pressed & beyond, size, 0.0)",
        "0.0 * size",
        "pressure: jumps not seen",
        tests=("estimates",),
    ),
    Mutant(
        "accuracy/pressure_error",
        "square + start**2 + start * slope + slope**2 / 3",
        "square + start**2",
        "pressure: the line beside a singular corner is level",
        tests=("estimates",),
    ),
    Mutant(
        "accuracy/pressure_error",
        "(part * base + np.minimum(one, other)) * base + np.maximum(one, other)",
        "(part * base + one) * base + other",
        "pressure: facets that run against the table have no error",
        tests=("estimates",),
    ),
    Mutant(
        "accuracy/error_estimates",
        "energy=error + data",
        "energy=error",
        "estimate: what the mesh misses of the data left out",
        tests=("estimates",),
    ),
    Mutant(
        "accuracy/error_estimates",
        "contact + (POLLUTION * error) ** 2 * body + data * forces",
        "contact",
        "estimate: the body is not refined for the pressure",
        tests=("estimates",),
    ),
    Mutant(
        "accuracy/error_estimates",
        "parallel.global_sum(comm, squares.sum())",
        "squares.sum()",
        "all estimates of this rank only",
        ranks=2,
        tests=("accuracy::test_every_number_of_ranks_meets_it",),
    ),
    Mutant(
        "accuracy/data_error",
        "load.factors[step] * load.forces",
        "load.factors[0] * load.forces",
        "missed data: size of the loads of the first step",
        tests=("estimates",),
    ),
    Mutant(
        "accuracy/data_error",
        "(load.factors or (1.0,) * d.scene.steps)[step]",
        "(load.factors or (1.0,) * d.scene.steps)[0]",
        "missed data: loads of the first step",
        tests=("estimates",),
    ),
    Mutant(
        "accuracy/data_error",
        '-density * dx(metadata={"quadrature_degree": coarse})',
        'density * dx(metadata={"quadrature_degree": coarse})',
        "missed data: all of the load",
        tests=("estimates",),
    ),
    Mutant(
        "accuracy/data_error",
        "missed[~(sliding[:-1] | sliding[1:])] = 0.0",
        "missed[sliding[:-1] | sliding[1:]] = 0.0",
        "missed data: friction where nothing slides",
        tests=("estimates",),
    ),
    Mutant(
        "accuracy/price_list",
        "(fine / coarse) ** rate - 1",
        "(fine / coarse) ** rate",
        "extrapolation: error of the finer mesh forgotten",
        tests=("price_list",),
    ),
    Mutant("accuracy/price_list", "finer**2", "finer", "next mesh: unknowns grow like h", tests=("price_list",)),
    Mutant(
        "accuracy/price_list",
        "p[inside] ** 2 - p[row] ** 2",
        "p[inside] - p[row]",
        "zone ends: no square root",
        tests=("price_list",),
    ),
    Mutant(
        "mesh/refinement",
        "parallel.global_sum(comm, squares[squares >= middle].sum())",
        "squares[squares >= middle].sum()",
        "marking: what this rank holds",
        ranks=2,
        tests=("parts_on_ranks::test_marking",),
    ),
    Mutant(
        "mesh/refinement",
        "parent_cell[place[children] - first]",
        "parent_cell[place[children]]",
        "regions of the cells of the first rank",
        ranks=2,
        tests=("parts_on_ranks::test_regions_of_a_refined_mesh",),
    ),
    Mutant(
        "check/cost",
        "FACTOR_SECONDS[dim][1]",
        "100 * FACTOR_SECONDS[dim][1]",
        "factorisation time times 100",
        tests=("cost_model",),
    ),
    Mutant(
        "check/findings",
        "2 * count > number and 2 * total > count and turned > _TURNED",
        "2 * count > number and 2 * total > count",
        "heights on flat boundaries",
        tests=("traps",),
    ),
    Mutant(
        "check/findings",
        "np.abs(slope @ direction + 1.0) <= _SAME_SLOPE",
        "np.abs(slope @ direction - 1.0) <= _SAME_SLOPE",
        "heights: downwards is upwards",
        tests=("traps",),
    ),
    Mutant(
        "check/equilibrium",
        "left > ZERO * size and left**2 > np.linalg.norm(given @ away, axis=1).sum()",
        "left > ZERO * size",
        "check: given friction holds nothing",
        tests=("check::test_friction_holds_either_way",),
    ),
    Mutant(
        "statics",
        "[*(c.normal + share * pull for pull in pulls), c.normal]",
        "[c.normal + share * pulls[0], c.normal]",
        "check: friction acts one way only",
        tests=("check::test_friction_holds_either_way",),
    ),
    Mutant(
        "statics",
        "-edge[c.bilateral]",
        "edge[c.bilateral]",
        "check: bilateral contact cannot pull",
        tests=("check::test_bilateral_contact_pulls",),
    ),
    Mutant(
        "check/findings",
        "smallest > _FAR * moved",
        "smallest > moved",
        "check: a gap just out of reach is called out",
        tests=("check::test_a_gap_out_of_reach",),
    ),
    Mutant(
        "check/findings",
        "parallel.any_rank(body.comm, any(load.forces.any() or load.start.any() for load in acting))",
        "any(load.forces.any() or load.start.any() for load in acting)",
        "nothing acts where this rank says so",
        ranks=3,
        tests=("traps::test_findings_are_the_same_on_every_rank",),
    ),
    # --- tables, pictures, sweeps ------------------------------------------------------------------------------------
    Mutant(
        "results/files",
        "cells += sum(counts[: comm.rank])",
        "pass",
        "cells of all ranks on the nodes of the first",
        ranks=2,
        tests=("quantities::test_cells_for_pictures",),
    ),
    Mutant(
        "results/files",
        "cells[:, [0, 1, 3, 2]]",
        "cells",
        "pictures: quadrilaterals crossed",
        tests=("quantities::test_cells_for_pictures",),
    ),
    Mutant("contact/table", "row - 1", "row", "zones end one node too late", tests=("example1",)),
    Mutant(
        "contact/table",
        "np.cumsum(steps)",
        "steps",
        "arc length does not add up",
        tests=("quantities::test_arc_length",),
    ),
    Mutant(
        "solving/sweep",
        "scale=self._load",
        "scale=1.0",
        "sweep: certificate with the load of 1",
        tests=("linalg::test_scaled_loads",),
    ),
    Mutant(
        "solving/sweep",
        "system.set_step(0, self._load)",
        "system.set_step(0)",
        "sweep: interior with the load of 1",
        tests=("linalg::test_scaled_loads",),
    ),
    # --- expressions -------------------------------------------------------------------------------------------------
    Mutant(
        "scene/expressions",
        "reduce(ufl.min_value, values)",
        "reduce(ufl.max_value, values)",
        "UFL: max for min",
        tests=("expressions",),
    ),
    Mutant(
        "scene/expressions",
        "self._backend.both if isinstance(node.op, ast.And) else self._backend.either",
        "self._backend.either if isinstance(node.op, ast.And) else self._backend.both",
        "and, or swapped",
        tests=("expressions",),
    ),
    Mutant(
        "scene/expressions",
        "reduce(self._backend.both, tests)",
        "tests[0]",
        "a < b < c: second half dropped",
        tests=("expressions",),
    ),
    Mutant(
        "scene/expressions",
        "abs(_float(value.value)) > _MAX_EXPONENT",
        "_float(value.value) > _MAX_EXPONENT + 1",
        "exponents up to 101",
        tests=("expressions",),
    ),
    Mutant(
        "scene/expressions",
        "(node.test, node.body, node.orelse)",
        "(node.test, node.orelse, node.body)",
        "A if C else B swapped",
        tests=("expressions",),
    ),
    # --- units -------------------------------------------------------------------------------------------------------
    Mutant(
        "solving/one_mesh",
        "scene.young / discretisation.tagged.size",
        "scene.young",
        "natural gamma without its length",
        tests=("strategy::test_path_following_has_no_unit",),
    ),
    Mutant(
        "mesh/tagged",
        "cdist(some, corners).max()",
        "cdist(some, corners).max(axis=1).min()",
        "size of the body: shortest distance",
        tests=("ranks", "invariances"),
    ),
    Mutant(
        "ssn",
        "norms[2] / problem.force_scale if problem.force_scale > 0 else norms[2]",
        "norms[2]",
        "residual in the units of the scene",
        tests=("invariances",),
    ),
)

# Some from every module.
QUICK = MUTANTS[::6]
