"""All pictures of a result folder, and the data for them, gathered from all ranks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from signorini_fx.addons.pictures.body import DrawnBody, normals_of
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.pictures.gather import gather_body
from signorini_fx.addons.pictures.rigid_shapes import drawn_shapes, rigid_motions_of
from signorini_fx.addons.pictures.style import finish, plain
from signorini_fx.arrays import Array, Columns, Ints, inner
from signorini_fx.machine.terminal import say
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.statement.units import labelled
from signorini_fx.records import Status
from signorini_fx.results.fields import facets_of
from signorini_fx.results.solution import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from signorini_fx.addons.pictures.foundation import DrawnSurface
    from signorini_fx.addons.pictures.setup import Setup


def gather_pictures(
    solution: Solution, asked: Sequence[str] = (), *, pdf: bool = False
) -> ResultPictures:
    """Return the data for the pictures of a solution; collective.

    The von Mises stress is drawn, or the displacement if there is no stress, with torsion also
    ``around``, and the fields ``asked``.  Fields that need a missing stress are left out, with a
    message.
    """
    suffixes = (".png", ".pdf") if pdf else (".png",)
    if solution.history.linear_solves == 0 and not solution.certified:  # excluded by statics
        from signorini_fx.addons.pictures.of_setup import gather_setup

        setup = gather_setup(solution.model.tagged, solution.statement, solution.model.title)
        return ResultPictures(solution, suffixes, setup=setup)
    fields = drawn_fields(solution, asked)
    body = gather_body(solution, fields)
    return ResultPictures(
        solution, suffixes, fields, body, {} if body is None else drawn_shapes(solution)
    )


def drawn_fields(solution: Solution, asked: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the fields that are drawn, and print which are not."""
    stress = solution.known_stress
    usual: tuple[str, ...] = ("displacement",) if stress is None else ("von_mises",)
    usual += ("around",) * bool(solution.statement.kinematics.out_of_section)
    usual += tuple(
        name for name in getattr(solution.last_step.place, "computed", ()) if name in FIELDS
    )
    unknown = [name for name in asked if FIELDS[name].of and stress is None]
    reason = "the body has no stress to draw"
    if stress is not None and "density" in asked and stress.stress.shear_modulus is None:
        unknown = ["density"]
        reason = "only linear isotropic bodies have a shear energy density"
    if unknown and solution.comm.rank == 0:
        say(f"not drawn, as {reason}: {', '.join(unknown)}")
    return tuple(name for name in dict.fromkeys((*usual, *asked)) if name not in unknown)


def _pressed(contact: ContactTable | None) -> tuple[Array, Ints, Array] | None:
    """Return points and facets of the contact surface in 3D, and the pressure at the points; None
    if nothing is in contact.

    Facets are counterclockwise as seen from outside.
    """
    if contact is None or contact.touching == 0:
        return None
    columns = contact.columns
    facets = facets_of(contact)
    facets = facets[:, : 3 if facets.shape[1] == 3 else 4]
    places, outwards = (
        np.column_stack([columns[f"{begin}{axis}"] for axis in "xyz"]) for begin in ("", "n_")
    )
    inwards = inner(normals_of(places[facets[:, :3]]), outwards[facets].sum(axis=1)) < 0
    facets = np.where(inwards[:, None], facets[:, ::-1], facets)
    return places, facets, np.where(columns["state"] == "open", 0.0, columns["pressure"])


