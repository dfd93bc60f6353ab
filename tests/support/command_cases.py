"""Two blocks, one upon the other, as a command file of code_aster with its mesh."""

import itertools

import numpy as np

# Places of the nodes of a cell in halves of its sides, in the order of code_aster.
SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
CUBE = [
    *((x, y, 0) for x, y in SQUARE[:4]),
    *((x, y, 2) for x, y in SQUARE[:4]),
    *((x, y, 0) for x, y in SQUARE[4:]),
    *((x, y, 1) for x, y in SQUARE[:4]),
    *((x, y, 2) for x, y in SQUARE[4:]),
]
KINDS = {(2, 1): ("QUAD4", "SEG2"), (2, 2): ("QUAD8", "SEG3"), (3, 1): ("HEXA8", "QUAD4"), (3, 2): ("HEXA20", "QUAD8")}


class Mail:
    """The text of a mesh that grows."""

    def __init__(self, dim, degree):
        self.dim, self.degree = dim, degree
        self.nodes, self.cells, self.groups, self.node_groups = [], {}, {}, {}

    def _element(self, kind, nodes, *groups):
        name = f"M{sum(map(len, self.cells.values())) + 1}"
        self.cells.setdefault(kind, []).append((name, nodes))
        for group in groups:
            self.groups.setdefault(group, []).append(name)

    def block(self, name, counts, low, high):
        """A box of cells; its facets are NAME_x0, NAME_x1 and so on."""
        dim, known = self.dim, {}
        low, high = np.array(low, dtype=float), np.array(high, dtype=float)

        def node(place):
            if place not in known:
                x = low + (high - low) * np.array(place) / (2 * np.array(counts))
                known[place] = f"N{len(self.nodes) + 1}"
                self.nodes.append((known[place], x))
            return known[place]

        cell, facet = KINDS[dim, self.degree]
        pattern = (SQUARE, CUBE)[dim - 2][: {"QUAD4": 4, "QUAD8": 8, "HEXA8": 8, "HEXA20": 20}[cell]]
        side = ([(0,), (2,), (1,)], SQUARE)[dim - 2][: {"SEG2": 2, "SEG3": 3, "QUAD4": 4, "QUAD8": 8}[facet]]
        for at in itertools.product(*map(range, counts)):
            places = [tuple(2 * a + p for a, p in zip(at, local, strict=True)) for local in pattern]
            self._element(cell, [node(place) for place in places], name)
            for axis, end in itertools.product(range(dim), (0, 1)):
                if at[axis] == (counts[axis] - 1) * end:
                    on_side = []
                    for local in side:
                        place = [2 * a + p for a, p in zip(at, [*local[:axis], 2 * end, *local[axis:]], strict=True)]
                        on_side.append(node(tuple(place)))
                    self._element(facet, on_side, f"{name}_{'xyz'[axis]}{end}")
        corner = tuple(2 * count for count in counts)
        self.node_groups[f"{name}_CORNER"] = [known[corner]]

    @property
    def text(self):
        lines = ["TITRE", "two blocks", "FINSF", f"COOR_{self.dim}D"]
        lines += [f"{name} {' '.join(f'{value:.17g}' for value in x)}" for name, x in self.nodes]
        for kind, rows in self.cells.items():
            lines += ["FINSF", kind, *(f"{name} {' '.join(nodes)}" for name, nodes in rows)]
        for word, groups in (("GROUP_MA", self.groups), ("GROUP_NO", self.node_groups)):
            for name, members in groups.items():
                lines += ["FINSF", word, name, *members]
        return "\n".join([*lines, "FINSF", "FIN"]) + "\n"


def two_blocks(model, degree=1, columns=(2, 3)):
    """Unit blocks that do not match, as the text of a mesh."""
    dim = 3 if model == "3D" else 2
    mail = Mail(dim, degree)
    for name, count, height in (("LOW", columns[0], 0.0), ("UP", columns[1], 1.0)):
        low = [0.0] * (dim - 1) + [height]
        mail.block(name, [count] * (dim - 1) + [1], low, [1.0] * (dim - 1) + [height + 1.0])
    return mail.text


COMMANDS = """
DEBUT()
MESH = LIRE_MAILLAGE(FORMAT="ASTER")
MODEL = AFFE_MODELE(MAILLAGE=MESH, AFFE=_F(TOUT="OUI", PHENOMENE="MECANIQUE", MODELISATION="{model}"))
MAT = DEFI_MATERIAU(ELAS=_F(E=1000.0, NU=0.25))
FIELD = AFFE_MATERIAU(MAILLAGE=MESH, AFFE=_F(TOUT="OUI", MATER=MAT))
HELD = AFFE_CHAR_MECA(MODELE=MODEL, DDL_IMPO=({held}))
LOAD = AFFE_CHAR_MECA(MODELE=MODEL, PRES_REP=_F(GROUP_MA="UP_{up}1", PRES=8.0))
CONT = DEFI_CONTACT(
    MODELE=MODEL,
    FORMULATION="CONTINUE",
    {contact}ZONE=_F(GROUP_MA_MAIT="LOW_{up}1", GROUP_MA_ESCL="UP_{up}0"{zone}),
)
RAMP = DEFI_FONCTION(NOM_PARA="INST", VALE=(0.0, 0.0, 2.0, 2.0))
TIMES = DEFI_LIST_REEL(DEBUT=0.0, INTERVALLE=_F(JUSQU_A=2.0, NOMBRE=2))
RES = STAT_NON_LINE(
    MODELE=MODEL,
    CHAM_MATER=FIELD,
    EXCIT=(_F(CHARGE=HELD), _F(CHARGE=LOAD, FONC_MULT=RAMP)),
    CONTACT=CONT,
    COMPORTEMENT=_F(RELATION="ELAS"),
    INCREMENT=_F(LIST_INST=TIMES),
)
"""


def commands(model, contact="", zone="", tests=""):
    """The two blocks pressed together by 8 and then 16, free to widen."""
    up = "z" if model == "3D" else "y"
    axes = "xyz"[: 3 if model == "3D" else 2]
    held = [f'_F(GROUP_MA="LOW_{axis}0", D{axis.upper()}=0.0)' for axis in axes]
    held += [f'_F(GROUP_MA="UP_{axis}0", D{axis.upper()}=0.0)' for axis in axes[:-1]]
    text = COMMANDS.format(model=model, up=up, held=", ".join(held) + ",", contact=contact, zone=zone)
    return f"{text}{tests}FIN()\n"


def values_text(values, at="UP_CORNER", field="DEPL", **more):
    """The text of a TEST_RESU at the last instant."""
    words = "".join(f", {key}={value!r}" for key, value in more.items())
    where = f'RESULTAT=RES, INST=2.0, NOM_CHAM="{field}", GROUP_NO="{at}"'
    entries = "".join(f'_F({where}, NOM_CMP="{name}", VALE_CALC={value!r}{words}),' for name, value in values.items())
    return f"TEST_RESU(RESU=({entries}))\n"


def write_case(folder, text, mail, name="case"):
    """Both files."""
    file = folder / f"{name}.comm"
    file.write_text(text)
    file.with_suffix(".mail").write_text(mail)
    return file


def top(model, pressure=16.0, young=1000.0, poisson=0.25):
    """How far the top of two unit blocks goes down under a pressure, free to widen."""
    return -2.0 * pressure / young * (1 - poisson**2 if model == "D_PLAN" else 1.0)
