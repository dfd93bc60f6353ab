"""Random scenes that one method does not solve and another one does, judged by the second program of the suite."""

from dataclasses import replace

import pytest

from benchmarks.stability.oracle.judge import RIGHT
from benchmarks.stability.oracle.package import solution_of
from benchmarks.stability.oracle.space import scenes as space
from benchmarks.stability.oracle.units import same
from benchmarks.stability.oracle.worker import examined
from signorini_fx.algebra.attempts import REGULARISED


def by(algorithm, seed):
    """A random scene in 3D by an algorithm, in units of the body."""
    drawn = space.trial(seed, same(3))
    return replace(drawn, scene=drawn.scene | {"solver": {"algorithm": algorithm}})


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "most"), [(500087, 260), (500077, 260)])
def test_ssn_in_place_of_alm(seed, most, tmp_path):
    """Where alm does not contract; the answer is right for the law that it promises."""
    drawn = by("alm", seed)
    verdict, about = examined(drawn, "space")
    assert (verdict.kind, about["algorithm"].startswith("alm")) == (RIGHT, seed == 500077), verdict
    assert about["solves"] <= most
    solution = solution_of(drawn.write(tmp_path))
    assert [finding.path for finding in solution.findings if finding.level == "warning"][:1] == (
        ["solver.algorithm"] if seed == 500087 else []
    )
    events = list(map(str, solution.history.events))
    assert any(event.endswith(str(REGULARISED)) for event in events)
