"""The tutorial as a notebook: it is what its script makes, it runs, and its outputs are those that
are stored.
"""

import base64
import io
import json
import os
import re
import runpy
from pathlib import Path

import pytest
from drawing import needs_pictures_in_3d

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "demos" / "tutorial.py"


PERCENT = runpy.run_path(str(ROOT / "docs" / "percent.py"))
NOTEBOOK = SOURCE.with_suffix(".ipynb")


def test_notebook_is_up_to_date():
    """Made by docs/percent.py, with outputs of every cell that has some, and no errors."""
    made = json.loads(PERCENT["as_notebook"](SOURCE.read_text(encoding="utf-8")))
    stored = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    outputs = PERCENT["outputs_of"](NOTEBOOK)
    for cell in (*made["cells"], *stored["cells"]):
        for key in ("outputs", "execution_count", "metadata"):
            cell.pop(key, None)
    assert stored["cells"] == made["cells"], "./env python3 docs/percent.py demos/tutorial.py"
    assert {output["output_type"] for cell in outputs for output in cell} == {
        "stream",
        "execute_result",
    }


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A function that runs a notebook in a kernel of its own, which knows nothing of the MPI of
    this process.
    """
    monkeypatch.setenv(
        "JUPYTER_PLATFORM_DIRS", "1"
    )  # jupyter_core warns without it when it is imported
    pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    for name in [name for name in os.environ if name.startswith(("OMPI_COMM", "PMIX_"))]:
        monkeypatch.delenv(name)
    monkeypatch.delenv("MPLBACKEND", raising=False)  # a notebook shows figures
    monkeypatch.setenv("PYTHONPATH", str(ROOT))

    def executed(notebook):
        client = nbclient.NotebookClient(notebook, kernel_name="python3", timeout=600)
        client.execute(cwd=str(tmp_path))  # raises if a cell fails

    return executed


PROGRESS = """
from signorini_fx import ProgressLine
from signorini_fx.records import IterationRecord
from signorini_fx.results import progress_line
progress_line.PROGRESS_PAUSE = 0.0
line = ProgressLine()
for number in (1, 2):
    line(IterationRecord(1, number, 0, 1, 0, 0, 0, 0, 0.5, False, 0.0))
"""


@pytest.mark.slow
def test_progress_line(run):
    """One output of its cell, which changes, and is empty in the end; nothing on standard error."""
    from nbformat.v4 import new_code_cell, new_notebook

    notebook = new_notebook(
        cells=[new_code_cell(PROGRESS), new_code_cell(f"{PROGRESS}line.erase()")]
    )
    run(notebook)
    assert [[output.data["text/plain"] for output in cell.outputs] for cell in notebook.cells] == [
        ["linear solve 2, residual 5.0e-01"],
        [""],
    ]


SPACE = """
from signorini_fx import Scene, solve
scene = Scene.model_validate({
    "mesh": {"generator": "box", "parameters": {"nx": 3, "ny": 3, "nz": 3}},
    "material": {"young": 100.0, "poisson": 0.3},
    "displacement": {"boundary": "top", "x": 0.0, "y": 0.0, "z": -0.1},
    "contact": {"boundary": "bottom", "gap": 0.05},
})
solution = solve(scene)
"""


@pytest.mark.slow
def test_pictures_of_a_body_in_space(run):
    """``solution.plot()`` displays pictures, those of a body in 3D by PyVista."""
    image = pytest.importorskip("PIL.Image")
    needs_pictures_in_3d()
    from nbformat.v4 import new_code_cell, new_notebook

    notebook = new_notebook(cells=[new_code_cell(text) for text in (SPACE, "solution.plot()")])
    run(notebook)
    (page,) = notebook.cells[1].outputs
    coded = re.findall(r"data:image/png;base64,([^\"]+)", page.data["text/html"])
    assert len(coded) >= 2
    for text in coded:
        with image.open(io.BytesIO(base64.b64decode(text))) as picture:
            assert len(set(picture.convert("L").resize((60, 60)).getdata())) > 10  # it is not blank


@pytest.mark.slow
def test_notebook_runs(tmp_path, run):
    """The cells do not fail, and results are displayed as tables."""
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(SOURCE.with_suffix(".ipynb"), as_version=4)
    run(notebook)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    tables = [
        output.data["text/html"] for output in outputs if "text/html" in output.get("data", {})
    ]
    assert len(tables) >= 3
    assert "converged" in tables[0]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert (tmp_path / "results/demos/tutorial/summary.json").exists()
    again = tmp_path / "again.ipynb"
    nbformat.write(notebook, again)
    assert printed(again) == printed(NOTEBOOK)


def printed(notebook):
    """What the cells print, without the seconds and residuals of the iteration, to three digits."""
    texts = [
        "".join(o["text"]) for cell in PERCENT["outputs_of"](notebook) for o in cell if "text" in o
    ]
    assert len(texts) >= 4
    words = [
        word
        for text in texts
        for word in text.split()
        if not re.search(r"e-\d\d|^\d\.\d{3}$", word)
    ]
    return [re.sub(r"(\.\d)\d+$", r"\1", word) for word in words]
