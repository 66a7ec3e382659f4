"""Text tables as tools write them: every form holds the same three columns, which are compared with
the numbers that were written; what is not read is said."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.recording import Recording
from aerodb.storage.readers.tabular import read_tabular
from aerodb.storage.readers.text import read_text

TIME = np.arange(60) * 0.05
SPEED = 1020.0 + 10.0 * np.sin(TIME)
LOAD = -9.81 + 0.25 * np.cos(TIME)
TRUTH = {"time": TIME, "V": SPEED, "az": LOAD}

Cell = Callable[[float], str]


def plain(value: float) -> str:
    return f"{value:.5f}"


def comma(value: float) -> str:
    return plain(value).replace(".", ",")


def rows(sep: str, cell: Cell = plain, end: str = "") -> str:
    return "".join(
        sep.join(map(cell, row)) + end + "\n" for row in zip(TIME, SPEED, LOAD, strict=True)
    )


def stamped(stamp: Callable[[float], str], sep: str = ",", cell: Cell = plain) -> str:
    return "".join(
        sep.join((stamp(t), cell(v), cell(a))) + "\n"
        for t, v, a in zip(TIME, SPEED, LOAD, strict=True)
    )


def clock(seconds: float, sign: str = ".") -> str:
    whole = int(seconds + 1e-9)
    part = round((seconds - whole) * 1000)
    return f"{14 + whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}{sign}{part:03d}"


def fortran(value: float) -> str:
    return f"{value:.9E}".replace("E", "D")


HEADER = "time,V,az\n"
FORMS = {
    "date of digits": HEADER + stamped(lambda t: f"20240312 {clock(t, ':')}"),
    "excel sep": "sep=;\n" + HEADER.replace(",", ";") + rows(";", comma),
    "excel sep quoted": '"sep=\t"\n' + HEADER.replace(",", "\t") + rows("\t"),
    "titles": "Flight test\nAircraft,example\n\n" + HEADER + rows(","),
    "titles below sep": "sep=;\nFlight test\n" + HEADER.replace(",", ";") + rows(";", comma),
    "many titles": "".join(f"H line {k}: setting\n" for k in range(150)) + HEADER + rows(","),
    "trailing": HEADER + rows(",", end=","),
    "trailing in the header too": "time,V,az,\n" + rows(",", end=","),
    "trailing header alone": "time,V,az,\n" + rows(","),
    "closing": HEADER + rows(",") + "END OF DATA\n",
    "closing without line end": HEADER + rows(",") + "\nend of file",
    "closing of as many words": "time V az\n" + rows(" ") + "END OF DATA\n",
    "pipes": "\n time | V | az | \n" + rows(" | ", end=" | "),
    "framed by pipes": "| time | V | az |\n" + rows(" | ").replace("\n", " |\n"),
    "names with commas between tabs": "time, s\tV, m/s\taz, m/s^2\n" + rows("\t"),
    "minus sign of typography": HEADER + rows(",").replace("-", "\u2212"),
    "exponents of Fortran": "time V az\n" + rows("  ", fortran),
    "decimal comma": "time;V;az\n" + rows(";", comma),
    "decimal comma between blanks": "time V az\n" + rows("  ", comma),
    "decimal comma quoted": HEADER + rows(",", lambda x: f'"{comma(x)}"'),
    "thousands with dots": "time;V;az\n"
    + rows(";", lambda x: comma(x).replace("10", "1.0", 1) if x > 1000 else comma(x)),
    "thousands with commas": HEADER + rows(",", lambda x: f'"{x:,.5f}"'),
    "thousands with apostrophes": "time;V;az\n"
    + rows(";", lambda x: f"{x:,.5f}".replace(",", "'")),
    "units above": "s,m/s,m/s^2\n" + HEADER + rows(","),
    "units below": HEADER + "s,m/s,m/s^2\n" + rows(","),
    "units below in brackets": HEADER + "[s],[m/s],[m/s^2]\n" + rows(","),
    "units in a comment below names in a comment": "% time V az\n% s m/s m/s^2\n" + rows(" "),
    "units in a comment": "#s, m/s, m/s2\n" + HEADER + rows(","),
    "names in a comment": "# flight of today\n# time V az\n" + rows(" "),
    "group line above": "Clock,Air data,\ntime,V,az\n" + rows(","),
    "comments between the data": HEADER + rows(",").replace("\n0.5", "\n# paused\n0.5", 1),
    "names again": HEADER + rows(",").replace("\n1.0", "\n" + HEADER + "1.0", 1),
    "numbers with units": HEADER + rows(",").replace(",-", " s,-").replace(" s,", " m/s,"),
    "ISO": HEADER + stamped(lambda t: f"2024-03-12T{clock(t)}Z"),
    "ISO with a zone": HEADER + stamped(lambda t: f"2024-03-12 {clock(t)}+01:00"),
    "German date": "time;V;az\n" + stamped(lambda t: f"12.03.2024 {clock(t, ',')}", ";", comma),
    "American date": HEADER + stamped(lambda t: f"03/25/2024 {clock(t)}"),
    "MATLAB date": HEADER + stamped(lambda t: f"12-Mar-2024 {clock(t)}"),
    "time of day": HEADER + stamped(clock),
    "AM and PM": HEADER + stamped(lambda t: clock(t).replace("14:", "02:") + " PM"),
    "past midnight": HEADER
    + stamped(
        lambda t: (
            f"23:59:59.{round(t * 1000):03d}" if t < 0.999 else clock(t - 1.0).replace("14:", "00:")
        )
    ),
    "minutes and seconds": HEADER + stamped(lambda t: f"0:{t:06.3f}"),
    "pandas durations": HEADER + stamped(lambda t: f"0 days {clock(t).replace('14:', '00:')}"),
}


def read(folder: Path, text: str, encoding: str = "utf-8") -> Recording:
    path = folder / "flight.csv"
    path.write_text(text, encoding=encoding, newline="")
    return read_tabular(path)


@pytest.mark.parametrize("form", FORMS)
def test_every_form_holds_the_same_numbers(tmp_path: Path, form: str) -> None:
    recording = read(tmp_path, FORMS[form])
    topic = recording.topics["table"]
    assert list(topic.fields) == list(TRUTH)
    for name, expected in TRUTH.items():
        values = np.asarray(topic.fields[name])
        values = values - values[0] if name == "time" else values
        np.testing.assert_allclose(values, expected, rtol=1e-8, atol=6e-6, err_msg=name)
    assert not recording.damage
    assert "skipped" not in recording.metadata


@pytest.mark.parametrize("form", [name for name in FORMS if name.startswith("units")])
def test_units_of_a_row_are_those_of_the_columns(tmp_path: Path, form: str) -> None:
    units = read(tmp_path, FORMS[form]).topics["table"].units
    assert dict(units) in (
        {"time": "s", "V": "m/s", "az": "m/s^2"},
        {"time": "s", "V": "m/s", "az": "m/s2"},
    )


@pytest.mark.parametrize("cut", [0, 5])
def test_room_that_a_logger_reserved_is_no_sample(tmp_path: Path, cut: int) -> None:
    text = HEADER + rows(",")
    recording = read(tmp_path, text[: len(text) - cut] + "\x00" * 512)
    fields = recording.topics["table"].fields
    count = len(TIME) - (cut > 0)
    np.testing.assert_allclose(fields["V"], SPEED[:count], rtol=1e-8)
    assert recording.damage[0].what.startswith("the file ends in zeros")
    assert recording.damage[0].bytes_lost == 512


def test_dates_are_seconds_since_1970(tmp_path: Path) -> None:
    """2024-03-12 14:00:00 UTC is 1710252000 s of POSIX time (IEEE 1003.1, 4.16)."""
    for form, first in (
        ("ISO", 1710252000.0),
        ("ISO with a zone", 1710252000.0 - 3600.0),
        ("German date", 1710252000.0),
        ("MATLAB date", 1710252000.0),
        ("date of digits", 1710252000.0),
    ):
        topic = read(tmp_path, FORMS[form]).topics["table"]
        assert topic.fields["time"][0] == first, form
        assert topic.units["time"] == "s"


@pytest.mark.parametrize(
    ("form", "said"),
    [
        ("titles", "titles above the table are not read: 'Flight test' and 1 more"),
        ("titles below sep", "titles above the table are not read: 'Flight test'"),
        ("closing", "closing lines are not read: 'END OF DATA'"),
        ("names again", "1 comments or repeated headers between the data"),
        ("ISO", "time: dates as seconds"),
    ],
)
def test_what_is_not_read_as_it_stands_is_said(tmp_path: Path, form: str, said: str) -> None:
    assert read(tmp_path, FORMS[form]).metadata["remarks"] == said


def test_an_order_of_day_and_month_that_stays_open_is_said(tmp_path: Path) -> None:
    text = HEADER + stamped(lambda t: f"03/12/2024 {clock(t)}")
    assert "the first number as the month" in str(read(tmp_path, text).metadata["remarks"])


def test_one_name_with_two_units_is_two_columns(tmp_path: Path) -> None:
    topic = read(tmp_path, "t [s],a [deg],a [rad]\n0,1,2\n1,3,4\n").topics["table"]
    assert dict(topic.units) == {"t": "s", "a [deg]": "deg", "a [rad]": "rad"}


@pytest.mark.parametrize(
    "names", ["g[0],g[1],g[2]", "g(1),g(2),g(3)", "g[x],g[y],g[z]", "g(1 ),g(2 ),g(3 )"]
)
def test_an_index_in_brackets_is_no_unit(tmp_path: Path, names: str) -> None:
    topic = read(tmp_path, f"{names}\n1,2,3\n4,5,6\n").topics["table"]
    assert list(topic.fields) == names.split(",")
    assert not topic.units


def test_a_one_in_brackets_that_stands_apart_is_the_unit_of_numbers(tmp_path: Path) -> None:
    """As aerodb's own tables have it; beside other indices it is one."""
    text = "time [s],mach [1],gyro [0],gyro [1]\n0,.5,1,2\n.1,.5,1,2\n.2,.5,1,2\n"
    topic = read(tmp_path, text).topics["table"]
    assert [*topic.fields] == ["time", "mach", "gyro [0]", "gyro [1]"]
    assert dict(topic.units) == {"time": "s", "mach": "1"}


