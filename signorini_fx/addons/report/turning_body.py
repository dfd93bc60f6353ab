"""The deformed body on a page, which can be turned with the pointer.

It has the surface with the fields of all load steps, from the files that ``solve`` wrote.
``turning_body.js`` draws it.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from scipy.spatial import cKDTree

from signorini_fx.addons.pictures.style import VALUES, visible_factor
from signorini_fx.addons.report.markup import Markup, rendered
from signorini_fx.arrays import Array, Ints
from signorini_fx.machine.result_files import read_csv
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.tuned import SAME_LENGTH

if TYPE_CHECKING:
    from signorini_fx.quantities.shown import Summary

# Larger surfaces, and more load steps, would make the page slow to load.
_MOST_CORNERS, _MOST_STEPS = 40_000, 12
# By VTK's number of a cell its corners, and the facets that they make; of plane cells themselves.
_TETRAHEDRON = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
_HEXAHEDRON = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_FACETS: dict[int, tuple[int, tuple[tuple[int, ...], ...]]] = {
    **dict.fromkeys((5, 22, 69), (3, ((0, 1, 2),))),
    **dict.fromkeys((9, 23, 28, 70), (4, ((0, 1, 2, 3),))),
    **dict.fromkeys((10, 24, 71), (4, _TETRAHEDRON)),
    **dict.fromkeys((12, 25, 29, 72), (8, _HEXAHEDRON)),
}
_RAW = "von_mises"  # which the recovered one stands for, where there is one
_NUMBERS = {"Float64": np.float64, "Int64": np.int64, "UInt8": np.uint8}


def turning_body(summary: Summary, folder: Path) -> Markup:
    """Return the body to turn, or nothing if there are no fields or the surface is too large."""
    files = _files(folder)
    if not files:
        return Markup("")
    chosen = np.unique(np.linspace(0, len(files) - 1, min(len(files), _MOST_STEPS)).round())
    steps = [files[int(k)] for k in chosen]
    grids = [_grid_of(path) for _, _, path in steps]
    first = grids[0]
    kind = int(first["types"][0])
    if kind not in _FACETS:
        return Markup("")
    plane = summary["dimension"] == 2
    corners, facets = _FACETS[kind]
    connectivity = first["connectivity"].astype(np.int64)
    cells = connectivity.reshape(len(first["types"]), -1)[:, :corners]
    used, numbers, vertices = _vertices(first["points"], cells)
    sides = _sides(vertices, facets, plane=plane)
    on_surface, local = np.unique(sides, return_inverse=True)
    if len(on_surface) > _MOST_CORNERS:
        return Markup("")
    sides = local.reshape(sides.shape)
    points = first["points"][used[on_surface]]
    tables = {} if plane else _contact_tables(folder)
    shown = [
        {"name": name, **_fields_of(grid, numbers, on_surface, points, tables.get(number))}
        for (number, name, _), grid in zip(steps, grids, strict=True)
    ]
    body = {
        "points": _packed(points),
        **_drawn(sides),
        "colours": [to_hex(VALUES(k / 15)) for k in range(16)],
        "plane": plane,
        "scale": visible_factor(points, grids[-1]["displacement"]),
        "steps": shown,
    }
    return _turning(body)


def _turning(body: Mapping[str, Any]) -> Markup:
    """Return the figure of a body that the script draws."""
    script = resources.files(__package__).joinpath("turning_body.js").read_text(encoding="utf-8")
    return rendered("turning_body", data=Markup(json.dumps(body)), script=Markup(script))


def turning_mesh(mesh: MeshArrays) -> Markup:
    """Return the surface of a mesh in 3D to turn; the name of the boundary under the pointer is
    shown.
    """
    outer = len(mesh.facets) - mesh.inner
    face = np.zeros(outer, dtype=np.int64)
    for number, rows in enumerate(mesh.boundaries.values(), start=1):
        face[rows[rows < outer]] = number
    corners = mesh.facet_corners[:outer]
    # Each boundary has points of its own.
    keys = corners + len(mesh.points) * face[:, None]
    used, numbers = np.unique(keys, return_inverse=True)
    sides = numbers.reshape(corners.shape)
    if sides.shape[1] == 4:  # as basix numbers them
        sides = sides[:, [0, 1, 3, 2]]
    points = mesh.points[used % len(mesh.points)]
    of_point = used // len(mesh.points)
    still = {"displacement": _packed(np.zeros_like(points)), "name": ""}
    return _turning(
        {
            "points": _packed(points),
            **_drawn(sides),
            "colours": [to_hex(colormaps["tab20"](k)) for k in range(16)],
            "plane": False,
            "scale": 1.0,
            "steps": [{**still, "fields": {"boundary": _packed(of_point % 16)}}],
            "names": ["no name", *mesh.boundaries],
            "faces": of_point.tolist(),
        }
    )


def _drawn(sides: Ints) -> dict[str, str]:
    """Return the triangles and the edges of facets, shape (f, c)."""
    triangles = np.concatenate([sides[:, [0, k, k + 1]] for k in range(1, sides.shape[1] - 1)])
    edges = np.concatenate([sides[:, [k, (k + 1) % sides.shape[1]]] for k in range(sides.shape[1])])
    once = np.unique(np.sort(edges, axis=1), axis=0)
    return {"triangles": _packed(triangles, np.uint32), "edges": _packed(once, np.uint32)}


def _files(folder: Path) -> list[tuple[int, str, Path]]:
    """Return the numbers and names of the load steps of a result, and their files of fields."""
    if (folder / "fields.vtu").is_file():
        return [(0, "", folder / "fields.vtu")]
    if not (folder / "fields.pvd").is_file():
        return []
    text = (folder / "fields.pvd").read_text(encoding="utf-8")
    rows = re.findall(r'timestep="([^"]*)" file="([^"]*)"', text)
    return [(int(Path(file).stem), f"time {float(time):g}", folder / file) for time, file in rows]


def _grid_of(path: Path) -> dict[str, Array]:
    """Return the arrays of a file of ``results.fields.write_vtu``, by their names."""
    found = {}
    pattern = rb'<DataArray type="(\w+)" Name="([^"]+)"(?: NumberOfComponents="(\d+)")? [^>]*>'
    text = path.read_bytes()
    for match in re.finditer(pattern, text):
        data = base64.b64decode(text[match.end() : text.index(b"</DataArray>", match.end())])
        values = np.frombuffer(data, dtype=_NUMBERS[match[1].decode()], offset=8)
        width = int(match[3] or 1)
        found[match[2].decode()] = values.reshape(-1, width) if width > 1 else values
    return found


def _vertices(points: Array, cells: Ints) -> tuple[Ints, Ints, Ints]:
    """Return the corners of the mesh, at which each cell of the file has its own point.

    Returns:
        One point of the file for each corner; all points of the file at corners with the number of
        the corner, shape (k, 2); and the corners of each cell.
    """
    at = cells.ravel()
    size = float(np.ptp(points, axis=0).max()) or 1.0
    places = np.round(points[at] / (size * SAME_LENGTH)).astype(np.int64)
    _, first, corner = np.unique(places, axis=0, return_index=True, return_inverse=True)
    corner = corner.reshape(-1)
    return at[first], np.column_stack((at, corner)), corner.reshape(cells.shape)


def _sides(vertices: Ints, facets: tuple[tuple[int, ...], ...], *, plane: bool) -> Ints:
    """Return the facets that belong to one cell only; in 2D all cells."""
    every = np.concatenate([vertices[:, list(facet)] for facet in facets])
    if plane:
        return every
    _, first, count = np.unique(
        np.sort(every, axis=1), axis=0, return_index=True, return_counts=True
    )
    return every[first[count == 1]]


def _fields_of(
    grid: Mapping[str, Array],
    numbers: Ints,
    on_surface: Ints,
    points: Array,
    contact: Mapping[str, Array] | None,
) -> dict[str, Any]:
    """Return displacement and fields at the corners of the surface in a load step, averaged over
    the cells at each corner.
    """
    at, corner = numbers.T
    count = np.bincount(corner)

    def mean(values: Array) -> Array:
        columns = values.reshape(len(values), -1)[at].T
        means = np.array([np.bincount(corner, column) / count for column in columns])
        return means.T[on_surface]

    displacement = mean(grid["displacement"])
    scalars = [
        name
        for name, values in grid.items()
        if values.dtype == np.float64
        and values.ndim == 1
        and not (name == _RAW and f"recovered_{_RAW}" in grid)
    ]
    scalars.sort(key=lambda name: _RAW not in name)  # the first one is shown first
    fields = {name.replace("_", " "): _packed(mean(grid[name])[:, 0]) for name in scalars}
    fields["displacement"] = _packed(np.linalg.norm(displacement, axis=1))
    if contact is not None:
        fields["contact pressure"] = _packed(_at_contact(points, contact, contact["pressure"]))
        fields["shear at contact"] = _packed(_at_contact(points, contact, contact["shear"]))
    return {"displacement": _packed(displacement), "fields": fields}


def _at_contact(points: Array, contact: Mapping[str, Array], values: Array) -> Array:
    """Return the magnitudes of values of a contact table at points, shape (n,), and nan
    elsewhere.
    """
    places = np.column_stack([contact[axis] for axis in "xyz"])
    unit = (float(np.ptp(points, axis=0).max()) or 1.0) * SAME_LENGTH
    distance, nearest = cKDTree(places).query(points)
    return np.where(distance < unit, np.abs(values[nearest]), np.nan)


def _contact_tables(folder: Path) -> dict[int, dict[str, Array]]:
    """Return the contact tables by number of the load step; the number is 0 for a single step."""
    if (folder / "contact_steps.csv").is_file():
        every = read_csv(folder / "contact_steps.csv")
        numbers = every["step"].astype(int)
        return {
            int(number): {name: column[numbers == number] for name, column in every.items()}
            for number in np.unique(numbers)
        }
    return {0: read_csv(folder / "contact.csv")} if (folder / "contact.csv").is_file() else {}


def _packed(values: Array, kind: type[np.generic] = np.float32) -> str:
    """Return an array converted to a number type, encoded in base64."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
