"""Solves and judges some of the random scenes, and reports each on standard output; started by
``__main__``.

python3 -m benchmarks.stability.oracle.worker WHERE SAME_UNITS FIRST STOP STRIDE
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mpi4py.MPI  # noqa: F401  # before dolfinx: in its wheels only mpi4py finds MPI

from benchmarks.stability.oracle import (
    more_scenes,
    scenes,
    scenes_in_space,
    scenes_of_bodies,
)
from benchmarks.stability.oracle.judge import CRASHED, REFUSED, REFUSED_WRONGLY, Verdict, judge
from benchmarks.stability.oracle.package import answer_of, mesh_of, solution_of
from benchmarks.stability.oracle.scenes import Trial
from benchmarks.stability.oracle.units import Units, same
from signorini_fx.errors import SignoriniError

# The scenes of a seed by their names; several bodies by turns in 2D and in 3D.
TRIAL: dict[str, Callable[..., Trial]] = {
    "plane": scenes.trial,
    "effects": lambda seed, units=None: more_scenes.more(seed, 2, units),
    "space-effects": lambda seed, units=None: more_scenes.more(seed, 3, units),
    "space": scenes_in_space.trial,
    "bodies": lambda seed, units=None: scenes_of_bodies.trial(
        seed, dimension_of("bodies", seed), units
    ),
}
# Libraries print too: the messages are the lines that begin like this.
MARK = "\x1e"


def dimension_of(where: str, seed: int) -> int:
    """Of a scene."""
    return {"plane": 2, "effects": 2, "space": 3, "space-effects": 3}.get(where, 2 + seed % 2)


def same_units(where: str, seed: int) -> Units:
    """Units of the body."""
    return same(dimension_of(where, seed))


@dataclass(frozen=True)
class Row:
    """A scene and the verdict on it."""

    seed: int
    kind: str
    where: str = "plane"
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


# What the documentation says is refused; the scenes contain nothing else that is.
_REASONS = ("prescribes the normal displacement on", "initial_contact: holds no contact node")


def examined(drawn: Trial, where: str) -> tuple[Verdict, dict[str, Any]]:
    """Solve a scene and judge the answer: the verdict, and remarks on the run."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            solution = solution_of(drawn.write(Path(folder)))
        except SignoriniError as error:
            message = str(error).split("\n")[0]
            kind = REFUSED if any(reason in message for reason in _REASONS) else REFUSED_WRONGLY
            return Verdict(kind, type(error).__name__, note=message), {}
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            text = (
                f"{type(error).__name__} in "
                f"{where.filename.rsplit('/', 1)[-1]}:{where.lineno}: {error}"
            )
            return Verdict(CRASHED, type(error).__name__, note=text.split("\n")[0]), {}
    mesh = mesh_of(solution, drawn.units) if drawn.mesh is None else drawn.mesh
    answer = answer_of(solution, drawn.units)
    dimension = mesh.points.shape[1]
    simplices = mesh.cells.shape[1] in ((3, 6) if dimension == 2 else (4, 10))
    about = {
        "algorithm": solution.algorithm,
        "element": f"{'P' if simplices else 'Q'}{solution.statement.element.degree}",
        "nodes": len(answer.steps[-1].table["x"]) if answer.steps else 0,
        "solves": solution.history.linear_solves,
        "steps": len(answer.steps),
    }
    return judge(drawn.scene, mesh, answer), about


def row_of(seed: int, where: str = "plane", *, own: bool = False) -> Row:
    """The row of a scene; ``own``: in units of the body."""
    begin = time.process_time()
    drawn = TRIAL[where](seed, same_units(where, seed) if own else None)
    verdict, about = examined(drawn, where)
    figure, value = verdict.worst
    laws = sorted(
        {effect.get("friction", {"law": "none"})["law"] for effect in drawn.scene["contact"]}
        - {"none"}
    )
    return Row(
        seed=seed,
        kind=verdict.kind,
        where=where,
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
    where, own, *seeds = arguments
    for seed in range(*map(int, seeds)):
        _say({"begin": seed})
        _say({"row": asdict(row_of(seed, where, own=bool(int(own))))})


def _say(message: dict[str, Any]) -> None:
    print(MARK + json.dumps(message), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