def test_an_index_before_a_unit(tmp_path: Path) -> None:
    topic = read(tmp_path, "g[0] (rad/s),g[1] (rad/s)\n1,2\n3,4\n").topics["table"]
    assert dict(topic.units) == {"g[0]": "rad/s", "g[1]": "rad/s"}


def test_names_of_x_plane_hold_their_units(tmp_path: Path) -> None:
    text = " _totl,_time |  Vtrue,_ktas |  alpha,__deg | \n 0.1 | 100.0 | 4.0 | \n 0.2 | 101.0 | 4.1 | \n"
    topic = read(tmp_path, text).topics["table"]
    assert dict(topic.units) == {"Vtrue": "ktas", "alpha": "deg"}


def test_unicode_text_of_excel(tmp_path: Path) -> None:
    topic = read(tmp_path, HEADER.replace(",", "\t") + rows("\t"), "utf-16").topics["table"]
    np.testing.assert_allclose(topic.fields["V"], SPEED, atol=1e-5)


def test_a_column_of_remarks_beside_decimal_commas(tmp_path: Path) -> None:
    text = "Zeit [s];V [m/s];Bemerkung\n" + "".join(
        f"{comma(t)};{comma(v)};Anflug Nr. 1\n" for t, v in zip(TIME, SPEED, strict=True)
    )
    recording = read(tmp_path, text)
    np.testing.assert_allclose(recording.topics["table"].fields["V"], SPEED, atol=1e-5)
    assert recording.metadata["skipped"] == "Bemerkung"


