"""Files as gmsh and meshio write them: their counts, names and sizes follow from what is drawn."""

import gmsh
import meshio
import numpy as np
import pytest

from signorini_fx.mechanics.mesh.files.formats import read_file
from signorini_fx.mechanics.mesh.info import mesh_info

# A plate of 4 by 2 with a tip of 1 by 2 at its end, in squares of 0.25; a box of 3 by 2 by 1 in cubes of 0.5.
PLATE = {"foot": 20, "end": 8, "both": 28}
BOX = {"foot": 24, "end": 8}


def plate(order, recombined, incomplete):
    """Two rectangles side by side, with names that overlap."""
    occ, mesh = gmsh.model.occ, gmsh.model.mesh
    occ.fragment([(2, occ.addRectangle(0, 0, 0, 4, 2))], [(2, occ.addRectangle(4, 0, 0, 1, 2))])
    occ.synchronize()
    sides = {"foot": [], "end": []}
    for _, tag in gmsh.model.getEntities(1):
        x, y, _ = occ.getCenterOfMass(1, tag)
        sides["foot"] += [tag] if y < 1e-9 else []
        sides["end"] += [tag] if x > 5 - 1e-9 else []
        mesh.setTransfiniteCurve(tag, round(4 * occ.getMass(1, tag)) + 1)
    for number, (_, tag) in enumerate(gmsh.model.getEntities(2)):
        mesh.setTransfiniteSurface(tag)
        if recombined:
            mesh.setRecombine(2, tag)
        gmsh.model.addPhysicalGroup(2, [tag], name=("plate", "tip")[number])
    for name, tags in (*sides.items(), ("both", sides["foot"] + sides["end"])):
        gmsh.model.addPhysicalGroup(1, tags, name=name)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", incomplete)
    mesh.generate(2)
    mesh.setOrder(order)


def box(order, recombined, incomplete):
    """A box with two names."""
    occ, mesh = gmsh.model.occ, gmsh.model.mesh
    occ.addBox(0, 0, 0, 3, 2, 1)
    occ.synchronize()
    for _, tag in gmsh.model.getEntities(1):
        mesh.setTransfiniteCurve(tag, round(2 * occ.getMass(1, tag)) + 1)
    for dim in (2, 3):
        for _, tag in gmsh.model.getEntities(dim):
            (mesh.setTransfiniteSurface if dim == 2 else mesh.setTransfiniteVolume)(tag)
            if dim == 2 and recombined:
                mesh.setRecombine(2, tag)
    for _, tag in gmsh.model.getEntities(2):
        x, _, z = occ.getCenterOfMass(2, tag)
        if z < 1e-9 or x > 3 - 1e-9:
            gmsh.model.addPhysicalGroup(2, [tag], name="foot" if z < 1e-9 else "end")
    gmsh.model.addPhysicalGroup(3, [1], name="body")
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", incomplete)
    mesh.generate(3)
    mesh.setOrder(order)


FILES = [
    ("msh", draw, version, binary, order, recombined, incomplete)
    for draw in (plate, box)
    for version, binary, order, recombined, incomplete in (
        (2.2, 0, 1, 0, 0),
        (2.2, 1, 2, 1, 1),
        (4.1, 0, 1, 1, 0),
        (4.1, 1, 1, 0, 0),
        (4.1, 0, 2, 0, 0),
        (4.1, 1, 2, 1, 0),
    )
]
FILES += [(suffix, draw, 4.1, 0, 1, 0, 0) for suffix in ("med", "vtu", "xdmf") for draw in (plate, box)]
FILES += [(suffix, draw, 4.1, 0, 1, 0, 0) for suffix in ("step", "brep") for draw in (plate, box)]


@pytest.mark.one_quick
@pytest.mark.parametrize(("suffix", "draw", "version", "binary", "order", "recombined", "incomplete"), FILES)
def test_counts_names_and_sizes(tmp_path, suffix, draw, version, binary, order, recombined, incomplete):
    """Cells, facets of each name and their length or area, area or volume of the body."""
    file = tmp_path / f"body.{suffix}"
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        draw(order, recombined, incomplete)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(file if suffix in ("msh", "step", "brep") else tmp_path / "body.msh"))
    finally:
        gmsh.finalize()
    if not file.exists():
        translate(tmp_path / "body.msh", file)
    info = mesh_info(read_file(file, {"foot": low(draw), "end": far(draw)} if suffix not in ("msh", "med") else None))
    plane = draw is plate
    assert info["area" if plane else "volume"] == pytest.approx(10.0 if plane else 6.0, rel=1e-12)
    sizes = {name: facets["length" if plane else "area"] for name, facets in info["boundaries"].items()}
    assert sizes["foot"] == pytest.approx(5.0 if plane else 6.0, rel=1e-12)
    assert sizes["end"] == pytest.approx(2.0)
    assert info["degree"] == order
    if suffix in ("step", "brep"):
        return
    counts = {name: facets["facets"] for name, facets in info["boundaries"].items() if name in (PLATE, BOX)[not plane]}
    whole = PLATE if plane else {name: count * (2 - recombined) for name, count in BOX.items()}
    if suffix != "msh":
        whole = {name: count for name, count in whole.items() if name != "both"}
    assert counts == whole
    cells = 160 if plane else 48
    assert (
        info["cells"] == cells if recombined else info["cells"] in ((2 * cells,) if plane else (5 * cells, 6 * cells))
    )
    if suffix == "msh":
        assert set(info["regions"]) == ({"plate", "tip"} if plane else {"body"})


def low(draw):
    """A rule for the foot."""
    return lambda x: x[1 if draw is plate else 2] < 1e-9


def far(draw):
    """A rule for the end."""
    return lambda x: x[0] > (5 if draw is plate else 3) - 1e-9


def translate(source, target):
    """The cells and facets of a mesh of gmsh in another format, by meshio; in MED with their names."""
    mesh = meshio.gmsh.read(source)
    kinds = ["triangle", "line"] if "tetra" not in mesh.cells_dict else ["tetra", "triangle"]
    blocks = [(kind, mesh.cells_dict[kind]) for kind in kinds]
    numbers = [mesh.get_cell_data("gmsh:physical", kind) for kind in kinds]
    points = mesh.points if kinds[0] == "tetra" else mesh.points[:, :2]
    out = meshio.Mesh(points, blocks)
    if target.suffix == ".med":
        foot, end = [np.isin(blocks[1][1], on).all(axis=1) for on in nodes_of(points)]
        out.cell_data = {"cell_tags": [-np.ones(len(blocks[0][1]), int), -(2 * foot + 3 * end).astype(int)]}
        out.cell_tags = {-1: ["body"], -2: ["foot"], -3: ["end"]}
    elif target.suffix == ".vtu":
        out.points = mesh.points
        out.cell_data = {"number": numbers}
    meshio.write(target, out)


def nodes_of(points):
    """The nodes of the foot, and those of the end."""
    return np.flatnonzero(points[:, -1] < 1e-9), np.flatnonzero(points[:, 0] > points[:, 0].max() - 1e-9)
