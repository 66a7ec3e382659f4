"""What stays at hand: as it was made, not to be written to, bounded, and made anew when its file
changes."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from aerodb.tasks import memory_cache as module
from aerodb.tasks.memory_cache import kept, of_file


@dataclass(frozen=True)
class Held:
    values: dict[str, np.ndarray]


def test_what_is_kept_is_made_once_and_cannot_be_written_to() -> None:
    made: list[int] = []

    def make() -> Held:
        made.append(1)
        return Held({"a": np.arange(3.0)})

    first, again = kept("once", make), kept("once", make)
    assert (again is first, made) == (True, [1])
    with pytest.raises(ValueError, match="read-only"):
        first.values["a"][0] = 1.0


def test_the_oldest_goes_first_and_what_is_too_large_is_not_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "_ROOM", 4000)
    monkeypatch.setattr(module, "_kept", type(module._kept)(4000, getsizeof=lambda entry: entry[1]))
    for name in "abcdef":
        kept(name, lambda: np.zeros(100))
    assert sorted(module._kept) == ["b", "c", "d", "e", "f"]
    large = kept("large", lambda: np.zeros(200))
    assert large.nbytes == 1600
    assert "large" not in module._kept


def test_a_file_that_changed_is_another(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("one")
    before = of_file(path, "flight")
    assert of_file(path, "flight") == before
    assert of_file(path, "other") != before
    os.utime(path, ns=(1, 1))
    assert of_file(path, "flight") != before
