"""Files that a JSBSim aircraft file refers to, read only from the folder of the aircraft."""

from collections.abc import Callable
from pathlib import Path

from aerodb.errors import InputError

MAX_BYTES = 20_000_000


def files_beside(aircraft: Path) -> Callable[[str], bytes]:
    """Function that returns the bytes of a file named relative to the folder of `aircraft`, with or
    without its suffix ``.xml``, as JSBSim finds it. FlightGear's aircraft may keep their flight
    dynamics in a subfolder and name files from the folder above it.

    The function raises InputError for a file that does not exist, is too large, or is outside the
    folder (through ``..`` or a link).
    """
    folder = aircraft.resolve().parent

    def load(name: str) -> bytes:
        names = [name, name.removeprefix(f"{folder.name}/")]
        for path in ((folder / f"{each}{end}").resolve() for each in names for end in ("", ".xml")):
            if path.is_file():
                if not path.is_relative_to(folder):
                    raise InputError(
                        f"'{name}' is outside the folder of the aircraft", str(aircraft)
                    )
                if path.stat().st_size > MAX_BYTES:
                    raise InputError(
                        f"'{name}' has {path.stat().st_size} bytes",
                        str(aircraft),
                        f"at most {MAX_BYTES} bytes are allowed",
                    )
                return path.read_bytes()
        raise InputError(
            f"file '{name}' does not exist", str(aircraft), "put it into the folder of the aircraft"
        )

    return load
