"""A mesh with groups of nodes and of cells, and what commands of code_aster do to them.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.aster.values import AsterCommand, CommandError
from signorini_fx.mechanics.mesh.files.raw import RawMesh
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import DIGITS_OF_FILES

_Marks = npt.NDArray[np.bool_]
# Of kinds of elements the dimension; others are of no body.
DIMENSIONS = {
    **dict.fromkeys(("vertex",), 0),
    **dict.fromkeys(("line", "line3"), 1),
    **dict.fromkeys(("triangle", "triangle6", "triangle7", "quad", "quad8", "quad9"), 2),
    **dict.fromkeys(("tetra", "tetra10", "pyramid", "pyramid13", "wedge", "wedge15", "wedge18"), 3),
    **dict.fromkeys(("hexahedron", "hexahedron20", "hexahedron27"), 3),
}


class GroupedMesh:
    """Nodes, elements, and groups of them.

    Attributes:
        points: positions, shape (n, 3).
        blocks: (kind in meshio's words, nodes of shape (elements, nodes of each)).
        cell_groups: name -> for each block whether an element belongs.
        node_groups: name -> numbers of nodes.
        unknown: name of a group -> why it is not known here; that matters if it is needed.
    """

    def __init__(self, raw: RawMesh) -> None:
        self.points: Floats = np.zeros((len(raw.points), 3))
        self.points[:, : raw.points.shape[1]] = raw.points
        self.blocks = raw.blocks
        self.cell_groups: dict[str, list[_Marks]] = {}
        for name, tables in raw.sets.items():
            marks: list[_Marks] = [np.zeros(len(nodes), dtype=bool) for _, nodes in raw.blocks]
            for mark, rows in zip(marks, tables, strict=True):
                mark[rows] = True
            self.cell_groups[name.strip()] = marks
        self.unknown: dict[str, str] = {}
        self.node_groups: dict[str, Ints] = {name.strip(): nodes for name, nodes in raw.node_sets.items()}

    @property
    def size(self) -> float:
        """The diagonal of a box around it."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def everything(self) -> list[_Marks]:
        """All elements."""
        return [np.ones(len(nodes), dtype=bool) for _, nodes in self.blocks]

    def cells(self, command: AsterCommand, names: Sequence[str]) -> list[_Marks]:
        """The elements of groups, together.

        Raises:
            CommandError: there is no such group.
        """
        marks: list[_Marks] = [np.zeros(len(nodes), dtype=bool) for _, nodes in self.blocks]
        for name in names:
            if name not in self.cell_groups:
                why = self.unknown.get(name, "it is not in the mesh")
                raise CommandError(command.origin, f"there is no GROUP_MA {name!r}: {why}")
            marks = [a | b for a, b in zip(marks, self.cell_groups[name], strict=True)]
        return marks

    def where(self, command: AsterCommand, entry: dict[str, Any]) -> list[_Marks]:
        """The elements that an occurrence of a factor keyword names: TOUT or GROUP_MA.

        Raises:
            CommandError: it names none, or some that are not there.
        """
        if entry.get("TOUT") == "OUI":
            return self.everything()
        if "GROUP_MA" not in entry:
            raise CommandError(command.origin, "TOUT or GROUP_MA is expected")
        return self.cells(command, command.words(entry["GROUP_MA"], "GROUP_MA"))

    def boundary(self, command: AsterCommand, entry: dict[str, Any], dim: int) -> list[_Marks]:
        """Of ``where`` the elements of the boundary of a body with so many dimensions."""
        pairs = zip(self.blocks, self.where(command, entry), strict=True)
        return [mark & (DIMENSIONS.get(kind) == dim - 1) for (kind, _), mark in pairs]

    def nodes_of_cells(self, marks: Sequence[_Marks]) -> Ints:
        """All nodes of elements, ascending."""
        nodes = [rows[mark].ravel() for (_, rows), mark in zip(self.blocks, marks, strict=True)]
        return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *nodes]))

    def corners_of_cells(self, marks: Sequence[_Marks]) -> Ints:
        """The corners of elements, ascending."""
        tables = zip(self.blocks, marks, strict=True)
        parts = [rows[mark][:, : _corners(kind)].ravel() for (kind, rows), mark in tables]
        return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *parts]))

    def nodes(self, command: AsterCommand, names: Sequence[str]) -> Ints:
        """The nodes of groups of nodes, one after the other.

        Raises:
            CommandError: there is no such group.
        """
        parts = []
        for name in names:
            if name not in self.node_groups:
                why = "it is a GROUP_MA" if name in self.cell_groups else "it is not in the mesh"
                raise CommandError(command.origin, f"there is no GROUP_NO {name!r}: {self.unknown.get(name, why)}")
            parts.append(self.node_groups[name])
        nodes = np.concatenate([np.empty(0, dtype=np.int64), *parts])
        return nodes[np.sort(np.unique(nodes, return_index=True)[1])]

    def selected(self, command: AsterCommand, entry: dict[str, Any], *, without: bool = True) -> Ints:
        """The nodes that an occurrence of a factor keyword names: TOUT, GROUP_NO, GROUP_MA, less SANS_GROUP_...

        Raises:
            CommandError: it names none, or some that are not there.
        """
        parts = []
        if entry.get("TOUT") == "OUI":
            parts.append(self.nodes_of_cells(self.everything()))
        if "GROUP_NO" in entry:
            parts.append(self.nodes(command, command.words(entry["GROUP_NO"], "GROUP_NO")))
        if "GROUP_MA" in entry:
            names = command.words(entry["GROUP_MA"], "GROUP_MA")
            parts.append(self.nodes_of_cells(self.cells(command, names)))
        if "NOEUD" in entry:
            parts.append(self.single_nodes(command, command.words(entry["NOEUD"], "NOEUD")))
        if not parts:
            raise CommandError(command.origin, "GROUP_NO or GROUP_MA is expected")
        nodes = np.concatenate(parts)
        nodes = nodes[np.sort(np.unique(nodes, return_index=True)[1])]
        if without and "SANS_GROUP_NO" in entry:
            nodes = nodes[~np.isin(nodes, self.nodes(command, command.words(entry["SANS_GROUP_NO"], "SANS_GROUP_NO")))]
        if without and "SANS_GROUP_MA" in entry:
            excluded = self.cells(command, command.words(entry["SANS_GROUP_MA"], "SANS_GROUP_MA"))
            nodes = nodes[~np.isin(nodes, self.nodes_of_cells(excluded))]
        return nodes

    def single_nodes(self, command: AsterCommand, names: Sequence[str]) -> Ints:
        """Nodes by the names N1, N2 ... that they have in a mesh without names.

        Raises:
            CommandError: there is no such node.
        """
        numbers = [int(name[1:]) if name[:1] == "N" and name[1:].isdigit() else 0 for name in names]
        for name, number in zip(names, numbers, strict=True):
            if not 1 <= number <= len(self.points):
                raise CommandError(command.origin, f"there is no node {name!r}")
        return np.array(numbers, dtype=np.int64) - 1

    # --- DEFI_GROUP ---------------------------------------------------------------------------------------------------

    def define(self, command: AsterCommand) -> None:
        """DEFI_GROUP: new groups; one that is not known here is an error where it is needed.

        Raises:
            CommandError: one has no name.
        """
        for entry in command.factors("CREA_GROUP_MA"):
            name = _name(command, entry)
            try:
                self.cell_groups[name] = self._made_cells(command, entry)
            except CommandError as error:
                self.unknown[name] = error.text
        for entry in command.factors("CREA_GROUP_NO"):
            if entry.get("TOUT_GROUP_MA") == "OUI":
                for name, marks in list(self.cell_groups.items()):
                    self.node_groups.setdefault(name, self.nodes_of_cells(marks))
            elif "GROUP_MA" in entry and "NOM" not in entry:
                for name in command.words(entry["GROUP_MA"], "GROUP_MA"):
                    self.node_groups[name] = self.nodes_of_cells(self.cells(command, [name]))
            else:
                name = _name(command, entry)
                try:
                    self.node_groups[name] = self._made_nodes(command, entry)
                except CommandError as error:
                    self.unknown[name] = error.text

    def _made_cells(self, command: AsterCommand, entry: dict[str, Any]) -> list[_Marks]:
        if entry.keys() & {"OPTION", "MAILLE"} or entry.get("TYPE_MAILLE", "TOUT") != "TOUT":
            raise CommandError(command.origin, f"CREA_GROUP_MA with {', '.join(entry)} is not known here")
        if entry.get("TOUT") == "OUI":
            return self.everything()
        for key in ("GROUP_MA", "UNION", "INTERSEC", "DIFFE"):
            if key not in entry:
                continue
            first, *further = [self.cells(command, [name]) for name in command.words(entry[key], key)]
            for additional in further:
                pairs = zip(first, additional, strict=True)
                first = [a & b if key == "INTERSEC" else a & ~b if key == "DIFFE" else a | b for a, b in pairs]
            return first
        raise CommandError(command.origin, f"CREA_GROUP_MA with {', '.join(entry)} is not known here")

    def _made_nodes(self, command: AsterCommand, entry: dict[str, Any]) -> Ints:
        option = entry.get("OPTION")
        if option == "PLAN":
            point, normal = (_vector(command, entry, key) for key in ("POINT", "VECT_NORMALE"))
            away = np.abs((self.points - point) @ normal) / np.linalg.norm(normal)
            return np.flatnonzero(away <= command.number(entry.get("PRECISION"), "PRECISION"))
        if option == "ENV_SPHERE":
            radius, near = (command.number(entry.get(key), key) for key in ("RAYON", "PRECISION"))
            away = np.linalg.norm(self.points - _vector(command, entry, "POINT"), axis=1)
            return np.flatnonzero(np.abs(away - radius) <= near)
        if option in ("NOEUD_ORDO", "SEGM_DROI_ORDO", "TUNNEL") and ("GROUP_MA" in entry or "GROUP_NO" in entry):
            keys = {key: entry[key] for key in ("GROUP_MA", "GROUP_NO") if key in entry}
            return self.selected(command, keys)
        if option is not None:
            raise CommandError(command.origin, f"CREA_GROUP_NO: OPTION={option!r} is not known here")
        for key in ("UNION", "INTERSEC", "DIFFE"):
            if key in entry:
                first, *further = [self.nodes(command, [name]) for name in command.words(entry[key], key)]
                for additional in further:
                    if key == "UNION":
                        first = np.union1d(first, additional)
                    else:
                        first = first[np.isin(first, additional) == (key == "INTERSEC")]
                return first
        corners = entry.get("CRIT_NOEUD", "TOUS")
        if corners == "SOMMET" and "GROUP_MA" in entry:
            marks = self.cells(command, command.words(entry["GROUP_MA"], "GROUP_MA"))
            return self.corners_of_cells(marks)
        if corners != "TOUS":
            raise CommandError(command.origin, f"CREA_GROUP_NO: CRIT_NOEUD={corners!r} is not known here")
        return self.selected(command, entry)

    # --- other changes ------------------------------------------------------------------------------------------------

    def normals(self, marks: Sequence[_Marks]) -> Floats:
        """Unit normals of a surface at its nodes, of either sense, zero elsewhere, shape (nodes, 3)."""
        of_blocks = [
            (rows[mark], _normals(kind, self.points[rows[mark]]))
            for (kind, rows), mark in zip(self.blocks, marks, strict=True)
            if mark.any()
        ]
        sums, first = np.zeros_like(self.points), np.zeros_like(self.points)
        for nodes, normals in of_blocks:
            for column in nodes.T:
                first[column] = normals
        for nodes, normals in of_blocks:
            for column in nodes.T:
                # Elements whose nodes are in the other order have the opposite normal.
                along = np.where(np.einsum("nd,nd->n", normals, first[column]) < 0, -1.0, 1.0)
                np.add.at(sums, column, along[:, None] * normals)
        lengths = np.linalg.norm(sums, axis=1, keepdims=True)
        return np.asarray(sums / np.where(lengths > 0, lengths, 1.0))

    def extent(self, marks: Sequence[_Marks]) -> float:
        """The diagonal of a box around some elements."""
        return float(np.linalg.norm(np.ptp(self.points[self.nodes_of_cells(marks)], axis=0)))

    def curvature(self, marks: Sequence[_Marks]) -> float:
        """The largest one of a surface, by the angle from its facets to the mean normals at their corners, 1 / length;
        an edge of a surface counts by the size of its facets.
        """
        means, largest = self.normals(marks), 0.0
        for (kind, rows), mark in zip(self.blocks, marks, strict=True):
            nodes = rows[mark][:, : _corners(kind)]
            x = self.points[nodes]
            if not len(nodes):
                continue
            normal = _normals(kind, x)
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            for k, column in enumerate(nodes.T):
                turned = np.linalg.norm(np.cross(normal, means[column]), axis=1)
                away = np.linalg.norm(x[:, k] - x.mean(axis=1), axis=1)
                largest = max(largest, float((turned / away).max()))
        return largest

    def nearest(self, nodes: Ints, further: Ints) -> Ints:
        """For each of some nodes that of others that is nearest."""
        away = np.linalg.norm(self.points[nodes][:, None] - self.points[further][None], axis=2)
        return np.asarray(further[away.argmin(axis=1)])

    def is_plane(self) -> bool:
        """Whether all nodes have one height."""
        return float(np.ptp(self.points[:, 2])) <= DIGITS_OF_FILES * self.size


def _name(command: AsterCommand, entry: dict[str, Any]) -> str:
    if "NOM" not in entry:
        raise CommandError(command.origin, "NOM is missing")
    return command.words(entry["NOM"], "NOM")[0]


def _vector(command: AsterCommand, entry: dict[str, Any], key: str) -> Floats:
    values = command.numbers(entry.get(key, ()), key)
    if len(values) not in (2, 3):
        raise CommandError(command.origin, f"{key}: two or three numbers are expected")
    return np.array((*values, 0.0)[:3])


def _corners(kind: str) -> int:
    """How many corners an element has, which stand first."""
    counts = {"vertex": 1, "line": 2, "triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
    return counts[kind.rstrip("0123456789")]


def _normals(kind: str, x: Floats) -> Floats:
    """Of elements of a boundary, of either sense and as long as they are large, from their nodes, shape (n, 3)."""
    if kind.startswith("line"):
        along = x[:, 1] - x[:, 0]
        return np.column_stack((along[:, 1], -along[:, 0], np.zeros(len(along))))
    return np.asarray(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), dtype=np.float64)
