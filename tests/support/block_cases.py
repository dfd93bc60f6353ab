"""Two blocks, one upon the other, as cases of Kratos and of FrontISTR."""

import itertools
import json

import numpy as np

YOUNG, POISSON, PRESSURE = 16000.0, 0.25, 16.0
CORNERS = {
    2: [(0, 0), (1, 0), (1, 1), (0, 1)],
    3: [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))],
}
SIDES = {2: [(0,), (1,)], 3: [(0, 0), (1, 0), (1, 1), (0, 1)]}
TETRAHEDRA = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]


class Blocks:
    """Unit blocks that do not match, with their nodes and sides.

    Attributes:
        points: number of a node -> position, shape (3,).
        cells: block by block, nodes of each cell.
        sides: (block, axis, end) -> nodes of each side.
    """

    def __init__(self, dim, columns=(2, 3), gap=0.0):
        self.dim, self.points, self.cells, self.sides = dim, {}, [], {}
        for block, count in enumerate(columns):
            counts = [count] * (dim - 1) + [1]
            low = np.array([0.0] * (dim - 1) + [block * (1.0 + gap)])
            known, cells = {}, []

            def node(place, low=low, counts=counts, known=known):
                if place not in known:
                    known[place] = 10 + 3 * len(self.points)  # not in line, as in files
                    x = low + np.array(place) / counts
                    self.points[known[place]] = np.pad(x, (0, 3 - dim))
                return known[place]

            for at in itertools.product(*map(range, counts)):
                cells.append([node(tuple(np.add(at, corner).tolist())) for corner in CORNERS[dim]])
                for axis, end in itertools.product(range(dim), (0, 1)):
                    if at[axis] == (counts[axis] - 1) * end:
                        places = [[*local[:axis], end, *local[axis:]] for local in SIDES[dim]]
                        nodes = [node(tuple(np.add(at, place).tolist())) for place in places]
                        self.sides.setdefault((block, axis, end), []).append(nodes)
            self.cells.append(cells)

    def nodes(self, *sides):
        """All nodes of sides."""
        return sorted({node for side in sides for row in self.sides[side] for node in row})


def exact(x, model):
    """The displacement of blocks that are pressed together between a plane and a uniform pressure, shape (3,)."""
    strain = PRESSURE / YOUNG
    if model == "strain":
        return np.array([POISSON * (1 + POISSON) * strain * x[0], -(1 - POISSON**2) * strain * x[1], 0.0])
    if model in ("stress", "axis"):
        return np.array([POISSON * strain * x[0], -strain * x[1], 0.0])
    return np.array([*(POISSON * strain * x[:2]), -strain * x[2]])


LAWS = {
    "strain": "LinearElasticPlaneStrain2DLaw",
    "stress": "LinearElasticPlaneStress2DLaw",
    "axis": "LinearElasticAxisym2DLaw",
    "space": "LinearElastic3DLaw",
}


def process(module, name="", **parameters):
    """A process of a file of parameters."""
    named = {"model_part_name": f"Structure.{name}" if name else "Structure"}
    return {"python_module": module, "Parameters": {**named, **parameters}}


