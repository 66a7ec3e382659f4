"""The expressions of one part: names of its own in place of the aircraft's."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from aerodb.errors import InputError
from aerodb.parts.frame import Frame
from aerodb.tables import Expression, Name, Operation, Term, Variable, number, parse, substituted

if TYPE_CHECKING:
    from aerodb.parts.wake import MovingAir

#: Unit and meaning of the variables of a part, by the end of their names.
_MEANING: Final = {
    "u": ("m/s", "velocity through the air along its x axis"),
    "v": ("m/s", "velocity through the air along its y axis"),
    "w": ("m/s", "velocity through the air along its z axis"),
    "V": ("m/s", "speed through the air"),
    "alpha": ("rad", "local angle of attack, deflections included"),
    "beta": ("rad", "local angle of sideslip"),
    "qbar": ("Pa", "local dynamic pressure"),
    "downwash": ("rad", "downwash angle"),
    "lift": ("1", "local lift coefficient"),
    "drag": ("1", "local drag coefficient"),
    "sideforce": ("1", "local side force coefficient"),
    "thrust": ("N", "thrust"),
    "n": ("Hz", "revolutions per second"),
    "J": ("1", "advance ratio"),
    "tilt": ("rad", "angle by which its axis is turned"),
    "tilt_told": ("rad", "angle by which its axis is to be turned, within its limits or not"),
    "induced": ("m/s", "velocity that it induces at its disc"),
    "compression": ("m", "depth of the unloaded wheel below the ground; negative above it"),
    "closing": ("m/s", "rate of its compression"),
    "load": ("N", "force of the ground on its wheel"),
    "steering": ("rad", "angle by which its wheel is turned nose right"),
    "rolling": ("m/s", "velocity of its wheel over the ground along the wheel"),
    "sliding": ("m/s", "velocity of its wheel over the ground across the wheel"),
    "slip": ("rad", "slip angle of its wheel"),
    "friction": ("1", "rolling friction coefficient"),
    "side_limit": ("1", "largest side force coefficient"),
    "saturation": ("1", "slip angle over that of the largest side force, times 1.5"),
    "aside": ("rad", "heading of the aircraft less that of its axis"),
    **{f"right_{k}": ("1", f"unit vector to the right of its axis along body {k}") for k in "xyz"},
    **{f"below_{k}": ("1", f"unit vector below its axis along body {k}") for k in "xyz"},
    "away_right": ("m", "moment reference to the right of its axis"),
    "away_below": ("m", "moment reference below its axis"),
    "strength": ("m^2/s", "circulation over 2 pi"),
    "core": ("m", "core radius"),
    "half": ("m", "half the spacing of its vortices"),
    **{
        name + end: (unit, f"{meaning} of the wake{where}")
        for end, where in (("", ""), ("_there", " where the air is measured"))
        for name, unit, meaning in (
            ("wake_y", "m", "place to the right of the axis"),
            ("wake_z", "m", "place below the axis"),
            ("wake_right", "m/s", "velocity of the air to the right of the axis"),
            ("wake_below", "m/s", "velocity of the air below the axis"),
        )
    },
    "x": ("N", "force along its x axis"),
    "y": ("N", "force along its y axis"),
    "z": ("N", "force along its z axis"),
    **{f"root_{name}": ("m/s", f"velocity {name} at its root") for name in "uvw"},
    **{
        f"tip_{name}": ("m/s", f"velocity {name} at its tip beyond that at its root")
        for name in "uvw"
    },
    **{f"slip_{name}": ("m/s", f"velocity {name} of the slipstream at its disc") for name in "uvw"},
    **{f"{name}_arm": ("N", f"force {name} by its place, 0 root to 1 tip") for name in "xz"},
}


@dataclass
class Writer:
    """Collects the variables and terms of one part.

    Parameters
    ----------
    part : its name in the file. name : what its variables begin with: of a mirrored part, with its
        side.
    where : its place in the file, such as ``[parts.tail]``. side : 1 on the right, -1 on the left.
    """

    part: str
    name: str
    where: str
    side: float = 1.0
    #: The wake that the part is in.
    air: "MovingAir | None" = None
    variables: dict[str, Variable] = field(default_factory=dict)
    terms: list[Term] = field(default_factory=list)
    #: Name in a formula of the part -> what it stands for.
    local: dict[str, Expression] = field(default_factory=dict)
    #: The same, for variables that are only defined where a formula uses them.
    offered: dict[str, Expression] = field(default_factory=dict)
    #: Variable or term -> key of the file that it is from.
    keys: dict[str, str] = field(default_factory=dict)

    def define(self, what: str, expression: Expression, key: str = "") -> Name:
        """Add the variable ``<part>_<what>``, which formulas of the part know as `what`.

        Its unit is that of `_MEANING`. key : of the file, where the expression is the user's.
        """
        name = f"{self.name}_{what}"
        unit, meaning = _MEANING[what]
        self.variables[name] = Variable(expression, unit, f"{self.name}: {meaning}", part=self.part)
        self.keys[name] = key
        self.local[what] = Name(name)
        return Name(name)

    def offer(self, what: str, expression: Expression) -> None:
        """Let formulas read on use a variable, SI, that is defined when the first of them does."""
        self.offered[what] = expression

    def velocity(self, frame: Frame) -> list[Expression]:
        """Return the velocity [m/s] of a part through the air along its axes: still air, or the air
        of a wake at its place."""
        moving = [frame.velocity(k) for k in range(3)]
        if self.air is None:
            return moving
        felt = self.air.felt(frame, self)
        return [Operation("-", one, other) for one, other in zip(moving, felt, strict=True)]

    def read(self, text: str, key: str) -> Expression:
        """Return a formula of the file, in which local names are those of the part.

        Values are in SI units. Raises InputError with the place, such as ``[parts.tail] lift``.
        """
        tree = self.parsed(text, key)
        for name in sorted(tree.names & self.offered.keys()):
            self.define(name, self.offered.pop(name))
        return substituted(tree, self.local)

    def parsed(self, text: str, key: str) -> Expression:
        """Return a formula of the file as it is; ``side`` is a number in it.

        Values are in SI units. Raises InputError with the place.
        """
        try:
            tree = parse(self.text(text))
        except InputError as error:
            raise InputError(error.what, f"{self.where} {key}", error.remedy) from None
        return substituted(tree, {"side": number(self.side)})

    def text(self, text: str) -> str:
        """Return a text with ``{side}`` replaced by right or left."""
        return text.replace("{side}", "right" if self.side > 0 else "left")

    def act(
        self,
        frame: Frame,
        forces: tuple[Expression | None, ...],
        moments: tuple[Expression | None, ...] = (None, None, None),
        end: str = "",
        key: str = "",
        only_moments: bool = False,
    ) -> None:
        """Add the load terms of forces [N] and moments [N m] in the part's axes.

        end : of the terms' names, after that of the part. key : of the file. only_moments : the
        forces themselves are in other terms.
        """
        for axis, expression in frame.loads(forces, moments).items():
            if only_moments and axis.startswith("F"):
                continue
            name = f"{self.name}{end}_{axis}"
            self.terms.append(Term(name, axis, expression, self.name, part=self.part))
            self.keys[name] = key
