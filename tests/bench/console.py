"""The console: the time of every page with many flights, and the first plot of a long flight in
Chromium."""

import statistics
import time
import urllib.request
from base64 import b64encode
from pathlib import Path

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.flows.web.test_console_scale import crowd
from tests.support.catalogue_samples import h
from tests.support.console_workspace import TOKEN, add_long_flight, served
from tests.support.small_glider import NAME, VEHICLE

#: Flights and versions in the catalogue; requests of each page.
FLIGHTS, VERSIONS, REQUESTS = 1000, 100, 9


def console(folder: Path, seconds: float) -> None:
    """Print medians over a console of `FLIGHTS` flights and one of `seconds` at 100 Hz."""
    workspace = Workspace.open(folder / "console")
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle(NAME, VEHICLE)
    crowd(workspace.catalogue, VERSIONS, FLIGHTS)
    flight, _ = add_long_flight(workspace, seconds)
    some = h(f"crowd-{FLIGHTS // 2}")
    print(f"console with {FLIGHTS} flights, medians of {REQUESTS} requests")
    with served(workspace) as address:
        for path in (
            *(
                "/",
                "/flights",
                f"/flights?vehicle={NAME}&verdict=rejected",
                "/flights?text=crowd-7",
            ),
            *(f"/flights/{flight}", f"/flights/{some}", f"/flights/{some}/impact"),
            *(
                f"/versions?vehicle={NAME}",
                "/findings",
                f"/history?vehicle={NAME}",
                "/work",
                "/api",
            ),
        ):
            times = [_seconds(f"{address}{path}") for _ in range(REQUESTS)]
            print(f"  {path[:40]:40} {statistics.median(times):6.3f} s, longest {max(times):.3f} s")
        _first_plot(f"{address}/flights/{flight}", seconds)


def _seconds(address: str) -> float:
    token = b64encode(f"bench:{TOKEN}".encode()).decode()
    request = urllib.request.Request(address, headers={"authorization": f"Basic {token}"})
    begun = time.perf_counter()
    with urllib.request.urlopen(request) as answer:
        answer.read()
    return time.perf_counter() - begun


def _first_plot(address: str, seconds: float) -> None:
    """Print the time from the address to drawn panels, in a browser that knows nothing yet."""
    from tests.support.browser import opened  # skips where there is no browser

    times = []
    with opened() as browser:
        for _ in range(REQUESTS):
            with browser.new_context(
                http_credentials={"username": "bench", "password": TOKEN}
            ) as context:
                page = context.new_page()
                begun = time.perf_counter()
                page.goto(address, wait_until="commit")
                page.wait_for_selector("#record[data-shown]")
                times.append(time.perf_counter() - begun)
    print(
        f"  first plot of {seconds:g} s at 100 Hz  {statistics.median(times):6.3f} s, longest"
        f" {max(times):.3f} s"
    )
