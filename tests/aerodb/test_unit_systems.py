"""The units in which people are shown quantities, against pint's definitions."""

import pytest

from aerodb import units
from aerodb.errors import InputError
from aerodb.nomenclature import CHANNELS
from aerodb.units import _SHOWN, SI, UnitSystem, conversion

#: Labels as pint spells them.
_PINT = {
    "hPa": "hPa",
    "slug/ft³": "slug/ft**3",
    "slug ft²": "slug*ft**2",
    "lbf ft": "lbf*ft",
    "ft/s²": "ft/s**2",
    "kt": "knot",
}


@pytest.mark.parametrize(
    ("system", "unit"), [(name, unit) for name, shown in _SHOWN.items() for unit in shown]
)
def test_factors_are_those_of_pint(system: str, unit: str) -> None:
    factor, label = UnitSystem(system).scale(unit)
    spelt = unit.replace("^", "**").replace("kg m", "kg*m").replace("N m", "N*m")
    assert factor == pytest.approx(conversion(spelt, _PINT.get(label, label))[0], rel=1e-12)


@pytest.mark.parametrize("system", list(_SHOWN))
def test_angles_are_degrees_and_slopes_per_radian_in_each(system: str) -> None:
    units = UnitSystem(system)
    assert units.shown(0.1, "rad") == "5.73 deg"
    assert units.scale("rad/s^2")[1] == "deg/s²"
    assert units.scale("1/rad") == (1.0, "1/rad")
    assert units.scale("1") == (1.0, "-")


def test_an_unknown_system_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(InputError, match="si, aero, imperial"):
        UnitSystem("metric")
    assert SI.shown(12.0, "m/s") == "12 m/s"


def test_common_conversions_are_those_of_pint() -> None:
    for (unit, to), known in units._COMMON.items():
        assert units._by_pint(unit, to) == known, unit
        assert units.conversion(unit, to) == known
    for unit, known in units._IN_SI.items():
        base = f"{units._registry().Quantity(1.0, unit).to_base_units().units}"
        assert units._by_pint(unit, base) == known, unit
        assert units.si_conversion(unit) == known


def test_no_channel_waits_for_pint() -> None:
    """Its registry takes half a second to start: a channel in its own unit must not need it."""
    own = {channel.unit for channel in CHANNELS.values()}
    assert {unit for unit in own if (units.spelled(unit),) * 2 not in units._COMMON} == set()
