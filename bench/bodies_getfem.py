"""Two bodies with GetFEM's integral contact brick, in a separate process: prints its answer as one line of JSON.

    python3 bench/bodies_getfem.py MESHES.npz COEFFICIENT

The brick between meshes that do not match is an augmented Lagrangian of Alart & Curnier with multipliers on the slave,
for small sliding; Newton's method with MUMPS.  The brick by raytracing, for large sliding, takes 1.6 to 2 times as
long.  It uses neither the package nor dolfinx.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np

# The Lagrangian's parameter over Young's modulus of the slave.
_AUGMENTATION = 1.0
# With 1e-8 displacements of 22 356 unknowns with friction are still 1e-4 from where they go, with 1e-10 4e-7.
_RESIDUAL, _STEPS = 1e-10, 60
_CONTACT, _HELD = 1, 2
# Corners of a hexahedron in GetFEM's order from Abaqus's.
_ORDER = [0, 1, 3, 2, 4, 5, 7, 6]


def solve(data: Any, coefficient: float) -> dict[str, Any]:
    """Solve, from the meshes in memory: CPU seconds, displacements, the force on the top.

    Raises:
        ImportError: there is no GetFEM.
        RuntimeError: Newton's method does not converge.
    """
    import getfem as gf

    gf.util_trace_level(0)
    start = time.process_time()
    model = gf.Model("real")
    spaces, rules, meshes = dict[str, Any](), dict[str, Any](), dict[str, Any]()
    for name, inward in (("upper", 1), ("lower", -1)):
        points, cells = data[f"{name}_points"], data[f"{name}_cells"]
        mesh = meshes[name] = gf.Mesh("empty", 3)
        corners = points[cells[:, _ORDER]].transpose(2, 1, 0)
        mesh.add_convex(gf.GeoTrans("GT_QK(3,1)"), np.ascontiguousarray(corners))
        faces = mesh.outer_faces()
        vertical = inward * mesh.normal_of_faces(faces)[2]
        mesh.set_region(_CONTACT, faces[:, vertical < -0.7])
        mesh.set_region(_HELD, faces[:, vertical > 0.7])
        space = spaces[name] = gf.MeshFem(mesh, 3)
        space.set_classical_fem(1)
        rules[name] = gf.MeshIm(mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(3,3)"))
        young, poisson = float(data[f"{name}_young"]), float(data[f"{name}_poisson"])
        model.add_fem_variable(f"u_{name}", space)
        model.add_initialized_data(f"mu_{name}", young / 2 / (1 + poisson))
        model.add_initialized_data(f"lame_{name}", young * poisson / (1 + poisson) / (1 - 2 * poisson))
        model.add_isotropic_linearized_elasticity_brick(rules[name], f"u_{name}", f"lame_{name}", f"mu_{name}")
        model.add_initialized_data(f"moved_{name}", data["pushed"] if name == "upper" else np.zeros(3))
        model.add_Dirichlet_condition_with_simplification(f"u_{name}", _HELD, f"moved_{name}")
    tractions = gf.MeshFem(meshes["upper"], 3 if coefficient else 1)
    tractions.set_classical_fem(1)
    model.add_filtered_fem_variable("traction", tractions, _CONTACT)
    model.add_initialized_data("r", _AUGMENTATION * float(data["upper_young"]))
    what = ["u_upper", "u_lower", "traction", "r"]
    if coefficient:
        model.add_initialized_data("coefficient", coefficient)
        what.append("coefficient")
    model.add_integral_contact_between_nonmatching_meshes_brick(rules["upper"], *what, _CONTACT, _CONTACT)
    steps, _ = model.solve("max_res", _RESIDUAL, "max_iter", _STEPS, "lsolver", "mumps")
    cpu = time.process_time() - start
    if steps >= _STEPS:
        raise RuntimeError(f"GetFEM has no solution after {_STEPS} Newton steps")
    space = spaces["upper"]
    constant = gf.MeshFem(meshes["upper"], 1)
    constant.set_classical_fem(0)
    lame, mu = (np.full(constant.nbdof(), model.variable(f"{what}_upper")) for what in ("lame", "mu"))
    stiffness = gf.asm_linear_elasticity(rules["upper"], space, constant, lame, mu)
    inner = stiffness.mult(model.variable("u_upper")).reshape(-1, 3)
    force = inner[np.unique(space.basic_dof_on_region(_HELD) // 3)].sum(axis=0)
    u = np.concatenate(
        [_at_nodes(spaces[name], model.variable(f"u_{name}"), data[f"{name}_points"]) for name in spaces]
    )
    return {"u": u.tolist(), "force": force.tolist(), "cpu": cpu, "note": f"{int(steps)} Newton steps"}


def _at_nodes(space: Any, values: Any, points: Any) -> Any:
    """Values in the order of the points."""
    places = space.basic_dof_nodes().T[::3]
    order = np.empty(len(points), dtype=int)
    order[np.lexsort(np.round(points, 9).T)] = np.lexsort(np.round(places, 9).T)
    return values.reshape(-1, 3)[order]


def main(arguments: list[str]) -> int:
    """Solve and print."""
    print(json.dumps(solve(np.load(arguments[0]), float(arguments[1]))))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
