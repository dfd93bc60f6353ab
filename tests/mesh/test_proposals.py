"""Contacts that are found: which surfaces of several bodies touch or nearly do, as entries of a
scene.
"""

import base64
import json
import re
import tomllib
from pathlib import Path

import gmsh
import numpy as np
import pytest
from commands import run
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed, rectangle_mesh

from signorini_fx import SceneError, propose_contacts, solve
from signorini_fx.mechanics.mesh.files.formats import read_file
from signorini_fx.mechanics.mesh.files.gmsh_reader import gmsh_session
from signorini_fx.mechanics.mesh.proposals import proposed_contacts
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene, read_scene

TWO_PI = 2 * np.pi


def cylinder(x, y, z, height, radius):
    """A cylinder along z."""
    return 3, gmsh.model.occ.addCylinder(x, y, z, 0, 0, height, radius)


def box(x, y, z, *edges):
    """A box from its least corner."""
    return 3, gmsh.model.occ.addBox(x, y, z, *edges)


def without(body, *others):
    """A body without others."""
    return gmsh.model.occ.cut([body], others)[0][0]


def joint():
    """Two plates, a bolt with clearance 0.5, and its nut."""
    without(box(-20, -20, 0, 40, 40, 10), cylinder(0, 0, -1, 12, 5.5))
    without(box(-20, -20, 10, 40, 40, 10), cylinder(0, 0, 9, 12, 5.5))
    gmsh.model.occ.fuse([cylinder(0, 0, -10, 35, 5)], [cylinder(0, 0, 20, 7, 9)])
    without(cylinder(0, 0, -8, 8, 9), cylinder(0, 0, -9, 10, 5))


def lug():
    """A lug and two cheeks on a pin with clearances 0.1 and 0.2, the cheeks 0.3 from the lug."""
    without(box(-10, -20, -5, 20, 40, 10), cylinder(0, 0, -6, 12, 6.1))
    without(box(-10, -20, -15.3, 20, 40, 10), cylinder(0, 0, -16, 12, 6.2))
    without(box(-10, -20, 5.3, 20, 40, 10), cylinder(0, 0, 4, 12, 6.2))
    cylinder(0, 0, -18, 36, 6)


def shaft():
    """A shaft with a collar in a hub, which it overlaps by 0.03."""
    gmsh.model.occ.fuse([cylinder(0, 0, -20, 80, 10)], [cylinder(0, 0, -10, 10, 16)])
    without(cylinder(0, 0, 0, 30, 25), cylinder(0, 0, -1, 32, 9.97))


def stack():
    """Five plates from 0.5 to 2 thick, each a little aside of the one below."""
    height = 0.0
    for number, thickness in enumerate((2.0, 0.5, 1.0, 0.5, 2.0)):
        box(-10 + number, -10, height, 20, 20, thickness)
        height += thickness


def bearing():
    """Two rings with eight rollers between them, which nearly touch both along lines."""
    without(cylinder(0, 0, 0, 10, 30), cylinder(0, 0, -1, 12, 25.01))
    without(cylinder(0, 0, 0, 10, 16.99), cylinder(0, 0, -1, 12, 12))
    for angle in np.linspace(0, TWO_PI, 9)[:-1]:
        cylinder(21 * np.cos(angle), 21 * np.sin(angle), 0, 10, 4)


def hinge():
    """Three knuckles of two leaves on a pin that fits."""
    leaf = box(0, -2, 0, 30, 4, 10), cylinder(0, 0, 0, 10, 5)
    body = gmsh.model.occ.fuse([leaf[0]], [leaf[1]])[0][0]
    without(body, cylinder(0, 0, -1, 12, 3))
    parts = [box(-30, -2, z, 30, 4, 10) for z in (-10, 10)]
    parts += [cylinder(0, 0, z, 10, 5) for z in (-10, 10)]
    parts.append(box(-34, -2, -10, 4, 4, 30))
    body = gmsh.model.occ.fuse(parts[:1], parts[1:])[0][0]
    without(body, cylinder(0, 0, -11, 32, 3))
    cylinder(0, 0, -10, 30, 3)


