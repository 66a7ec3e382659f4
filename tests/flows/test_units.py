"""Units of one's choice in what commands print; SI in JSON; angles without a unit are questioned;
states that are not stated exist."""

from pathlib import Path
from typing import Any

import pytest

from aerodb.exchange import read_native
from aerodb.remarks import MOVING_AIR, POSITION_AGAINST_VELOCITY, Remark, said
from aerodb.report import reasons_in_units
from aerodb.tables import height_outside_ground_effect, neutral_point
from aerodb.tasks.references import value_of
from aerodb.tasks.workspace_access import access_workspace
from aerodb.units import UnitSystem
from tests.support.command import aerodb, asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import DATABASE, MODEL, NAME

STEADY = ("--speed", "25", "--altitude", "1000 ft", "--glide")
#: A database whose lift grows near the ground, by a table over the height in spans.
NEAR_GROUND = """
name = "near-ground"
[reference]
area = 1.0
chord = 0.25
span = 4.0
moment_reference = [0.0, 0.0, 0.0]
[tables.ground]
arguments = ["height_ratio"]
breakpoints = [[0.0, 0.5, 1.2]]
values = [1.4, 1.1, 1.0]
[[terms]]
name = "lift"
axis = "CZ"
expression = "-0.5*ground(height_above_ground/b_ref)"
"""


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    place = tmp_path_factory.mktemp("units") / "workspace"
    shared.updated(place)
    return place


def printed(workspace: Path, *arguments: str) -> dict[str, str]:
    """The first two columns of a table that a command prints."""
    done = aerodb(workspace, *arguments)
    assert done.returncode == 0, done.stderr
    return {
        cells[0]: " ".join(cells[1:]) for cells in map(str.split, done.stdout.splitlines()) if cells
    }


def test_a_trim_in_knots_and_the_same_json(workspace: Path) -> None:
    trim = ("version", "trim", "released", *STEADY)
    si, aero, imperial = (
        printed(workspace, *trim, *units)
        for units in ((), ("--units", "aero"), ("--units=imperial",))
    )
    assert si["V"] == "25 m/s"
    assert aero["V"] == "48.596 kt"
    assert imperial["V"] == "82.021 ft/s"
    assert aero["qbar"].endswith(" hPa")
    assert aero["alpha"] == si["alpha"]
    difference = aerodb(workspace, "version", "diff", "v0001", "candidate").stdout
    assert "others held at zero" in difference
    assert " V 1 " not in difference
    document = asked(workspace, *trim)
    assert asked(workspace, *trim, "--units", "aero") == document
    assert document["channels"]["V"] == 25.0


def test_reasons_of_a_verdict_come_in_the_units_that_are_shown() -> None:
    """Those that an earlier release stored as words alone stay as they are."""
    gusts = {"V": (0.66, "m/s"), "alpha": (0.39, "m/s")}
    moving = Remark(MOVING_AIR, tuple(gusts), gusts, "the air moved: V 0.66")
    off = {"north": (1.0, "m/s"), "jump": (20.0, "m/s"), "limit": (0.8, "m/s")}
    jumping = Remark(POSITION_AGAINST_VELOCITY, ("north",), off)
    remarks = [moving.document(), jumping.document(), said("damaged").document()]
    stored = {"reasons": ["the air moved", "jumps", "damaged"], "verdict_remarks": remarks}
    advice = "use regression or filter error, not output error"
    shown = reasons_in_units(stored, UnitSystem("aero"))
    assert shown[0] == f"turbulence of 1.3 kt rms: {advice}"
    assert "off by 1.9 kt rms" in shown[1]
    assert shown[1].endswith("limit 1.56 kt")
    assert shown[2] == "damaged"
    assert reasons_in_units(stored) == [moving.sentence, jumping.sentence, "damaged"]
    assert moving.sentence == f"turbulence of 0.66 m/s rms: {advice}"
    words = {"reasons": ["the air moved: V 0.66"], "verdict_remarks": []}
    assert reasons_in_units(words, UnitSystem("aero")) == words["reasons"]


