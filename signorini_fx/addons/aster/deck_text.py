"""A problem of another program's case as an input file of Abaqus, which the scene is drafted from.  No dolfinx here."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from signorini_fx.addons.aster.study import MODELS, CaseStudy, Relation, Support, SurfaceLoad, Zone
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.abaqus import faces_of
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.raw import rows_of
from signorini_fx.mechanics.mesh.files.shape import Ints

# Of kinds of cells how many nodes those of a deck have; what stands between these is left out.
_NODES = {
    "triangle": 3,
    "triangle6": 6,
    "triangle7": 6,
    "quad": 4,
    "quad8": 8,
    "quad9": 8,
    "tetra": 4,
    "tetra10": 10,
    "pyramid": 5,
    "wedge": 6,
    "wedge15": 15,
    "wedge18": 15,
    "hexahedron": 8,
    "hexahedron20": 20,
    "hexahedron27": 20,
}
_ROW = 12  # numbers in a line


class DeckText:
    """Lines of an input file, and the place in the case that each keyword is from.

    Attributes:
        lines: of the file.
        places: number of the line of a keyword -> place in the case.
    """

    def __init__(self, study: CaseStudy, title: str) -> None:
        self.lines: list[str] = []
        self.places: dict[int, str] = {}
        self._study = study
        self._names: dict[str, bytes] = {}
        self._elements = self._numbered_elements()
        self._of_body = self._mesh_nodes()
        self._rigid: dict[int, str] = {}
        self._add("", "*HEADING", [re.sub(r"[,*\s]+", " ", title)])
        self._write_mesh()
        self._write_materials()
        for relation in study.relations:
            self._write_relation(relation)
        for zone in study.zones:
            self._write_zone(zone)
        self._write_steps()

    @property
    def text(self) -> str:
        """Of the file."""
        return "\n".join(self.lines) + "\n"

    def at_commands(self, text: str) -> str:
        """A message about lines of this file, about the commands that they are from."""

        def origin(match: re.Match[str]) -> str:
            command = self.places.get(int(match[1]), "")
            return command or match[0]

        named = re.sub(r"line (\d+), \*[A-Z][A-Z\-]*(?: [A-Z\-]+)*", origin, text)
        return re.sub(r"(line \d+, \w+)(?: and \1\b)+", r"\1", named)

    def _add(self, origin: str, keyword: str, rows: Iterable[str] = ()) -> None:
        self.lines.append(keyword)
        if origin:
            self.places[len(self.lines)] = origin
        self.lines.extend(rows)

    # --- mesh -----------------------------------------------------------------------------------------------------

    def _numbered_elements(self) -> list[tuple[int, str, Ints, Ints]]:
        """Of each block with cells of the body its number, kind, rows of these, and the numbers of the elements."""
        blocks: list[tuple[int, str, Ints, Ints]] = []
        first = 1
        for k, (kind, _) in enumerate(self._study.mesh.blocks):
            rows: Ints = np.flatnonzero(self._study.body[k]).astype(np.int64)
            if rows.size:
                if kind not in _NODES:
                    raise MeshError(f"cells of kind {kind} are not known here")
                blocks.append((k, kind, rows, first + np.arange(len(rows))))
                first += len(rows)
        return blocks

    def _mesh_nodes(self) -> Ints:
        blocks = self._study.mesh.blocks
        return np.unique(
            np.concatenate([blocks[k][1][rows][:, : _NODES[kind]].ravel() for k, kind, rows, _ in self._elements])
        )

    def _write_mesh(self) -> None:
        mesh, prefix = self._study.mesh, MODELS[self._study.model]
        x = mesh.points[self._of_body]
        if self._study.dim == 2:
            x = np.column_stack((x[:, :2], np.zeros(len(x))))
        self._add(
            "",
            "*NODE",
            (
                f"{node + 1}, {', '.join(map(repr, row))}"
                for node, row in zip(plain(self._of_body), plain(x), strict=True)
            ),
        )
        for k, kind, rows, numbers in self._elements:
            count = _NODES[kind]
            self._add("", f"*ELEMENT, TYPE={prefix}{count}")
            nodes = mesh.blocks[k][1][rows][:, :count] + 1
            for number, row in zip(plain(numbers), plain(nodes), strict=True):
                words = [str(number), *map(str, row)]
                parts = [words[n : n + _ROW] for n in range(0, len(words), _ROW)]
                self.lines += [", ".join(part) + ("," if n < len(parts) - 1 else "") for n, part in enumerate(parts)]

    def _write_materials(self) -> None:
        study = self._study
        missing = [np.ones(len(rows), dtype=bool) for _, _, rows, _ in self._elements]
        written: dict[str, list[Ints]] = {}
        sections: list[tuple[str, str, dict[str, float]]] = []
        for marks, properties, origin in reversed(study.materials):
            numbers = []
            for open_cells, (k, _, rows, of_rows) in zip(missing, self._elements, strict=True):
                chosen = open_cells & marks[k][rows]
                numbers.append(of_rows[chosen])
                open_cells &= ~chosen
            if sum(map(len, numbers)):
                name = f"part_{len(written) + 1}"
                written[name] = numbers
                sections.append((name, origin, properties))
        if any(cells.any() for cells in missing):
            raise MeshError("cells of the body have no material: the case does not name them")
        for name, origin, properties in sections:
            self._add("", f"*ELSET, ELSET={name}", _listed(np.concatenate(written[name])))
            self._add(origin, f"*MATERIAL, NAME={name}")
            self._add(origin, "*ELASTIC", [f"{properties['young']!r}, {properties['poisson']!r}"])
            if "density" in properties:
                self._add(origin, "*DENSITY", [repr(properties["density"])])
            if "expansion" in properties:
                self._add(origin, "*EXPANSION", [repr(properties["expansion"])])
            self._add(origin, f"*SOLID SECTION, ELSET={name}, MATERIAL={name}")
        self._add("", "*ELSET, ELSET=everything", written)

    def _named(self, prefix: str, content: bytes) -> tuple[str, bool]:
        """A name for nodes or faces, and whether it is new."""
        for name, of_name in self._names.items():
            if of_name == content and name.startswith(prefix):
                return name, False
        name = f"{prefix}_{sum(additional.startswith(prefix) for additional in self._names) + 1}"
        self._names[name] = content
        return name, True

    def _node_set(self, nodes: Ints) -> str:
        """The name of a set of nodes of the body; "": there are none."""
        held = np.intersect1d(nodes, self._of_body)
        if not held.size:
            return ""
        name, new = self._named("nodes", held.tobytes())
        if new:
            self._add("", f"*NSET, NSET={name}", _listed(held + 1))
        return name

    def _faces(self, marks: Sequence[Any]) -> tuple[list[tuple[int, int]], int]:
        """Element and number of each face of the body that elements of the boundary are, and how many are none."""
        mesh, collected, without = self._study.mesh, [], 0
        for (kind, nodes), mark in zip(mesh.blocks, marks, strict=True):
            if not mark.any():
                continue
            corners = {"l": 2, "t": 3, "q": 4}[kind[0]]
            wanted = nodes[mark][:, :corners]
            pairs = np.full((len(wanted), 2), -1)
            for k, cell, rows, numbers in self._elements:
                for face, places in enumerate(faces_of(cell), 1):
                    if len(places) != corners:
                        continue
                    at = rows_of(wanted, mesh.blocks[k][1][rows][:, list(places)])
                    pairs[at >= 0] = np.column_stack((numbers[at[at >= 0]], np.full((at >= 0).sum(), face)))
            without += int((pairs[:, 0] < 0).sum())
            collected += [tuple(pair) for pair in plain(pairs[pairs[:, 0] >= 0])]
        return collected, without

    def _surface(self, marks: Sequence[Any], origin: str) -> str:
        """The name of a surface; "": no face of the body is in it."""
        faces, without = self._faces(marks)
        if without and faces:
            self._study.lose(origin, f"{without} elements of a boundary are on no face of the body")
        if not faces:
            return ""
        name, new = self._named("surface", np.array(sorted(faces)).tobytes())
        if new:
            self._add("", f"*SURFACE, NAME={name}", [f"{element}, S{face}" for element, face in sorted(faces)])
        return name

    # --- contact --------------------------------------------------------------------------------------------------

    def _write_zone(self, zone: Zone) -> None:
        study = self._study
        slave, master = (self._surface(marks, zone.origin) for marks in (zone.slave, zone.master))
        if not slave and master:
            study.note(
                zone.origin, f"zone {zone.number}: the slave surface is rigid: the other one has the contact points"
            )
            if zone.apart.size or zone.smooth.size:
                study.lose(zone.origin, f"zone {zone.number}: nodes of a rigid surface without contact or friction")
            slave, rigid = master, zone.slave
            master = self._rigid_surface(rigid, zone)
        elif slave and not master:
            master = self._rigid_surface(zone.master, zone)
        if not slave or not master:
            study.lose(zone.origin, f"zone {zone.number}: this contact is not of the body")
            return
        name = interaction_of(zone)
        if zone.tied:
            self._add(zone.origin, f"*TIE, NAME={name}", [f"{slave}, {master}"])
            return
        self._add(zone.origin, f"*SURFACE INTERACTION, NAME={name}")
        if zone.stiffness is not None:
            self._add(zone.origin, "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", [repr(zone.stiffness)])
        if zone.coefficient:
            sticking = "" if zone.sticking is None else f", {zone.sticking!r}"
            self._add(zone.origin, "*FRICTION", [f"{zone.coefficient!r}{sticking}"])
        self._add(zone.origin, f"*CONTACT PAIR, INTERACTION={name}, TYPE=SURFACE TO SURFACE", [f"{slave}, {master}"])

    def _rigid_surface(self, marks: Sequence[Any], zone: Zone) -> str:
        """Elements that are on no face of the body, as a rigid surface that supports hold; "": they do not."""
        mesh, dim = self._study.mesh, self._study.dim
        nodes = mesh.nodes_of_cells(marks)
        held = {support.component for support in self._study.supports if np.isin(nodes, support.nodes).all()}
        steady = all(
            np.isscalar(value) and value == 0
            for support in self._study.supports
            if np.isin(support.nodes, nodes).any()
            for value in support.values
        )
        if held != set(range(dim)) or not steady:
            self._study.lose(zone.origin, f"zone {zone.number}: a surface without body that is not held")
            return ""
        name = f"rigid_{zone.number}"
        start = int(mesh.points.shape[0])
        for (kind, rows), mark in zip(mesh.blocks, marks, strict=True):
            if mark.any():
                corners = {"l": 2, "t": 3, "q": 4}[kind[0]]
                extra = np.setdiff1d(rows[mark][:, :corners], [*self._of_body, *self._rigid])
                self._rigid |= dict.fromkeys(plain(extra), name)
                self._add(
                    "",
                    "*NODE",
                    (f"{node + 1}, {', '.join(map(repr, plain(mesh.points[node])))}" for node in plain(extra)),
                )
                self._add("", f"*ELEMENT, TYPE={'R2D2' if dim == 2 else f'R3D{corners}'}, ELSET={name}")
                first = 1 + sum(len(numbers) for *_, numbers in self._elements) + len(self._rigid) * 10
                for number, row in enumerate(plain(rows[mark][:, :corners] + 1), first):
                    self.lines.append(", ".join(map(str, (number, *row))))
        reference = start + zone.number
        self._add("", "*NODE", [f"{reference}, {', '.join(map(repr, plain(mesh.points[nodes[0]])))}"])
        self._add(zone.origin, f"*RIGID BODY, ELSET={name}, REF NODE={reference}")
        surface = f"{name}_surface"
        self._add(zone.origin, f"*SURFACE, NAME={surface}", [f"{name}, SPOS"])
        return surface

    # --- constraints and loads ------------------------------------------------------------------------------------

    def _write_relation(self, relation: Relation) -> None:
        missing = [node for node, _, _ in relation.terms if node not in self._of_body]
        if missing:
            self._study.lose(relation.origin, "a relation of nodes that are no part of the body")
            return
        rows = [f"{node + 1}, {component + 1}, {factor!r}" for node, component, factor in relation.terms]
        self._add(relation.origin, "*EQUATION", [str(len(rows)), *rows])

    def _write_steps(self) -> None:
        study = self._study
        supports = [(self._node_set(support.nodes), support) for support in study.supports]
        pressures = [(self._surface(load.cells, load.origin), load) for load in study.pressures]
        tractions = [(self._surface(load.cells, load.origin), load) for load in study.tractions]
        for name, load in (*pressures, *tractions):
            if not name:
                study.lose(load.origin, "a load on no face of the body")
        previous = 0.0
        for step, time in enumerate(study.instants):
            period = time - previous if time > previous else 1.0
            previous = time
            nonlinear = ", NLGEOM=YES" if study.finite else ""
            self._add(study.finite, f"*STEP, NAME={time:.9g}{nonlinear}")
            self._add("", "*STATIC", [f"{period!r}, {period!r}"])
            self._write_supports(supports, step)
            self._write_loads(pressures, tractions, step)
            for force in study.forces:
                rows = [
                    f"{node + 1}, {axis + 1}, {value!r}"
                    for axis, value in enumerate(plain(force.values[step])[: study.dim])
                    for node in plain(force.nodes)
                    if force.values[:, axis].any()
                ]
                if rows:
                    self._add(force.origin, "*CLOAD", rows)
            for vectors, origin in study.gravities:
                size = float(np.linalg.norm(vectors[step]))
                direction = vectors[np.argmax(np.linalg.norm(vectors, axis=1))]
                unit = plain(direction / (np.linalg.norm(direction) or 1.0))
                sign = 1.0 if float(vectors[step] @ direction) >= 0 else -1.0
                self._add(origin, "*DLOAD", [f"everything, GRAV, {sign * size!r}, {', '.join(map(repr, unit))}"])
            self._add("", "*END STEP")

    def _write_supports(self, supports: list[tuple[str, Support]], step: int) -> None:
        """Those of a step; where some hold in a part of the steps only, each step begins anew."""
        named = [(name, support) for name, support in supports if name]
        change = any(value is None for _, support in named for value in support.values)
        if change:
            self._add("", "*BOUNDARY, OP=NEW")
        for name, support in named:
            if support.values[step] is not None:
                self._write_support(name, support, step)

    def _write_support(self, name: str, support: Support, step: int) -> None:
        value, component = support.values[step], support.component + 1
        if isinstance(value, np.ndarray):
            pairs = zip(plain(support.nodes), plain(value), strict=True)
            body_nodes = set(plain(self._of_body))
            rows = [f"{node + 1}, {component}, {component}, {number!r}" for node, number in pairs if node in body_nodes]
        else:
            rows = [f"{name}, {component}, {component}, {value!r}"]
        self._add(support.origin, "*BOUNDARY", rows)

    def _write_loads(
        self, pressures: list[tuple[str, SurfaceLoad]], tractions: list[tuple[str, SurfaceLoad]], step: int
    ) -> None:
        for name, load in pressures:
            if name and load.vector.any():
                self._add(load.origin, "*DSLOAD", [f"{name}, P, {float(load.vector[step, 0])!r}"])
        for name, load in tractions:
            for axis in np.flatnonzero(load.vector.any(axis=0)) if name else ():
                unit = ", ".join(str(int(k == axis)) for k in range(3))
                self._add(load.origin, "*DSLOAD", [f"{name}, TRVEC, {float(load.vector[step, axis])!r}, {unit}"])


def interaction_of(zone: Zone) -> str:
    """The name of the interaction of a zone in the input file."""
    return f"ZONE_{zone.number}"


def _listed(numbers: Ints) -> list[str]:
    listed = plain(np.sort(numbers))
    return [", ".join(map(str, listed[n : n + _ROW])) for n in range(0, len(listed), _ROW)]
