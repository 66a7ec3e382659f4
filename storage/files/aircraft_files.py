"""The files that a JSBSim aircraft names for its parts, read from its own folder and nowhere
else."""

from collections.abc import Callable
from pathlib import Path

from aerodb.errors import InputError

MAX_BYTES = 20_000_000


def files_beside(aircraft: Path) -> Callable[[str], bytes]:
    """Gives the bytes of a file named relative to the folder of `aircraft`, with or without its
    ``.xml``, as JSBSim finds it.

    Raises InputError for a file that is not there, is too large, or lies outside the folder
    (through ``..`` or a link).
    """
    folder = aircraft.resolve().parent

    def load(name: str) -> bytes:
        for path in ((folder / name).resolve(), (folder / f"{name}.xml").resolve()):
            if path.is_file():
                if not path.is_relative_to(folder):
                    raise InputError(f"'{name}' lies outside the aircraft's folder", str(aircraft))
                if path.stat().st_size > MAX_BYTES:
                    raise InputError(
                        f"'{name}' has {path.stat().st_size} bytes",
                        str(aircraft),
                        f"at most {MAX_BYTES}",
                    )
                return path.read_bytes()
        raise InputError(f"no file '{name}'", str(aircraft), "put it beside the aircraft file")

    return load
