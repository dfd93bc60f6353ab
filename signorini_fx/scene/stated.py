"""What statements about a body rest on, in words."""

from __future__ import annotations

from typing import Any

# Where arcs of the body are polygons of the mesh.
STRAIGHT_CELLS = "of the body with the straight cells of the mesh"


def may_have_arcs(scene: Any) -> bool:
    """Whether a mesh may stand for a body with arcs: all but rectangles and boxes may."""
    meshes = [body.mesh for body in scene.body] or [scene.mesh]
    return not all(getattr(mesh, "generator", None) in ("rectangle", "block", "box") for mesh in meshes)
