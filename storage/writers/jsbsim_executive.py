"""Exported aircraft files loaded in JSBSim, ready to run.

JSBSim is an optional extra (``pip install 'aerodb[jsbsim]'``); the comparisons with it are in
`aerodb.exchange`.
"""

import importlib.util
import tempfile
from pathlib import Path
from typing import Any

from aerodb.errors import InputError

_NAME = "exported"


def jsbsim_is_installed() -> bool:
    """Return whether JSBSim is installed, so that exports can be checked in it."""
    return importlib.util.find_spec("jsbsim") is not None


def loaded_in_jsbsim(xml: bytes) -> Any:
    """JSBSim's FGFDMExec with the aircraft of `xml` loaded, without console output.

    Raises InputError with JSBSim's own message when it cannot load the file, and when JSBSim is not
    installed.
    """
    if not jsbsim_is_installed():
        raise InputError(
            "JSBSim is not installed", "check of an export", "pip install 'aerodb[jsbsim]'"
        )
    import jsbsim

    class Collector(jsbsim.FGLogger):
        """Collects JSBSim's messages, which would otherwise go to standard output."""

        messages = ""

        def set_level(self, level: Any) -> None: ...
        def file_location(self, filename: str, line: int) -> None: ...
        def format(self, format: Any) -> None: ...
        def flush(self) -> None: ...
        def message(self, message: str) -> None:
            self.messages += message

    before, collector = jsbsim.get_logger(), Collector()
    jsbsim.set_logger(collector)
    try:
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / "aircraft" / _NAME
            place.mkdir(parents=True)
            (place / f"{_NAME}.xml").write_bytes(xml)
            executive = jsbsim.FGFDMExec(folder)
            try:
                loaded = bool(executive.load_model(_NAME))
            except (
                Exception
            ) as error:  # JSBSim raises types of its own, derived from RuntimeError or not
                collector.messages, loaded = str(error), False
        if not loaded:
            messages = " ".join(collector.messages.split())[-300:]
            raise InputError(f"JSBSim cannot load the file: {messages}", "check of an export")
        executive.set_debug_level(0)
        return executive
    finally:
        jsbsim.set_logger(before)