class KratosCase:
    """A case whose content a test may change before it is written.

    Attributes:
        blocks: the mesh.
        parameters: of the problem.
        materials: of both blocks.
        results: what Kratos is said to have computed.
        parts: name -> nodes, elements and conditions.
        conditions: rows of nodes.
    """

    def __init__(self, model="strain", *, element="", tetrahedra=False, turned=False, gap=0.0):
        dim = 3 if model == "space" else 2
        self.model, self.blocks = model, Blocks(dim, gap=gap)
        axisymmetric = "Axisym" if model == "axis" else ""
        kind = element or f"{axisymmetric}SmallDisplacementElement"
        self.cells = [
            [[cell[k] for k in places] for cell in cells for places in TETRAHEDRA] if tetrahedra else cells
            for cells in self.blocks.cells
        ]
        self.element = f"{kind}{dim}D{len(self.cells[0][0])}N"
        up = dim - 1
        # Of a side along x, from left to right at the top, the normal to the right of it points into the body.
        top = self.blocks.sides[1, up, 1]
        if tetrahedra:
            top = [[row[k] for k in places] for row in top for places in ((0, 1, 2), (0, 2, 3))]
        self.conditions = [row[::-1] if turned else row for row in top]
        word = "Line" if dim == 2 else "Surface"
        self.condition = f"{axisymmetric}{word}LoadCondition{dim}D{len(top[0])}N"
        count = len(self.cells[0])
        self.parts = {
            "Low": (self._of(0), range(1, count + 1), ()),
            "Up": (self._of(1), range(count + 1, count + len(self.cells[1]) + 1), ()),
            "Top": (self.blocks.nodes((1, up, 1)), (), range(1, len(top) + 1)),
            "Bottom": (self.blocks.nodes((0, up, 0)), (), ()),
            **{f"Wall_{'xyz'[axis]}": (self.blocks.nodes((0, axis, 0), (1, axis, 0)), (), ()) for axis in range(up)},
            "Contact": (self.blocks.nodes((0, up, 1), (1, up, 0)), (), ()),
        }
        held = [
            process(
                "assign_vector_variable_process",
                name,
                variable_name="DISPLACEMENT",
                constrained=[k == axis for k in range(3)],
                value=[0.0, 0.0, 0.0],
            )
            for name, axis in [("Bottom", up), *((f"Wall_{'xyz'[axis]}", axis) for axis in range(up))]
        ]
        direction = [0.0, 0.0, 0.0]
        direction[up] = -2.0
        load = process(
            "assign_vector_by_direction_to_condition_process",
            "Top",
            variable_name="LINE_LOAD" if dim == 2 else "SURFACE_LOAD",
            modulus=f"{PRESSURE} * t",
            direction=direction,
        )
        touching = process(
            "alm_contact_process",
            contact_model_part={"0": ["Contact"]},
            assume_master_slave={"0": ["Up"]},
            contact_type="Frictionless",
        )
        names = [f"DISPLACEMENT_{axis}" for axis in "XYZ"[:dim]]
        check = process(
            "from_json_check_result_process",
            "Contact",
            check_variables=[*names, "AUGMENTED_NORMAL_CONTACT_PRESSURE"],
            input_file_name="folder/case_results.json",
        )
        self.parameters = {
            "problem_data": {"start_time": 0.0, "end_time": 0.95},
            "solver_settings": {
                "model_part_name": "Structure",
                "solver_type": "Static",
                "model_import_settings": {"input_type": "mdpa", "input_filename": "folder/case"},
                "material_import_settings": {"materials_filename": "folder/case_materials.json"},
                "time_stepping": {"time_step": 0.25},
            },
            "processes": {
                "constraints": held,
                "loads": [load],
                "contact": [touching],
                "check": [check],
            },
        }
        self.materials = [
            {
                "model_part_name": f"Structure.{name}",
                "Material": {
                    "constitutive_law": {"name": LAWS[model]},
                    "Variables": {"YOUNG_MODULUS": YOUNG, "POISSON_RATIO": POISSON, "DENSITY": 2.0},
                },
            }
            for name in ("Low", "Up")
        ]
        self.results = {"TIME": [0.5, 1.0]}
        for node in self.parts["Contact"][0]:
            u = exact(self.blocks.points[node], model)
            pressures = {"AUGMENTED_NORMAL_CONTACT_PRESSURE": [-0.5 * PRESSURE, -PRESSURE]}
            self.results[f"NODE_{node}"] = {name: [0.5 * u[k], u[k]] for k, name in enumerate(names)} | pressures

    def _of(self, block):
        return sorted({node for cell in self.cells[block] for node in cell})

    @property
    def mdpa(self):
        lines = ["Begin ModelPartData", "// nothing", "End ModelPartData", "Begin Properties 0", "End Properties"]
        lines += ["Begin Nodes // all", *(f" {n} {x[0]!r} {x[1]!r} {x[2]!r}" for n, x in self.points()), "End Nodes"]
        number = 1
        for cells in self.cells:
            lines.append(f"Begin Elements {self.element}// of a block")
            for cell in cells:
                lines.append(f" {number} 0 {' '.join(map(str, cell))}")
                number += 1
            lines.append("End Elements")
        rows = (f" {n} 0 {' '.join(map(str, row))}" for n, row in enumerate(self.conditions, 1))
        lines += [f"Begin Conditions {self.condition}", *rows, "End Conditions"]
        for name, (nodes, elements, conditions) in self.parts.items():
            lines.append(f"Begin SubModelPart {name}")
            for word, numbers in (("Nodes", nodes), ("Elements", elements), ("Conditions", conditions)):
                lines += [f" Begin SubModelPart{word}", *map(str, numbers), f" End SubModelPart{word}"]
            lines.append("End SubModelPart")
        return "\n".join(lines) + "\n"

    def points(self):
        """Numbers and positions of the nodes."""
        return [(number, x.tolist()) for number, x in self.blocks.points.items()]

    def write(self, folder):
        """Write all files, and return that of the parameters."""
        folder = folder / "folder"
        folder.mkdir(exist_ok=True)
        (folder / "case.mdpa").write_text(self.mdpa)
        for name, content in (
            ("parameters", self.parameters),
            ("materials", {"properties": self.materials}),
            ("results", self.results),
        ):
            (folder / f"case_{name}.json").write_text(json.dumps(content, indent=1))
        return folder / "case_parameters.json"


