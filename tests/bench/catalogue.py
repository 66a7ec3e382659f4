"""What the catalogue costs in a file and in PostgreSQL, side by side: ``python -m
tests.bench.catalogue``.

100,000 flights and 10,000 versions in each, the same rows; the quickest of warm calls in one
process, which who else works on the machine disturbs least; the server on the same machine over TCP
with its usual guarantees (fsync). Nothing is asserted.
"""

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.copying import copy_catalogue
from tests.storage.test_scale import QUERIES, SIZES, crowd, family
from tests.support.catalogue_samples import V, add_flight, add_version, h
from tests.support.postgresql import Server, binaries, name_in_settings

_QUERIES = (
    "list",
    "names",
    "version by name",
    "version by prefix",
    "load",
    "flight by name",
    "lineage",
    "impact",
    "prov",
    "diff",
)
_TIMES = 30


def quickest(call: Callable[[int], Any]) -> float:
    """Milliseconds of a call; it is given its number."""
    call(-1)
    spent = []
    for k in range(_TIMES):
        start = time.perf_counter()
        call(k)
        spent.append(time.perf_counter() - start)
    return 1e3 * min(spent)


def writes(catalogue: Catalogue) -> dict[str, Callable[[int], Any]]:
    """What a run writes, by number: each call is new."""

    def run(_: int) -> None:
        catalogue.end_run(catalogue.start_run("bench", how="direct").id, "completed")

    def result(k: int) -> None:
        catalogue.add_result(
            h(f"r{k}"), step="s", kind="k", path=f"results/{k}", result_version=1, inputs=[h(k)]
        )

    return {
        "write: a run begins and ends": run,
        "write: a result": result,
        "write: a flight and its log": lambda k: add_flight(catalogue, f"bench-{k}"),
        "write: a version": lambda k: add_version(catalogue, f"bench-{k}"),
        "write: 2,000 marks of a flight": lambda k: catalogue.add_marks(
            h("one-0"), range(2000 * (k + 1), 2000 * (k + 2))
        ),
    }


def opened_by_a_process(root: Path) -> float:
    """Milliseconds from a catalogue's opening to its first answer, in a process that has imported
    all it needs."""

    def once(_: int) -> None:
        with Catalogue.open(root / "catalogue.sqlite") as catalogue:
            catalogue.names(V)

    return quickest(once)


def prepared(folder: Path, server: Server) -> tuple[dict[str, Path], dict[str, float]]:
    """The two workspaces, and seconds that the rows took from one kind to the other."""
    roots = {"SQLite": folder / "file", "PostgreSQL": folder / "database"}
    roots["SQLite"].mkdir()
    name_in_settings(roots["PostgreSQL"], server.url(server.empty()))
    versions, flights = SIZES["large"]
    with Catalogue.open(roots["SQLite"] / "catalogue.sqlite") as one:
        one.add_vehicle(V, "text")
        crowd(roots["SQLite"] / "catalogue.sqlite", versions, flights)
        family(one)
        with (
            Catalogue.open(roots["PostgreSQL"] / "catalogue.sqlite") as other,
            Catalogue.in_file(folder / "back") as back,
        ):
            start = time.perf_counter()
            copy_catalogue(one, other)
            there = time.perf_counter()
            copy_catalogue(other, back)
            spent = {"there": there - start, "back": time.perf_counter() - there}
    server.execute("VACUUM ANALYZE", database="test_1")
    return roots, spent


def main() -> None:
    if binaries() is None:
        sys.exit("no PostgreSQL server on this machine")
    server = Server(durable=True)
    try:
        with tempfile.TemporaryDirectory() as folder:
            roots, spent = prepared(Path(folder), server)
            table: dict[str, list[float]] = {}
            for root in roots.values():
                table.setdefault("open, first answer", []).append(opened_by_a_process(root))
                with Catalogue.open(root / "catalogue.sqlite") as catalogue:
                    for name in _QUERIES:
                        query = QUERIES[name]
                        table.setdefault(name, []).append(
                            quickest(lambda _, query=query, one=catalogue: query(one))
                        )  # type: ignore[misc]
                    for name, write in writes(catalogue).items():
                        table.setdefault(name, []).append(quickest(write))
        print(
            f"{'[ms]':36}"
            + "".join(f"{name:>12}" for name in roots)
            + f"   load {os.getloadavg()[0]:.1f}"
        )
        for name, values in table.items():
            print(f"{name:36}" + "".join(f"{value:12.2f}" for value in values))
        print(f"all rows into PostgreSQL {spent['there']:.0f} s, back {spent['back']:.0f} s")
    finally:
        server.remove()


if __name__ == "__main__":
    main()
