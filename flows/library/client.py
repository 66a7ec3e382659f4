"""A client of the console's API (``aerodb web``): the documents of the commands, from anywhere."""

import json
import struct
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final, Self
from urllib.parse import quote

import httpx
import numpy as np

from aerodb.errors import (
    AeroError,
    GateRefusal,
    InputError,
    StoreBusyError,
    StoreError,
    UnknownNameError,
)
from aerodb.flows.library.documents import Document, of_finding, of_flight
from aerodb.nomenclature import CHANNELS, channel, is_surface

if TYPE_CHECKING:
    import pandas as pd

#: Status of a refusal -> its error here, as the console turned it into the status.
_ERRORS: Final[Mapping[int, type[AeroError]]] = {
    404: UnknownNameError,
    422: InputError,
    503: StoreBusyError,
}
_CSRF: Final = "x-csrf-token"


class Client:
    """A console at an address, asked with a token.

    Answers are the documents of the commands (docs/reference/contract.md); a refusal is raised as
    the error that the command would have: UnknownNameError, InputError, GateRefusal,
    StoreBusyError. A console that does not answer is a StoreError.

    Parameters
    ----------
    url : address of the console, such as ``http://127.0.0.1:8050``.
    token : of the console, or of a user of its workspace (``aerodb user add``).
    timeout : longest wait for an answer [s].
    verify : False to accept a certificate that nobody signed.

    Use it in a ``with`` statement, or call `close`.
    """

    def __init__(self, url: str, token: str, *, timeout: float = 60.0, verify: bool = True) -> None:
        self.url = url.rstrip("/")
        headers = {"authorization": f"Bearer {token}"}
        self._http = httpx.Client(
            base_url=self.url, headers=headers, timeout=timeout, verify=verify
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def __repr__(self) -> str:
        return f"<console at {self.url}>"

    def get(self, path: str, **asked: Any) -> Any:
        """Return the document at a path of the API, such as ``/api/status``.

        asked : parameters of the query; those that are None are left out. Documents:
        docs/reference/contract.md, section "JSON". Raises UnknownNameError, InputError, GateRefusal
        or StoreError as the class says.
        """
        return self._ask("GET", path, asked).json()

    def pages(self, path: str, **asked: Any) -> Iterator[dict[str, Any]]:
        """Yield the entries of a list of the API, over all its pages (``Link`` of RFC 8288); raises
        what `get` raises."""
        answer = self._ask("GET", path, asked)
        while True:
            yield from answer.json()
            following = answer.links.get("next", {}).get("url")
            if following is None:
                return
            answer = self._ask("GET", following, {})

    def vehicles(self) -> list[dict[str, Any]]:
        """Return the vehicles, each with the versions that its names point at; raises what `get`
        raises."""
        return list(self.get("/api/vehicles"))

    def flights(
        self, vehicle: str | None = None, verdict: str | None = None, text: str = ""
    ) -> Iterator[dict[str, Any]]:
        """Yield the flights, newest first: of a vehicle, of a verdict, or with a text.
        UnknownNameError for an unknown vehicle; durations are in [s]."""
        return self.pages("/api/flights", vehicle=vehicle, verdict=verdict, text=text)

    def flight(self, flight: str, vehicle: str | None = None) -> Document:
        """Return the document of a flight (name, or the beginning of its id): times [s], figures in
        SI units; ``print`` says its verdict. UnknownNameError where there is none."""
        return of_flight(self.get(f"/api/flights/{_part(flight)}", vehicle=vehicle))

    def channels(
        self,
        flight: str,
        names: list[str] | None = None,
        start: float | None = None,
        end: float | None = None,
        points: int = 2000,
    ) -> "dict[tuple[str, str], pd.Series[float]]":
        """Return channels of a flight, decimated with their extremes kept.

        Parameters
        ----------
        names : channels and axes; None for those that its page shows first.
        start, end : of the window [s]; None for the flight's own.
        points : most samples of a line; a window with fewer comes in full.

        Returns (name, source) -> values [SI] over time [s]; the source is ``measured``,
        ``reconstructed``, ``flight`` or ``database``. ``attrs["unit"]`` is the unit.
        """
        import pandas as pd  # slow to import

        asked = {"names": ",".join(names or ()), "from": start, "to": end, "points": points}
        path = f"/api/flights/{_part(flight)}/channels"
        data = self._ask("GET", path, {**asked, "format": "binary"}).content
        (length,) = struct.unpack_from("<I", data)
        heading = json.loads(data[4 : 4 + length])
        numbers, at = np.frombuffer(data, "<f8", offset=4 + length), 0
        found = {}
        for line in heading["series"]:
            n = line["samples"]
            time, values = numbers[at : at + n], numbers[at + n : at + 2 * n]
            at += 2 * n
            series = pd.Series(values, index=pd.Index(time, name="time"), name=line["name"])
            series.attrs["unit"] = line["unit"]
            found[(line["name"], line["source"])] = series
        return found

    def versions(self, vehicle: str | None = None) -> Iterator[dict[str, Any]]:
        """Yield the versions of a vehicle, newest first. UnknownNameError for an unknown vehicle;
        see `Client.get`."""
        return self.pages("/api/versions", vehicle=vehicle)

    def version(self, version: str = "released", vehicle: str | None = None) -> dict[str, Any]:
        """Return the document of a version (name, label, or the beginning of its id), with its
        report (docs/reference/contract.md, section "JSON"). UnknownNameError where there is
        none."""
        return dict(self.get(f"/api/versions/{_part(version)}", vehicle=vehicle))

    def evaluate(
        self, version: str = "released", vehicle: str | None = None, **inputs: float | str
    ) -> dict[str, Any]:
        """Evaluate a version at a point: ``client.evaluate("released", alpha="5 deg", V=20.0)``.

        inputs : numbers in SI, or texts with a unit; those not given count as zero. Coefficients
        are dimensionless; InputError for an unknown input or unit.
        """
        at = ",".join(f"{name}={_with_unit(name, value)}" for name, value in inputs.items())
        return dict(self.get(f"/api/versions/{_part(version)}/evaluate", at=at, vehicle=vehicle))

    def export(self, version: str, form: str, vehicle: str | None = None) -> bytes:
        """Return the file that ``aerodb version export`` writes, checked by its check cases.

        form : ``daveml``, ``jsbsim``, ``csv``, ``mat`` or ``netcdf``. InputError for another form,
        or a database that it cannot hold.
        """
        path = f"/api/versions/{_part(version)}/export"
        return self._ask("GET", path, {"format": form, "vehicle": vehicle}).content

    def findings(self) -> Iterator[dict[str, Any]]:
        """Yield updates and closed loops, newest first, each in one sentence; raises what `get`
        raises."""
        return self.pages("/api/findings")

    def finding(self, reference: str, vehicle: str | None = None) -> Document:
        """Return the document of an update or a closed loop (docs/reference/contract.md, section
        "update and close-loop"), in SI units; ``print`` says what to decide on. UnknownNameError
        where there is none."""
        return of_finding(self.get(f"/api/findings/{_part(reference)}", vehicle=vehicle))

    def promote(
        self, version: str, reason: str, name: str = "released", vehicle: str | None = None
    ) -> dict[str, Any]:
        """Point a name at a version, through the gate; GateRefusal with its reasons
        (docs/method/updates.md, section "Gate")."""
        path = f"/api/versions/{_part(version)}/promote"
        return self._change(path, {"reason": reason, "name": name}, {"vehicle": vehicle})

    def roll_back(
        self, reason: str, name: str = "released", vehicle: str | None = None
    ) -> dict[str, Any]:
        """Undo the last move of a name; raises what `get` raises, InputError without a reason."""
        body = {"reason": reason, "name": name, "vehicle": vehicle}
        return self._change("/api/rollback", body, {})

    def _change(
        self, path: str, body: Mapping[str, Any], asked: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Send a change with the token of this session."""
        token = self.get("/api/session")["csrf"]
        return dict(self._ask("POST", path, asked, body, {_CSRF: token}).json())

    def _ask(
        self,
        method: str,
        path: str,
        asked: Mapping[str, Any],
        body: Mapping[str, Any] | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> httpx.Response:
        query = {name: value for name, value in asked.items() if value not in (None, "")}
        try:
            # None, not {}: a query that the path brings along stays
            answer = self._http.request(
                method, path, params=query or None, json=body, headers=headers
            )
        except httpx.HTTPError as error:
            what = f"the console does not answer: {error}"
            raise StoreError(what, self.url, "check its address and that it runs") from error
        if answer.status_code != httpx.codes.OK:
            raise _refusal(answer, self.url)
        return answer


def _with_unit(name: str, value: float | str) -> str:
    """A number with the SI unit of its channel, where people would be asked for one."""
    angle = not isinstance(value, str) and (name in CHANNELS or is_surface(name))
    return f"{value} rad" if angle and channel(name).unit == "rad" else str(value)


def _part(name: str) -> str:
    """A name as one part of a path."""
    return quote(name, safe="")


def _refusal(answer: httpx.Response, url: str) -> AeroError:
    """The error that a refusal stands for."""
    try:
        said = answer.json()["error"]
        what, where, remedy = said["what"], said["where"], said["remedy"]
    except (ValueError, KeyError, TypeError):  # what stands before the application, in text
        what, where = answer.text[:200].strip() or answer.reason_phrase, url
        remedy = "check the token" if answer.status_code in (401, 403) else ""
    if answer.status_code == httpx.codes.CONFLICT:
        return GateRefusal((what,), where, remedy)
    return _ERRORS.get(answer.status_code, InputError)(what, where, remedy)
