"""Heat conduction in bodies and through their contact, from load step to load step: steady, or by
the implicit Euler rule where materials have a specific heat.

B maps nodal temperatures to the jump at contact points, one side minus the other; D and M are its
parts on the two sides, and w the weights of the points:

    C (T - T_0) / dt + K T + B^T w h (B T - T_f) = f + D^T w b q + M^T w (1 - b) q,
    q = share of mu . xi / dt.

T_0 is the temperature at the beginning of the step, h(pressure, gap) the conductance, T_f the
temperature of foundations, b the share of one side in the friction heat q.  Rows of D and M have
the sum one: what one side loses the other gains.

Temperatures strain the body, and contact determines h and q, so a step is solved in turns until
both agree, accelerated by Aitken's factor.  A turn multiplies a change of the temperature by a
factor that is a property of the problem: where it is one or more no steady temperature is stable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc
from scipy.sparse.csgraph import connected_components

from signorini_fx.algebra.linalg.factorisation import use_direct
from signorini_fx.arrays import Array, Expr, Flags, Ints
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import (
    assemble,
    compile_form,
    facet_nodes,
    marked_nodes,
    node_positions,
)
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.scalar_map import ScalarMap
from signorini_fx.mechanics.effects.heat import Heat, InitialTemperature
from signorini_fx.mechanics.loads.load_vectors import FormCoefficients, measures
from signorini_fx.mechanics.model import Model, sum_of
from signorini_fx.mechanics.state import Field, State
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.step_effect import StepEffect, StepEnd
from signorini_fx.records import Finding, Status
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, ROOT_OF_EPS

_SETTLED = 1e-10  # change of temperatures in the last turn, relative to their range
# Fields of the state at contact points: the temperatures of both sides, and the heat flux from the
# first to the second.
_AT_POINTS = ("temperature_slave", "temperature_master", "heat_flux")
# h^2 / (diffusivity * dt) above which temperatures next to a heated node undershoot.
_PASSING = 6.0
_GROWING = 3  # turns in a row with a growing change, after which a step is given up


# The nodal temperature at the beginning of a step, and the duration of the step.
Before = tuple[Array, float]


class Balance(NamedTuple):
    """The heat balance of a step.

    It has the power of each entry into the body, shape (entries,); the largest residual at free
    nodes, relative to the largest power at a node; the power that contact takes from all bodies;
    the power that they store; and the round-off of these powers.
    """

    power: Array
    residual: float
    lost: float
    stored: float
    least: float


@dataclass(frozen=True)
class PassedHeat:
    """Heat transfer at the n contact points of this rank.

    Attributes:
        conductance: h, power per area and temperature, shape (n,).
        beyond: the temperature of foundations, zero between two bodies, shape (n,).
        friction: friction heat, power per area, shape (n,).
        share: fraction of the friction heat that goes to the side with the points, shape (n,).
        map: from nodal temperatures to temperature jumps at the points.
    """

    conductance: Array
    beyond: Array
    friction: Array
    share: Array
    map: ScalarMap

    @classmethod
    def of(cls, model: Model, contact: ContactState, time: float, dt: float) -> Self:
        """Return the heat transfer of a contact state.

        Args:
            model: the body.
            contact: its contact state at the end of a step.
            time: the end of the step.
            dt: its duration.
        """
        part = contact.boundary.part
        conductance, beyond, friction, share = (np.zeros(part.size) for _ in range(4))
        pressure = np.maximum(contact.pressure, 0.0)
        gap = np.maximum(contact.gap - contact.u_n, 0.0)
        closed = contact.in_contact | contact.bilateral
        for number, entry in enumerate(model.contacts):
            on = part == number
            if (joint := entry.conductance) is not None:
                conductance[on] = joint.of(pressure[on], gap[on], closed[on])
                if joint.temperature is not None:
                    at_time = joint.at_time(time).temperature
                    beyond[on] = sample(at_time, in_space(contact.boundary.x[on]))
            if (heated := entry.friction_heat) is not None:
                friction[on] = heated.fraction * contact.friction_energy[on] / dt
                share[on] = heated.share
        to_points = ScalarMap(contact.boundary, Conductor.of(model).space)
        return cls(conductance, beyond, friction, share, to_points)

    def jump(self, values: Array) -> Array:
        """Return the temperature of the side with the points minus that of the other side or the
        foundation, shape (n,); collective.

        Args:
            values: temperatures at the nodes of this rank.
        """
        return self.map.of(values) - self.beyond

    def at_nodes(self, values: Array | None) -> Array:
        """Return the power that contact brings to the owned nodes, shape (owned nodes,);
        collective.

        Args:
            values: temperatures at the nodes of this rank; None: zero.
        """
        apart = -self.beyond if values is None else self.jump(values)
        other = (1.0 - self.share) * self.friction
        of_friction = self.map.vector(self.friction, self.map.side)
        return of_friction - self.map.vector(other + self.conductance * apart)


class Conductor:
    """The heat conduction problem of a body: its forms and the map to its contact points.

    The coefficients of the forms are those at the time of ``on``.  All methods are collective.
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
        self.stores = any(one.specific_heat is not None for one in model.materials)
        self.temperature = fem.Function(self.space)
        self.rate = fem.Function(self.space)
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

        def inside(value: Expr) -> ufl.Form:
            return conductivity * ufl.inner(ufl.grad(value), ufl.grad(test)) * around * dx

        def resisting(value: Expr) -> ufl.Form:
            """Return the form of conduction and films."""
            films = (
                on.value(entry.film) * value * test * around * d
                for entry, d in zip(self.given, places, strict=True)
                if entry.film is not None
            )
            return sum(films, inside(value))

        def brought(entry: Heat, film: Expr) -> Expr:
            """Return the power per area or volume that an entry brings, if the temperature at its
            film is ``film``.
            """
            if entry.film is not None:
                return on.value(entry.film) * (on.value(entry.ambient) - film)
            return on.value_in(entry.region, entry.flux if entry.source is None else entry.source)

        def storing(value: Expr) -> ufl.Form:
            capacity = on.density * on.of_material("specific_heat")
            return capacity * value * test * around * dx

        self.matrix_form = compile_form(resisting(trial))
        self.residual_form = compile_form(resisting(self.temperature))
        if self.stores:
            self.capacity_form = compile_form(storing(trial))
            self.storing_form = compile_form(storing(self.rate))
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
        """Return the conduction problem of a body; it is made once and kept."""
        entries = model.statement.effects["heat"]
        kept: Conductor | None = model.of_mesh.get("heat")
        if kept is None or kept.entries is not entries:
            kept = model.of_mesh["heat"] = cls(model)
        return kept

    @property
    def owned(self) -> int:
        """The number of nodes that this rank owns."""
        return int(self.space.dofmap.index_map.size_local)

    def nodes_of(self, entry: Heat | InitialTemperature) -> Ints:
        """Return the nodes of this rank on the boundary of an entry or in its region;
        collective.
        """
        if entry.where is not None:
            nodes = facet_nodes(self.space, self.model.tagged.facets(entry.where))
        else:
            nodes = self.space.dofmap.list[self.model.tagged.cells(entry.region)]
        return np.flatnonzero(marked_nodes(self.space, np.asarray(nodes).ravel()))

    def prescribed(self, time: float) -> tuple[Array, Ints]:
        """Return the prescribed temperatures at the nodes of this rank, and the number of the entry
        that prescribes each, -1 where none does, both of shape (nodes,); collective.
        """
        x = node_positions(self.space).T
        values = np.zeros(x.shape[1])
        by = np.full(x.shape[1], -1)
        for number, entry in enumerate(self.entries):
            if entry.temperature is not None:
                held = self.nodes_of(entry)
                values[held] = sample(entry.at_time(time).temperature, x[:, held])
                by[held] = number
        return values, by

    def first(self) -> Array:
        """Return the temperature before the first step at the nodes of this rank, shape (nodes,);
        collective.
        """
        x = node_positions(self.space).T
        values = np.zeros(x.shape[1])
        statement = self.model.statement
        for entry in (*statement.material, *statement.effects.get("initial_temperature", ())):
            nodes = self.nodes_of(entry)
            given = getattr(entry, "temperature", getattr(entry, "reference_temperature", 0.0))
            values[nodes] = sample(given or 0.0, x[:, nodes])
        return values

    @cached_property
    def _stiffness(self) -> PETSc.Mat:
        return sum_of([self.matrix_form], [])

    @cached_property
    def _capacity(self) -> PETSc.Mat:
        return sum_of([self.capacity_form], [])

    def solved(self, passed: PassedHeat | None, time: float, before: Before | None) -> Array:
        """Return the temperature at the end of a step at the nodes of this rank, shape (nodes,).

        Args:
            passed: heat transfer of the contact; None: there is none.
            time: the end of the step.
            before: temperature at its beginning, and its duration; None: a steady temperature.
        """
        parts = () if passed is None else (passed.conductance, passed.beyond, passed.friction)
        key = np.concatenate([[time], *parts, *(before or ())], axis=None).tobytes()
        same = self._solved is not None and self._solved[0] == key
        if self._solved is not None and not parallel.any_rank(self.model.comm, not same):
            return self._solved[1]
        self.on.set_time(time)
        owned = self.owned
        load = np.zeros(owned) if self.load_form is None else assemble(self.load_form)
        matrix = self._stiffness.copy()
        pattern = PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN
        values, by = self.prescribed(time)
        held = by >= 0
        x, right = matrix.createVecs()
        if before is not None:
            earlier, dt = before
            matrix.axpy(1.0 / dt, self._capacity, structure=pattern)
            x.getArray()[:] = earlier[:owned] / dt
            self._capacity.mult(x, right)
            load = load + right.getArray(readonly=True)
        if passed is not None:
            matrix.axpy(1.0, passed.map.matrix(passed.conductance), structure=pattern)
            load = load + passed.at_nodes(None)
        loose = self._of_pieces(~self._determined(passed, held))
        rows = np.flatnonzero(held[:owned] | loose)
        first = self.space.dofmap.index_map.local_range[0]
        x.getArray()[:] = np.where(held[:owned], values[:owned], 0.0)
        right.getArray()[:] = load
        matrix.zeroRowsColumns((first + rows).astype(PETSc.IntType), 1.0, x, right)
        ksp = PETSc.KSP().create(self.model.comm)
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

    def balance(
        self, passed: PassedHeat | None, values: Array, time: float, before: Before | None
    ) -> Balance:
        """Return the heat balance of temperatures, recomputed from forms of its own; collective.

        Args:
            passed: see ``solved``.
            values: the temperatures at the nodes of this rank.
            time: see ``solved``.
            before: see ``solved``.
        """
        comm = self.model.comm
        self.on.set_time(time)
        self.temperature.x.array[:] = values
        residual = assemble(self.residual_form)
        # If the temperature is uniform all powers are round-off: compare with ``least``.
        diagonal = self._stiffness.getDiagonal().getArray(readonly=True)
        across = diagonal * np.abs(values[: self.owned])
        least = ROOT_OF_EPS * parallel.largest(comm, across)
        acting = [] if self.load_form is None else [assemble(self.load_form)]
        lost = stored = 0.0
        if passed is not None:
            acting.append(passed.at_nodes(values))
            lost = -float(parallel.global_sum(comm, np.array(acting[-1].sum())))
        if before is not None:
            self.rate.x.array[:] = (values - before[0]) / before[1]
            acting.append(-assemble(self.storing_form))
            stored = -float(parallel.global_sum(comm, np.array(acting[-1].sum())))
        for each in acting:
            residual = residual - each
        on_node = self.prescribed(time)[1][: self.owned]
        taken = on_node >= 0
        powers = [*(np.abs(each) for each in acting), np.abs(residual[taken])]
        largest = max(least, *(parallel.largest(comm, each) for each in powers))
        wrong = parallel.largest(comm, np.abs(residual[~taken]))
        power = np.zeros(len(self.entries))
        power += np.bincount(on_node[taken], residual[taken], minlength=len(self.entries))
        given = iter(self.power_forms)
        for number, entry in enumerate(self.entries):
            if entry.temperature is None:
                power[number] = fem.assemble_scalar(next(given))
        total = parallel.global_sum(comm, power)
        return Balance(total, wrong / largest if largest else 0.0, lost, stored, least)

    # --- what decides a temperature ---

    def _determined(self, passed: PassedHeat | None, held: Flags) -> Flags:
        """Return which pieces of the body have a unique temperature, shape (pieces,); collective.

        A piece has one if it stores heat, or if a chain of conducting contacts links it to a
        prescribed temperature, a film or a foundation of given temperature.
        """
        pieces = self.model.pieces
        if self.stores:
            return np.ones(pieces.count, dtype=bool)
        dofs = self.space.dofmap.list
        for entry in self.given:
            if entry.film is not None:
                held = held | np.isin(np.arange(held.size), self.nodes_of(entry))
        linked: Array = np.zeros((pieces.count + 1,) * 2)  # the last row: known temperatures
        linked[pieces.of_cell[held[dofs].any(axis=1)], -1] = 1.0
        if passed is not None:
            boundary = passed.map.boundary
            piece_of = np.zeros(held.size)
            piece_of[dofs.ravel()] = np.repeat(pieces.of_cell, dofs.shape[1])
            of_node = passed.map.received(piece_of).astype(np.int64)
            shares = passed.map.rows
            contacts = self.model.contacts
            for point in np.flatnonzero(passed.conductance * boundary.weight > 0):
                touched = of_node[shares.indices[slice(*shares.indptr[point : point + 2])]]
                if contacts[boundary.part[point]].against is None:
                    touched = np.append(touched, -1)
                linked[np.ix_(touched, touched)] = 1.0
        _, part = connected_components(parallel.global_sum(self.model.comm, linked), directed=False)
        return np.asarray(part[:-1] == part[-1])

    def _of_pieces(self, chosen: Flags) -> Flags:
        """Return which owned nodes belong to the chosen pieces, shape (owned nodes,)."""
        nodes = self.space.dofmap.list[chosen[self.model.pieces.of_cell]]
        return np.asarray(np.isin(np.arange(self.owned), nodes))

    def undetermined(self, passed: PassedHeat | None) -> str:
        """Return a message that names the pieces without a unique temperature; "" if there are
        none.
        """
        _, by = self.prescribed(self.model.path.time_at(0))
        known = self._determined(passed, by >= 0)
        if known.all():
            return ""
        loose = " and ".join(self.model.pieces.called(piece) for piece in np.flatnonzero(~known))
        return f"the temperature of {loose} is not determined"


