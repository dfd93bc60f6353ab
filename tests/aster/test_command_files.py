"""Command files of code_aster: what of their Python is evaluated, and that nothing of it is executed."""

import pytest

from signorini_fx.addons.aster.command_file import depends_on, read_commands, value_at
from signorini_fx.addons.aster.values import AsterCommand, CommandError, Unknown
from signorini_fx.errors import MeshError


def commands(tmp_path, text):
    """Of a text."""
    file = tmp_path / "case.comm"
    file.write_text(text)
    return read_commands(file)


def number_of(tmp_path, term, before=""):
    """The value that a keyword has."""
    (command,) = commands(tmp_path, f"{before}\nX = DEFI_CONSTANTE(VALE={term})\n").named("DEFI_CONSTANTE")
    return command.keywords["VALE"]


@pytest.mark.parametrize(
    ("term", "before", "value"),
    [
        ("2.0 * E / (1 + NU)", "E = 3.0\nNU = 0.5", 4.0),
        ("math.sqrt(2.25) - pi + pi", "import math", 1.5),
        ("-2 ** 2", "", -4.0),
        ("lame(3.0, 0.25)", "def lame(E, NU):\n    twice = 2 * (1 + NU)\n    return E / twice", 1.2),
        ("square(3)", "square = lambda x: x * x", 9),
        ("VALUES[1][0]", "VALUES = [[1, 2], [3, 4]]", 3),
        ("a", "a, b = 5, 6", 5),
        ("total", "total = 0\nfor k in range(4):\n    total += k", 6),
        ("x if x > 2 else y", "x, y = 1, 7", 7),
        ("7 if chosen else 8", "chosen = 1 < 2 and not False", 7),
        ("data['E']", "data = dict\ndata = {'E': 9.0}", 9.0),
        ("[2 * k for k in (1, 2)][1]", "", 4),
        ("listed[-1]", "listed = [1] * 3\nlisted.append(8)", 8),
        ("'%d' % 3 == '3'", "", True),
    ],
)
def test_terms(tmp_path, term, before, value):
    """Arithmetic, lists, conditions, loops and functions of these."""
    assert number_of(tmp_path, term, before) == value


@pytest.mark.parametrize(
    "term",
    [
        "open('written', 'w')",
        "'%1000000000d' % 3",
        "'%(a)*d' % {'a': 3}",
        "__import__('os').getpid()",
        "().__class__.__bases__",
        "(lambda: exec('x = 1'))()",
        "eval('1')",
        "unheard_of + 1",
        "1 / 0",
        "'a' * 10 ** 9",
        "[0] * 10 ** 9",
        "9 ** 9 ** 9",
        "range(10 ** 9)",
        "f(0)",
    ],
)
def test_what_is_not_evaluated(tmp_path, term, monkeypatch):
    """It is not known, which is an error where it is needed, with its line; nothing is written, and nothing hangs."""
    monkeypatch.chdir(tmp_path)
    value = number_of(tmp_path, term, "def f(x):\n    return f(x + 1)")
    assert isinstance(value, Unknown)
    with pytest.raises(CommandError, match="VALE"):
        AsterCommand("DEFI_CONSTANTE", {"VALE": value}, 3).get("VALE")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case.comm"]


def test_a_loop_without_end(tmp_path):
    """Terms are counted."""
    nested = "".join(f"{'    ' * k}for a{k} in range(9999):\n" for k in range(3)) + "            x = 1\n"
    with pytest.raises(MeshError, match=r"case\.comm: line \d: more than 2000000 terms: a loop without end\?"):
        commands(tmp_path, nested)


@pytest.mark.parametrize(
    ("text", "line"),
    [("A = (1,\nB = 2\n", 1), ("X = LIRE_MAILLAGE(\n\n", 1), ("def f(:\n    pass\n", 1), ("a\n  b\n", 2)],
)
def test_what_is_no_command_file(tmp_path, text, line):
    """An error with its line."""
    with pytest.raises(MeshError, match=rf"case\.comm: line {line}: this is no command file"):
        commands(tmp_path, text)


