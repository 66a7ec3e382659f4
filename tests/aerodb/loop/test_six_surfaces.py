"""A database in six separate surfaces: a locked one is named by itself, and a healthy aircraft has
none. Flights are ten legs of 10 s of the WVU YF-22 at 42 m/s, with the printed noise of its sensors."""

import numpy as np
import pytest

from aerodb.coefficients import compare, total_coefficients
from aerodb.effects import FlightView, view_of
from aerodb.effects.library import hypotheses_for
from aerodb.exchange.native import read_native
from aerodb.loop import Accept, LoopResult, freeze_library, run_loop
from aerodb.nomenclature import AXES
from aerodb.tables import AeroDatabase
from tests.support import six_surfaces

LOCK = "surface_asymmetry@all:{}"
SURFACE_ERRORS = {
    "surface_scale", "surface_bias", "surface_asymmetry", "surface_delay", "surface_backlash",
    "surface_wide_backlash", "surface_dead_zone",
}  # fmt: skip


def closed(number: int, locked: dict[str, float] | None) -> LoopResult:
    """The loop over ten legs of the database of the healthy aircraft."""
    truth = six_surfaces.database()
    source = six_surfaces.legs(range(10 * number, 10 * number + 10), truth, locked)
    ids = tuple(source.flown)
    return run_loop(source, ids, truth, freeze_library(source, ids, truth), Accept())


def test_the_planted_terms_are_the_printed_ones() -> None:
    """Eq. 71: Cm of the left aileron -.0859; CY of the left stabilator .657."""
    added = six_surfaces.added()
    assert added["Cm"]["aileron_left"] == pytest.approx(-0.0859, abs=5e-5)
    assert added["CY"]["stabilator_left"] == pytest.approx(0.657, abs=5e-4)
    assert sum(len(terms) for terms in added.values()) == 18


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(k, marks=pytest.mark.campaign) for k in range(1, 100))]
)
def test_a_locked_surface_is_named_and_nothing_else(seed: int) -> None:
    found = {f.hypothesis: f for f in closed(seed, {"stabilator_left": 0.0}).findings}
    lock = found.pop(LOCK.format("stabilator_left"))
    assert lock.verdict == "sensor"
    assert lock.ci95[0] < 1.0 < lock.ci95[1] or abs(lock.value - 1.0) < 0.1
    assert lock.ci95[1] - lock.ci95[0] < 0.3
    assert found == {}


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(k, marks=pytest.mark.campaign) for k in range(1, 100))]
)
def test_a_healthy_aircraft_has_none(seed: int) -> None:
    assert not closed(seed, None).findings


@pytest.mark.parametrize("surface", ["aileron_right", "rudder_left"])
def test_another_surface_is_told_from_its_pair(surface: str) -> None:
    findings = closed(1, {surface: 0.0}).findings
    named = [f for f in findings if f.hypothesis == LOCK.format(surface)]
    assert [f.verdict for f in named] == ["sensor"], findings
    assert named[0].value == pytest.approx(1.0, abs=0.15)


def in_pairs() -> AeroDatabase:
    """The database without the terms that a pair cancels, in combinations."""
    lines = ['name = "pairs"', "[reference]"]
    own = six_surfaces.database(False).reference
    lines += [f"area = {own.area}", f"chord = {own.chord}", f"span = {own.span}"]
    lines += ["moment_reference = [0.0, 0.0, 0.0]"]
    for axis, terms in six_surfaces.nominal().items():
        lines += [f"[derivatives.{axis}]", *(f'"{n}" = {v!r}' for n, v in terms.items())]
    return read_native("\n".join(lines) + "\n")


def test_columns_do_not_depend_on_how_the_database_writes_a_pair() -> None:
    """In combinations or in two surfaces, the model is the same: so is what errors of deflections
    do to it."""
    vehicle = six_surfaces.vehicle()
    flight = six_surfaces.leg(3, six_surfaces.database(False))
    coefficients = total_coefficients(flight, vehicle)
    columns = []
    for database in (in_pairs(), six_surfaces.database(False)):
        comparison = compare(flight, coefficients, database, vehicle.reference)
        view: FlightView = view_of(flight, comparison, database, vehicle)
        columns.append(
            {
                each.id: each.tangent(view)
                for each in hypotheses_for(database, vehicle, frozenset(flight.channels))
                if each.kind == "sensor" and each.effect in SURFACE_ERRORS
            }
        )
    pairs, sides = columns
    assert pairs.keys() == sides.keys()
    assert {id.split("@")[0] for id in pairs} == SURFACE_ERRORS
    moved = 0
    for id, own in pairs.items():
        for axis in AXES:
            np.testing.assert_allclose(sides[id][axis], own[axis], rtol=1e-6, atol=1e-12)
            moved += bool(np.abs(own[axis]).max() > 1e-6)
    assert moved > 20
