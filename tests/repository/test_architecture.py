"""The structure of the package, read from its imports."""

import ast
import importlib
import inspect
import subprocess
import sys
import tomllib
from pathlib import Path

import architecture
import pytest
from commands import run_python

from signorini_fx import InstallationError, extensions
from signorini_fx.extensions import ADD_ONS, add_on
from signorini_fx.mechanics.statement.mesh_sources import known_generators

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "signorini_fx"
MODULES = sorted(
    (*PACKAGE.rglob("*.py"), *(PACKAGE / "meshes").glob("*.py"))
)  # globs follow no links


def imports(path, *, everywhere):
    """Names of the modules that a file imports: everywhere, or when it is imported itself."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = set()
    todo = [tree]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        lazily = isinstance(node, ast.FunctionDef) or (
            isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        )
        if everywhere or not lazily:
            todo += ast.iter_child_nodes(node)
    return names


def uses(path, *packages, everywhere=True):
    """The imports of a file that belong to one of the packages."""
    found = imports(path, everywhere=everywhere)
    return {
        name for name in found if any(f"{name}.".startswith(f"{package}.") for package in packages)
    }


def test_tests_follow_the_rooms():
    """Each file of tests lies in a folder that is named as a room of the package, or says what else
    is tested.
    """
    rooms = {layer.split(".")[-1] for layer in architecture.packages()} | {
        "random_scenes",
        "repository",
        "verification",
    }
    files = [path.relative_to(ROOT / "tests") for path in (ROOT / "tests").rglob("test_*.py")]
    assert {file.parts[0] for file in files if len(file.parts) == 2} <= rooms
    assert [file for file in files if len(file.parts) != 2] == []
    assert len({file.name for file in files}) == len(files)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["petsc_vec", "assemble_vector", "create_vector", "set_bc", "create_petsc_vector"]
)
def test_vectors_of_dolfinx_are_not_made_petscs(name):
    """See ``assembly.mesh_entities._summed``: ranks would wait for each other as their garbage
    collectors run.
    """
    calls = [
        file.name
        for file in MODULES
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and node.attr == name
        if not (
            isinstance(node.value, ast.Name) and node.value.id == "fem"
        )  # those give dolfinx's own vectors
    ]
    assert calls == []


@pytest.mark.parametrize("folder", architecture.CORE)
def test_the_core_stands_alone(folder):
    """It knows neither forms nor meshes nor scenes, and imports none of the packages above it,
    anywhere in a file.
    """
    above = architecture.LAYERS[: architecture.LAYERS.index("algebra.algorithms")]
    strangers = (
        "dolfinx",
        "ufl",
        "basix",
        "pydantic",
        *(f"signorini_fx.{layer}" for layer in above),
    )
    files = sorted(architecture.folder_of(folder).glob("*.py"))
    assert len(files) >= 2
    assert {file.name: uses(file, *strangers) for file in files} == {
        file.name: set() for file in files
    }


def test_algorithms_and_linear_algebra_are_strangers():
    """Algorithms know the protocol of linalg/__init__.py at most, linear algebra knows no
    algorithm.
    """
    for file in (PACKAGE / "algebra" / "algorithms").glob("*.py"):
        # What calls back, why PETSc fails, its options, and what petsc4py lacks.
        known = ("petsc_calls", "petsc_options")
        kinds = {
            f"signorini_fx.algebra.linalg.{kind.stem}"
            for kind in (PACKAGE / "algebra" / "linalg").glob("[!_]*.py")
            if kind.stem not in known
        }
        assert not uses(file, *kinds), file.name
    for file in (PACKAGE / "algebra" / "linalg").glob("*.py"):
        assert not uses(file, "signorini_fx.algebra.algorithms"), file.name


def test_every_module_has_a_layer():
    """Its package; a module beside packages is named in BESIDE of tests/support/architecture.py."""
    assert {architecture.layer_of(module) for module in architecture.files()} == set(
        architecture.LAYERS
    )


@pytest.mark.slow
def test_imports_point_down():
    """To lower layers, or within one."""
    graph = architecture.graph()
    statement = {
        f"mechanics.statement.{name}"
        for name in ("effect", "expressions", "rigid_body", "statement", "values")
    }
    assert graph["mechanics.effects.loads"] == {"arrays", "errors", "tuned", *statement}
    assert {"mechanics.model", "mechanics.mesh.tagged", "algebra.linalg.choice"} <= graph[
        "solving.solve_on_mesh"
    ]
    place = {layer: number for number, layer in enumerate(architecture.LAYERS)}
    upward = [
        f"{module} imports {other}"
        for module, used in graph.items()
        for other in used
        if place[architecture.layer_of(module)] > place[architecture.layer_of(other)]
    ]
    assert not upward


def assigned_names(tree):
    """What a module gives a name to: variables, arguments, attributes, functions, classes."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.id if isinstance(node, ast.Name) else node.attr
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name


