"""Workspace settings: ``settings.toml`` in the workspace folder. Unknown keys are errors; without
the file, all settings have their defaults.

What the section of a vehicle leaves out is taken from the sections of the workspace. Secrets do not
belong in the file: write the name of an environment variable that holds the address of a webhook
(``"$NAME"``); the token of the server is read from an environment variable too.
"""

import ipaddress
import re
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self
from urllib.parse import urlsplit
from zoneinfo import ZoneInfo

from pydantic import AfterValidator, BeforeValidator, Field, field_validator, model_validator

from aerodb.errors import InputError, UnknownNameError
from aerodb.quantities import Metres, Number, Radians, Seconds, in_unit
from aerodb.storage.catalogue import SETTINGS_FILE
from aerodb.storage.encoding import VEHICLE_NAME
from aerodb.storage.limits import Limits
from aerodb.storage.urls import checked_url
from aerodb.support import Strict, parsed_toml, validated

FILE: Final = SETTINGS_FILE
#: Environment variable of the token; required when other machines can reach the server.
TOKEN_VARIABLE: Final = "AERODB_TOKEN"
_SHORTEST_TOKEN: Final = 16

_CRON_RANGES: Final = ((0, 59), (0, 23), (1, 31), (1, 12), (0, 7), (0, 59))
_CRON_NAMES: Final = {
    3: ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"),
    4: ("sun", "mon", "tue", "wed", "thu", "fri", "sat"),
}
_CRON_PART: Final = re.compile(r"(?:\*|([0-9]+|[a-z]{3})(?:-([0-9]+|[a-z]{3}))?)(?:/[1-9][0-9]*)?")
_OBJECTS: Final = re.compile(
    r"s3://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](?:/(?!\.{1,2}(?:/|$))[A-Za-z0-9_.-]+)*/?"
)
_YEAR: Final = 366 * 86_400.0
#: A duration [s], bounded so that arithmetic with times cannot overflow.
Duration = Annotated[Seconds, Field(le=_YEAR, allow_inf_nan=False)]

Occasion = Literal["candidate", "refused", "failed"]


def _check_cron(text: str) -> None:
    """Raise ValueError unless the fields are minute, hour, day, month, weekday and, optionally,
    second."""
    fields = text.lower().split()
    if len(fields) not in (5, 6):
        raise ValueError(
            f"cron '{text[:60]}' has {len(fields)} fields, not 5 (or 6, with the seconds last)"
        )
    for place, field in enumerate(fields):
        for part in field.split(","):
            match = _CRON_PART.fullmatch(part)
            if match is None or not all(
                _in_range(place, value) for value in match.groups() if value is not None
            ):
                raise ValueError(
                    f"cron '{text[:60]}': '{part[:20]}' is not allowed as field {place + 1}"
                )


def _in_range(place: int, value: str) -> bool:
    low, high = _CRON_RANGES[place]
    return low <= int(value) <= high if value.isdecimal() else value in _CRON_NAMES.get(place, ())


class SettingsError(InputError):
    """The settings, or a file that they name, cannot be used. Not the fault of any log."""


def unreadable_settings(path: Path, error: Exception, remedy: str) -> SettingsError:
    """The error for the settings file at `path`, which reading or parsing refused with `error`:
    the same words whoever reads it first."""
    why = str(error)
    if isinstance(error, InputError):
        why = error.what
    elif isinstance(error, UnicodeDecodeError):
        why = f"not valid TOML: {error}"
    return SettingsError(f"the settings cannot be read: {why}", str(path), remedy)


#: ``postgresql://...`` without its password, or ``$NAME`` of an environment variable that holds the
#: whole address; empty: a file.
DatabaseUrl = Annotated[str, BeforeValidator(checked_url)]


class CatalogueSettings(Strict):
    """Database of the catalogue: PostgreSQL at `url`; empty: the SQLite file in the workspace. See
    `aerodb.storage.catalogue.location`."""

    url: DatabaseUrl = ""


