"""Settings of a backup as a restored workspace gets them: without those that run commands, connect
elsewhere or take protection away, until the person who restores them confirms.

A backup may come from a stranger, and the next run of a workspace does what its settings say.
"""

import json
from typing import Any, Final

from aerodb.support import parsed_toml

#: Keys of the settings, and of a vehicle's section, that do so; a value that does not is kept.
_ACTIVE: Final[dict[str, tuple[Any, ...]]] = {
    "notification.command": ([],),
    "notification.webhook": ("",),
    "catalogue.url": ("",),
    "store.url": ("",),
    "serve.host": ("127.0.0.1", "::1", "localhost"),
    "serve.database": ("",),
    "work.engine": ("threads",),
    "work.address": ("",),
    "work.trusted_network": (False,),
    "work.confined": (True,),
}


def quiet(text: str, where: str) -> tuple[str, tuple[str, ...]]:
    """Return the text of settings (TOML) without what has to be confirmed, and what was left out,
    each as ``key = value``; the text as it is where there is nothing.

    Raises InputError for a text that is no TOML. where : the file, for messages.
    """
    data = parsed_toml(text, where)
    left = list(_taken(data, ""))
    vehicles = data.get("vehicles")
    for name, section in (vehicles if isinstance(vehicles, dict) else {}).items():
        left.extend(_taken(section, f"vehicles.{name}."))
    return (_written(data, ""), tuple(left)) if left else (text, ())


def _taken(data: Any, prefix: str) -> list[str]:
    """Take what has to be confirmed out of a table, and return it."""
    left = []
    for key, harmless in _ACTIVE.items():
        section, name = key.split(".")
        table = data.get(section) if isinstance(data, dict) else None
        if isinstance(table, dict) and name in table and table[name] not in harmless:
            left.append(f"{prefix}{key} = {json.dumps(table.pop(name), default=str)}")
    return left


def _written(table: dict[str, Any], name: str) -> str:
    """A table as TOML: its values, then its tables."""
    lines = [f"{_text(key)} = {_value(each)}" for key, each in table.items() if not _is(each)]
    head = f"[{name}]\n" if name and lines else ""
    inner = [
        _written(each, f"{name}.{_text(key)}" if name else _text(key))
        for key, each in table.items()
        if _is(each)
    ]
    return "\n".join([head + "".join(f"{line}\n" for line in lines), *inner])


def _is(value: Any) -> bool:
    return isinstance(value, dict)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{_text(key)} = {_value(each)}' for key, each in value.items())}}}"
    return str(value).lower() if isinstance(value, bool | float) else str(value)


def _text(text: str) -> str:
    """A basic string of TOML, whose escapes are those of JSON; DEL is the one more."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