ADDED = tuple(f"signorini_fx.{room}" for room in architecture.ADD_ONS)


@pytest.mark.slow
def test_the_rest_imports_no_add_on():
    """Anywhere in a file, also within functions: ``extensions.add_on`` finds them by their entry
    points.
    """
    rest = {
        module: path
        for module, path in architecture.files().items()
        if architecture.layer_of(module) not in architecture.ADD_ONS
    }
    assert len(rest) > 200
    assert {module: used for module, path in rest.items() if (used := uses(path, *ADDED))} == {}
    entries = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "entry-points"
    ]
    rooms = {value.partition(".")[2].partition(":")[0] for value in entries[ADD_ONS].values()}
    assert {architecture.layer_of(room) for room in rooms} < set(architecture.ADD_ONS)


@pytest.mark.one_quick("room", architecture.ADD_ONS)
def test_add_ons_use_no_private_names(room):
    """Of the rest, or of each other."""
    trees = {
        path: ast.parse(path.read_text(encoding="utf-8"))
        for path in architecture.folder_of(room).glob("*.py")
    }
    names = {
        name for tree in trees.values() for name in assigned_names(tree) if name.startswith("_")
    }
    for path, tree in trees.items():
        others = {
            name.replace(".__version__", "").replace(f"{room}._", "")
            for name in uses(path, "signorini_fx")
        }
        assert {name for name in others if "._" in name} == set(), path
        attributes = (node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute))
        assert {
            name for name in attributes if name.startswith("_") and not name.endswith("__")
        } <= names, path


@pytest.mark.slow
def test_a_missing_package_is_one_message():
    """What draws and writes reports needs packages that the rest works without: the error names the
    one to install.
    """
    code = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "from signorini_fx.extensions import add_on\n"
        "import signorini_fx.scenes.cli, signorini_fx.results.files\n"
        "add_on('pictures')"
    )
    ended = run_python(code, check=False)
    assert (
        "MissingPackageError: 'pictures' needs matplotlib, which is not installed: pip install "
        "matplotlib" in ended.stderr
    )
    assert "During handling" not in ended.stderr


def test_a_missing_add_on_is_one_message(monkeypatch):
    """Where somebody asks for it, and nothing where nobody does."""
    monkeypatch.setitem(sys.modules, "signorini_fx.addons.bounds", None)
    monkeypatch.delitem(sys.modules, "signorini_fx.addons.bounds.error_bound", raising=False)
    with pytest.raises(
        InstallationError,
        match=r"'error_bound' needs signorini_fx\.addons\.bounds.*, an add-on that is not",
    ):
        add_on("error_bound")
    monkeypatch.setattr(extensions, "_installed", lambda *_: {key: {} for key in extensions.GROUPS})
    monkeypatch.setitem(sys.modules, "signorini_fx.meshes", None)
    assert known_generators() == {}
    with pytest.raises(
        InstallationError, match="'report' is an add-on of signorini_fx that is not installed"
    ):
        add_on("report")


def test_imports_run_in_no_circle():
    """Modules can be read in an order in which nothing is used before it is explained."""
    rest = architecture.graph()
    while rest:
        free = {module for module, used in rest.items() if not used & rest.keys()}
        assert free, f"these import each other: {sorted(rest)}"
        rest = {module: used for module, used in rest.items() if module not in free}


