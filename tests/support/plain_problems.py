"""What guaranteed bounds are made of, for tests of their parts."""

from signorini_fx.addons.bounds.error_bound import bounded
from signorini_fx.addons.bounds.scene_arrays import on_first_rank


def problem(solution):
    """The arrays of a solution on one rank, with what bounds its error."""
    place = solution.last_step.place
    return on_first_rank(
        solution.model, solution.displacement, solution.contact, place, lambda rows: bounded(solution.model, rows)
    )
