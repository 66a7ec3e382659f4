"""TOML from strangers: refused with a sentence, in little time and memory."""

import subprocess
import sys

import pytest

from aerodb.errors import InputError
from aerodb.support import parsed_toml

HOSTILE = {
    "nested arrays": ("x = " + "[" * 100_000, "nest deeper than 64"),
    "nested arrays that end": ("x = " + "[" * 90 + "]" * 90, "nest deeper than 64"),
    "nested tables": ("x = " + "{a = " * 100_000, "nest deeper than 64"),
    "a key of 50,000 parts": (".".join(["a"] * 50_000) + " = 1", "more than 64 parts in line 1"),
    "a header of 50,000 parts": ("\n[" + " . ".join(["a-1"] * 50_000) + "]", "parts in line 2"),
    "quoted parts": (".".join(['"a b"', "'c'"] * 25_000) + " = 1", "more than 64 parts"),
    "a number of 6,000 digits": ("x = " + "9" * 6_000, "not valid TOML"),
    "a word of 300,000 letters": ("x = " + "f" * 300_000, "not valid TOML"),
    "no end": ("x = [", "not valid TOML"),
    "too long": ("#" * 50_000_001, "at most 50000000"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_is_refused(name: str) -> None:
    text, said = HOSTILE[name]
    with pytest.raises(InputError, match=said):
        parsed_toml(text, "vehicle file")


def test_what_people_write_is_read() -> None:
    text = 'a.b.c = 1\n[[x]]\ny = [[1.5, 2], [3, 4]]\n[z."file-1.2.3".q]\nw = {v = "1.2.3.4"}\n'
    assert parsed_toml(text, "")["z"] == {"file-1.2.3": {"q": {"w": {"v": "1.2.3.4"}}}}
    assert parsed_toml(".".join(["a"] * 64) + " = 1", "")  # the longest key
    table = "x = [" + ", ".join(["[1.25, 2.5]"] * 100_000) + "]"
    assert len(parsed_toml(table, "")["x"]) == 100_000


def test_it_takes_little_memory() -> None:
    """A key of 50,000 parts once took 8.6 GB."""
    code = (
        "import resource\n"
        "resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))\n"
        "from tests.aerodb.test_toml import HOSTILE\n"
        "from aerodb.support import parsed_toml\n"
        "from aerodb.errors import InputError\n"
        "for text, _ in HOSTILE.values():\n"
        "    try:\n"
        "        parsed_toml(text, '')\n"
        "    except InputError:\n"
        "        continue\n"
        "    raise SystemExit(3)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
