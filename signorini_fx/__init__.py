"""Signorini contact with Tresca and Coulomb friction on FEniCSx, by the semi-smooth Newton method of Kunisch & Stadler.

``from signorini_fx import Scene, read_scene, solve``.  dolfinx is imported when it is first needed, not before.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_PUBLIC = {
    "effects.body_force": ("BodyForce",),
    "effects.contact": (
        "BilateralContact",
        "BondedContact",
        "UnilateralContact",
    ),
    "effects.displacement": ("PrescribedDisplacement",),
    "effects.fluid": ("Fluid",),
    "effects.force": ("TotalForce",),
    "effects.gravity": ("Gravity",),
    "effects.preload": ("Preload",),
    "effects.rotation": ("Rotation",),
    "effects.springs": ("Springs",),
    "effects.temperature": ("TemperatureChange",),
    "effects.traction": ("SurfaceTraction",),
    "errors": (
        "FormError",
        "InstallationError",
        "MachineError",
        "MeshError",
        "OptionsError",
        "PictureError",
        "SceneError",
        "SignoriniError",
    ),
    "forms.contact_problem": ("ContactProblem",),
    "forms.meshes": ("solve_nested", "solve_to_accuracy"),
    "mesh.section": ("section_in_space",),
    "body.foundation": ("Foundation", "Pair"),
    "laws.coulomb": ("Coulomb",),
    "laws.none": ("NoFriction",),
    "laws.protocol": ("FrictionLaw", "Parameter"),
    "laws.tresca": ("Tresca",),
    "materials.directed": ("DirectedMaterial",),
    "materials.isotropic": ("LinearElastic",),
    "materials.orthotropic": ("OrthotropicElastic",),
    "materials.protocol": ("Material",),
    "mesh.tagged": ("TaggedMesh", "generate_mesh", "read_mesh", "tag_boundaries"),
    "nonlinear.problem": ("NonlinearContactProblem",),
    "quantities.quantity": ("Quantity",),
    "quantities.read_results": ("read_results",),
    "records": ("Status",),
    "results.files": ("write_results",),
    "results.progress_line": ("ProgressLine",),
    "results.solution": ("ConvergenceError", "Solution"),
    "results.summary": ("print_progress",),
    "scene.load_steps": ("LoadPath", "LoadSteps"),
    "scene.scene": ("Body", "MeshFile", "MeshGenerator", "Scene"),
    "scene.settings": ("Accuracy", "Box", "Discretised", "SolverSettings", "TitleBlock", "Units"),
    "scene.reading": ("read_scene",),
    "solving.solver": ("solve",),
    "solving.sweep": ("SweepPoint", "sweep"),
}
# Those of add-ons.
_ADDED = ("plot", "pyvista_grid", "sensitivity")
# Names of the last version, by the names of this one.
_RENAMED = {"CoulombFriction": "Coulomb", "TrescaFriction": "Tresca"}
_MODULE_OF = {name: module for module, names in _PUBLIC.items() for name in names}

if TYPE_CHECKING:
    from signorini_fx.results.solution import ConvergenceError as ConvergenceError
    from signorini_fx.solving.solver import solve as solve

__all__ = sorted((*_MODULE_OF, *_ADDED))


def __getattr__(name: str) -> Any:
    if name in _RENAMED:
        warnings.warn(f"{name} is called {_RENAMED[name]} now", DeprecationWarning, stacklevel=2)
        name = _RENAMED[name]
    if name in __all__:
        try:
            if name in _ADDED:
                return import_module("signorini_fx.extensions").add_on(name)
            return getattr(import_module(f"signorini_fx.{_MODULE_OF[name]}"), name)
        except ModuleNotFoundError as error:
            failure = error
        from signorini_fx.machine.requirements import check_fenicsx

        check_fenicsx()
        raise failure
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
