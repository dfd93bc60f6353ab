"""What is to be solved on one mesh: the record that scenes and forms make, and that everything after them reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.linalg import ElasticSystem, LoadCase
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import shared_in
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodies
from signorini_fx.mechanics.scales import Scales
from signorini_fx.mechanics.statement.expressions import in_space, sample

if TYPE_CHECKING:
    from signorini_fx.mechanics.loads.load_vectors import AppliedLoad, FormCoefficients
    from signorini_fx.mechanics.loads.supports import Conditions
    from signorini_fx.mechanics.obstacles.paired_points import PairedSides
    from signorini_fx.mechanics.statement.statement import Statement


@dataclass(frozen=True, kw_only=True)
class Model(ElasticBody):
    """An elastic body on its mesh with the names of its parts, its contact and all that acts on it."""

    statement: Statement  # names and settings; of forms of a user's own less than all that acts
    tagged: TaggedMesh  # the mesh; where displacements have a component out of it a section in 3D
    law: PointFriction | None  # of friction; None where no law can act
    pairs: Mapping[int, PairedSides]  # both sides of each contact of two bodies, by its place in ``statement.contact``
    rigid: RigidBodies  # those whose motion is an unknown
    supports: Conditions = field(default_factory=list)  # prescribed displacements, one component each: ``bcs``
    applied: tuple[AppliedLoad, ...] = ()  # the loads, by their load factors
    data: RegularisedData | None = None  # at the contact points, without shifts; None without contact
    coefficients: FormCoefficients | None = None  # of the forms of loads and resistances; None: a user's forms

    @property
    def scales(self) -> Scales:
        """What its lengths and stresses are compared with."""
        tagged = self.tagged
        return Scales(tagged.dimension, self.statement.young, tagged.size, self.kinematics.depth(tagged.size))

    def factors(self, step: float) -> npt.NDArray[np.float64]:
        """The factors of the applied loads at a place in the lists of factors, see ``statement.load_path``."""
        return np.array([load.factor(step) for load in self.applied])

    def applied_at(self, step: float) -> list[tuple[float, AppliedLoad]]:
        """The applied loads at a place with their factors; collective."""
        return [(load.factor(step), load.at(step)) for load in self.applied]

    def first_sets(self) -> tuple[ActiveSets, int]:
        """The sets of the first linear solve and its number, section 7: 0 if it only computes the start; collective.

        Raises:
            SceneError: the settings leave no contact node in them.
        """
        assert self.boundary is not None
        region, full_contact = (
            self.settings.initial_contact,
            ActiveSets.all_in_contact(*self.boundary.tangents.shape[::2]),
        )
        if isinstance(region, str):
            return full_contact, 0
        inside = sample(region, in_space(self.boundary.x)) > 0
        if not parallel.any_rank(self.comm, bool(inside.any())):
            raise SceneError([("solver.initial_contact", "holds no contact node")])
        return ActiveSets.of(inside, full_contact.direction), 1

    @shared_in("of_body")
    def cases(self) -> tuple[LoadCase, ...]:
        """The right-hand sides of the applied loads, in their order; those of the first load step; collective."""
        return tuple(map(self._case, self.applied))

    def _case(self, load: AppliedLoad) -> LoadCase:
        return self.case(load.forces, load.prescribed, load.driven, load.pushing, load.pressure_load)

    def load(self, system: ElasticSystem, step: float) -> npt.NDArray[np.float64]:
        """Give a system the loads that depend on the time as they are at a place; collective.

        Returns:
            The factors of all loads, for ``system.set_load``.
        """
        for number, load in enumerate(self.applied):
            if load.again is not None:
                system.set_case(number, self._case(load.at(step)))
        return self.factors(step)
