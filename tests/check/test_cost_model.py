"""The cost that ``check`` foresees, against what the factorisation counts; no clock is read."""

import subprocess
import sys
from itertools import pairwise

import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import example1

from signorini_fx.algebra.linalg.factorisation import has_package
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.records import Timings
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.mesh import load_mesh

# What a core of the 2020s does in a sparse factorisation: from small fronts, where the ordering takes most of the
# time, to large ones that run at the speed of a dense product.
SLOWEST, FASTEST = 5e8, 2e10  # operations a second


@pytest.mark.one_quick
@pytest.mark.skipif(not has_package("mumps"), reason="MUMPS counts")
@pytest.mark.parametrize(("cell", "degree"), [("quadrilateral", 1), ("triangle", 1), ("quadrilateral", 2)])
def test_operations_and_entries_of_a_factorisation(cell, degree):
    """Seconds are those of the operations on a core of the 2020s, bytes those of the entries to a factor of two."""
    speeds = []
    for nx in (30, 60, 120):
        cells = nx // degree
        scene = example1(nx=cells, ny=cells // 3, cell=cell, degree=degree, linear_algebra="full")
        cost = check_scene(scene, MPI.COMM_SELF).cost
        pc = PETSc.PC().create(MPI.COMM_SELF)
        pc.setOperators(discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings()).stiffness)
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("mumps")
        pc.setUp()
        factor = pc.getFactorMatrix()
        speeds.append(factor.getMumpsRinfog(3) / cost.factorisation_seconds)
        assert 0.5 <= cost.factorisation_bytes / (8.0 * factor.getMumpsInfog(9)) <= 2.0
    assert all(SLOWEST <= speed <= FASTEST for speed in speeds)
    # Operations grow like n^1.5 and what else there is like n: the speed rises, and never by more than that.
    assert all(1.0 <= fine / coarse <= 4.0**0.5 * 1.25 for coarse, fine in pairwise(speeds))


PAIR = """
[[body]]
name = "a"
mesh = { generator = "box", parameters = { nx = 40, ny = 40, nz = 1, width = 3.0, height = 0.1 } }
[[body]]
name = "b"
mesh = { generator = "box", parameters = { nx = 41, ny = 41, nz = 1, width = 3.0, height = 0.1 } }
shift = [0.0, 0.0, 0.1]
[material]
young = 1000.0
poisson = 0.3
[[displacement]]
boundary = "a.bottom"
x = 0.0
y = 0.0
z = 0.0
[[displacement]]
boundary = "b.top"
x = 0.0
y = 0.0
z = -0.001
[[contact]]
boundary = "b.bottom"
against = "a.top"
"""
PEAK = """
import re, sys
from pathlib import Path
from signorini_fx import read_scene, solve
from signorini_fx.scenes.checks import check_scene


def peak():  # of this program alone; getrusage counts that of the process which it was forked from, too
    return 1024 * int(re.search(r"VmHWM:\\s*(\\d+)", Path("/proc/self/status").read_text())[1])


foreseen = check_scene(read_scene(sys.argv[1])).cost.memory_bytes
checked = peak()
solve(sys.argv[1])
print(foreseen, checked, peak())
"""


@pytest.mark.slow
def test_memory_of_two_bodies(tmp_path):
    """What a process of its own takes to solve a pair with many nodes is foreseen to a factor of two."""
    (tmp_path / "scene.toml").write_text(PAIR)
    told = subprocess.run([sys.executable, "-c", PEAK, str(tmp_path / "scene.toml")], capture_output=True, check=True)
    foreseen, checked, solved = map(float, told.stdout.split())
    assert 0.5 < foreseen / solved < 2.0
    assert checked < foreseen
