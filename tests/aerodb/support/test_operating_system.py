"""On systems that are not Linux the program says so in words: command line and library."""

import sys

import pytest

import aerodb
from aerodb.errors import AeroError
from aerodb.flows.cli.main import main
from aerodb.support.operating_system import UNTESTED, require_supported_system


def test_linux_is_supported() -> None:
    require_supported_system()


def test_windows_is_refused_and_wsl_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setenv(UNTESTED, "1")
    monkeypatch.setattr(sys, "argv", ["aerodb", "version", "list"])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 1
    first, second = capsys.readouterr().err.splitlines()
    assert first == "aerodb: this system: aerodb does not run on Windows itself"
    assert "WSL 2" in second


def test_macos_is_refused_until_somebody_tries_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.delenv(UNTESTED, raising=False)
    monkeypatch.delitem(vars(aerodb), "evaluate", raising=False)  # another test may have loaded it
    with pytest.raises(AeroError, match=rf"never tested on darwin(?s:.)*{UNTESTED}=1"):
        _ = aerodb.evaluate
    monkeypatch.setenv(UNTESTED, "1")
    assert callable(aerodb.evaluate)
