"""Sensor calibration from flights: parameters with their covariance, as an immutable version.

It is the prior of the sensor parameters of flights processed later. `drift` tests whether a
flight's own estimates still agree with it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from aerodb.errors import InputError
from aerodb.support import DIFFERENCE, Array, key_of, standard_errors

#: Distance in standard errors between a flight's own estimate and the calibration from which on
#: recalibration is due.
DRIFT = standard_errors(DIFFERENCE)


@dataclass(frozen=True)
class Calibration:
    """Sensor parameters of a vehicle.

    vehicle : name.
    names : k parameter names as in `parameters.known_names`, without scope.
    values : (k,), SI.
    covariance : (k, k), SI, positive definite.
    flights : ids of the flights that it was estimated from.
    valid_from, valid_until : range of start times (UTC) of the flights that it applies to; None: no
        limit.

    Raises InputError when shapes disagree, values are not finite, or the covariance is not positive
    definite.
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
                "give k unique names, k values and a (k, k) covariance",
            )
        if not np.isfinite(self.values).all() or (
            k and np.linalg.eigvalsh(self.covariance)[0] <= 0
        ):
            raise InputError(
                "values are not finite, or the covariance is not positive definite", "calibration"
            )

    @property
    def id(self) -> str:
        """SHA-256 (64 hexadecimal digits) of the canonical JSON (RFC 8785) of its content, values
        in SI units, the same on every machine."""
        return key_of(self.document())

    @property
    def standard_errors(self) -> Array:
        """(k,) standard errors, SI."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def by_name(self) -> dict[str, tuple[float, float]]:
        """Name -> (value, standard error), SI."""
        pairs = zip(self.values.tolist(), self.standard_errors.tolist(), strict=True)
        return dict(zip(self.names, pairs, strict=True))

    def only(self, names: Iterable[str]) -> "Calibration":
        """Return the marginal calibration of these parameters, in its own order.

        values (j,), covariance (j, j), SI, of the j that it has; the others are integrated out.
        """
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
        """Return whether it applies to a flight that started at `start`; an unknown start (None)
        needs a calibration without limits.

        Aware times; the range is half open. Source: `docs/method/consistency.md`, section
        "Calibrations".
        """
        if start is None:
            return self.valid_from is None and self.valid_until is None
        return (self.valid_from is None or start >= self.valid_from) and (
            self.valid_until is None or start < self.valid_until
        )

    def document(self) -> dict[str, Any]:
        """As a JSON document; `from_document` reads it back.

        Parameters name -> value, SI; covariance (k, k) as lists in the order of `order`; times as
        text.
        """
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
    """The calibration in a stored document of `Calibration.document`: k values, covariance (k, k),
    SI.

    Raises InputError when it is not one.
    """
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
    """A parameter whose estimate from one flight alone is far from the calibration.

    own, calibrated : both values, SI. distance : in standard errors of their difference.
    """

    name: str
    own: float
    calibrated: float
    distance: float

    @property
    def because(self) -> str:
        """The finding as one sentence, which is stored with the flight: both values in SI units,
        distance in standard errors."""
        figures = f"{self.own:.3g} in this flight, {self.calibrated:.3g} in its calibration"
        return (
            f"recalibrate: {self.name} has drifted by {self.distance:.1f} standard errors"
            f" ({figures})"
        )


def drift(
    calibration: Calibration, names: Sequence[str], values: Array, standard_errors: Array
) -> tuple[Drift, ...]:
    """Parameters that differ by more than `DRIFT` standard errors from the calibration.

    Parameters
    ----------
    names, values, standard_errors : (k,) estimates of one flight, made without the calibration, SI.
    """
    known, drifts = calibration.by_name, []
    for name, value, error in zip(names, values, standard_errors, strict=True):
        if name in known:
            centre, spread = known[name]
            distance = abs(float(value) - centre) / float(np.hypot(error, spread))
            if distance > DRIFT:
                drifts.append(Drift(name, float(value), centre, distance))
    return tuple(drifts)


def _text(time: datetime | None) -> str | None:
    return None if time is None else time.astimezone(UTC).isoformat()


def _time(text: str | None) -> datetime | None:
    return None if text is None else datetime.fromisoformat(text)
