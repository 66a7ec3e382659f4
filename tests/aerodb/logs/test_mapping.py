"""From recordings to flights: measured files against their own columns, resampling against known
signals, damage, refusals."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs.completeness import consequences_of_missing
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.logs.mapping_file import parse_mapping
from aerodb.nomenclature import FLAGS, channel
from aerodb.recording import Recording, Topic
from aerodb.storage.files.flights import read_flight, write_flight
from aerodb.storage.mappings import builtin_mappings, load_mapping
from aerodb.storage.readers.tabular import read_tabular
from aerodb.vehicle import Vehicle, parse_vehicle

VEHICLE = """
name = "glider"
[reference]
area = 10.0
chord = 1.0
span = 10.0
[points]
moment_reference = "cg"
[mass]
source = "channels"
"""
SURFACES = """
[surfaces.aileron_right]
limits = ["-25 deg", "25 deg"]
[surfaces.aileron_left]
limits = ["-25 deg", "25 deg"]
[combinations.aileron]
kind = "asymmetric"
right = "aileron_right"
left = "aileron_left"
[configuration]
delta_flap = "10 deg"
"""


def vehicle_with_elevator(extra: str = "") -> Vehicle:
    return parse_vehicle(VEHICLE + extra)


def _flight(path: Path, extra: str = "") -> Flight:
    recording = read_tabular(path)
    return map_recording(
        recording,
        choose_mapping(recording, builtin_mappings().values()),
        vehicle_with_elevator(extra),
    )


def test_built_in_mappings_name_only_what_the_glossary_knows() -> None:
    mappings = builtin_mappings()
    assert {
        "sidpac_fdata",
        "attas",
        "attas_quasi_steady",
        "hfb320",
        "citation_phlab",
        "canonical",
    } <= set(mappings)
    for name, mapping in mappings.items():
        assert mapping.name == name
        for entry in mapping.channel:
            assert channel(entry.name)
    assert load_mapping("hfb320") is mappings["hfb320"]


def _recording(
    topics: dict[str, tuple[np.ndarray, dict[str, np.ndarray]]], units: dict[str, str] | None = None
) -> Recording:
    made = {name: Topic(name, time, fields, units or {}) for name, (time, fields) in topics.items()}
    return Recording("made.log", "ulog", "ab" * 32, 0, made)


def _mapping(*channels: tuple[str, str, str, str], more: str = "") -> Any:
    entries = [
        f'[[channel]]\nname = "{name}"\nsources = [{{topic = "{topic}", field = "{key}", unit ='
        f' "{unit}"}}]'
        for name, topic, key, unit in channels
    ]
    return parse_mapping('name = "made"\nformats = ["ulog"]\n' + "\n".join(entries) + more)


FAST, SLOW = np.arange(0.0, 20.0, 0.004), np.arange(0.0, 20.0, 0.02)


def test_one_uniform_time_base_passes_bit_for_bit() -> None:
    values = np.random.default_rng(0).normal(size=len(SLOW))
    flight = map_recording(
        _recording({"imu": (SLOW, {"q": values})}),
        _mapping(("q", "imu", "q", "rad/s")),
        vehicle_with_elevator(),
    )
    np.testing.assert_array_equal(flight["q"], values)
    np.testing.assert_array_equal(flight.time, SLOW)
    assert flight.flags == {}


def test_a_surface_that_only_the_vehicle_names_is_the_field_of_its_name() -> None:
    """Of the topic of the rates, in the unit that the log declares; a stated place comes first."""
    moved, other = 0.1 * np.sin(SLOW), 0.2 * np.cos(SLOW)
    fields = {"p": SLOW, "delta_canard": np.rad2deg(moved), "servo": other, "flap": other}
    units = {"delta_canard": "deg", "servo": "rad"}
    recording = _recording({"imu": (SLOW, fields)}, units)
    stated = '[surfaces.canard]\nlimits = ["-20 deg", "20 deg"]\n'
    mapping = _mapping(("p", "imu", "p", "rad/s"))
    flight = map_recording(recording, mapping, vehicle_with_elevator(stated))
    np.testing.assert_allclose(flight["delta_canard"], moved, rtol=1e-12)
    place = 'log = { topic = "imu", field = "servo", unit = "rad" }\n'
    flight = map_recording(recording, mapping, vehicle_with_elevator(stated + place))
    np.testing.assert_allclose(flight["delta_canard"], other, rtol=1e-12)
    assert "delta_canard" not in map_recording(recording, mapping, vehicle_with_elevator())


def test_going_down_keeps_the_band_and_removes_what_would_alias() -> None:
    """1.5 Hz passes within 0.1 %; 47 Hz, which would fold to 3 Hz on a grid of 50 Hz, is 60 dB
    down; nothing is delayed."""
    slow, fast = np.sin(2 * np.pi * 1.5 * FAST), np.sin(2 * np.pi * 47.0 * FAST)
    recording = _recording(
        {"imu": (SLOW, {"q": np.zeros_like(SLOW)}), "air": (FAST, {"alpha": slow + fast})}
    )
    mapping = _mapping(("q", "imu", "q", "rad/s"), ("alpha", "air", "alpha", "rad"))
    flight = map_recording(recording, mapping, vehicle_with_elevator())
    inner = (SLOW > 0.5) & (SLOW < 19.5)
    error = flight["alpha"] - np.sin(2 * np.pi * 1.5 * SLOW)
    assert np.max(np.abs(error[inner])) < 2e-3
    assert np.max(np.abs(error)) < 0.2  # the ends are continued, not faded to zero


def test_going_up_joins_by_lines_and_flags_silence() -> None:
    time = np.concatenate([np.arange(0.0, 8.0, 0.2), np.arange(12.0, 19.0, 0.2)])
    recording = _recording({"imu": (SLOW, {"q": SLOW}), "gps": (time, {"h": 100.0 + 2.0 * time})})
    flight = map_recording(
        recording,
        _mapping(("q", "imu", "q", "rad/s"), ("altitude", "gps", "h", "m")),
        vehicle_with_elevator(),
    )
    np.testing.assert_allclose(flight["altitude"][:900], 100.0 + 2.0 * SLOW[:900], rtol=1e-12)
    flagged = (flight.flags["altitude"] & FLAGS["gap"]) > 0
    expected = ((SLOW > 7.8 + 1e-6) & (SLOW < 12.0 - 1e-6)) | (SLOW > 18.8 + 0.2 + 1e-3)
    np.testing.assert_array_equal(flagged, expected)
    assert "q" not in flight.flags


def test_samples_that_are_not_finite_are_bridged_or_flagged() -> None:
    values = SLOW.copy()
    values[100], values[500:600] = np.nan, np.nan
    recording = _recording({"imu": (SLOW, {"q": SLOW, "a": values})})
    flight = map_recording(
        recording,
        _mapping(("q", "imu", "q", "rad/s"), ("alpha", "imu", "a", "rad")),
        vehicle_with_elevator(),
    )
    np.testing.assert_allclose(flight["alpha"], SLOW, rtol=1e-12)
    assert np.flatnonzero(flight.flags["alpha"]).tolist() == list(range(500, 600))


def test_grid_is_the_overlap_at_the_vehicles_rate() -> None:
    recording = _recording({"a": (FAST + 1.0, {"x": FAST}), "g": (SLOW, {"q": SLOW})})
    mapping = _mapping(("ax_imu", "a", "x", "m/s^2"), ("q", "g", "q", "rad/s"))
    flight = map_recording(recording, mapping, vehicle_with_elevator("[processing]\nrate = 25.0\n"))
    assert (flight.time[0], flight.step) == (pytest.approx(1.0), pytest.approx(0.04))
    assert flight.time[-1] <= SLOW[-1]


def test_angles_are_unwrapped_before_they_are_joined() -> None:
    heading = np.unwrap(np.linspace(3.0, 9.0, len(SLOW)))
    recording = _recording(
        {"g": (FAST, {"q": FAST}), "att": (SLOW, {"psi": (heading + np.pi) % (2 * np.pi) - np.pi})}
    )
    flight = map_recording(
        recording,
        _mapping(("q", "g", "q", "rad/s"), ("psi", "att", "psi", "rad")),
        vehicle_with_elevator(),
    )
    assert np.max(np.abs(np.diff(flight["psi"]))) < 0.01


def test_quaternion_and_sum_are_derived() -> None:
    rotation = Rotation.from_euler("ZYX", [[2.0, 0.1, -0.3]] * len(SLOW))
    x, y, z, w = rotation.as_quat().T
    recording = _recording(
        {"att": (SLOW, {"w": w, "x": x, "y": y, "z": z, "q": SLOW, "l": SLOW, "r": SLOW})}
    )
    sources = ", ".join(f'{{topic = "att", field = "{key}", unit = "1"}}' for key in "wxyz")
    engines = ", ".join(f'{{topic = "att", field = "{key}", unit = "kN"}}' for key in "lr")
    more = (
        '\n[[derived]]\nchannels = ["phi", "theta", "psi"]\nmethod ='
        f' "euler_321_from_quaternion"\nsources = [{sources}]\n[[derived]]\nchannels ='
        f' ["thrust"]\nmethod = "sum"\nsources = [{engines}]\n'
    )
    flight = map_recording(
        recording, _mapping(("q", "att", "q", "rad/s"), more=more), vehicle_with_elevator()
    )
    for name, value in (("phi", -0.3), ("theta", 0.1), ("psi", 2.0)):
        np.testing.assert_allclose(flight[name], value, atol=1e-12)
    np.testing.assert_allclose(flight["thrust"], 2000.0 * SLOW, rtol=1e-12)


COMMANDED = """
[surfaces.elevator]
limits = ["-30 deg", "30 deg"]
scale = 0.5
offset = 0.02
lag = 0.1
"""


@pytest.mark.parametrize("time", [SLOW, FAST, np.arange(0.0, 20.0, 0.1)])
def test_a_command_becomes_a_deflection_by_scale_offset_and_lag(time: np.ndarray) -> None:
    """Step of a command at 5 s: delta = offset + scale (1 - exp(-t / T)), whatever the rate of the
    command's topic."""
    step = (time >= 5.0 - 1e-9).astype(float)
    recording = _recording({"imu": (SLOW, {"q": SLOW}), "servo": (time, {"out": step})})
    more = (
        '\n[[channel]]\nname = "delta_elevator"\ncommand = true\nsources = [{topic = "servo", field'
        ' = "out"}]\n'
    )
    flight = map_recording(
        recording, _mapping(("q", "imu", "q", "rad/s"), more=more), vehicle_with_elevator(COMMANDED)
    )
    start = time[np.argmax(step)]
    expected = 0.02 + 0.5 * np.where(
        start <= SLOW, 1.0 - np.exp(-np.maximum(SLOW - start, 0.0) / 0.1), 0.0
    )
    tolerance = (
        0.02 if time is FAST else 1e-9
    )  # coming down, the corner itself holds what the grid cannot
    np.testing.assert_allclose(flight["delta_elevator"], expected, atol=tolerance)


