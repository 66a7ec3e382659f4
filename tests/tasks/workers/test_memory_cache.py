"""What stays at hand: as it was made, not to be written to, bounded, and made anew when its file
changes."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from aerodb.tasks.workers import cached, file_key
from aerodb.tasks.workers import memory_cache as module


@dataclass(frozen=True)
class Held:
    values: dict[str, np.ndarray]


def test_what_is_kept_is_made_once_and_cannot_be_written_to() -> None:
    made: list[int] = []

    def make() -> Held:
        made.append(1)
        return Held({"a": np.arange(3.0)})

    first, again = cached("once", make), cached("once", make)
    assert (again is first, made) == (True, [1])
    with pytest.raises(ValueError, match="read-only"):
        first.values["a"][0] = 1.0


def test_the_oldest_goes_first_and_what_is_too_large_is_not_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "_MAX_BYTES", 4000)
    monkeypatch.setattr(module, "_entries", module._Entries())
    for name in "abcdef":
        cached(name, lambda: np.zeros(100))
    assert list(module._entries.values) == ["b", "c", "d", "e", "f"]
    large = cached("large", lambda: np.zeros(200))
    assert large.nbytes == 1600
    assert "large" not in module._entries.values


def test_what_several_share_counts_once_until_the_last_of_them_is_forgotten(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "_MAX_BYTES", 4000)
    monkeypatch.setattr(module, "_entries", module._Entries())
    shared = np.zeros(100)
    for name in "abcdef":
        cached(name, lambda name=name: {"whole": shared, "part": shared[:9], "own": name})
    assert (module._entries.size, list(module._entries.values)) == (800, list("abcdef"))
    for name in "ghij":
        cached(name, lambda: np.zeros(100))
    assert (module._entries.size, list(module._entries.values)) == (4000, list("abcdefghij"))
    cached("a", lambda: None)  # used last
    cached("k", lambda: np.zeros(100))
    assert (module._entries.size, list(module._entries.values)) == (4000, list("hijak"))


def test_a_file_that_changed_is_another(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("one")
    before = file_key(path, "flight")
    assert file_key(path, "flight") == before
    assert file_key(path, "other") != before
    os.utime(path, ns=(1, 1))
    assert file_key(path, "flight") != before
