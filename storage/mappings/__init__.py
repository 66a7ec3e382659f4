"""Log layouts as data: one TOML file per format and firmware; users add their own files of the same
form."""

from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from aerodb.errors import InputError, nearest
from aerodb.logs import Mapping, parse_mapping


@lru_cache(maxsize=1)
def _built_in() -> dict[str, Mapping]:
    found = [entry for entry in files(__name__).iterdir() if entry.name.endswith(".toml")]
    parsed = [parse_mapping(entry.read_text(encoding="utf-8"), entry.name) for entry in found]
    return {mapping.name: mapping for mapping in sorted(parsed, key=lambda mapping: mapping.name)}


def builtin_mappings() -> dict[str, Mapping]:
    """The mappings that come with the product, by name."""
    return dict(_built_in())


def load_mapping(name_or_path: str | Path) -> Mapping:
    """A built-in mapping by name, or one from a TOML file; InputError names the nearest built-in
    one."""
    built_in = _built_in()
    if str(name_or_path) in built_in:
        return built_in[str(name_or_path)]
    path = Path(name_or_path)
    if path.suffix != ".toml":
        raise InputError(
            f"no mapping '{name_or_path}'",
            remedy=nearest(str(name_or_path), built_in) + ", or give a .toml file",
        )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"mapping file cannot be read: {error}", str(path)) from error
    return parse_mapping(text, str(path))