def bracket():
    """An angle on a plate, held by two screws that sit in the plate."""
    angle = gmsh.model.occ.fuse([box(0, 0, 0, 40, 60, 5)], [box(0, 0, 0, 5, 60, 40)])[0][0]
    places = (25, 15), (25, 45)
    without(angle, *(cylinder(x, y, -1, 7, 4.2) for x, y in places))
    without(box(-10, -10, -15, 60, 80, 15), *(cylinder(x, y, -10, 11, 4) for x, y in places))
    for x, y in places:
        gmsh.model.occ.fuse([cylinder(x, y, -10, 15, 4)], [cylinder(x, y, 5, 4, 7)])


def ring():
    """A disc in a ring whose bore, as the disc, is made of two halves."""
    for radii in ((2.0,), (4.0, 2.0)):
        loops = []
        for radius in radii:
            arcs = [
                gmsh.model.occ.addCircle(0, 0, 0, radius, angle1=a, angle2=a + np.pi)
                for a in (0.0, np.pi)
            ]
            loops.append(gmsh.model.occ.addCurveLoop(arcs))
        gmsh.model.occ.addPlaneSurface(loops)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A function that draws an assembly into a file of OpenCASCADE."""
    folder = tmp_path_factory.mktemp("drawings")

    def draw(assembly):
        file = folder / f"{assembly.__name__}.brep"
        if not file.exists():
            with gmsh_session("drawing") as session:
                assembly()
                session.model.occ.synchronize()
                session.write(str(file))
        return file

    return draw


# For each assembly two lengths of cells, and the pairs wanted: kind, gap, and how many there are.
WANTED = {
    joint: ((4, 2), {("touches", 0.0): 4, ("clearance", 0.5): 2}),
    lug: ((4, 2), {("clearance", 0.1): 1, ("clearance", 0.2): 2, ("clearance", 0.3): 2}),
    shaft: ((8, 4), {("overlap", -0.03): 1, ("touches", 0.0): 1}),
    stack: ((4, 2), {("touches", 0.0): 4}),
    bearing: ((4, 2), {("touches", 0.0): 16}),
    hinge: ((4, 2), {("touches", 0.0): 5}),
    bracket: ((6, 3), {("touches", 0.0): 7, ("clearance", 0.2): 2}),
    ring: ((1.0, 0.5), {("touches", 0.0): 1}),
}


@pytest.mark.parametrize("assembly", WANTED, ids=lambda assembly: assembly.__name__)
@pytest.mark.parametrize("fine", [0, 1], ids=["coarse", "fine"])
def test_pairs_of_an_assembly(drawn, assembly, fine):
    """All wanted pairs are found and no other one; their gaps are right within a twentieth of
    what facets leave their arcs by, those of surfaces that diverge within all of it.
    """
    sizes, wanted = WANTED[assembly]
    found = proposed_contacts(read_file(MeshFile(file=drawn(assembly), size=sizes[fine])))
    left = dict(wanted)
    for contact in found.contacts:
        gap = min(
            (gap for kind, gap in wanted if kind == contact.kind),
            key=lambda gap: abs(gap - contact.gap),
            default=np.inf,
        )
        within = contact.sagitta / 20 if contact.fitted else contact.sagitta
        assert contact.gap == pytest.approx(gap, abs=1e-9 + within), contact
        left[contact.kind, gap] -= 1
        assert contact.shared == (assembly is bearing)  # of a roller and a ring both meet several
    assert not any(left.values()), (left, [(c.name, c.kind, c.gap) for c in found.contacts])
    assert found.unnamed == ()


def filled_in(text):
    """A scene of a drawing with a material, supports and loads: the outer rim is held."""
    text = text.replace("young = 0.0", "young = 210000.0")
    text = text.replace('boundary = "", x', 'boundary = "boundary_3", x')
    return text.replace('boundary = "", pressure = 0.0', 'boundary = "boundary_4", x = 1.0')


def test_from_a_drawing_to_a_scene(capsys, tmp_path, monkeypatch, drawn):
    """``new`` writes a scene, a picture of the boundaries beside it, and nothing over a file; what
    it lacks is named; both halves of the bore are one side of the contact.
    """
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, "new", drawn(ring), "--size", "1.0")
    assert (code, err) == (0, ""), err
    assert "ring.toml is a scene" in out
    assert (tmp_path / "ring.png").stat().st_size > 10_000
    text = (tmp_path / "ring.toml").read_text()
    assert len(text.splitlines()) <= 20
    assert run(capsys, "check", "ring.toml")[2].count("material.young: must be greater than 0")
    file = tmp_path / "young.toml"
    file.write_text(text.replace("young = 0.0", "young = 1.0"))
    code, _, err = run(capsys, "check", file)
    assert code == 2
    for path in ("displacement[0].boundary", "traction[0].boundary"):
        assert path in err
    run(capsys, "contacts", drawn(ring), "--size", "1.0", "--into", "ring.toml")
    assert (tmp_path / "ring.toml").read_text() == text
    file = tmp_path / "filled.toml"
    file.write_text(filled_in(text))
    scene = read_scene(file)
    (contact,) = scene.contact
    assert (contact.distance, contact.gap) == ("nominal", 0.0)
    assert {contact.boundary, contact.against} == {
        "region_1_region_2_on_region_1",
        "region_1_region_2_on_region_2",
    }
    assert not [f for f in check_scene(scene, MPI.COMM_SELF).findings if f.path == "contact"]
    again = run(capsys, "new", drawn(ring))
    assert again[0] == 2
    assert "ring.toml: already exists" in again[2]
    (tmp_path / "sub").mkdir()
    assert run(capsys, "new", drawn(ring), "--size", "1.0", "-o", "sub/other.toml")[0] == 0
    assert {path.name for path in Path("sub").iterdir()} >= {"other.toml", "other.png"}
    file = Path("sub/filled.toml")
    file.write_text(filled_in(Path("sub/other.toml").read_text()))
    assert read_scene(file).mesh.file.samefile(drawn(ring))


def test_entries_are_found_anew(capsys, tmp_path, drawn):
    """A second search changes nothing; what the user has written himself stays and is not repeated;
    an entry that was found before and is no longer near goes.
    """
    code, out, err = run(capsys, "contacts", drawn(lug), "--size", "4", "--within", "0.5")
    assert (code, err) == (0, "")
    assert len(tomllib.loads(out)["contact"]) == 5
    own = (
        f'mesh = {{ file = "{drawn(lug)}", size = 4 }}\n'
        "material = { young = 1.0, poisson = 0.3 }\n\n"
        '[[contact]]\nboundary = "boundary_14"\nagainst = "boundary_22"\nkind = "bonded"\n'
    )
    file = tmp_path / "lug.toml"
    file.write_text(own)
    arguments = ("contacts", drawn(lug), "--size", "4", "--into", file)
    code, out, err = run(capsys, *arguments, "--within", "0.5")
    assert (code, err) == (0, ""), err
    assert f"they are in {file}" in out
    text = file.read_text()
    entries = tomllib.loads(text)["contact"]
    sides = [frozenset((entry["boundary"], entry["against"])) for entry in entries]
    assert (len(entries), len(set(sides)), entries[0]["kind"]) == (5, 5, "bonded")
    gaps = sorted(entry["gap"] for entry in entries if "distance" in entry)
    assert gaps == pytest.approx([0.1, 0.2], rel=0.03)
    run(capsys, *arguments, "--within", "0.5")
    assert file.read_text() == text
    run(capsys, *arguments, "--within", "0.25")  # the cheeks are 0.3 from the lug
    assert len(tomllib.loads(file.read_text())["contact"]) == 3
    assert file.read_text().startswith(own.rstrip())


def test_surfaces_without_contact_are_named(tmp_path, drawn):
    """``check`` warns of surfaces that touch and that no contact names, under whatever name."""
    file = tmp_path / "stack.toml"
    scene = (
        f'mesh = {{ file = "{drawn(stack)}", size = 4, '
        'boundaries = { roof = "abs(x[2] - 2.0) < 1e-9", floor = "abs(x[2]) < 1e-9" } }\n'
        "material = { young = 1.0, poisson = 0.3 }\n"
        'displacement = { boundary = "floor", x = 0.0, y = 0.0, z = 0.0 }\n'
        'contact = { boundary = "roof", against = "boundary_11" }\n'
    )
    file.write_text(
        scene.replace('"roof", against = "boundary_11"', '"boundary_6", against = "boundary_11"')
    )
    found = [
        f for f in check_scene(read_scene(file), MPI.COMM_SELF).findings if f.path == "contact"
    ]
    assert [finding.level for finding in found] == ["warning"] * 3
    said = "boundary_17 of region_3 and boundary_12 of region_2 touch"
    assert any(said in finding.message for finding in found)


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        ("contact = { boundary = 'a' }\n", "contact: is an inline table"),
        ("title = ", "is not a TOML file"),
        (
            "",
            "mesh.boundaries: add these names, which the contacts need: region_1_region_2_on_region_",
        ),
    ],
)
def test_a_scene_that_contacts_cannot_be_put_into(capsys, tmp_path, drawn, scene, message):
    """It is left as it is, and the error names what to do."""
    file = tmp_path / "scene.toml"
    file.write_text(scene)
    code, out, err = run(capsys, "contacts", drawn(ring), "--size", "1", "--into", file)
    assert (code, out) == (2, "")
    assert message in err
    assert file.read_text() == scene


def test_one_body_has_no_contacts(capsys, tmp_path):
    """The error says so, and names the file once."""
    file = tmp_path / "one.geo"
    file.write_text('SetFactory("OpenCASCADE");\nRectangle(1) = {0, 0, 0, 1, 1};\n')
    code, _, err = run(capsys, "contacts", file)
    assert code == 2
    assert err.count("one.geo") == 1
    assert "the mesh is one body" in err
    assert run(capsys, "contacts", tmp_path / "none.msh")[2].count("none.msh: no such file") == 1


def hub():
    """A shaft that is 0.004 larger than its bore."""
    occ = gmsh.model.occ
    shaft = occ.addCylinder(0.0, 0.0, 0.0, 1.0, 2.0, 8.0, 5.002)
    outer = occ.addCylinder(0.0, 0.0, 0.0, 1.0, 2.0, 8.0, 9.0)
    bore = occ.addCylinder(0.0, 0.0, 0.0, 1.0, 2.0, 8.0, 5.0)
    occ.cut([(3, outer)], [(3, bore)])
    return shaft


def test_a_fit_is_that_of_the_surfaces(drawn):
    """Facets leave the arcs by a hundred times its interference."""
    (contact,) = proposed_contacts(read_file(MeshFile(file=drawn(hub), size=3.0))).contacts
    assert contact.sagitta > 0.1
    assert (contact.kind, contact.gap) == ("overlap", pytest.approx(-0.002, rel=1e-5))


def test_the_page_of_a_drawing_names_its_boundaries(capsys, tmp_path, monkeypatch, drawn):
    """Each corner of the surface has the name of the boundary on which it is; the picture has their
    numbers.
    """
    monkeypatch.chdir(tmp_path)
    assert run(capsys, "new", drawn(hub), "--size", "3")[0] == 0
    page = (tmp_path / "hub.html").read_text(encoding="utf-8")
    body = json.loads(re.search(r'class="data">(.*?)</script>', page)[1])
    mesh = read_file(MeshFile(file=drawn(hub), size=3.0))
    points = np.frombuffer(base64.b64decode(body["points"]), dtype=np.float32).reshape(-1, 3)
    assert body["names"] == ["no name", *mesh.boundaries]
    for number, rows in enumerate(mesh.boundaries.values(), start=1):
        own = mesh.points[np.unique(mesh.facet_corners[rows])]
        found = points[np.array(body["faces"]) == number]
        np.testing.assert_allclose(
            found[np.lexsort(np.round(found, 3).T)], own[np.lexsort(np.round(own, 3).T)], atol=1e-4
        )


def test_names_that_toml_has_to_quote(capsys, tmp_path, monkeypatch, drawn):
    """A file name with a quotation mark is one word of the scene."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / 'a "b".brep'
    file.write_bytes(drawn(ring).read_bytes())
    assert run(capsys, "new", file, "--size", "1")[0] == 0
    scene = tomllib.loads((tmp_path / 'a "b".toml').read_text())
    assert (scene["title"], scene["mesh"]["file"]) == ('a "b"', 'a "b".brep')


