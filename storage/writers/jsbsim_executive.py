"""JSBSim as the receiver of an export: an aircraft file, given as bytes, loaded and ready to run.

JSBSim is an optional extra (``pip install 'aerodb[jsbsim]'``); what is compared with it belongs in
`aerodb.exchange`.
"""

import importlib.util
import tempfile
from pathlib import Path
from typing import Any

from aerodb.errors import InputError

_NAME = "exported"


def jsbsim_is_installed() -> bool:
    """Whether exports can be checked inside JSBSim here."""
    return importlib.util.find_spec("jsbsim") is not None


def loaded_in_jsbsim(xml: bytes) -> Any:
    """JSBSim's FGFDMExec with the aircraft of `xml` loaded; it prints nothing.

    Raises InputError with JSBSim's own words when it cannot load the file, and when JSBSim is not
    installed.
    """
    if not jsbsim_is_installed():
        raise InputError(
            "JSBSim is not installed", "check of an export", "pip install 'aerodb[jsbsim]'"
        )
    import jsbsim

    class Collector(jsbsim.FGLogger):
        """Keeps what JSBSim says, which would otherwise go to standard output."""

        said = ""

        def set_level(self, level: Any) -> None: ...
        def file_location(self, filename: str, line: int) -> None: ...
        def format(self, format: Any) -> None: ...
        def flush(self) -> None: ...
        def message(self, message: str) -> None:
            self.said += message

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
                collector.said, loaded = str(error), False
        if not loaded:
            said = " ".join(collector.said.split())[-300:]
            raise InputError(f"JSBSim does not load the file: {said}", "check of an export")
        executive.set_debug_level(0)
        return executive
    finally:
        jsbsim.set_logger(before)
