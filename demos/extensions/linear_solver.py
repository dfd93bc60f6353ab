"""A linear solver of one's own: MUMPS with its factor compressed (block low-rank), which takes less
memory.

The factor is not exact; FGMRES makes up for the rest, and the certificate judges the result as
always.
"""

from pathlib import Path

from mpi4py import MPI  # noqa: F401  # before PETSc
from petsc4py import PETSc

from signorini_fx import read_scene, solve
from signorini_fx.extensions import register


class BlockLowRank:
    """Sees the stiffness with the contact blocks each time that it changes, and solves with it."""

    def set_up(self, matrix):
        self.pc = PETSc.PC().create(matrix.comm)
        self.pc.setOperators(matrix)
        self.pc.setType(PETSc.PC.Type.LU)
        self.pc.setFactorSolverType("mumps")
        self.pc.setFactorSetUpSolverType()
        factor = self.pc.getFactorMatrix()
        factor.setMumpsIcntl(35, 1)  # compress blocks
        factor.setMumpsCntl(7, 1e-6)  # to this accuracy

    def solve(self, b, x):
        self.pc.apply(b, x)


register("signorini_fx.linear_solvers", "block-low-rank", BlockLowRank)

if __name__ == "__main__":
    scene = read_scene(Path(__file__).parents[1] / "scenes" / "example1_coulomb.toml")
    settings = scene.solver.model_copy(update={"linear_algebra": "block-low-rank"})
    print(solve(scene.model_copy(update={"solver": settings})))
