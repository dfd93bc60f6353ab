"""What statements about a body rest on, in words."""

from __future__ import annotations

# Where arcs of the body are polygons of the mesh.
STRAIGHT_CELLS = "of the body with the straight cells of the mesh"
