"""A program in 3D written by hand: Newton's method in plain dolfinx, GAMG set up on stiffness plus contact terms.

It has the usual optimisations that PETSc allows.  The stiffness is assembled once.  The contact terms are blocks of 3 x
3 at the bottom nodes (lumped by the vertices), which are written into the stiffness.  CG, or GMRES where Coulomb
friction makes the matrix unsymmetric, starts from the last displacement, with a larger tolerance while many nodes
change (inexact Newton).  GAMG gets the rigid motions and is set up for each matrix.  A slipping node keeps its
direction and resists turning, as in the package (Hueber, Stadler, Wohlmuth 2008): otherwise Newton's method does not
converge.

Residuals are measured after preconditioning: without it the penalty dominates the norm, which is then small for a
displacement that is not in equilibrium.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import linear
import numpy as np
import space
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc
from space import Answer, Flags, Floats, Run

from signorini_fx.mechanics.mesh.tagged import TaggedMesh

NEWTON_STEPS = 60
# Reduction of the residual by a linear solve, while sets change and when they stay.  Tuned at 42,483 unknowns, between
# 0.1 and 1e-5: within 15 % of the least time for each law and gamma.  With a larger value than the last one, Coulomb
# friction with a large gamma does not converge on all meshes, because the residual of GMRES is then a poor measure of
# the error.
_WIDE, _CLOSE = 0.01, 1e-4
_WIDE_UNSYMMETRIC, _LARGE_GAMMA = 1e-4, 1e7
# Relative change of the displacement at the end.
_ERROR = 1e-9
# The directions of slip have settled when the friction law is met to this share of the bound.
_LAW = 1e-7


@dataclass
class _Sets:
    """Contact, slip, its directions and the stiffness against turning, at the bottom nodes."""

    contact: Flags
    slip: Flags
    direction: Floats
    turning: Floats


class Rival:
    """The block, assembled.

    Args:
        tagged: the mesh in memory.
        law: of ``space.LAWS``.
        gamma: of contact and friction.
        reuse: whether GAMG keeps its interpolation from the first matrix.
    """

    def __init__(self, tagged: TaggedMesh, law: str, gamma: float, *, reuse: bool = False) -> None:
        ends = {"left": (0, 1), "right": (0, 1)}
        self.space, self.matrix, self.load, fixed = space.assemble(tagged, ends)
        self.gamma, self.law = gamma, space.LAWS[law]
        bottom = tagged.facets("bottom")
        self.nodes = fem.locate_dofs_topological(self.space, 2, bottom)
        self.place = self.space.tabulate_dof_coordinates()[self.nodes]
        self.gap = 0.003 * ((self.place[:, 0] - 1.5) ** 2 + (self.place[:, 1] - 0.5) ** 2) + 0.001
        ds = ufl.Measure("ds", domain=tagged.mesh, subdomain_data=tagged.facet_tags)(tagged.boundaries["bottom"])
        test = ufl.TestFunction(self.space)
        self.weight = fem_petsc.assemble_vector(fem.form(test[2] * ds)).getArray()[3 * self.nodes + 2]
        free = np.ones(self.load.getSize())
        for condition in fixed:
            free[condition.dof_indices()[0]] = 0.0
        self.free = free.reshape(-1, 3)[self.nodes]
        self.elastic = self._blocks()
        self.unsymmetric = self.law["law"] == "coulomb"
        self.ksp = PETSc.KSP().create(tagged.mesh.comm)
        self.ksp.setType(PETSc.KSP.Type.GMRES if self.unsymmetric else PETSc.KSP.Type.CG)
        if self.unsymmetric:
            self.ksp.setGMRESRestart(200)
        self.ksp.setOperators(self.matrix)
        self.ksp.getPC().setType(PETSc.PC.Type.GAMG)
        with linear.petsc_options({"pc_gamg_reuse_interpolation": "true" if reuse else "false"}):
            self.ksp.setFromOptions()
        self.y = self.load.duplicate()
        self.right, self.change = self.load.duplicate(), self.load.duplicate()
        self.solves = self.steps = 0

    def _blocks(self) -> Floats:
        """The blocks of the stiffness at the bottom nodes."""
        rows = (3 * self.nodes[:, None] + np.arange(3)).astype(PETSc.IntType)
        return np.array([self.matrix.getValues(row, row) for row in rows])

    def _values(self) -> Floats:
        return np.asarray(self.y.getArray(readonly=True).reshape(-1, 3)[self.nodes])

    def bound(self, values: Floats) -> Floats:
        """The friction bound at a displacement of the bottom nodes."""
        if self.law["law"] == "tresca":
            return np.full(len(values), float(self.law["bound"]))
        if self.law["law"] == "none":
            return np.zeros(len(values))
        pressure = self.gamma * np.maximum(-values[:, 2] - self.gap, 0.0)
        return np.asarray(self.law["coefficient"] * pressure)

    def _step(self, sets: _Sets, bound: Floats, tolerance: float) -> None:
        """Solve with given sets."""
        gamma, count = self.gamma, self.nodes.size
        e, contact, slip = sets.direction, sets.contact, sets.slip
        acting = bound > 0
        block, force = np.zeros((count, 3, 3)), np.zeros((count, 3))
        block[:, 2, 2] = np.where(contact, gamma, 0.0)
        force[:, 2] = np.where(contact, -gamma * self.gap, 0.0)
        across = np.eye(2) - e[:, :, None] * e[:, None, :]
        sliding = np.where(slip & acting, sets.turning, 0.0)[:, None, None] * across
        sticking = np.where(~slip & acting, gamma, 0.0)[:, None, None] * np.eye(2)
        block[:, :2, :2] = sliding + sticking
        if self.unsymmetric:  # the bound is F gamma (-u_z - gap) of the new displacement
            pull = np.where((slip & contact)[:, None], self.law["coefficient"] * gamma * e, 0.0)
            block[:, :2, 2] = -pull
            force[:, :2] = pull * self.gap[:, None]
        else:
            force[:, :2] = -np.where((slip & acting)[:, None], bound[:, None] * e, 0.0)
        block *= self.weight[:, None, None] * self.free[:, :, None] * self.free[:, None, :]
        force *= self.weight[:, None] * self.free
        starts = np.arange(count + 1, dtype=PETSc.IntType)
        nodes = self.nodes.astype(PETSc.IntType)
        self.matrix.setValuesBlockedIJV(starts, nodes, self.elastic + block, rowmap=nodes)
        self.matrix.assemble()
        if not self.unsymmetric:
            self.matrix.setOption(PETSc.Mat.Option.SPD, True)
        self.load.copy(self.right)
        self.right.getArray().reshape(-1, 3)[self.nodes] += force
        self.ksp.setTolerances(rtol=tolerance, max_it=2000)
        self.ksp.setOperators(self.matrix)
        self.matrix.mult(self.y, self.change)
        self.right.axpy(-1.0, self.change)
        self.ksp.solve(self.right, self.change)
        self.y.axpy(1.0, self.change)
        if self.ksp.getConvergedReason() <= 0:
            raise RuntimeError(f"a linear solve ended with reason {self.ksp.getConvergedReason()}")
        self.solves += 1
        self.steps += self.ksp.getIterationNumber()

    def next_sets(self, sets: _Sets) -> tuple[_Sets, Floats]:
        """The sets at the displacement, and by how much the friction law is violated, relative to the bound."""
        values = self._values()
        contact, bound = -values[:, 2] > self.gap, self.bound(values)
        elastic = self.gamma * values[:, :2] * self.free[:, :2]
        along = np.einsum("ij,ij->i", elastic, sets.direction)
        size = np.linalg.norm(elastic, axis=1)
        slip = np.where(sets.slip, along > bound, size > bound) & (bound > 0)
        fresh = slip & ~sets.slip
        # The shear of a node that continues to slip, and its direction.
        turning = sets.turning[:, None] * (values[:, :2] - along[:, None] / self.gamma * sets.direction)
        shear = bound[:, None] * sets.direction + turning
        direction = np.where(fresh[:, None], elastic, shear)
        length = np.linalg.norm(direction, axis=1)
        direction = np.where(slip[:, None], direction / np.where(length > 0, length, 1.0)[:, None], 0.0)
        along = np.einsum("ij,ij->i", values[:, :2], direction)
        stiffness = np.where(slip, bound / np.maximum(along, np.where(bound > 0, bound, 1.0) / self.gamma), 0.0)
        onto = bound[:, None] * elastic / np.where(size > 0, size, 1.0)[:, None]
        missed = np.where(slip & sets.slip, np.linalg.norm(shear - onto, axis=1), 0.0)
        share = missed / np.where(bound > 0, bound, 1.0)
        return _Sets(contact, slip, direction, stiffness), share

    def solve(self) -> _Sets:
        """Newton's method from contact and stick everywhere.

        Raises:
            RuntimeError: it does not converge.
        """
        count = self.nodes.size
        sets = _Sets(np.ones(count, dtype=bool), np.zeros(count, dtype=bool), np.zeros((count, 2)), np.zeros(count))
        bound = self.bound(np.full((count, 3), -1.0))
        large = self.unsymmetric and self.gamma > _LARGE_GAMMA
        loose = tolerance = _WIDE_UNSYMMETRIC if large else _WIDE
        for _ in range(NEWTON_STEPS):
            self._step(sets, bound, tolerance)
            left = tolerance * self.change.norm() / self.y.norm()
            found, missed = self.next_sets(sets)
            bound = self.bound(self._values())
            same = np.array_equal(found.contact, sets.contact) and np.array_equal(found.slip, sets.slip)
            if same and missed.max() <= _LAW and left <= _ERROR:
                return sets
            sets, tolerance = found, _CLOSE if same else loose
        raise RuntimeError(f"the rival has no solution after {NEWTON_STEPS} Newton steps")

    def answer(self, sets: _Sets) -> Answer:
        """The answer in the common form."""
        values = self._values()
        bound = self.bound(values)
        gamma, e = self.gamma, sets.direction
        across = values[:, :2] - np.einsum("ij,ij->i", values[:, :2], e)[:, None] * e
        sliding = bound[:, None] * e + sets.turning[:, None] * across
        shear = np.where(sets.slip[:, None], sliding, np.where((bound > 0)[:, None], gamma * values[:, :2], 0.0))
        pressure = np.where(sets.contact, gamma * (-values[:, 2] - self.gap), 0.0)
        force = np.append(-(self.weight[:, None] * shear).sum(axis=0), self.weight @ pressure)
        deflection = float(self.y.getArray(readonly=True)[3 * space.node_at(self.space, space.MIDDLE) + 2])
        return Answer.at(deflection, force, self.place, sets.contact, sets.slip & (bound > 0))


def solve(tagged: TaggedMesh, law: str, gamma: float, *, reuse: bool = False) -> Run:
    """The whole solve, from the function space."""
    start, cpu = time.perf_counter(), time.process_time()
    rival = Rival(tagged, law, gamma, reuse=reuse)
    sets = rival.solve()
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    note = f"{rival.solves} Newton steps, {rival.steps} Krylov steps"
    return Run(seconds, cpu, rival.steps, rival.solves, rival.load.getSize(), note, answer=rival.answer(sets))