def test_a_command_beyond_the_stops_stays_at_them_and_the_start_of_the_lag_is_not_known() -> None:
    recording = _recording(
        {"imu": (SLOW, {"q": SLOW}), "servo": (SLOW, {"out": np.full_like(SLOW, 3.0)})}
    )
    more = (
        '\n[[channel]]\nname = "delta_elevator"\ncommand = true\nsources = [{topic = "servo", field'
        ' = "out"}]\n'
    )
    flight = map_recording(
        recording, _mapping(("q", "imu", "q", "rad/s"), more=more), vehicle_with_elevator(COMMANDED)
    )
    assert np.max(flight["delta_elevator"]) == pytest.approx(np.deg2rad(30.0))
    unknown = SLOW[0] + 5 * 0.1 > SLOW
    np.testing.assert_array_equal(flight.flags["delta_elevator"] > 0, unknown)


def test_the_vehicle_says_where_a_surface_stands() -> None:
    recording = _recording(
        {"imu": (SLOW, {"q": SLOW}), "servo": (SLOW, {"control[1]": SLOW / 20.0})}
    )
    extra = COMMANDED + '[surfaces.elevator.log]\ntopic = "servo"\nfield = "control[1]"\n'
    mapping = _mapping(("q", "imu", "q", "rad/s"))
    flight = map_recording(recording, mapping, vehicle_with_elevator(extra))
    assert flight["delta_elevator"][-1] == pytest.approx(
        0.02 + 0.5 * (SLOW[-1] - 0.1) / 20.0, abs=1e-3
    )
    assert (
        "delta_elevator"
        in map_recording(recording, mapping, vehicle_with_elevator(COMMANDED)).missing
    )