@dataclass(frozen=True)
class ResultPictures:
    """The data for the pictures of a solution; ``draw`` is called on the first rank."""

    solution: Solution
    suffixes: Sequence[str]  # suffixes of the files to write
    # names of the fields that are drawn on the body, the von Mises stress first, where it is known
    fields: tuple[str, ...] = ()
    body: DrawnBody | None = None  # None if it has too many facets
    # the surface of each foundation that is a shape, by its boundary: lines, or points and
    # triangles, to be drawn where nothing is magnified; see ``rigid_shapes``
    shapes: Mapping[str, DrawnSurface] = field(default_factory=dict)
    # supports, loads and contact, to be drawn where nothing was solved; None: it was solved
    setup: Setup | None = None

    def draw(
        self,
        folder: Path,
        contact: ContactTable | None,
        steps: Columns | None,
        profiles: Columns | None = None,
    ) -> None:
        """Draw all pictures.

        Args:
            folder: where to write them.
            contact: the contact table; None without contact.
            steps: columns of ``steps.csv``; None for a single step.
            profiles: columns of ``contact_steps.csv``; None without it.

        Raises:
            PictureError: a body in 3D cannot be drawn; all other pictures are written.
        """
        with labelled(self.solution.statement.unit_names(self._dimension)):
            if self.setup is not None:
                self.setup.draw(folder / "setup", self.suffixes)
                return
            self._draw_curves(folder, contact, steps)
            state = self.solution.contact
            if profiles is not None and state is not None and state.columns and "s" in profiles:
                from signorini_fx.addons.pictures.load_steps import profiles_by_step

                drawn = [name for name in state.columns if profiles[name].any()]
                if drawn:
                    self._write(folder / "effects", profiles_by_step(profiles, drawn))
            if self.body is not None:
                self._draw_body(self.body, folder, contact)

    @property
    def _dimension(self) -> int:
        return self.solution.model.tagged.dimension

    @property
    def _around(self) -> bool:
        """Whether the body is the section of an axisymmetric one."""
        return bool(self.solution.statement.kinematics.zero_on_axis)

    def _draw_body(
        self,
        body: DrawnBody,
        folder: Path,
        contact: ContactTable | None,
    ) -> None:
        """Draw the body with each field on its foundation."""
        from signorini_fx.addons.pictures.foundation import foundations_of
        from signorini_fx.addons.pictures.marks import Largest

        foundations = (
            []
            if contact is None
            else foundations_of(contact, rigid_motions_of(self.solution), self.shapes)
        )
        draw: Callable[..., tuple[Figure, str]]
        beside: dict[str, Any] = {}  # of the first picture alone
        if self._dimension == 2:
            from signorini_fx.addons.pictures.boundary_profiles import boundaries_of
            from signorini_fx.addons.pictures.deformed_body import deformed_mesh as draw

            if contact is not None and contact.touching:
                beside = {"pressed": [boundary.near() for boundary in boundaries_of(contact)]}
        else:
            from signorini_fx.addons.pictures.solid import deformed_solid, telling_view

            seen = telling_view(body, self.fields[0])
            draw = partial(deformed_solid, seen=seen)
            beside = {"pressed": _pressed(contact)}
        solved = self.solution.last_step.status is Status.CONVERGED
        for name in self.fields:
            largest = Largest.of(body, name) if solved else None
            more = beside if name == self.fields[0] else {}
            figure, remark = draw(body, name, foundations=foundations, largest=largest, **more)
            remark += "; axis at x = 0" * self._around
            self._write(
                folder / ("deformed" if name == self.fields[0] else f"field_{name}"), figure, remark
            )

    def _draw_curves(
        self, folder: Path, contact: ContactTable | None, steps: Columns | None
    ) -> None:
        from signorini_fx.addons.pictures.load_steps import load_steps

        between = [row for step in self.solution.steps for row in step.between]
        moves = any("kinetic_energy" in told for _, told in between)
        if steps is not None and (moves or contact is not None):
            drawn = load_steps(steps, around=self._around, between=between)
            finish(drawn, folder / "load_steps", "", self.suffixes)
        if contact is None:
            return
        if self._dimension == 2:
            from signorini_fx.addons.pictures.boundary_profiles import boundary_profiles

            self._write(folder / "profiles", boundary_profiles(contact))
        else:
            from signorini_fx.addons.pictures.contact_surface import contact_surface

            self._write(
                folder / "contact_surface", contact_surface(contact.columns, facets_of(contact))
            )

    def _write(self, path_stem: Path, figure: Figure, remark: str = "") -> None:
        title = plain(self.solution.model.title)
        finish(
            figure,
            path_stem,
            f"{title}   ({remark})" if title and remark else title or remark,
            self.suffixes,
        )