class StoreSettings(Strict):
    """Location of the stored files: objects below `url` (``s3://bucket/prefix``); empty: the
    workspace folder.

    With an object store, the folder is its cache; `aerodb store trim` and the nightly flow reduce
    it to `cache` bytes (0: no limit). Endpoint and credentials are read from the environment
    variables of AWS only.
    """

    url: str = ""
    cache: int = Field(default=0, ge=0)

    @field_validator("url")
    @classmethod
    def _address(cls, text: str) -> str:
        if text and not _OBJECTS.fullmatch(text):
            raise InputError(
                "not an address of the form s3://BUCKET/PREFIX",
                "",
                "set endpoint and credentials in the environment variables $AWS_... only",
            )
        return text.rstrip("/")


class ServeSettings(Strict):
    """Address of the server: `host` (default: loopback) and `port` (0: any free port).

    database : of Prefect itself; empty: a file in the workspace. ui : whether the server has
    Prefect's pages.
    """

    host: str = "127.0.0.1"
    port: int = Field(default=4200, ge=0, le=65535)
    database: DatabaseUrl = ""
    ui: bool = False

    @property
    def loopback(self) -> bool:
        """Whether only this machine can reach the server."""
        return is_loopback(self.host)


def is_loopback(host: str) -> bool:
    """Return whether `host` is a loopback address (127.0.0.0/8 or ::1; RFC 6890), or localhost; any
    other text gives False, no error."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class WorkSettings(Strict):
    """Executor of the per-flight steps: `threads` of the process of the run, or the workers of a
    Dask cluster whose scheduler listens at `address` (or ``"$NAME"`` of an environment variable
    that holds the address).

    A Dask scheduler authenticates clients only over TLS. Beyond this machine, ``tcp://`` requires
    `trusted_network`. With `confined`, what a step computes from a log runs in a process of its own
    under ``[limits]``; without, in the process of the run, which a hostile log can then take down.
    With `direct`, commands run without Prefect, as with ``--direct``.
    """

    engine: Literal["threads", "dask"] = "threads"
    confined: bool = True
    address: str = ""
    trusted_network: bool = False
    direct: bool = False

    @model_validator(mode="after")
    def _addressed(self) -> Self:
        if self.engine == "dask" and not self.address:
            raise ValueError(
                'dask requires the address of its scheduler: address = "tcp://127.0.0.1:8786"'
            )
        if self.address and not self.address.startswith("$"):
            self.checked(self.address)
        return self

    def checked(self, address: str) -> str:
        """`address` if it is valid and allowed; otherwise ValueError."""
        parts = urlsplit(address)
        if parts.scheme not in ("tcp", "tls") or not parts.hostname or not parts.port:
            raise ValueError(
                "write the address of a scheduler as tcp://HOST:PORT, tls://HOST:PORT, or $NAME"
            )
        if parts.scheme == "tcp" and not is_loopback(parts.hostname) and not self.trusted_network:
            why = "anyone who reaches a scheduler over tcp:// can run any code on its workers"
            raise ValueError(f"{why}: use tls://, or set trusted_network = true")
        return address


class InboxSettings(Strict):
    """When a file counts as completely copied (size and times unchanged for `settle` [s]), and how
    many times its ingestion is attempted."""

    settle: Duration = 10.0
    attempts: int = Field(default=3, ge=1)


class Schedule(Strict):
    """Schedule of the nightly flow: `cron` (five fields, or six with the seconds last) in
    `timezone`, or a period `every` [s]."""

    cron: str = ""
    every: Duration | None = None
    timezone: str = "UTC"

    @model_validator(mode="after")
    def _one(self) -> Self:
        if bool(self.cron) == (self.every is not None):
            raise ValueError("give either cron or every")
        if self.every is not None and self.every < 1.0:
            raise ValueError("every must be at least 1 s")
        if self.cron:
            _check_cron(self.cron)
        return self

    @field_validator("timezone")
    @classmethod
    def _known(cls, name: str) -> str:
        try:
            ZoneInfo(name)
        except (KeyError, ValueError, OSError) as error:
            raise ValueError(f"unknown time zone '{name[:60]}'") from error
        return name


class Notification(Strict):
    """Receivers of notifications, and the occasions: a `webhook` gets a JSON document by POST, a
    `command` the same document on standard input."""

    webhook: str = ""
    command: tuple[str, ...] = ()
    on: tuple[Occasion, ...] = ("candidate", "refused", "failed")

    @field_validator("webhook")
    @classmethod
    def _address(cls, text: str) -> str:
        if text and not text.startswith(("https://", "http://", "$")):
            raise ValueError(
                "a webhook is an http(s) address, or $NAME of an environment variable that"
                " holds the address"
            )
        return text


class LoopSettings(Strict):
    """When and how the database of a vehicle is updated automatically.

    after : number of new flights since the last update that triggers one. newest : maximum number
    of flights used, the newest ones. run : ``close-loop``, ``update``, both or neither. model :
    model file of the update, relative to the workspace.
    """

    after: int = Field(default=5, ge=1)
    newest: int = Field(default=100, ge=2)
    run: tuple[Literal["close-loop", "update"], ...] = ("close-loop",)
    model: str = ""

    @model_validator(mode="after")
    def _modelled(self) -> Self:
        if "update" in self.run and not self.model:
            raise ValueError('an update requires a model file: model = "increments.toml"')
        if Path(self.model).is_absolute() or ".." in Path(self.model).parts:
            raise ValueError("model must be a file inside the workspace")
        return self


def _inside_the_workspace(file: str) -> str:
    if Path(file).is_absolute() or ".." in Path(file).parts:
        raise ValueError("must be a file inside the workspace")
    return file


class GateSettings(Strict):
    """Additional conditions of the gate: minimum number of flights that identified a version, and
    of flights that validated it (`held_out`); greatest relative change of a main derivative inside
    the data that a person need not accept (`largest_change`); whether the responses on the held-out
    flights must be within tolerance (`responses`), with the file `tolerances` of the workspace in
    place of those of aerodb."""

    identified: int = Field(default=0, ge=0)
    held_out: int = Field(default=0, ge=0)
    largest_change: float = Field(default=0.5, gt=0.0)
    responses: bool = False
    tolerances: Annotated[str, AfterValidator(_inside_the_workspace)] | None = None


class AccuracySettings(Strict):
    """Limits of the consistency verdict that replace those of the vehicle file; see
    `aerodb.vehicle.Accuracy`."""

    attitude: Radians | None = None
    flow_angle: Radians | None = None
    horizontal_velocity: Annotated[float, in_unit("m/s")] | None = None
    climb_rate: Annotated[float, in_unit("m/s")] | None = None
    lateral_position: Metres | None = None
    altitude: Metres | None = None
    qbar_fraction: Number | None = None

    @property
    def given(self) -> dict[str, float]:
        """Return the limits that are set, in SI units, by field of `Accuracy`."""
        return self.model_dump(exclude_none=True)


class VehicleSettings(Strict):
    """Settings of one vehicle; None: as for the workspace."""

    mapping: str | None = None
    strict: bool = False
    schedule: Schedule | None = None
    loop: LoopSettings | None = None
    notification: Notification | None = None
    gate: GateSettings = GateSettings()
    accuracy: AccuracySettings = AccuracySettings()


class ShowSettings(Strict):
    """Units in which people are shown quantities (`aerodb.units.UnitSystem`), where they have not
    chosen others by ``--units`` or ``$AERODB_UNITS``."""

    units: Literal["si", "aero", "imperial"] = "si"


class Settings(Strict):
    """The settings of a workspace."""

    serve: ServeSettings = ServeSettings()
    catalogue: CatalogueSettings = CatalogueSettings()
    store: StoreSettings = StoreSettings()
    work: WorkSettings = WorkSettings()
    inbox: InboxSettings = InboxSettings()
    nightly: Schedule = Schedule(cron="0 2 * * *")
    loop: LoopSettings = LoopSettings()
    notification: Notification = Notification()
    limits: Limits = Limits()
    show: ShowSettings = ShowSettings()
    vehicles: dict[str, VehicleSettings] = {}

    @field_validator("limits")
    @classmethod
    def _within_a_year(cls, limits: Limits) -> Limits:
        for name in ("processor", "wall", "step", "run"):
            if not getattr(limits, name) <= _YEAR:
                raise ValueError(f"{name} must be at most {_YEAR:.0f} s, a year")
        return limits

    @field_validator("vehicles")
    @classmethod
    def _names(cls, vehicles: dict[str, VehicleSettings]) -> dict[str, VehicleSettings]:
        for name in vehicles:
            if not VEHICLE_NAME.fullmatch(name):
                raise ValueError(f"'{name[:60]}' is not allowed as the name of a vehicle")
        return vehicles

    def of(self, vehicle: str) -> VehicleSettings:
        """The section of a vehicle; defaults when there is none."""
        return self.vehicles.get(vehicle, VehicleSettings())

    def loop_of(self, vehicle: str) -> LoopSettings:
        """The automatic update of a vehicle."""
        return self.of(vehicle).loop or self.loop

    def notification_of(self, vehicle: str) -> Notification:
        """The notification settings of a vehicle; empty name: of the workspace."""
        return self.of(vehicle).notification or self.notification


def load_settings(root: Path, vehicles: tuple[str, ...] | None = None) -> Settings:
    """The settings of the workspace folder `root`; defaults when there is no file.

    vehicles : known vehicles; a section of another vehicle is an error. Raises SettingsError that
    names the key, the reason and the nearest known key, and UnknownNameError for an unknown
    vehicle.
    """
    path = root / FILE
    try:
        data: Any = parsed_toml(path.read_text(encoding="utf-8"), str(path))
    except FileNotFoundError:
        return Settings()
    except (OSError, UnicodeDecodeError, InputError) as error:
        raise unreadable_settings(
            path, error, "correct it, or move it away to use the defaults"
        ) from error
    try:
        settings = validated(Settings, data, str(path))
    except InputError as error:
        raise SettingsError(error.what, error.where, error.remedy) from error
    for name in settings.vehicles:
        if vehicles is not None and name not in vehicles:
            known = ", ".join(vehicles[:12]) or "none yet"
            raise UnknownNameError(
                f"vehicles.{name}: unknown vehicle", str(path), f"known vehicles: {known}"
            )
    return settings


def checked_token(serve: ServeSettings, environment: dict[str, str]) -> str:
    """Return the token that clients of the server must present; empty for none. InputError when a
    token is required and missing, or has fewer than `_SHORTEST_TOKEN` characters."""
    token = environment.get(TOKEN_VARIABLE, "")
    if token and len(token) < _SHORTEST_TOKEN:
        raise InputError(
            f"the token has fewer than {_SHORTEST_TOKEN} characters",
            f"${TOKEN_VARIABLE}",
            "use a longer one",
        )
    if not serve.loopback and not token:
        what = (
            f"the server would listen on {serve.host}, where other machines can reach it, without"
            " a token"
        )
        raise InputError(
            what,
            f"{FILE}: serve.host",
            f"set ${TOKEN_VARIABLE}, or remove serve.host to use 127.0.0.1",
        )
    return token


def authorization(token: str) -> str:
    """Return name and password with which a client presents the token (HTTP basic authentication,
    RFC 7617), as `checked_token` gives it; it raises no error for an empty one."""
    return f"aerodb:{token}"
