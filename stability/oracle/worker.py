"""Solves and judges some of the random scenes, and reports each on standard output; started by ``__main__``.

python3 -m stability.oracle.worker FIRST STOP STRIDE
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from signorini_fx.errors import SignoriniError
from stability.oracle.judge import CRASHED, REFUSED, Verdict, judge
from stability.oracle.package import answer_of, mesh_of, solution_of
from stability.oracle.scenes import Trial, trial

# Libraries print too: the messages are the lines that begin like this.
MARK = "\x1e"


@dataclass(frozen=True)
class Row:
    """A scene and the verdict on it."""

    seed: int
    kind: str
    outcome: str = ""
    algorithm: str = ""
    law: str = ""
    element: str = ""
    nodes: int = 0
    solves: int = 0
    steps: int = 0
    compared: int = 0
    figure: str = ""
    value: float = 0.0
    seconds: float = 0.0
    note: str = ""


def examined(drawn: Trial) -> tuple[Verdict, dict[str, Any]]:
    """Solve a scene and judge the answer: the verdict, and remarks on the run."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            solution = solution_of(drawn.write(Path(folder)))
        except SignoriniError as error:
            return Verdict(REFUSED, type(error).__name__, note=str(error).split("\n")[0]), {}
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            text = f"{type(error).__name__} in {where.filename.rsplit('/', 1)[-1]}:{where.lineno}: {error}"
            return Verdict(CRASHED, type(error).__name__, note=text.split("\n")[0]), {}
    mesh = mesh_of(solution) if drawn.mesh is None else drawn.mesh
    answer = answer_of(solution)
    about = {
        "algorithm": solution.algorithm,
        "element": f"P{solution.scene.element.degree}"
        if len(mesh.cells[0]) in (3, 6)
        else f"Q{solution.scene.element.degree}",
        "nodes": len(answer.steps[-1].table["x"]) if answer.steps else 0,
        "solves": solution.history.linear_solves,
        "steps": len(answer.steps),
    }
    return judge(drawn.scene, mesh, answer), about


def row_of(seed: int) -> Row:
    """The row of a scene."""
    begin = time.process_time()
    drawn = trial(seed)
    verdict, about = examined(drawn)
    figure, value = verdict.worst
    laws = sorted({effect["friction"]["law"] for effect in drawn.scene["contact"]} - {"none"})
    return Row(
        seed=seed,
        kind=verdict.kind,
        outcome=verdict.outcome,
        law=" and ".join(laws) or "none",
        compared=verdict.compared,
        figure=figure,
        value=min(float(value), 1e300),
        seconds=time.process_time() - begin,
        note=verdict.note,
        **about,
    )


def main(arguments: Sequence[str]) -> None:
    """Examine the scenes FIRST, FIRST + STRIDE, ... before STOP."""
    for seed in range(*map(int, arguments)):
        _say({"begin": seed})
        _say({"row": asdict(row_of(seed))})


def _say(message: dict[str, Any]) -> None:
    print(MARK + json.dumps(message), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
