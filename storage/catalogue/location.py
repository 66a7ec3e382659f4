"""Location of the catalogue of a workspace: the SQLite file in its folder, or the PostgreSQL
database that its settings name.

This is the only place that decides. Callers refer to the catalogue by the path of the file,
`Workspace.catalogue`; the settings are in the same folder. Only the section ``[catalogue]`` is
read, so errors in other sections do not block access to the catalogue.
"""

from collections.abc import Hashable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from aerodb.errors import InputError

#: Settings of a workspace, in its folder.
SETTINGS_FILE: Final = "settings.toml"
#: A folder that every workspace has; backups, which also contain settings, do not.
_OF_WORKSPACES: Final = "locks"


@dataclass(frozen=True)
class CatalogueLocation:
    """The SQLite file at `path`, or the PostgreSQL database at `url` if that is not empty (it may
    contain the password and is never shown)."""

    path: Path
    url: str = field(default="", repr=False)

    @property
    def begun(self) -> bool:
        """Whether a workspace exists: the SQLite file, or settings that name a database."""
        return self.path.is_file() if not self.url else (self.path.parent / _OF_WORKSPACES).is_dir()

    @property
    def identity(self) -> Hashable:
        """Identity of the database: it differs if another database replaces this one."""
        return self.url or self.path.stat().st_ino


def catalogue_location(path: Path) -> CatalogueLocation:
    """Location of the catalogue whose SQLite file is, or would be, at `path`.

    Raises SettingsError when the settings cannot be read and there is no such file, and for an
    invalid address; InputError when there are both a file and an address.
    """
    settings = path.parent / SETTINGS_FILE
    try:
        text = settings.read_text(encoding="utf-8")
    except FileNotFoundError:
        return CatalogueLocation(path)
    except (OSError, UnicodeDecodeError) as error:
        return _file_or_nothing(path, settings, error)
    from aerodb.support import parsed_toml  # as below

    try:
        section = parsed_toml(text, str(settings)).get("catalogue", {})
    except InputError as error:
        return _file_or_nothing(path, settings, error)
    url = _url(section, settings) if section else ""
    if url and path.is_file():
        remedy = (
            "to move a catalogue, use `aerodb backup` and `aerodb restore --settings`; if it was"
            " moved already, move this file away; otherwise remove the section [catalogue]"
        )
        raise InputError(
            "there is a catalogue in this file, and the settings name another one",
            str(path),
            remedy,
        )
    return CatalogueLocation(path, url)


def _file_or_nothing(path: Path, settings: Path, error: Exception) -> CatalogueLocation:
    """Without readable settings, an existing file is the catalogue; otherwise it is unknown."""
    if path.is_file():
        return CatalogueLocation(path)
    from aerodb.storage.workspace_settings import unreadable_settings

    raise unreadable_settings(
        settings, error, "correct them: they may name the database of the catalogue"
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
