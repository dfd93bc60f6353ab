"""The block in space with GetFEM's contact brick, in a separate process: prints its answer as one line of JSON.

    python3 bench/space_getfem.py LAW NX

LAW is frictionless or coulomb; the brick has no Tresca friction.  The constraints are exact: the multipliers are forces
at the bottom nodes, found by the augmented Lagrangian of Alart & Curnier (1991) and Newton's method with MUMPS.  It
uses neither the package nor dolfinx.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np

LAWS = {"frictionless": 0.0, "coulomb": 0.3}  # with their coefficients
LENGTH, YOUNG, POISSON, TRACTION = 3.0, 5000.0, 0.4, (0.0, 4.0, -20.0)
MIDDLE = (1.5, 0.5, 1.0)
# The initial state is contact except at the ends, since otherwise nothing holds the body.  At the ends u_x and u_y are
# prescribed, so that the brick has no friction force to determine there.
_DOWN = -7e-3
# Force at a node per displacement, in units of Young's modulus times the width of a cell; and which of Alart &
# Curnier's Lagrangians.  None of the factors 0.1, 1 and 10 and of the four versions takes less time at 6,075 unknowns.
_AUGMENTATION, _VERSION = 1.0, 1
_RESIDUAL, _STEPS = 1e-8, 40
_ENDS, _LOADED, _BOTTOM = 1, 2, 3


def solve(law: str, nx: int, augmentation: float = _AUGMENTATION, version: int = _VERSION) -> dict[str, Any]:
    """The whole solve, from the mesh in memory: seconds, CPU seconds, Newton steps, and what ``space.Answer`` has.

    Raises:
        ImportError: there is no GetFEM.
        RuntimeError: Newton's method does not converge.
    """
    import getfem as gf

    gf.util_trace_level(0)
    ny = nx // 3
    mesh = gf.Mesh("cartesian", *(np.linspace(0.0, size, n + 1) for size, n in ((LENGTH, nx), (1.0, ny), (1.0, ny))))
    start, cpu = time.perf_counter(), time.process_time()
    near = 1e-6
    boxes = {
        _ENDS: [((-near, -near, -near), (near, 1 + near, 1 + near)), ((3 - near, -near, -near), (3 + near, 2.0, 2.0))],
        _LOADED: [((1 - near, -near, 1 - near), (2 + near, 1 + near, 1 + near))],
        _BOTTOM: [((-near, -near, -near), (3 + near, 1 + near, near))],
    }
    for region, parts in boxes.items():
        mesh.set_region(region, np.hstack([mesh.outer_faces_in_box(*part) for part in parts]))
    displacement = gf.MeshFem(mesh, 3)
    displacement.set_classical_fem(1)
    rule = gf.MeshIm(mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(3,3)"))

    model = gf.Model("real")
    model.add_fem_variable("u", displacement)
    model.add_initialized_data("mu", YOUNG / 2 / (1 + POISSON))
    model.add_initialized_data("lame", YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON))
    model.add_isotropic_linearized_elasticity_brick(rule, "u", "lame", "mu")
    model.add_initialized_data("traction", TRACTION)
    model.add_source_term_brick(rule, "u", "traction", _LOADED)
    place = displacement.basic_dof_nodes().T
    size = displacement.nbdof()
    ends = displacement.basic_dof_on_region(_ENDS)
    held = ends[ends % 3 != 2]
    model.add_variable("reaction", held.size)
    rows = _selection(gf, held, np.ones(held.size), size)
    model.add_constraint_with_multipliers("u", "reaction", rows, np.zeros(held.size))

    bottom = displacement.basic_dof_on_region(_BOTTOM)
    normal = bottom[bottom % 3 == 2]
    x = place[normal]
    edge = [np.where(np.isclose(x[:, k], 0.0) | np.isclose(x[:, k], end), 0.5, 1.0) for k, end in ((0, LENGTH), (1, 1))]
    weight = edge[0] * edge[1] * (LENGTH / nx) ** 2
    gap = 0.003 * ((x[:, 0] - 1.5) ** 2 + (x[:, 1] - 0.5) ** 2) + 0.001
    model.add_initialized_data("gap", gap)
    model.add_initialized_data("alpha", np.ones(normal.size))
    model.add_initialized_data("r", augmentation * YOUNG * LENGTH / nx)
    model.add_variable("pressure", normal.size)
    down = _selection(gf, normal, -np.ones(normal.size), size)
    coefficient = LAWS[law]
    if coefficient:
        along = (normal[:, None] + np.array([-2, -1])).ravel()
        model.add_variable("shear", along.size)
        model.add_initialized_data("coefficient", coefficient)
        sideways = _selection(gf, along, np.ones(along.size), size)
        what = ("u", "pressure", "shear", "r", down, sideways, "coefficient", "gap", "alpha", version)
    else:
        what = ("u", "pressure", "r", down, "gap", "alpha", version)
    model.add_basic_contact_brick(*what)
    u = np.zeros(size)
    u[2::3] = _DOWN
    model.set_variable("u", u)
    steps, _ = model.solve("max_res", _RESIDUAL, "max_iter", _STEPS, "lsolver", "mumps")
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    if steps >= _STEPS:
        raise RuntimeError(f"GetFEM has no solution after {_STEPS} Newton steps")

    u, pressure = model.variable("u"), -model.variable("pressure")
    shear = -model.variable("shear").reshape(-1, 2) if coefficient else np.zeros((normal.size, 2))
    bound = coefficient * pressure
    contact = pressure > 1e-9 * pressure.max()
    slip = contact & (coefficient > 0) & (np.linalg.norm(shear, axis=1) > (1 - 1e-6) * bound)
    middle = 2 + 3 * int(np.argmin(np.linalg.norm(place[::3] - np.array(MIDDLE), axis=1)))
    return {
        "seconds": seconds,
        "cpu": cpu,
        "steps": int(steps),
        "dofs": int(size),
        "peak_pressure": float((pressure / weight).max()),
        "deflection": float(u[middle]),
        "force": [*map(float, -shear.sum(axis=0)), float(pressure.sum())],
        "x": x[:, :2].tolist(),
        "contact": contact.tolist(),
        "slip": slip.tolist(),
    }


def _selection(gf: Any, columns: Any, values: Any, size: int) -> Any:
    """The matrix with one entry in each row."""
    matrix = gf.Spmat("empty", columns.size, size)
    for row, (column, value) in enumerate(zip(columns, values, strict=True)):
        matrix.add(row, int(column), float(value))
    return matrix


def main(arguments: list[str]) -> int:
    """Solve and print."""
    law, nx = arguments
    print(json.dumps(solve(law, int(nx))))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
