"""What statics says about Coulomb friction: a first problem that has a solution, and which outcomes are proved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.algorithms.task import Task
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction, as_given, stuck
from signorini_fx.algebra.contact.statics import no_balance
from signorini_fx.algebra.problem.regularised import RegularisedProblem
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import CERTIFICATE_TOLERANCE


def coulomb_start(task: Task, data: RegularisedData) -> RegularisedData:
    """Section 7: the pure contact problem, g = 0; but a body that cannot do without friction starts from stick.

    It sticks everywhere, unless that would hold it without any contact, as a ring with clearance around a pin: then
    only where it touches at its reference motion.
    """
    motions, everywhere = task.motions, task.motions.points.everywhere

    def possible(stick: npt.NDArray[np.bool_]) -> bool:
        """Whether contact can hold the body and balance its load if these nodes stick, and no other ones rub."""
        law = stuck(stick)
        held = motions.held_by(everywhere, stick)
        return held and no_balance(law, data.bilateral, motions, task.system.resultant) is None

    if possible(~everywhere):
        return replace(data, bound=None)
    stick = everywhere
    if motions.held_by(~everywhere, everywhere):
        touching = _touching_nodes(task, data)
        stick = touching if possible(touching) else everywhere
    return replace(data, bound=np.where(stick, np.inf, 0.0))


def _touching_nodes(task: Task, data: RegularisedData) -> npt.NDArray[np.bool_]:
    """The nodes without a gap where displacements are counted from, shape (n,); collective.

    On a straight side that lies on a straight foundation all gaps are round-off, which chooses no nodes.
    """
    gap = np.abs(data.gap)
    largest = parallel.largest(task.motions.points.comm, gap)
    return np.asarray(gap <= max(task.coordinate_error, CERTIFICATE_TOLERANCE * largest))


def proved(task: Task, problem: RegularisedProblem, law: PointFriction, status: Status) -> Status:
    """An outcome of Coulomb friction: that a body moves away with the bound of one Tresca problem proves nothing else.

    The bound of such a problem is that of the previous pressure.  If the law itself allows for an equilibrium, as it
    always does where the pressure is statically indeterminate, the fixed-point iteration has failed, and another method
    may find it.
    """
    if status not in (Status.SLIDES, Status.TIPS, Status.OPEN, Status.NOT_HELD):
        return status
    data, everywhere = problem.data, task.motions.points.everywhere
    if status is Status.NOT_HELD and not task.motions.held_by(everywhere, law.acts):
        return status
    motions, resultant = task.motions, task.system.resultant
    at_rest = task.system.load.norm() == task.system.start.norm() == 0.0
    lost = no_balance(law, data.bilateral, motions, resultant, data.gap if at_rest else None)
    if lost is not None:
        return lost.status
    task.history.add(f"{status.value}: with the friction bound of the pressure before, not by the law itself")
    share = share_of_loads(task, data)
    if share >= 1.0:
        return Status.OUTER_MAX_ITERATIONS
    task.history.add(f"friction at this pressure carries at most {share:.5g} of the loads")
    return Status.SLIDES_AT_PRESSURES


def share_of_loads(task: Task, data: RegularisedData) -> float:
    """A multiple of the loads above which no pressures, and no shears up to the given bound, carry them; collective."""
    from signorini_fx.algebra.contact.reactions import largest_multiple, reactions

    motions, load = task.motions, task.system.resultant
    allowed = reactions(motions, as_given(data.bound), data.bilateral)
    loaded = [(number, columns) for number, columns in motions.assemblies if load[columns].any()]
    return min((largest_multiple(allowed.of(number, at), load[at]) for number, at in loaded), default=np.inf)
