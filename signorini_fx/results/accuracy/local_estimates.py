"""Which quantities cells are divided for where the error is, unless a scene says otherwise."""

from __future__ import annotations

# Quantities that a mesh shows the error of, cell by cell.  Others are told by comparing meshes; of them the largest
# pressure is known on meshes that are fine in some places only, if these become finer where it is.
LOCAL = ("energy", "pressure", "force")

# For which of these the cells are divided if another quantity is asked for.
DIVIDED_FOR = {"zone": "force"}
