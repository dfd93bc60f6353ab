"""Contact, ties and rigid surfaces of an Abaqus input file, as the contacts of a scene.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signorini_fx.addons.decks.content import Deck, plain_name
from signorini_fx.addons.decks.keywords import COMING_AND_GOING
from signorini_fx.addons.decks.nodal import follow
from signorini_fx.addons.decks.ties import distances, tie_nodes
from signorini_fx.addons.decks.tools import of_time, tool_keys
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, quoted, real, real_or_none
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import DIGITS_OF_FILES, HARD_CONTACT, NEVER_CLOSED

_PIECES = 64  # straight ones that an arc of a rigid surface becomes


def contact_tables(deck: Deck, steps: int) -> tuple[list[list[str]], list[str]]:
    """The lines of each [[contact]], and those of [solver] with their stiffness."""
    tables: list[list[str]] = []
    interactions: list[tuple[str | None, list[str]]] = []
    taken: dict[str, Ints] = {}
    touched: dict[str, Ints] = {}  # by others, which may be several
    drives = _drives(deck, steps)
    used = set()
    for name, node in deck.coupled:
        where = str(deck.boundary(name))
        if np.setdiff1d(deck.nodes(name), deck.held(where)).size:
            deck.lose(None, f"rigid coupling of {name!r}: not all of its nodes are on whole facets of the body")
        used.add(node)
        taken[where] = deck.mesh.boundaries[where]
        keys = tool_keys(deck, node, drives.get(node, {}), always=True)
        pivot = deck.model.raw.points[deck.model.places[node]][: deck.mesh.dim].tolist()
        normal = [0.0] * (deck.mesh.dim - 1) + [1.0]  # a bond holds in all directions, whichever this is
        shape = f'shape = "plane", point = {pivot}, normal = {normal}'
        tables.append([f"boundary = {quoted(where)}", 'kind = "bonded"', f"foundation = {{ {shape}, {keys} }}"])
    contacts = [(*names, None) for names in deck.ties] + deck.pairs
    yielding = any(deck.stiffness.get(pair[2], np.inf) < _hard(deck) for pair in deck.pairs)
    for slave, master, interaction in contacts:
        if frozenset((slave.upper(), master.upper())) in deck.unpaired or deck.has_vanished(slave, master):
            continue
        tie = interaction is None or interaction in deck.tied
        label = f"{'tie' if tie else 'contact'} of {slave!r} with {master!r}"
        names = [name for name in (slave, master) if plain_name(name) in deck.rigid]
        sides = {name: deck.boundary(name) for name in (slave, master) if name not in names}
        missing = [name for name, where in sides.items() if where is None]
        boundaries = [where for where in sides.values() if where is not None]
        rows = {where: deck.mesh.boundaries[where] for where in boundaries}
        occupied = {where: taken | ({} if where != boundaries[0] else touched) for where in boundaries}
        shared = [
            where for where in boundaries if any(np.intersect1d(rows[where], r).size for r in occupied[where].values())
        ]
        block = deck.pairing[(slave, master) if interaction is None else (slave, master, interaction)]
        # Nodes are tied at a distance, without arms; and beside soft contact, whose stiffness a bond would have, too.
        nodal = missing or yielding or block.parameters.get("ADJUST", "").upper() == "NO"
        if nodal and interaction is None and not names and tie_nodes(deck, block, slave, master):
            continue
        if len(names) == 2 or slave == master or (len(boundaries) == 2 and boundaries[0] == boundaries[1]):
            deck.lose(None, f"{label}: " + ("both are rigid" if names else "a surface with itself"))
        elif missing:
            deck.lose(None, f"{label}: {missing[0]!r} is no boundary of the body")
        elif shared:
            deck.lose(None, f"{label}: facets of {shared[0]!r} are in another contact, and have one only")
        else:
            mover = deck.movers.get(plain_name(names[0])) if names else None
            keys = "" if mover is None else tool_keys(deck, mover, drives.get(mover, {}))
            if tie and names and not keys:
                deck.lose(None, f"{label}: {names[0]!r} is rigid; give displacements instead")
                continue
            used |= set() if mover is None else {mover}
            taken[boundaries[0]] = rows[boundaries[0]]
            touched |= {where: rows[where] for where in boundaries[1:]}
            lines = [f"# {block.origin}", f"boundary = {quoted(boundaries[0])}"]
            lines += _gap(deck, boundaries[0], names[0], keys) if names else [f"against = {quoted(boundaries[1])}"]
            lines += ['points = "boundary"'] if deck.slaves and not names else []
            _say_more_nodes(deck, block, slave, boundaries[0])
            if tie:
                tables.append([*lines, 'kind = "bonded"'])
                continue
            lines += (
                []
                if names
                else _clearance(deck, (slave, master)) or _adjust(deck, label, (slave, master, interaction or ""))
            )
            lines += _untouched(deck, label, interaction or "", between=not names)
            lines = _in_steps(deck, block, (slave, master), lines, steps, rigid=bool(names))
            if names and (slave, master, interaction) in deck.adjusted:
                deck.lose(None, f"{label}: ADJUST, which scenes know between two bodies")
            tables.append([*lines, *_friction(deck, label, interaction or "")])
            interactions.append((interaction, tables[-1]))
    for names_without in deck.clearances:
        deck.lose(None, f"clearance of {' and '.join(sorted(names_without))}: no such contact of two bodies here")
    for node in sorted(drives.keys() - used):
        if tool_keys(deck, node, drives[node]):
            deck.lose(None, f"what moves the rigid body of node {node}: no contact with it is in the scene")
    return tables, _stiffness(deck, interactions)


def _say_more_nodes(deck: Deck, block: DeckBlock, slave: str, where: str) -> None:
    """A contact of nodes has whole facets, whose other nodes touch, too, unless they move as those by equations."""
    nodes = deck.nodes(slave)
    if not nodes.size or plain_name(slave) not in deck.node_surfaces:
        return
    listed = np.searchsorted(deck.numbers, nodes)
    corners = np.unique(deck.mesh.facet_corners[deck.mesh.boundaries[where]])
    corners = corners[corners < len(deck.numbers)]  # others divide cells, and are none of the file
    normals = np.linalg.svd(deck.mesh.points[corners] - deck.mesh.points[corners].mean(axis=0))[2]
    following = follow(deck, {*map(int, listed)}, normals[deck.mesh.dim - 1])
    more = np.setdiff1d(corners, [*listed, *following]).size
    if more:
        deck.lose(block, f"contact of {len(nodes)} nodes of {slave!r}: {more} more nodes of whole facets touch here")


def _stiffness(deck: Deck, contacts: list[tuple[str | None, list[str]]]) -> list[str]:
    """The stiffness of contact and of sticking as keys of [solver], which hold for the whole scene; where contacts
    differ in the first one each has its own, but for bonds.

    Args:
        deck: what has been read.
        contacts: the interaction of each contact that the scene has, None: of a tie, and the lines of its table.
    """
    names = [name for name, _ in contacts]
    slopes = {None if name is None else deck.stiffness.get(name) for name in names}
    bonds = {slope for name in names if name in deck.tied and (slope := deck.stiffness.get(str(name))) is not None}
    lines = []
    if len(slopes) == 1 and None not in slopes and not deck.overclosures.keys() & set(names):
        lines.append(f"gamma_n = {slopes.pop()!r}")
    else:
        if bonds:
            lines.append(f"gamma_n = {max(bonds)!r}")
            if len(slopes) > 1:
                deck.lose(None, "a bond with a stiffness beside contact of another one: all bonds have the largest")
        for name, table in contacts:
            if name is None or name in deck.tied:
                continue
            if name in deck.overclosures:
                table.append(f"overclosure = {{ {deck.overclosures[name]} }}")
            elif name in deck.stiffness:
                table.append(f'overclosure = {{ law = "linear", stiffness = {deck.stiffness[name]!r} }}')
    sticking = {deck.sticking.get(name) for name in names if name and "coefficient" in deck.frictions.get(name, {})}
    soft = sorted(slope for slope in sticking if slope is not None)
    if soft:
        lines.append(f"gamma_t = {soft[-1]!r}")
        listed = ", ".join(f"{slope:g}" for slope in soft)
        if len(soft) > 1:
            deck.lose(None, f"contact of several stiffnesses of sticking, {listed}: a scene has one gamma_t")
        if None in sticking and soft[-1] < _hard(deck):
            deck.lose(None, "contact that sticks without slip beside such with: here it slips, too, by gamma_t")
    return lines


def _hard(deck: Deck) -> float:
    """The stiffness, stress per length, from which contact is hard."""
    size = deck.size
    moduli = (properties.get("orthotropic", properties).get("young", 0.0) for properties in deck.materials.values())
    return HARD_CONTACT * max((float(np.max(stiffness)) for stiffness in moduli), default=0.0) / size


def _clearance(deck: Deck, pair: tuple[str, str]) -> list[str]:
    """The distance of both sides where the file says it, as keys of a contact; empty: it is that of the mesh."""
    distance = deck.clearances.pop(frozenset(name.upper() for name in pair), None)
    return [] if distance is None else ['distance = "nominal"', f"gap = {distance!r}"]


def _adjust(deck: Deck, label: str, pair: tuple[str, str, str]) -> list[str]:
    """How far points are moved onto the other side: ADJUST of *CONTACT PAIR, a length or a set of nodes."""
    adjustment = deck.adjusted.get(pair)
    if adjustment is None:
        return []
    if (length := real_or_none(adjustment)) is not None:
        return [f"adjust = {length!r}"]
    named = deck.nodes(adjustment)
    slave, master = map(deck.boundary, pair[:2])
    if slave is not None and master is not None:
        size = deck.size
        held = deck.held(slave)
        away = distances(deck, np.searchsorted(deck.numbers, held), master)
        inside = np.isin(held, named)
        if inside.all():
            return [f"adjust = {size!r}"]
        # A length does the same where those that the set has not are further away; nodes in the middle of faces, which
        # the file does not have, are between those that it has.
        near, far = float(away[inside].max(initial=0.0)) + DIGITS_OF_FILES * size, float(away[~inside].min())
        if far > near:
            return [f"adjust = {float(f'{np.sqrt(near * far):.6g}')!r}"]
    deck.lose(None, f"{label}: ADJUST={adjustment}, which has only some of the nodes of {pair[0]!r}")
    return []


def _drives(deck: Deck, steps: int) -> dict[int, dict[tuple[str, ...], list[float]]]:
    """What moves rigid bodies in the steps, by the number of their reference nodes; see ``tool_keys``."""
    drives: dict[int, dict[tuple[str, ...], list[float]]] = {}
    for load in deck.loads.values():
        if load.table == "tool":
            drives.setdefault(int(load.target), {})[load.keys] = deck.course(load, steps)
    return drives


def _friction(deck: Deck, label: str, interaction: str) -> list[str]:
    friction = deck.frictions.get(interaction, {})
    if interaction in deck.rough:
        deck.lose(None, f"{label}: rough friction, which never slides: give a coefficient")
        return []
    course, current = [], friction.get("coefficient", 0.0)
    for step in range(max(1, len(deck.steps))):
        current = deck.rubbing.get(interaction, {}).get(step, current)
        course.append(current)
    if any(course):
        cap = f", cap = {friction['cap']!r}" if "cap" in friction else ""
        coefficient = of_time(course)
        if (nodes := deck.smooth.get(interaction)) is not None and nodes.size:
            coefficient = quoted(f"0.0 if {_at_nodes(deck, nodes)} else ({coefficient.strip(chr(34))})")
        return [f'friction = {{ law = "coulomb", coefficient = {coefficient}{cap} }}']
    return []


def _untouched(deck: Deck, label: str, interaction: str, *, between: bool) -> list[str]:
    """Nodes of a slave surface without contact, as a distance there that is never closed."""
    nodes = deck.untouched.get(interaction)
    if nodes is None or not nodes.size:
        return []
    if not between:
        deck.lose(None, f"{label}: {len(nodes)} nodes without contact have it with a rigid surface")
        return []
    return [f"gap = {quoted(f'{_far(deck)!r} if {_at_nodes(deck, nodes)} else 0.0')}"]


def _in_steps(
    deck: Deck, block: DeckBlock, pair: tuple[str, str], lines: list[str], steps: int, *, rigid: bool
) -> list[str]:
    """The lines of a contact with a distance that nothing closes in the steps that are without it."""
    course = deck.touching_in(frozenset(name.upper() for name in pair), steps)
    if all(course):
        return lines
    gaps = [line.partition(" = ")[2] for line in lines if line.startswith("gap = ")]
    if rigid or (gaps and real_or_none(gaps[0]) is None):
        deck.lose(block, COMING_AND_GOING)
        return lines
    gap, open_gap = (real(gaps[0]) if gaps else 0.0), _far(deck)
    without_gap = [line for line in lines if not line.startswith("gap = ")]
    return [*without_gap, f"gap = {of_time([gap if touches else open_gap for touches in course])}"]


def _far(deck: Deck) -> float:
    """A distance that nothing closes, length."""
    return float(f"{NEVER_CLOSED * deck.size:.3g}")


def _at_nodes(deck: Deck, nodes: Ints) -> str:
    """The condition of being at one of some nodes."""
    near = DIGITS_OF_FILES * deck.size
    places = (
        "+".join(f"abs(x[{k}]-{value!r})" for k, value in enumerate(map(float, x))) for x in deck.mesh.points[nodes]
    )
    return " or ".join(f"{place.replace('--', '+')} < {near:.3g}" for place in places)


def _gap(deck: Deck, where: str, rigid: str, tool: str) -> list[str]:
    """A rigid surface: the distance to a plane one as a formula, and one of lines and arcs as a polyline.

    Args:
        deck: what has been read.
        where: the boundary of the body.
        rigid: the surface.
        tool: keys of what drives it, see ``tool_keys``; empty: it stays where it is.
    """
    driven = f", {tool}" if tool else ""
    points = _points_of_surface(deck, plain_name(rigid))
    body = deck.mesh.points[np.unique(deck.mesh.facet_corners[deck.mesh.boundaries[where]])]
    plane = None if points is None else _plane(points[:, : deck.mesh.dim])
    if plane is None and points is not None and plain_name(rigid) in deck.drawn:
        if len(points) > len(deck.drawn[plain_name(rigid)]):
            deck.note(None, f"arcs of the rigid surface {rigid!r}: polygons of {_PIECES} sides each")
        shape = f'shape = "polyline", points = {_with_left(points, body.mean(axis=0)).tolist()}'
        return [f"foundation = {{ {shape}{driven} }}"]
    if plane is None:
        deck.lose(None, f"shape of the rigid surface {rigid!r}: write the gap to it as an expression")
        if tool:
            deck.lose(None, f"what moves the rigid surface {rigid!r}: {tool}")
        return ["gap = 0.0  # the distance to the foundation, which is not known here"]
    middle, normal = plane
    side = float(np.mean(body, axis=0) @ normal - middle @ normal)
    toward = -normal if side > 0 else normal
    if abs(side) <= DIGITS_OF_FILES * float(np.ptp(deck.mesh.points, axis=0).max()):
        toward = _outwards(deck, where, normal)
    if tool:
        shape = f'shape = "plane", point = {middle.tolist()}, normal = {(-toward + 0.0).tolist()}'
        return [f"foundation = {{ {shape}{driven} }}"]
    at, toward = float(middle @ toward), toward + 0.0  # without negative zeros
    terms = "".join(
        f" {'-' if share > 0 else '+'} {'' if abs(share) == 1 else f'{abs(share)!r}*'}x[{k}]"
        for k, share in enumerate(map(float, toward))
        if share
    )
    distance = f"{at!r}{terms}" if at else terms.removeprefix(" + ").lstrip()
    return [f'gap = "{distance}"', f"direction = {toward.tolist()}"]


def _outwards(deck: Deck, where: str, normal: Floats) -> Floats:
    """The direction of a plane's normal that leads out of the body at a boundary that lies in it."""
    inside = deck.mesh.points.mean(axis=0)
    centre = deck.mesh.points[np.unique(deck.mesh.facet_corners[deck.mesh.boundaries[where]])].mean(axis=0)
    return normal if (centre - inside) @ normal > 0 else -normal


