"""Bad input on the command line: refused in two lines, quarantined with a reason, nothing else
changed."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sqlalchemy as sa
from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from aerodb.recording import Topic
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.writers.ulog import write_ulog
from tests.support.command import aerodb, asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import (
    DATABASE,
    MODEL,
    NAME,
    VEHICLE,
    channels,
    state_of,
    write_csv,
    write_parquet,
)

#: What a refusal may leave behind: that somebody tried and was told, and the log that was refused.
OF_REFUSALS = {"runs", "run_dismissals", "log_files"}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    return shared.ingested(tmp_path_factory.mktemp("made") / "w").root


def everything(root: Path) -> tuple[dict[str, str], dict[str, list[Any]]]:
    """Hashes of all files and rows of all tables, but for quarantine and `OF_REFUSALS`."""
    engine = sa.create_engine(f"sqlite:///{root / 'catalogue.sqlite'}")
    with engine.connect() as connection:
        names = [
            name for name in sa.inspect(connection).get_table_names() if name not in OF_REFUSALS
        ]
        rows = {
            name: [tuple(row) for row in connection.execute(sa.text(f'SELECT * FROM "{name}"'))]
            for name in names
        }
    engine.dispose()
    rows["chain"] = [row for row in rows["chain"] if row[1] not in OF_REFUSALS]  # its table
    return state_of(root), rows


def refused(workspace: Path, *arguments: str, process: bool = False) -> list[str]:
    """Runs a command (`process`: as the shell does) that must end with 3 and two lines, and changes
    nothing; the lines."""
    before = everything(workspace)
    if process:
        done = aerodb(workspace, *arguments)
        code, said, complained = done.returncode, done.stdout, done.stderr
    else:
        result = CliRunner().invoke(app, ["--workspace", str(workspace), *arguments])
        code, said, complained = result.exit_code, result.stdout, result.stderr
    lines = complained.splitlines()
    assert (code, said, len(lines)) == (3, "", 2), (said, complained)
    assert lines[0].startswith("aerodb: ")
    assert everything(workspace) == before
    return lines


def ingest(log: Path, *options: str) -> list[str]:
    return ["flight", "ingest", str(log), "--vehicle", NAME, "--direct", *options]


def ulog(path: Path, seconds: float = 8.0) -> bytes:
    """A real ULog of the glider's channels, as one topic ``glider``; returns its bytes."""
    table = channels(40, seconds)
    fields = {name: values.astype(np.float32) for name, values in table.items() if name != "time"}
    write_ulog(path, [Topic("glider", table["time"] + 1.0, fields)], metadata={"sys_name": "TEST"})
    return path.read_bytes()


def own_mapping(path: Path, unit_of_alpha: str = "rad") -> Path:
    """A user's mapping file for that ULog."""
    units = {
        "V": "m/s",
        "qbar": "Pa",
        "alpha": unit_of_alpha,
        "beta": "rad",
        "delta_elevator": "rad",
    }
    units |= dict.fromkeys("pqr", "rad/s") | dict.fromkeys(("ax", "ay", "az"), "m/s^2")
    text = 'name = "own"\nformats = ["ulog"]\ndetect = ["glider"]\n'
    for name, unit in units.items():
        text += (
            f'[[channel]]\nname = "{name}"\nsources = [{{ topic = "glider", field = "{name}", unit'
            f' = "{unit}" }}]\n'
        )
    path.write_text(text)
    return path


def backwards(path: Path) -> None:
    write_csv(path, {**(table := channels(41)), "time": table["time"][::-1].copy()})


def without_air_data(path: Path) -> None:
    write_csv(
        path, {name: values for name, values in channels(42).items() if name not in ("V", "qbar")}
    )


def unknown_unit(path: Path) -> None:
    path.write_text(
        write_csv(path, channels(43)).read_text().replace("alpha [rad]", "alpha [quux]")
    )


def wrong_dimension(path: Path) -> None:
    path.write_text(write_csv(path, channels(44)).read_text().replace("V [m/s]", "V [kg]"))


def cut_parquet(path: Path) -> None:
    path.write_bytes(write_parquet(path, channels(45)).read_bytes()[:-300])


def absurd_mat(path: Path) -> None:
    """A MAT v5 file whose one variable declares 4 GB."""
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(
        header + (14).to_bytes(4, "little") + (0xFFFFFFF0).to_bytes(4, "little") + bytes(16)
    )


