"""Services under load: what is asked of the console meanwhile, and when they have done their work."""

import json
import signal
import threading
import time
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from http.client import HTTPException
from http.cookiejar import CookieJar
from types import MappingProxyType
from typing import Any, Final

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.locks import is_held
from tests.campaigns.kills.places import LONGEST, Place, ended
from tests.support.ports import free_port
from tests.support.small_glider import NAME

TOKEN: Final = "a-token-for-the-campaign"
_PAGES: Final = ("/", "/flights", "/api/flights", "/versions", "/history", "/work", "/api/status")
_CLIENTS: Final = 4


class Load:
    """Clients that ask a console for one page after the other, and at most one that promotes.

    faults : answers that no client should get. answered : good answers by path. asking : requests
    that wait for an answer now.
    """

    def __init__(self, port: int, pages: tuple[str, ...]) -> None:
        self._port, self._pages = port, pages
        self.faults: list[str] = []
        self.answered: Counter[str] = Counter()
        self.asking = 0
        self._promotes = False
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._threads = [
            threading.Thread(target=self._ask_on, args=(k,), daemon=True) for k in range(_CLIENTS)
        ]

    def start(self) -> None:
        for thread in self._threads:
            thread.start()

    def promote(self, version: str) -> None:
        """Begin to promote a version, once; its answer is that of ``promote``."""
        if self._promotes:
            return
        self._promotes = True
        thread = threading.Thread(target=self._insist, args=(version,), daemon=True)
        self._threads.append(thread)
        thread.start()

    @property
    def is_complete(self) -> bool:
        """Whether each page was answered."""
        return set(self._pages) <= set(self.answered)

    def stop(self) -> None:
        self._ended.set()
        for thread in self._threads:
            thread.join(LONGEST)

    def _ask_on(self, first: int) -> None:
        number = first
        while not self._ended.is_set():
            self._ask(self._pages[number % len(self._pages)])
            number += 1

    def _insist(self, version: str) -> None:
        """Promote in a session, as a page does."""
        wanted = json.dumps({"name": "released", "reason": "proved"}).encode()
        while not self._ended.is_set():
            jar = urllib.request.HTTPCookieProcessor(CookieJar())
            session = urllib.request.build_opener(jar)
            known = self._ask("/api/session", session=session)
            if known is None:
                continue
            head = {"X-CSRF-Token": json.loads(known)["csrf"]}
            if self._ask(f"/api/versions/{version}/promote", session, wanted, head) is not None:
                self.answered["promote"] += 1
                return

    def _ask(
        self,
        path: str,
        session: urllib.request.OpenerDirector | None = None,
        body: bytes | None = None,
        more: Mapping[str, str] = MappingProxyType({}),
    ) -> bytes | None:
        """What was answered; None for nothing, when the console does not listen or is killed."""
        head = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json", **more}
        request = urllib.request.Request(f"http://127.0.0.1:{self._port}{path}", body, head)
        with self._lock:
            self.asking += 1
        try:
            with (session or urllib.request.build_opener()).open(request, timeout=60) as answer:
                found: bytes = answer.read()
            self.answered[path] += 1
            return found
        except urllib.error.HTTPError as error:
            said = error.read()
            if not (body and error.code == 409):  # what is promoted already
                self.faults.append(f"{path}: {error.code} {said[:200]!r}")
            return said
        except (OSError, HTTPException):
            time.sleep(0.05)
            return None
        finally:
            with self._lock:
                self.asking -= 1


# ``aerodb serve``: logs come in, nights are run, and a console is asked --------------------------


@contextmanager
def console_beside(place: Place) -> Iterator[Load]:
    """A console of the same workspace, which is asked all the time."""
    port = free_port()
    place.more["AERODB_TOKEN"] = TOKEN
    load = Load(port, _PAGES)
    with place.begun(["web", "--port", str(port)], "console") as process:
        load.start()
        try:
            yield load
        finally:
            load.stop()
            if not ended(process):
                with suppress(ProcessLookupError):
                    process.send_signal(signal.SIGTERM)
            code = process.wait(LONGEST)
            if code not in (-signal.SIGTERM, -signal.SIGKILL):
                load.faults.append(f"the console ended with {code}")


def all_taken_in(place: Place, _load: Load | None) -> bool:
    """The inbox is empty, the update has made its candidate, and no run is under way."""
    inbox = place.here / "w" / "inbox" / NAME
    if any(inbox.iterdir()):
        return False
    with Catalogue.open(place.workspace.catalogue) as catalogue:
        if any(is_held(place.workspace.lock(f"run-{r.id}")) for r in catalogue.runs("running")):
            return False
        return len(catalogue.versions(NAME)) == 2


def a_run_is_under_way(place: Place, _load: Load | None) -> bool:
    runs = (place.here / "w" / "locks").glob("run-*")
    return any(is_held(lock) for lock in runs)


# ``aerodb web``: pages, reports and exports while a version is promoted --------------------------


@contextmanager
def clients(place: Place) -> Iterator[Load]:
    """Clients of the console that is killed."""
    flight, candidate = place.filled(["{flight}", "{candidate}"])
    pages = (
        *_PAGES,
        f"/flights/{flight}",
        f"/versions/{candidate}",
        f"/api/versions/{candidate}/export?format=daveml",
    )
    load = Load(int(place.more["KILLS_PORT"]), pages)
    load.start()
    try:
        yield load
    finally:
        load.stop()


def promoted(place: Place, load: Any) -> bool:
    """The console has answered each page and a promotion."""
    if load.answered:
        load.promote(place.filled(["{candidate}"])[0])
    return load.answered["promote"] > 0 and load.is_complete


def a_page_is_asked(place: Place, load: Any) -> bool:
    promoted(place, load)
    return bool(load.answered) and load.asking > 0


def own_port(place: Place) -> None:
    place.more |= {"AERODB_TOKEN": TOKEN, "KILLS_PORT": str(free_port())}