def test_numbers_with_points_are_read_bit_for_bit(tmp_path: Path) -> None:
    values = np.random.default_rng(5).normal(size=(40, 3))
    text = HEADER + "".join(",".join(map(repr, row.tolist())) + "\n" for row in values)
    fields = read(tmp_path, text).topics["table"].fields
    np.testing.assert_allclose(np.column_stack(list(fields.values())), values, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("a,b,c\n1,2\n3,4\n", "line 2 has 2 fields, 3 were expected"),
        ("T\n\na,b\n1,2\n3,4,5\n6,7\n", "line 5 has 3 fields, 2 were expected"),
        ("a,b\n# x\n1,2\n3\n6,7\n", "line 4 has 1 fields, 2 were expected"),
        ("\n\n", "no rows of numbers"),
    ],
)
def test_a_line_that_does_not_fit_is_named_as_the_file_counts(
    tmp_path: Path, text: str, what: str
) -> None:
    with pytest.raises(InputError, match=what):
        read(tmp_path, text)


@pytest.mark.parametrize("mark", [b",", b";", b"\t", b"|", b" "])
def test_more_columns_than_any_log_has_are_refused(mark: bytes) -> None:
    """200,000 columns took 82 s and 1.9 GB."""
    wide = b"".join(mark.join([b"1"] * 200_000) + b"\n" for _ in range(3))
    with pytest.raises(InputError, match="more than 20000 columns"):
        read_text(wide, "log.csv")


@pytest.mark.parametrize(
    ("header", "written"),
    [
        ("time/s,V/(km/h),alpha/deg", ("s", "km/h", "deg")),
        ("time in s,V in kt,alpha in rad", ("s", "kt", "rad")),
        ("time {s},V {m/s},alpha {deg}", ("s", "m/s", "deg")),
        ("time [s],V [m/s],alpha [Grad]", ("s", "m/s", "Grad")),
    ],
)
def test_units_behind_a_slash_in_and_in_braces(
    tmp_path: Path, header: str, written: tuple[str, ...]
) -> None:
    path = tmp_path / "flight.csv"
    path.write_text(header + "\n" + "".join(f"{k / 20},{20 + k},{k / 9}\n" for k in range(60)))
    topic = read_tabular(path).topics["table"]
    assert list(topic.fields) == ["time", "V", "alpha"]
    assert tuple(topic.units[name] for name in topic.fields) == written