def tower(**changed):
    """Three blocks on each other, with a load on the last one, as plain data of a scene."""

    def block(name, height):
        mesh = rectangle_mesh(6, 4)
        return {"name": name, "mesh": mesh, "shift": [0.0, height]}

    return {
        "body": [block("low", 0.0), block("middle", 1.0), block("high", 2.0)],
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": [fixed("low.bottom")],
        "traction": [{"boundary": "high.top", "y": -1.0}, {"boundary": "middle.right", "x": -0.1}],
        "general_contact": {"friction": coulomb_friction(0.3)},
    } | changed


@pytest.mark.mpi
def test_general_contact_makes_entries():
    """They are those that a user would state, with one friction law, and entries of the user come
    first.
    """
    comm = MPI.COMM_WORLD
    found = solve(parse_scene(tower()), comm)
    entries = found.statement.contact
    sides = {frozenset((entry.boundary, entry.against)) for entry in entries}
    assert sides == {
        frozenset(("low.top", "middle.bottom")),
        frozenset(("middle.top", "high.bottom")),
    }
    assert {entry.friction.coefficient for entry in entries} == {0.3}
    part = found.contact.boundary.part
    forces = (found.contact.boundary.weight * found.contact.pressure)[part == 1].sum()
    assert comm.allreduce(forces) == pytest.approx(3.0, rel=1e-6)
    smooth = {"boundary": "middle.top", "against": "high.bottom", "kind": "bonded"}
    stated = solve(parse_scene(tower(contact=smooth)), comm).statement.contact
    assert [entry.kind for entry in stated] == ["bonded", "unilateral"]


