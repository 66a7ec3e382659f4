"""What a database needs and flights lack, by name: a proposal for each, and what it does to the
result.

An input that no flight has is proposed to be held at zero. Rates of the flow angles come from the
angles themselves (`as_inputs`), everything else that flights have from the log. How much the
result hangs on an input is measured along the flights: the largest change of a predicted
coefficient when the input leaves its value for either end of its plausible range, beside the rms
of that axis' residual. The range is, in this order, the limits of the surface in the vehicle file;
the breakpoints of the tables that are looked up with it; 0 to 1 for a position ``..._norm``; else 0
to 1 as a unit, and said to be one. For an input that the flights could give, the change is that
from zero to the flights' own values.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from aerodb.coefficients.comparison import FLOW_RATES, Comparison, as_inputs
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.nomenclature import AXES, CHANNELS
from aerodb.signals import rms
from aerodb.support import Array
from aerodb.tables import (
    HAT_RATES,
    WIND_AXES,
    AeroDatabase,
    Expression,
    Name,
    Number,
    Variable,
    body_to_wind,
    breakpoints_over,
    number,
    parse,
    rebuilt,
)
from aerodb.vehicle import Vehicle

#: Beginning of the description of a variable that holds an input at zero.
_HELD: Final = "held at zero: "
#: Inputs that no constant can stand for.
UNHOLDABLE: Final = frozenset({"V", "alpha", "beta", "qbar", "rho"})
#: Least change of a coefficient, as a share of its axis' residual, that is worth a sentence.
_WORTH: Final = 1e-3
#: Least change of an axis' residual, as a share of it, that is worth a sentence.
_WORTH_OF_RESIDUAL: Final = 0.1


class Range(NamedTuple):
    """A plausible range [SI], and where it is from."""

    low: float
    high: float
    origin: str


class AxisEffect(NamedTuple):
    """Largest change of the coefficient on an axis, and its share of the rms of the residual (NaN
    without a residual)."""

    axis: str
    change: float
    share: float


class AxisResidual(NamedTuple):
    """Rms of the residual on an axis without each flight's own constant, as it is and with the
    input at zero."""

    axis: str
    now: float
    with_zero: float


@dataclass(frozen=True)
class InputUse:
    """An input of a database that flights do not log as it is, and its effect.

    name : of the input, or of the variable that holds it. source : what it is. description : that
    of the database, empty without one. channel : that is held, empty for another input. binding :
    ``zero`` or ``motion``. accepted : whether the database or the comparison already does so.
    range : over which the effects were computed. effects : per axis that depends on it, the largest
    share first; None without a flight along which to compute them. residuals : for an input from
    motion, of the axes whose residual zero would change by more than a tenth.
    """

    name: str
    source: str
    binding: str
    accepted: bool
    range: Range
    effects: tuple[AxisEffect, ...] | None
    residuals: tuple[AxisResidual, ...] = ()
    description: str = ""
    channel: str = ""

    def __str__(self) -> str:
        what = "from motion" if self.binding == "motion" else "held at zero"
        span = f"{self.range.low:.3g} to {self.range.high:.3g}, {self.range.origin}"
        if self.effects is None:
            return f"{self.source} {what}; its effect is shown once flights are stored"
        if not self.effects:
            return f"{self.source} {what}: no coefficient depends on it ({span})"
        first = "zero instead would change" if self.binding == "motion" else "at most"
        parts = [
            f"{e.change:.2g} of {e.axis}"
            + (f", {e.share:.2g} of its residual" if np.isfinite(e.share) else "")
            for e in self.effects
        ]
        changed = [
            f"; the residual of {r.axis} without constants would be {r.with_zero:.2g} instead of"
            f" {r.now:.2g}"
            for r in self.residuals
        ]
        return f"{self.source} {what}: {first} {'; '.join(parts)}{''.join(changed)} ({span})"


def lacking_inputs(database: AeroDatabase, flights: Iterable[Collection[str]]) -> tuple[str, ...]:
    """Inputs of the database that none of the flights has or can give by its motion, sorted.

    flights : the channels of each. Without any flight, those that no log can hold: free inputs.
    """
    known = [set(channels) for channels in flights]
    if not known:
        own = database.free_inputs.keys() - CHANNELS.keys()
        return tuple(name for name in database.flight_inputs if name in own)
    given = set[str]().union(*known)
    given |= {rate for rate in FLOW_RATES if rate.removesuffix("dot") in given}
    return tuple(name for name in database.flight_inputs if name not in given)


def with_held_inputs(database: AeroDatabase, names: Iterable[str]) -> AeroDatabase:
    """Return the database with these inputs held at zero by variables, whose descriptions say so.

    A free input keeps its name as a variable; a channel's variable is called ``<name>_held``.
    Raises InputError for a name that is no input of the terms, that an increment uses, or that is
    one of `UNHOLDABLE`.
    """
    variables, free, swap = dict(database.variables), dict(database.free_inputs), {}
    by_increments = frozenset[str]().union(*(each.names for each in database.increments))
    for name in names:
        if name not in database.inputs or name in by_increments | UNHOLDABLE:
            raise InputError(
                f"'{name}' cannot be held", f"database {database.name}", "name an input of a term"
            )
        own = name in free and name not in CHANNELS
        meaning = free.pop(name, "") or _channel_meaning(name)
        swap[name] = held = name if own else f"{name}_held"
        variables[held] = Variable(Number(0.0), "", f"{_HELD}{meaning}")
        for hat, (rate, length) in HAT_RATES.items():
            if rate == name and hat in database.needs:
                per = "b_ref" if length == "span" else "c_ref"
                swap[hat] = f"{hat}_held"
                variables[swap[hat]] = Variable(parse(f"{held}*{per}/(2*V)"))

    def change(node: Expression) -> Expression:
        renamed = isinstance(node, Name) and swap.get(node.name, node.name) != node.name
        return Name(swap[node.name]) if renamed and isinstance(node, Name) else node

    return _rebuilt(replace(database, variables=variables, free_inputs=free), change)


def _rebuilt(database: AeroDatabase, change: Callable[[Expression], Expression]) -> AeroDatabase:
    return replace(
        database,
        variables={
            name: replace(v, expression=rebuilt(v.expression, change))
            for name, v in database.variables.items()
        },
        terms=tuple(replace(t, expression=rebuilt(t.expression, change)) for t in database.terms),
    )


def input_uses(
    database: AeroDatabase,
    vehicle: Vehicle,
    compared: Sequence[tuple[Flight, Comparison]],
    proposed: Collection[str] = (),
    bound: Mapping[str, Expression | None] | None = None,
) -> tuple[InputUse, ...]:
    """Describe what is held or made from motion, and what depends on it (in dimensionless
    coefficients).

    Parameters
    ----------
    database : all inputs bound, so that the flights could be compared with it.
    compared : consistent flights with their comparison; none: the effects are unknown and empty.
    proposed : names that `database` holds but that nobody has accepted yet.
    bound : variable of `database` that somebody bound to a number -> what it would otherwise be,
        None if that is not known.
    """
    uses = []
    for name, otherwise in {**dict.fromkeys(held_inputs(database)), **(bound or {})}.items():
        uses.append(_held_use(database, vehicle, compared, name, otherwise, name not in proposed))
    for rate in FLOW_RATES:
        made = [pair for pair in compared if rate not in pair[0]]
        if rate in database.flight_inputs and made:
            named = [v for v in database.variables.values() if v.expression == Name(rate)]
            source = f"{named[0].description} = {rate}" if named else rate
            use = _motion_use(database, made, rate, source, _without_rate(database, rate))
            uses.append(replace(use, description=named[0].description if named else ""))
    for name, variable in database.variables.items():
        if str(variable.expression).startswith("abs(") and _is_one_sided(variable, compared):
            still = _with(database, name, Number(0.0))
            source = f"{variable.description or name} = {variable.expression}"
            use = _motion_use(database, compared, name, source, still)
            uses.append(replace(use, description=variable.description))
    return tuple(uses)


def held_inputs(database: AeroDatabase) -> tuple[str, ...]:
    """Variables of `with_held_inputs`, sorted."""
    variables = database.variables.items()
    return tuple(sorted(name for name, v in variables if _held(v) is not None))


def _held(variable: Variable) -> str | None:
    """What a variable of `with_held_inputs` holds at zero; None for another variable.

    Stored databases say so in its description alone.
    """
    held = variable.description.startswith(_HELD)
    return variable.description.removeprefix(_HELD) if held else None


def _channel_meaning(name: str) -> str:
    return f"channel {name}"


def _held_use(
    database: AeroDatabase,
    vehicle: Vehicle,
    compared: Sequence[tuple[Flight, Comparison]],
    name: str,
    otherwise: Expression | None,
    accepted: bool,
) -> InputUse:
    variable = database.variables[name]
    held = _held(variable)
    source = variable.description if held is None else held
    channel = name.removesuffix("_held")
    if otherwise is not None:
        freed = _with(database, name, otherwise)
        values = [np.zeros(1)]
        for flight, _ in compared:
            flown = as_inputs(flight, freed).channels
            program = freed.compiled([otherwise], {}, {})
            (value,) = program.run(freed.resolved(program.inputs, flown)).values
            values.append(np.atleast_1d(value))
        flat = np.concatenate(values)
        reach = Range(float(np.nanmin(flat)), float(np.nanmax(flat)), f"as flown ({otherwise})")
        others = [freed]
    else:
        reach = _plausible(name, source, database, vehicle)
        others = [_with(database, name, number(end)) for end in (reach.low, reach.high)]
    effects = _effects(database, others, compared)
    return InputUse(
        name,
        source,
        "zero",
        accepted,
        reach,
        effects,
        description=source,
        channel=channel if source == _channel_meaning(channel) else "",
    )


def _without_rate(database: AeroDatabase, rate: str) -> AeroDatabase:
    """The database with a rate of a flow angle, and what is made of it, at zero."""
    names = [name for name in (rate, f"{rate}_hat") if name in database.needs]
    swap = {name: Number(0.0) for name in names}

    def change(node: Expression) -> Expression:
        return swap.get(node.name, node) if isinstance(node, Name) else node

    return _rebuilt(database, change)


def _is_one_sided(variable: Variable, compared: Sequence[tuple[Flight, Comparison]]) -> bool:
    """Return whether a variable is the size of one channel that all flights have."""
    names = variable.expression.names
    return len(names) == 1 and bool(compared) and all(names <= set(f.channels) for f, _ in compared)


def _motion_use(
    database: AeroDatabase,
    compared: Sequence[tuple[Flight, Comparison]],
    name: str,
    source: str,
    still: AeroDatabase,
) -> InputUse:
    """Describe an input from motion.

    still : the database with it at zero.
    """
    expression = Name(name)
    flown, changes = [], []
    square: dict[str, list[tuple[float, float, int]]] = {}
    for flight, comparison in compared:
        inputs = as_inputs(flight, database).channels
        definitions = {name: v.expression for name, v in database.variables.items()}
        program = database.compiled([expression], definitions, {})
        (values,) = program.run(database.resolved(program.inputs, inputs)).values
        flown.append(np.atleast_1d(values))
        own, other = _predicted(database, flight), _predicted(still, flight)
        changes.append(_change(own, other, comparison))
        for axis in changes[-1]:
            good = comparison.usable[axis]
            left = comparison.residual(axis)[good]
            bare = left + (own[axis] - other[axis])[good]
            square.setdefault(axis, []).append((left.var(), bare.var(), len(left)))
    effects = _ranked(database, changes, compared)
    residuals = []
    for axis in [effect.axis for effect in effects or ()]:
        now, zero, count = (np.array(column) for column in zip(*square[axis], strict=True))
        rows = [float(np.sqrt(np.average(v, weights=count))) for v in (now, zero)]
        each = AxisResidual(axis, rows[0], rows[1])
        if abs(each.with_zero - each.now) > _WORTH_OF_RESIDUAL * each.now:
            residuals.append(each)
    flat = np.concatenate(flown)
    reach = Range(float(np.nanmin(flat)), float(np.nanmax(flat)), "as flown")
    return InputUse(name, source, "motion", True, reach, effects, tuple(residuals))


def _plausible(name: str, source: str, database: AeroDatabase, vehicle: Vehicle) -> Range:
    surface = vehicle.surfaces.get(name.removeprefix("delta_").removesuffix("_held"))
    if surface is not None:
        return Range(*surface.limits, "rad, limits in the vehicle file")
    freed = replace(
        database,
        variables={n: v for n, v in database.variables.items() if n != name},
        free_inputs={**database.free_inputs, name: source},
    )
    grids = [grid for grid in breakpoints_over(name, freed) if len(grid)]
    if grids:
        low, high = min(grid[0] for grid in grids), max(grid[-1] for grid in grids)
        return Range(float(low), float(high), "breakpoints of the tables")
    if name.endswith("norm") or name == "delta_landing_gear_held":
        return Range(0.0, 1.0, "full travel")
    return Range(0.0, 1.0, "one unit: its range is not known")


def _with(database: AeroDatabase, name: str, expression: Expression) -> AeroDatabase:
    changed = replace(database.variables[name], expression=expression)
    return replace(database, variables={**database.variables, name: changed})


def _predicted(database: AeroDatabase, flight: Flight) -> dict[str, Array]:
    flown = as_inputs(flight, database).channels
    c = database.predict(flown).coefficients
    beta = flown.get("beta", np.zeros_like(flight.time))
    if "alpha" not in flown:
        return c
    wind = body_to_wind(c["CX"], c["CY"], c["CZ"], flown["alpha"], beta)
    return {**c, **dict(zip(WIND_AXES, wind, strict=True))}


def _change(
    one: Mapping[str, Array], other: Mapping[str, Array], comparison: Comparison
) -> dict[str, float]:
    change = {}
    for axis in one:
        good = comparison.usable.get(axis)
        if good is not None and good.any():
            change[axis] = float(np.max(np.abs(one[axis] - other[axis])[good]))
    return change


def _effects(
    database: AeroDatabase,
    others: Sequence[AeroDatabase],
    compared: Sequence[tuple[Flight, Comparison]],
) -> tuple[AxisEffect, ...] | None:
    changes = []
    for flight, comparison in compared:
        own = _predicted(database, flight)
        changes += [_change(own, _predicted(other, flight), comparison) for other in others]
    return _ranked(database, changes, compared)


def _ranked(
    database: AeroDatabase,
    changes: Sequence[Mapping[str, float]],
    compared: Sequence[tuple[Flight, Comparison]],
) -> tuple[AxisEffect, ...] | None:
    """Effects on the axes that the database is written in, the largest share first."""
    if not compared:
        return None
    forces = WIND_AXES if database.on_wind_axes else AXES[:3]
    effects = []
    for axis in (*forces, *AXES[3:]):
        change = max((each.get(axis, 0.0) for each in changes), default=0.0)
        left = [c.residual(axis)[c.usable[axis]] for _, c in compared if axis in c.usable]
        size = rms(np.concatenate(left)) if left else np.nan
        share = change / size if size > 0.0 else np.nan
        if change > 0.0 and not share < _WORTH:
            effects.append(AxisEffect(axis, change, share))
    return tuple(sorted(effects, key=lambda effect: -np.nan_to_num(effect.share, nan=np.inf)))
