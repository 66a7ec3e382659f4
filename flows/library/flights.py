"""From a log to residuals: reconstruction, total coefficients, comparison with a database."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.coefficients import Coefficients, Comparison
from aerodb.coefficients import compare as compare_coefficients
from aerodb.coefficients import total_coefficients as total_coefficients_of
from aerodb.consistency import make_consistent
from aerodb.flight import Flight
from aerodb.flows.library.logs import Log, load_database
from aerodb.flows.library.views import (
    Data,
    Result,
    Summary,
    Values,
    axis_coordinate,
    channel_values,
    number,
    over_axes,
    shown_unit,
    time_coordinate,
)
from aerodb.report import sensor_error_unit
from aerodb.support import Array, half_interval
from aerodb.suspicions import limited_document, limits_flight
from aerodb.tables import AeroDatabase
from aerodb.vehicle import Vehicle, with_mass_channels

#: Most sensor errors, and axes, that headlines name.
_FEW = 3


@dataclass(frozen=True, eq=False, repr=False)
class ReconstructedFlight(Result):
    """A flight whose sensors agree with its motion.

    flight : corrected channels. sigma : channel -> (n,), standard errors of V, alpha, beta and
    attitude, SI. document : estimates of sensor errors, verdict, reasons, as in
    docs/reference/contract.md.
    """

    log: Log
    flight: Flight
    sigma: Mapping[str, Array]
    document: Mapping[str, Any]

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle that flew."""
        return self.log.vehicle

    @property
    def verdict(self) -> str:
        """``good``, ``limited`` or ``rejected`` (docs/reference/conventions.md, section
        "Consistency verdicts")."""
        return str(self.document["verdict"])

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the flight is not good, one sentence each."""
        return tuple(self.document["reasons"])

    def headlines(self) -> list[str]:
        """Return the verdict, its first reason, and the sensor errors known best, in the SI unit of
        each."""
        said = self.summary()
        lines = [f"{said.title}: {self.verdict}", *(f"  because  {r}" for r in self.reasons[:1])]
        applied = [row for row in said.rows if row[-1] == "yes"][:_FEW]
        lines += [f"  {name}  {value} +- {error} {unit}" for name, value, error, unit, _ in applied]
        return lines

    def summary(self) -> Summary:
        """Return verdict and sensor errors, scalars in the SI unit of each."""
        rows = [
            (
                each["parameter"],
                number(each["value"]),
                number(half_interval(each["standard_error"]), 2),
                shown_unit(sensor_error_unit(each["parameter"])),
                "yes" if each["applied"] else "no",
            )
            for each in self.document.get("estimates", ())
            if each["stretch"] is None
        ]
        sources = [f"{name} {text}" for name, text in self.document.get("used", {}).items()]
        facts = [("verdict", self.verdict), ("channels", "; ".join(sources) or "as logged")]
        return Summary(
            f"reconstruction of {self.log.name}",
            facts,
            ("sensor error", "value", "+-", "unit", "applied"),
            rows,
            [*self.reasons, *self.document["notes"]],
        )

    def data(self) -> Data:
        """Return the corrected channels and their standard errors, (n,) over time [s], in SI
        units."""
        quantities = channel_values(self.flight.channels)
        quantities |= channel_values(self.sigma, "sigma_")
        return Data(
            "time",
            {"time": time_coordinate(self.flight.time)},
            quantities,
            {"flight": self.flight.id, "verdict": self.verdict},
        )


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredCoefficients(Result):
    """Total aerodynamic coefficients of a flight, with standard deviations and usable samples.

    flight : its channels, with mass properties. coefficients : in the vehicle's geometry.
    """

    reconstructed: ReconstructedFlight
    flight: Flight
    coefficients: Coefficients

    def summary(self) -> Summary:
        """Return mean, spread and noise of each axis, dimensionless scalars; the bandwidth is in
        [Hz]."""
        found = self.coefficients
        rows = []
        for axis, values in found.values.items():
            good = found.usable[axis]
            some = bool(good.any())
            rows.append(
                (
                    axis,
                    str(int(good.sum())),
                    number(float(values[good].mean()) if some else None),
                    number(float(values[good].std()) if some else None),
                    number(float(np.median(found.sigma[axis][good])) if some else None, 2),
                )
            )
        band = "not limited" if found.bandwidth is None else f"{found.bandwidth:g} Hz"
        return Summary(
            f"coefficients of {self.reconstructed.log.name}",
            [("bandwidth", band)],
            ("axis", "samples", "mean [-]", "standard deviation [-]", "noise [-]"),
            rows,
            found.notes,
        )

    def data(self) -> Data:
        """Return values and standard deviations (dimensionless) and usable samples over axis and
        time [s], (m, n)."""
        found = self.coefficients
        axes = list(found.values)
        parts = {"measured": found.values, "sigma": found.sigma, "usable": found.usable}
        return Data(
            "time",
            {"axis": axis_coordinate(axes), "time": time_coordinate(found.time)},
            over_axes(axes, "time", parts),
            {"flight": self.flight.id},
        )


@dataclass(frozen=True, eq=False, repr=False)
class ComparedFlight(Result):
    """A flight's coefficients compared with those that a database predicts for the same inputs.

    comparison : in the database's geometry and about its moment reference.
    """

    measured: MeasuredCoefficients
    database: AeroDatabase
    comparison: Comparison

    def residual(self, axis: str) -> Array:
        """Return measured - predicted on an axis (CX CY CZ Cl Cm Cn C_lift C_drag C_side), (n,),
        dimensionless."""
        return self.comparison.residual(axis)

    def headlines(self) -> list[str]:
        """Return the axes whose residual is largest beside what was measured (dimensionless
        rms)."""
        found = self.comparison
        rows = [(axis, found.summary(axis)) for axis in found.measured]
        rows = [(axis, each) for axis, each in rows if each["rms_measured"] > 0.0]
        rows.sort(key=lambda row: -row[1]["rms_residual"] / row[1]["rms_measured"])
        lines = [
            f"  {axis}  flight - database {number(each['rms_residual'], 3)} of"
            f" {number(each['rms_measured'], 3)} rms, noise floor {number(each['noise_floor'], 2)}"
            for axis, each in rows[:_FEW]
        ]
        return [self.summary().title, *lines]

    def summary(self) -> Summary:
        """Return the rms of each axis, measured, residual and noise floor: dimensionless
        scalars."""
        found = self.comparison
        rows = []
        for axis in found.measured:
            each = found.summary(axis)
            numbers = (each["rms_measured"], each["rms_residual"], each["noise_floor"])
            rows.append((axis, str(each["samples"]), *map(number, numbers)))
        return Summary(
            f"{self.measured.reconstructed.log.name} beside {self.database.name}",
            [("left out", ", ".join(found.left_out) or "no axis")],
            ("axis", "samples", "rms measured [-]", "rms residual [-]", "noise floor [-]"),
            rows,
            found.notes,
        )

    def data(self) -> Data:
        """Return measured, predicted, residual and sigma (dimensionless) and usable over axis and
        time [s], (m, n)."""
        found = self.comparison
        axes = list(found.measured)
        parts: dict[str, Mapping[str, Any]] = {
            "measured": found.measured,
            "predicted": found.predicted,
            "residual": {axis: found.residual(axis) for axis in axes},
            "sigma": found.sigma,
            "usable": found.usable,
        }
        outside = Values(("time",), found.outside, "1", "an argument lies outside the tables")
        return Data(
            "time",
            {"axis": axis_coordinate(axes), "time": time_coordinate(found.time)},
            {**over_axes(axes, "time", parts), "outside": outside},
            {"flight": found.flight, "database": self.database.name},
        )


def reconstruct(log: Log) -> ReconstructedFlight:
    """Make a flight (channels (n,), SI units) consistent with its motion: sensor errors, corrected
    channels, a verdict.

    A flight without vanes gets alpha, beta and wind from its motion. A flight that cannot be
    checked has the verdict ``limited`` with the reason; nothing is raised
    (`aerodb.consistency.make_consistent`).
    """
    made = make_consistent(log.flight, log.vehicle, log.calibration)
    suspected = [each.remark for each in log.conditioning.suspicions if limits_flight(each)]
    return ReconstructedFlight(
        log, made.flight, made.sigma, limited_document(made.document, suspected)
    )


def total_coefficients(flight: ReconstructedFlight) -> MeasuredCoefficients:
    """Return CX CY CZ Cl Cm Cn of a flight, by Newton's and Euler's equations less thrust
    (`aerodb.coefficients.total_coefficients`).

    Raises InputError where no axis can be computed.
    """
    found = total_coefficients_of(flight.flight, flight.vehicle, angular_acceleration="chosen")
    return MeasuredCoefficients(flight, with_mass_channels(flight.flight, flight.vehicle), found)


def compare(measured: MeasuredCoefficients, database: AeroDatabase | str | Path) -> ComparedFlight:
    """Compare a flight's coefficients with a database's prediction for the same inputs
    (`aerodb.coefficients.compare`).

    database : or the file of one, which `load_database` reads.
    Raises InputError naming the inputs of the database that the flight lacks.
    """
    if not isinstance(database, AeroDatabase):
        database = load_database(database)
    reference = measured.reconstructed.vehicle.reference
    found = compare_coefficients(measured.flight, measured.coefficients, database, reference)
    return ComparedFlight(measured, database, found)
