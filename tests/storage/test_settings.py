"""Settings of a workspace: what the file may contain, and the messages for what it may not."""

from pathlib import Path

import pytest

from aerodb.errors import InputError, UnknownNameError
from aerodb.storage.workspace_settings import (
    AccuracySettings,
    Schedule,
    Settings,
    checked_token,
    load_settings,
)
from aerodb.vehicle import Accuracy

FULL = """\
[serve]
port = 0
[inbox]
settle = "2 min"
[nightly]
cron = "30 1 * * mon-fri"
timezone = "Europe/Berlin"
[loop]
after = 8
[notification]
webhook = "$HOOK"
[vehicles.glider]
mapping = "px4"
[vehicles.glider.schedule]
every = "1 h"
[vehicles.glider.loop]
run = ["update"]
model = "increments.toml"
[vehicles.glider.notification]
command = ["logger", "-t", "aerodb"]
on = ["candidate"]
[vehicles.glider.gate]
held_out = 2
[vehicles.glider.accuracy]
attitude = "0.5 deg"
climb_rate = "100 ft/min"
altitude = 20.0
"""


def _load(folder: Path, text: str, vehicles: tuple[str, ...] | None = None) -> Settings:
    (folder / "settings.toml").write_text(text, encoding="utf-8")
    return load_settings(folder, vehicles)


def test_what_a_vehicle_leaves_out_is_the_workspaces(tmp_path: Path) -> None:
    settings = _load(tmp_path, FULL, ("glider", "other"))
    assert (settings.inbox.settle, settings.nightly.timezone) == (120.0, "Europe/Berlin")
    assert settings.loop_of("glider").run == ("update",)
    assert (settings.loop_of("other").run, settings.loop_of("other").after) == (("close-loop",), 8)
    assert settings.notification_of("glider").on == ("candidate",)
    assert settings.notification_of("other").webhook == "$HOOK"
    assert settings.of("glider").accuracy.given == pytest.approx(
        {"attitude": 0.00872664626, "climb_rate": 0.508, "altitude": 20.0}
    )
    assert settings.of("glider").accuracy.given.keys() <= Accuracy.model_fields.keys()
    assert AccuracySettings.model_fields.keys() == Accuracy.model_fields.keys()
    assert settings.of("other").accuracy.given == {}


def test_without_a_file_everything_has_its_default(tmp_path: Path) -> None:
    settings = load_settings(tmp_path)
    assert settings == Settings()
    assert settings.serve.loopback
    assert settings.nightly.cron == "0 2 * * *"


@pytest.mark.parametrize(
    ("text", "what", "remedy"),
    [
        ("[inbox]\nsetle = 3", "unknown key 'inbox.setle'", "did you mean 'settle'?"),
        (
            "[vehicles.g.gate]\nheldout = 3",
            "unknown key 'vehicles.g.gate.heldout'",
            "did you mean 'held_out'?",
        ),
        (
            "[inbox]\nsettle = -3",
            "inbox.settle: Input should be greater than or equal to 0",
            "got -3",
        ),
        ("[nightly]\ncron = '61 2 * * *'", "cron '61 2 * * *': '61' is not allowed as field 1", ""),
        ("[nightly]\ncron = '*-5 2 * * *'", "'*-5' is not allowed as field 1", ""),
        ("[nightly]\nevery = inf", "nightly.every", "got inf"),
        ("[nightly]\nevery = '400 d'", "nightly.every", ""),
        ("[inbox]\nsettle = nan", "inbox.settle", "got nan"),
        ("[limits]\nstep = inf", "limits: step must be at most 31622400 s, a year", ""),
        ("[limits]\nwall = 1e12", "limits: wall must be at most", ""),
        ("[nightly]\ncron = '0 2 * *'", "has 4 fields, not 5", ""),
        ("[nightly]\ncron = '0 2 * * *; rm -rf /'", "fields, not 5", ""),
        ("[nightly]\ncron = '0 2 * * *'\nevery = 5", "give either cron or every", ""),
        (
            "[nightly]\ncron = '0 2 * * *'\ntimezone = 'Mars/Base'",
            "unknown time zone 'Mars/Base'",
            "",
        ),
        ("[loop]\nrun = ['update']", "an update requires a model file", ""),
        ("[loop]\nmodel = '../../etc/passwd'", "model must be a file inside the workspace", ""),
        ("[notification]\nwebhook = 'file:///etc/passwd'", "a webhook is an http(s) address", ""),
        ("[notification]\non = ['everything']", "notification.on", ""),
        ("[vehicles.'../x']", "is not allowed as the name of a vehicle", ""),
        ("[serve]\nport = 70000", "serve.port", ""),
        ("[serve", "not valid TOML", "correct it"),
    ],
)
def test_what_may_not_stand_there_is_said_with_its_place(
    tmp_path: Path, text: str, what: str, remedy: str
) -> None:
    with pytest.raises(InputError) as caught:
        _load(tmp_path, text)
    assert what in caught.value.what
    assert remedy in caught.value.remedy
    assert caught.value.where == str(tmp_path / "settings.toml")


def test_a_section_of_no_vehicle_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="known vehicles: glider"):
        _load(tmp_path, "[vehicles.gilder]\nstrict = true\n", ("glider",))


@pytest.mark.parametrize(
    "cron", ["*/5 * * * *", "0 2 1,15 jan-mar sun", "0-59/2 0 * * 7", "* * * * * */5"]
)
def test_schedules_that_are_ones(cron: str) -> None:
    assert Schedule(cron=cron).cron == cron


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "example.org"])
def test_whoever_can_be_reached_needs_a_token(tmp_path: Path, host: str) -> None:
    serve = _load(tmp_path, f"[serve]\nhost = '{host}'\n").serve
    with pytest.raises(InputError, match="without a token"):
        checked_token(serve, {})
    with pytest.raises(InputError, match="fewer than 16 characters"):
        checked_token(serve, {"AERODB_TOKEN": "short"})
    assert checked_token(serve, {"AERODB_TOKEN": "0123456789abcdef"}) == "0123456789abcdef"
    for own in ("127.0.0.1", "::1", "localhost"):
        assert checked_token(_load(tmp_path, f"[serve]\nhost = '{own}'\n").serve, {}) == ""