EFFECTS = sorted(
    f"mechanics/effects/{file.stem}" for file in (PACKAGE / "mechanics" / "effects").glob("*.py")
)
SCENE = ("mechanics/statement/effect", "scenes/scene", "mechanics/statement/expressions")


@pytest.mark.parametrize("module", [*EFFECTS, *SCENE, "errors", "records", "addons/report/page"])
def test_scenes_need_no_solver(module):
    """A scene can be read and checked without dolfinx, PETSc, MPI or UFL."""
    heavy = (
        "dolfinx",
        "petsc4py",
        "mpi4py",
        "ufl",
        "basix",
        "gmsh",
        "signorini_fx.mechanics.mesh.tagged",
        "signorini_fx.machine.parallel",
    )
    assert not uses(PACKAGE / f"{module}.py", *heavy, everywhere=False)


@pytest.mark.slow
def test_mpi_is_imported_first():
    """Each module can be imported alone where PETSc and dolfinx find MPI only once mpi4py has
    loaded it.
    """
    for file in MODULES:
        names = []
        for path in [
            *(
                folder / "__init__.py"
                for folder in reversed(file.parents)
                if PACKAGE in folder.parents
            ),
            file,
        ]:
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.Import | ast.ImportFrom):
                    names += (
                        [node.module]
                        if isinstance(node, ast.ImportFrom)
                        else [one.name for one in node.names]
                    )
        first = next(
            (name for name in names if name.startswith(("mpi4py", "petsc4py", "dolfinx"))), "mpi4py"
        )
        assert first.startswith("mpi4py"), file


def compares_versions(path):
    """Whether a file compares something called version, but for that of VTK."""
    comparisons = (
        node
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Compare)
    )
    texts = [ast.unparse(node).lower() for node in comparisons]
    return any("version" in text and "vtk" not in text for text in texts)


@pytest.mark.slow
def test_versions_are_compared_in_one_place():
    """Only compat.py does something else for another version of dolfinx."""
    assert [file.name for file in MODULES if compares_versions(file)] == ["compat.py"]


@pytest.mark.slow
def test_private_parts_of_dolfinx_are_used_in_one_place():
    """Only compat.py imports ``dolfinx.cpp``, or asks a geometry for what has other names in other
    releases.
    """
    assert [file.name for file in MODULES if uses(file, "dolfinx.cpp")] == ["compat.py"]
    asked = {
        file.name
        for file in MODULES
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute)
        and node.attr in ("dofmap", "cmap")
        and "geometry" in ast.unparse(node.value)
    }
    assert asked == {"compat.py"}


