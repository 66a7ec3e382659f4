"""Drafts of mappings: units from names, ranges and other channels, signs, clocks, and questions; the
text is a mapping that finds what was guessed. Held against the built-in mapping of a measured log."""

import numpy as np
import pytest

from aerodb.logs import channels_found, draft_mapping, empty_channels, parse_mapping
from aerodb.recording import Recording, Topic
from aerodb.storage.mappings import builtin_mappings

TIME = np.arange(0.0, 20.0, 0.02)
ROLL = 30.0 * np.sin(TIME)


def table(**columns: np.ndarray) -> Recording:
    topics = {"table": Topic("table", np.arange(TIME.size, dtype=float), columns)}
    return Recording("a/flight.csv", "tabular", "0" * 64, 1, topics)


def guesses(recording: Recording) -> dict:
    return {guess.channel: guess for guess in draft_mapping(recording, "own").guesses}


def test_names_ranges_signs_and_the_clock():
    draft = draft_mapping(
        table(
            **{
                "t [ms]": TIME * 1000,
                "TAS_kts": 60 + ROLL,
                "AoA": 4.0 + 0.1 * ROLL,
                "nz": 1.0 + 0.01 * ROLL,
                "Roll": ROLL,
                "RollRate": 30.0 * np.cos(TIME),
                "spare": np.zeros(TIME.size),
                "lost": np.full(TIME.size, np.nan),
            }
        ),
        "own",
    )
    found = {guess.channel: (guess.unit, guess.scale) for guess in draft.guesses}
    assert found == {
        "V": ("knot", 1.0),
        "alpha": ("deg", 1.0),
        "az_imu": ("g", -1.0),
        "phi": ("deg", 1.0),
        "p": ("deg/s", 1.0),
    }
    assert 'unit = "ms"' in draft.text
    (empty,) = draft.questions
    assert "table.lost" in empty
    assert "table.spare" in empty
    present, _ = channels_found(table(), parse_mapping(draft.text))
    assert present == ()


def test_the_text_is_a_mapping_that_finds_what_was_guessed():
    log = table(time=TIME, **{"V (m/s)": 20 + 0 * TIME, "q": 0.1 * np.cos(TIME)})
    draft = draft_mapping(log, "own")
    present, _ = channels_found(log, parse_mapping(draft.text))
    assert set(present) == {"V", "q"}
    assert any("is q (q) in rad/s?" in text for text in draft.questions)


def test_a_rate_in_another_unit_than_its_angle_is_asked():
    log = table(time=TIME, phi=np.deg2rad(ROLL), p_rad_s=30.0 * np.cos(TIME))
    assert any("times the derivative of phi" in text for text in draft_mapping(log, "x").questions)


def test_the_mach_number_decides_the_unit_of_the_airspeed():
    mach = 0.3 + 0.05 * np.sin(TIME)
    for unit, sound in (("knot", 661.5), ("m/s", 340.3), ("ft/s", 1116.0)):
        assert guesses(table(time=TIME, tas=mach * sound, mach=mach))["V"].unit == unit


def test_columns_without_names_are_described_by_their_derivatives():
    draft = draft_mapping(table(**{"1": TIME, "2": ROLL, "3": 30.0 * np.cos(TIME)}), "own")
    assert draft.guesses == ()
    assert any(
        text.startswith("column 3 is 1 times the derivative of 2") for text in draft.questions
    )
    assert "# table.2:" in draft.text


def test_a_builtin_mapping_that_fits_is_written_out_whole():
    topics = {
        "vehicle_angular_velocity": Topic(
            "vehicle_angular_velocity", TIME, {f"xyz[{k}]": np.sin(TIME + k) for k in range(3)}
        ),
        "vehicle_attitude": Topic(
            "vehicle_attitude", TIME, {f"q[{k}]": np.cos(TIME) for k in range(4)}
        ),
    }
    log = Recording("f.ulg", "ulog", "0" * 64, 1, topics)
    px4 = builtin_mappings()["px4"]
    again = parse_mapping(draft_mapping(log, "own", px4).text)
    assert set(channels_found(log, again)[0]) == set(channels_found(log, px4)[0])


def test_an_empty_field_that_is_mapped_is_named():
    log = table(time=TIME, beta=np.full(TIME.size, np.nan))
    text = draft_mapping(table(time=TIME, beta=ROLL), "own").text
    assert empty_channels(log, parse_mapping(text)) == ("beta",)


@pytest.mark.parametrize("name", ["citation/flight_2019-03-12.parquet"])
def test_guesses_agree_with_the_mapping_written_by_hand(measured, name):
    import pyarrow.parquet as parquet

    columns = parquet.read_table(measured(name)).to_pydict()
    log = table(**{k: np.array(v, dtype=float) for k, v in columns.items() if k != "sample"})
    by_hand = {
        entry.name: entry.sources[0] for entry in builtin_mappings()["citation_phlab"].channel
    }
    found = guesses(log)
    same = [k for k in found if k in by_hand and found[k].field == by_hand[k].field]
    assert {"phi", "theta", "p", "q", "r", "V", "alpha", "mach", "latitude"} <= set(same)
    decided = [k for k in same if "assumed" not in found[k].reason]
    assert [found[k].unit for k in decided] == [by_hand[k].unit for k in decided]


@pytest.mark.parametrize(
    "name", ["Frame", "idx", "LineNo", "PacketNumber", "distance_m", "latitude", "sample", "seq"]
)
def test_what_merely_runs_evenly_is_no_clock_and_the_time_is_asked(name: str) -> None:
    draft = draft_mapping(table(**{name: 47.0 + 0.001 * np.arange(TIME.size), "roll": ROLL}), "own")
    assert draft.clock is None
    assert any("which is the time?" in question for question in draft.questions)
    assert "\n[time]\n" not in draft.text


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_attitude_against_turns_and_climbs_is_asked(sign: float) -> None:
    """A flight simulator counts pitch downwards and bank to the left; turns and climbs tell."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 120.0, 0.1)
    bank, climb = 0.4 * np.sin(0.11 * time), 0.1 * np.sin(0.07 * time + 1.0)
    heading = np.cumsum(9.81 * np.tan(bank) / 60.0) * 0.1
    fields = {
        "Bank": sign * np.rad2deg(bank + 0.02 * rng.normal(size=time.size)),
        "Pitch": sign * np.rad2deg(climb + 0.05 + 0.02 * rng.normal(size=time.size)),
        "TrueHeading": np.rad2deg(heading) % 360.0,
        "Altitude_m": 500.0 + np.cumsum(60.0 * np.sin(climb)) * 0.1,
    }
    topic = Topic("table", time, fields)
    recording = Recording("a.csv", "tabular", "0" * 64, 1, {"table": topic}, {})
    found = {guess.channel: guess for guess in draft_mapping(recording, "a").guesses}
    assert ("positive to the left" in found["phi"].open) == (sign < 0)
    assert ("positive downwards" in found["theta"].open) == (sign < 0)
