"""Equilibrium of a foreign displacement, in the formulation that fits best.

The residual r = f_int(v) - L of the components that are free (neither held nor of a node in contact), along directions
that keep to ties and equations, is taken in the dual norm,

    rho = sqrt(r . K^-1 r) / sqrt(v . K v),

K that of full integration, which is the relative distance in the energy norm of v from the displacement in equilibrium
with the same values on supports and contact: it has no unit and does not depend on the mesh.  A body that expands
stores less than v . K v where it does so freely; then the energy that it stores takes its place, so that loads are not
small beside the expansion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from signorini_fx.addons.judging.formulations import (
    EXACT,
    FULL,
    INCOMPATIBLE,
    SELECTIVE,
    SELECTIVE_EXACT,
    UNIFORM,
    Formulation,
    candidates,
    forces_of_strains,
    square_of_strains,
    stiffness_by_material,
)
from signorini_fx.addons.judging.linked_nodes import free_directions
from signorini_fx.addons.judging.problem_data import JudgedProblem
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import (
    JUDGED_EQUILIBRIUM,
    JUDGED_EQUILIBRIUM_OF_PRINT,
    JUDGED_HOURGLASS,
    JUDGED_HOURGLASS_LEFT,
    JUDGED_HOURGLASS_NODE,
    JUDGED_SHIFT,
    JUDGED_SOLVED,
    JUDGED_STORED,
    JUDGED_SURE,
)


@dataclass(frozen=True)
class Forces:
    """Internal forces of a displacement in one formulation.

    Attributes:
        formulation: it.
        by_material: those of each material, and behind them of each spring, force, shape (materials + springs, n d).
        strains: those by which each initial strain expands the body, which ``by_material`` is less, force, shape
            (strains, n d).
        columns: what unknowns of the formulation add that only contact determines, shape (n d, k).
    """

    formulation: Formulation
    by_material: Floats
    strains: Floats
    columns: Floats

    @property
    def total(self) -> Floats:
        """Their sum, shape (n d,)."""
        return np.asarray(self.by_material.sum(axis=0))

    @property
    def of_displacement(self) -> Floats:
        """Their sum without initial strains, shape (n d,)."""
        return np.asarray(self.total + self.strains.sum(axis=0))


@dataclass(frozen=True)
class Fit:
    """The equilibrium of a displacement in one formulation.

    Attributes:
        forces: its internal forces.
        rho: relative dual norm of the residual.
        residual: internal forces less loads, force, shape (n, d): on supports and contact what these exert.
        worst: the node whose free components do not fit most; and the share of the residual that it has.
        worst_share: see ``worst``.
    """

    forces: Forces
    rho: float
    residual: Floats
    worst: int
    worst_share: float

    @property
    def formulation(self) -> Formulation:
        """In which it is."""
        return self.forces.formulation


class JudgedStiffness:
    """What the equilibrium of any displacement of a problem needs, which neither loads nor initial strains change.

    Attributes:
        springs: the stiffness of each, shape (n d, n d).
        free: numbers of the components that are free.
        basis: the directions that are free, shape (n d, m), see ``free_directions``.
        independent: the component that each of them changes by 1, shape (m,).

    Args:
        problem: the problem.
    """

    def __init__(self, problem: JudgedProblem) -> None:
        self._problem, self._by_material = problem, dict[Formulation, list[csr_array]]()
        self.springs = list(problem.springs.values())
        self.free = np.flatnonzero(problem.free.ravel())
        self.basis, self.independent = free_directions(problem.links, self.free, problem.free.size)

    def by_material(self, formulation: Formulation) -> list[csr_array]:
        """See ``stiffness_by_material``."""
        if formulation not in self._by_material:
            self._by_material[formulation] = stiffness_by_material(self._problem, formulation)
        return self._by_material[formulation]

    @cached_property
    def plain(self) -> csr_array:
        """K, shape (n d, n d)."""
        matrices = self.by_material(FULL)
        return sum((*matrices[1:], *self.springs), matrices[0])

    @cached_property
    def factor(self) -> splu:
        """That of K along the directions that are free."""
        inner = csc_array(self.basis.T @ self.plain @ self.basis)
        shift = JUDGED_SHIFT * inner.diagonal().max()  # of bodies that nothing holds
        inner.setdiag(inner.diagonal() + shift)
        options = {"SymmetricMode": True}
        return splu(inner, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


class Equilibrium:
    """The equilibrium of one displacement.

    Args:
        problem: the problem.
        v: the displacement, length, shape (n, d).
        half_digits: half a unit of the last digit that was printed, length, shape (n, d); no solver has more digits
            than some of the largest displacement.
        system: of the problem, perhaps with other loads or initial strains; None: it is made.
    """

    def __init__(
        self, problem: JudgedProblem, v: Floats, half_digits: Floats, system: JudgedStiffness | None = None
    ) -> None:
        self.problem, self.v = problem, v
        self.system = JudgedStiffness(problem) if system is None else system
        self._half_digits = np.maximum(half_digits, JUDGED_SOLVED * np.abs(v).max(initial=0.0))
        self.loads = np.array([forces.ravel() for forces in problem.loads.values()]).reshape(-1, v.size)

    @cached_property
    def moving(self) -> float:
        """a(v, v), an energy."""
        return float(self.v.ravel() @ (self.system.plain @ self.v.ravel()))

    @cached_property
    def energy(self) -> float:
        """a(v, v), or with initial strains twice the energy that is stored if this is less, down to a share of it."""
        expansion = forces_of_strains(self.problem, FULL).sum(axis=(0, 1))
        stored = self.moving - 2 * float(expansion @ self.v.ravel()) + square_of_strains(self.problem)
        return min(self.moving, max(stored, JUDGED_STORED**2 * self.moving))

    def solved(self, columns: Floats) -> Floats:
        """K^-1 of forces along the directions that are free, shape (n d, k) -> (directions, k)."""
        if not self.system.independent.size or not columns.shape[1]:
            return np.zeros((self.system.independent.size, columns.shape[1]))
        return np.asarray(self.system.factor.solve(np.ascontiguousarray(self.system.basis.T @ columns)))

    def least(self, start: Floats, columns: Floats) -> tuple[Floats, Floats]:
        """The factors z with which start + columns z is smallest in the dual norm, and what remains.

        Args:
            start: forces, shape (n d,).
            columns: forces, shape (n d, k).
        """
        inner = self.system.basis.T @ columns
        scales = np.linalg.norm(inner, axis=0)
        used = scales > 0
        factors = np.zeros(columns.shape[1])
        if used.any():
            solved = self.solved(columns[:, used] / scales[used])
            gram = (inner[:, used] / scales[used]).T @ solved
            right = solved.T @ (self.system.basis.T @ start)
            factors[used] = -np.linalg.lstsq(gram, right, rcond=1e-12)[0] / scales[used]
        return factors, np.asarray(start + columns @ factors)

    def size(self, forces: Floats) -> float:
        """The dual norm of the free components of forces, relative to the root of ``energy``."""
        square = float((self.system.basis.T @ forces) @ self.solved(forces[:, None])[:, 0])
        return float(np.sqrt(max(square, 0.0) / self.energy)) if self.energy > 0 else np.inf

    @cached_property
    def printed(self) -> float:
        """Rho that the digits of the displacement leave, independent at each node."""
        diagonal = self.system.plain.diagonal()[self.system.free]
        square = float(diagonal @ self._half_digits.ravel()[self.system.free] ** 2) / 3
        return float(np.sqrt(square / self.energy)) if self.energy > 0 else np.inf

    @property
    def threshold(self) -> float:
        """Of rho."""
        return max(JUDGED_EQUILIBRIUM, JUDGED_EQUILIBRIUM_OF_PRINT * self.printed)

    def forces(self, formulation: Formulation) -> Forces:
        """The internal forces in a formulation."""
        matrices = self.system.by_material(formulation)
        strained = forces_of_strains(self.problem, formulation)
        of_springs = np.array([matrix @ self.v.ravel() for matrix in self.system.springs]).reshape(-1, self.v.size)
        if not formulation.layer:
            by_material = np.array([matrix @ self.v.ravel() for matrix in matrices]) - strained.sum(axis=0)
            columns = np.zeros((self.v.size, 0))
            return Forces(formulation, np.vstack((by_material, of_springs)), strained.sum(axis=1), columns)
        in_layer = self._forces_of_layer(formulation, matrices, strained)
        return replace(in_layer, by_material=np.vstack((in_layer.by_material, of_springs)))

    def _forces_of_layer(self, formulation: Formulation, matrices: list[csr_array], strained: Floats) -> Forces:
        """Of a layer of bricks, whose displacement out of the plane is free but where friction holds it.

        Args:
            formulation: it.
            matrices: the stiffness of each material, shape (3 n, 3 n).
            strained: forces of initial strains, shape (strains, materials, 3 n).
        """
        count = len(self.v)
        total = sum(matrices[1:], matrices[0])
        rubbing = np.zeros(count, dtype=bool)
        for contact in self.problem.contacts:
            if contact.rubs or contact.bonded:
                rubbing[contact.nodes] = True
        in_plane, across = np.arange(3 * count).reshape(-1, 3)[:, :2].ravel(), 3 * np.arange(count) + 2
        loose, held = across[~rubbing], across[rubbing]
        inner = total[loose][:, loose].tocsc()
        inner.setdiag(inner.diagonal() + JUDGED_SHIFT * inner.diagonal().max())
        factor = splu(inner)
        unknown = np.zeros((3 * count, 1 + held.size))
        unknown[in_plane, 0] = self.v.ravel()
        unknown[held, 1:] = np.eye(held.size)
        unknown[loose] = -factor.solve(np.ascontiguousarray(total[loose] @ unknown))
        swollen = np.zeros((3 * count, len(strained)))
        swollen[loose] = factor.solve(np.ascontiguousarray(strained.sum(axis=1)[:, loose].T))
        moved = unknown[:, 0] + swollen.sum(axis=1)
        parts = np.array([matrix[in_plane] @ moved for matrix in matrices]) - strained.sum(axis=0)[:, in_plane]
        expanding = strained.sum(axis=1)[:, in_plane] - (total[in_plane] @ swollen).T
        return Forces(formulation, parts, expanding, np.asarray(total[in_plane] @ unknown[:, 1:]))

    def fit(self, formulation: Formulation) -> Fit:
        """The equilibrium in a formulation."""
        forces = self.forces(formulation)
        _, residual = self.least(forces.total - self.loads.sum(axis=0), forces.columns)
        missed = self.solved(residual[:, None])[:, 0]
        work = np.zeros(self.v.size)
        work[self.system.independent] = np.abs(missed * (self.system.basis.T @ residual))
        by_node = work.reshape(self.v.shape).sum(axis=1)
        worst = int(np.argmax(by_node))
        share = float(by_node[worst] / by_node.sum()) if by_node.any() else 0.0
        return Fit(forces, self.size(residual), residual.reshape(self.v.shape), worst, share)

    @cached_property
    def by_quadrature(self) -> float:
        """Rho of what rules of quadrature make different of initial strains with a jump or a kink inside cells."""
        switching = replace(self.problem, strains=tuple(strain for strain in self.problem.strains if strain.switches))
        if not switching.strains:
            return 0.0
        full, exact = (forces_of_strains(switching, rule).sum(axis=(0, 1)) for rule in (FULL, EXACT))
        return self.size(full - exact)

    def doubt(self, fit: Fit) -> float:
        """How large a force may be that is none: what is left where forces of expansion cancel in a displacement in
        equilibrium, or by the digits of the displacements around nodes in contact.
        """
        expansion = fit.forces.strains.sum(axis=0).reshape(self.v.shape)
        squares = self.system.plain.multiply(self.system.plain) @ self._half_digits.ravel() ** 2 / 3
        of_digits = np.sqrt(squares.reshape(self.v.shape).sum(axis=1))[self.problem.touching].sum()
        expanded = np.linalg.norm(expansion, axis=1).sum()
        return float(self.threshold * expanded + JUDGED_EQUILIBRIUM_OF_PRINT * of_digits)

    def moved_by(self, fit: Fit) -> Floats:
        """By how much the free components must move to be in equilibrium, length, shape (n, d)."""
        missed = self.system.basis @ -self.solved(fit.residual.reshape(-1, 1))[:, 0]
        return np.asarray(missed).reshape(self.v.shape)


def own_formulation(problem: JudgedProblem) -> Formulation | None:
    """That of the elements of its deck, as CalculiX has them; None: not known."""
    kind = problem.element
    if not kind:
        return None
    layer = problem.hypothesis == "plane stress"
    reduced = kind.endswith("R") or kind.endswith("RH")
    if kind.startswith("C3D8I") or kind.endswith("I"):
        return Formulation(INCOMPATIBLE)
    if hourglass(problem):
        return Formulation(UNIFORM, layer)
    return Formulation("reduced" if reduced and not problem.mesh.element.simplex else "full", layer)


def stated_formulations(problem: JudgedProblem) -> list[Formulation]:
    """That of the elements of a deck; of a scene, which has no rule of quadrature, those that it may mean."""
    if problem.deck is not None:
        stated = own_formulation(problem)
        return [Formulation("full", problem.hypothesis == "plane stress")] if stated is None else [stated]
    fewer = problem.statement.element.volumetric in ("auto", "reduced")
    names = ["full", "exact", *[SELECTIVE, SELECTIVE_EXACT] * fewer]
    return [Formulation(name) for name in names]


def hourglass(problem: JudgedProblem) -> bool:
    """Whether the elements of its deck have a stiffness against hourglassing, which is known of some programs only."""
    reduced = problem.element.endswith("R") or problem.element.endswith("RH")
    return reduced and problem.mesh.element.degree == 1 and not problem.mesh.element.simplex


@dataclass(frozen=True)
class BestFit:
    """The formulation that fits best.

    Attributes:
        fit: in it.
        tried: all fits.
        as_stated: whether it is that of the elements of the deck, or of a problem without a deck the plain one.
        exact: whether the residual is below its threshold.
        resolution: what rho means nothing below: the threshold, or rho of a formulation that is not known.
        similar: whether the reduced formulation fits much better than others, as with a stiffness against hourglassing.
    """

    fit: Fit
    tried: tuple[Fit, ...]
    as_stated: bool
    exact: bool
    resolution: float
    similar: bool


def best_fit(equilibrium: Equilibrium, *, of_calculix: bool = False) -> BestFit:
    """Try the formulation of the deck first, then others until one fits.

    Args:
        equilibrium: of the displacement.
        of_calculix: whether the stiffness against hourglassing is that of CalculiX: then none that is similar will do.
    """
    problem = equilibrium.problem
    stated = stated_formulations(problem)
    tried: list[Fit] = []
    for formulation in sorted(candidates(problem), key=lambda entry: entry not in stated):
        least = min((fit.rho for fit in tried), default=np.inf)
        # Of several that a scene may mean the best one is taken, unless one is sure.
        if least <= (JUDGED_SURE if formulation in stated else equilibrium.threshold):
            break
        tried.append(equilibrium.fit(formulation))
    best = min(tried, key=lambda entry: entry.rho)
    exact = best.rho <= equilibrium.threshold
    softer = ("reduced", UNIFORM)
    unreduced = [entry.rho for entry in tried if entry.formulation.name not in softer]
    much_better = best.rho <= JUDGED_HOURGLASS * min(unreduced, default=0.0)
    similar = (
        not exact
        and not of_calculix
        and problem.mesh.element.degree == 1
        and best.formulation.name in softer
        and best.rho <= JUDGED_HOURGLASS_LEFT
        and (hourglass(problem) or (best.worst_share <= JUDGED_HOURGLASS_NODE and much_better))
    )
    as_stated = exact and best.formulation.name in {formulation.name for formulation in stated}
    resolution = max(best.rho, equilibrium.threshold) if similar else equilibrium.threshold
    return BestFit(best, tuple(tried), as_stated, exact, resolution, similar)