def test_general_contact_of_some_bodies():
    acts = check_scene(
        parse_scene(
            tower(
                general_contact={"without": [["low", "middle"]], "kind": "bonded"},
                displacement=[fixed("low.bottom"), fixed("middle.left")],
            )
        ),
        MPI.COMM_SELF,
    ).acts
    assert [line for line in acts if line.startswith("contact")] == [
        "contact middle.top (bonded, against high.bottom, 7 nodes)"
    ]


@pytest.mark.parametrize(
    ("wrong", "fault"),
    [
        ({"bodies": ["low", "roof"]}, r"general_contact.bodies: there is no body 'roof'; there"),
        ({"without": [["low", "roof"]]}, r"general_contact.without: there is no body 'roof'"),
        ({"within": -1.0}, r"general_contact.within"),
    ],
)
def test_bad_general_contact(wrong, fault):
    with pytest.raises(SceneError, match=fault):
        check_scene(parse_scene(tower(general_contact=wrong)), MPI.COMM_SELF)


def test_contacts_of_a_mesh():
    """In Python they are entries of a scene, which a program may change."""
    tagged = load_mesh(parse_scene(tower()), MPI.COMM_SELF)
    contacts = propose_contacts(tagged)
    assert [(one.kind, one.friction.law) for one in contacts] == [("unilateral", "none")] * 2