def test_a_command_without_calibration_is_not_taken_for_a_deflection() -> None:
    recording = _recording({"imu": (SLOW, {"q": SLOW, "out": SLOW})})
    more = (
        '\n[[channel]]\nname = "delta_elevator"\ncommand = true\nsources = [{topic = "imu", field ='
        ' "out"}]\n'
    )
    flight = map_recording(
        recording, _mapping(("q", "imu", "q", "rad/s"), more=more), vehicle_with_elevator()
    )
    assert "delta_elevator" in flight.missing
    assert any("surfaces.elevator" in note for note in flight.notes)


def test_constants_of_the_vehicle_fill_what_the_log_lacks() -> None:
    recording = _recording({"imu": (SLOW, {"q": SLOW})})
    flight = map_recording(
        recording, _mapping(("q", "imu", "q", "rad/s")), vehicle_with_elevator(SURFACES), "first"
    )
    np.testing.assert_allclose(flight["delta_flap"], np.deg2rad(10.0))
    assert any("delta_flap" in note for note in flight.notes)
    assert flight.id == "first"
    assert {"ax_imu", "V", "qbar", "delta_aileron_left"} <= set(flight.missing)
    assert consequences_of_missing(flight.missing)[0].endswith("no coefficient can be computed")


def test_former_names_patterns_and_declared_units() -> None:
    recording = _recording({"old_rates": (SLOW, {"q": np.rad2deg(SLOW)})}, {"q": "deg/s"})
    text = """
name = "made"
formats = ["ulog"]
[[channel]]
name = "q"
sources = [{topic = "new_rates", field = "q"}, {topic = "older|old_*", field = "q"}]
"""
    np.testing.assert_allclose(
        map_recording(recording, parse_mapping(text), vehicle_with_elevator())["q"],
        SLOW,
        rtol=1e-12,
    )


