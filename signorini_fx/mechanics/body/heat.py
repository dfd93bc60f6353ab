"""Steady heat in bodies and through their contact, from load step to load step.

With B the map of contact points to temperatures, one side less the other, D and M its two parts,
and the weights w,

    K T + B^T w h (B T - T_f) = f + D^T w b q + M^T w (1 - b) q,    q = share of mu . xi / dt,

where h(pressure, gap) is the conductance, T_f the temperature of foundations, b the share of one
side.  Rows of D and M have the sum one: what one side loses the other gains.  Temperatures strain
the body, and contact decides h and q: a step is solved again until both agree.  Aitken's factor
shortens that, and the factor by which a turn repeats a change of the temperature is physics: from
one on no steady temperature is stable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem
from petsc4py import PETSc

from signorini_fx.algebra.linalg.factorisation import use_direct
from signorini_fx.arrays import Array, Flags
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners, to_owners
from signorini_fx.mechanics.assembly.mesh_entities import (
    assemble,
    compile_form,
    facet_nodes,
    marked_nodes,
    node_positions,
)
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.effects.heat import Heat
from signorini_fx.mechanics.loads.load_vectors import FormCoefficients, measures
from signorini_fx.mechanics.model import Model, sum_of
from signorini_fx.mechanics.state import Field, State
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.step_effect import StepEffect, StepEnd
from signorini_fx.records import Finding, Status
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, ROOT_OF_EPS

_SETTLED = 1e-10  # of the range of temperatures: by how much a turn may change one
_GROWING = 3  # turns one after the other, each of which repeats more than all of a change


@dataclass(frozen=True)
class PassedHeat:
    """Heat at the n contact points of this rank.

    Attributes:
        conductance: h, power per area and temperature, shape (n,).
        beyond: the temperature of foundations, zero between two bodies, shape (n,).
        friction: heat of friction, power per area, shape (n,).
        share: that of the side with the points, shape (n,).
    """

    conductance: Array
    beyond: Array
    friction: Array
    share: Array

    @classmethod
    def of(cls, model: Model, contact: ContactState, time: float, dt: float) -> Self:
        """Return what passes contact as it is at a time, after a step of a duration."""
        part = contact.boundary.part
        conductance, beyond, friction, share = (np.zeros(part.size) for _ in range(4))
        pressure = np.maximum(contact.pressure, 0.0)
        gap = np.maximum(contact.gap - contact.u_n, 0.0)
        closed = contact.in_contact | contact.bilateral
        for number, entry in enumerate(model.statement.contact):
            on = part == number
            if (joint := entry.conductance) is not None:
                conductance[on] = joint.of(pressure[on], gap[on], closed[on])
                if joint.temperature is not None:
                    at_time = joint.at_time(time).temperature
                    beyond[on] = sample(at_time, in_space(contact.boundary.x[on]))
            if (heated := entry.friction_heat) is not None:
                friction[on] = heated.fraction * contact.friction_energy[on] / dt
                share[on] = heated.share
        return cls(conductance, beyond, friction, share)


class Conductor:
    """A body as conduction sees it: its forms and the map of its contact points.

    Forms have the values of the time of ``on``.  All methods are collective.
    """

    def __init__(self, model: Model) -> None:
        space = model.space
        mesh = space.mesh
        self.model = model
        self.on = FormCoefficients(model.statement, model.tagged, space)
        degree = space.element.basix_element.degree
        self.space = fem.functionspace(mesh, ("Lagrange", degree))
        if not np.array_equal(self.space.dofmap.list, space.dofmap.list):
            raise RuntimeError("temperatures are numbered otherwise than the nodes")
        self.entries: tuple[Heat, ...] = model.statement.effects["heat"]
        self.temperature = fem.Function(self.space)
        self._solved: tuple[bytes, Array] | None = None
        test = ufl.TestFunction(self.space)
        trial = ufl.TrialFunction(self.space)
        on = self.on
        around = on.around
        conductivity = on.of_material("conductivity")
        metadata = {"quadrature_degree": 2 * degree + 2}
        dx = ufl.dx(metadata=metadata)
        self.given = [entry for entry in self.entries if entry.temperature is None]
        places = [each(metadata=metadata) for each in measures(self.given, model.tagged)]

        def inside(value: Any) -> Any:
            return conductivity * ufl.inner(ufl.grad(value), ufl.grad(test)) * around * dx

        def resisting(value: Any) -> Any:
            """Conduction and films."""
            films = (
                on.value(entry.film) * value * test * around * d
                for entry, d in zip(self.given, places, strict=True)
                if entry.film is not None
            )
            return sum(films, inside(value))

        def brought(entry: Heat, film: Any) -> Any:
            """The power that an entry brings per area or volume, at a temperature at its film."""
            if entry.film is not None:
                return on.value(entry.film) * (on.value(entry.ambient) - film)
            return on.value_in(entry.region, entry.flux if entry.source is None else entry.source)

        self.matrix_form = compile_form(resisting(trial))
        self.residual_form = compile_form(resisting(self.temperature))
        loads = [
            brought(entry, 0.0) * test * around * d
            for entry, d in zip(self.given, places, strict=True)
        ]
        self.load_form = compile_form(sum(loads[1:], loads[0])) if loads else None
        self.power_forms = [
            compile_form(brought(entry, self.temperature) * around * d)
            for entry, d in zip(self.given, places, strict=True)
        ]

    @classmethod
    def of(cls, model: Model) -> Conductor:
        """Return that of a body, made once."""
        entries = model.statement.effects["heat"]
        kept: Conductor | None = model.of_mesh.get("heat")
        if kept is None or kept.entries is not entries:
            kept = model.of_mesh["heat"] = cls(model)
        return kept

    @property
    def owned(self) -> int:
        """How many nodes this rank owns."""
        return int(self.space.dofmap.index_map.size_local)

    def prescribed(self, time: float) -> tuple[Flags, Array, Array]:
        """Which nodes of this rank have a prescribed temperature, what it is, and the number of the
        entry that prescribes it, shape (nodes,).
        """
        x = node_positions(self.space).T
        values = np.zeros(x.shape[1])
        by = np.full(x.shape[1], -1)
        tagged = self.model.tagged
        for number, entry in enumerate(self.entries):
            if entry.temperature is None:
                continue
            if entry.boundary is not None:
                nodes = facet_nodes(self.space, tagged.facets(entry.boundary))
            else:
                nodes = self.space.dofmap.list[tagged.cells(entry.region)]
            held = np.flatnonzero(marked_nodes(self.space, np.asarray(nodes).ravel()))
            if held.size:
                values[held] = sample(entry.at_time(time).temperature, x[:, held])
            by[held] = number
        return by >= 0, values, by

    def _moved_to(self, time: float) -> None:
        """Give values that depend on the time those of a time."""
        self.on.move_to(self.model.path.place_of(time))

    @cached_property
    def _stiffness(self) -> PETSc.Mat:
        return sum_of([self.matrix_form], [])

    def solved(
        self, boundary: ContactBoundary | None, passed: PassedHeat | None, time: float
    ) -> Array:
        """Return the temperature at the nodes, shape (nodes,)."""
        parts = () if passed is None else (passed.conductance, passed.beyond, passed.friction)
        key = np.concatenate([[time], *parts]).tobytes()
        same = self._solved is not None and self._solved[0] == key
        if self._solved is not None and not parallel.any_rank(self.model.comm, not same):
            return self._solved[1]
        self._moved_to(time)
        owned = self.owned
        comm = self.model.comm
        load = np.zeros(owned) if self.load_form is None else assemble(self.load_form)
        matrix = self._stiffness.copy()
        held, values, _ = self.prescribed(time)
        if boundary is not None and passed is not None:
            added = self._coupling(boundary, passed, matrix)
            matrix.axpy(1.0, added, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
            load = load + self._of_contact(boundary, passed, None)
        loose = self._of_pieces(~self._determined(boundary, passed, held))
        rows = np.flatnonzero(held[:owned] | loose)
        first = self.space.dofmap.index_map.local_range[0]
        x, right = matrix.createVecs()
        x.getArray()[:] = np.where(held[:owned], values[:owned], 0.0)
        right.getArray()[:] = load
        matrix.zeroRowsColumns((first + rows).astype(PETSc.IntType), 1.0, x, right)
        ksp = PETSc.KSP().create(comm)
        ksp.setOperators(matrix)
        ksp.setType(PETSc.KSP.Type.PREONLY)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        use_direct(ksp.getPC(), int(self.space.dofmap.index_map.size_global), symmetric=True)
        ksp.solve(right, x)
        self.temperature.x.array[:owned] = x.getArray(readonly=True)
        self.temperature.x.scatter_forward()
        result = np.array(self.temperature.x.array)
        self._solved = key, result
        return result

    def _coupling(
        self, boundary: ContactBoundary, passed: PassedHeat, like: PETSc.Mat
    ) -> PETSc.Mat:
        """B^T w h B."""
        averages = boundary.averages
        shares = sp.csr_array(averages.shares)
        weighted = sp.diags_array(boundary.weight * passed.conductance) @ shares
        product = sp.csr_array(shares.T @ weighted)
        nodes = averages.nodes.astype(PETSc.IntType)
        added = PETSc.Mat().createAIJ(like.getSizes(), comm=self.model.comm)
        added.setUp()
        added.setValuesIJV(
            product.indptr.astype(PETSc.IntType),
            nodes[product.indices],
            product.data,
            addv=PETSc.InsertMode.ADD_VALUES,
            rowmap=nodes,
        )
        added.assemble()
        return added

    def relative(self, boundary: ContactBoundary, values: Array) -> Array:
        """B of values at the nodes of this rank, shape (n,)."""
        averages = boundary.averages
        owned = np.asarray(values)[: self.owned, None]
        return np.asarray(
            averages.shares @ from_owners(owned, averages.nodes, self.model.comm)[:, 0]
        )

    def sides(self, boundary: ContactBoundary) -> tuple[Any, Any]:
        """D and M, sparse, shape (n, m): columns of nodes on the side of the points, and others."""
        averages = boundary.averages
        shares = sp.csr_array(averages.shares)
        own = sp.lil_array(shares.shape)
        for space, facets, number in boundary.surface:
            on_side = marked_nodes(space, facet_nodes(space, facets).ravel())[: self.owned, None]
            slave = from_owners(on_side.astype(np.float64), averages.nodes, self.model.comm)[:, 0]
            rows = sp.diags_array((boundary.part == number).astype(np.float64))
            own = own + rows @ shares @ sp.diags_array(slave)
        return sp.csr_array(own), sp.csr_array(own - shares)

    def _of_contact(
        self, boundary: ContactBoundary, passed: PassedHeat, values: Array | None
    ) -> Array:
        """What contact brings to the owned nodes, power, shape (owned nodes,), at temperatures of
        the nodes of this rank, None: at zero.
        """
        averages = boundary.averages
        weight = boundary.weight
        own, other = self.sides(boundary)
        apart = -passed.beyond
        if values is not None:
            apart = apart + self.relative(boundary, values)
        crossing = passed.conductance * apart
        at_nodes = (
            -averages.shares.T @ (weight * crossing)
            + own.T @ (weight * passed.share * passed.friction)
            + other.T @ (weight * (1.0 - passed.share) * passed.friction)
        )
        return to_owners(
            np.asarray(at_nodes)[:, None], averages.nodes, self.model.comm, self.owned
        )[:, 0]

    def balance(
        self,
        boundary: ContactBoundary | None,
        passed: PassedHeat | None,
        values: Array,
        time: float,
    ) -> tuple[Array, float, float, float]:
        """Return the power that each entry brings, shape (entries,), the largest residual at free
        nodes, by forms of its own, relative to the largest power at a node, what contact takes from
        all bodies, and powers below which there is round-off alone.
        """
        comm = self.model.comm
        self._moved_to(time)
        self.temperature.x.array[:] = values
        resisted = assemble(self.residual_form)
        load = np.zeros(self.owned) if self.load_form is None else assemble(self.load_form)
        residual = resisted - load
        lost = 0.0
        # Of an even temperature all powers are round-off.
        diagonal = self._stiffness.getDiagonal().getArray(readonly=True)
        across = diagonal * np.abs(values[: self.owned])
        least = ROOT_OF_EPS * parallel.largest(comm, across)
        largest = max(np.abs(load).max(initial=0.0), least)
        if boundary is not None and passed is not None:
            contact = self._of_contact(boundary, passed, values)
            residual = residual - contact
            lost = -float(parallel.global_sum(comm, np.array(contact.sum())))
            largest = max(largest, np.abs(contact).max(initial=0.0))
        held, _, by = self.prescribed(time)
        largest = max(largest, np.abs(residual[held[: self.owned]]).max(initial=0.0))
        largest = parallel.global_max(comm, float(largest))
        wrong = parallel.largest(comm, np.abs(residual[~held[: self.owned]]))
        power = np.zeros(len(self.entries))
        on_node = by[: self.owned]
        taken = on_node >= 0
        power += np.bincount(on_node[taken], residual[taken], minlength=power.size)
        given = iter(self.power_forms)
        for number, entry in enumerate(self.entries):
            if entry.temperature is None:
                power[number] = fem.assemble_scalar(next(given))
        total = parallel.global_sum(comm, power)
        return total, wrong / largest if largest else 0.0, lost, least

    # --- what decides a temperature ---

    def _determined(
        self, boundary: ContactBoundary | None, passed: PassedHeat | None, held: Flags
    ) -> Flags:
        """Which pieces of the body have a temperature that something decides, shape (pieces,)."""
        pieces = self.model.pieces
        comm = self.model.comm
        known: Flags = np.zeros(pieces.count, dtype=bool)
        dofs = self.space.dofmap.list
        known[pieces.of_cell[held[dofs].any(axis=1)]] = True
        for entry in self.given:
            if entry.film is not None:
                nodes = facet_nodes(self.space, self.model.tagged.facets(str(entry.boundary)))
                on_film = marked_nodes(self.space, nodes.ravel())
                known[pieces.of_cell[on_film[dofs].any(axis=1)]] = True
        known = parallel.global_sum(comm, known.astype(np.int64)) > 0
        if boundary is None or passed is None:
            return known
        averages = boundary.averages
        piece_of = np.zeros((held.size, 1))
        piece_of[dofs.ravel(), 0] = np.repeat(pieces.of_cell, dofs.shape[1])
        of_node = from_owners(piece_of[: self.owned], averages.nodes, comm)[:, 0].astype(np.int64)
        conducts = passed.conductance * boundary.weight > 0
        linked: Array = np.zeros((pieces.count, pieces.count + 1))
        shares = sp.csr_array(averages.shares)
        for point in np.flatnonzero(conducts):
            touched = np.unique(of_node[shares.indices[slice(*shares.indptr[point : point + 2])]])
            linked[np.ix_(touched, touched)] = 1.0
            if self.model.statement.contact[boundary.part[point]].against is None:
                linked[touched, -1] = 1.0
        linked = parallel.global_sum(comm, linked)
        known = known | (linked[:, -1] > 0)
        for _ in range(pieces.count):
            known = known | (linked[:, :-1][:, known] > 0).any(axis=1)
        return np.asarray(known)

    def _of_pieces(self, chosen: Flags) -> Flags:
        """Which owned nodes are those of some pieces, shape (owned nodes,)."""
        nodes = self.space.dofmap.list[chosen[self.model.pieces.of_cell]]
        return np.asarray(np.isin(np.arange(self.owned), nodes))

    def undetermined(self, boundary: ContactBoundary | None, passed: PassedHeat | None) -> str:
        """Return what has a temperature that nothing decides; "": everything has one."""
        held, _, _ = self.prescribed(self.model.path.time_at(0))
        known = self._determined(boundary, passed, held)
        if known.all():
            return ""
        loose = " and ".join(self.model.pieces.called(piece) for piece in np.flatnonzero(~known))
        return f"the temperature of {loose} is not determined"


@dataclass(frozen=True)
class Conduction(StepEffect):
    """The temperature of bodies in each load step.

    Fields of the state: ``temperature``, at nodes, that of the end; ``heating``, that which strains
    the body, the same up to what a turn may change; ``heat_change``, by how much the last turn has
    changed it; ``heat_turns``: the step, the turns so far, Aitken's factor, that of the turns, and
    how many of them one after the other have grown.
    """

    @classmethod
    def of(cls, entry: Any) -> Self:
        return cls()

    @staticmethod
    def _turns(model: Model) -> bool:
        """Whether contact decides the temperature."""
        return any(
            entry.conductance is not None or entry.friction_heat is not None
            for entry in model.statement.contact
        )

    # --- a step ---

    def initial(self, model: Model | None, state: State) -> State:
        assert model is not None
        if reason := self._undetermined(model):
            cure = "give it one, or a film, or its contact a conductance"
            raise SceneError.at("heat", f"{reason}: {cure}")
        return state

    @staticmethod
    def _undetermined(model: Model) -> str:
        """Whose temperature nothing can decide even where all contact is closed; "": that of
        none; collective.
        """
        boundary = model.boundary
        passed = None
        if boundary is not None:
            joints = [entry.conductance for entry in model.statement.contact]
            conducts = np.array([joint is not None for joint in joints])[boundary.part] * 1.0
            zero = np.zeros(boundary.size)
            passed = PassedHeat(conducts, zero, zero, zero)
        return Conductor.of(model).undetermined(boundary, passed)

    def at_nodes(self, model: Model, state: State, time: float) -> Mapping[str, Array]:
        return {"temperature": self._used(model, state, time)}

    def _used(self, model: Model, state: State, time: float) -> Array:
        """The temperature that strains the body in a step from a state, or that has in one to it,
        shape (nodes,).
        """
        conductor = Conductor.of(model)
        if not self._turns(model):
            return conductor.solved(None, None, time)
        known = state.fields.get("heating")
        if known is not None:
            return known.values.ravel()
        reference = model.statement.material[0].reference_temperature or 0.0
        return np.full(conductor.temperature.x.array.size, reference)

    def _found(self, new: State, ended: StepEnd) -> Array:
        """The temperature that a step leads to, shape (nodes,)."""
        contact = ended.contact
        boundary = None if contact is None else contact.boundary
        conductor = Conductor.of(ended.model)
        return conductor.solved(boundary, self._passed(new, ended), new.time)

    def _passed(self, new: State, ended: StepEnd) -> PassedHeat | None:
        if ended.contact is None or not self._turns(ended.model):
            return None
        return PassedHeat.of(ended.model, ended.contact, new.time, ended.dt)

    def _unsettled(self, new: State, ended: StepEnd) -> tuple[Array, float]:
        """Return the change of the temperature by a turn, shape (nodes,), and the largest one
        relative to the range of temperatures; collective.
        """
        found = self._found(new, ended)
        change = found - self._used(ended.model, new, new.time)
        comm = ended.model.comm
        size = parallel.largest(comm, found) + parallel.largest(comm, -found)
        size = max(size, parallel.largest(comm, np.abs(found)) * _SETTLED)
        return change, parallel.largest(comm, np.abs(change)) / size if size else 0.0

    def repeat(self, state: State, new: State, ended: StepEnd) -> State | None:
        model = ended.model
        if not self._turns(model):
            return None
        change, unsettled = self._unsettled(new, ended)
        if unsettled <= _SETTLED:
            return None
        turns = np.array([new.number, 1.0, 1.0, 0.0, 0.0])
        before = state.fields.get("heat_turns")
        if before is not None and before.values[0] == new.number:
            earlier = state.fields["heat_change"].values.ravel()
            comm = model.comm
            owned = slice(0, Conductor.of(model).owned)
            difference = (change - earlier)[owned]
            along, size, old = parallel.global_sum(
                comm,
                np.array(
                    [
                        earlier[owned] @ difference,
                        difference @ difference,
                        earlier[owned] @ earlier[owned],
                    ]
                ),
            )
            _, count, used, _, growing = before.values
            factor = 1.0 + along / (used * old) if old else 0.0
            growing = growing + 1 if factor >= 1.0 else 0.0
            aitken = -used * along / size if size and factor < 1.0 else 1.0
            turns = np.array([new.number, count + 1, aitken, factor, growing])
        if turns[4] >= _GROWING:
            return None
        fields = {
            **state.fields,
            "heating": Field("nodes", self._used(ended.model, new, new.time) + turns[2] * change),
            "heat_change": Field("nodes", change),
            "heat_turns": Field("global", turns),
        }
        return replace(state, fields=fields)

    def last_begun(self, state: State, new: State) -> State:
        used = new.fields.get("heating")
        return state if used is None else replace(state, fields={**state.fields, "heating": used})

    def after(self, state: State, new: State, ended: StepEnd) -> State:
        new = new.with_field("temperature", "nodes", self._found(new, ended))
        if self._turns(ended.model):
            new = new.with_field("heating", "nodes", self._used(ended.model, new, new.time))
        contact, passed = ended.contact, self._passed(new, ended)
        if contact is not None and passed is not None:
            jump = self._jump(new, ended, passed)
            new = new.with_field("temperature_jump", "points", jump)
            new = new.with_field("heat_flux", "points", passed.conductance * jump)
        return replace(
            new, fields={name: one for name, one in new.fields.items() if name != "heat_change"}
        )

    def outcome(self, state: State, new: State, ended: StepEnd) -> tuple[Status, Finding] | None:
        model = ended.model
        conductor = Conductor.of(model)
        passed = self._passed(new, ended)
        boundary = None if ended.contact is None else ended.contact.boundary
        if reason := conductor.undetermined(boundary, passed):
            reason = f"{reason} while its contact is open"
            return Status.RUNS_AWAY, Finding("warning", "heat", reason)
        _, unsettled = self._unsettled(new, ended)
        if self._turns(model) and unsettled > _SETTLED:
            turns = new.fields.get("heat_turns")
            growing = 0.0 if turns is None else turns.values[3]
            if growing >= 1.0:
                reason = f"a turn of contact and heat multiplies a change by {growing:.3g}"
                return Status.RUNS_AWAY, Finding("warning", "heat", reason)
            reason = f"a turn still changes temperatures by {unsettled:.1g} of their range"
            cure = "take shorter load steps"
            return Status.OUTER_MAX_ITERATIONS, Finding("warning", "heat", f"{reason}: {cure}")
        wrong = self._balance(new, ended)[1]
        if wrong > CERTIFICATE_TOLERANCE:
            reason = f"heat is not in balance: {wrong:.1g} of the largest at a node is left"
            return Status.NOT_CERTIFIED, Finding("warning", "heat", reason)
        return None

    # --- what is told ---

    def _balance(self, new: State, ended: StepEnd) -> tuple[Array, float, float, float]:
        contact = ended.contact
        boundary = None if contact is None else contact.boundary
        values = new.fields["temperature"].values.ravel()
        passed = self._passed(new, ended)
        return Conductor.of(ended.model).balance(boundary, passed, values, new.time)

    def figures(self, state: State, new: State, ended: StepEnd) -> Mapping[str, float]:
        """Return what comes in, what goes out, what passes contact, heat of friction, powers, the
        residual at nodes, the balance, the turns and their factor.
        """
        power, wrong, lost, least = self._balance(new, ended)
        comm = ended.model.comm
        into = float(power[power > 0].sum())
        out = -float(power[power < 0].sum())
        through = rubbed = 0.0
        contact = ended.contact
        passed = self._passed(new, ended)
        if contact is not None and passed is not None:
            flux = contact.boundary.weight * passed.conductance * self._jump(new, ended, passed)
            heated = contact.boundary.weight @ passed.friction
            through, rubbed = map(
                float, parallel.global_sum(comm, np.array([np.abs(flux).sum(), heated]))
            )
        size = max(into, out, abs(lost), rubbed, least)
        figures = {
            "heat_in": into,
            "heat_out": out,
            "heat_through": through,
            "friction_heat": rubbed,
            "heat_balance": (into - out - lost) / size if size else 0.0,
            "heat_error": wrong,
            "hottest": parallel.largest(comm, new.fields["temperature"].values),
        }
        turns = new.fields.get("heat_turns")
        if turns is not None and turns.values[0] == new.number:
            figures |= {"heat_turns": float(turns.values[1]), "heat_factor": float(turns.values[3])}
        return figures

    def _jump(self, new: State, ended: StepEnd, passed: PassedHeat) -> Array:
        """The temperature of the side of the points less that of the other one, shape (n,)."""
        assert ended.contact is not None
        values = new.fields["temperature"].values.ravel()
        apart = Conductor.of(ended.model).relative(ended.contact.boundary, values)
        return apart - passed.beyond

    def columns(self, new: State) -> Mapping[str, Array]:
        names = ("temperature_jump", "heat_flux")
        return {name: new.fields[name].values.ravel() for name in names if name in new.fields}

    def findings(self, model: Model) -> Iterator[Finding]:
        if reason := self._undetermined(model):
            yield Finding("warning", "heat", reason)
        if self._turns(model):
            text = "heat and contact depend on each other: each load step is solved in turns"
            yield Finding("note", "heat", text)

    def told(self, new: State, ended: StepEnd, figures: Mapping[str, float]) -> Iterator[Finding]:
        text = f"{figures['heat_in']:.4g} in, {figures['heat_out']:.4g} out"
        if figures["friction_heat"]:
            text += f", {figures['friction_heat']:.4g} by friction"
        if figures["heat_through"]:
            text += f", {figures['heat_through']:.4g} through contact"
        text += f"; balance {abs(figures['heat_balance']):.1g}; hottest {figures['hottest']:.4g}"
        if "heat_turns" in figures:
            text += f"; {figures['heat_turns']:.0f} turns, factor {figures['heat_factor']:.2g}"
        yield Finding("note", "heat", text)
        jumps = new.fields.get("temperature_jump")
        if jumps is None or ended.contact is None:
            return
        boundary = ended.contact.boundary
        for number, entry in enumerate(ended.model.statement.contact):
            if entry.conductance is None:
                continue
            own = jumps.values.ravel()[boundary.part == number]
            least = -parallel.largest(boundary.comm, -own, -np.inf)
            most = parallel.largest(boundary.comm, own, -np.inf)
            text = f"temperatures of both sides differ by {least:.4g} to {most:.4g}"
            yield Finding("note", f"contact[{number}].conductance", text)
