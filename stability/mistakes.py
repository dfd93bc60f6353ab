"""The mistakes of the mutation check (``stability/mutants.py``): what a programmer may well get wrong.

A mutant names a module by its stem, wherever in the package it stands, and an expression, keyword argument or statement
that the module holds exactly once.  It is found by its syntax, so that layout and what stands around it may change; a
list that no longer fits the code is an error and no silent success (``python3 -m stability.mutants --check``).
"""

from __future__ import annotations

import ast
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
        return syntax.replace(source, self._piece(source), self.new)

    def spoil(self, package: Path) -> None:
        """Put the mistake into a copy of the package.

        Raises:
            ValueError: the list does not fit the code.
        """
        self.path(package).write_text(self.spoilt(package), encoding="utf-8")


MUTANTS = (
    # --- pointwise maps ----------------------------------------------------------------------------------------------
    Mutant("complementarity", "u_n - data.gap", "u_n + data.gap", "gap, sign"),
    Mutant(
        "complementarity",
        "np.where(sets.contact, trial_pressure(u_n, data), 0.0)",
        "trial_pressure(u_n, data)",
        "open nodes are pulled: max dropped",
    ),
    Mutant(
        "complementarity",
        "data.mu_hat + data.gamma_t * slip_of(u_t, data)",
        "data.mu_hat - data.gamma_t * slip_of(u_t, data)",
        "friction drives the slip: sign",
    ),
    Mutant(
        "complementarity",
        "return sets.slip * np.where(sets.slip == 0, 0.0, bound)",
        "return -sets.slip * np.where(sets.slip == 0, 0.0, bound)",
        "slip sets swapped",
    ),
    Mutant(
        "complementarity",
        "slip_of(u_t, data) + (data.mu_hat - mu) / data.gamma_t",
        "slip_of(u_t, data) - mu / data.gamma_t",
        "slip multiplier without its shift",
    ),
    Mutant(
        "complementarity",
        "(mu > bound) | ((mu == bound) & (xi > 0))",
        "mu > bound",
        "a slip node never stays in its set",
    ),
    Mutant("complementarity", "(mu == -bound) & (xi < 0)", "(mu == -bound) & (xi > 0)", "slip against mu is kept"),
    Mutant("complementarity", "mu - bound", "mu + bound", "finite sigma: wrong bound"),
    Mutant(
        "complementarity",
        "np.maximum(pressure, 0.0)",
        "pressure",
        "friction bound of a negative pressure",
        within="RegularisedData.friction_bound",
    ),
    Mutant(
        "complementarity",
        "np.where(sets.contact, data.gamma_n, 0.0)",
        "np.where(~sets.contact, data.gamma_n, 0.0)",
        "tangent: contact set swapped",
    ),
    Mutant(
        "complementarity",
        "np.where(sets.slip == 0, data.gamma_t, 0.0)",
        "np.where(sets.slip == 0, data.gamma_n, 0.0)",
        "tangent: gamma_n for gamma_t",
    ),
    Mutant(
        "complementarity",
        "sets.slip * data.coupling * normal",
        "-sets.slip * data.coupling * normal",
        "monolithic tangent: sign of F",
    ),
    Mutant(
        "complementarity",
        "pushing if data.bilateral is None else np.where(data.bilateral, pressure, pushing)",
        "pressure",
        "projection drops its max",
    ),
    Mutant("complementarity", "np.clip(shear, -bound, bound)", "np.minimum(shear, bound)", "projection clips one side"),
    Mutant("complementarity", "np.abs(pressure)", "pressure", "bilateral Coulomb: |lambda| dropped"),
    Mutant("complementarity", "np.minimum(bound, self.cap)", "np.maximum(bound, self.cap)", "cap: max for min"),
    Mutant("complementarity", "contact | data.bilateral", "contact", "bilateral contact may open"),
    Mutant("complementarity", "u_t - data.slip_origin", "u_t", "load steps: slip from zero", tests=("load_steps",)),
    # --- the data of a scene -----------------------------------------------------------------------------------------
    Mutant(
        "contact_data",
        'coefficient[here] = _nodal(value, boundary, here, f"{path}.coefficient", minimum=0.0)',
        'given[here] = _nodal(value, boundary, here, f"{path}.coefficient", minimum=0.0)',
        "Coulomb taken for Tresca",
    ),
    Mutant(
        "contact_data",
        'automatic if settings.gamma_t == "auto" else settings.gamma_t',
        'automatic if settings.gamma_t == "auto" else settings.gamma_n',
        "gamma_t of the scene ignored",
        tests=("strategy::test_path_following_keeps_the_ratio_of_gammas",),
    ),
    Mutant(
        "contact_data",
        'np.inf if settings.sigma == "auto" else settings.sigma',
        "np.inf",
        "sigma of the scene ignored",
        tests=("outcomes",),
    ),
    Mutant(
        "contact_data",
        "_AUTOMATIC_GAMMA * scene.young / discretisation.tagged.size",
        "_AUTOMATIC_GAMMA * scene.young",
        "automatic gamma without its length",
        tests=("invariances",),
    ),
    Mutant("contact_data", "values < minimum", "values < -np.inf", "negative friction is let in"),
    Mutant(
        "contact_data",
        "boundary.part == index",
        "boundary.part <= index",
        "gap of a boundary on those before it",
        within="regularised_data",
        tests=("patch_anywhere::test_two_foundations",),
    ),
    # --- the boundary ------------------------------------------------------------------------------------------------
    Mutant("boundary", "-self.normal[:, 1]", "self.normal[:, 1]", "tangent not orthogonal"),
    Mutant("boundary", "(self.weight * shear)[:, None]", "shear[:, None]", "shear without its weight"),
    Mutant(
        "boundary",
        "np.asarray(direction) / np.hypot(*direction)",
        "np.asarray(direction)",
        "direction not made a unit vector",
        tests=("patch_anywhere::test_direction_equal_to_the_normal",),
    ),
    Mutant(
        "boundary",
        "~fixed.reshape(-1, 2)[nodes]",
        "np.ones((nodes.size, 2), dtype=bool)",
        "contact acts on prescribed components",
    ),
    Mutant("boundary", "values**2", "np.abs(values)", "norm: no square"),
    Mutant(
        "boundary",
        "parallel.global_sum(self.comm, np.dot(self.weight, values**2))",
        "np.dot(self.weight, values**2)",
        "norm of the contact boundary of this rank only",
        ranks=2,
        tests=("parts_on_ranks::test_norm_of_the_contact_boundary",),
    ),
    Mutant(
        "boundary",
        "[first, *middle, last]",
        "[first, last, *middle]",
        "middle node at the end of its facet",
        tests=("quantities::test_arc_length",),
    ),
    Mutant(
        "boundary",
        "np.abs(direction) * ~self.free",
        "np.abs(direction) * self.free",
        "free and prescribed directions swapped",
        tests=("patch_anywhere::test_full_slip_in_the_limit",),
    ),
    # --- forms, loads, supports --------------------------------------------------------------------------------------
    Mutant(
        "assembly",
        "vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)",
        "pass",
        "loads of other ranks on shared nodes forgotten",
        within="assemble",
        ranks=2,
        tests=("ranks::test_one_rank_or_many",),
    ),
    Mutant(
        "forms",
        "lame * ufl.tr(strain(y)) * ufl.tr(strain(z))",
        "mu * ufl.tr(strain(y)) * ufl.tr(strain(z))",
        "reduced element: mu for lambda",
        tests=("patch_anywhere",),
    ),
    Mutant("forms", "ufl.inner(traction, z) * ds", "-ufl.inner(traction, z) * ds", "traction, sign"),
    Mutant("forms", "ufl.inner(force, z)", "-ufl.inner(force, z)", "body force, sign", within="body_force_form"),
    Mutant(
        "forms",
        '{"quadrature_rule": "vertex", "quadrature_degree": 1}',
        '{"quadrature_degree": 2}',
        "Gauss points instead of the nodes",
    ),
    Mutant(
        "material",
        'material.hypothesis == "plane stress"',
        "False",
        "plane stress taken for plane strain",
        tests=("patch_anywhere::test_plane_stress",),
    ),
    Mutant(
        "material", "4 * mu", "2 * mu", "shear energy density doubled", tests=("quantities::test_cells_for_pictures",)
    ),
    Mutant(
        "material",
        "mean = (ufl.tr(sigma) + sigma_33) / 3",
        "mean = ufl.tr(sigma) / 3",
        "shear energy density: mean stress without its third part",
        tests=("quantities::test_cells_for_pictures",),
    ),
    Mutant(
        "material",
        "(sigma_33 - mean) ** 2",
        "0 * mean",
        "shear energy density: third deviator forgotten",
        tests=("quantities::test_cells_for_pictures",),
    ),
    Mutant(
        "loads",
        "traction -= _ufl_value(load.pressure, space) * ufl.FacetNormal(mesh)",
        "traction += _ufl_value(load.pressure, space) * ufl.FacetNormal(mesh)",
        "pressure pulls",
        tests=("patch_anywhere",),
    ),
    Mutant(
        "loads",
        "(body.x, body.y)",
        "(body.y, body.x)",
        "components of a body force swapped",
        tests=("patch", "patch_anywhere"),
    ),
    Mutant(
        "loads",
        "load.axpy(-1.0, action(elastic, prescribed, blocks))",
        "load.axpy(1.0, action(elastic, prescribed, blocks))",
        "lifting, sign",
    ),
    Mutant(
        "loads",
        "case.factors[step] * case.resultant",
        "case.factors[0] * case.resultant",
        "resultant of the first load step for all",
        tests=("parts_on_ranks::test_resultant",),
    ),
    Mutant(
        "loads",
        'parallel.global_sum(load.comm.tompi4py(), np.einsum("ij,ijk->k", forces, motions.at(x)))',
        'np.einsum("ij,ijk->k", forces, motions.at(x))',
        "resultant of this rank only",
        ranks=2,
        tests=("parts_on_ranks::test_resultant",),
    ),
    Mutant("supports", "sign * value", "value", "normal support without its sign", tests=("algorithms",)),
    Mutant(
        "supports",
        "sign * sample(value, x)",
        "sample(value, x)",
        "normal support given as a text: sign",
        tests=("algorithms",),
    ),
    # --- the exact limit ---------------------------------------------------------------------------------------------
    Mutant("exact", "u_n > self.data.gap", "u_n < self.data.gap", "open nodes close where they are apart"),
    Mutant(
        "exact",
        "np.where(self.sets.contact, pressure > 0, u_n > self.data.gap)",
        "self.sets.contact | (u_n > self.data.gap)",
        "contact is never given up",
    ),
    Mutant("exact", "np.where(slip * slip_of(u_t, self.data) < 0, 0, slip)", "slip", "slip is never given up"),
    Mutant(
        "exact", "self._n_sign * self.data.gap", "self.data.gap", "gap without its direction", tests=("algorithms",)
    ),
    Mutant("exact", "self._t_sign * origin", "0 * origin", "stick forgets its origin", tests=("load_steps",)),
    Mutant(
        "exact",
        "-self._t_sign * reaction[self._t] / weight",
        "self._t_sign * reaction[self._t] / weight",
        "reaction of a stick node, sign",
    ),
    Mutant(
        "exact",
        "first + dofs",
        "dofs",
        "constraints on the rows of the first rank",
        ranks=2,
        tests=("parts_on_ranks::test_the_limit",),
    ),
    # --- algorithms --------------------------------------------------------------------------------------------------
    Mutant("ssn", "fingerprint in self._seen", "False", "cycles are not seen", tests=("outcomes", "ladder")),
    Mutant(
        "ssn",
        "if residual <= snes.getTolerances()[0]:\n    return int(_SNES.CONVERGED_FNORM_RELATIVE)",
        "return int(_SNES.CONVERGED_FNORM_RELATIVE)",
        "residual of repeated sets is not looked at",
        tests=("inexact",),
    ),
    Mutant(
        "ssn",
        "problem.accept(self.x, problem.wanted, snes.getTolerances()[0])",
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
    Mutant("ssn", "problem.loose is not None", "False", "a loose body is not seen", tests=("outcomes",)),
    Mutant("fp", "mu_hat=shifts[1]", "mu_hat=data.mu_hat", "ALM-FP does not shift mu", tests=("algorithms",)),
    Mutant(
        "fp",
        "norm(following - g) / size",
        "norm(following - following) / size",
        "fixed point stops at once",
        tests=("invariances::test_tresca_with_the_bound_of_the_fixed_point",),
    ),
    Mutant("fp", "law.bound(g)", "law.bound(start[0])", "the bound is never updated"),
    Mutant("fp", "damping * (pressure - g)", "pressure - g", "damping has no effect", tests=("ladder",)),
    Mutant("alm", "mu_hat=shear", "mu_hat=data.mu_hat", "ALM does not shift mu", tests=("algorithms",)),
    Mutant(
        "alm", "lambda_hat=pressure", "lambda_hat=data.lambda_hat", "ALM does not shift lambda", tests=("algorithms",)
    ),
    Mutant(
        "alm",
        "pressure, shear = newton.shifts(data)",
        "pressure, shear = newton.multipliers()",
        "inexact ALM does not project",
        within="augmented_lagrangian",
        tests=("algorithms",),
    ),
    Mutant(
        "alm",
        "gamma_t=data.gamma_t * gamma_factor",
        "gamma_t=data.gamma_t",
        "gamma_t does not grow",
        tests=("strategy::test_both_gammas_grow",),
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
        "-2.0 * contact_force(first, nothing, nothing)",
        "2.0 * contact_force(first, nothing, nothing)",
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
        "ladder",
        "stage = replace(data, gamma_n=share * data.gamma_n, gamma_t=share * data.gamma_t)",
        "stage = replace(data, gamma_n=share * data.gamma_n)",
        "smaller gamma_n only",
        tests=("strategy::test_the_path_of_the_ladder_keeps_the_ratio_of_gammas",),
    ),
    Mutant("ladder", "start.copy(newton.x)", "pass", "a ladder that fails leaves its own iterate", tests=("ladder",)),
    Mutant(
        "ladder", "replace(data, sigma=np.inf)", "data", "through stick: with the sigma that failed", tests=("ladder",)
    ),
    # --- strategy ----------------------------------------------------------------------------------------------------
    Mutant(
        "strategy",
        "state.copy(newton.x)",
        "pass",
        "fall-back from the diverged iterate",
        tests=("strategy::test_fall_backs_begin_where_the_first_method_began",),
    ),
    Mutant(
        "strategy",
        "task.regularisation_error = None",
        "pass",
        "augmentation reports the error of the path before",
        tests=("ladder",),
    ),
    Mutant(
        "strategy",
        "gamma_t=first * data.gamma_t / data.gamma_n",
        "gamma_t=first",
        "path-following: both gammas equal",
        tests=("strategy::test_path_following_keeps_the_ratio_of_gammas",),
    ),
    Mutant(
        "strategy",
        "s.gamma_first / data.gamma_n",
        "1 / s.gamma_first",
        "continuation: share of gamma inverted",
        tests=("strategy::test_continuation_begins_with_the_first_gamma_that_is_given",),
    ),
    Mutant(
        "strategy",
        "Status.SLIDES if balanced(rough) else Status.OPEN",
        "Status.OPEN if balanced(rough) else Status.SLIDES",
        "slides and opens swapped",
        tests=("outcomes",),
    ),
    Mutant(
        "strategy",
        "task.motions.free.shape[1] > 0",
        "False",
        "a loose body without load is called at rest",
        within="_nothing_acts",
        tests=("strategy::test_a_loose_body_without_load_is_not_at_rest",),
    ),
    # --- the state of a solve ----------------------------------------------------------------------------------------
    Mutant("task", "mu_hat=shear", "mu_hat=self.data.mu_hat", "load steps forget the shear", tests=("load_steps",)),
    Mutant(
        "task",
        "self.data = replace(self.data, slip_origin=u_t)",
        "pass",
        "load steps forget the slip",
        tests=("load_steps",),
    ),
    Mutant(
        "task",
        "data.gap + rest_n",
        "data.gap",
        "gap counted from where the body rests",
        tests=("quantities::test_displacement_of_a_body_that_comes_to_rest",),
    ),
    Mutant(
        "task",
        "u_t + rest_t",
        "u_t",
        "slip reported from where the body rests",
        tests=("quantities::test_displacement_of_a_body_that_comes_to_rest",),
    ),
    Mutant(
        "solver",
        "discretisation.motions.at(x) @ rest.motion",
        "discretisation.motions.at(x)[:, :, :2] @ rest.motion[:2]",
        "displacement from rest without its rotation",
        tests=("quantities::test_displacement_of_a_body_that_comes_to_rest",),
    ),
    # --- residual and Jacobian ---------------------------------------------------------------------------------------
    Mutant(
        "problem",
        "self.boundary.nodal_forces(*self.multipliers(x, sets)) * self.boundary.free",
        "self.boundary.nodal_forces(*self.multipliers(x, sets))",
        "contact forces on supports",
    ),
    Mutant(
        "problem",
        "contact += coupling[:, None, None] * self._tn",
        "contact -= coupling[:, None, None] * self._tn",
        "Jacobian: coupling, sign",
    ),
    Mutant("problem", "((n, n), (t, t), (t, n))", "((n, n), (t, t), (n, t))", "Jacobian: coupling transposed"),
    Mutant(
        "problem",
        "np.add.at(blocks, self._node, contact)",
        "blocks[self._node] += contact",
        "Jacobian: one of two boundaries at a common node",
    ),
    Mutant(
        "problem",
        "first + dofs",
        "dofs",
        "Jacobian: blocks in the rows of the first rank",
        ranks=2,
        tests=("ranks::test_one_rank_or_many",),
    ),
    Mutant(
        "problem",
        "largest * np.finfo(float).eps > tolerance * self.force_scale",
        "False",
        "residuals at round-off have no name",
        tests=("outcomes", "ladder"),
    ),
    # --- linear algebra ----------------------------------------------------------------------------------------------
    Mutant("condensed", "residual.aypx(-1.0, load)", "residual.aypx(1.0, load)", "condensed load, sign"),
    Mutant("condensed", "result.scale(-1.0)", "result.scale(1.0)", "interior recovered with the wrong sign"),
    Mutant(
        "condensed",
        "d.fixed[kept]",
        "np.zeros(kept.size, dtype=bool)",
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
        "moved is not None and moved <= _LAG",
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
        "d.stiffness.setNearNullSpace(_rigid_modes(d))",
        "pass",
        "multigrid without rigid motions",
        tests=("inexact",),
    ),
    Mutant(
        "full",
        "_LOOSE_TOLERANCE if self.inexact else _KRYLOV_TOLERANCE",
        "_LOOSE_TOLERANCE",
        "Krylov: loose to the end",
        tests=("inexact",),
    ),
    Mutant(
        "rotated",
        "np.stack([boundary.normal, boundary.tangent], axis=2)",
        "np.stack([boundary.normal, boundary.tangent], axis=1)",
        "rotation transposed",
        tests=("patch_anywhere::test_full_slip",),
    ),
    Mutant(
        "rotated",
        "first + system.contact_dofs",
        "system.contact_dofs",
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
        "coarsened",
        "self.prolongation.T @ self.inner.load.getArray(readonly=True)",
        "self.inner.load.getArray(readonly=True)[self.kept]",
        "coarse load taken, not gathered",
        tests=("boundary_levels::test_coarse_matrix_is_galerkins",),
    ),
    Mutant(
        "boundary_levels",
        "interpolation.T @ boundary.weight",
        "boundary.weight[rows]",
        "weights of few nodes are those of all",
        tests=("boundary_levels::test_coarse_matrix_is_galerkins",),
    ),
    # --- rigid motions, statics --------------------------------------------------------------------------------------
    Mutant("rigid", "-(x[:, 1] - centre[1]) / length", "(x[:, 1] - centre[1]) / length", "rotation is a shear"),
    Mutant(
        "rigid",
        "parallel.global_sum(boundary.comm, self.free.T @ rows.T @ rows @ self.free)",
        "self.free.T @ rows.T @ rows @ self.free",
        "a body is held by the contact nodes of this rank",
        ranks=2,
        tests=("parts_on_ranks::test_what_holds_a_body",),
    ),
    Mutant(
        "rigid",
        "parallel.global_sum(comm, rows.T @ rows)",
        "rows.T @ rows",
        "a body is held by the supports of this rank",
        ranks=2,
        tests=("parts_on_ranks::test_free_motions",),
    ),
    Mutant(
        "holding",
        "Status.SLIDES if data.has_friction and pressing else Status.OPEN",
        "Status.OPEN",
        "sliding is called opening",
        tests=("outcomes",),
    ),
    Mutant(
        "holding",
        "parallel.global_sum(boundary.comm, np.dot(boundary.weight, pressure)) > 0",
        "np.dot(boundary.weight, pressure) > 0",
        "a body presses where this rank says so",
        ranks=3,
        tests=("parts_on_ranks::test_how_a_body_gets_away",),
    ),
    Mutant(
        "holding",
        "(None if sign else 0.0, None)",
        "(None, None)",
        "statics: the foundation may pull",
        tests=("outcomes",),
    ),
    Mutant(
        "holding",
        "boundary.weight * data.bound",
        "data.bound",
        "statics: friction bound without its weight",
        tests=("invariances::test_statics_have_no_unit",),
    ),
    Mutant(
        "holding",
        "-sparse.diags(coupling).tocsr()[finite]",
        "sparse.diags(coupling).tocsr()[finite]",
        "statics: friction falls with the pressure",
    ),
    Mutant(
        "holding",
        "max(float(np.abs(resultant).max()), 1e-300)",
        "1.0",
        "statics in the units of the scene",
        tests=("invariances::test_statics_have_no_unit",),
    ),
    Mutant("resting", "data.gap - self.u_n", "data.gap + self.u_n", "gap from the resting place, sign"),
    Mutant(
        "resting",
        "(0.0 if slip_origin is None else slip_origin) - self.u_t",
        "(0.0 if slip_origin is None else slip_origin) + self.u_t",
        "slip from the resting place, sign",
        tests=("boundary_levels",),
    ),
    Mutant(
        "resting",
        "along > _SMALL * along.max(initial=0.0)",
        "along != 0",
        "round-off of a wall stops the body",
        tests=("ladder",),
    ),
    Mutant(
        "resting",
        "(gap[stops] / along[stops]).min()",
        "(gap[stops] / along[stops]).max()",
        "the body rests where the last node would touch",
        tests=("ladder",),
    ),
    # --- nested iteration --------------------------------------------------------------------------------------------
    Mutant(
        "nested",
        "np.where((slips == slips[:, :1]).all(axis=1), slips[:, 0], 0)",
        "-np.where((slips == slips[:, :1]).all(axis=1), slips[:, 0], 0)",
        "nested: slip carried over the wrong way",
        tests=("nested",),
    ),
    Mutant("nested", "distance[:, ::-1]", "distance", "nested: the farther neighbour counts more", tests=("nested",)),
    Mutant("nested", "(5, 6)", "(6, 5)", "nested: pressure and shear swapped", tests=("nested",)),
    Mutant("nested", "rows[rows[:, 0] == part]", "rows", "nested: neighbours on another boundary", tests=("nested",)),
    Mutant(
        "nested",
        "states[:, :, 3] > 0",
        "states[:, :, 3] < 1",
        "nested: contact and distance swapped",
        tests=("nested",),
    ),
    # --- certificate, functionals, resultants ------------------------------------------------------------------------
    Mutant(
        "quantities",
        "np.abs(shear) - contact.bound",
        "np.abs(shear) - 2 * contact.bound",
        "certificate: cone twice as wide",
        tests=("ladder",),
    ),
    Mutant(
        "quantities",
        "-pressure[~contact.bilateral]",
        "0 * pressure[~contact.bilateral]",
        "certificate: tension not seen",
        tests=("ladder",),
    ),
    Mutant(
        "quantities", "-shear * xi", "0 * shear * xi", "certificate: slip the wrong way not seen", tests=("ladder",)
    ),
    Mutant(
        "quantities",
        "normal, tangential = boundary.traces(nodal_reaction)",
        "normal, tangential = contact.pressure, contact.shear",
        "certificate trusts the solver",
        tests=("ladder",),
    ),
    Mutant(
        "quantities",
        "parallel.global_sum(comm, np.dot(values, values))",
        "np.dot(values, values)",
        "certificate: residual of this rank only",
        ranks=2,
        tests=("parts_on_ranks::test_certificate",),
    ),
    Mutant(
        "quantities",
        "-self.boundary.nodal_forces(self.pressure, nothing).sum(axis=0)",
        "self.boundary.nodal_forces(self.pressure, nothing).sum(axis=0)",
        "contact force on the foundation",
    ),
    Mutant(
        "quantities",
        "parallel.global_sum(comm, friction)",
        "friction",
        "friction force of this rank only",
        ranks=2,
        tests=("ranks::test_one_rank_or_many",),
    ),
    Mutant(
        "quantities",
        "self.shear * self.xi",
        "self.shear * self.u_t",
        "work of friction on the whole displacement",
        tests=("load_steps",),
    ),
    Mutant(
        "quantities",
        "np.dot(weight, self.u_t)",
        "self.u_t.sum()",
        "mean displacement without weights",
        tests=("quantities::test_mean_tangential_displacement",),
    ),
    Mutant(
        "quantities",
        "0.5 * float(self.internal.dot(self.displacement.x.petsc_vec))",
        "float(self.internal.dot(self.displacement.x.petsc_vec))",
        "strain energy without its half",
        tests=("oracle",),
    ),
    Mutant(
        "quantities",
        "trial - bound / 2",
        "trial - bound",
        "primal functional: friction beyond the bound",
        tests=("example1",),
    ),
    Mutant(
        "quantities",
        "data.lambda_hat**2 - (pressure - data.lambda_hat) ** 2",
        "data.lambda_hat**2 + (pressure - data.lambda_hat) ** 2",
        "dual functional: compliance, sign",
        tests=("example1",),
    ),
    # --- estimates ---------------------------------------------------------------------------------------------------
    Mutant(
        "estimators",
        "2 * tau[2] ** 2",
        "tau[2] ** 2",
        "estimate: shear stress counted once",
        tests=("quantities::test_compliance_is_the_inverse_of_the_stiffness",),
    ),
    Mutant(
        "estimators",
        "lame / (2 * (lame + mu)) * trace**2",
        "lame / (lame + mu) * trace**2",
        "estimate: compliance of the trace doubled",
        tests=("quantities::test_compliance_is_the_inverse_of_the_stiffness",),
    ),
    Mutant(
        "estimators",
        "moments.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)",
        "pass",
        "estimate: moments of other ranks forgotten",
        ranks=2,
        tests=("parts_on_ranks::test_error_estimate",),
    ),
    Mutant(
        "estimators",
        "self._recovered.x.scatter_forward()",
        "pass",
        "estimate: recovered stress of ghosts not sent",
        ranks=2,
        tests=("parts_on_ranks::test_error_estimate",),
    ),
    Mutant(
        "estimators",
        "parallel.global_sum(self._comm, self.squares(x).sum())",
        "self.squares(x).sum()",
        "estimate of this rank only",
        ranks=2,
        tests=("parts_on_ranks::test_error_estimate",),
    ),
    Mutant(
        "price_list",
        "(h[1:] ** 3 + h[:-1] ** 3) / 2",
        "h[1:] ** 3 + h[:-1] ** 3",
        "pressure: kinks count twice",
        tests=("price_list",),
    ),
    Mutant(
        "price_list",
        "(fine / coarse) ** rate - 1",
        "(fine / coarse) ** rate",
        "extrapolation: error of the finer mesh forgotten",
        tests=("price_list",),
    ),
    Mutant("price_list", "finer**2", "finer", "next mesh: unknowns grow like h", tests=("price_list",)),
    Mutant(
        "price_list",
        "p[inside] ** 2 - p[row] ** 2",
        "p[inside] - p[row]",
        "zone ends: no square root",
        tests=("price_list",),
    ),
    Mutant(
        "refinement",
        "parallel.global_sum(comm, squares[squares >= middle].sum())",
        "squares[squares >= middle].sum()",
        "marking: what this rank holds",
        ranks=2,
        tests=("parts_on_ranks::test_marking",),
    ),
    Mutant(
        "refinement",
        "parent_cell[place[children] - first]",
        "parent_cell[place[children]]",
        "regions of the cells of the first rank",
        ranks=2,
        tests=("parts_on_ranks::test_regions_of_a_refined_mesh",),
    ),
    Mutant(
        "checks",
        "1e-6 * n + 3e-9 * n**1.5",
        "1e-4 * n + 3e-7 * n**1.5",
        "factorisation time times 100",
        tests=("cost_model",),
    ),
    # --- tables, pictures, sweeps ------------------------------------------------------------------------------------
    Mutant(
        "io",
        "cells += sum(counts[: comm.rank])",
        "pass",
        "cells of all ranks on the nodes of the first",
        ranks=2,
        tests=("quantities::test_cells_for_pictures",),
    ),
    Mutant(
        "io",
        "cells[:, [0, 1, 3, 2]]",
        "cells",
        "pictures: quadrilaterals crossed",
        tests=("quantities::test_cells_for_pictures",),
    ),
    Mutant("contact_table", "row - 1", "row", "zones end one node too late", tests=("example1",)),
    Mutant(
        "contact_table",
        "np.cumsum(steps)",
        "steps",
        "arc length does not add up",
        tests=("quantities::test_arc_length",),
    ),
    Mutant(
        "parameter_sweep",
        "forces.external.scale(self._load)",
        "pass",
        "sweep: certificate with the load of 1",
        tests=("linalg::test_scaled_loads",),
    ),
    Mutant(
        "parameter_sweep",
        "system.set_step(0, self._load)",
        "system.set_step(0)",
        "sweep: interior with the load of 1",
        tests=("linalg::test_scaled_loads",),
    ),
    # --- expressions -------------------------------------------------------------------------------------------------
    Mutant(
        "expressions",
        "reduce(ufl.min_value, values)",
        "reduce(ufl.max_value, values)",
        "UFL: max for min",
        tests=("expressions",),
    ),
    Mutant(
        "expressions",
        "self._backend.both if isinstance(node.op, ast.And) else self._backend.either",
        "self._backend.either if isinstance(node.op, ast.And) else self._backend.both",
        "and, or swapped",
        tests=("expressions",),
    ),
    Mutant(
        "expressions",
        "reduce(self._backend.both, tests)",
        "tests[0]",
        "a < b < c: second half dropped",
        tests=("expressions",),
    ),
    Mutant(
        "expressions",
        "abs(_float(value.value)) > _MAX_EXPONENT",
        "_float(value.value) > _MAX_EXPONENT + 1",
        "exponents up to 101",
        tests=("expressions",),
    ),
    Mutant(
        "expressions",
        "(node.test, node.body, node.orelse)",
        "(node.test, node.orelse, node.body)",
        "A if C else B swapped",
        tests=("expressions",),
    ),
    # --- units -------------------------------------------------------------------------------------------------------
    Mutant(
        "solver",
        "scene.young / discretisation.tagged.size",
        "scene.young",
        "natural gamma without its length",
        tests=("strategy::test_path_following_has_no_unit",),
    ),
    Mutant(
        "mesh",
        "pdist(corners).max()",
        "pdist(corners).min()",
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
