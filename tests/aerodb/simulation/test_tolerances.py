"""Tolerances are data with "A or B"; agreement is measured from the start of a manoeuvre."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.simulation import (
    Oscillation,
    check_responses,
    oscillation,
    parse_tolerances,
    response_agreement,
)
from aerodb.tasks.steps import default_tolerances

TIME = np.linspace(0.0, 10.0, 501)


def flown() -> dict[str, np.ndarray]:
    return {
        "theta": 0.1 * np.sin(TIME),
        "q": 0.1 * np.cos(TIME),
        "p": 0.2 * np.sin(2.0 * TIME),
        "az": -9.8 + np.sin(TIME),
    }


def test_the_flight_itself_is_inside_every_band() -> None:
    tolerances = parse_tolerances(default_tolerances())
    results = check_responses(tolerances, flown(), flown(), ("pitch", "roll"))
    assert {result.share for result in results} == {1.0}
    assert {result.check.partition(":")[0] for result in results} == {
        "short period",
        "roll response",
    }


def test_one_of_two_bands_is_enough() -> None:
    """Pitch rate is off by 3 deg/s, pitch attitude by 1 deg: "+-1.5 deg or +-2 deg/s" holds."""
    tolerances = parse_tolerances(default_tolerances())
    off = flown() | {"theta": flown()["theta"] + np.deg2rad(1.0), "q": flown()["q"] + 0.052}
    assert all(result.passed for result in check_responses(tolerances, off, flown(), ("pitch",)))
    off["theta"] = flown()["theta"] + np.deg2rad(1.6)
    first = check_responses(tolerances, off, flown(), ("pitch",))[0]
    assert not first.passed
    assert first.share == 0.0


def test_a_share_of_the_excursion_is_a_band() -> None:
    text = '[[check]]\nname = "roll"\nbands = [{ channel = "p", share = 0.1 }]'
    tolerances = parse_tolerances(text)
    for error, inside in ((0.09, True), (0.11, False)):
        off = flown() | {"p": flown()["p"] + error * 0.2}
        assert check_responses(tolerances, off, flown(), ())[0].passed is inside


def test_what_the_flight_lacks_or_cannot_judge_is_not_checked() -> None:
    tolerances = parse_tolerances(default_tolerances())
    short = {name: values for name, values in flown().items() if name != "az"}
    names = [r.check for r in check_responses(tolerances, flown(), short, ("pitch",))]
    assert names == ["short period: pitch attitude or pitch rate"]
    assert check_responses(tolerances, flown(), flown(), ("pitch",), ("az", "q")) == ()


def test_a_simulation_that_ended_is_outside_and_gaps_of_the_flight_do_not_count() -> None:
    text = '[[check]]\nname = "q"\nbands = [{ channel = "q", width = "2 deg/s" }]'
    tolerances, ended, gap = parse_tolerances(text), flown(), flown()
    ended["q"] = np.where(TIME > 5.0, np.nan, ended["q"])
    assert check_responses(tolerances, ended, flown(), ())[0].share == pytest.approx(0.5, abs=0.01)
    gap["q"] = np.where(TIME > 5.0, np.nan, gap["q"])
    assert check_responses(tolerances, ended, gap, ())[0].share == 1.0


def test_theils_parts_name_the_kind_of_error() -> None:
    lagging = response_agreement({"q": 0.1 * np.cos(TIME) + 0.02}, {"q": 0.1 * np.cos(TIME)})[0]
    assert lagging.theil.bias > 0.99
    assert lagging.rms_error == pytest.approx(0.02)
    weak = response_agreement({"q": 0.05 * np.sin(TIME)}, {"q": 0.1 * np.sin(TIME)})[0]
    assert weak.theil.variance > 0.9


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no \\[\\[check\\]\\]"),
        ("[[check]", "no TOML"),
        ('[[check]]\nname = "x"', "no bands"),
        ('[[check]]\nbands = [{ channel = "aplha", width = 1 }]', "unknown response 'aplha'"),
        ('[[check]]\nbands = [{ channel = "q" }]', "has no width"),
        ('[[check]]\nbands = [{ channel = "q", width = "2 kg" }]', "kg"),
        ('[[check]]\ncontrols = ["up"]\nbands = [{ channel = "q", width = 1 }]', "'up'"),
        ('[[check]]\nrequired_share = 95\nbands = [{ channel = "q", width = 1 }]', "95"),
        ('[[check]]\nband = 1', "unknown key 'band'"),
    ],
)  # fmt: skip
def test_wrong_tolerances_are_named(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        parse_tolerances(text)


def test_figures_of_an_oscillation_have_bands_of_their_own() -> None:
    """ "+-.5 s or 10 % of the period"; a simulation that does not oscillate fails."""
    text = (
        '[[check]]\nname = "Dutch roll"\nbands = [\n{ channel = "r", of = "period", share = 0.1 },\n'
        '{ channel = "r", of = "damping", width = 0.02 },\n]'
    )
    tolerances = parse_tolerances(text)
    flight = Oscillation(2.0, 0.1, 3.0, 3.5, 0.0, 0.0)
    for simulated, passed in (
        (Oscillation(2.0, 0.5, 3.2, 1.0, 0.0, 0.0), True),
        (Oscillation(1.0, 0.11, 6.0, 6.0, 0.0, 0.0), True),
        (Oscillation(1.0, 0.5, 6.0, 1.0, 0.0, 0.0), False),
        (None, False),
    ):
        swings = {"r": (simulated, flight)}
        turning = flown() | {"r": flown()["q"]}
        found = check_responses(tolerances, turning, turning, (), oscillations=swings)
        assert [result.passed for result in found] == [passed]
    assert check_responses(tolerances, flown(), flown(), ()) == ()


@pytest.mark.parametrize(
    ("database", "period", "damping", "passed"),
    [
        ("wind tunnel", 4.18, 0.207, [False, True]),
        ("updated from flight", 5.04, 0.202, [True, True]),
    ],
)
def test_a_published_dutch_roll_fails_before_and_passes_after(
    database: str, period: float, damping: float, passed: list[bool]
) -> None:
    """A regional airliner (000): 4.18 s and .207 in the wind tunnel, 5.04 s and .202 after the update,
    5.12 s and .198 in flight; judged by the tolerances of `version validate`."""
    time = np.arange(0.0, 30.0, 0.02)

    def yaw_rate(period: float, damping: float) -> np.ndarray:
        turn = 2.0 * np.pi / period
        decay = damping / np.sqrt(1.0 - damping**2) * turn
        return 0.1 * np.exp(-decay * time) * np.sin(turn * time)

    ours, flight = yaw_rate(period, damping), yaw_rate(5.12, 0.198)
    swings = {"r": (oscillation(time, ours), oscillation(time, flight))}
    assert swings["r"][0].period == pytest.approx(period, rel=1e-3)
    assert swings["r"][0].zeta == pytest.approx(damping, rel=1e-3)
    found = check_responses(
        parse_tolerances(default_tolerances()),
        {"r": ours},
        {"r": flight},
        ("yaw",),
        oscillations=swings,
    )
    judged = {each.check: each.passed for each in found}
    assert [judged[f"Dutch roll: {name}"] for name in ("period", "damping")] == passed, database


def test_a_test_names_a_paragraph_that_is_listed() -> None:
    check = '[[check]]\nname = "q"\ntest = "2.c.10"\nbands = [{ channel = "q", width = 1 }]\n'
    with pytest.raises(InputError, match=r"no \[\[test\]\] has the number '2\.c\.10'"):
        parse_tolerances(check)
    listed = parse_tolerances(f'{check}[[test]]\nnumber = "2.c.10"\ntitle = "short period"\n')
    (result,) = check_responses(listed, flown(), flown(), ())
    assert (result.test, result.required) == ("2.c.10", 1.0)
    assert (result.bands[0].limit, result.bands[0].deviation) == (1.0, 0.0)
    with pytest.raises(InputError, match="has no number"):
        parse_tolerances(f'{check}[[test]]\ntitle = "short period"\n')


def test_the_deviation_of_a_simulation_that_ended_is_not_known() -> None:
    tolerances, ended = parse_tolerances(default_tolerances()), flown()
    ended["az"] = np.where(TIME > 5.0, np.nan, ended["az"])
    found = {r.check: r for r in check_responses(tolerances, ended, flown(), ("pitch",))}
    assert found["short period: normal acceleration"].bands[0].deviation is None