def test_the_user_comes_before_the_settings_and_the_option_before_both(
    workspace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from typer.testing import CliRunner

    from aerodb.flows.cli.main import app

    def speed(*more: str) -> str:
        given = ["--workspace", str(workspace), "version", "trim", "released", *STEADY, *more]
        result = CliRunner().invoke(app, given)
        return next(line for line in result.stdout.splitlines() if line.startswith("V "))

    settings = workspace / "settings.toml"
    settings.write_text('[show]\nunits = "aero"\n')
    assert "kt" in speed()
    monkeypatch.setenv("AERODB_UNITS", "imperial")
    assert "ft/s" in speed()
    assert "m/s" in speed("--units", "si")
    settings.write_text('[show]\nunits = "knots"\n')
    assert "m/s" in speed("--units", "si")
    settings.unlink()


def test_the_report_that_a_command_writes_is_in_the_units_asked_for(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    """Also where the settings alone ask for them; the document is the same, in SI."""
    place, model = tmp_path / "workspace", tmp_path / "model.toml"
    shared.ingested(place)
    model.write_text(MODEL, encoding="utf-8")
    update = ("update", "--model", str(model), "--vehicle", NAME, "--direct")

    def said(*more: str) -> tuple[str, dict[str, Any]]:
        document = asked(place, *update, *more)
        page = Path(document.pop("page")).read_text(encoding="utf-8")
        return page[page.index("<footer>") :], document

    si, document = said("--units", "si")
    assert "SI units unless stated" in si
    aero, same = said("--units", "aero")
    assert "kt, ft, hPa, otherwise SI units unless stated" in aero
    assert same["axes"] == document["axes"]
    (place / "settings.toml").write_text('[show]\nunits = "imperial"\n', encoding="utf-8")
    assert "ft/s, ft" in said()[0]


def test_an_unknown_system_of_units_says_which_there_are(workspace: Path) -> None:
    for command in (("version", "trim", "released", *STEADY), ("flight", "list")):
        done = aerodb(workspace, *command, "--units", "furlongs")
        assert (done.returncode, done.stdout) == (3, "")
        assert "choose one of: si, aero, imperial" in done.stderr


def test_an_angle_without_a_unit_is_questioned(workspace: Path) -> None:
    for arguments in (
        ("version", "evaluate", "released", "--at", "alpha=5,V=25"),
        ("version", "trim", "released", *STEADY, "--set", "delta_elevator=5"),
        ("version", "trim", "released", "--speed", "25", "--altitude", "0", "--climb", "-5"),
    ):
        done = aerodb(workspace, *arguments)
        assert done.returncode == 3, arguments
        assert "write 5deg or 5rad" in done.stderr.replace("-5", "5")
        assert "286 deg" in done.stderr
    asked(workspace, "version", "evaluate", "released", "--at", "alpha=5rad,V=25")
    assert value_of("psi", "3.0") == 3.0
    assert value_of("alpha", "-1.5") == -1.5
    assert value_of("q", "5") == 5.0
    assert value_of("alpha", "5", by_program=True) == 5.0


def test_a_point_beyond_the_flown_range_is_told_where_the_change_fades(workspace: Path) -> None:
    import aerodb as library

    catalogue = access_workspace(str(workspace)).catalogue
    version = catalogue.version(NAME, "candidate").id
    database = access_workspace(str(workspace)).database(version)
    inside, beyond = (
        library.evaluate(database, alpha=alpha, V=25.0).report() for alpha in ("3 deg", "40 deg")
    )
    assert "alpha <" not in inside
    assert "beyond the flown range (alpha <" in beyond
    assert "the change fades to nothing at" in beyond


def test_a_height_that_is_not_stated_is_outside_ground_effect(tmp_path: Path) -> None:
    database = read_native(NEAR_GROUND)
    height = height_outside_ground_effect(database)
    assert height == pytest.approx(1.2 * 4.0)
    assert neutral_point(database)["height_above_ground"] == height
    flat = read_native(NEAR_GROUND.replace("ground(height_above_ground/b_ref)", "alpha"))
    assert height_outside_ground_effect(flat) is None

    import aerodb as library

    points = library.evaluate(database)
    assert points["CZ"].tolist() == [-0.5]
    assert points.taken == {"height_above_ground": height}
    assert "outside ground effect" in points.report()
    assert library.evaluate(database, height_above_ground=0.0)["CZ"].tolist() == [-0.7]


def test_a_trim_at_sea_level_is_not_in_ground_effect(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    place, database = tmp_path / "workspace", tmp_path / "low.toml"
    shared.prepared(place)
    table = NEAR_GROUND[NEAR_GROUND.index("[tables.ground]") : NEAR_GROUND.index("[[terms]]")]
    low = DATABASE.replace('"CZ0(alpha)"', '"CZ0(alpha)*ground(height_above_ground/b_ref)"')
    database.write_text(
        low.replace("[[terms]]", table.replace("height_ratio", "ratio") + "[[terms]]")
    )
    done = aerodb(place, "database", "import", str(database), "--vehicle", NAME)
    assert done.returncode == 0, done.stderr
    steady = ("--speed", "25", "--altitude", "0", "--glide")

    def alpha(version: str, *more: str) -> float:
        found = asked(place, "version", "trim", version, *steady, *more)
        return float(found["channels"]["alpha"])

    assert alpha("v0002") == pytest.approx(alpha("released"), abs=1e-9)
    assert alpha("v0002", "--set", "ground_altitude=0") < alpha("released") - 0.01
    said = aerodb(place, "version", "trim", "v0002", *steady).stdout
    assert "ground taken 4.32 m below, outside ground effect" in " ".join(said.split())
    said = aerodb(place, "--units", "aero", "version", "trim", "v0002", *steady).stdout
    assert "ground taken 14.17 ft below" in " ".join(said.split())
