"""What the pictures of a solution are drawn from, from all ranks on the first one."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from signorini_fx.addons.picture_data.rigid_shapes import drawn_shapes
from signorini_fx.addons.pictures.body import DrawnBody, Volume
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.pictures.result_pictures import MOST_FACETS, ResultPictures
from signorini_fx.machine import parallel
from signorini_fx.machine.terminal import say
from signorini_fx.records import as_rows
from signorini_fx.results.solution import Solution

MOST_CELLS = 200_000  # of a section: they take seconds, and 100 MB on the first rank


def gather_pictures(solution: Solution, asked: Sequence[str] = (), *, pdf: bool = False) -> ResultPictures:
    """Of a solution, with fields beside the von Mises stress, or the displacement where that is not known, and out of
    a section ``around``; collective.  Fields that follow from a stress that is not known are left out, which is said.
    """
    if solution.history.linear_solves == 0 and not solution.certified:
        return _of_setup(solution, pdf=pdf)
    stress = solution.known_stress
    usual: tuple[str, ...] = ("displacement",) if stress is None else ("von_mises",)
    usual += ("around",) * bool(solution.statement.kinematics.out_of_section)
    unknown = [name for name in asked if FIELDS[name].of_stress and stress is None]
    reason = "the stress of this body is not known"
    if stress is not None and "density" in asked and stress.stress.shear_modulus is None:
        unknown, reason = ["density"], "its shear energy is known of linear isotropic bodies alone"
    if unknown and solution.comm.rank == 0:
        say(f"not drawn, as {reason}: {', '.join(unknown)}")
    fields = tuple(name for name in dict.fromkeys((*usual, *asked)) if name not in unknown)
    dimension = solution.model.tagged.dimension
    gather, contacts = _gatherer(solution), solution.statement.contact
    return ResultPictures(
        solution.statement.title,
        dimension,
        fields,
        None if gather is None else gather(solution, fields, recovered=True),
        as_rows(solution.history.iterations),
        as_rows(solution.convergence_table),
        _volume(solution) if dimension == 3 and gather is not None and stress is not None else None,
        solution.statement.unit_names(dimension),
        {contacts[part].boundary: motion.at for motion in solution.last_step.tools for part in motion.body.parts},
        drawn_shapes(solution) if gather is not None else {},
        (".png", ".pdf") if pdf else (".png",),
        bool(solution.statement.kinematics.zero_on_axis),
    )


def _of_setup(solution: Solution, *, pdf: bool) -> ResultPictures:
    """The scene as it was prescribed, where statics has excluded a solution before anything was solved; collective."""
    from signorini_fx.addons.picture_data.of_setup import gather_setup

    tagged, statement = solution.model.tagged, solution.statement
    setup = gather_setup(tagged, statement, statement.title)
    suffixes = (".png", ".pdf") if pdf else (".png",)
    return ResultPictures(
        statement.title, tagged.dimension, (), None, (), (), units=setup.units, suffixes=suffixes, setup=setup
    )


def _volume(solution: Solution) -> Volume | None:
    """The cells of a body in 3D; None if there are too many; collective."""
    from signorini_fx.addons.picture_data.outer_surface import gather_volume

    topology = solution.model.tagged.mesh.topology
    return gather_volume(solution) if topology.index_map(3).size_global <= MOST_CELLS else None


def _gatherer(solution: Solution) -> Callable[..., DrawnBody] | None:
    """What gathers the body; None if it is too large to be drawn; collective."""
    if solution.model.tagged.dimension == 2:
        from signorini_fx.addons.picture_data.body_cells import gather_cells

        return gather_cells
    from signorini_fx.addons.picture_data.outer_surface import gather_outer_surface, outer_facets

    count = outer_facets(solution)
    if count <= MOST_FACETS:
        return gather_outer_surface
    parallel.log_on_root(
        solution.comm,
        f"the deformed body is not drawn: its surface has {count} facets, more than {MOST_FACETS}: see it in ParaView",
    )
    return None