def test_commands_and_what_they_make(tmp_path):
    """One result is changed by a later command; another one of the same name is another result."""
    found = commands(
        tmp_path,
        "R = [None] * 2\n"
        "for k in range(2):\n"
        "    M = LIRE_MAILLAGE(UNITE=20 + k, **{'FORMAT': 'MED'})\n"
        "    M = DEFI_GROUP(reuse=M, MAILLAGE=M, CREA_GROUP_NO=(_F(NOM='A', NOEUD='N1'), _F(NOM='B')))\n"
        "    R[k] = STAT_NON_LINE(MODELE=M)\n"
        "IMPR_RESU(RESU=_F(RESULTAT=R[1]))\n",
    )
    assert [command.name for command in found.commands].count("DEFI_GROUP") == 2
    meshes = [concept for concept in found.concepts if concept.made_by.name == "LIRE_MAILLAGE"]
    assert [[command.name for command in mesh.commands] for mesh in meshes] == [["LIRE_MAILLAGE", "DEFI_GROUP"]] * 2
    assert [mesh.made_by.get("UNITE") for mesh in meshes] == [20, 21]
    results = [concept for concept in found.concepts if concept.made_by.name == "STAT_NON_LINE"]
    assert results[1].made_by.get("MODELE") is meshes[1]
    (printed,) = found.named("IMPR_RESU")
    assert printed.factors("RESU")[0]["RESULTAT"] is results[1]
    assert [entry["NOM"] for entry in meshes[0].commands[1].factors("CREA_GROUP_NO")] == ["A", "B"]


def test_what_depends_on_what_is_not_evaluated(tmp_path):
    """Statements that are left out are listed with the commands in them, and what they would assign is not known."""
    found = commands(
        tmp_path,
        "try:\n    M = LIRE_MAILLAGE()\nexcept Exception:\n    pass\n"
        "try:\n    M = DEFI_GROUP(reuse=M)\nexcept Exception:\n    pass\n"
        "if rank() > 0:\n    E = 1.0\n"
        "X = DEFI_CONSTANTE(VALE=E)\n",
    )
    assert [(line, why.rpartition("in it: ")[2]) for line, why in found.unread] == [
        (1, "no command"),  # what it makes is not known, and what needs that is refused
        (5, "DEFI_GROUP"),  # but this changes something
        (9, "no command"),
    ]
    (command,) = found.commands
    with pytest.raises(CommandError, match="line 9"):
        command.get("VALE")


FUNCTIONS = """
def twice(x):
    return 2 * x
A = 3.0
F = DEFI_FONCTION(NOM_PARA="INST", VALE=(0.0, 0.0, 1.0, 2.0, 3.0, 0.0){more})
G = FORMULE(NOM_PARA=("X", "INST"), VALE="twice(X) + A *\\n INST", twice=twice, A=A)
C = DEFI_CONSTANTE(VALE=5.0)
USED = TEST(F=F, G=G, C=C)
"""


@pytest.mark.parametrize(
    ("more", "time", "value"),
    [
        ("", 0.5, 1.0),
        ("", 2.0, 1.0),
        (", PROL_DROITE='LINEAIRE'", 4.0, -1.0),
        (", PROL_DROITE='CONSTANT'", 4.0, 0.0),
        (", PROL_GAUCHE='LINEAIRE'", -1.0, -2.0),
    ],
)
def test_functions(tmp_path, more, time, value):
    """Of the instant and of the position; beyond the last point as they say."""
    (command,) = commands(tmp_path, FUNCTIONS.replace("{more}", more)).named("TEST")
    parameters = {"X": 10.0, "Y": 0.0, "Z": 0.0, "INST": time}
    assert value_at(command.get("F"), parameters, command, "F") == pytest.approx(value)
    assert value_at(command.get("G"), parameters, command, "G") == pytest.approx(20.0 + 3.0 * time)
    assert value_at(command.get("C"), parameters, command, "C") == 5.0
    assert (depends_on(command.get("F")), depends_on(command.get("G"))) == ({"INST"}, {"X", "INST"})
    assert depends_on(7.0) == set()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("F = DEFI_FONCTION(NOM_PARA='INST', VALE=(0.0, 0.0, 1.0))", "pairs of numbers"),
        ("F = DEFI_FONCTION(NOM_PARA='INST', VALE=(0.0, 0.0, 1.0, 1.0))", "it has no value at 9"),
        ("F = DEFI_FONCTION(NOM_PARA='INST', VALE=(1.0, 0.0, 0.0, 1.0))", "abscissas must increase"),
        ("F = DEFI_FONCTION(NOM_PARA='TEMP', VALE=(0.0, 0.0, 9.0, 1.0))", "a function of TEMP"),
        ("F = DEFI_FONCTION(NOM_PARA='INST', VALE=(1.0, 0.0, 9.0, 1.0), INTERPOL='LOG')", "only LIN"),
        ("F = FORMULE(NOM_PARA='INST', VALE='INST +')", "is no term"),
        ("F = FORMULE(NOM_PARA='INST', VALE='INST + b')", "'b' is not defined"),
        ("F = CALC_FONCTION(COMB=1)", "no function that is known"),
    ],
)
def test_functions_without_value(tmp_path, text, why):
    """An error that names the command that defines them, and its line."""
    (command,) = commands(tmp_path, f"\n{text}\nX = TEST(F=F)\n").named("TEST")
    with pytest.raises(CommandError, match=why) as raised:
        value_at(command.get("F"), {"INST": 9.0}, command, "F")
    assert raised.value.text.startswith("line 2, ")
