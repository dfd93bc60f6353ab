"""Signorini contact with Tresca and Coulomb friction on FEniCSx, by the semi-smooth Newton method
of Kunisch & Stadler.

``from signorini_fx import Scene, read_scene, solve``.  dolfinx is imported when it is first needed,
not before.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_PUBLIC = {
    "mechanics.effects.contact": (
        "BilateralContact",
        "BondedContact",
        "Contact",
        "UnilateralContact",
    ),
    "mechanics.effects.displacement": ("PrescribedDisplacement",),
    "mechanics.effects.loads": (
        "BodyForce",
        "Fluid",
        "Gravity",
        "PointForce",
        "Preload",
        "Rotation",
        "Springs",
        "SurfaceTraction",
        "TemperatureChange",
        "TotalForce",
    ),
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
    "mechanics.interfaces": ("Foundation", "Pair"),
    "mechanics.laws.coulomb": ("Coulomb", "NoFriction", "Tresca"),
    "mechanics.laws.protocol": ("FrictionLaw", "Parameter"),
    "mechanics.materials.isotropic": ("LinearElastic",),
    "mechanics.materials.hyperelastic": (
        "MooneyRivlin",
        "NeoHooke",
        "Ogden",
        "SaintVenantKirchhoff",
    ),
    "mechanics.materials.nonlinear": ("Hyperelastic", "PathDependent"),
    "mechanics.materials.orthotropic": ("DirectedMaterial", "OrthotropicElastic"),
    "mechanics.materials.path_dependent": ("J2", "Maxwell"),
    "mechanics.materials.protocol": ("Material",),
    "mechanics.mesh.tagged": (
        "TaggedMesh",
        "generate_mesh",
        "read_mesh",
        "section_in_space",
        "tag_boundaries",
    ),
    "forms.nonlinear.problem": ("NonlinearContactProblem",),
    "mechanics.loads.follower_pressure": ("follower_pressure",),
    "quantities.summary": ("Quantity", "read_results"),
    "records": ("Status",),
    "results.files": ("write_results",),
    "results.progress_line": ("ProgressLine",),
    "results.solution": ("ConvergenceError", "Solution"),
    "results.summary": ("print_progress",),
    "mechanics.statement.load_path": ("LoadPath", "LoadSteps"),
    "mechanics.statement.mesh_sources": ("Body", "MeshFile", "MeshGenerator"),
    "scenes.scene": ("Scene",),
    "mechanics.statement.settings": ("Accuracy", "Discretised", "SolverSettings", "Units"),
    "scenes.reading": ("read_scene",),
    "scenes.solver": ("solve",),
    "scenes.sweep": ("sweep",),
}
# Those of add-ons.
_ADDED = ("judge", "plot", "pyvista_grid", "sensitivity")
_MODULE_OF = {name: module for module, names in _PUBLIC.items() for name in names}

if TYPE_CHECKING:
    from signorini_fx.results.solution import ConvergenceError as ConvergenceError
    from signorini_fx.scenes.solver import solve as solve

__all__ = sorted((*_MODULE_OF, *_ADDED))


def __getattr__(name: str) -> Any:
    if name in __all__:
        try:
            if name in _ADDED:
                return import_module("signorini_fx.extensions").add_on(name)
            return getattr(import_module(f"signorini_fx.{_MODULE_OF[name]}"), name)
        except ModuleNotFoundError as error:
            failure = error
        from signorini_fx.errors import check_fenicsx

        check_fenicsx()
        raise failure
    if not name.startswith("_") and (
        removal := import_module("signorini_fx.removed").removal(name)
    ):
        raise ImportError(
            f"{__name__}.{name} {removal}"
        )  # an AttributeError has no message after "from ... import"
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
