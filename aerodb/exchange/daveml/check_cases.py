"""Check cases of DAVE-ML files (static shots): read them, and verify a database against them.

A shot names its inputs and outputs by public name and unit, and its internal signals by id. Here
all signals are identified by id, in the unit that their variable declares.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.daveml.names import Declaration, read_unit, unit_conversion
from aerodb.exchange.daveml.root_element import read_root
from aerodb.exchange.xml_elements import (
    children,
    find,
    number,
    own_text,
    required,
    tag,
    unsupported,
)
from aerodb.tables import (
    CONSTANTS,
    AeroDatabase,
    AnyTable,
    Expression,
    Name,
    Program,
    Value,
    compile_program,
    parse,
    rebuilt,
)

#: Relative tolerance where a file states none; for values below `_SMALL` relative to `_SMALL`.
RELATIVE: Final = 1e-12
_SMALL: Final = 1e-3
_LEAST_DIGITS: Final = 4  # significant: below, a value is taken as exact

_PARTS: Final = ("checkInputs", "internalValues", "checkOutputs")
_INPUT_ROLES: Final = ("isInput", "isControl", "isDisturbance")


@dataclass(frozen=True)
class CheckSignal:
    """Value of a signal by id, in the unit of its declaration.

    tolerance : None where the file states none. rounding : half a unit of the last digit to which
    the values of the shot are written.
    """

    identity: str
    value: float
    tolerance: float | None = None
    rounding: float = 0.0


@dataclass(frozen=True)
class StaticShot:
    """A static shot."""

    name: str
    inputs: tuple[CheckSignal, ...]
    internals: tuple[CheckSignal, ...]
    outputs: tuple[CheckSignal, ...]


@dataclass(frozen=True)
class CaseResult:
    """Result of one check case.

    internals, outputs : number of signals compared. failures : one sentence per signal beyond its
    tolerance.
    """

    name: str
    internals: int
    outputs: int
    failures: tuple[str, ...]

    @property
    def passed(self) -> bool:
        return not self.failures


def read_check_cases(xml: bytes, *, name: str = "") -> tuple[StaticShot, ...]:
    """Return the check cases of a DAVE-ML file; empty if it has none.

    Raises InputError for a signal that matches no variable, or several that its unit cannot tell
    apart.
    """
    where = name or "DAVE-ML file"
    root = read_root(xml, where)
    declared: list[tuple[Declaration, frozenset[str]]] = []
    for element in children(root):
        if tag(element) == "variableDef":
            identity = required(element, "varID", where)
            shown, unit = (
                (element.get("name") or identity).strip(),
                (element.get("units") or "nd").strip(),
            )
            declared.append(
                (Declaration(identity, shown, unit), frozenset(map(tag, children(element))))
            )
    cases: list[StaticShot] = []
    for block in children(root):
        for shot in children(block) if tag(block) == "checkData" else ():
            if tag(shot) == "staticShot":
                cases.append(_case(shot, declared, where, len(cases) + 1))
            elif tag(shot) not in ("description", "provenance", "provenanceRef"):
                raise unsupported(shot, "<checkData>", where)
    return tuple(cases)


def _case(
    shot: Any, declared: list[tuple[Declaration, frozenset[str]]], where: str, count: int
) -> StaticShot:
    name = (shot.get("name") or f"shot {count}").strip()
    parts: dict[str, tuple[CheckSignal, ...]] = {}
    for part in children(shot):
        if tag(part) in _PARTS:
            location = f"{where}: check case {name}"
            digits = _digits(part) if tag(part) != "checkInputs" else (17, 17)
            roles = {"checkInputs": _INPUT_ROLES, "checkOutputs": ("isOutput",)}.get(tag(part), ())
            parts[tag(part)] = tuple(
                _signal(each, declared, roles, digits, location)
                for each in _signals(part, location)
            )
        elif tag(part) not in ("description", "provenance", "provenanceRef"):
            raise unsupported(part, "<staticShot>", where)
    return StaticShot(name, *(parts.get(each, ()) for each in _PARTS))


def _signals(part: Any, where: str) -> Iterator[Any]:
    for element in children(part):
        if tag(element) != "signal":
            raise unsupported(element, f"<{tag(part)}>", where)
        yield element


def _signal(
    element: Any,
    declared: list[tuple[Declaration, frozenset[str]]],
    roles: tuple[str, ...],
    digits: tuple[int, int],
    where: str,
) -> CheckSignal:
    text = {tag(child): own_text(child).strip() for child in children(element)}
    if find(element, "signalValue") is None:
        raise InputError("a <signal> without <signalValue>", where)
    value = number(text["signalValue"], where)
    tolerance = number(text["tol"], where) if "tol" in text else None
    rounding = max(0.5 * 10.0 ** -digits[1], 0.5 * 10.0 ** (1 - digits[0]) * abs(value))
    identity = text.get("varID") or text.get("signalID")
    if identity is not None:
        if all(each.identity != identity for each, _ in declared):
            raise InputError(f"no variable '{identity}'", where)
        return CheckSignal(identity, value, tolerance, rounding)
    unit = text.get("signalUnits", "")
    meaning = _named(text.get("signalName", ""), unit, declared, roles, where)
    scale, offset = _between(unit, meaning.unit) if unit else (1.0, 0.0)
    return CheckSignal(
        meaning.identity,
        value * scale + offset,
        None if tolerance is None else tolerance * abs(scale),
        rounding * abs(scale),
    )


def _digits(part: Any) -> tuple[int, int]:
    """Largest numbers of significant digits and of decimals to which a part of a shot is written.

    Fewer than four significant digits are the numbers themselves, not rounded ones: (17, 17).
    """
    found = [(0, 0)]
    for element in part.iter():
        if isinstance(element.tag, str) and tag(element) == "signalValue":
            mantissa, _, exponent = own_text(element).strip().lower().partition("e")
            whole, _, decimals = mantissa.lstrip("+-").partition(".")
            power = int(exponent) if re.fullmatch(r"[+-]?\d{1,4}", exponent) else 0
            found.append((len((whole + decimals).lstrip("0")), max(len(decimals) - power, 0)))
    significant, decimals_of = (max(each[k] for each in found) for k in (0, 1))
    return (significant, decimals_of) if significant >= _LEAST_DIGITS else (17, 17)


def _named(
    name: str,
    unit: str,
    declared: list[tuple[Declaration, frozenset[str]]],
    roles: tuple[str, ...],
    where: str,
) -> Declaration:
    """Return the variable that a public name means.

    Names may repeat: variables of the expected role come first, then those of the stated unit.
    """
    same = [(each, kinds) for each, kinds in declared if name in (each.name, each.identity)]
    in_role = [each for each, kinds in same if kinds.intersection(roles)] or [
        each for each, _ in same
    ]
    exact = [each for each in in_role if _spelling(each.unit) == _spelling(unit)]
    near = [each for each in in_role if unit_conversion(unit, read_unit(each.unit)) is not None]
    for candidates in (exact, near, in_role if not unit else []):
        if len(candidates) == 1:
            return candidates[0]
    what = (
        f"signal '{name}' in '{unit}' matches {len(in_role)} variables"
        if in_role
        else f"no variable is named '{name}'"
    )
    if in_role and not near:
        what = f"signal '{name}' is in '{unit}', its variable in '{in_role[0].unit}'"
    raise InputError(what, where)


def _spelling(unit: str) -> str:
    return read_unit(unit).lower()


def _between(unit: str, to: str) -> tuple[float, float]:
    if _spelling(unit) == _spelling(to):
        return 1.0, 0.0
    return unit_conversion(unit, read_unit(to)) or (1.0, 0.0)


class SignalEvaluator:
    """Evaluate all signals of a database at given values of the file's own inputs."""

    def __init__(self, database: AeroDatabase, further: Sequence[Expression] = ()) -> None:
        """further : expressions of variables, whose values `values_of` gives."""
        self._database = database
        self._identities = {
            variable.declared.get("id", name): name for name, variable in database.variables.items()
        }
        self._input_names: dict[str, str] = {}  # id of an input -> name of its given value
        definitions = {name: self._expression_of(name) for name in database.variables}
        constants = {
            name: float(getattr(database.reference, attribute))
            for name, attribute in CONSTANTS.items()
        }
        tables: dict[str, AnyTable] = {**database.tables, **database.scattered}
        self._constants = constants
        self._program: Program = compile_program(
            [*(Name(name) for name in definitions), *further], tables, definitions, constants
        )

    def _expression_of(self, name: str) -> Expression:
        """Return the expression of a variable.

        In the expression of an input, its given value replaces the channels; its limits still
        apply.
        """
        variable = self._database.variables[name]
        text = variable.declared.get("input")
        if text is None:
            return variable.expression
        channels, given = parse(text), Name(f"{name}_given_")
        self._input_names[variable.declared.get("id", name)] = given.name
        return rebuilt(variable.expression, lambda node: given if node == channels else node)

    def at(self, inputs: Mapping[str, float]) -> dict[str, float]:
        """Return the values of all variables and inputs by id, scalars in the units that the file
        declares.

        Raises InputError that names missing inputs.
        """
        values, found = self._run(inputs)
        outputs = dict(zip(self._database.variables, found, strict=False))
        signals = {identity: outputs[name] for identity, name in self._identities.items()}
        return {
            **self._constants,
            **{k: float(np.ravel(v)[0]) for k, v in values.items()},
            **inputs,
            **signals,
        }

    def values_of(self, inputs: Mapping[str, float]) -> list[float]:
        """Return the values (scalars) of the further expressions at an input, as `at` takes it;
        raises what `at` raises."""
        return self._run(inputs)[1][len(self._database.variables) :]

    def _run(self, inputs: Mapping[str, float]) -> tuple[dict[str, Any], list[float]]:
        channels: dict[str, Value] = {
            self._input_names.get(identity, identity): value for identity, value in inputs.items()
        }
        values = self._database.resolved(self._program.inputs, channels)
        run = self._program.run(values)
        return values, [float(np.ravel(value)[0]) for value in run.values]


def verify_cases(
    database: AeroDatabase, cases: tuple[StaticShot, ...], relative: float = RELATIVE
) -> tuple[CaseResult, ...]:
    """Compare `database`, imported from DAVE-ML, with check cases of its file.

    Every internal signal and output must be within its stated tolerance; where none is stated,
    within `relative` times max(|value|, 1e-3), or half a unit of the last digit that is written.

    Raises InputError for an input or signal that the database does not have.
    """
    signals = SignalEvaluator(database)
    results = []
    for case in cases:
        values = signals.at({signal.identity: signal.value for signal in case.inputs})
        failures = []
        for signal in (*case.internals, *case.outputs):
            if signal.identity not in values:
                raise InputError(f"no signal '{signal.identity}'", f"check case {case.name}")
            tolerance = (
                max(relative * max(abs(signal.value), _SMALL), signal.rounding)
                if signal.tolerance is None
                else signal.tolerance
            )
            value = values[signal.identity]
            if not abs(value - signal.value) <= tolerance:
                failures.append(
                    f"{signal.identity} is {value!r}, expected {signal.value!r} within"
                    f" {tolerance:g}"
                )
        results.append(
            CaseResult(case.name, len(case.internals), len(case.outputs), tuple(failures))
        )
    return tuple(results)
