"""Two bodies with the contact of Kratos, in a separate process: prints its answer as one line of JSON.

    pip install --target DIR KratosMultiphysics KratosLinearSolversApplication \
        KratosStructuralMechanicsApplication KratosContactStructuralMechanicsApplication
    PYTHONPATH=DIR python3 bench/bodies_kratos.py MESHES.npz COEFFICIENT

The contact is an augmented Lagrangian on dual mortar spaces (``ALMContact``), solved by Newton's method.  The mesh must
move, or the active set does not settle.  It uses neither the package nor dolfinx.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np

_STEPS = 30


def parameters(pushed: list[float], coefficient: float) -> dict[str, Any]:
    """As in a file ProjectParameters.json."""
    kind = "Frictional" if coefficient else "Frictionless"
    fixed = {"python_module": "assign_vector_variable_process", "kratos_module": "KratosMultiphysics"}
    moved = {"variable_name": "DISPLACEMENT", "constrained": [True] * 3, "interval": [0.0, "End"]}
    both = {"upper": [f"{value}*t" for value in pushed], "lower": [0.0] * 3}
    supports = [
        fixed | {"Parameters": moved | {"model_part_name": f"Structure.{name}_held", "value": value}}
        for name, value in both.items()
    ]
    contact: dict[str, Any] = {
        "model_part_name": "Structure",
        "contact_model_part": {"0": ["upper_contact", "lower_contact"]},
        "assume_master_slave": {"0": ["upper_contact"]},
        "contact_type": kind,
    }
    if coefficient:
        contact["friction_coefficients"] = {"0": coefficient}
    process = {
        "python_module": "alm_contact_process",
        "kratos_module": "KratosMultiphysics.ContactStructuralMechanicsApplication",
        "process_name": "ALMContactProcess",
        "Parameters": contact,
    }
    return {
        "problem_data": {
            "problem_name": "bodies",
            "parallel_type": "OpenMP",
            "echo_level": 0,
            "start_time": 0.0,
            "end_time": 1.0 - 1e-9,
        },
        "solver_settings": {
            "solver_type": "Static",
            "model_part_name": "Structure",
            "domain_size": 3,
            "echo_level": 0,
            "analysis_type": "non_linear",
            "model_import_settings": {"input_type": "use_input_model_part"},
            "material_import_settings": {"materials_filename": ""},
            "time_stepping": {"time_step": 1.0},
            "convergence_criterion": "contact_residual_criterion",
            "residual_relative_tolerance": 1e-6,
            "residual_absolute_tolerance": 1e-9,
            "max_iteration": _STEPS,
            "contact_settings": {
                "mortar_type": f"ALMContact{kind}",
                "fancy_convergence_criterion": False,
                "use_mixed_ulm_solver": False,
            },
            "linear_solver_settings": {"solver_type": "LinearSolversApplication.sparse_lu"},
        },
        "processes": {"supports": supports, "contact": [process]},
    }


def solve(data: Any, coefficient: float) -> dict[str, Any]:
    """Solve, from the meshes in memory: CPU seconds, displacements, the force on the top.

    Raises:
        ImportError: there is no Kratos.
        RuntimeError: Newton's method does not converge.
    """
    import KratosMultiphysics as Kratos
    import KratosMultiphysics.ContactStructuralMechanicsApplication
    import KratosMultiphysics.LinearSolversApplication
    import KratosMultiphysics.StructuralMechanicsApplication as Structural
    from KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis import (
        StructuralMechanicsAnalysis,
    )

    Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
    start = time.process_time()
    settings = Kratos.Parameters(json.dumps(parameters(data["pushed"].tolist(), coefficient)))
    model = Kratos.Model()
    analysis = StructuralMechanicsAnalysis(model, settings)
    structure = model["Structure"]
    node, element, condition = 1, 1, 1
    for number, name in enumerate(("upper", "lower"), 1):
        points, cells, contact, held = (data[f"{name}_{what}"] for what in ("points", "cells", "contact", "held"))
        material = structure.CreateNewProperties(number)
        material[Kratos.YOUNG_MODULUS] = float(data[f"{name}_young"])
        material[Kratos.POISSON_RATIO] = float(data[f"{name}_poisson"])
        material[Kratos.DENSITY] = 1.0
        material[Kratos.CONSTITUTIVE_LAW] = Structural.LinearElastic3DLaw()
        for n, x in enumerate(points.tolist(), node):
            structure.CreateNewNode(n, *x)
        for n, corners in enumerate((cells + node).tolist(), element):
            structure.CreateNewElement("SmallDisplacementElement3D8N", n, corners, material)
        part = structure.CreateSubModelPart(f"{name}_contact")
        part.AddNodes((np.unique(contact) + node).tolist())
        for n, corners in enumerate((contact + node).tolist(), condition):
            part.CreateNewCondition("SurfaceCondition3D4N", n, corners, material)
        structure.CreateSubModelPart(f"{name}_held").AddNodes((held + node).tolist())
        node, element, condition = node + len(points), element + len(cells), condition + len(contact)
    analysis.Run()
    cpu = time.process_time() - start
    steps = structure.ProcessInfo[Kratos.NL_ITERATION_NUMBER]
    if steps >= _STEPS:
        raise RuntimeError(f"Kratos has no solution after {_STEPS} Newton steps")
    count = node - 1
    u = np.array([structure.GetNode(n).GetSolutionStepValue(Kratos.DISPLACEMENT) for n in range(1, count + 1)])
    top = (int(n) + 1 for n in data["upper_held"])
    force = np.sum([structure.GetNode(n).GetSolutionStepValue(Kratos.REACTION) for n in top], axis=0)
    return {"u": u.tolist(), "force": force.tolist(), "cpu": cpu, "note": f"{steps} Newton steps"}


def main(arguments: list[str]) -> int:
    """Solve and print."""
    print(json.dumps(solve(np.load(arguments[0]), float(arguments[1]))), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
