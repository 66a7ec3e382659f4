"""Build an AeroDatabase from the signals of a DAVE-ML file.

Inputs become expressions of channels, outputs become coefficients on axes; the reference geometry
is read by its standard names.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from aerodb.errors import InputError, OpenQuestionsError, Question, nearest
from aerodb.exchange.binding_units import binding_fault, binding_question, raise_together
from aerodb.exchange.daveml.names import (
    POSITION_SIGNS,
    POSITIONS,
    REFERENCES,
    Declaration,
    channel_in_unit,
    described,
    input_channel,
    output_axis,
    read_unit,
    sign_factor,
    signed_name,
    unit_conversion,
)
from aerodb.nomenclature import AXES, CHANNELS, channel, is_command, is_hinge_axis, is_surface
from aerodb.tables import (
    CONSTANTS,
    FUNCTIONS,
    HAT_RATES,
    WIND_AXES,
    AeroDatabase,
    Expression,
    Name,
    Negation,
    Number,
    Operation,
    ReferenceGeometry,
    ScatteredTable,
    Table,
    TableCall,
    Term,
    Uncertainty,
    Variable,
    number,
    parse,
    rebuilt,
)

_GIVEN: Final = ("isInput", "isControl", "isDisturbance")
_MOST_TERMS: Final = 200


@dataclass(frozen=True)
class DavemlSignal:
    """A variable of the file: declaration, roles, description, notes and initial value."""

    declared: Declaration
    roles: tuple[str, ...]
    description: str
    notes: Mapping[str, str]
    initial: float | None


@dataclass
class Model:
    """The signals of a file and their definitions, by the ids of the file.

    bindings : as in `import_daveml`.
    """

    where: str
    bindings: dict[str, str]
    header: str = ""
    signals: dict[str, DavemlSignal] = field(default_factory=dict)
    tables: dict[str, Table] = field(default_factory=dict)
    scattered: dict[str, ScatteredTable] = field(default_factory=dict)
    limits: dict[str, Callable[[Expression], Expression]] = field(default_factory=dict)
    uncertainties: dict[str, Uncertainty] = field(default_factory=dict)
    _identifiers: dict[str, str] = field(default_factory=dict)
    _defined: dict[str, Expression] = field(default_factory=dict)
    _notes: dict[str, str] = field(default_factory=dict)
    _questions: list[OpenQuestionsError] = field(default_factory=list)
    _taken: set[str] = field(default_factory=lambda: {*CHANNELS, *CONSTANTS, *FUNCTIONS})

    def declare(self, signal: DavemlSignal) -> str:
        """Add a signal; return its identifier in the database.

        The identifier is the id wherever possible.
        """
        identity = signal.declared.identity
        self.signals[identity] = signal
        self._identifiers[identity] = self.unique(identity)
        return self._identifiers[identity]

    def identifier(self, identity: str) -> str:
        """Return the name of a signal among the database's variables (`declare`); KeyError for an
        unknown one."""
        return self._identifiers[identity]

    def value(self, identity: str) -> Expression:
        """Return the expression that refers to a signal (`identifier`), in its declared unit;
        KeyError for an unknown one."""
        return Name(self._identifiers[identity])

    def defined(self, identity: str) -> bool:
        """Return whether a calculation or a function defines this signal."""
        return identity in self._defined

    def define(self, identity: str, expression: Expression, where: str) -> None:
        """Set the expression of a signal (``calculation`` or ``function``, in the unit that it
        declares).

        Raises InputError for an unknown signal or a second definition.
        """
        if identity not in self.signals:
            raise InputError(f"no variableDef '{identity}'", where)
        if identity in self._defined:
            raise InputError(f"variable '{identity}' is defined twice", where)
        self._defined[identity] = expression

    def annotate(self, identity: str, note: str) -> None:
        """Set the description of a signal that declares none."""
        self._notes[identity] = note

    def unique(self, wanted: str) -> str:
        """Return an unused identifier similar to `wanted`."""
        base = re.sub(r"\W", "_", wanted.strip(), flags=re.ASCII)
        taken = is_surface(base) or is_command(base)  # these are channels
        base = f"_{base}" if not base or base[0].isdigit() or taken else base
        name, count = base, 1
        while name in self._taken:
            count += 1
            name = f"{base}_{count}"
        self._taken.add(name)
        return name

    def database(self, reference: ReferenceGeometry | None) -> AeroDatabase:
        """Return the database of everything that was read, in SI units. Raises InputError, or
        OpenQuestionsError for inputs without a meaning.

        reference : replaces the reference geometry of the file.
        """
        try:
            reference = reference or self._reference()
        except OpenQuestionsError as question:
            self._questions.append(question)
            reference = ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0))  # until it is answered
        free: dict[str, str] = {}
        # Variables that only repeat a channel, a constant or a free input.
        repeated: dict[str, Expression] = {}
        variables: dict[str, Variable] = {}
        used = set(self.bindings) & {*CONSTANTS, *self._axes}
        for identity, signal in self.signals.items():
            raw, extra = self._meaning(identity, signal, reference, free, used)
            name = self._identifiers[identity]
            value = self.limits.get(identity, lambda each: each)(raw)
            repeats = (
                isinstance(raw, Name)
                and raw.name == identity
                and (raw.name in free or raw.name != name)
            )
            if repeats and value == raw and identity not in self.uncertainties:
                repeated[name] = raw
                continue
            notes = {"id": identity, **signal.notes, "role": " ".join(signal.roles), **extra}
            notes = {
                key: text
                for key, text in notes.items()
                if text and not (key == "name" and text == identity)
            }
            description = signal.description or self._notes.get(identity, "")
            uncertainty = self.uncertainties.get(identity)
            variables[name] = Variable(value, signal.declared.unit, description, notes, uncertainty)
        self._refuse_unused(used)
        try:
            terms = self._terms(variables)
        except OpenQuestionsError as question:  # the first words: what such a file is not
            every = [question, *self._questions]
            asked = [each for one in every for each in one.questions]
            raise OpenQuestionsError(question.what, self.where, question.remedy, asked) from None
        raise_together(self._questions, self.where)
        if repeated:
            variables, terms = _without(variables, terms, repeated)
        for tree in [term.expression for term in terms] + [
            each.expression for each in variables.values()
        ]:
            # A stored expression must be readable: the limits of the language apply to imports.
            parse(str(tree))
        source = f"DAVE-ML file{f': {self.header}' if self.header else ''}"
        return AeroDatabase(
            self.where,
            reference,
            variables,
            self.tables,
            tuple(terms),
            free_inputs=free,
            source=source,
            scattered=self.scattered,
        )

    def _meaning(
        self,
        identity: str,
        signal: DavemlSignal,
        reference: ReferenceGeometry,
        free: dict[str, str],
        used: set[str],
    ) -> tuple[Expression, dict[str, str]]:
        """The expression of a signal before its limits, and the note of an input."""
        key = next(
            (each for each in (identity, signal.declared.name) if each in self.bindings), None
        )
        given = any(role in _GIVEN for role in signal.roles) or identity not in self._defined
        if not given:
            return self._plain(identity, reference), {}
        if identity in self._defined:
            raise InputError(f"input '{identity}' also has a calculation or function", self.where)
        raw: Expression | None = None
        if key is not None:
            used.add(key)
            raw = self._bound(key, identity)
        if raw is None and (key is None):
            try:
                channel_and_scale = input_channel(signal.declared, self.where)
            except OpenQuestionsError as question:
                self._questions.append(question)
                channel_and_scale = None
            if channel_and_scale is not None:
                raw = channel_in_unit(
                    Name(channel_and_scale[0]),
                    signal.declared.unit,
                    channel(channel_and_scale[0]).unit,
                    channel_and_scale[1],
                )
        if raw is None:
            raw = Name(self._free(signal, free))
        return raw, {"input": str(raw)}

    def _plain(self, identity: str, reference: ReferenceGeometry) -> Expression:
        """The expression of a defined signal.

        The constants and hat rates of the database, which an export writes out, are restored.
        """
        expression = self._defined[identity]
        if identity in CONSTANTS and expression == number(getattr(reference, CONSTANTS[identity])):
            return Name(identity)
        if identity in HAT_RATES:
            rate, length = HAT_RATES[identity]
            constant = next(name for name, attribute in CONSTANTS.items() if attribute == length)
            names = {self._identifiers.get(each, ""): Name(each) for each in (rate, constant, "V")}
            if _renamed(expression, names) == hat_rate_expression(rate, constant):
                return Name(identity)
        return expression

    def _bound(self, key: str, identity: str) -> Expression | None:
        """The expression of a binding; None if it names the input itself, which remains free unless
        a channel has that name.

        A binding in another unit than the file's is noted as a question.
        """
        bound = self._parsed(key)
        channels = (n for n in bound.names if n in CHANNELS or is_surface(n) or is_command(n))
        if not any(channels) and bound in (Name(self._identifiers[identity]), Name(key)):
            return None
        fault = binding_fault(bound, read_unit(self.signals[identity].declared.unit))
        if fault is not None:
            self._questions.append(binding_question(key, fault, self.where))
        return bound

    def _parsed(self, key: str) -> Expression:
        try:
            return parse(self.bindings[key])
        except InputError as error:
            raise InputError(error.what, f"{self.where}: binding of {key}", error.remedy) from None

    def _free(self, signal: DavemlSignal, free: dict[str, str]) -> str:
        """Add a free input for this signal; return its name.

        The name is the signal's id if that is also its name, otherwise its name.
        """
        declared = signal.declared
        plain_id = declared.name == declared.identity == self._identifiers[declared.identity]
        limited = declared.identity in self.limits or declared.identity in self.uncertainties
        name = declared.identity if plain_id and not limited else self.unique(declared.name)
        free[name] = described(signal.description or declared.name, declared)
        return name

    @property
    def _axes(self) -> tuple[str, ...]:
        """Axes that may be bound: body and wind axes, and the hinge moments that are."""
        return (*AXES, *WIND_AXES, *filter(is_hinge_axis, self.bindings))

    def _refuse_unused(self, used: set[str]) -> None:
        unused = sorted(set(self.bindings) - used)
        if unused:
            inputs = [i for i, s in self.signals.items() if any(role in _GIVEN for role in s.roles)]
            known = [*inputs, *AXES, *WIND_AXES, *CONSTANTS]
            raise InputError(
                f"binding of '{unused[0]}', which is not an input of the file",
                self.where,
                nearest(unused[0], known),
            )

    def _reference(self) -> ReferenceGeometry:
        """Reference geometry by standard names, in SI."""
        values: dict[str, float] = {}
        for key, attribute in CONSTANTS.items():
            if key in self.bindings:
                bound = self._parsed(key)
                if not isinstance(bound, Number):
                    raise InputError(f"the binding of {key} is not a number", self.where)
                values[attribute] = bound.value
        for signal in self.signals.values():
            attribute = REFERENCES.get(signal.declared.name, "")
            if attribute and attribute not in values and signal.initial is not None:
                values[attribute] = self._metres(signal, "m^2" if attribute == "area" else "m")
        missing = [key for key, attribute in CONSTANTS.items() if attribute not in values]
        if missing:
            names = {attribute: name for name, attribute in REFERENCES.items()}
            what = f"no variable named {names[CONSTANTS[missing[0]]]} with an initialValue"
            units = {key: "m2" if CONSTANTS[key] == "area" else "m" for key in missing}
            asked = [
                Question(
                    f"the reference {CONSTANTS[key]} is not in the file: what is it in {unit}?",
                    key,
                    (("NUMBER", f"in {unit}"),),
                )
                for key, unit in units.items()
            ]
            remedy = f"bind {', '.join(f'{key}=NUMBER' for key in missing)} in m2 and m"
            raise OpenQuestionsError(what, self.where, remedy, asked)
        point = [0.0, 0.0, 0.0]
        for signal in self.signals.values():
            if signal.declared.name in POSITIONS and signal.initial is not None:
                k = POSITIONS.index(signal.declared.name)
                point[k] = self._position(signal, k, values["chord"])
        return ReferenceGeometry(
            values["area"], values["chord"], values["span"], (point[0], point[1], point[2])
        )

    def _metres(self, signal: DavemlSignal, unit: str) -> float:
        scale = unit_conversion(signal.declared.unit, unit)
        if scale is None or signal.initial is None:
            raise InputError(
                f"{signal.declared.name} in '{signal.declared.unit}'",
                self.where,
                f"a unit of {unit} is needed",
            )
        return signal.initial * scale[0] + scale[1]

    def _position(self, signal: DavemlSignal, k: int, chord: float) -> float:
        """One coordinate of the moment reference in body axes.

        A fraction of the chord is measured aft from its leading edge.
        """
        declared = signal.declared
        fraction = declared.unit.lower() == "fracmac"
        value = (signal.initial or 0.0) * chord if fraction else self._metres(signal, "m")
        sign = sign_factor(
            declared.sign or ("aft" if fraction and k == 0 else ""), *POSITION_SIGNS[k]
        )
        if sign == 0:
            raise InputError(
                f"{declared.name} with sign '{declared.sign}'",
                self.where,
                f"known: {POSITION_SIGNS[k]}",
            )
        return sign * value

    def _terms(self, variables: Mapping[str, Variable]) -> list[Term]:
        """The outputs that are coefficients, as terms: one per addend of a sum."""
        axes: dict[str, Expression] = {}
        for axis in self._axes:
            if axis in self.bindings:
                names = {identity: Name(name) for identity, name in self._identifiers.items()}
                axes[axis] = _renamed(self._parsed(axis), names)
        marked = [s for s in self.signals.values() if "isOutput" in s.roles] or list(
            self.signals.values()
        )
        by_axis: dict[str, str] = {}
        for signal in marked:
            axis_sign = output_axis(signal.declared, self.where)
            if axis_sign is None or axis_sign[0] in self.bindings:
                continue
            axis, sign = axis_sign
            if axis in by_axis:
                both = f"{by_axis[axis]} and {signal.declared.identity}"
                raise InputError(
                    f"two outputs are {axis}: {both}",
                    self.where,
                    f"bind the axis: {axis}=EXPRESSION",
                )
            by_axis[axis] = signal.declared.identity
            axes[axis] = signed_name(self._identifiers[signal.declared.identity], sign)
        if not axes:
            outputs = ", ".join(s.declared.identity for s in marked[:12])
            raise OpenQuestionsError(
                _unknown_outputs([each.declared for each in marked]),
                self.where,
                f"bind axes with CX=EXPRESSION; outputs: {outputs}",
                _axis_questions([each.declared for each in marked[:12]]),
            )
        stability = "C_side" not in axes and "CY" in axes
        terms: list[Term] = []
        for axis, expression in axes.items():
            if axis in WIND_AXES and stability:
                terms += _along_stability_axis(axis, expression)
            else:
                terms += _addends(axis, expression, variables)
        return _named(terms)


#: Standard names of what other models than aerodynamics give (AIAA S-119).
_OTHER_OUTPUTS: Final = re.compile(
    r"thrust|engine|fuel|total_?mass|mass|.*[iI]nertia|.*[cC]ommand|atmospher|air(Density|Pressure)"
)


def _unknown_outputs(outputs: Sequence[Declaration]) -> str:
    """Why no output is a coefficient: others are calculated, or those are called otherwise."""
    others = [each.name for each in outputs if _OTHER_OUTPUTS.match(each.name)]
    if len(others) == len(outputs):
        return f"the file is not one of aerodynamics: it gives {', '.join(others[:4])}"
    if any(question.name != "CX" for question in _axis_questions(outputs)) or any(
        "coefficient" in each.name.lower() for each in outputs
    ):
        return "no output has the standard name of a coefficient: which is which?"
    return "no output is a known coefficient: is the file one of aerodynamics?"


def _axis_questions(outputs: Sequence[Declaration]) -> list[Question]:
    """Which axes outputs may be that are called like one, whatever the case of their letters; else
    one question about all of them."""
    ours = [each.identity for each in outputs if not _OTHER_OUTPUTS.match(each.name)]
    alike = [
        Question(f"is output '{output}' the coefficient {axis}?", axis, ((output, "if it is"),))
        for output in ours
        for axis in (*AXES, *WIND_AXES)
        if output.lower() == axis.lower() and (axis.lower() != "cl" or output == axis)
    ]
    every = ", ".join((*AXES, *WIND_AXES))
    return alike or [
        Question(f"which output is which of {every}?", "CX", (("EXPRESSION", "of the outputs"),))
    ]


def hat_rate_expression(rate: str, constant: str) -> Expression:
    """Return ``rate*(length/2)/V``.

    The order of the operations is that of `aerodb.tables.reference.hat_rate`.

    The result is dimensionless, the rate in rad/s.
    """
    return Operation(
        "/", Operation("*", Name(rate), Operation("/", Name(constant), Number(2.0))), Name("V")
    )


def _along_stability_axis(axis: str, expression: Expression) -> list[Term]:
    """Lift or drag in stability axes, as terms on CX and CZ."""
    sine, cosine = parse("sin(alpha)"), parse("cos(alpha)")
    aft, up = (cosine, sine) if axis == "C_drag" else (sine, cosine)
    x: Expression = Operation("*", expression, aft)
    x, z = Negation(x) if axis == "C_drag" else x, Negation(Operation("*", expression, up))
    kind = axis.removeprefix("C_")
    note = f"{kind} along the stability axes"
    return [Term(f"CX_{kind}", "CX", x, note), Term(f"CZ_{kind}", "CZ", z, note)]


def _addends(axis: str, expression: Expression, variables: Mapping[str, Variable]) -> list[Term]:
    """The terms of an output.

    A variable whose expression is a sum gives a term per addend; any other expression gives one
    term.
    """
    if isinstance(expression, Name) and expression.name in variables:
        whole = variables[expression.name].expression
        parts: list[Expression] = []
        while isinstance(whole, Operation) and whole.operator in "+-" and len(parts) < _MOST_TERMS:
            parts.append(Negation(whole.right) if whole.operator == "-" else whole.right)
            whole = whole.left
        parts.append(whole)
        if len(parts) > 1:
            return [
                Term(_label(axis, part), axis, part, _described(part, variables))
                for part in reversed(parts)
            ]
    return [Term(axis, axis, expression, _described(expression, variables))]


def _label(axis: str, part: Expression) -> str:
    inner = part.operand if isinstance(part, Negation) else part
    if isinstance(inner, (Name, TableCall)):
        return str(inner.name if isinstance(inner, Name) else inner.table)
    return (
        f"{axis}_{'_'.join(sorted(inner.names | inner.tables))}"[:80]
        if inner.names
        else f"{axis}_0"
    )


def _described(part: Expression, variables: Mapping[str, Variable]) -> str:
    known = variables.get(part.name) if isinstance(part, Name) else None
    return known.description if known else ""


def _named(terms: list[Term]) -> list[Term]:
    """Terms with unique names."""
    counts: dict[str, int] = {}
    named = []
    for term in terms:
        counts[term.name] = counts.get(term.name, 0) + 1
        name = (
            term.name
            if counts[term.name] == 1
            else f"{term.name} ({term.axis} {counts[term.name]})"
        )
        named.append(Term(name, term.axis, term.expression, term.description))
    return named


def _renamed(expression: Expression, names: Mapping[str, Expression]) -> Expression:
    return rebuilt(
        expression, lambda node: names.get(node.name, node) if isinstance(node, Name) else node
    )


def _without(
    variables: Mapping[str, Variable], terms: list[Term], same: Mapping[str, Expression]
) -> tuple[dict[str, Variable], list[Term]]:
    """Variables and terms in which names are replaced by the expressions they repeat."""
    replaced = {
        name: Variable(
            _renamed(v.expression, same), v.unit, v.description, v.declared, v.uncertainty
        )
        for name, v in variables.items()
    }
    return replaced, [
        Term(t.name, t.axis, _renamed(t.expression, same), t.description) for t in terms
    ]
