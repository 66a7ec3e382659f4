"""Selection of samples by time, by condition and by phase."""

import numpy as np
import pytest

from aerodb.conditioning import checked_conditions, selected
from aerodb.errors import InputError, UnknownNameError
from aerodb.flight import Flight

TIME = 100.0 + np.arange(0.0, 20.0, 0.1)


def flight() -> Flight:
    spent = TIME - TIME[0]
    up = (spent > 5.0) & (spent < 15.0)
    return Flight(
        "f" * 64, "quad", TIME,
        {
            "V": np.where(up & (spent > 9.95), 6.0, 0.0),
            "command_1": np.where(up, 0.6, 0.05), "command_2": np.where(up, 0.6, 0.05),
        },
    )  # fmt: skip


@pytest.mark.parametrize(
    ("conditions", "first", "last"),
    [
        (["time >= 3 s", "time < 4 s"], 3.0, 3.9),
        (["command_1 > 0.3"], 5.1, 14.9),
        (["command_1 > 0.3", "V > 5 kt"], 10.0, 14.9),
        (["phase = hover", "time >= 6"], 6.0, 9.9),
    ],
)
def test_what_is_selected(conditions: list[str], first: float, last: float) -> None:
    found = (TIME - TIME[0])[selected(flight(), conditions)]
    assert (found[0], found[-1]) == (pytest.approx(first), pytest.approx(last))


def test_what_is_not_a_phase_is_the_rest() -> None:
    inside, rest = (selected(flight(), [f"phase {sign} hover"]) for sign in ("=", "!="))
    assert np.array_equal(inside, ~rest)


@pytest.mark.parametrize(
    ("condition", "said"),
    [
        ("V above 3", "no condition"),
        ("phase > hover", "no condition"),
        ("commnd_1 > 0.3", "unknown channel"),
        ("V > 3 kg", "kg"),
    ],
)
def test_what_cannot_be_read_is_said_before_any_flight(condition: str, said: str) -> None:
    with pytest.raises((InputError, UnknownNameError), match=said):
        checked_conditions([condition])


@pytest.mark.parametrize("condition", ["time > 1 h", "phase = landed", "command_3 > 0.1"])
def test_what_selects_nothing_is_said(condition: str) -> None:
    with pytest.raises((InputError, UnknownNameError)):
        selected(flight(), [condition])
