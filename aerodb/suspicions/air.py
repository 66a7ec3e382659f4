"""Density, pressure, temperature, altitude, airspeed and dynamic pressure against each other."""

import numpy as np

from aerodb.conditioning import Suspicion
from aerodb.flight import Flight
from aerodb.physics import density, speed_of_sound, standard_atmosphere
from aerodb.support import SMALL
from aerodb.suspicions.in_flight import HUGE, flying, middle

#: Coldest air in which aircraft fly, that of the coldest tropopause, with a margin [K].
COLDEST = 170.0
#: Hottest such air, that of the hottest desert, with a margin [K].
HOTTEST = 335.0
#: Largest share by which density, dynamic pressure and airspeed may differ from each other: 2 % of
#: airspeed, twice, and density. Moist air of 40 degC is 2.8 % lighter than dry air.
AIR_DATA = 0.06
#: Largest difference between altitude and pressure altitude [m]: an altimeter setting of +-50 hPa,
#: a ground 1000 m high.
ALTITUDE = 1500.0
#: Share by which air may be colder or warmer than standard; as much of the altitude adds to that
#: difference.
SHARE = 0.15
#: Share of the samples of a channel in which all others are known, from which those are compared:
#: fewer are no middle of a flight.
ALIKE = SMALL


def air_suspicions(flight: Flight) -> tuple[Suspicion, ...]:
    """Return contradictions of the air data: a unit, a sensor or a setting that is wrong.

    Medians over the samples in flight are compared: ideal gas, ``qbar = rho V^2 / 2`` (with
    compressibility where the Mach number is known: a pitot-static pressure is no fault), the
    standard atmosphere.

    Pressures [Pa], density [kg/m^3], temperatures [K]. Source: `docs/method/consistency.md`,
    section "Against the vehicle". Channels are (n,).
    """
    names = ("rho", "static_pressure", "temperature", "altitude", "qbar", "V", "mach")
    there = [name for name in names if name in flight]
    where = flying(flight, [name for name in there if name in ("V", "qbar")])
    at = {}
    alike = where & flight.usable(there, despite=("implausible", "stuck"))
    for name in there:  # over the same samples, where one of them failed for a part of the flight
        own = where & flight.usable([name], despite=("implausible", "stuck"))
        good = alike if alike.sum() > ALIKE * own.sum() else own
        if np.isfinite(value := middle(flight[name], good)):
            at[name] = value
    listed = [
        _not_positive(name, at[name])
        for name in at
        if _positive(name) and not 0.0 < at[name] < HUGE
    ]
    if listed:
        return tuple(listed)
    listed += _temperature(at)
    return (*listed, *_gas(at), *_dynamic(at), *_sound(at), *_height(at))


def _positive(name: str) -> bool:
    return name in ("rho", "static_pressure", "temperature", "qbar", "V")


def _not_positive(name: str, value: float) -> Suspicion:
    words = (
        f"the median of {name} in flight is {value:.4g} (SI): it was not recorded, or is no {name}"
    )
    return Suspicion(name, "unit", words, {"median": value})


def _temperature(at: dict[str, float]) -> list[Suspicion]:
    value = at.get("temperature")
    if value is None or COLDEST < value < HOTTEST:
        return []
    celsius = ": it is in degC, declared as K" if -100.0 < value < 62.0 else ""
    words = f"the median of temperature is {value:.4g} K, no temperature of the air{celsius}"
    return [Suspicion("temperature", "unit", words, {"median": value})]


def _gas(at: dict[str, float]) -> list[Suspicion]:
    if not {"rho", "static_pressure", "temperature"} <= at.keys():
        return []
    pressure, temperature = at["static_pressure"], at["temperature"]
    expected = float(density(np.asarray(pressure), np.asarray(temperature)))
    ratio = at["rho"] / expected
    if abs(ratio - 1.0) <= AIR_DATA:
        return []
    words = (
        f"rho is {at['rho']:.4g} kg/m^3, but {pressure:.6g} Pa at {temperature:.5g} K is air of"
        f" {expected:.4g} kg/m^3 (ratio {ratio:.4g}){_unit_of_density(ratio)}"
    )
    return [Suspicion("rho", "unit", words, {"ratio": ratio, "expected": expected})]