class FrontistrCase:
    """A case whose text a test may change before it is written.

    Attributes:
        mesh: the text of the mesh.
        control: that of the control file.
        displacements: number of a node -> what FrontISTR is said to have computed.
        pressures: likewise of contact.
    """

    def __init__(self, *, tetrahedra=False, interaction="SSLID", surfaces=True):
        blocks = Blocks(3)
        self.blocks = blocks
        cells = [
            [[cell[k] for k in places] for cell in block for places in TETRAHEDRA] if tetrahedra else block
            for block in blocks.cells
        ]
        lines = ["!HEADER", " two blocks", "!NODE"]
        lines += [f" {n}, {x[0]!r}, {x[1]!r}, {x[2]!r}" for n, x in ((n, x.tolist()) for n, x in blocks.points.items())]
        number = 1
        ranges = []
        for block, name in zip(cells, ("LOW", "UP"), strict=True):
            lines.append(f"!ELEMENT, TYPE={341 if tetrahedra else 361}, EGRP={name}")
            lines += [f" {number + k}, {', '.join(map(str, cell))}" for k, cell in enumerate(block)]
            ranges.append(range(number, number + len(block)))
            number += len(block)
        for name, nodes in {
            "BOTTOM": blocks.nodes((0, 2, 0)),
            "WALL_X": blocks.nodes((0, 0, 0), (1, 0, 0)),
            "WALL_Y": blocks.nodes((0, 1, 0), (1, 1, 0)),
            "SLAVES": blocks.nodes((1, 2, 0)),
        }.items():
            lines += [f"!NGROUP, NGRP={name}", *(f" {node}" for node in nodes)]
        for name, block, axis_end in (("TOP", 1, (2, 1)), ("UPPER", 1, (2, 0)), ("LOWER", 0, (2, 1))):
            faces = self._faces(cells[block], ranges[block], set(blocks.nodes((block, *axis_end))), tetrahedra)
            lines += [f"!SGROUP, SGRP={name}", *(f" {element}, {face}" for element, face in faces)]
        for name in ("LOW", "UP"):
            lines += [f"!SECTION, TYPE=SOLID, EGRP={name}, MATERIAL=STEEL", " 1.0"]
        lines += ["!MATERIAL, NAME=STEEL, ITEM=1", "!ITEM=1, SUBITEM=2", f" {YOUNG!r}, {POISSON!r}"]
        lines += [f"!CONTACT PAIR, NAME=PAIR{', TYPE=SURF-SURF' if surfaces else ''}"]
        lines += [f" {'UPPER' if surfaces else 'SLAVES'}, LOWER", "!END"]
        self.mesh = "\n".join(lines) + "\n"
        self.control = f"""!VERSION
 3
!SOLUTION, TYPE=NLSTATIC
# a comment
!BOUNDARY, GRPID=1
 BOTTOM, 3, 3, 0.0
 WALL_X, 1, 1
 WALL_Y, 2, 2
!DLOAD, GRPID=1
 TOP, S, {PRESSURE!r}
!CONTACT_ALGO, TYPE=SLAGRANGE
!CONTACT, INTERACTION={interaction}, GRPID=1
 PAIR, 0.0
!MATERIAL, NAME=STEEL
!ELASTIC, INFINITESIMAL
 {YOUNG!r}, {POISSON!r}
!STEP, SUBSTEPS=2
 BOUNDARY, 1
 LOAD, 1
 CONTACT, 1
!SOLVER, METHOD=CG
 1000, 1
!END
"""
        self.displacements = {n: exact(x, "space") for n, x in blocks.points.items()}
        self.pressures = dict.fromkeys(blocks.nodes((1, 2, 0)), PRESSURE)
        self.time = 1.0

    @staticmethod
    def _faces(cells, numbers, nodes, tetrahedra):
        """Elements and numbers of their faces, as FrontISTR counts them, all of whose corners are there."""
        if tetrahedra:
            faces = [(0, 1, 2), (3, 1, 0), (3, 2, 1), (3, 0, 2)]
        else:
            faces = [(0, 1, 2, 3), (7, 6, 5, 4), (4, 5, 1, 0), (5, 6, 2, 1), (6, 7, 3, 2), (7, 4, 0, 3)]
        return [
            (number, face)
            for number, cell in zip(numbers, cells, strict=True)
            for face, places in enumerate(faces, 1)
            if {cell[k] for k in places} <= nodes
        ]

    @property
    def result(self):
        lines = ["*fstrresult 2.0", "*comment", "static_result", "*global", "1", "1", "TOTALTIME", f"{self.time!r}"]
        lines += ["*data", f"{len(self.displacements)} 0", "2 0", "3 3", "DISPLACEMENT", "CONTACT_NTRACTION"]
        for number, u in self.displacements.items():
            pressure = float(self.pressures.get(number, 0.0))
            lines += [f"{number}", " ".join(map(repr, [*map(float, u), 0.0, 0.0, pressure]))]
        return "\n".join(lines) + "\n"

    def write(self, folder):
        """Write all files, and return the control file."""
        folder = folder / "folder"
        folder.mkdir(exist_ok=True)
        (folder / "case.msh").write_text(self.mesh)
        (folder / "case.cnt").write_text(self.control)
        (folder / "case.res.0.2").write_text(self.result)
        return folder / "case.cnt"
