"""All pictures of a result folder, from plain arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.pictures.body import DrawnBody, Volume
from signorini_fx.addons.pictures.fields import FIELDS, values_of
from signorini_fx.addons.pictures.marks import Largest
from signorini_fx.addons.pictures.setup import Setup
from signorini_fx.machine.csv_text import Table
from signorini_fx.mechanics.statement.units import labelled

if TYPE_CHECKING:
    from signorini_fx.addons.pictures.foundation import FoundationSurface

Array = npt.NDArray[np.float64]
MOST_FACETS = 40_000  # of a body in 3D: a picture takes seconds, and a page megabytes


@dataclass(frozen=True)
class ResultPictures:
    """What the pictures of a result are drawn from.

    Attributes:
        title: above each of the large ones, a text of the user.
        dimension: 2 or 3.
        fields: names of the fields that are drawn on the body, the von Mises stress first, where it is known.
        body: None if it has too many facets.
        history: one mapping per linear solve, the columns of history.csv.
        prices: one mapping per mesh, the columns of convergence_table.csv.
        volume: the cells of a body in 3D, if it has no more than can be drawn, for a section.
        units: for labels, see ``signorini_fx.mechanics.statement.units``.
        tools: of each boundary that a rigid tool may touch, how the tool has moved at points of shape (n, d).
        shapes: of each boundary whose foundation is a shape its lines, or points and triangles, where it is, to be
            drawn where nothing is magnified; see ``picture_data.rigid_shapes``.
        suffixes: of the files to write.
        mirrored: whether the body is a section that is drawn on both sides of its axis.
        setup: what the scene prescribes, where nothing was solved and there is no body to be drawn; None: it was.
    """

    title: str
    dimension: int
    fields: tuple[str, ...]
    body: DrawnBody | None
    history: Sequence[Mapping[str, Any]]
    prices: Sequence[Mapping[str, Any]]
    volume: Volume | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    tools: Mapping[str, Callable[[Array], Array]] = field(default_factory=dict)
    shapes: Mapping[str, Any] = field(default_factory=dict)
    suffixes: Sequence[str] = (".png",)
    mirrored: bool = False
    setup: Setup | None = None

    def draw(
        self,
        folder: Path,
        contact: Table | None = None,
        facets: npt.NDArray[np.int64] | None = None,
        steps: Table | None = None,
        largest: tuple[Sequence[float], str] | None = None,
    ) -> None:
        """All of them.

        Args:
            folder: where to write.
            contact: the columns of contact.csv; None: without contact.
            facets: of a body in 3D, its rows at each facet of the contact surface, see ``read_facets``.
            steps: the columns of steps.csv if there are several.
            largest: where the von Mises stress is largest, and its value; None: there is none that may be used.

        Raises:
            PictureError: a body in 3D cannot be drawn; all others pictures are there.
        """
        with labelled(self.units):
            marked = None if largest is None else Largest(np.array(largest[0])[: self.dimension], largest[1])
            self._draw(folder, contact, facets, steps, marked)

    def _draw(
        self,
        folder: Path,
        contact: Table | None,
        facets: npt.NDArray[np.int64] | None,
        steps: Table | None,
        largest: Largest | None,
    ) -> None:
        # matplotlib takes a while to import
        from signorini_fx.addons.pictures.convergence import errors_and_costs, iteration_history
        from signorini_fx.addons.pictures.load_steps import load_steps
        from signorini_fx.addons.pictures.style import plain

        title = plain(self.title)
        if self.setup is not None:
            self.setup.draw(folder / "setup", self.suffixes)
            return
        if self.history:
            dimension = 3 if contact is not None and "shear_z" in contact else 2  # slip has a sign, or a direction
            columns = {name: np.array([row[name] for row in self.history]) for name in self.history[0]}
            iteration_history(folder / "history", columns, dimension=dimension, suffixes=self.suffixes)
        if self.prices:
            errors_and_costs(folder / "convergence_table", self.prices, title=title, suffixes=self.suffixes)
        if contact is not None and steps is not None:
            load_steps(folder / "load_steps", steps, around=self.mirrored, suffixes=self.suffixes)
        if contact is not None and self.dimension == 2:
            from signorini_fx.addons.pictures.boundary_profiles import boundary_profiles

            boundary_profiles(folder / "profiles", contact, title=title, suffixes=self.suffixes)
        elif contact is not None and facets is not None:
            from signorini_fx.addons.pictures.contact_surface import contact_surface

            contact_surface(folder / "contact_surface", contact, facets, title=title, suffixes=self.suffixes)
        if self.body is not None and self.dimension == 2:
            self._draw_in_the_plane(self.body, contact, folder, title, largest)
        elif self.body is not None:
            foundations = (
                [] if contact is None or facets is None else foundations_of(contact, facets, self.tools, self.shapes)
            )
            drawn = self.body if contact is None else replace(self.body, parted=_parted(contact))
            self._draw_in_space(drawn, foundations, folder, title, largest)
            if contact is not None and self.volume is not None:
                self._draw_section(drawn, self.volume, contact, foundations, folder, title)

    def _draw_in_the_plane(
        self, body: DrawnBody, contact: Table | None, folder: Path, title: str, largest: Largest | None
    ) -> None:
        from signorini_fx.addons.pictures.deformed_body import DrawnFoundation, deformed_mesh

        foundation = None
        if self.mirrored:
            body = body.with_mirror_image()
        assert body.outline is not None
        if contact is not None:
            nodes = np.column_stack((contact["x"], contact["y"]))
            offset = np.column_stack((contact["n_x"], contact["n_y"])) * contact["gap"][:, None]
            for name, moved in self.tools.items():
                on_tool = np.asarray(contact["boundary"] == name)
                offset[on_tool] += moved(nodes[on_tool])
            shaped = np.isin(contact["boundary"], list(self.shapes))
            lines = [line for drawn in self.shapes.values() for line in drawn]
            foundation = DrawnFoundation(nodes, offset, contact["state"] != "open", ~_grounded(contact), shaped, lines)
            foundation = foundation.with_mirror_image() if self.mirrored else foundation
        for name in self.fields:
            deformed_mesh(
                folder / self._stem(name),
                body.points,
                body.polygons,
                body.displacement,
                values_of(name, body.values),
                outline=body.outline,
                tiles=body.divided,
                field=FIELDS[name],
                stress=body.stress_in_the_middle() if name == "principal" else None,
                foundation=foundation,
                largest=_marked(name, body, largest),
                title=title,
                suffixes=self.suffixes,
            )

    def _draw_in_space(
        self,
        body: DrawnBody,
        foundations: Sequence[FoundationSurface],
        folder: Path,
        title: str,
        largest: Largest | None,
    ) -> None:
        from signorini_fx.addons.pictures.solid_body import Skin, deformed_solid, telling_view

        seen = telling_view(Skin.of(body, self.fields[0]))
        for name in self.fields:
            deformed_solid(
                folder / self._stem(name),
                Skin.of(body, name),
                field=FIELDS[name],
                stress=body.stress_in_the_middle() if name == "principal" else None,
                foundations=foundations,
                seen=seen,
                largest=_marked(name, body, largest),
                title=title,
                suffixes=self.suffixes,
            )

    def _stem(self, field: str) -> str:
        return "deformed" if field == self.fields[0] else f"field_{field}"

    def _draw_section(
        self,
        body: DrawnBody,
        volume: Volume,
        contact: Table,
        foundations: Sequence[FoundationSurface],
        folder: Path,
        title: str,
    ) -> None:
        """Through the centre of the contact pressure, if there is any."""
        from signorini_fx.addons.pictures.solid_body import Skin, section, telling_view

        skin = Skin.of(body, "von_mises")
        force = np.maximum(np.nan_to_num(contact["pressure"]), 0.0) * contact["weight"]
        if not 0 < force.sum() < np.inf:
            return
        origin, across = (
            force @ np.column_stack([contact[f"{name}{axis}"] for axis in "xyz"]) / force.sum() for name in ("", "n_")
        )
        seen = telling_view(skin)
        section(
            folder / "section",
            skin,
            volume,
            origin,
            across,
            foundations=foundations,
            seen=seen,
            title=title,
            suffixes=self.suffixes,
        )


def _marked(field: str, body: DrawnBody, largest: Largest | None) -> Largest | None:
    """What is marked in the picture of a field: of the von Mises stress what all figures say."""
    if field == "von_mises":
        return largest
    values = values_of(field, body.values)
    points = body.points[body.within]
    if values.ndim == 1:
        return Largest.of(points.mean(axis=1), values)
    return Largest.of(points.reshape(-1, points.shape[-1]), values.ravel())


def _grounded(contact: Table) -> npt.NDArray[np.bool_]:
    """Which rows of contact.csv are on a rigid foundation."""
    return np.asarray(contact["against"] == "") if "against" in contact else np.full(len(contact["boundary"]), True)


def _parted(contact: Table) -> float:
    """The largest gap that has closed between two bodies, length."""
    closed = np.abs(contact["gap"][~_grounded(contact) & (contact["state"] != "open")])
    return float(closed[np.isfinite(closed)].max(initial=0.0))


def foundations_of(
    c: Table,
    facets: npt.NDArray[np.int64],
    tools: Mapping[str, Callable[[Array], Array]],
    shapes: Mapping[str, Any],
) -> list[FoundationSurface]:
    """The rigid foundation of each contact boundary in 3D that has one; ``facets`` are rows of the contact table,
    shape (m, k).  Of the motion of a tool that along the normals is seen where it is magnified.
    """
    from signorini_fx.addons.pictures.foundation import FoundationSurface

    nodes, normals = (np.column_stack([c[f"{name}{axis}"] for axis in "xyz"]) for name in ("", "n_"))
    gap = np.array(c["gap"])
    corners = facets[:, :4]  # VTK's biquadratic facets begin with their corners
    foundations = []
    for name in dict.fromkeys(c["boundary"][_grounded(c)]):
        on_boundary = np.asarray(c["boundary"] == name)
        row = np.cumsum(on_boundary) - 1
        if name in tools:
            gap[on_boundary] += np.sum(normals[on_boundary] * tools[name](nodes[on_boundary]), axis=1)
        foundations.append(
            FoundationSurface(
                nodes[on_boundary],
                normals[on_boundary],
                gap[on_boundary],
                row[corners[on_boundary[corners].all(axis=1)]],
                shapes.get(name),
            )
        )
    return foundations
