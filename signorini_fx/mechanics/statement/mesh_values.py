"""Nodal values of a mesh in a file that meshio reads."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# The formats, by their suffixes.
SUFFIXES = (".vtu", ".xdmf")
_FLAT = ("triangle", "quad")


def nodal_values(file: Path, name: str) -> tuple[Array, Array, float]:
    """Nodes and values of a mesh.

    Args:
        file: .vtu or .xdmf, with one array of numbers at its points, or with one of this name.
        name: of the array.

    Returns:
        The positions of the nodes, length, shape (n, d), the values, shape (n,), and the length of the largest cell.

    Raises:
        ValueError: what is wrong with it.
    """
    try:
        mesh = import_module(f"meshio.{file.suffix[1:].lower()}").read(str(file))
    except ImportError as error:
        raise ValueError(f"needs {error.name}: install signorini-fx[meshes]") from None
    except (Exception, SystemExit) as error:  # whatever meshio meets
        reason = str(error).partition("\n")[0]
        raise ValueError(f"cannot be read: {getattr(error, 'strerror', None) or reason or 'meshio ends'}") from None
    arrays = {key: np.ravel(values) for key, values in mesh.point_data.items() if np.size(values) == len(mesh.points)}
    if name not in arrays and len(arrays) != 1:
        array_names = ", ".join(sorted(arrays)) or "none"
        raise ValueError(f"has the arrays {array_names} of one number per point: one must be called {name}")
    values = arrays.get(name, next(iter(arrays.values())))
    solid = [block.data for block in mesh.cells if not block.type.startswith((*_FLAT, "line", "vertex"))]
    cells = solid or [block.data for block in mesh.cells if block.type.startswith(_FLAT)]
    if not cells:
        raise ValueError("has no cells of the plane or of space")
    used = np.unique(np.concatenate([np.ravel(block) for block in cells]))
    points = np.asarray(mesh.points, dtype=np.float64)[:, : 3 if solid else 2]
    if not (np.isfinite(points[used]).all() and np.isfinite(values[used]).all()):
        raise ValueError("has numbers that are not finite")
    extents = [np.linalg.norm(np.ptp(points[block], axis=1), axis=1).max() for block in cells]
    return points[used], np.asarray(values[used], dtype=np.float64), float(max(extents))
