"""The noise floor: a known error of the state gives what it makes of the coefficient."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients import compare, total_coefficients
from aerodb.consistency import StateNoise
from aerodb.loop import ReconstructionErrors, noise_floors_of
from aerodb.signals import rms
from aerodb.vehicle import Sensor, with_measured
from tests.aerodb.loop.test_axis_models import database, flights
from tests.support.flights_in_memory import FlightsInMemory

ERROR = 0.002  # rad, of alpha


class Known(FlightsInMemory):
    """Flights in calm air whose reconstruction is not sure of alpha: by a constant, and by noise up
    to 1 Hz."""

    def reconstruction(self, flight: str) -> ReconstructionErrors:
        noise = StateNoise(
            "sensor", (0.1, 1.1), {"alpha": ERROR}, {"alpha": (ERROR**2,)}, 0.0, {"alpha": (0.0,)}
        )
        return replace(ReconstructionErrors(), noise=noise)


@pytest.fixture(scope="module")
def source() -> FlightsInMemory:
    return flights(range(60, 62), noise=0.0)


def slope(source: FlightsInMemory, id: str) -> float:
    """rms of dCm/dalpha along a flight."""
    channels, step = source.flight(id).channels, 1e-4
    moved = {**channels, "alpha": channels["alpha"] + step}
    two = [database(1.0).predict(c).coefficients["Cm"] for c in (moved, channels)]
    return rms((two[0] - two[1]) / step)


def test_a_known_error_of_alpha_is_its_slope_times_the_error(source: FlightsInMemory) -> None:
    """Both parts are ERROR rms: together sqrt(2) of it; two draws of the noise give it to a fifth."""
    known, (id, *_) = Known(source.vehicle, source.flown), tuple(source.flown)
    white = noise_floors_of(source, [id], database(1.0))[id]["Cm"].total
    expected = ERROR * slope(source, id)
    floor = noise_floors_of(known, [id], database(1.0))[id]["Cm"].total
    assert expected > 3.0 * white
    assert floor == pytest.approx(np.sqrt(2.0) * expected, rel=0.2)


def test_without_a_reconstruction_the_floor_is_the_sensors_noise(source: FlightsInMemory) -> None:
    id = next(iter(source.flown))
    beside = source.comparison(id, database(1.0))
    floors = noise_floors_of(source, [id], database(1.0))[id]
    assert floors["Cm"].level == 0.0
    assert floors["Cm"].shape == pytest.approx(rms(beside.sigma["Cm"][beside.usable["Cm"]]))


def test_the_stated_noise_of_a_deflection_is_felt_by_the_prediction_alone(
    source: FlightsInMemory,
) -> None:
    """Against white noise added to the deflection of the log, compared as any flight is."""
    id, name = next(iter(source.flown)), "delta_elevator"
    flight, clean = source.flight(id), source.comparison(id, database(1.0))
    drawn = ERROR * np.random.default_rng(3).standard_normal(len(flight.time))
    noisy = flight.with_channels({name: flight[name] + drawn})
    beside = compare(
        noisy, total_coefficients(noisy, source.vehicle), database(1.0), source.vehicle.reference
    )
    expected = rms((beside.residual("Cm") - clean.residual("Cm"))[clean.usable["Cm"]])
    sensors = {**source.vehicle.sensors, name: Sensor(noise=ERROR)}
    stated = source.vehicle.model_copy(update={"sensors": sensors})
    floor = noise_floors_of(FlightsInMemory(stated, source.flown), [id], database(1.0))[id]["Cm"]
    assert expected > 2.0 * noise_floors_of(source, [id], database(1.0))[id]["Cm"].total
    assert floor.total == pytest.approx(expected, rel=0.1)


def test_the_stated_error_of_the_cg_is_in_the_floor(source: FlightsInMemory) -> None:
    """Against the coefficients of the same flight about a CG elsewhere: their change is in the floor,
    its mean and the rest apart, and with nothing stated nothing is."""
    id, sigma = next(iter(source.flown)), 0.05
    flight, vehicle, whole = source.flight(id), source.vehicle, database(1.0)
    x, y, z = vehicle.mass.cg
    moved = vehicle.model_copy(
        update={"mass": vehicle.mass.model_copy(update={"cg": (x - sigma, y, z)})}
    )
    here, there = (
        compare(flight, total_coefficients(flight, each), whole, vehicle.reference)
        for each in (vehicle, moved)
    )
    plain = noise_floors_of(source, [id], whole)[id]
    stated = with_measured(vehicle, [f"cg_x={sigma} m"])
    floors = noise_floors_of(FlightsInMemory(stated, source.flown), [id], whole)[id]
    change = (there.residual("Cm") - here.residual("Cm"))[here.usable["Cm"]]
    assert rms(change) > 3.0 * plain["Cm"].total
    close = 0.02 * rms(change)
    assert floors["Cm"].level == pytest.approx(abs(change.mean()), abs=close)
    expected = np.hypot(plain["Cm"].shape, change.std())
    assert floors["Cm"].shape == pytest.approx(expected, abs=close)