FAULTY: dict[str, tuple[str, Callable[[Path], Any], str]] = {
    "empty": ("empty.csv", lambda path: path.write_bytes(b""), "the file is empty"),
    "empty_ulog": ("empty.ulg", lambda path: path.write_bytes(b""), "empty"),
    "another_type": (
        "photo.csv",
        lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256))),
        "not a text file",
    ),
    "unknown_type": (
        "log.xyz",
        lambda path: path.write_bytes(b"hello"),
        "unknown kind of table '.xyz'",
    ),
    "prose": (
        "prose.csv",
        lambda path: path.write_text("once upon a time\nthere was a log\n"),
        "no column contains numbers",
    ),
    "no_layout": (
        "other.csv",
        lambda path: path.write_text("x,y\n1,2\n3,4\n"),
        "no mapping fits this log",
    ),
    "absurd_mat": ("absurd.mat", absurd_mat, "4294967280 bytes declared"),
    "absurd_ulog": (
        "absurd.ulg",
        lambda p: p.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8) + b"\xff\xffAxx"),
        "no data",
    ),
    "absurd_mcap": (
        "absurd.mcap",
        lambda p: p.write_bytes(b"\x89MCAP0\r\n\x01" + b"\xff" * 7 + b"\x7f"),
        "no message",
    ),
    "cut_parquet": ("cut.parquet", cut_parquet, "not readable as Parquet"),
    "backwards": ("backwards.csv", backwards, "time does not increase"),
    "unknown_unit": ("unit.csv", unknown_unit, "field table.alpha: unknown unit 'quux'"),
    "wrong_dimension": (
        "dimension.csv",
        wrong_dimension,
        "field table.V: unit 'kg' cannot be converted to 'm/s'",
    ),
    "no_axis": ("no_axis.csv", without_air_data, "no axis can be computed"),
}


@pytest.mark.parametrize("case", FAULTY)
def test_a_faulty_log_goes_to_quarantine_and_nothing_else_changes(
    workspace: Path, tmp_path: Path, case: str
) -> None:
    name, make, reason = FAULTY[case]
    log = tmp_path / name
    make(log)
    data = log.read_bytes()
    lines = refused(workspace, *ingest(log), process=case in ("empty", "unknown_unit"))
    assert reason in lines[0], lines
    assert str(log) in lines[0], "it says where"
    assert lines[1], "it says what to do"
    sha256 = hashlib.sha256(data).hexdigest()
    held = workspace / "quarantine" / sha256
    assert next(held.glob("log*")).read_bytes() == data
    note = json.loads((held / "reason.json").read_text())
    assert reason in note["reason"]
    assert note["sha256"] == sha256
    assert log.read_bytes() == data, "the user's own file stays"
    with Catalogue.open(workspace / "catalogue.sqlite") as catalogue:
        row = catalogue.log(sha256)
        assert row is not None
        assert (row.status, reason in row.reason) == ("quarantined", True)
        assert catalogue.runs(limit=1)[0].state == "completed"


def test_a_refused_log_is_taken_once_its_mapping_is_right(workspace: Path, tmp_path: Path) -> None:
    """Unknown unit in the user's mapping: refused; mended: the same bytes become a flight."""
    log = tmp_path / "own.ulg"
    ulog(log)
    faulty = own_mapping(tmp_path / "faulty.toml", unit_of_alpha="quux")
    lines = refused(workspace, *ingest(log, "--mapping", str(faulty)))
    assert "field glider.alpha: unknown unit 'quux'" in lines[0]
    taken = asked(workspace, *ingest(log, "--mapping", str(own_mapping(tmp_path / "own.toml"))))
    assert [outcome["status"] for outcome in taken] == ["stored"]
    with Catalogue.open(workspace / "catalogue.sqlite") as catalogue:
        row = catalogue.log(taken[0]["sha256"])
        assert row is not None
        assert (row.status, row.reason) == ("stored", "")


def test_a_faulty_mapping_file_is_the_mappings_fault_not_the_logs(
    workspace: Path, tmp_path: Path
) -> None:
    log = write_csv(tmp_path / "good.csv", channels(46))
    mapping = own_mapping(tmp_path / "own.toml")
    mapping.write_text(mapping.read_text().replace('name = "alpha"', 'name = "alhpa"'))
    lines = refused(workspace, *ingest(log, "--mapping", str(mapping)), process=True)
    assert "did you mean 'alpha'?" in " ".join(lines)
    lines = refused(workspace, *ingest(log, "--mapping", "canonicl"), process=True)
    assert "did you mean 'canonical'?" in lines[1]
    assert not (workspace / "quarantine" / hashlib.sha256(log.read_bytes()).hexdigest()).exists()


@pytest.mark.parametrize("kind", ["csv", "ulg"])
def test_a_lost_tail_is_stored_as_damaged_and_strict_refuses_it(
    workspace: Path, tmp_path: Path, kind: str
) -> None:
    log = tmp_path / f"cut.{kind}"
    if kind == "csv":
        whole = write_csv(log, channels(47)).read_bytes()
        options: list[str] = []
    else:
        whole = ulog(log)
        options = ["--mapping", str(own_mapping(tmp_path / "own.toml"))]
    log.write_bytes(whole[:-17])
    sha256 = hashlib.sha256(whole[:-17]).hexdigest()
    lines = refused(workspace, *ingest(log, "--strict", *options))
    assert lines[1] == "ingest without --strict to keep what is intact"
    assert (workspace / "quarantine" / sha256 / "reason.json").is_file()
    (outcome,) = asked(workspace, *ingest(log, *options))
    assert outcome["status"] == "damaged"
    assert outcome["damage"][0]["kind"] == "lost_tail"
    shown = asked(workspace, "flight", "show", outcome["flight"])
    assert shown["log"]["status"] == "damaged"
    assert shown["log"]["damage"][0]["kind"] == "lost_tail"
    assert shown["samples"] == (299 if kind == "csv" else 199)
    assert outcome["comparison"]["key"], "what is intact is compared all the same"


