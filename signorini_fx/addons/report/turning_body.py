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
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING
from warnings import catch_warnings

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from scipy.spatial import cKDTree

from signorini_fx.addons.pictures.style import VALUES, visible_factor
from signorini_fx.addons.report.markup import Markup, rendered
from signorini_fx.arrays import Array, Ints, Plain
from signorini_fx.machine.result_files import read_csv
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.statement.units import bracketed
from signorini_fx.tuned import SAME_LENGTH

if TYPE_CHECKING:
    from pyvista import UnstructuredGrid

    from signorini_fx.quantities.shown import Summary

# Larger surfaces, and more load steps, would make the page slow to load.
_MOST_CORNERS, _MOST_STEPS = 40_000, 12
_RAW = "von_mises"  # which the recovered one stands for, where there is one


def turning_body(summary: Summary, folder: Path) -> Markup:
    """Return the body to turn, or nothing if there are no fields, if the surface is too large, or
    without PyVista.
    """
    files = _files(folder)
    if not files or find_spec("pyvista") is None:
        return Markup("")
    import pyvista

    chosen = np.unique(np.linspace(0, len(files) - 1, min(len(files), _MOST_STEPS)).round())
    steps = [files[int(k)] for k in chosen]
    grids = (_joined(pyvista.read(path)) for _, _, path in steps)
    # Newer versions of PyVista announce another default that older ones cannot be given.
    with catch_warnings(action="ignore"):
        surfaces = [grid.extract_surface(nonlinear_subdivision=0) for grid in grids]
    points = np.asarray(surfaces[0].points)
    sides = surfaces[0].faces
    if len(points) > _MOST_CORNERS:
        return Markup("")
    plane = summary["dimension"] == 2
    tables = {} if plane else _contact_tables(folder)
    shown = [
        {"name": name, **_fields_of(surface.point_data, points, tables.get(number))}
        for (number, name, _), surface in zip(steps, surfaces, strict=True)
    ]
    body = {
        "points": _packed(points),
        **_drawn(sides.reshape(-1, 1 + sides[0])[:, 1:]),
        "colours": [to_hex(VALUES(k / 15)) for k in range(16)],
        "plane": plane,
        "scale": visible_factor(points, surfaces[-1].point_data["displacement"]),
        "steps": shown,
    }
    return _turning(body)


def _joined(grid: UnstructuredGrid) -> UnstructuredGrid:
    """Return a grid whose cells share their points, with the mean of the cells, but not with those
    of another body that they touch.
    """
    import pyvista

    pieces = np.unique(grid.point_data.get("piece", 0))
    if len(pieces) == 1:
        return grid.clean(tolerance=SAME_LENGTH)
    bodies = [grid.threshold((piece, piece), scalars="piece") for piece in pieces]
    return pyvista.merge([body.clean(tolerance=SAME_LENGTH) for body in bodies], merge_points=False)


def _turning(body: Mapping[str, Plain]) -> Markup:
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


def _fields_of(
    values: Mapping[str, Array], points: Array, contact: Mapping[str, Array] | None
) -> dict[str, Plain]:
    """Return displacement and fields at the corners of the surface in a load step."""
    scalars = [
        name
        for name, column in values.items()
        if column.dtype == np.float64
        and column.ndim == 1
        and not (name == _RAW and f"recovered_{_RAW}" in values)
    ]
    scalars.sort(key=lambda name: _RAW not in name)  # the first one is shown first
    fields = {name.replace("_", " "): values[name] for name in scalars}
    displacement = values["displacement"]
    fields["displacement"] = np.linalg.norm(displacement, axis=1)
    if contact is not None:
        fields["contact pressure"] = _at_contact(points, contact, contact["pressure"])
        fields["shear at contact"] = _at_contact(points, contact, contact["shear"])
    named = {f"{name}{_unit_of(name)}": _packed(column) for name, column in fields.items()}
    return {"displacement": _packed(displacement), "fields": named}


def _unit_of(name: str) -> str:
    """Return the unit of a field in brackets, or nothing if it is not known."""
    quantities = {"mises": "stress", "at contact": "stress", "contact pressure": "stress"}
    quantities |= {"displacement": "length", "temperature": "temperature"}
    return next((bracketed(kind) for part, kind in quantities.items() if part in name), "")


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
