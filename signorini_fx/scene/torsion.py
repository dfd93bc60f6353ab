"""What the torsion of a body of revolution is not possible with.

The displacement of an axisymmetric body with torsion has three components: radial, axial, and around the axis.  They
are called x, y and z, and z is along x[2], out of the section: what turns by an angle about x[1] moves by -angle x[0]
along it.  Other programs call such elements generalised axisymmetric, with twist (CGAX in Abaqus).
"""

from __future__ import annotations

from typing import Any

from signorini_fx.scene.effect import Contradictions, SectionJump


def contradictions_of_torsion(scene: Any) -> Contradictions:
    """Why torsion does not go together with other entries of a scene, see ``Effect``."""
    yet, solver = "is not possible yet where material.torsion is true", scene.solver
    for number, material in enumerate(scene.material):
        if material.hypothesis != "axisymmetric":
            yield ("material", number, "torsion"), 'needs hypothesis = "axisymmetric": other bodies have no axis'
        if material.torsion != scene.material[0].torsion:
            yield ("material", number, "torsion"), "must be the same in all materials"
        if material.orthotropic is not None:
            yield ("material", number, "orthotropic"), yet
    for wrong, path, reason in (
        (scene.element.volumetric == "mixed", ("element", "volumetric"), f"'mixed' {yet}"),
        (solver.linear_algebra == "krylov", ("solver", "linear_algebra"), f"'krylov' {yet}"),
        (solver.levels > 1, ("solver", "levels"), f"a sequence of meshes {yet}"),
        (solver.error_bound, ("solver", "error_bound"), yet),
        (scene.accuracy is not None, ("accuracy",), yet),
        (bool(scene.of(SectionJump)), ("preload",), yet),
    ):
        if wrong:
            yield path, reason
    for number, contact in enumerate(scene.contact):
        contact_path = ("contact", number)
        if contact.against is not None:
            yield (*contact_path, "against"), f"contact of two bodies {yet}"
        if contact.tool is not None or contact.moves:
            yield (*contact_path, "foundation"), f"a foundation that moves {yet}: move or turn the body"
        if contact.friction.ratio is not None:
            yield (*contact_path, "friction", "ratio"), yet
    for number, effect in enumerate(scene.displacement):
        if effect.rotation is None:
            continue
        if effect.axis is None or len(effect.axis) != 2 or effect.axis[0] != 0 or (effect.about or (0.0,))[0] != 0:
            yield ("displacement", number, "axis"), "must be that of the body: axis = [0.0, 1.0]"