def _points_of_surface(deck: Deck, name: str) -> Floats | None:
    """Points of a rigid surface that consists of elements, or in the plane of lines and arcs, which are in order."""
    if (rows := deck.drawn.get(name)) is not None:
        try:
            return None if deck.mesh.dim == 3 else _walked(rows)
        except (ValueError, IndexError) as error:
            raise ValueError(f"the rigid surface {name!r}: {error}") from None
    labels = {name, *deck.parts.get(name, ())}
    nodes = [
        block[rows].ravel()
        for label, members in deck.model.raw.sets.items()
        if label.upper() in labels
        for (_, block), rows in zip(deck.model.raw.blocks, members, strict=True)
    ]
    return np.asarray(deck.model.raw.points, dtype=np.float64)[np.unique(np.concatenate(nodes))] if nodes else None


def _walked(rows: Sequence[list[str]]) -> Floats | None:
    """Points along START, LINE and CIRCL of a rigid surface; None: it has other pieces."""
    points: list[Floats] = []
    for kind, *words in rows:
        end = np.array([real(word) for word in words[:2]])
        if kind.upper() == "CIRCL":
            centre = np.array([real(word) for word in words[2:4]])
            (x, y), radius = points[-1] - centre, float(np.hypot(*(end - centre)))
            first, last = np.arctan2(y, x), np.arctan2(*(end - centre)[::-1])
            turn = (last - first + np.pi) % (2 * np.pi) - np.pi  # an arc is less than half a circle
            angles = first + turn * np.arange(1, _PIECES) / _PIECES
            points += list(centre + radius * np.column_stack((np.cos(angles), np.sin(angles))))
        elif kind.upper() not in ("START", "LINE"):
            return None
        points.append(end)
    return np.array(points)


def _with_left(points: Floats, point: Floats) -> Floats:
    """The points in the order in which a place is on the left of the nearest piece."""
    ahead = np.diff(points, axis=0)
    share = np.clip(((point - points[:-1]) * ahead).sum(axis=1) / (ahead**2).sum(axis=1), 0.0, 1.0)
    near = int(np.argmin(np.linalg.norm(points[:-1] + share[:, None] * ahead - point, axis=1)))
    (along, across), (x, y) = ahead[near], point - points[near]
    return points if along * y - across * x > 0 else points[::-1]


def _plane(points: Floats) -> tuple[Floats, Floats] | None:
    """A point and the unit normal of the plane (in the plane: of the line) through points; None: there is none."""
    middle = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - middle)
    if (
        len(points) < points.shape[1]
        or sizes[-2] <= DIGITS_OF_FILES * sizes[0]
        or sizes[-1] > DIGITS_OF_FILES * sizes[0]
    ):
        return None
    normal = np.where(np.abs(axes[-1]) < 1e-12, 0.0, axes[-1])
    return middle, np.asarray(normal / np.linalg.norm(normal))
