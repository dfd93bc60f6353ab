"""A program of its own: multigrid with the PETSc options of its command line, which may crash."""

import sys
from contextlib import suppress

import mpi4py.MPI  # first: with wheels of PyPI its library is not found otherwise  # noqa: F401

# isort: split
import petsc4py

_SIZE = 400


def main() -> None:
    """Solve a small symmetric system by multigrid of both kinds; what PETSc refuses is no matter here."""
    petsc4py.init([sys.argv[0], "-no_signal_handler", *sys.argv[1:]])
    from petsc4py import PETSc

    matrix = PETSc.Mat().createAIJ((_SIZE, _SIZE), nnz=3)
    for row in range(_SIZE):
        columns = [column for column in (row - 1, row, row + 1) if 0 <= column < _SIZE]
        matrix.setValues(row, columns, [4.0 if column == row else -1.0 for column in columns])
    matrix.assemble()
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    x, right = matrix.createVecs()
    right.set(1.0)
    for kind in (PETSc.PC.Type.GAMG, PETSc.PC.Type.MG):
        ksp = PETSc.KSP().create()
        ksp.setOptionsPrefix("sfx_")
        ksp.setOperators(matrix)
        pc = ksp.getPC()
        pc.setType(kind)
        if kind == PETSc.PC.Type.MG:
            pc.setMGLevels(3)
            coarse = matrix
            for level in (2, 1):
                size = coarse.getSize()[0]
                pairs = PETSc.Mat().createAIJ((size, size // 2), nnz=1)
                for row in range(size):
                    pairs.setValue(row, row // 2, 1.0)
                pairs.assemble()
                pc.setMGInterpolation(level, pairs)
                coarse = coarse.ptap(pairs)
                smoother = pc.getMGSmoother(level - 1) if level == 2 else pc.getMGCoarseSolve()
                smoother.setOperators(coarse)
        with suppress(PETSc.Error):
            ksp.setFromOptions()
            ksp.solve(right, x)


if __name__ == "__main__":
    main()
