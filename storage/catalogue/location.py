"""Where the catalogue of a workspace is: the SQLite file in its folder, or the PostgreSQL database
that its settings name.

Decided here and nowhere else. Everybody names the catalogue by the path of the file,
`Workspace.catalogue`; the settings stand beside it. Only the section ``[catalogue]`` is read: what
is wrong in another one keeps nobody from the catalogue.
"""

import tomllib
from collections.abc import Hashable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from aerodb.errors import InputError

_SETTINGS: Final = "settings.toml"
#: A folder of every workspace, and of no backup, which has the settings too.
_OF_WORKSPACES: Final = "locks"


@dataclass(frozen=True)
class CatalogueLocation:
    """The file at `path`, unless there is a `url` of a PostgreSQL database (with its password:
    never shown)."""

    path: Path
    url: str = field(default="", repr=False)

    @property
    def begun(self) -> bool:
        """Whether a workspace stands around it: a catalogue in a file, or settings that name a
        database."""
        return self.path.is_file() if not self.url else (self.path.parent / _OF_WORKSPACES).is_dir()

    @property
    def identity(self) -> Hashable:
        """Another database that comes to stand at this place has another one."""
        return self.url or self.path.stat().st_ino


def catalogue_location(path: Path) -> CatalogueLocation:
    """Where the catalogue is whose file is, or would be, at `path`.

    Raises SettingsError for settings that cannot be read while there is no such file, and for an
    address that cannot be used; InputError when there are both, a file and an address.
    """
    settings = path.parent / _SETTINGS
    try:
        text = settings.read_text(encoding="utf-8")
    except FileNotFoundError:
        return CatalogueLocation(path)
    except (OSError, UnicodeDecodeError) as error:
        return _file_or_nothing(path, settings, error)
    try:
        section = tomllib.loads(text).get("catalogue", {})
    except tomllib.TOMLDecodeError as error:
        return _file_or_nothing(path, settings, error)
    url = _url(section, settings) if section else ""
    if url and path.is_file():
        remedy = (
            "a catalogue moves by `aerodb backup` and `aerodb restore --settings`; move the file"
            " away if it was moved, or take the section [catalogue] out"
        )
        raise InputError("here is a catalogue, and the settings name another", str(path), remedy)
    return CatalogueLocation(path, url)


def _file_or_nothing(path: Path, settings: Path, error: Exception) -> CatalogueLocation:
    """With a catalogue in a file nothing else can be meant; without one nobody knows."""
    if path.is_file():
        return CatalogueLocation(path)
    from aerodb.storage.workspace_settings import SettingsError

    raise SettingsError(
        f"cannot be read: {error}", str(settings), "mend it: it may say where the catalogue is"
    ) from error


def _url(section: object, settings: Path) -> str:
    # Imported here: most workspaces have no such section, and their queries need not wait for the
    # rest of the settings.
    from aerodb.storage.urls import resolved
    from aerodb.storage.workspace_settings import CatalogueSettings, SettingsError
    from aerodb.support import validated

    where = f"{settings}: catalogue.url"
    try:
        return resolved(validated(CatalogueSettings, section, where).url, where)
    except InputError as error:
        raise SettingsError(error.what, error.where, error.remedy) from error
