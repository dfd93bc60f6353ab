"""What ``check`` says of the length of facets in contact: an eighth of Hertz's half width, which is known here."""

import re
import tomllib
from math import cbrt, pi, sqrt

import pytest
from mpi4py import MPI

from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene

YOUNG, POISSON, RADIUS = 200.0, 0.3, 8.0
PLANE = YOUNG / (1 - POISSON**2)
MATERIAL = f"[[material]]\nyoung = {YOUNG}\npoisson = {POISSON}\n"


def sizes_said(text):
    """The numbers that can be pasted, by the place of their findings."""
    findings = check_scene(parse_scene(tomllib.loads(text)), MPI.COMM_SELF).findings
    found = {one.path: re.match(r"contact_size = (\S+) would", one.message) for one in findings}
    return {path: float(match[1]) for path, match in found.items() if match}


def disk(*, symmetric=False, load=0.4, size=1.0, unit=1.0, more="", hypothesis="plane strain", own=""):
    """Half a disk on a plane with this pressure on its top, whose cells are of one size."""
    held = '[[displacement]]\nboundary = "symmetry"\nx = 0.0\n' * symmetric
    return (
        f'[mesh]\ngenerator = "half_disk"\n{own}parameters = {{ radius = {RADIUS * unit}, size = {size * unit}, '
        f"contact_size = {size * unit}, symmetric = {str(symmetric).lower()} }}\n{MATERIAL}"
        f'hypothesis = "{hypothesis}"\n[[contact]]\nboundary = "arc"\ngap = "x[1]"\ndirection = [0.0, -1.0]\n'
        + held
        + (f'[[traction]]\nboundary = "top"\npressure = {load}\n' if load else "")
        + more
    )


@pytest.mark.parametrize("unit", [1.0, 1e-3])
@pytest.mark.parametrize("symmetric", [False, True])
@pytest.mark.parametrize(("hypothesis", "modulus"), [("plane strain", PLANE), ("plane stress", YOUNG)])
def test_half_a_disk_on_a_plane(symmetric, unit, hypothesis, modulus):
    width = sqrt(4 * 0.4 * 2 * RADIUS * RADIUS / (pi * modulus)) * unit
    (size,) = sizes_said(disk(symmetric=symmetric, unit=unit, hypothesis=hypothesis)).values()
    assert size == pytest.approx(width / 8, rel=0.06)


@pytest.mark.parametrize("part", ["whole", "half", "quarter"])
@pytest.mark.parametrize("against", ["gap", "sphere"])
def test_a_sphere_in_space(part, against):
    """On a plane, and on a sphere of half the radius."""
    held = {"whole": "", "half": "y", "quarter": "xy"}[part]
    supports = "".join(f'[[displacement]]\nboundary = "symmetry_{axis}"\n{axis} = 0.0\n' for axis in held)
    foundation = 'gap = "x[2]"\ndirection = [0.0, 0.0, -1.0]\n'
    if against == "sphere":
        foundation = 'foundation = { shape = "sphere", centre = [0.0, 0.0, -4.0], radius = 4.0 }\n'
    text = (
        f'[mesh]\ngenerator = "half_sphere"\nparameters = {{ radius = {RADIUS}, size = 1.6, contact_size = 1.6, '
        f'part = "{part}" }}\n{MATERIAL}{supports}[[contact]]\nboundary = "sphere"\n{foundation}'
        '[[traction]]\nboundary = "top"\npressure = 1.0\n'
    )
    (size,) = sizes_said(text).values()
    radius = RADIUS if against == "gap" else 1 / (1 / RADIUS + 1 / 4.0)
    assert size == pytest.approx(cbrt(3 * pi * RADIUS**2 * radius / (4 * PLANE)) / 8, rel=0.2)


def cylinders(tmp_path, lower):
    """Half a disk in or on another body, with its load on the top."""
    round_side, bottom, sign = {"disk": ("upper", -12, 1), "seat": ("upper", -20, -1)}[lower]
    script = tmp_path / "two.geo"
    script.write_text(
        f"""
Point(1) = {{0, 0, 0, 1}}; Point(2) = {{-8, 8, 0, 1}}; Point(3) = {{8, 8, 0, 1}}; Point(4) = {{0, 8, 0, 1}};
Circle(1) = {{2, 4, 1}}; Circle(2) = {{1, 4, 3}}; Line(3) = {{3, 2}};
Curve Loop(1) = {{1, 2, 3}}; Plane Surface(1) = {{1}};
Point(11) = {{0, 0, 0, 1}}; Point(14) = {{0, {-12 * sign}, 0, 1}};
Point(12) = {{-12, {-12 * sign}, 0, 1}}; Point(13) = {{12, {-12 * sign}, 0, 1}};
Circle(11) = {{13, 14, 11}}; Circle(12) = {{11, 14, 12}};
Point(15) = {{-12, {bottom}, 0, 1}}; Point(16) = {{12, {bottom}, 0, 1}};
"""
        + (
            "Line(13) = {12, 13}; Curve Loop(11) = {11, 12, 13};\n"
            if lower == "disk"
            else "Line(13) = {15, 16}; Line(14) = {12, 15}; Line(15) = {16, 13};\n"
            "Curve Loop(11) = {11, 12, 14, 13, 15};\n"
        )
        + """Plane Surface(11) = {11};
Physical Curve("upper") = {1, 2}; Physical Curve("top") = {3};
Physical Curve("lower") = {11, 12}; Physical Curve("bottom") = {13};
Physical Surface("soft") = {1}; Physical Surface("stiff") = {11};
"""
    )
    return (
        f'[mesh]\nfile = "{script}"\n{MATERIAL}region = "soft"\n[[material]]\nregion = "stiff"\nyoung = 600.0\n'
        f'poisson = 0.2\n[[displacement]]\nboundary = "bottom"\nx = 0.0\ny = 0.0\n[[traction]]\nboundary = "top"\n'
        f'pressure = 0.4\n[[contact]]\nboundary = "{round_side}"\nagainst = "lower"\n'
    )


@pytest.mark.parametrize("lower", ["disk", "seat"])
def test_two_cylinders(tmp_path, lower):
    """One on the other, and one in a round seat."""
    (size,) = sizes_said(cylinders(tmp_path, lower)).values()
    radius = 1 / (1 / RADIUS + (1 if lower == "disk" else -1) / 12.0)
    modulus = 1 / (1 / PLANE + (1 - 0.2**2) / 600.0)
    width = sqrt(4 * 0.4 * 2 * RADIUS * radius / (pi * modulus))
    assert size == pytest.approx(width / 8, rel=0.1)


def test_nothing_is_said_of_flat_contact():
    text = (
        f'[mesh]\ngenerator = "rectangle"\n{MATERIAL}[[contact]]\nboundary = "bottom"\n[[traction]]\nboundary = "top"\n'
        "pressure = 1.0\n"
    )
    assert not sizes_said(text)
