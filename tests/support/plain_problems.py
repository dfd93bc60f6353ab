"""What guaranteed bounds are made of, for tests of their parts."""

from signorini_fx.addons.bounds.error_bound import proved


def problem(solution):
    """The arrays of a solution on one rank, with what bounds its error."""
    place = solution.last_step.place
    return proved(
        solution.model, solution.displacement, solution.contact, place, lambda found: found
    )
