"""An import that was wrong can be undone: by the right file, with a reason, as a logged event."""

from pathlib import Path

import pytest

from tests.support.command import aerodb, asked
from tests.support.daveml_samples import small
from tests.support.small_glider import DATABASE, NAME, VEHICLE

OUTPUT = "<apply><times/><cn>-0.5</cn><ci>ALP</ci></apply>"
SHOT = """<checkData><staticShot name="one"><checkInputs>
<signal><signalName>angleOfAttack</signalName><signalUnits>deg</signalUnits><signalValue>5</signalValue></signal>
</checkInputs><checkOutputs>
<signal><signalName>aeroBodyMomentCoefficient_Pitch</signalName><signalUnits>nd</signalUnits><signalValue>{}</signalValue></signal>
</checkOutputs></staticShot></checkData>"""


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    (tmp_path / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    (tmp_path / "wrong.toml").write_text(DATABASE.replace("5", "6", 1), encoding="utf-8")
    (tmp_path / "right.toml").write_text(DATABASE, encoding="utf-8")
    (tmp_path / "failing.dml").write_bytes(small(SHOT.format("-2.4"), OUTPUT))
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    return tmp_path / "w"


def imported(workspace: Path, file: str, *words: str) -> dict:
    path = str(workspace.parent / file)
    return asked(workspace, "database", "import", path, "--vehicle", NAME, *words)


def test_a_wrong_first_import_is_replaced_with_a_reason_and_can_come_back(workspace: Path) -> None:
    assert imported(workspace, "wrong.toml")["released"]
    second = imported(workspace, "right.toml", "--replace", "--reason", "typing error")
    assert (second["released"], second["replaced"]) == (True, "v0001")
    moves = asked(workspace, "version", "history", "--name", "released")
    assert [move["reason"] for move in moves][1:] == ["typing error"]
    back = asked(workspace, "version", "rollback", "--vehicle", NAME, "--reason", "it was right")
    assert back["label"] == "v0001"
    again = asked(workspace, "version", "promote", "v0002", "--reason", "no")
    assert again["label"] == "v0002"


def test_replacing_needs_a_reason(workspace: Path) -> None:
    imported(workspace, "wrong.toml")
    words = ("database", "import", str(workspace.parent / "right.toml"), "--vehicle", NAME)
    done = aerodb(workspace, *words, "--replace")
    assert (done.returncode, "--reason" in done.stderr) == (3, True)
    assert asked(workspace, "version", "show", "released")["label"] == "v0001"


def test_a_file_that_fails_its_own_cases_is_stored_and_not_released(workspace: Path) -> None:
    document = imported(workspace, "failing.dml")
    assert (document["released"], document["file_checks"]["failed"]) == (False, 1)
    shown = asked(workspace, "version", "show", "v0001")
    assert shown["report"]["file_checks"]["failures"] == document["file_checks"]["failures"]
    assert "WARNING" in aerodb(workspace, "version", "show", "v0001").stdout
    refused = aerodb(workspace, "version", "promote", "v0001", "--reason", "it is right")
    assert (refused.returncode, "--accept file_checks" in refused.stderr) == (4, True)
    words = ("--accept", "file_checks", "--reason", "the case is wrong")
    assert asked(workspace, "version", "promote", "v0001", *words)["moved"]
