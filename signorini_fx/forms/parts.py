"""The parts of a ``ContactProblem`` that its results are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.algorithms.task import Outcome, Start, Task
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.elastic import ElasticBody
from signorini_fx.body.foundation import Foundation, Pair
from signorini_fx.body.foundations import FoundationData, Foundations
from signorini_fx.body.rigid_bodies import RigidBodies, RigidBodyMotion
from signorini_fx.forms.steps import SolvedPath
from signorini_fx.forms.stress import Law
from signorini_fx.records import History, Status, Timings
from signorini_fx.results.certificate import Certificate
from signorini_fx.scales import Scales
from signorini_fx.scene.settings import SolverSettings

Facets = npt.NDArray[np.int32]


class ProblemParts:
    """See ``ContactProblem``, which sets them."""

    u: fem.Function
    bcs: list[fem.DirichletBC]
    contact: tuple[Foundation | Pair, ...]
    settings: SolverSettings
    history: History
    status: Status | None
    certificate: Certificate | None
    tools: tuple[RigidBodyMotion, ...]
    _space: fem.FunctionSpace
    _forms: tuple[Any, Any]
    _a: fem.Form
    _L: fem.Form
    _law: Law | None
    _parts: list[npt.NDArray[np.int32]]
    _named: tuple[Sequence[Facets], Mapping[int, Facets]]
    _boundaries: dict[str, Facets]
    _foundations: Foundations
    _data: list[FoundationData]
    _elastic: ElasticBody
    _scales: Scales
    _task: Task
    _rigid: RigidBodies
    _prescribed: tuple[npt.NDArray[np.bool_], npt.NDArray[np.float64]]
    _begun: Start
    _outcome: Outcome | None
    _path: SolvedPath | None
    _marks: int
    _timings: Timings

    @property
    def state(self) -> ContactState:
        """See ``ContactProblem``."""
        raise NotImplementedError
