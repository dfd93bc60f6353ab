"""The sections of the page for a body in 3D, instead of curves and zones."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.report.markup import drawn_by, joined, long_table, table
from signorini_fx.addons.report.templating import Markup, part
from signorini_fx.machine.display import clean, on_several_bodies, touch_each_other
from signorini_fx.mechanics.statement.units import bracketed
from signorini_fx.quantities.digits import components, figure
from signorini_fx.quantities.shown import error_of

# Vectors of contact.csv, whose components are shown together.
_VECTORS = {"position": ("x", "y", "z"), "normal": ("n_x", "n_y", "n_z")}
_COLUMNS = ("state", "friction", "pressure", "shear", "bound", "gap", "u_n", "u_t", "slip")


def resultants(summary: dict[str, Any], contact: dict[str, Any]) -> Markup:
    """The forces of the foundation on the body, and the areas in contact."""
    force, friction = (np.array(summary[name], dtype=np.float64) for name in ("contact_force", "friction_force"))
    moment, twist = (np.array(summary[name], dtype=np.float64) for name in ("contact_moment", "friction_moment"))
    size = float(np.nanmax(np.abs([force, friction]), initial=0.0))
    lever = float(np.nanmax(np.abs([moment, twist]), initial=0.0))
    error = error_of(summary, "contact_force")
    several = on_several_bodies(summary)
    forces = [*(f"{axis}{bracketed('force')}" for axis in "xyz"), f"size{bracketed('force')}"]
    if several:  # their moments are among the resultants of all boundaries
        rows = [
            (f"{kind} on {row['boundary']}", *components(row[name]), figure(float(np.linalg.norm(row[name]))))
            for kind, name in (("contact force", "contact_force"), ("friction force", "friction_force"))
            for row in summary["contact_boundaries"]
        ]
        parts = [table(["between bodies", *forces], rows)]
    else:
        rows = [
            (
                name,
                *components(clean(f.tolist(), size), error),
                figure(float(np.linalg.norm(f)), error),
                *components(clean(m.tolist(), lever), error),
            )
            for name, f, m in (
                ("contact force", force, moment),
                ("friction force", friction, twist),
                ("both", force + friction, moment + twist),
            )
        ]
        whom = summary["contact_boundaries"][0]["boundary"] if touch_each_other(summary) else "the body"
        moments = [f"moment {axis}{bracketed('moment')}" for axis in "xyz"]
        parts = [table([f"on {whom}", *forces, *moments], rows)]
    through = None if several else summary["contact_force_through"]
    if through is not None:
        extent = max(float(np.ptp(contact[axis])) for axis in "xyz")
        axial_moment = float(force @ moment / np.linalg.norm(force))
        about = figure(axial_moment if abs(axial_moment) > 1e-9 * lever else 0.0)
        named = [f"{axis}{bracketed('length')}" for axis in "xyz"]
        heads = [
            "the contact force acts along the line through",
            *named,
            f"moment about this axis{bracketed('moment')}",
        ]
        parts.append(table(heads, [("", *components(clean(through, extent)), about)]))
    names = np.asarray(contact["boundary"])
    weight, touching = np.asarray(contact["weight"]), contact["state"] != "open"
    rubs = np.asarray(contact["friction"])
    areas = []
    for name in dict.fromkeys(map(str, names)):
        on_boundary = names == name
        parts_of = (
            on_boundary,
            on_boundary & touching,
            on_boundary & (rubs == "stick"),
            on_boundary & (rubs == "slip"),
        )
        areas.append((name, *(float(weight[where].sum()) for where in parts_of)))
    if len(areas) > 1:
        areas.append(("all", *(sum(column) for column in list(zip(*areas, strict=True))[1:])))
    shown = [(name, *map(figure, sizes)) for name, *sizes in areas]
    measured = [f"{share}{bracketed('area')}" for share in ("whole", "in contact", "sticks", "slips")]
    parts.append(table(["area of", *measured], shown))
    note = "Moments are about the origin. Areas are sums of weights of nodes, stick and slip where friction can act."
    return joined([*parts, part("note", note)])


def surface(contact: dict[str, Any], facets: npt.NDArray[np.int64]) -> Markup:
    """The contact surface seen along its normal, and the table of its nodes."""
    from signorini_fx.addons.pictures.contact_surface import boundaries_shown, contact_surface

    captions = {"pressure": "Contact pressure, shear as arrows."}
    if np.any(contact["bound"] != 0) or np.any(contact["friction"] != "none"):
        captions["state"] = "State of each node, and slip as arrows, magnified as stated above."
    pictures = [
        drawn_by(contact_surface, contact, facets, panels=[panel], boundary=boundary, caption=caption)
        for boundary in boundaries_shown(contact, facets)
        for panel, caption in captions.items()
    ]
    drawn = part("beside", pictures)
    note = (
        "Seen along the outward normal, through the body. Arrows of shear point where the body slips or would slip; "
        "the traction on the body is opposite."
    )
    return joined([drawn, part("note", note), long_table("Every contact node", nodes(contact), "contact.csv")])


def nodes(contact: dict[str, Any]) -> dict[str, Any]:
    """The contact table with vectors in one column: scalars and vectors in turn, one entry for each node."""
    columns: dict[str, Any] = {"boundary": contact["boundary"], "position": _vectors(contact, _VECTORS["position"])}
    for name in _COLUMNS:
        columns[name] = contact[name]
        if f"{name}_x" in contact:
            columns[f"{name} vector"] = _vectors(contact, tuple(f"{name}_{axis}" for axis in "xyz"))
    return columns | {"normal": _vectors(contact, _VECTORS["normal"]), "weight": contact["weight"]}


def _vectors(contact: dict[str, Any], names: tuple[str, ...]) -> list[tuple[float, ...]]:
    """Three columns as one of vectors; components that are round-off compared with the largest are zero."""
    columns = np.column_stack([np.asarray(contact[name], dtype=np.float64) for name in names])
    columns[np.abs(columns) <= 1e-9 * np.nanmax(np.abs(columns), initial=0.0)] = 0.0
    return [tuple(map(float, row)) for row in columns]