def _dynamic(at: dict[str, float]) -> list[Suspicion]:
    if not {"rho", "V", "qbar"} <= at.keys():
        return []
    ratio = 2.0 * at["qbar"] / (at["rho"] * at["V"] ** 2)
    mach = at.get("mach", at["V"] / 295.0)
    impact = ((1.0 + 0.2 * mach**2) ** 3.5 - 1.0) / (0.7 * mach**2) if 0.05 < mach < 1.0 else 1.0
    if 1.0 - AIR_DATA <= ratio <= impact + AIR_DATA:
        return []
    words = (
        f"qbar is {at['qbar']:.5g} Pa, but rho {at['rho']:.4g} kg/m^3 and V {at['V']:.4g} m/s give"
        f" {at['qbar'] / ratio:.5g} Pa (ratio {ratio:.4g})"
        f"{_unit_of_density(1.0 / ratio) or ': one of the three is wrong, or in another unit'}"
    )
    return [Suspicion("qbar", "unit", words, {"ratio": ratio})]


def _sound(at: dict[str, float]) -> list[Suspicion]:
    if not {"V", "mach"} <= at.keys() or not 0.0 < at["mach"] < HUGE:
        return []
    if "temperature" not in at:
        slowest, fastest = (float(v) for v in speed_of_sound(np.array([COLDEST, HOTTEST])))
        speed = at["V"] / at["mach"]
        if (1.0 - AIR_DATA) * slowest <= speed <= (1.0 + AIR_DATA) * fastest:
            return []
        words = (
            f"V is {at['V']:.4g} m/s at Mach {at['mach']:.4g}, a speed of sound of {speed:.4g} m/s"
            f" (air: {slowest:.3g} to {fastest:.3g} m/s): one of the two is wrong, or in another"
            " unit"
        )
        return [Suspicion("V", "unit", words, {"speed_of_sound": speed})]
    expected = at["mach"] * float(speed_of_sound(np.asarray(at["temperature"])))
    ratio = at["V"] / expected
    if not at["temperature"] > COLDEST or abs(ratio - 1.0) <= AIR_DATA:
        return []
    words = (
        f"V is {at['V']:.4g} m/s, but Mach {at['mach']:.4g} at {at['temperature']:.4g} K is"
        f" {expected:.4g} m/s (ratio {ratio:.4g}): one of the three is wrong, or in another unit"
    )
    return [Suspicion("V", "unit", words, {"ratio": ratio})]


def _height(at: dict[str, float]) -> list[Suspicion]:
    if "altitude" not in at or not -500.0 < at["altitude"] < 60000.0:
        return []
    altitude = at["altitude"]
    standard = standard_atmosphere(np.asarray(altitude))
    margin = ALTITUDE + SHARE * abs(altitude)
    bounds = standard_atmosphere(np.asarray([altitude + margin, altitude - margin]))
    pressure = at.get("static_pressure", float(standard.pressure))
    if not bounds.pressure[0] < pressure < bounds.pressure[1]:
        words = (
            f"static_pressure is {pressure:.6g} Pa, but at an altitude of {altitude:.5g} m the"
            f" standard atmosphere has {float(standard.pressure):.6g} Pa: one of them is wrong, or"
            " in another unit"
        )
        evidence = {"pressure": pressure, "standard": float(standard.pressure)}
        return [Suspicion("static_pressure", "unit", words, evidence)]
    if "rho" in at:
        ratio = at["rho"] / float(standard.density)
        thinnest, densest = bounds.density / (1.0 + np.array([SHARE, -SHARE]))
        if not thinnest < at["rho"] < densest:
            words = (
                f"rho is {at['rho']:.4g} kg/m^3, {ratio:.4g} times the standard atmosphere's at an"
                f" altitude of {altitude:.5g} m{_unit_of_density(ratio)}"
            )
            return [Suspicion("rho", "unit", words, {"ratio": ratio})]
    return []


def _unit_of_density(ratio: float) -> str:
    """Name the unit that a density has which is `ratio` times what it should be."""
    if abs(ratio * 515.379 - 1.0) < 0.3:
        return ": it is in slug/ft^3, declared as kg/m^3"
    return ""
