"""DataFlash logs as text give what the binary log of the same flight gives."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.recording import Recording, Topic
from aerodb.storage.readers.any_format import read_log
from tests.support.command import aerodb
from tests.support.dataflash_log import MESSAGES, DataFlashWriter

N = 100
#: Messages that describe others.
ABOUT = ("UNIT", "MULT", "FMTU")
TIME = np.arange(1, N + 1) * 20_000


@dataclass
class TextWriter(DataFlashWriter):
    """The same records as lines, as Mission Planner writes them."""

    lines: list[str] = field(default_factory=list)

    def describe(self, name: str, identity: int, characters: str, labels: str) -> None:
        super().describe(name, identity, characters, labels)
        self.lines.append(f"FMT, {identity}, 89, {name}, {characters}, {labels}")

    def add(self, name: str, *values: object) -> None:
        super().add(name, *values)
        characters = MESSAGES[name][1]
        shown = [
            f"{value:.9g}" if c in "fdcCeEL" else str(value)
            for c, value in zip(characters, values, strict=True)
        ]
        self.lines.append(", ".join([name, *shown]))


def written(folder: Path, units: bool = True) -> tuple[Recording, Recording, list[str]]:
    """The binary log, the same as text, and its lines."""
    log = TextWriter.begun((*ABOUT, "MSG", "PARM", "IMU", "ATT", "BARO", "GPS"), units)
    log.add("MSG", 1000, "ArduPlane V4.5.7, with, commas")
    log.add("PARM", 1000, "SERVO1_FUNCTION", 4.0, 0.0)
    rng = np.random.default_rng(2)
    for k, us in enumerate(TIME.tolist()):
        for number in (0, 1):
            log.add("IMU", us + number, *_row("IMU", rng, number))
        log.add("ATT", us, *_row("ATT", rng, 0))
        if k % 5 == 0:
            log.add("BARO", us, *_row("BARO", rng, 0))
            log.add("GPS", us, *_row("GPS", rng, 0))
    (folder / "a.bin").write_bytes(bytes(log.data))
    lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns", *log.lines]
    (folder / "a.log").write_text("\n".join(lines) + "\n")
    return read_log(folder / "a.bin"), read_log(folder / "a.log"), lines


def _row(name: str, rng: np.random.Generator, number: int) -> list[object]:
    characters, labels = MESSAGES[name][1:3]
    row: list[object] = []
    for c, label in zip(characters[1:], labels.split(",")[1:], strict=True):
        if label == "I":
            row.append(number)
        elif c in "nNZ":
            row.append("text")
        elif c in "fd":
            row.append(float(np.float32(rng.normal())))
        elif c in "cCeEL":
            row.append(float(rng.integers(1, 90)))
        else:
            row.append(int(rng.integers(0, 100)))
    return row


@pytest.mark.parametrize("units", [True, False])
def test_a_text_log_is_the_binary_log(tmp_path: Path, units: bool) -> None:
    binary, text, _ = written(tmp_path, units)
    assert text.topics.keys() == binary.topics.keys()
    assert {"IMU", "ATT", *(["IMU.1"] if units else [])} <= text.topics.keys()
    for name, topic in binary.topics.items():
        other: Topic = text.topics[name]
        np.testing.assert_allclose(other.time, topic.time, rtol=0, atol=1e-9)
        assert other.units == topic.units
        assert other.fields.keys() == topic.fields.keys()
        for label, values in topic.fields.items():
            np.testing.assert_allclose(other.fields[label], values, rtol=1e-7, atol=1e-9)
    assert text.metadata == binary.metadata
    assert text.start_utc == binary.start_utc
    assert (text.format, text.layout) == (binary.format, binary.layout)
    assert text.damage == ()


def test_what_is_no_record_is_reported(tmp_path: Path) -> None:
    _, whole, lines = written(tmp_path)
    k = next(n for n, line in enumerate(lines) if line.startswith("ATT"))
    odd = [*lines[: k + 1], "IMU, 3, 4", "noise", "ATT, 99, x, x, x, x, x, x, x, x, x", *lines[k:]]
    (tmp_path / "b.log").write_text("\n".join(odd) + "\nATT, 123")
    found = read_log(tmp_path / "b.log")
    kinds = sorted(each.kind for each in found.damage)
    assert "framing" in kinds
    assert "lost_tail" in kinds
    framing = next(each for each in found.damage if each.kind == "framing")
    assert framing.bytes_lost >= len("IMU, 3, 4\nnoise\n")
    assert len(found.topics["ATT"].time) == len(whole.topics["ATT"].time) + 1


def test_a_mode_by_its_name_is_a_text(tmp_path: Path) -> None:
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 155, 14, MODE, QMBB, TimeUS,Mode,ModeNum,Rsn",
        "MODE, 1000000, QHOVER, 18, 1",
        "MODE, 2000000, FBWA, 5, 1",
    ]
    (tmp_path / "a.log").write_text("\r\n".join(lines) + "\r\n")
    topic = read_log(tmp_path / "a.log").topics["MODE"]
    assert topic.fields["ModeNum"].tolist() == [18, 5]
    assert "Mode" not in topic.fields


def test_a_log_of_descriptions_alone_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n")
    with pytest.raises(InputError, match="no data"):
        read_log(path)


def test_a_text_log_by_command(tmp_path: Path) -> None:
    written(tmp_path)
    done = aerodb(tmp_path / "w", "log", "inspect", str(tmp_path / "a.log"))
    assert done.returncode == 0
    assert "dataflash, fixed wing" in done.stdout.split("\n")[0]