@pytest.mark.parametrize("fields", [("roll", "pitch", "yaw"), ("y", "x", "r")])
def test_the_stick_of_a_px4_log_is_what_was_commanded(fields: tuple[str, str, str]) -> None:
    rates = {f"xyz[{k}]": np.sin((k + 1) * SLOW) for k in range(3)}
    stick = {name: np.cos((k + 1) * SLOW) for k, name in enumerate(fields)}
    recording = _recording(
        {"vehicle_angular_velocity": (SLOW, rates), "manual_control_setpoint": (SLOW, stick)}
    )
    flight = map_recording(recording, builtin_mappings()["px4"], vehicle_with_elevator())
    for name, field in zip(("command_roll", "command_pitch", "command_yaw"), fields, strict=True):
        np.testing.assert_allclose(flight[name], stick[field])


def test_canonical_table(tmp_path: Path) -> None:
    frame = pd.DataFrame(
        {
            "time [s]": SLOW,
            "p [deg/s]": SLOW,
            "q [deg/s]": SLOW,
            "r [deg/s]": SLOW,
            "delta_rudder [deg]": SLOW,
        }
    )
    frame.to_csv(tmp_path / "x.csv", index=False)
    flight = _flight(tmp_path / "x.csv")
    assert flight.mapping == "canonical"
    np.testing.assert_allclose(flight["delta_rudder"], np.deg2rad(SLOW), rtol=1e-12)


