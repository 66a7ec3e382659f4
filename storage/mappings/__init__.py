"""Built-in mapping files: one TOML file per log format and firmware that assigns log fields to
channels. Users add their own files of the same form.

`builtin_mappings` gives all of them by name, `load_mapping` one by name or from a file.
"""

from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from aerodb.errors import InputError, nearest
from aerodb.logs import Mapping, parse_mapping


@lru_cache(maxsize=1)
def _built_in() -> dict[str, Mapping]:
    entries = [entry for entry in files(__name__).iterdir() if entry.name.endswith(".toml")]
    parsed = [parse_mapping(entry.read_text(encoding="utf-8"), entry.name) for entry in entries]
    return {mapping.name: mapping for mapping in sorted(parsed, key=lambda mapping: mapping.name)}


def builtin_mappings() -> dict[str, Mapping]:
    """The built-in mappings, by name."""
    return dict(_built_in())


def load_mapping(name_or_path: str | Path) -> Mapping:
    """Return a built-in mapping by name, or a mapping from a TOML file (`parse_mapping`);
    InputError suggests the nearest built-in name."""
    built_in = _built_in()
    if str(name_or_path) in built_in:
        return built_in[str(name_or_path)]
    path = Path(name_or_path)
    if path.suffix != ".toml":
        raise InputError(
            f"unknown mapping '{name_or_path}'",
            remedy=nearest(str(name_or_path), built_in) + ", or name a .toml file",
        )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"the mapping file cannot be read: {error}", str(path)) from error
    return parse_mapping(text, str(path))
