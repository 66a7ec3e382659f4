"""The aerodynamic database: from channels through variables and tables to the six coefficients.

A coefficient is a sum of terms, each an expression on one axis. Increments identified from flights
add to the sum. Checks of the definitions are in `definitions`; standard errors and places in
`evaluation`; file formats in `aerodb.exchange`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.nomenclature import AXES, FORCE_AXES, in_order
from aerodb.support import Array, counted
from aerodb.tables.definitions import (
    CONSTANTS,
    LIFT_INCREMENTS,
    check_axis,
    check_definitions,
    check_increment_axis,
    check_input,
    check_parameters,
    check_states,
    check_uncertainties,
    value_of,
)
from aerodb.tables.expression import Expression
from aerodb.tables.functions import Value
from aerodb.tables.increment import Increment
from aerodb.tables.loads import LOAD_AXES, load_shares
from aerodb.tables.parameter import Parameter
from aerodb.tables.prediction import BLOCK, Prediction, blocks, joined, length_of
from aerodb.tables.program import AnyTable, Program, compile_program
from aerodb.tables.rate_state import Rate, along_flight, steady_values
from aerodb.tables.reference import HAT_RATES, WIND_AXES, ReferenceGeometry, hat_rate, wind_to_body
from aerodb.tables.scattered import ScatteredTable
from aerodb.tables.state_model import StateModel
from aerodb.tables.table import Table
from aerodb.tables.uncertainty import Uncertainty

#: Kind of all parts of a database that is no vehicle's -> its line of versions.
LINES: Final = {"leg": "friction", "wake": "wake"}


@dataclass(frozen=True)
class Variable:
    """A named expression that terms and other variables use.

    Parameters
    ----------
    unit : as the source states it; "1" where it states none.
    declared : further attributes from the source, as text: DAVE-ML's id, name, sign, symbol, role.
    uncertainty : declared by the source; None where there is none.
    parameter : where flight can correct it; its expression is then a number. None otherwise.
    part : the part that it was made of (`AeroDatabase.parts`); empty where it is written itself.
    """

    expression: Expression
    unit: str = "1"
    description: str = ""
    declared: Mapping[str, str] = field(default_factory=dict)
    uncertainty: Uncertainty | None = None
    parameter: Parameter | None = None
    part: str = ""


@dataclass(frozen=True)
class Term:
    """One additive contribution to a coefficient or a load.

    axis : CX CY CZ Cl Cm Cn on body axes, or C_drag C_side C_lift on wind axes; or Ch_<surface>,
        a hinge moment; or a load, FX FY FZ [N] or MX MY MZ [N m] on body axes about the moment
        reference (`aerodb.tables.loads`).
    part : as of a variable.
    """

    name: str
    axis: str
    expression: Expression
    description: str = ""
    part: str = ""


@dataclass(frozen=True, eq=False)
class AeroDatabase:
    """The aerodynamic database of one vehicle.

    Names in expressions are resolved in this order:

    1. `variables`;
    2. the constants S_ref [m2], c_ref, b_ref [m];
    3. `free_inputs` (name -> description): quantities of the source that are no channel here;
    4. `C_lift_increments`: the sum of `increments` on C_lift;
    5. channels of `aerodb.nomenclature`. The dimensionless rates p_hat q_hat r_hat alphadot_hat
       are computed from p q r alphadot, V and this database's own lengths unless they are given.

    A channel that one of `states` computes has its steady value unless it is given;
    `states_along` integrates it along a flight. So has a state with a rate expression: the value at
    which the rate is zero.

    `parts` are entries as written; their variables and terms are among `variables` and `terms`.

    Raises InputError for an unknown name, table or axis (with the nearest valid one), a wrong
    number of table arguments, and variables that are defined by each other.
    """

    name: str
    reference: ReferenceGeometry
    variables: Mapping[str, Variable] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)
    terms: tuple[Term, ...] = ()
    increments: tuple[Increment, ...] = ()
    free_inputs: Mapping[str, str] = field(default_factory=dict)
    description: str = ""
    source: str = ""
    scattered: Mapping[str, ScatteredTable] = field(default_factory=dict)
    states: tuple[StateModel, ...] = ()
    parts: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "states", tuple(self.states))
        object.__setattr__(self, "terms", tuple(self.terms))
        object.__setattr__(self, "increments", tuple(self.increments))
        check_definitions(
            self.name,
            {
                name: "variable" if each.parameter is None else "parameter"
                for name, each in self.variables.items()
            },
            [*self.tables.items(), *self.scattered.items()],
            self.free_inputs,
        )
        check_states(self.name, self.states, self.free_inputs)
        check_parameters(
            self.name,
            {
                name: (variable.expression, variable.parameter, variable.uncertainty)
                for name, variable in self.variables.items()
                if variable.parameter is not None
            },
        )
        check_uncertainties(
            self.name,
            {name: variable.uncertainty for name, variable in self.variables.items()},
            [*self.tables.values(), *self.scattered.values()],
        )
        for axis in self._axes:
            check_axis(axis, self.name)
        for increment in self.increments:
            check_increment_axis(increment.axis, self.name)
        if self.reference.pressure is not None and self.on_wind_axes:
            raise InputError(
                "terms on wind axes over a constant reference pressure",
                f"database {self.name}",
                "give them on body axes: at V = 0 the wind has none",
            )
        names = [term.name for term in self.terms]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise InputError(
                f"term '{repeated[0]}' is defined twice",
                f"database {self.name}",
                "give each term its own name",
            )
        try:
            everything = [v.expression for v in self.variables.values()] + [
                term.expression for term in self.terms
            ]
            used = set(self._compile(everything).inputs)
        except InputError as error:
            raise InputError(error.what, f"database {self.name}", error.remedy) from None
        used |= self._names_of_rates()
        for name in sorted(used.union(*(increment.names for increment in self.increments))):
            check_input(name, self.name, self.variables, self.free_inputs)

    def _compile(self, expressions: Iterable[Expression]) -> Program:
        definitions = {name: variable.expression for name, variable in self.variables.items()}
        return self.compiled(expressions, definitions, {**self.tables, **self.scattered})

    def compiled(
        self,
        expressions: Iterable[Expression],
        variables: Mapping[str, Expression],
        tables: Mapping[str, AnyTable],
    ) -> Program:
        """Compile `expressions` with this database's reference lengths and the given variables and
        tables in place of its own.

        Reference lengths are in metres.
        """
        constants = {
            name: float(getattr(self.reference, attribute)) for name, attribute in CONSTANTS.items()
        }
        return compile_program(expressions, tables, variables, constants)

    @cached_property
    def line(self) -> str:
        """What it is of, where that is no vehicle: ``friction`` for legs alone, ``wake`` for the
        wake of another aircraft. Empty for aerodynamics, and for the constant reference pressure of
        a vehicle that only rolls."""
        kinds = {part["kind"] for part in self.parts.values()}
        alone = (
            len(kinds) == 1
            and all(term.part for term in self.terms)
            and not self.increments
            and self.reference.pressure is None
        )
        return LINES.get(kinds.pop(), "") if alone else ""

    @cached_property
    def unused_parameters(self) -> tuple[str, ...]:
        """Parameters that no expression uses, so that no flight can tell anything of them."""
        trees = [each.expression for each in self.variables.values()]
        trees += [each.expression for each in self.terms]
        trees += [law.rate for law in self.rates.values()]
        used = {name for tree in trees for name in tree.names}
        used.update(*(increment.names for increment in self.increments))
        return tuple(name for name in self.parameters if name not in used)

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Parameter -> its value, a scalar in its unit, in the order of `variables`."""
        return {
            name: value_of(variable.expression)
            for name, variable in self.variables.items()
            if variable.parameter is not None
        }

    @cached_property
    def coefficient_terms(self) -> tuple[Term, ...]:
        """The terms, dimensionless: loads [N, N m] as their share of the coefficients, summed by
        axis.

        Without loads these are `terms` themselves.
        """
        if self._axes.isdisjoint(LOAD_AXES):
            return self.terms
        shares = load_shares(
            ((term.axis, term.expression) for term in self.terms), self.reference.pressure
        )
        own = [term for term in self.terms if term.axis not in LOAD_AXES]
        return (*own, *(Term(f"loads on {axis}", axis, each) for axis, each in shares))

    @property
    def has_loads(self) -> bool:
        """Whether any term is a load in N or N m, so that coefficients depend on qbar."""
        return self.coefficient_terms is not self.terms

    @property
    def acts_at_rest(self) -> bool:
        """Whether anything acts at V = 0: loads, or coefficients over a constant pressure."""
        return self.has_loads or self.reference.pressure is not None

    @cached_property
    def _program(self) -> Program:
        return self._compile(term.expression for term in self.coefficient_terms)

    @cached_property
    def _axes(self) -> frozenset[str]:
        return frozenset(
            [term.axis for term in self.terms] + [increment.axis for increment in self.increments]
        )

    @cached_property
    def axes(self) -> tuple[str, ...]:
        """Axes that it predicts: the six body axes, then the hinge moments (``Ch_<surface>``) that
        it has."""
        return in_order({*AXES, *self._axes})

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """Names that evaluation uses, sorted, dimensionless rates (`HAT_RATES`) among them."""
        names = set(self._program.inputs).union(*(increment.names for increment in self.increments))
        if self.on_wind_axes:
            names |= {"alpha", "beta"}
        return tuple(sorted(names))

    @property
    def on_wind_axes(self) -> bool:
        """Whether any term or increment acts on C_drag, C_side or C_lift."""
        return not self._axes.isdisjoint(WIND_AXES)

    def __repr__(self) -> str:
        parts = {
            "term": len(self.terms),
            "table": len(self.tables) + len(self.scattered),
            "increment": len(self.increments),
        }
        said = ", ".join(counted(n, what) for what, n in parts.items())
        return f"<AeroDatabase {self.name!r}: {said}>"

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Channels and free inputs that `predict` needs, sorted; for a dimensionless rate, the
        rate and V."""
        names = set(self.needs) - set(HAT_RATES) - {LIFT_INCREMENTS}
        for hat in set(self.needs) & set(HAT_RATES):
            names |= {HAT_RATES[hat][0], "V"}
        used = [self._states[name] for name in names & self._states.keys()]
        if any(not isinstance(state.law, Rate) for state in used):
            names.add("alpha")
        if any(isinstance(state.law, Rate) for state in used):
            names |= self.inputs_of_rates
        return tuple(sorted(names))

    @cached_property
    def flight_inputs(self) -> tuple[str, ...]:
        """Channels and free inputs that a flight must have, sorted: `inputs`, with each state
        replaced by the channels, (n,) in SI units, that it is integrated from."""
        used = [self._states[name] for name in self.inputs if name in self._states]
        return tuple(
            sorted(
                set(self.inputs) - self._states.keys()
                | {name for state in used for name in state.needs}
            )
        )

    @cached_property
    def _states(self) -> dict[str, StateModel]:
        return {state.name: state for state in self.states}

    @cached_property
    def rates(self) -> dict[str, Rate]:
        """State -> its law, of the states with a rate expression [1/s]."""
        return {s.name: s.law for s in self.states if isinstance(s.law, Rate)}

    @cached_property
    def _rate_program(self) -> Program:
        return self._compile(law.rate for law in self.rates.values())

    def _names_of_rates(self) -> set[str]:
        """Names that rates use; InputError with the state for a rate that cannot be computed."""
        names: set[str] = set()
        for state, law in self.rates.items():
            try:
                own = self._compile([law.rate]).inputs
                for name in own:
                    check_input(name, self.name, self.variables, self.free_inputs)
            except InputError as error:
                where = f"database {self.name}: states.{state} rate"
                raise InputError(error.what, where, error.remedy) from None
            names |= set(own)
        return names

    @cached_property
    def inputs_of_rates(self) -> frozenset[str]:
        """Channels and free inputs [SI] behind all rates, without the states themselves."""
        names = set(self._rate_program.inputs) - self.rates.keys()
        for hat in names & set(HAT_RATES):
            names = (names - {hat}) | {HAT_RATES[hat][0], "V"}
        others = names & self._states.keys()
        return frozenset(names | ({"alpha"} if others else set()))

    def _settled_rates(self, channels: Mapping[str, Value]) -> dict[str, Any]:
        """Steady values of the states with a rate; those in `channels` are as given."""
        given = {name: channels[name] for name in self.rates if name in channels}
        free = {name: law for name, law in self.rates.items() if name not in given}
        program = self._compile(law.rate for law in free.values())
        names = set(program.inputs) - free.keys()
        return {**given, **steady_values(program, free, self.resolved(names, channels))}

    def states_along(self, time: Array, channels: Mapping[str, Array]) -> dict[str, Array]:
        """Integrate the state models along a flight: state name -> (n,).

        Parameters
        ----------
        time : (n,) s, uniform.
        channels : those of `flight_inputs`, each (n,).

        States that `channels` already holds, and states that nothing uses, are left out. Raises
        InputError naming the channels that a state needs and `channels` lacks.
        """
        wanted = [
            state
            for state in self.states
            if state.name in self.needs and state.name not in channels
        ]
        found = {
            state.name: state.along(time, channels, self.reference.chord)
            for state in wanted
            if not isinstance(state.law, Rate)
        }
        if any(isinstance(state.law, Rate) for state in wanted):
            names = set(self._rate_program.inputs) - self.rates.keys()
            values = self.resolved(names, {**channels, **found})
            tables: dict[str, AnyTable] = {**self.tables, **self.scattered}
            found |= along_flight(self._rate_program, tables, self.rates, time, values)
        return found

    def resolved(self, names: Iterable[str], channels: Mapping[str, Value]) -> dict[str, Any]:
        """Values of the channels, dimensionless rates, states and free inputs in `names`.

        Raises InputError naming all channels that are missing.
        """
        values: dict[str, Any] = {}
        absent: set[str] = set()
        names = set(names)
        settling = (names & self.rates.keys()) - channels.keys()
        if settling:
            absent |= self.inputs_of_rates - channels.keys()
            if not absent:
                settled = self._settled_rates(channels)
                values |= {name: settled[name] for name in settling}
        for name in sorted(names - settling):
            if name in channels:
                values[name] = channels[name]
                continue
            if name == LIFT_INCREMENTS:
                values[name] = self._lift_increments(channels)
                continue
            state = self._states.get(name)
            sources = (
                {HAT_RATES[name][0], "V"} if name in HAT_RATES else {"alpha"} if state else {name}
            )
            missing = {source for source in sources if source not in channels}
            absent |= missing
            if state is not None and not missing:
                values[name] = state.settled(channels, self.reference.chord)
            elif name in HAT_RATES and not missing:
                values[name] = hat_rate(name, channels, self.reference)
        if absent:
            shown = [
                f"{name} ({self.free_inputs[name]})" if name in self.free_inputs else name
                for name in sorted(absent)
            ]
            remedy = "give them as channels, or bind them to expressions at import"
            raise InputError(
                f"channels missing: {', '.join(shown)}", f"database {self.name}", remedy
            )
        return values

    def _lift_increments(self, channels: Mapping[str, Value]) -> Value:
        """Sum of the increments on C_lift, (n,) or 0 without any."""
        acting = [
            increment
            for increment in self.increments
            if increment.axis == "C_lift" and increment.induces_drag and increment.acts_as_layer
        ]
        used = self.resolved(frozenset[str]().union(*(each.names for each in acting)), channels)
        return sum((each.value(used) for each in acting), 0.0)

    @property
    def depends_on_lift_increments(self) -> bool:
        """Whether some term is a function of the total lift, increments included."""
        return LIFT_INCREMENTS in self.needs

    def predict(self, channels: Mapping[str, Value]) -> Prediction:
        """Predict the coefficients on `axes`; stateless.

        Parameters
        ----------
        channels : those of `inputs`, each (n,) or a number, SI and rad.

        Raises InputError naming missing channels. Inputs that are not finite give coefficients
        that are not finite.
        """
        n = length_of(channels)
        values = self.resolved(self.needs, channels)
        if n <= BLOCK:
            return self._predict_block(values, n)
        return joined(
            [
                self._predict_block(block, min(BLOCK, n - start))
                for start, block in blocks(values, n)
            ],
            n,
        )

    def _predict_block(self, values: Mapping[str, Value], n: int) -> Prediction:
        run = self._program.run(values)
        totals = {axis: np.zeros(n) for axis in (*self.axes, *WIND_AXES)}
        for term, value in zip(self.coefficient_terms, run.values, strict=True):
            totals[term.axis] += value
        for increment in self.increments:
            if increment.acts_as_layer:
                totals[increment.axis] += increment.value(values)
        wind = [totals.pop(axis) for axis in WIND_AXES]
        if self.on_wind_axes:
            parts = wind_to_body(wind[0], wind[1], wind[2], values["alpha"], values["beta"])
            for axis, part in zip(FORCE_AXES, parts, strict=True):
                totals[axis] += part
        beyond = {table: np.broadcast_to(where, (n,)) for table, where in run.outside.items()}
        outside = np.zeros(n, dtype=np.bool_)
        for where in beyond.values():
            outside |= where
        return Prediction(totals, outside, beyond)
