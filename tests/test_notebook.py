"""The tutorial as a notebook: it is what its script makes, and it runs."""

import os
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "demos" / "tutorial.py"


def test_notebook_is_up_to_date():
    """Made by docs/percent.py, without outputs."""
    as_notebook = runpy.run_path(str(ROOT / "docs" / "percent.py"))["as_notebook"]
    made = as_notebook(SOURCE.read_text(encoding="utf-8"))
    assert SOURCE.with_suffix(".ipynb").read_text(encoding="utf-8") == made, (
        "./env python3 docs/percent.py demos/tutorial.py"
    )


def test_notebook_runs(tmp_path, monkeypatch):
    """In a kernel of its own, which knows nothing of the MPI of this process; results are displayed as tables."""
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")  # jupyter_core warns without it when it is imported
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    for name in [name for name in os.environ if name.startswith(("OMPI_COMM", "PMIX_"))]:
        monkeypatch.delenv(name)
    monkeypatch.delenv("MPLBACKEND", raising=False)  # a notebook shows figures
    monkeypatch.setenv("CELLS", "30")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    notebook = nbformat.read(SOURCE.with_suffix(".ipynb"), as_version=4)
    client = nbclient.NotebookClient(notebook, kernel_name="python3", timeout=600)
    client.execute(cwd=str(tmp_path))  # raises if a cell fails
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    tables = [output.data["text/html"] for output in outputs if "text/html" in output.get("data", {})]
    assert len(tables) >= 2
    assert "converged" in tables[0]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert (tmp_path / "results/demos/tutorial/summary.json").exists()