# Clocks


def test_small_steps_back_are_dropped_and_reported() -> None:
    time, values = SLOW.copy(), SLOW.copy()
    time[300], time[500], time[700] = time[299], time[500] + 5.0, time[690]
    recording = _recording({"imu": (time, {"q": values})})
    flight = map_recording(recording, _mapping(("q", "imu", "q", "rad/s")), vehicle_with_elevator())
    np.testing.assert_allclose(flight["q"], flight.time, atol=1e-9)
    assert [entry.kind for entry in flight.damage] == ["time"]
    assert flight.damage[0].what.startswith("3 samples")


def test_a_broken_clock_costs_its_topic_or_the_log() -> None:
    """Rates on a clock that runs backwards: refused. A lesser topic on one: done without, and
    reported."""
    recording = _recording({"imu": (SLOW, {"q": SLOW}), "gps": (SLOW[::-1], {"h": SLOW})})
    flight = map_recording(
        recording,
        _mapping(("q", "imu", "q", "rad/s"), ("altitude", "gps", "h", "m")),
        vehicle_with_elevator(),
    )
    assert "altitude" in flight.missing
    assert [(entry.kind, entry.topic) for entry in flight.damage] == [("time", "gps")]
    with pytest.raises(InputError, match="time does not increase"):
        map_recording(
            recording,
            _mapping(("q", "gps", "h", "rad/s"), ("p", "imu", "q", "rad/s")),
            vehicle_with_elevator(),
        )


def test_a_clock_that_jumps_far_ahead_does_not_make_an_endless_grid() -> None:
    time = np.concatenate([SLOW, SLOW + 1e6])
    with pytest.raises(InputError, match="clock jumps"):
        map_recording(
            _recording({"imu": (time, {"q": time})}),
            _mapping(("q", "imu", "q", "rad/s")),
            vehicle_with_elevator(),
        )


# Refusals


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("name = 'x'\nformats = ['ulog']\n[[chanel]]\n", "chanel"),
        (
            (
                "name = 'x'\nformats = ['ulog']\n[[channel]]\nname = 'alhpa'\nsources ="
                " [{topic='a', field='b'}]\n"
            ),
            "alhpa",
        ),
        ("name = 'x'\nformats = ['ulog']\n[[channel]]\nname = 'alpha'\nsources = []\n", "sources"),
        (
            (
                "name = 'x'\nformats = ['ulog']\n[[channel]]\nname = 'q'\nsources = [{topic='a',"
                " feild='b'}]\n"
            ),
            "feild",
        ),
        ("name = 'x", "TOML"),
    ],
)
def test_faulty_mapping_files_are_refused(text: str, what: str) -> None:
    with pytest.raises(InputError) as refusal:
        parse_mapping(text, "my.toml")
    assert what in str(refusal.value)
    assert refusal.value.where == "my.toml"


def test_unknown_method_and_repeated_channel_are_refused() -> None:
    derived = (
        '\n[[derived]]\nchannels = ["thrust"]\nmethod = "summ"\nsources = [{topic = "a", field ='
        ' "b"}]\n'
    )
    with pytest.raises(InputError, match="did you mean 'sum'"):
        _mapping(("q", "imu", "q", "rad/s"), more=derived)
    with pytest.raises(InputError, match="q is listed twice"):
        _mapping(("q", "imu", "q", "rad/s"), ("q", "imu", "r", "rad/s"))


