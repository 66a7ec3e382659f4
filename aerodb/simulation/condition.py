"""The condition of a trim."""

from dataclasses import dataclass

import numpy as np

from aerodb.errors import InputError


@dataclass(frozen=True)
class Condition:
    """A steady flight in still air, SI.

    Parameters
    ----------
    V : airspeed [m/s].
    altitude : [m].
    climb : flight-path angle [rad]; None: found, with the thrust as given (gliding flight).
    bank, beta, turn_rate : bank angle, sideslip [rad] and rate of turn [rad/s]. Two of them
        determine the third. One alone: `beta` without turn, the others without sideslip; none:
        straight flight without sideslip.
    load_factor : specific force normal to the flight path in the plane of symmetry, in g: of a turn
        to the right, or with `pull_up` of a pull-up without turn (below 1: a push-over).
    hover : whether bank and pitch attitude are found, with a collective and three mixes of the
        inputs that are free: a vehicle that rotors carry. V may then be 0; with `climb` it is the
        speed along a path straight ahead.
    ground : whether legs carry it along a level runway at `altitude`: height, bank and pitch
        attitude are found, at which it neither sinks nor rolls nor pitches. Forces along and across
        and the yawing moment stay as they are. V may be 0.
    """

    V: float
    altitude: float
    climb: float | None = 0.0
    bank: float | None = None
    beta: float | None = None
    turn_rate: float | None = None
    load_factor: float | None = None
    pull_up: bool = False
    hover: bool = False
    ground: bool = False

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is not None and not np.isfinite(value):
                raise InputError(f"{name} is not finite", "trim condition", "give a number")
        if self.V < 0 or (self.V == 0 and not (self.hover or self.ground)):
            raise InputError(
                "no airspeed", "trim condition", "give V [m/s] above zero; rotors carry a hover"
            )
        if self.hover and (
            self.climb is None
            or any(x is not None for x in (self.bank, self.beta, self.turn_rate, self.load_factor))
        ):
            raise InputError(
                "a hover with bank, sideslip, turn, load factor or in a glide",
                "trim condition",
                "leave them out: a hover is straight, and its attitude is found",
            )
        if self.ground and (
            self.hover
            or self.climb != 0.0
            or any(x is not None for x in (self.bank, self.beta, self.turn_rate, self.load_factor))
        ):
            raise InputError(
                "a start on the ground with hover, climb, bank, sideslip, turn or load factor",
                "trim condition",
                "leave them out: it rolls straight ahead, and its attitude is found",
            )
        if self.pull_up and self.load_factor is None:
            raise InputError("a pull-up without load factor", "trim condition", "give it in g")
        stated = [name for name in ("bank", "beta", "turn_rate") if getattr(self, name) is not None]
        turning = self.load_factor is not None and not self.pull_up
        if (turning and {"bank", "turn_rate"} & set(stated)) or (
            self.pull_up and "turn_rate" in stated
        ):
            raise InputError(
                f"the load factor and {' and '.join(stated)} together",
                "trim condition",
                "a turn is given by bank, turn rate or load factor; a pull-up does not turn",
            )
        if len(stated) == 3:
            raise InputError(
                "bank, beta and turn_rate together", "trim condition", "give two: the third follows"
            )

    @property
    def fixed(self) -> dict[str, float]:
        """Those of bank (as phi) [rad], beta [rad] and turn rate [rad/s] that are given, as
        scalars; the trim finds the others."""
        stated = {"phi": self.bank, "beta": self.beta, "turn_rate": self.turn_rate}
        given = {name: value for name, value in stated.items() if value is not None}
        if self.load_factor is not None and not self.pull_up:
            return {"beta": 0.0, **given}
        if self.pull_up:
            return {"turn_rate": 0.0, **({} if given else {"beta": 0.0}), **given}
        if not given:
            return {"beta": 0.0, "turn_rate": 0.0}
        if len(given) == 1:
            return {"turn_rate": 0.0, **given} if "beta" in given else {"beta": 0.0, **given}
        return given
