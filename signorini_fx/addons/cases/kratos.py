"""What the parameters of a case of Kratos say of contact in linear elasticity, as a problem.  No dolfinx here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.addons.aster.grouped_mesh import GroupedMesh
from signorini_fx.addons.aster.study import CaseStudy, NodalForce, Relation, Support, SurfaceLoad, Zone, add_once
from signorini_fx.addons.cases.body_facets import BodyFacets, either, some, without
from signorini_fx.addons.cases.courses import Course
from signorini_fx.addons.cases.located_json import JsonError, JsonObject, read_object
from signorini_fx.addons.cases.mdpa import ELEMENT_KINDS, SubModelPart, read_mdpa
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import KRATOS_SAME_TIME

CHECKS = "from_json_check_result_process"
_CONTACTS = ("alm_contact_process", "penalty_contact_process", "mpc_contact_process", "mesh_tying_process")
# Processes that only look, or set what static problems with contact do not depend on.
_WITHOUT_EFFECT = (CHECKS, "json_output_process", "gid_output_process", "vtk_output_process", "check_normals_process")
_TENSOR_LAWS = ("LinearElastic", "KirchhoffSaintVenant", "HyperElastic")
_THICKNESS, _YOUNG, _POISSON = "THICKNESS", "YOUNG_MODULUS", "POISSON_RATIO"
_FRICTION = "FRICTION_COEFFICIENT"
_AXES = "XYZ"
_MOST_INSTANTS = 400
_FORMULATIONS = {
    "alm_contact_process": "by a mortar method with an augmented Lagrangian, on the deformed surfaces",
    "penalty_contact_process": "by a mortar method with a penalty, on the deformed surfaces",
    "mpc_contact_process": "by tying the nodes of one surface to the other one while they touch",
    "mesh_tying_process": "by a mortar method with Lagrange multipliers",
}


@dataclass
class KratosStudy(CaseStudy):
    """A problem of a case of Kratos.

    Attributes:
        numbers: of the nodes, in the order of the mesh.
        checks: files with values that Kratos has computed, and of which variables.
    """

    numbers: Ints = None  # type: ignore[assignment]
    checks: tuple[tuple[Path, tuple[str, ...]], ...] = ()


def other_solver(file: Path) -> str:
    """Why a case is no statics; "": it is, or it does not say.

    Raises:
        MeshError: the file cannot be read.
    """
    settings = read_object(file).get("solver_settings")
    kind = settings.get("solver_type") if isinstance(settings, JsonObject) else None
    if not isinstance(settings, JsonObject) or not isinstance(kind, str) or "static" in kind.lower():
        return ""
    return f"line {settings.line}, solver_type {kind!r}: only static steps are taken"


def read_kratos(file: Path) -> KratosStudy:
    """The problem of a file of parameters, beside or above which the files are that it names.

    Raises:
        MeshError: something is missing, or is not known here; the message says where.
    """
    parameters = read_object(file)
    try:
        return _KratosCase(file, parameters).study()
    except JsonError as error:
        raise MeshError(f"{file}: {error.text}") from None


def case_file(file: Path, name: str, suffix: str = "") -> Path | None:
    """A file that the parameters name, relative to their folder or the one above it; None: it is not there."""
    for folder in (file.parent, file.parent.parent):
        for candidate in (folder / f"{name}{suffix}", folder / f"{Path(name).name}{suffix}"):
            if candidate.is_file():
                return candidate
    return None


class _KratosCase:
    """The parameters, and what has been read of the case so far."""

    def __init__(self, file: Path, parameters: JsonObject) -> None:
        self._file, self._parameters = file, parameters
        self._settings = parameters.part("solver_settings")
        self._root = self._settings.text("model_part_name", "Structure")
        name = self._settings.part("model_import_settings")
        mdpa_file = case_file(file, name.text("input_filename"), ".mdpa")
        if mdpa_file is None:
            raise name.error(f"input_filename: {name.text('input_filename')}.mdpa is not there")
        self._mdpa = mdpa_file
        self._model = read_mdpa(mdpa_file)
        self._processes = self._listed_processes()
        self._lost: list[tuple[str, str]] = []
        self._finite = ""
        self._kind = ""
        self._blocks = self._element_blocks()
        self._facets = BodyFacets(self._model.points, [(kind, nodes) for kind, nodes, _ in self._blocks])

    def study(self) -> KratosStudy:
        """All of it."""
        facets = self._facets
        body = facets.nothing()
        for k in range(facets.cells):
            body[k][:] = True
        materials, sizes = self._materials()
        study = KratosStudy(GroupedMesh(facets.mesh), self._kind, body)
        study.numbers, study.finite = self._model.numbers, self._finite
        study.materials = materials
        for origin, why in self._lost:
            study.lose(origin, why)
        for line, entry in self._model.unread.items():
            if "NORMAL" not in entry:
                study.lose(f"{self._mdpa.name}: line {line}", f"{entry}: not known here")
        study.checks = tuple(self._checks())
        self._contacts(study, sizes)
        times = self._times()
        study.instants = self._needed(times, study)
        course = Course(study.instants, study.dim, len(self._model.numbers))
        for process in self._processes:
            self._act(study, course, *process)
        self._say_supports(study, course)
        self._say_loads(study, course)
        return study

    # --- the model ------------------------------------------------------------------------------------------------

    def _listed_processes(self) -> list[tuple[str, str, JsonObject]]:
        """Name, place in the file and parameters of all processes."""
        collected = []
        groups = self._parameters.part("processes")
        for key in groups:
            for entry in groups.parts(key):
                name = entry.text("python_module", entry.get("process_name"))
                collected.append((name.rpartition(".")[2], f"line {entry.line}, {name}", entry.part("Parameters")))
        return collected

    def _part(self, parameters: JsonObject, key: str, name: str) -> SubModelPart | None:
        """A sub model part by its name; None: it is the whole model."""
        if name == self._root:
            return None
        name = name.removeprefix(f"{self._root}.")
        if name not in self._model.parts:
            raise parameters.error(f"{key}: {self._mdpa.name} has no SubModelPart {name}")
        return self._model.parts[name]

    def _nodes_of(self, parameters: JsonObject, key: str, names: list[str]) -> Ints:
        """The rows of the nodes of parts."""
        rows: list[Ints] = [np.empty(0, np.int64)]
        for name in names:
            part = self._part(parameters, key, name)
            listed = self._model.numbers if part is None else np.unique(np.array(part.nodes, dtype=np.int64))
            rows.append(self._model.rows(listed))
        return np.unique(np.concatenate(rows))

    def _element_blocks(self) -> list[tuple[str, Ints, Ints]]:
        """Kind, nodes and numbers of the elements of each block; says what kind of model they are."""
        blocks, kinds = [], set()
        for block in self._model.elements:
            kind = block.kind(ELEMENT_KINDS)
            name = block.name
            if not kind or not ("Displacement" in name or "Lagrangian" in name) or "SolidShell" in name:
                raise MeshError(f"{self._mdpa}: line {block.line}: {name} is not known here")
            if "Lagrangian" in name:
                self._finite = self._finite or f"{self._mdpa.name}: line {block.line}, {name}"
            kinds.add("AXIS" if "Axisym" in name else f"{block.dim}D")
            blocks.append((kind, self._model.rows(block.nodes), block.numbers))
        if len(kinds) != 1:
            raise MeshError(f"{self._mdpa}: line 1: elements of one kind are expected, not {sorted(kinds)}")
        self._kind = kinds.pop()
        return blocks

    def _materials(self) -> tuple[list[tuple[list[Any], dict[str, float], str]], list[float]]:
        """Materials of the problem with their elements, and the thicknesses that they name."""
        settings = self._settings.part("material_import_settings")
        name = settings.text("materials_filename", "")
        entries: list[tuple[list[Any], JsonObject, str]] = []
        if not name:
            raise settings.error("materials_filename: a file of materials is expected")
        path = case_file(self._file, name)
        if path is None:
            raise settings.error(f"materials_filename: {name} is not there")
        listed = read_object(path)
        try:
            for entry in listed.parts("properties"):
                part = self._part(entry, "model_part_name", entry.text("model_part_name"))
                marks = self._facets.nothing()
                for mark, (_, _, numbers) in zip(marks, self._blocks, strict=False):
                    mark[:] = True if part is None else np.isin(numbers, np.array(part.elements, dtype=np.int64))
                if some(marks):
                    entries.append((marks, entry.part("Material"), f"{path.name}: line {entry.line}"))
            materials = [self._material(*entry) for entry in entries]
        except JsonError as error:
            raise MeshError(f"{path}: {error.text}") from None
        covered = either(self._facets.nothing(), *(marks for marks, _, _ in materials))
        if not all(mark.all() for mark in covered[: self._facets.cells]):
            raise MeshError(f"{path}: line {listed.line}: some elements have no material")
        thickness = [entry[1].part("Variables").number(_THICKNESS, 1.0) for entry in entries]
        self._coefficients = [
            (marks, material.part("Variables").number(_FRICTION, 0.0)) for marks, material, _ in entries
        ]
        return materials, thickness if self._kind.startswith(("D_", "C_")) else [1.0]

    def _material(self, marks: list[Any], entry: JsonObject, origin: str) -> tuple[list[Any], dict[str, float], str]:
        law, variables = entry.part("constitutive_law").text("name"), entry.part("Variables")
        name = law.rpartition(".")[2]
        if not name.startswith(_TENSOR_LAWS) or "Plasticity" in name or "Damage" in name:
            raise entry.error(f"constitutive_law: {law} is not known here")
        if not name.startswith("LinearElastic"):
            self._finite = self._finite or f"{origin}, {law}"
        if self._kind not in ("3D", "AXIS"):
            kind = "C_PLAN" if "PlaneStress" in name else "D_PLAN" if "PlaneStrain" in name else ""
            if not kind or self._kind not in ("2D", kind):
                raise entry.error(f"constitutive_law: {law}: one plane law is expected")
            self._kind = kind
        if self._kind == "AXIS" and "Axisym" not in name:
            self._lost.append(
                (f"{origin}, {law}", "a plane law in elements of revolution, where it has no hoop stress")
            )
        young, poisson = variables.number(_YOUNG), variables.number(_POISSON)
        properties = {"young": young, "poisson": poisson}
        if "DENSITY" in variables:
            properties["density"] = variables.number("DENSITY")
        return marks, properties, f"{origin}, {law}"

    # --- time -----------------------------------------------------------------------------------------------------

    def _times(self) -> list[float]:
        """When Kratos solves: the last time is the first one that is not before the end."""
        data, stepping = self._parameters.part("problem_data"), self._settings.part("time_stepping")
        start, end = data.number("start_time", 0.0), data.number("end_time")
        times, time = [], start
        while time < end:
            time += self._step(stepping, time)
            times.append(time)
            if len(times) > 100 * _MOST_INSTANTS:
                raise stepping.error(f"time_step: more than {100 * _MOST_INSTANTS} steps to {end:g}")
        if not times:
            raise data.error(f"end_time: {end:g} is not after start_time, {start:g}")
        return times

    @staticmethod
    def _step(stepping: JsonObject, time: float) -> float:
        if "time_step" in stepping:
            step, where = stepping.number("time_step"), stepping
        else:
            intervals = stepping.part("time_step_intervals")
            for key in sorted(intervals):  # as Kratos keeps its objects
                where = intervals.part(key)
                begin, end = _interval(where)
                if begin - KRATOS_SAME_TIME <= time <= end:
                    step = where.number("time_step")
                    break
            else:
                raise stepping.error(f"time_stepping: no step is given at the time {time:g}")
        if not step > 0:
            raise where.error("time_step: a number above 0 is expected")
        return step

    def _needed(self, times: list[float], study: KratosStudy) -> list[float]:
        """Without friction the instants of values; with friction all, as the answer depends on them."""
        if any(zone.coefficient for zone in study.zones):
            if len(times) > _MOST_INSTANTS:
                raise self._settings.error(f"more than {_MOST_INSTANTS} steps with friction")
            return times
        wanted = [time for path, _ in study.checks for time in times_of(path)]
        step = min(np.diff([0.0, *times]))
        enough = [time for time in times if any(abs(time - value) <= KRATOS_SAME_TIME * step for value in wanted)]
        return enough or times[-1:]

    def _checks(self) -> list[tuple[Path, tuple[str, ...]]]:
        collected = []
        for name, _, parameters in self._processes:
            if name == CHECKS:
                path = case_file(self._file, parameters.text("input_file_name"))
                if path is not None:
                    collected.append((path, tuple(parameters.words("check_variables"))))
        return collected

    # --- supports and loads ---------------------------------------------------------------------------------------

    def _act(self, study: KratosStudy, course: Course, name: str, origin: str, parameters: JsonObject) -> None:
        """What a process does."""
        if name in _WITHOUT_EFFECT or name in _CONTACTS:
            return
        variable = parameters.text("variable_name", "") if "variable_name" in parameters else ""
        base, _, axis = variable.rpartition("_") if variable[-2:-1] == "_" else (variable, "", "")
        on_conditions = name.endswith(("_to_conditions_process", "_to_condition_process"))
        assigns = name.startswith(("assign_vector_variable", "assign_scalar_variable", "assign_vector_by_direction"))
        if name == "impose_rigid_movement_process":
            self._tie_nodes(study, origin, parameters)
        elif not assigns:
            study.lose(origin, "not known here")
        elif on_conditions and base in ("LINE_LOAD", "SURFACE_LOAD", "POINT_LOAD"):
            self._load(study, course, origin, parameters, base, axis)
        elif on_conditions and base in ("POSITIVE_FACE_PRESSURE", "NEGATIVE_FACE_PRESSURE"):
            self._load(study, course, origin, parameters, "FACE_PRESSURE", "XZ"[base.startswith("NEG")])
        elif not on_conditions and base == "DISPLACEMENT":
            self._hold(study, course, origin, parameters, axis)
        elif not on_conditions and base == "VOLUME_ACCELERATION":
            self._weigh(study, course, origin, parameters, axis)
        elif "LAGRANGE_MULTIPLIER" in variable:
            study.note(origin, f"{variable}: multipliers are what contact makes them here")
        else:
            study.lose(origin, f"{variable or name}: not known here")

    def _entries(self, parameters: JsonObject, axis: str) -> list[tuple[int, Any]]:
        """Components and what is given for each: a number, or a function of time and place."""
        if "direction" in parameters:
            direction = parameters["direction"]
            if (
                not isinstance(direction, list)
                or len(direction) != 3
                or not all(isinstance(c, int | float) for c in direction)
            ):
                raise parameters.error("direction: three numbers are expected")
            unit = np.array(direction, dtype=float)
            if not (length := float(np.linalg.norm(unit))) > 0:
                raise parameters.error("direction: it has no length")
            modulus = parameters.get("modulus")
            return [(k, _scaled(modulus, part)) for k, part in enumerate(plain(unit / length))]
        value = parameters.get("value")
        if axis:
            return [(_AXES.index(axis), value)] if axis in _AXES else []
        if not isinstance(value, list) or len(value) != 3:
            raise parameters.error("value: three numbers or functions are expected")
        return list(enumerate(value))

    def _hold(self, study: KratosStudy, course: Course, origin: str, parameters: JsonObject, axis: str) -> None:
        rows = self._nodes_of(parameters, "model_part_name", [parameters.text("model_part_name")])
        fixed = parameters.get("constrained", True)
        fixed = [fixed] * 3 if isinstance(fixed, bool) else fixed
        if not isinstance(fixed, list) or len(fixed) != 3:
            raise parameters.error("constrained: true, false, or three of them are expected")
        interval = _interval(parameters)
        for component, value in self._entries(parameters, axis):
            if component < study.dim and value is not None and fixed[component]:
                course.hold(parameters, origin, component, rows, value, self._model.points[rows], interval)

    def _load(
        self, study: KratosStudy, course: Course, origin: str, parameters: JsonObject, base: str, axis: str
    ) -> None:
        name = parameters.text("model_part_name")
        if self._part(parameters, "model_part_name", name) is None:
            raise parameters.error("model_part_name: a SubModelPart with conditions is expected")
        interval = _interval(parameters)
        for component, value in self._entries(parameters, axis):
            if value is not None:
                course.load(parameters, origin, (base, name), component, value, interval)

    def _weigh(self, study: KratosStudy, course: Course, origin: str, parameters: JsonObject, axis: str) -> None:
        rows = self._nodes_of(parameters, "model_part_name", [parameters.text("model_part_name")])
        used = np.unique(np.concatenate([nodes.ravel() for _, nodes, _ in self._blocks]))
        if not np.isin(used, rows).all():
            heavy = self._facets.nothing()
            for mark, (_, nodes, _) in zip(heavy, self._blocks, strict=False):
                mark[:] = np.isin(nodes, rows).all(axis=1)
            if not all(
                np.isin(nodes[~mark], rows).sum() == 0 for mark, (_, nodes, _) in zip(heavy, self._blocks, strict=False)
            ):
                study.lose(origin, "weight of nodes within a body: that of whole elements is taken")
            study.materials = [
                (part, properties if number == 0 else properties | {"density": 0.0}, origin_of)
                for marks, properties, origin_of in study.materials
                for number, part in enumerate(
                    ([a & b for a, b in zip(marks, heavy, strict=True)], without(marks, heavy))
                )
                if some(part)
            ]
        for component, value in self._entries(parameters, axis):
            if value is not None:
                course.load(parameters, origin, ("WEIGHT", ""), component, value, _interval(parameters))

    def _tie_nodes(self, study: KratosStudy, origin: str, parameters: JsonObject) -> None:
        rows = self._nodes_of(parameters, "model_part_name", [parameters.text("model_part_name")])
        variable = parameters.text("master_variable_name", "DISPLACEMENT")
        factor = parameters.number("relation", 1.0)
        if parameters.text("slave_variable_name", "") not in ("", variable) or parameters.number("constant", 0.0):
            study.lose(origin, "a relation of other displacements, or with a constant")
            return
        components = [k for k in range(study.dim) if variable in ("DISPLACEMENT", f"DISPLACEMENT_{_AXES[k]}")]
        number = int(parameters.number("master_node_id", 0.0))
        if number and number not in self._model.numbers:
            raise parameters.error(f"master_node_id: node {number} is not there")
        master = int(self._model.rows(np.array([number]))[0]) if number else int(rows[0])
        for row in rows[rows != master]:
            for k in components:
                study.relations.append(Relation(((int(row), k, 1.0), (master, k, -factor)), origin))

    def _say_supports(self, study: KratosStudy, course: Course) -> None:
        """Supports; those of whole facets that may touch are links, as a scene has one of the two on a facet."""
        pairs = [either(zone.slave, zone.master) for zone in study.zones if not zone.tied]
        supports = list(course.supports())
        for component in range(study.dim):
            of_component = [(rows, values, origin) for k, rows, values, origin in supports if k == component]
            still = [rows for rows, values, _ in of_component if all(isinstance(v, float) and v == 0 for v in values)]
            touching = [pair for pair in pairs if self._facets.leans(pair, component)]
            nodes = np.concatenate([np.empty(0, np.int64), *still])
            crossed = self._facets.filled(either(self._facets.nothing(), *touching), nodes)
            for rows, values, origin in of_component:
                linked = np.intersect1d(rows, crossed)
                study.relations += [Relation(((node, component, 1.0),), origin) for node in plain(linked)]
                if (rows := np.setdiff1d(rows, linked)).size:
                    study.supports.append(Support(rows, component, values, origin))

    def _say_loads(self, study: KratosStudy, course: Course) -> None:
        for (base, name), values, origin in course.loads():
            if base == "WEIGHT":
                study.gravities.append((values, origin))
                continue
            part = self._model.parts[name.removeprefix(f"{self._root}.")]
            if base == "POINT_LOAD":
                blocks = self._conditions(part, 1)
                rows = np.unique(np.concatenate([np.empty(0, np.int64), *(nodes.ravel() for _, nodes in blocks)]))
                study.forces.append(NodalForce(rows, np.asarray(values / self._thickness), origin))
                continue
            blocks = [(n, rows) for n, rows in self._conditions(part, 2) if "Load" in n or "Pressure" in n]
            if not blocks:
                study.note(origin, f"{name} has no conditions of a load")
            for _, rows in blocks:
                self._say_load(study, base, rows, values, origin)

    def _say_load(self, study: KratosStudy, base: str, rows: Ints, values: Floats, origin: str) -> None:
        corners = rows[:, : {2: 2, 3: 2 if study.dim == 2 else 3}.get(rows.shape[1], 3 if rows.shape[1] == 6 else 4)]
        if base != "FACE_PRESSURE":
            marks, missing = self._facets.matching(corners)
            if missing:
                study.lose(origin, f"{missing} conditions are on no side of the body")
            study.tractions.append(SurfaceLoad(marks, np.asarray(values / self._thickness), origin))
            return
        signs = self._facets.outward(corners)
        if not signs.all():
            study.lose(origin, f"{int((signs == 0).sum())} conditions are on no side of the body")
        for sign in (1.0, -1.0):
            marks, _ = self._facets.matching(corners[signs == sign])
            # In the plane a positive face pressure pulls where in space it pushes.
            pushes = sign if study.dim == 3 else -sign
            pressure = pushes * (values[:, 0] - values[:, 2]) / self._thickness
            if some(marks):
                study.pressures.append(SurfaceLoad(marks, np.asarray(pressure[:, None]), origin))

    def _conditions(self, part: SubModelPart, least: int) -> list[tuple[str, Ints]]:
        """Names and rows of the nodes of the conditions of a part, block by block, with so many nodes or more."""
        listed = np.array(part.conditions, dtype=np.int64)
        blocks = []
        for block in self._model.conditions:
            chosen = np.isin(block.numbers, listed)
            if chosen.any() and (block.nodes.shape[1] >= 2) == (least >= 2):
                blocks.append((block.name, self._model.rows(block.nodes[chosen])))
        return blocks

    # --- contact --------------------------------------------------------------------------------------------------

    def _contacts(self, study: KratosStudy, sizes: list[float]) -> None:
        self._thickness = sizes[0]
        if len(set(sizes)) > 1:
            study.lose("", "parts of different thickness")
        for name, origin, parameters in self._processes:
            if name not in _CONTACTS:
                continue
            add_once(study.formulations, _FORMULATIONS[name])
            kind = parameters.text("contact_type", "Frictionless")
            tied = name == "mesh_tying_process" or kind == "MeshTying"
            if not tied:
                study.follows = origin
            if name == "penalty_contact_process":
                study.lose(origin, "the penalty that Kratos computes: contact is hard here")
            if "PureSlip" in kind:
                study.lose(origin, f"{kind}: friction acts only where bodies slide")
            surfaces = parameters.part(
                "mesh_tying_model_part" if name == "mesh_tying_process" else "contact_model_part"
            )
            for key in sorted(surfaces):
                if names := surfaces.words(key):
                    self._zone(study, origin, parameters, key, names, rubs="Frictional" in kind, tied=tied)
        if not study.zones:
            raise self._parameters.part("processes").error("no contact is known here")

    def _zone(
        self,
        study: KratosStudy,
        origin: str,
        parameters: JsonObject,
        key: str,
        names: list[str],
        *,
        rubs: bool,
        tied: bool,
    ) -> None:
        facets = self._facets
        marks = facets.nothing()
        for name in names:
            part = self._part(parameters, key, name)
            blocks = [] if part is None else self._conditions(part, 2)
            if blocks:
                corners = [rows[:, : _corner_count(rows.shape[1], study.dim)] for _, rows in blocks]
                marks = either(marks, *(facets.matching(rows)[0] for rows in corners))
            else:
                marks = either(marks, facets.within(self._nodes_of(parameters, key, [name])))
        assumed = parameters.part("assume_master_slave").words(key)
        if assumed:
            slave_nodes = self._nodes_of(parameters, "assume_master_slave", assumed)
            slave = [a & b for a, b in zip(marks, facets.within(slave_nodes), strict=True)]
            master = without(marks, slave)
        else:
            slave, master = facets.halves(marks)
        if not some(slave) or not some(master):
            study.lose(origin, f"{key}: {', '.join(names)}: two surfaces of bodies are expected")
            return
        # Kratos takes the normals of the slave.  Ours are means of both sides, which facets that no point of the slave
        # faces, as round a corner, would turn.
        facing = facets.nothing() if tied else facets.facing(slave, master)
        master = facing if some(facing) else master
        coefficient = 0.0
        if rubs:
            coefficient = self._coefficient(study, origin, parameters, key, slave)
        no_nodes = np.empty(0, np.int64)
        number = len(study.zones) + 1
        study.zones.append(
            Zone(slave, master, coefficient, None, None, origin, number, False, no_nodes, no_nodes, tied)
        )

    def _coefficient(
        self, study: KratosStudy, origin: str, parameters: JsonObject, key: str, slave: list[Any]
    ) -> float:
        """Of friction: that of the pair, or of the materials of the slave side."""
        pair = parameters.part("friction_coefficients")
        if key in pair:
            return pair.number(key)
        nodes = np.unique(
            np.concatenate(
                [rows[mark].ravel() for (_, rows), mark in zip(self._facets.mesh.blocks, slave, strict=True)]
            )
        )
        values = set()
        for marks, value in self._coefficients:
            pairs = zip(self._facets.mesh.blocks, marks, strict=True)
            if any(np.isin(rows[mark], nodes).any() for (_, rows), mark in pairs if mark.any()):
                values.add(value)
        if len(values) != 1:
            study.lose(origin, f"{key}: several coefficients of friction on one side")
        return max(values, default=0.0)


def _corner_count(nodes: int, dim: int) -> int:
    """Of a condition with so many nodes how many are corners."""
    return 2 if dim == 2 else 3 if nodes in (3, 6) else 4


def _interval(parameters: JsonObject) -> tuple[float, float]:
    """The beginning and the end of a time."""
    value = parameters.get("interval", [0.0, "End"])
    if not isinstance(value, list) or len(value) != 2 or isinstance(value[0], bool | str) or value[0] is None:
        raise parameters.error("interval: two numbers, or a number and 'End', are expected")
    end = np.inf if value[1] == "End" else value[1]
    if not isinstance(end, int | float) or not isinstance(value[0], int | float):
        raise parameters.error("interval: two numbers, or a number and 'End', are expected")
    return float(value[0]), float(end)


def _scaled(value: Any, factor: float) -> Any:
    """A number or a function times a number; nothing: the component is zero throughout."""
    if isinstance(value, str):
        return f"({value}) * {factor!r}" if factor else 0.0
    return value * factor if isinstance(value, int | float) and not isinstance(value, bool) else value


def times_of(path: Path) -> list[float]:
    """The times of values that Kratos has written; some of its files have none.

    Raises:
        MeshError: they are no numbers, or the file is none of values.
    """
    entries = read_object(path)
    values = entries.get("TIME", [])
    if not isinstance(values, list) or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        raise MeshError(f"{path}: line {entries.line}: TIME: a list of numbers is expected")
    return [float(value) for value in values]
