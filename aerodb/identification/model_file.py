"""Files that declare a linear state-space model of channels of the flights.

    [state_space]
    states = ["p", "r"]
    inputs = ["delta_aileron", "delta_rudder", "beta"]
    outputs = ["p", "r"]
    a = [["Lp", "Lr"], ["Np", "Nr"]]
    b = [["Lda", "Ldr", "Lbeta"], ["Nda", "Ndr", "Nbeta"]]
    c = [[1, 0], [0, 1]]
    state_bias = ["L0", "N0"]
    initial = ["p", "r"]
    own = ["L0", "N0"]

    [[parameter]]
    name = "Lp"
    value = -2.0
    upper = 0.0

Entries are numbers or sums of parameters, such as ``2*Lp - 0.1*Lr``; their units are SI. What no
``[[parameter]]`` describes is free and starts at 0. `initial` names the states whose first value is
unknown, `own` the parameters that every record has of its own. ``late_inputs = ["delta_aileron"]``
and ``late_outputs = ["p"]`` make delays unknown: parameters ``delay_<name>``, in s, which a
``[[parameter]]`` may start elsewhere, fix or bound. ``random_walk`` of a ``[[parameter]]`` lets it
change with time, by its standard deviation per root of a second, where `ekf` or `ukf` estimate it.
`estimated` names outputs that no sensor measured but an estimator on board made. ``feedback = { q =
{ q = 3.0 } }`` stabilises output error: state, output and gain of its rate (`stabilised`). ``band
= [0.1, 1.5]`` [Hz] is that of `frequency-domain-output-error`, which else follows from the records.

Of files without a vehicle, ``[columns]`` says which column is what: ``p = "roll_rate [deg/s]"``,
``time = "t [ms]"`` (`aerodb.logs.find_columns`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import Field

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.estimation import (
    FROM_SUBSPACE,
    MOST_DELAY,
    DelayedStateSpace,
    Fit,
    Parameter,
    Parameters,
    StateSpace,
    TimeHistory,
    affine_matrix,
    dependent,
    has_start_values,
    input_correlations,
    stabilised,
    state_space,
    with_delays,
    with_start_values,
)
from aerodb.identification.entry_units import UNKNOWN, entry_units
from aerodb.identification.identification_flight import IdentificationFlight
from aerodb.identification.methods import Method
from aerodb.identification.recorded import time_histories
from aerodb.identification.state_equations import equation_error_fit
from aerodb.logs import TIME, find_columns
from aerodb.nomenclature import channel
from aerodb.recording import Recording
from aerodb.support import Array, Strict, parsed_toml, validated

Row = list[float | str]

_CHANGING = (
    "parameters change during the records (ekf and ukf follow those with a random_walk), or the"
    " response is not linear"
)
#: Tables of which a model file has one.
_DECLARED = {"state_space", "increment", "parameters"}
#: What residuals that are correlated with an input say.
_LACKING = (
    "the model lacks part of the response to it (a delay, a state, a term), or a controller feeds"
    " disturbances back"
)
#: A record with which a file is checked.
_ANY = TimeHistory("any", np.arange(2.0), {}, {})


class StateSpaceTable(Strict):
    """Names and matrices; see the module."""

    states: list[str]
    inputs: list[str]
    outputs: list[str]
    a: list[Row]
    b: list[Row]
    c: list[Row]
    d: list[Row] | None = None
    state_bias: Row | None = None
    output_bias: Row | None = None
    initial: list[str] = []
    late_inputs: list[str] = []
    late_outputs: list[str] = []
    own: list[str] = []
    estimated: list[str] = []
    feedback: dict[str, dict[str, float]] = {}
    band: list[float] = Field([], max_length=2)


class ParameterTable(Strict):
    """A parameter: start value, unit (else that of its entry in the matrices) and what is known of
    it. A delay is bounded anyway."""

    name: str
    value: float = 0.0
    unit: str = ""
    fixed: bool = False
    lower: float = -np.inf
    upper: float = np.inf
    prior: float | None = None
    prior_error: float | None = None
    tied: str | None = None
    factor: float = 1.0
    random_walk: float = Field(0.0, ge=0.0, allow_inf_nan=False)


class StateSpaceFile(Strict):
    """A file that declares a linear model."""

    state_space: StateSpaceTable
    parameter: list[ParameterTable] = []
    columns: dict[str, str] = {}

    @property
    def entries(self) -> tuple[str, ...]:
        """Names of the parameters in the matrices, scalars, in order."""
        return _names(self.state_space)

    def model(self, records: Sequence[TimeHistory]) -> StateSpace | DelayedStateSpace:
        """Return the model of these records, A (s, s) and B (s, m), entries in SI units; a state
        starts as first measured where no output of its name says it better.

        Raises InputError for names that are not in the model, and for wrong matrices.
        """
        table = self.state_space
        _checked(table, [each.name for each in self.parameter])
        delays = [f"delay_{name}" for name in (*table.late_inputs, *table.late_outputs)]
        entries = tuple(dict.fromkeys([*_names(table), *delays]))
        described = {each.name: each for each in self.parameter}
        for what, names, known in (
            ("entry", [*described, *table.own], entries),
            ("state", table.initial, tuple(table.states)),
            ("output", table.estimated, tuple(table.outputs)),
        ):
            for name in names:
                if name not in known:
                    raise InputError(f"no {what} '{name}'", "state space", nearest(name, known))
        items, units = list[Parameter](), _units(table)
        for name in entries:
            given = described.get(name, ParameterTable(name=name))
            if name in delays:
                given = _believable(given)
            elif not given.unit:
                given = given.model_copy(update={"unit": units[name]})
            ends = [f"[{record.name}]" for record in records] if name in table.own else [""]
            items += [_parameter(given, end) for end in ends]
        items += [
            Parameter(f"initial_{state}[{record.name}]", _first(record, state), _unit(state))
            for state in table.initial
            for record in records
        ]
        model = state_space(
            table.states,
            table.inputs,
            table.outputs,
            Parameters(tuple(items)),
            a=table.a,
            b=table.b,
            c=table.c,
            d=table.d,
            state_bias=table.state_bias,
            output_bias=table.output_bias,
        )
        return with_delays(model, table.late_inputs, table.late_outputs) if delays else model

    def fed_back(self, model: StateSpace | DelayedStateSpace) -> StateSpace | DelayedStateSpace:
        """Return `model` with the feedback of measured outputs that the file states [SI per SI], as
        it is where there is none.

        Raises InputError for names that are not in the model, and beside unknown delays.
        """
        gains = {
            (state, output): gain
            for state, each in self.state_space.feedback.items()
            for output, gain in each.items()
        }
        if not gains:
            return model
        if isinstance(model, DelayedStateSpace):
            what = "feedback stands beside unknown delays"
            raise InputError(what, "state space", "leave one of the two out")
        return stabilised(model, gains)


def declares_state_space(text: str | Mapping[str, Any], where: str = "model file") -> bool:
    """Return whether a model file (TOML) declares a linear model, not increments.

    Raises InputError for a text that is no TOML, and for one that declares neither. See
    docs/reference/conventions.md, section Linear model file.
    """
    found = parsed_toml(text, where) if isinstance(text, str) else text
    if not _DECLARED & found.keys():
        raise InputError(
            "it declares no linear model ([state_space]), increments ([[increment]]) or parameters",
            where,
            nearest(next(iter(found), ""), sorted(_DECLARED)),
        )
    return "state_space" in found


def parse_state_space(text: str | Mapping[str, Any], where: str = "model file") -> StateSpaceFile:
    """Return the linear model that a file (TOML) declares.

    Raises InputError for unknown keys, wrong matrices and names that are nowhere. See
    docs/reference/conventions.md, section Linear model file; entries are in SI units.
    """
    data = parsed_toml(text, where) if isinstance(text, str) else text
    file = validated(StateSpaceFile, data, where)
    file.fed_back(file.model([_ANY]))
    return file


def state_space_fit(method: Method, records: Sequence[TimeHistory], file: StateSpaceFile) -> Fit:
    """Return the fit of a method to records (channels (n,), SI units), from start values of
    subspace identification where the file gives none.

    Raises InputError for delays, and for states that are not measured, under a method of equation
    error.
    """
    fit = _fitted(method, records, file)
    found = input_correlations(fit.residuals, records)
    notes = [
        f"The residuals of {each.output} are correlated with {each.input} {each.lag:.3g} s before"
        f" ({each.correlation:.2f}, 95 % bound {each.bound:.2f}"
        f"{'' if each.part == 'all' else f', {each.part} of its motion'}): "
        f"{_LACKING if each.part == 'all' else _CHANGING}."
        for each in dependent(found)[:1]
    ]
    walking = [each.name for each in file.parameter if each.random_walk]
    if walking and not fit.histories:
        notes.append(
            f"Taken as constant: {', '.join(walking)}; the random walk is for ekf and ukf."
        )
    return replace(fit, input_correlations=found, notes=(*fit.notes, *notes))


def _fitted(method: Method, records: Sequence[TimeHistory], file: StateSpaceFile) -> Fit:
    _moving(records, file.state_space.outputs)
    model, notes = file.model(records), list[str]()
    if method.kind != "dynamic":
        if isinstance(model, DelayedStateSpace):
            raise InputError(
                "it solves equations without delays", method.name, "use output-error for a delay"
            )
        return equation_error_fit(method, model, records)
    fed_back = method.name == "output-error" and bool(file.state_space.feedback)
    sees_to_it = method.name == "output-error" and not fed_back
    if not sees_to_it and not has_start_values(model):
        try:
            model = with_start_values(model, records)
            notes = [FROM_SUBSPACE]
        except InputError as error:
            notes = [f"The search began at zero: {error.what}."]
    if fed_back:
        model = file.fed_back(model)
        notes.append(
            "Measured outputs are fed back, as the file states: an unstable motion stays bounded."
        )
    in_band = {"band": file.state_space.band} if method.linear and file.state_space.band else {}
    fit: Fit = method.load()(model, records, **in_band)
    return replace(fit, notes=(*fit.notes, *(note for note in notes if note not in fit.notes)))


def _moving(records: Sequence[TimeHistory], outputs: Sequence[str]) -> None:
    """Raise InputError for an output that stands still: its noise cannot be estimated."""
    for name in outputs:
        values = np.concatenate([record.outputs[name] for record in records])
        values = values[np.isfinite(values)]
        if not len(values) or np.ptp(values) == 0.0:
            raise InputError(
                f"output {name} " + ("stands still" if len(values) else "has no values"),
                f"record {records[0].name}",
                "check its column, or leave it out of the model's outputs",
            )


def flight_records(
    flights: Sequence[IdentificationFlight], file: StateSpaceFile
) -> list[TimeHistory]:
    """Return the manoeuvres of the flights as records of the model's channels (n,), SI units.

    Raises InputError for channels that no manoeuvre has.
    """
    records = [
        record
        for each in flights
        for since, until in each.windows
        if (record := _record(file.state_space, each, since, until)) is not None
    ]
    if not records:
        raise InputError(
            "no manoeuvre has all inputs and outputs of the model",
            "flights",
            "use channels of the flights (aerodb flight show), or name the manoeuvres",
        )
    return records


def file_records(
    recordings: Mapping[str, Recording], file: StateSpaceFile
) -> tuple[list[TimeHistory], list[str]]:
    """Return the records that files hold of the model's channels, (n,) in SI units, and what was
    taken for granted.

    recordings : name of a file -> its contents.

    Raises InputError for a channel without a column and a file without usable samples.
    """
    table = file.state_space
    names = tuple(dict.fromkeys([*table.inputs, *table.outputs]))
    for name in file.columns:
        if name not in (*names, TIME):
            raise InputError(f"no channel '{name}'", "[columns]", nearest(name, [*names, TIME]))
    records, notes = list[TimeHistory](), list[str]()
    for name, recording in recordings.items():
        columns = find_columns(recording, names, file.columns)
        made, done = time_histories(
            name,
            columns.time,
            {each: columns.values[each] for each in table.inputs},
            {each: columns.values[each] for each in table.outputs},
        )
        records += made
        notes += [f"{name}: {note}" for note in columns.notes] + done
    return records, notes


def _checked(table: StateSpaceTable, described: Sequence[str]) -> None:
    """Raise InputError for names that occur twice, and for matrices of another size than the names
    of states, inputs and outputs ask for."""
    for what, names in (
        ("states", table.states),
        ("inputs", table.inputs),
        ("outputs", table.outputs),
        ("[[parameter]]", described),
    ):
        twice = [name for name in dict.fromkeys(names) if list(names).count(name) > 1]
        if twice:
            raise InputError(f"'{twice[0]}' stands twice in {what}", "state space", "name it once")
    s, m, o = len(table.states), len(table.inputs), len(table.outputs)
    matrices: dict[str, tuple[list[Row], int, int]] = {
        "a": (table.a, s, s),
        "b": (table.b, s, m),
        "c": (table.c, o, s),
        "d": ([[0.0] * m] * o if table.d is None else table.d, o, m),
        "state_bias": ([table.state_bias or [0.0] * s], 1, s),
        "output_bias": ([table.output_bias or [0.0] * o], 1, o),
    }
    for name, (rows, height, width) in matrices.items():
        if [len(row) for row in rows] != [width] * height:
            found = " and ".join(str(each) for each in sorted({len(row) for row in rows}))
            raise InputError(
                f"{name} has {len(rows)} rows of {found or 'no'} entries, not {height} of {width}",
                "state space",
                f"{s} states, {m} inputs and {o} outputs are named: a row for each state or output,"
                " an entry for each state or input",
            )


def _names(table: StateSpaceTable) -> tuple[str, ...]:
    """Parameters in the entries, in order."""
    matrices = [table.a, table.b, table.c, table.d or []]
    matrices += [
        [[entry] for entry in bias or []] for bias in (table.state_bias, table.output_bias)
    ]
    found: dict[str, None] = {}
    for rows in matrices:
        found |= dict.fromkeys(affine_matrix(rows, "state space").slopes)
    return tuple(found)


def _units(table: StateSpaceTable) -> dict[str, str]:
    """Units of the parameters in the matrices."""
    states, inputs, outputs = table.states, table.inputs, table.outputs
    return entry_units(
        (
            (table.a, states, states, True),
            (table.b, states, inputs, True),
            (table.c, outputs, states, False),
            (table.d or [], outputs, inputs, False),
            ([[entry] for entry in table.state_bias or []], states, [], True),
            ([[entry] for entry in table.output_bias or []], outputs, [], False),
        )
    )


def _unit(name: str) -> str:
    try:
        return channel(name).unit
    except UnknownNameError:
        return UNKNOWN


def _believable(delay: ParameterTable) -> ParameterTable:
    """A delay in seconds, within what is searched where the file sets no bounds."""
    lower, upper = max(delay.lower, -MOST_DELAY), min(delay.upper, MOST_DELAY)
    free = {} if delay.fixed else {"lower": lower, "upper": upper}
    return delay.model_copy(update={"unit": "s", **free})


def _parameter(given: ParameterTable, end: str) -> Parameter:
    return Parameter(
        given.name + end,
        given.value,
        given.unit,
        not given.fixed,
        given.lower,
        given.upper,
        given.prior,
        given.prior_error,
        None if given.tied is None else (given.tied, given.factor),
        given.random_walk,
    )


def _first(record: TimeHistory, state: str) -> float:
    values = record.outputs.get(state, np.zeros(1))
    good = values[np.isfinite(values)]
    return float(good[0]) if len(good) else 0.0


def _record(
    table: StateSpaceTable, each: IdentificationFlight, since: float, until: float
) -> TimeHistory | None:
    """A manoeuvre with the model's channels; None where it lacks one or an input has a gap."""
    flight = each.flight
    start = float(flight.time[0])
    inside = (flight.time >= start + since) & (flight.time <= start + until)
    inputs, outputs = dict[str, Array](), dict[str, Array]()
    for names, found in ((table.inputs, inputs), (table.outputs, outputs)):
        for name in names:
            if name not in flight:
                return None
            values = np.where(flight.usable([name]), flight[name], np.nan)[inside]
            found[name] = values
    if inside.sum() < 3 or not all(np.isfinite(values).all() for values in inputs.values()):
        return None
    if not all(np.isfinite(values).any() for values in outputs.values()):
        return None
    return TimeHistory(f"{flight.id[:8]} {since:.1f} s", flight.time[inside], inputs, outputs)