def test_a_quotient_is_no_unit(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    path.write_text("time,L/D,m/s\n" + "".join(f"{k},{k},{k}\n" for k in range(60)))
    assert list(read_tabular(path).topics["table"].fields) == ["time", "L/D", "m/s"]


@pytest.mark.parametrize("part", [1.0, 100.0, 1000.0])
def test_digits_of_a_clock_are_seconds(tmp_path: Path, part: float) -> None:
    """From 14:58:30 to 15:00:10 in steps of .5 s; as plain numbers they jump by 40 each minute."""
    seconds = 53910.0 + 0.5 * np.arange(200)
    minutes = seconds // 60
    digits = minutes // 60 * 10000 + minutes % 60 * 100 + seconds % 60
    path = tmp_path / "flight.csv"
    rows = "".join(f"{part * d:.1f},{k % 7}\n" for k, d in enumerate(digits))
    path.write_text("gps_time,V\n" + rows)
    recording = read_tabular(path)
    assert np.array_equal(recording.topics["table"].fields["gps_time"], seconds)
    assert recording.topics["table"].units["gps_time"] == "s"
    assert "gps_time: digits of a clock" in str(recording.metadata["remarks"])


def test_a_column_that_only_rises_is_no_clock(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    for values in (np.arange(300.0), 14.0 + np.cumsum(rng.random(300)), 100.0 + np.arange(50.0)):
        path = tmp_path / "flight.csv"
        path.write_text("time,V\n" + "".join(f"{v:.3f},{k % 7}\n" for k, v in enumerate(values)))
        assert np.allclose(read_tabular(path).topics["table"].fields["time"], values, atol=1e-3)


@pytest.mark.parametrize("writes_times", [True, False])
def test_a_labview_measurement_file_is_its_table(tmp_path, writes_times):
    head = "LabVIEW Measurement\t\nSeparator\tTab\t\nDecimal_Separator\t,\t\nTime\t14:00:00,1\t\n"
    head += "***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t4\t4\t\nY_Unit_Label\tdeg\tPa\t\n"
    head += "X0\t0,0E+0\t0,0E+0\t\nDelta_X\t0,02\t0,02\t\n***End_of_Header***\t\t\t\n"
    rows = [f"{0.02 * k if writes_times else ''}\t{k}.5\t60{k}.25\t" for k in range(4)]
    text = head + "X_Value\tRollwinkel\tStaudruck\tComment\n" + "\n".join(rows).replace(".", ",")
    path = tmp_path / "a.lvm"
    path.write_text(text + "\n", encoding="utf-8")
    topic = read_tabular(path).topics["table"]
    np.testing.assert_allclose(topic.fields["X_Value"], [0.0, 0.02, 0.04, 0.06])
    np.testing.assert_allclose(topic.fields["Staudruck"], [600.25, 601.25, 602.25, 603.25])
    assert topic.units == {"X_Value": "s", "Rollwinkel": "deg", "Staudruck": "Pa"}


@pytest.mark.parametrize("step", [50, 100, 200])
def test_milliseconds_with_gaps_are_no_digits_of_a_clock(tmp_path: Path, step: int) -> None:
    stamps = [step * k for k in range(5900 // step) if k not in (5, 6, 7, 12)]
    text = "time_ms,V\n" + "".join(f"{stamp},{20 + stamp % 3}\n" for stamp in stamps)
    recording = read(tmp_path, text)
    np.testing.assert_array_equal(recording.topics["table"].fields["time_ms"], stamps)
    assert "remarks" not in recording.metadata


def test_lines_framed_by_pipes_with_a_rule_under_the_header(tmp_path: Path) -> None:
    text = "| t [s] | V [m/s] |\n|---|---|\n"
    text += "".join(f"| {0.1 * k:.1f} | {20 + k % 3} |\n" for k in range(40))
    topic = read(tmp_path, text).topics["table"]
    assert topic.units == {"t": "s", "V": "m/s"}
    np.testing.assert_allclose(topic.fields["t"], 0.1 * np.arange(40))


@pytest.mark.parametrize("names", [",V,az", "time,V,az"])
def test_groups_above_names_above_units(tmp_path: Path, names: str) -> None:
    text = f"time,Aircraft,Aircraft\n{names}\n[s],[m/s],[m/s2]\n" + rows(",")
    topic = read(tmp_path, text).topics["table"]
    assert topic.units == {"time": "s", "V": "m/s", "az": "m/s2"}


def test_a_comment_may_say_that_units_follow(tmp_path: Path) -> None:
    text = "# units: s, m/s, m/s2\n" + HEADER + rows(",")
    assert read(tmp_path, text).topics["table"].units["time"] == "s"