def test_units_must_be_known() -> None:
    recording = _recording({"imu": (SLOW, {"q": SLOW})})
    silent = parse_mapping(
        'name = "made"\nformats = ["ulog"]\n[[channel]]\nname = "q"\nsources = [{topic = "imu",'
        ' field = "q"}]\n'
    )
    with pytest.raises(InputError, match="no unit is declared"):
        map_recording(recording, silent, vehicle_with_elevator())
    with pytest.raises(InputError, match="unknown unit 'furlong/week/week2'"):
        map_recording(
            recording, _mapping(("q", "imu", "q", "furlong/week/week2")), vehicle_with_elevator()
        )


def test_logs_that_no_mapping_fits_or_without_motion_are_refused(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("a,b\n1,2\n3,4\n")
    recording = read_tabular(tmp_path / "x.csv")
    with pytest.raises(InputError, match="no mapping fits") as refusal:
        choose_mapping(recording, builtin_mappings().values())
    assert "sidpac_fdata" in refusal.value.remedy
    (tmp_path / "y.csv").write_text("q [rad/s],b\n1,2\n3,4\n")
    with pytest.raises(InputError, match=r"no time: topic .* has no field 'time'"):
        map_recording(
            read_tabular(tmp_path / "y.csv"), load_mapping("canonical"), vehicle_with_elevator()
        )
    air = _recording({"air": (SLOW, {"alpha": SLOW})})
    with pytest.raises(InputError, match="no accelerations and no rates"):
        map_recording(air, _mapping(("alpha", "air", "alpha", "rad")), vehicle_with_elevator())


def test_two_mappings_that_fit_equally_are_named() -> None:
    one = parse_mapping(
        'name = "one"\nformats = ["ulog"]\ndetect = ["imu"]\n[[channel]]\nname = "q"\nsources ='
        ' [{topic = "imu", field = "q"}]\n'
    )
    two = one.model_copy(update={"name": "two"})
    recording = _recording({"imu": (SLOW, {"q": SLOW})})
    with pytest.raises(InputError, match="several mappings fit: one, two"):
        choose_mapping(recording, [one, two])
    assert choose_mapping(recording, [one]).name == "one"


def test_absent_mapping_is_refused_with_the_nearest_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean 'hfb320'"):
        load_mapping("hfb32")
    with pytest.raises(InputError, match="cannot be read"):
        load_mapping(tmp_path / "absent.toml")


def test_what_missing_channels_prevent() -> None:
    assert consequences_of_missing([]) == []
    assert consequences_of_missing(["qbar"]) == []
    assert "no coefficient" in consequences_of_missing(["qbar", "V"])[0]
    assert "CY" in consequences_of_missing(["ay", "ay_imu"])[0]
    assert consequences_of_missing(["delta_rudder"]) == [
        "no position of rudder: no control effectiveness of these"
    ]


def test_what_an_estimator_made_is_told_from_what_sensors_measured(tmp_path: Path) -> None:
    """The flight says which of its channels they are, also when it is read back; the mapping of
    sensors is written as before there was the word."""
    recording = _recording({"g": (FAST, {"q": FAST, "a": FAST})})
    entry = '\n[[channel]]\nname = "alpha"\nsources = [{topic="g", field="a", unit="rad"'
    for word, estimated in (("", frozenset()), (", estimated = true", frozenset({"alpha"}))):
        mapping = _mapping(("q", "g", "q", "rad/s"), more=f"{entry}{word}}}]\n")
        flight = map_recording(recording, mapping, vehicle_with_elevator())
        assert flight.estimated == estimated
        write_flight(tmp_path / "flight.parquet", flight)
        assert read_flight(tmp_path / "flight.parquet").estimated == estimated
        assert ("estimated" in mapping.model_dump_json()) == bool(word)
