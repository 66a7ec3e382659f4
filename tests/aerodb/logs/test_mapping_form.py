"""A drafted mapping that is answered line by line: the file of the answers maps the log."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import AeroError, InputError
from aerodb.logs import FormLine, answered, draft_mapping, in_si, mapping_form, parse_mapping
from aerodb.recording import Recording, Topic

TIME = np.arange(0.0, 50.0, 0.05)


def form_of(**columns: np.ndarray):
    topic = Topic("table", TIME, columns)
    recording = Recording("strange.csv", "tabular", "0" * 64, 1, {"table": topic}, {})
    return mapping_form(recording, draft_mapping(recording, "strange"))


def strange():
    return form_of(Roll=np.sin(TIME), Speed_kt=60 + TIME, Elev=0.1 * np.cos(TIME), Mystery=7 + TIME)


def test_the_lines_are_those_of_the_draft_with_what_they_show() -> None:
    form = strange()
    channels = {line.channel: line for line in form.lines}
    assert channels["phi"].place == ("table", "Roll")
    assert channels["phi"].confidence
    assert len(form.columns) == 4
    time, values = in_si(form, replace(channels["phi"], unit="deg"))
    assert len(time) == len(values) <= 300
    assert values.max() == pytest.approx(np.pi / 180, rel=1e-3)


def test_the_answers_make_the_file() -> None:
    form = strange()
    lines = [replace(line, unit="deg") for line in form.lines if line.channel == "phi"]
    lines += [replace(line, channel="") for line in form.lines if line.channel != "phi"]
    lines += [FormLine("V", ("table", "Speed_kt"), "knot", 1.05)]
    made = answered(form, lines)
    mapping = parse_mapping(made.text)
    found = {each.name: each.sources[0] for each in mapping.channel}
    assert set(found) == {"phi", "V"}
    assert (found["V"].field, found["V"].unit, found["V"].scale) == ("Speed_kt", "knot", 1.05)
    assert found["phi"].unit == "deg"
    assert mapping.detect == ("table",) or list(mapping.detect) == ["table"]
    assert "QUESTION" not in made.text
    again = answered(made, made.lines)
    assert again.text == made.text


@pytest.mark.parametrize(
    "line",
    [
        FormLine("phi", ("table", "Roll"), "kg"),
        FormLine("phi", ("table", "Roll"), "no unit"),
        FormLine("no channel", ("table", "Roll"), "deg"),
        FormLine("phi", ("table", "absent"), "deg"),
        FormLine("phi", ("table", 'a"]\n[x'), "deg"),
    ],
)
def test_what_makes_no_mapping_is_refused(line: FormLine) -> None:
    with pytest.raises(AeroError):
        answered(strange(), [line])


def test_one_channel_of_two_fields_is_refused() -> None:
    lines = [FormLine("phi", ("table", name), "deg") for name in ("Roll", "Elev")]
    with pytest.raises(InputError, match="two fields for phi"):
        answered(strange(), lines)


def test_a_log_that_nothing_is_known_of_can_be_mapped_in_the_form() -> None:
    form = form_of(A=np.sin(TIME), B=7 + TIME)
    assert form.lines == ()
    made = answered(form, [FormLine("theta", ("table", "A"), "rad")])
    mapping = parse_mapping(made.text)
    assert [each.name for each in mapping.channel] == ["theta"]
    assert list(mapping.detect) == ["table"]
    assert list(mapping.fields) == ["A"]