def _temperature(model: Model, state: State, name: str = "temperature") -> Array:
    """Return a temperature field of a state; that before the first step if the state has no such
    field, shape (nodes,); collective.

    Args:
        model: the body.
        state: the state.
        name: of the field.
    """
    known = state.fields.get(name)
    return Conductor.of(model).first() if known is None else known.values.ravel()


def _used(model: Model, state: State) -> Array:
    """Return the temperature that strains the body in the next turn of a step from a state, shape
    (nodes,).
    """
    return _temperature(model, state, "heating" if "heating" in state.fields else "temperature")


def _before(model: Model, state: State, time: float) -> Before | None:
    """Return the temperature at the beginning of the step from a state to a time, and its duration;
    None if the step is steady.
    """
    if not Conductor.of(model).stores:
        return None
    return _temperature(model, state), time - state.time


@dataclass(frozen=True)
class Conduction(StepEffect):
    """The temperature of bodies in each load step.

    Fields of the state: ``temperature``, at nodes, at the end of the step; ``heating``, the
    temperature that strains the body, equal to it up to the tolerance of the turns;
    ``heat_change``, the change of temperature in the last turn; ``heat_turns``: the number of the
    step, the turns so far, Aitken's factor, the factor by which a turn multiplies a change, and how
    many turns in a row it has been one or more.
    """

    @classmethod
    def of(cls, entry: Any) -> Self:
        return cls()

    @staticmethod
    def _turns(model: Model) -> bool:
        """Return whether contact influences the temperature, so that a step is solved in turns."""
        return any(
            entry.conductance is not None or entry.friction_heat is not None
            for entry in model.contacts
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
        """Return a message that names the pieces without a unique temperature even if all contact
        is closed; "" if there are none; collective.
        """
        boundary = model.boundary
        passed = None
        if boundary is not None:
            joints = [entry.conductance for entry in model.contacts]
            conducts = np.array([joint is not None for joint in joints])[boundary.part] * 1.0
            zero = np.zeros(boundary.size)
            to_points = ScalarMap(boundary, Conductor.of(model).space)
            passed = PassedHeat(conducts, zero, zero, zero, to_points)
        return Conductor.of(model).undetermined(passed)

    def at_nodes(self, model: Model, state: State, time: float) -> Mapping[str, Array]:
        if self._turns(model):
            return {"temperature": _used(model, state)}
        return {"temperature": Conductor.of(model).solved(None, time, _before(model, state, time))}

    def _found(self, state: State, new: State, ended: StepEnd) -> Array:
        """Return the temperature at the end of a step for its contact state, shape (nodes,)."""
        before = _before(ended.model, state, new.time)
        return Conductor.of(ended.model).solved(self._passed(new, ended), new.time, before)

    def _passed(self, new: State, ended: StepEnd) -> PassedHeat | None:
        if ended.contact is None or not self._turns(ended.model):
            return None
        return PassedHeat.of(ended.model, ended.contact, new.time, ended.dt)

    def _unsettled(self, state: State, new: State, ended: StepEnd) -> tuple[Array, float]:
        """Return the change of the temperature in a turn, shape (nodes,), and its largest value
        relative to the range of temperatures; collective.
        """
        found = self._found(state, new, ended)
        change = found - _used(ended.model, state)
        comm = ended.model.comm
        size = parallel.largest(comm, found) + parallel.largest(comm, -found)
        size = max(size, parallel.largest(comm, np.abs(found)) * _SETTLED)
        return change, parallel.largest(comm, np.abs(change)) / size if size else 0.0

    def repeat(self, state: State, new: State, ended: StepEnd) -> State | None:
        model = ended.model
        if not self._turns(model):
            return None
        change, unsettled = self._unsettled(state, new, ended)
        if unsettled <= _SETTLED:
            return None
        turns = np.array([new.number, 1.0, 1.0, 0.0, 0.0])
        before = state.fields.get("heat_turns")
        if before is not None and before.values[0] == new.number:
            earlier = state.fields["heat_change"].values.ravel()
            owned = slice(0, Conductor.of(model).owned)
            difference = (change - earlier)[owned]
            products = (
                np.array([difference, earlier[owned]]) @ np.array([earlier[owned], difference]).T
            )
            (along, size), (old, _) = parallel.global_sum(model.comm, products)
            _, count, used, _, growing = before.values
            factor = 1.0 + along / (used * old) if old else 0.0
            growing = growing + 1 if factor >= 1.0 else 0.0
            aitken = -used * along / size if size and factor < 1.0 else 1.0
            turns = np.array([new.number, count + 1, aitken, factor, growing])
        if turns[4] >= _GROWING:
            return None
        fields = {
            **state.fields,
            "heating": Field("nodes", _used(model, state) + turns[2] * change),
            "heat_change": Field("nodes", change),
            "heat_turns": Field("global", turns),
        }
        return replace(state, fields=fields)

    def last_begun(self, state: State, new: State) -> State:
        used = new.fields.get("heating")
        return state if used is None else replace(state, fields={**state.fields, "heating": used})

    def after(self, state: State, new: State, ended: StepEnd) -> State:
        found = self._found(state, new, ended)
        new = new.with_field("temperature", "nodes", found)
        if self._turns(ended.model):
            new = new.with_field("heating", "nodes", _used(ended.model, state))
        if (passed := self._passed(new, ended)) is not None:
            jump = passed.jump(found)
            own = passed.map.of(found, passed.map.side)
            values = own, own - jump, passed.conductance * jump
            for name, each in zip(_AT_POINTS, values, strict=True):
                new = new.with_field(name, "points", each)
        return replace(
            new, fields={name: one for name, one in new.fields.items() if name != "heat_change"}
        )

    def outcome(self, state: State, new: State, ended: StepEnd) -> tuple[Status, Finding] | None:
        model = ended.model
        conductor = Conductor.of(model)
        if reason := conductor.undetermined(self._passed(new, ended)):
            reason = f"{reason} while its contact is open"
            return Status.RUNS_AWAY, Finding("warning", "heat", reason)
        _, unsettled = self._unsettled(state, new, ended)
        if self._turns(model) and unsettled > _SETTLED:
            turns = new.fields.get("heat_turns")
            growing = 0.0 if turns is None else turns.values[3]
            cure = "take shorter load steps"
            if growing >= 1.0:
                reason = f"each repetition of contact and heat multiplies a change by {growing:.3g}"
                reason += f": {cure}" * conductor.stores
                return Status.RUNS_AWAY, Finding("warning", "heat", reason)
            reason = f"a turn still changes temperatures by {unsettled:.1g} of their range"
            return Status.OUTER_MAX_ITERATIONS, Finding("warning", "heat", f"{reason}: {cure}")
        wrong = self._balance(state, new, ended).residual
        if wrong > CERTIFICATE_TOLERANCE:
            reason = f"heat is not in balance: {wrong:.1g} of the largest at a node is left"
            return Status.NOT_CERTIFIED, Finding("warning", "heat", reason)
        return None

    # --- what is told ---

    def _balance(self, state: State, new: State, ended: StepEnd) -> Balance:
        values = new.fields["temperature"].values.ravel()
        before = _before(ended.model, state, new.time)
        return Conductor.of(ended.model).balance(self._passed(new, ended), values, new.time, before)

    def figures(self, state: State, new: State, ended: StepEnd) -> Mapping[str, float]:
        """Return the numbers to report: power in, out, stored, through contact and of friction, the
        errors of the balance, the largest temperature, the number of turns and their factor.
        """
        balance = self._balance(state, new, ended)
        comm = ended.model.comm
        into = float(balance.power[balance.power > 0].sum())
        out = -float(balance.power[balance.power < 0].sum())
        through = rubbed = 0.0
        if (passed := self._passed(new, ended)) is not None:
            each = np.abs(new.fields["heat_flux"].values.ravel()), passed.friction
            through, rubbed = parallel.global_sum(comm, np.array(each) @ passed.map.weight)
        left = balance.lost + balance.stored
        size = max(into, out, abs(balance.lost), abs(balance.stored), rubbed, balance.least)
        figures = {
            "heat_in": into,
            "heat_out": out,
            "heat_stored": balance.stored,
            "heat_through": float(through),
            "friction_heat": float(rubbed),
            "heat_balance": (into - out - left) / size if size else 0.0,
            "heat_error": balance.residual,
            "hottest": parallel.largest(comm, new.fields["temperature"].values),
        }
        turns = new.fields.get("heat_turns")
        if turns is not None and turns.values[0] == new.number:
            figures |= {"heat_turns": float(turns.values[1]), "heat_factor": float(turns.values[3])}
        return figures

    def columns(self, new: State) -> Mapping[str, Array]:
        return {name: new.fields[name].values.ravel() for name in _AT_POINTS if name in new.fields}

    def findings(self, model: Model) -> Iterator[Finding]:
        if reason := self._undetermined(model):
            yield Finding("warning", "heat", reason)
        if self._turns(model):
            text = "heat and contact depend on each other: each load step is solved in turns"
            yield Finding("note", "heat", text)
        if Conductor.of(model).stores:
            slowest = max(
                one.density * one.specific_heat / one.conductivity for one in model.materials
            )
            mesh = model.tagged.mesh
            sizes = mesh.h(mesh.topology.dim, model.tagged.cells(None))
            passing = slowest * parallel.largest(model.comm, sizes) ** 2 / _PASSING
            shortest = min(np.diff(model.path.times, prepend=0.0))
            if shortest < passing:
                text = f"steps of {shortest:.3g} are shorter than heat takes through a cell, "
                text += f"{passing:.3g}: where it comes suddenly others are colder than they began"
                yield Finding("note", "heat", text)

    def told(self, new: State, ended: StepEnd, figures: Mapping[str, float]) -> Iterator[Finding]:
        text = f"{figures['heat_in']:.4g} in, {figures['heat_out']:.4g} out"
        if figures["heat_stored"]:
            text += f", {figures['heat_stored']:.4g} stay"
        if figures["friction_heat"]:
            text += f", {figures['friction_heat']:.4g} by friction"
        if figures["heat_through"]:
            text += f", {figures['heat_through']:.4g} through contact"
        text += f"; balance {abs(figures['heat_balance']):.1g}; hottest {figures['hottest']:.4g}"
        if "heat_turns" in figures:
            text += f"; {figures['heat_turns']:.0f} turns, factor {figures['heat_factor']:.2g}"
        yield Finding("note", "heat", text)
        columns = self.columns(new)
        if not columns or ended.contact is None:
            return
        jumps = columns["temperature_slave"] - columns["temperature_master"]
        boundary = ended.contact.boundary
        for number, entry in enumerate(ended.model.contacts):
            if entry.conductance is None:
                continue
            own = jumps[boundary.part == number]
            least = -parallel.largest(boundary.comm, -own, -np.inf)
            most = parallel.largest(boundary.comm, own, -np.inf)
            text = f"sides of {entry.boundary} differ by {least:.4g} to {most:.4g}"
            yield Finding("note", "heat", text)