@pytest.mark.parametrize(
    ("old", "new", "place", "help"),
    [
        (
            "[reference]\narea",
            "[reference]\naera",
            "unknown key 'reference.aera'",
            "did you mean 'area'?",
        ),
        ("mass = 12.0", "mass = -12.0", "mass.mass", "got -12.0"),
        ("[thrust]", "[thurst]", "unknown key 'thurst'", "did you mean 'thrust'?"),
        ('"25 deg"', '"25 kg"', "unit 'kg' cannot be converted to 'rad'", ""),
        ('name = "small-glider"', 'name = "../small"', "name", "got '../small'"),
        ("[reference]", "[reference", "not valid TOML", ""),
    ],
)
def test_a_faulty_vehicle_file_is_refused(
    workspace: Path, tmp_path: Path, old: str, new: str, place: str, help: str
) -> None:
    path = tmp_path / "vehicle.toml"
    assert old in VEHICLE
    path.write_text(VEHICLE.replace(old, new))
    _refused_file(workspace, ["vehicle", "add", str(path)], "vehicle.toml", place, help)


@pytest.mark.parametrize(
    ("old", "new", "place", "help"),
    [
        ("[-4, 0, 4, 8, 12]", "[-4, 0, 8, 4, 12]", "breakpoints of alpha do not increase", ""),
        ("CZ0(alpha)", "CZ0(alhpa)", "'alhpa'", "did you mean 'alpha'?"),
        ("[derivatives.Cm]", "[derivatives.CM]", "unknown axis 'CM'", "did you mean 'Cm'?"),
        ("q_hat = -12.0", "q_hta = -12.0", "'q_hta'", "did you mean 'q_hat'?"),
        ("-1.3]", '"x"]', "values are not a rectangular list of numbers", ""),
    ],
)
def test_a_faulty_database_file_is_refused(
    workspace: Path, tmp_path: Path, old: str, new: str, place: str, help: str
) -> None:
    path = tmp_path / "database.toml"
    assert old in DATABASE
    path.write_text(DATABASE.replace(old, new))
    _refused_file(
        workspace,
        ["database", "import", str(path), "--vehicle", NAME],
        "database.toml",
        place,
        help,
    )


@pytest.mark.parametrize(
    ("old", "new", "place", "help"),
    [
        (
            '"q_hat"',
            '"q_hta"',
            "increment on CZ: no channel 'q_hta' in these flights",
            "did you mean 'q_hat'?",
        ),
        (
            '"q_hat"',
            '"delta_elevatr"',
            "no channel 'delta_elevatr'",
            "did you mean 'delta_elevator'?",
        ),
        ('"q_hat"', '"alpha +"', "unexpected end", "near: 'alpha +'"),
        ('axis = "CZ"', 'axis = "Cz"', "unknown axis 'Cz'", "did you mean 'CZ'?"),
        ("terms", "trems", "unknown key", "did you mean 'terms'?"),
    ],
)
def test_a_faulty_model_file_is_refused(
    workspace: Path, tmp_path: Path, old: str, new: str, place: str, help: str
) -> None:
    path = tmp_path / "model.toml"
    path.write_text(MODEL.replace(old, new, 1))
    command = ["update", "--vehicle", NAME, "--model", str(path), "--direct"]
    _refused_file(
        workspace, command, "model.toml" if "no channel" not in place else "model file", place, help
    )


def _refused_file(workspace: Path, command: list[str], file: str, place: str, help: str) -> None:
    before = everything(workspace)
    result = CliRunner().invoke(app, ["--workspace", str(workspace), *command])
    lines = str(result.exception).splitlines()
    assert type(result.exception).__name__ == "InputError", result.output
    assert 1 <= len(lines) <= 2, lines
    assert file in lines[0]
    assert place in lines[0], lines
    assert help in " ".join(lines), lines
    assert everything(workspace) == before


def test_refused_files_end_with_3_and_two_lines(workspace: Path, tmp_path: Path) -> None:
    """One of each kind through the real process; the rest of the cases go through the runner."""
    for name, text, command in (
        ("vehicle.toml", VEHICLE.replace("area", "aera"), ["vehicle", "add"]),
        (
            "database.toml",
            DATABASE.replace("CZ0(alpha)", "CZ0(alhpa)"),
            ["database", "import", "--vehicle", NAME],
        ),
        (
            "model.toml",
            MODEL.replace("q_hat", "q_hta"),
            ["update", "--vehicle", NAME, "--direct", "--model"],
        ),
    ):
        (tmp_path / name).write_text(text)
        assert refused(workspace, *command, str(tmp_path / name), process=True)[1].startswith(
            "did you mean '"
        )