def python(code):
    """Run code in a fresh interpreter, warnings as errors."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )


def test_import_is_light():
    """``import signorini_fx`` and reading a scene import neither dolfinx nor PETSc."""
    code = "import sys, signorini_fx; signorini_fx.read_scene, signorini_fx.SceneError; "
    heavy = "('dolfinx', 'petsc4py', 'mpi4py', 'ufl', 'gmsh', 'matplotlib')"
    ended = python(code + f"print([name for name in {heavy} if name in sys.modules])")
    assert (ended.stdout.strip(), ended.stderr) == ("[]", "")


def test_the_elements_of_others_stay_as_they_are():
    """Cells of elements are shared within a solve alone, where they save most of what is made."""
    code = (
        "import basix.ufl, ufl; elements = basix.ufl._ElementBase; before = elements.cell; "
        "made, begun = [], ufl.Cell.__init__\n"
        "def counted(cell, *args):\n    made.append(cell)\n    begun(cell, *args)\n"
        "ufl.Cell.__init__ = counted\n"
        "import signorini_fx as sfx; sfx.ContactProblem; "
        "sfx.solve(sfx.read_scene('demos/scenes/example1_coulomb.toml')); "
        "print(elements.cell is before, len(made) < 100)"
    )
    ended = run_python(code)
    assert ended.stdout.splitlines()[-1] == "True True"


def test_only_named_materials_are_imported():
    """A scene imports the files of its materials alone, and no UFL."""
    read = "import sys; from signorini_fx.scenes.reading import parse_scene; "
    scene = (
        "{'mesh': {'generator': 'rectangle'}, 'material': {'young': 1, 'poisson': 0.3}, "
        "'body_force': {'x': 1}}"
    )
    found = (
        "sorted(m.rpartition('.')[2] for m in sys.modules if "
        "m.startswith('signorini_fx.mechanics.materials.'))"
    )
    ended = python(f"{read}parse_scene({scene}); print({found}, 'ufl' in sys.modules)")
    assert (ended.stdout.strip(), ended.stderr) == ("['isotropic', 'protocol'] False", "")


@pytest.mark.slow
def test_a_small_solve_imports_no_more_than_it_runs(tmp_path):
    """Neither materials, methods, readers of meshes nor accuracies that the scene does not need."""
    code = (
        "import sys; from signorini_fx.scenes.cli import main; main(['solve', "
        "'demos/scenes/example1_coulomb.toml', "
    )
    code += (
        f"'--out', {str(tmp_path / 'out')!r}, '--no-pictures', '--no-fields', '--quiet']); "
        "print([m for m in "
    )
    code += "sys.modules if m in ('scipy.optimize', 'signorini_fx.mechanics.materials.nonlinear', "
    code += "'signorini_fx.mechanics.mesh.files.abaqus', 'signorini_fx.solving.to_accuracy')])"
    assert python(code).stdout.splitlines()[-1:] == ["[]"]


def test_a_small_problem_of_forms_imports_no_more_than_it_runs():
    """A ``ContactProblem`` on a plane foundation, with Coulomb friction, loads 98 modules."""
    code = """import numpy, signorini_fx as sfx, sys, ufl
from mpi4py import MPI
from dolfinx import fem, mesh
square = mesh.create_unit_square(MPI.COMM_WORLD, 4, 4)
space = fem.functionspace(square, ("Lagrange", 1, (2,)))
u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
a = ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx
L = ufl.inner(ufl.as_vector((0, -1e-3)), v) * ufl.dx
low = mesh.locate_entities_boundary(square, 1, lambda x: numpy.isclose(x[1], 0))
sfx.ContactProblem(a, L, contact=sfx.Foundation(low, friction=sfx.Coulomb(0.3))).solve()
print(sum(name.startswith("signorini_fx") for name in sys.modules) <= 98)"""
    ended = run_python(code)
    assert ended.stdout.splitlines()[-1] == "True"


def test_the_certificate_stands_alone():
    """It imports nothing that has solved the problem: neither algorithms, nor problems, nor linear
    algebra.
    """
    solvers = [
        f"signorini_fx.{layer}"
        for layer in ("algebra.algorithms", "algebra.regularised", "algebra.linalg", "solving")
    ]
    files = sorted(architecture.folder_of("results.certificate").glob("*.py"))
    assert len(files) >= 6
    assert {file.name: uses(file, *solvers) for file in files} == {
        file.name: set() for file in files
    }


def documentation(member):
    """The docstring of what a class defines, if it is a function or a property."""
    function = (
        getattr(member, "fget", None)
        or getattr(member, "func", None)
        or getattr(member, "__func__", member)
    )
    named = inspect.isfunction(function) and function.__name__.isidentifier()  # no lambda
    return function.__doc__ if named else "no function"


def undocumented(module):
    """The public methods of its classes without a docstring that override none that has one."""
    for found in vars(module).values():
        if (
            not inspect.isclass(found)
            or found.__module__ != module.__name__
            or found.__name__.startswith("_")
        ):
            continue
        for name, member in vars(found).items():
            overridden = [vars(base)[name] for base in found.__mro__[1:] if name in vars(base)]
            if not name.startswith("_") and not any(map(documentation, [member, *overridden])):
                yield f"{found.__module__}.{found.__qualname__}.{name}"


def test_public_methods_are_documented():
    """A method has a docstring, or overrides one that has."""
    names = [name for name in architecture.files() if not name.endswith("__main__")]
    missing = [
        found
        for name in names
        for found in undocumented(importlib.import_module(f"signorini_fx.{name}"))
    ]
    assert missing == []
