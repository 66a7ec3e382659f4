"""What a file of an aerodynamic code leaves open, asked in one round: numbers, choices, controls.

An answer is a binding of the import, ``--bind NAME=ANSWER``; it takes precedence over what the file
and the vehicle say.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from aerodb.errors import InputError, OpenQuestionsError, Question, nearest
from aerodb.support import counted
from aerodb.tables import Expression, ReferenceGeometry, parse
from aerodb.units import quantity

_LENGTHS: Final = ("S_ref", "c_ref", "b_ref")
_POINT: Final = ("x_ref", "y_ref", "z_ref")
_MEANT: Final = {
    "S_ref": "the reference area",
    "c_ref": "the chord of Cm",
    "b_ref": "the span of Cl and Cn",
    "x_ref": "the point of its moments: x, body axes, from the vehicle's datum",
    "y_ref": "the point of its moments: y, body axes, from the vehicle's datum",
    "z_ref": "the point of its moments: z, body axes, from the vehicle's datum",
}
#: Stands where only the user knows the answer.
_BLANK: Final = "NUMBER"


@dataclass(frozen=True)
class KnownVehicle:
    """What the vehicle file says, for proposals.

    reference : lengths and moment reference; None where there is no vehicle. has_point : whether
    the moment reference is a fixed point. surfaces : its surfaces and combinations -> full travel
    [rad].
    """

    reference: ReferenceGeometry | None = None
    has_point: bool = False
    surfaces: Mapping[str, float] = field(default_factory=dict)


class Answers:
    """Bindings of an import as answers to questions; what is open is raised by `close`."""

    def __init__(self, bindings: Mapping[str, str], where: str, vehicle: KnownVehicle) -> None:
        self.where, self.vehicle = where, vehicle
        self.notes: list[str] = []
        self._bindings = {name.strip(): text.strip() for name, text in bindings.items()}
        self._stated: dict[str, str] = {}
        self._known: set[str] = set()
        self._questions: dict[str, Question] = {}

    def is_given(self, name: str) -> bool:
        """Return whether a binding answers `name`."""
        self._known.add(name)
        if name not in self._bindings and name in self._stated:
            self._bindings[name] = self._stated[name]
        return name in self._bindings

    def state(self, answers: Mapping[str, str]) -> None:
        """Take what a file says itself (name -> answer), where no binding says otherwise."""
        self._stated.update(answers)

    def ask(self, name: str, text: str, proposals: Collection[tuple[str, str]] = ()) -> None:
        """Leave a question open: the first of `proposals` (answer, when it is right) is the
        default."""
        self._known.add(name)
        given = tuple(proposals) or ((_BLANK, ""),)
        self._questions.setdefault(name, Question(text, name, given))

    def number(
        self,
        name: str,
        unit: str,
        text: str,
        proposals: Collection[tuple[str, str]] = (),
        stated: float | None = None,
        meanwhile: float = 1.0,
    ) -> float:
        """Return a number in `unit` (SI): the answer, else what is `stated`; `meanwhile` until it
        is answered.

        Raises InputError for an answer that is no number.
        """
        if self.is_given(name):
            try:
                return quantity(self._bindings[name], unit)
            except InputError as error:
                raise InputError(error.what, f"--bind {name}", error.remedy) from None
        if stated is not None:
            return stated
        self.ask(name, text, proposals)
        return meanwhile

    def choice(
        self,
        name: str,
        options: Mapping[str, str],
        text: str,
        stated: str = "",
    ) -> str:
        """Return one of `options` (answer -> when it is right): the answer, else what is `stated`;
        the first option while it is open. Raises InputError for another answer."""
        if self.is_given(name):
            if self._bindings[name] not in options:
                raise InputError(
                    f"'{self._bindings[name]}' is none of {', '.join(options)}",
                    f"--bind {name}",
                    nearest(self._bindings[name], options),
                )
            return self._bindings[name]
        if not stated:
            self.ask(name, text, tuple(options.items()))
        return stated or next(iter(options))

    def left_out(self, names: Sequence[str], code: str) -> dict[str, float]:
        """Return the numbers that a file leaves out and `code` has built in: each as answered, or
        all zero by one answer."""
        values = {name: self.number(name, "1", "", (), 0.0) for name in names}
        open_ = [name for name in names if not self.is_given(name)]
        if open_:
            self.choice(
                "left_out",
                {"zero": "if none of them acts; else one --bind NAME=NUMBER each"},
                f"{code} has its own values for what is not in the file ({', '.join(open_)}):"
                " are they zero?",
            )
        return values

    def expression(self, name: str) -> Expression:
        """Return an answer as an expression of channels, in the unit of the file. Raises InputError
        for anything else, KeyError where there is none (`is_given`)."""
        try:
            return parse(self._bindings[name])
        except InputError as error:
            raise InputError(error.what, f"--bind {name}", error.remedy) from None

    def reference(
        self,
        area: float | None = None,
        chord: float | None = None,
        span: float | None = None,
        point: tuple[float, float, float] | None = None,
        offset: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> ReferenceGeometry:
        """Return the reference geometry: each length [m, m2] and the point [m, body axes from the
        vehicle's datum] as answered, else as the file states it; what neither has is asked, with
        the vehicle's as proposal. offset : (3,) [m], of the file's point from the vehicle's."""
        own = self.vehicle.reference
        stated = dict(zip(_LENGTHS, (area, chord, span), strict=True))
        stated |= dict(zip(_POINT, point or (None, None, None), strict=True))
        theirs: dict[str, float] = {}
        if own is not None:
            theirs = dict(zip(_LENGTHS, (own.area, own.chord, own.span), strict=True))
            if self.vehicle.has_point:
                at = (x + dx for x, dx in zip(own.moment_reference, offset, strict=True))
                theirs |= dict(zip(_POINT, at, strict=True))
        open_ = [n for n in theirs if stated[n] is None and not self.is_given(n)]
        if len(open_) > 1:
            told = ", ".join(f"{n} {theirs[n]:.9g}" for n in open_)
            self.choice(
                "reference",
                {"vehicle": f"{told}, as the vehicle file; else one --bind NAME=NUMBER each"},
                f"the file does not state {', '.join(open_)}: are they the vehicle's?",
            )
            stated |= {n: theirs[n] for n in open_}
        values = {}
        for n, value in stated.items():
            proposals = ((f"{theirs[n]:.9g}", "as the vehicle file"),) if n in theirs else ()
            unit = "m^2" if n == "S_ref" else "m"
            text = f"the file does not state {_MEANT[n]} [{unit}]: which is it?"
            values[n] = self.number(n, unit, text, proposals, value)
        for n in _LENGTHS:
            if not values[n] > 0.0:
                raise InputError(f"{n} is {values[n]:g}", self.where, "it must be positive")
        x, y, z = (values[n] for n in _POINT)
        return ReferenceGeometry(values["S_ref"], values["c_ref"], values["b_ref"], (x, y, z))

    @property
    def proposed(self) -> set[str]:
        """All answers that are proposed to open questions."""
        return {answer for each in self._questions.values() for answer, _ in each.proposals}

    def close(self) -> None:
        """Raise OpenQuestionsError with all open questions, and InputError for a binding of what
        the file does not have."""
        unused = sorted(set(self._bindings) - self._known)
        if unused:
            raise InputError(
                f"binding of '{unused[0]}', which the file does not have",
                self.where,
                nearest(unused[0], self._known),
            )
        if self._questions:
            asked = list(self._questions.values())
            raise OpenQuestionsError(
                f"{counted(len(asked), 'question')} before it can be read",
                self.where,
                "import again with one line of each, all in one command:",
                asked,
            )


#: Units of length that aerodynamic codes are used in, in metres.
LENGTHS: Final = {"m": 1.0, "ft": 0.3048, "inch": 0.0254, "cm": 0.01, "mm": 0.001}
#: Relative difference up to which lengths of two files are of one aircraft: three digits printed,
#: and definitions of the chord that differ by some per cent.
_SAME: Final = 0.05


def length_unit(answers: Answers, area: float, chord: float, span: float) -> float:
    """Return the unit of length of a file that does not name it, in metres.

    area, chord, span : as in the file. It is taken without a question where exactly one unit gives
    the vehicle's lengths; see `Answers.choice`.
    """
    own = answers.vehicle.reference
    fitting = [
        name
        for name, scale in LENGTHS.items()
        if own is not None
        and all(
            abs(ours / theirs - 1.0) <= _SAME
            for ours, theirs in (
                (area * scale**2, own.area),
                (chord * scale, own.chord),
                (span * scale, own.span),
            )
        )
    ]
    stated = fitting[0] if len(fitting) == 1 else ""
    if stated:
        answers.notes.append(f"lengths are in {stated}: with that they are the vehicle file's")
    chosen = answers.choice(
        "length_unit",
        {name: f"span {span * scale:.4g} m" for name, scale in LENGTHS.items()},
        f"the file does not say its unit of length (span {span:g}): which one?",
        stated,
    )
    return LENGTHS[chosen]
