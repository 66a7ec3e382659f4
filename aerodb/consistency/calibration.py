"""A calibration: sensor parameters with their covariance, from flights, as an immutable version.

Flights that are processed later take it as what is known of their sensors beforehand. Whether a
flight's own estimate still agrees with it is `drift`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from aerodb.errors import InputError
from aerodb.support import Array, key_of

#: A flight's own estimate beyond this many standard errors from its calibration is a reason to
#: calibrate anew.
DRIFT = 3.0


@dataclass(frozen=True)
class Calibration:
    """Sensor parameters of a vehicle.

    names : as in `parameters.known_names`, without scope. values (k,) and covariance (k, k), SI.
    flights : ids of those that it was estimated from. valid_from, valid_until : UTC of the start of
    flights that it is for; None: without limit.
    """

    vehicle: str
    names: tuple[str, ...]
    values: Array
    covariance: Array
    flights: tuple[str, ...] = ()
    valid_from: datetime | None = None
    valid_until: datetime | None = None

    def __post_init__(self) -> None:
        k = len(self.names)
        if (
            self.values.shape != (k,)
            or self.covariance.shape != (k, k)
            or len(set(self.names)) != k
        ):
            raise InputError(
                f"{k} names, values {self.values.shape}, covariance {self.covariance.shape}",
                "calibration",
            )
        if not np.isfinite(self.values).all() or (
            k and np.linalg.eigvalsh(self.covariance)[0] <= 0
        ):
            raise InputError(
                "values are not finite, or the covariance is not positive", "calibration"
            )

    @property
    def id(self) -> str:
        """sha256 of the canonical JSON of its content: the same calibration has the same id on
        every machine."""
        return key_of(self.document())

    @property
    def standard_errors(self) -> Array:
        """(k,) one sigma of each value."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def by_name(self) -> dict[str, tuple[float, float]]:
        """Name -> value and its standard error."""
        pairs = zip(self.values.tolist(), self.standard_errors.tolist(), strict=True)
        return dict(zip(self.names, pairs, strict=True))

    def only(self, names: Iterable[str]) -> "Calibration":
        """What it says of these parameters alone (others integrated out), in its own order."""
        wanted = set(names)
        index = [number for number, name in enumerate(self.names) if name in wanted]
        part = tuple(self.names[number] for number in index)
        spread = self.covariance[np.ix_(index, index)]
        return Calibration(
            self.vehicle,
            part,
            self.values[index],
            spread,
            self.flights,
            self.valid_from,
            self.valid_until,
        )

    def valid_at(self, start: datetime | None) -> bool:
        """Whether it is for a flight that started at `start`; a flight of unknown start needs one
        without limits."""
        if start is None:
            return self.valid_from is None and self.valid_until is None
        return (self.valid_from is None or start >= self.valid_from) and (
            self.valid_until is None or start < self.valid_until
        )

    def document(self) -> dict[str, Any]:
        """As a JSON document, from which `from_document` makes it again."""
        return {
            "vehicle": self.vehicle,
            "parameters": {
                name: float(value) for name, value in zip(self.names, self.values, strict=True)
            },
            "order": list(self.names),
            "covariance": self.covariance.tolist(),
            "flights": sorted(self.flights),
            "valid_from": _text(self.valid_from),
            "valid_until": _text(self.valid_until),
        }


def from_document(document: Mapping[str, Any]) -> Calibration:
    """The calibration of a stored document; InputError when it is none."""
    try:
        names = tuple(document["order"])
        return Calibration(
            document["vehicle"],
            names,
            np.array([document["parameters"][name] for name in names], dtype=np.float64),
            np.array(document["covariance"], dtype=np.float64).reshape(len(names), len(names)),
            tuple(document["flights"]),
            _time(document["valid_from"]),
            _time(document["valid_until"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"not a calibration: {error}", "stored calibration", "restore it from a backup"
        ) from error


@dataclass(frozen=True)
class Drift:
    """A parameter whose estimate from one flight alone is far from its calibration; `distance` in
    standard errors of both."""

    name: str
    own: float
    calibrated: float
    distance: float

    @property
    def because(self) -> str:
        """One plain sentence."""
        figures = f"{self.own:.3g} in this flight, {self.calibrated:.3g} in its calibration"
        return (
            f"recalibrate: {self.name} has drifted by {self.distance:.1f} standard errors"
            f" ({figures})"
        )


def drift(
    calibration: Calibration, names: Sequence[str], values: Array, standard_errors: Array
) -> tuple[Drift, ...]:
    """Parameters of a flight's own estimate (made without the calibration) that differ by more than
    `DRIFT` sigma from it."""
    known, found = calibration.by_name, []
    for name, value, error in zip(names, values, standard_errors, strict=True):
        if name in known:
            centre, spread = known[name]
            distance = abs(float(value) - centre) / float(np.hypot(error, spread))
            if distance > DRIFT:
                found.append(Drift(name, float(value), centre, distance))
    return tuple(found)


def _text(time: datetime | None) -> str | None:
    return None if time is None else time.astimezone(UTC).isoformat()


def _time(text: str | None) -> datetime | None:
    return None if text is None else datetime.fromisoformat(text)
