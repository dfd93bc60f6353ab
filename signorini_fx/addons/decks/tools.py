"""Rigid bodies of an Abaqus input file that move, as rigid tools of a scene.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Sequence

from signorini_fx.addons.decks.content import Deck


def tool_keys(deck: Deck, node: int, courses: dict[tuple[str, ...], list[float]], *, always: bool = False) -> str:
    """What drives a rigid body, as keys of a foundation.

    Args:
        deck: what has been read.
        node: the number of its reference node.
        courses: ("prescribed", component), ("force", component) or ("moment", component) -> value in each step.
        always: also for a rigid body that stays where it is.

    Returns:
        The text, empty where nothing drives it.
    """
    if not (always or any(any(values) for values in courses.values())):
        return ""
    axes, planar = deck.axes, deck.mesh.dim == 2
    turns = ("rotation",) if planar else tuple(f"rotation_{axis}" for axis in axes)
    share = deck.thickness if planar else 1.0

    def sums(kind: str, names: Sequence[str]) -> list[str]:
        selected = [courses.get((kind, name)) for name in names]
        zeros = [0.0] * max(1, len(deck.steps))
        return [of_time([value / share for value in course or zeros]) for course in selected] if any(selected) else []

    point = deck.model.raw.points[deck.model.places[node]][: deck.mesh.dim].tolist()
    keys = [f"pivot = {point}"]
    if force := sums("force", axes):
        keys.append(f"force = [{', '.join(force)}]")
    if moment := sums("moment", turns):
        keys.append(f"moment = {moment[0]}" if planar else f"moment = [{', '.join(moment)}]")
    held = {name: course for name in (*axes, *turns) if (course := courses.get(("prescribed", name))) is not None}
    if held:
        keys.append(f"prescribed = {{ {', '.join(f'{name} = {of_time(course)}' for name, course in held.items())} }}")
    if len(keys) == 1:  # what nothing drives is free, and moves with what it is tied to
        keys.append(f"force = {[0.0] * len(axes)}")
    return ", ".join(keys)


def of_time(values: Sequence[float]) -> str:
    """A number, or an expression of the time t, which is 1, 2, 3 and so on in the steps."""
    *earlier, last = values
    if all(value == last for value in earlier):
        return repr(last)
    pairs = zip(earlier, values[1:], strict=True)
    parts = [f"{value!r} if t < {step + 0.5} else" for step, (value, then) in enumerate(pairs, 1) if value != then]
    return f'"{" ".join(parts)} {last!r}"'
