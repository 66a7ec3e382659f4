"""Golden keys: what each step makes of one tiny fixed input, under which key. A reminder, not a
proof.

A key is made of inputs, settings and the step's RESULT_VERSION, not of what the step computes.
Whoever changes what a step returns must bump its number in ``tasks/result_versions.py``, or old
results would be taken for new ones.
"""

import hashlib
import json
from typing import Any

import numpy as np
import pytest

from aerodb.flows.close_loop import close_loop_flow
from aerodb.flows.estimate import estimate_flow
from aerodb.flows.flight import flight_flow
from aerodb.flows.fly import fly_flow
from aerodb.flows.importing import import_flow
from aerodb.flows.run import run_flow
from aerodb.flows.update import update_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.files.flights import read_flight, read_results
from aerodb.storage.workspace import Workspace
from aerodb.support.identity import result_key
from aerodb.tasks.result_versions import RESULT_VERSION
from tests.support.small_glider import DATABASE, MODEL, NAME, VEHICLE, write_csv

#: step -> (RESULT_VERSION, first digits of the key, first digits of the digest of what is stored).
GOLDEN: dict[str, tuple[int, str, str]] = {
    "ingest": (11, "d4fb750c460090af", "3c40ca585a1c1e0d"),
    "conditioning": (38, "d53ed9252635f700", "46c72025355d8e3c"),
    "consistency": (29, "be348c1536e25049", "0a6b81f9def94d33"),
    "coefficients": (5, "0a6959f8f048b54b", "9ddddc1b635ef5d7"),
    "compare": (27, "f8495e09083af964", "75ab953bf9aaf46f"),
    "gram": (22, "482a98edec7155da", "a41b3127f3bfd9d7"),
    "close_loop": (76, "c68f414d1296a161", "b7cd226038e57476"),
    "fly": (8, "71fffe689ec4408f", "c1e07fb83cde1a03"),
    "import": (3, "2c4d0454b27962f7", "15d078bd64552f53"),
    "estimate": (29, "99d693478690998f", "be09817f5df27dda"),
    "update": (40, "4f019828e8f1bc43", "6b1983884f9e9ae7"),
}

#: The test's own mapping: the built-in ones may learn new channels without anything here changing.
MAPPING = 'name = "golden"\nformats = ["tabular"]\n[time]\ntopic = "table"\nfield = "time"\n'


def _table(shift: float) -> dict[str, np.ndarray]:
    """A short flight in which everything moves, to six decimals: the same bytes on every
    machine."""
    t = np.arange(150) / 25.0
    wave = {
        "V": 25.0 + 0.5 * np.sin(0.7 * t + shift),
        "qbar": 344.0 + 14.0 * np.sin(0.7 * t + shift),
        "alpha": 0.07 + 0.04 * np.sin(2.1 * t + shift),
        "beta": 0.03 * np.sin(1.7 * t + 2 * shift),
        "p": 0.4 * np.sin(2.9 * t + shift),
        "q": 0.2 * np.cos(2.3 * t + 3 * shift),
        "r": 0.1 * np.sin(1.3 * t - shift),
        "ax": 0.5 * np.sin(2.1 * t + shift),
        "ay": 0.3 * np.sin(1.7 * t + shift),
        "az": -9.8 - 4.0 * np.sin(2.0 * t + shift),
        "delta_elevator": 0.1 * np.sin(2.6 * t - 2 * shift),
    }
    return {"time": t, **{name: np.round(values, 6) for name, values in wave.items()}}


def _digest(columns: dict[str, Any]) -> str:
    """sha256 of numbers to nine digits of the largest of their column: rounding elsewhere must not
    show."""
    digest = hashlib.sha256()
    for name in sorted(columns):
        values = np.asarray(columns[name])
        digest.update(f"{name} {values.shape}".encode())
        if values.dtype.kind == "f":
            scale = np.nanmax(np.abs(values), initial=0.0) or 1.0
            values = np.round(values / scale, 9) + 0.0
            digest.update(f"{scale:.8e}".encode())
        digest.update(
            np.ascontiguousarray(values).tobytes()
            if values.dtype.kind in "fbiu"
            else repr(values.tolist()).encode()
        )
    return digest.hexdigest()[:16]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[str, str]]:
    """step -> (key, digest) of a run on the fixed input."""
    folder, workspace = (
        tmp_path_factory.mktemp("files"),
        Workspace.open(tmp_path_factory.mktemp("w")),
    )
    logs = [str(write_csv(folder / f"golden{k}.csv", _table(0.9 * k))) for k in range(2)]
    (folder / "database.toml").write_text(DATABASE, encoding="utf-8")
    entries = [
        f'[[channel]]\nname = "{n}"\nsources = [{{ topic = "table", field = "{n}" }}]\n'
        for n in _table(0.0)
        if n != "time"
    ]
    (folder / "golden.toml").write_text(MAPPING + "".join(entries), encoding="utf-8")
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle(NAME, VEHICLE)
        database = {"file": str(folder / "database.toml"), "vehicle": NAME, "bindings": {}}
        baseline = run_flow(import_flow, database, workspace, "direct")["version"]
        ingest = {"logs": logs, "vehicle": NAME, "mapping": str(folder / "golden.toml")}
        outcomes = run_flow(flight_flow, ingest, workspace, "direct")
        flights = [outcome["flight"] for outcome in outcomes]
        update = {"vehicle": NAME, "baseline": baseline, "flights": flights, "model": MODEL}
        candidate = run_flow(update_flow, update, workspace, "direct")["candidate"]
        loop = run_flow(
            close_loop_flow,
            {name: update[name] for name in ("vehicle", "baseline", "flights")},
            workspace,
            "direct",
        )
        found = {}
        for step in ("ingest", "conditioning", "consistency", "coefficients", "compare", "gram"):
            row = next(
                r
                for r in catalogue.results_of(flights[0], step)
                if step != "compare" or baseline in r.inputs
            )
            path = workspace.resolve(row.path)
            if step == "ingest":
                flight = read_flight(path)
                columns: dict[str, Any] = {"time": flight.time, **flight.channels}
                columns |= {f"flags_{name}": bits for name, bits in flight.flags.items()}
            elif step == "conditioning":
                columns = _findings(read_results(path)[1])
            elif step == "consistency":  # this log has no attitude: what is said of it
                columns = {
                    name: np.array(read_results(path)[1][name])
                    for name in ("verdict", "reasons", "changed")
                }
            else:
                columns = dict(read_results(path)[0])
            found[step] = (row.key, _digest(columns))
        said = {
            name: np.array([f"{e['hypothesis']} {e['verdict']}" for e in loop[name]])
            for name in ("findings", "not_found")
        }
        found["close_loop"] = (loop["report"], _digest(said))
        given = {"version": baseline, "flight": flights[0]}
        flown = run_flow(fly_flow, given, workspace, "direct")  # says what the log lacks
        reasons = [stretch["reason"] for stretch in flown["stretches"]]
        found["fly"] = (flown["key"], _digest({"reasons": np.array(reasons)}))
        estimating = {"flights": flights, "model": MODEL, "methods": ["regression"]}
        answer = run_flow(estimate_flow, {**estimating, "version": baseline}, workspace, "direct")
        values = {e["name"]: np.array(e["value"]) for e in answer["methods"][0]["estimates"]}
        found["estimate"] = (answer["key"], _digest(values))
        for step, version in (("import", baseline), ("update", candidate)):
            found[step] = (
                version,
                _digest(_numbers(json.loads(catalogue.version_documents(version).content))),
            )
    return found


def _findings(document: dict[str, Any]) -> dict[str, Any]:
    """What conditioning says, but for digits that rounding on another machine may turn."""
    return {
        "suspicions": np.array([entry["sentence"] for entry in document["suspicions"]]),
        "segments": np.array(
            [
                f"{s['kind']} {s['channel']} {s['start']:.3f} {s['end']:.3f}"
                for s in document["segments"]
            ]
        ),
        "delays": np.array(
            [
                f"{d['channel']} {d['observable']} {d['seconds']:.3f}"
                for d in document["delays"]
                if d["observable"]
            ]
        ),
    }


def _numbers(document: dict[str, Any]) -> dict[str, Any]:
    """The numbers of a database document by name."""
    found: dict[str, Any] = {"terms": [term["expression"] for term in document["terms"]]}
    for name, table in document["tables"].items():
        found[f"table {name}"] = np.array(table["values"], dtype=float)
        found[f"breakpoints {name}"] = np.concatenate(
            [np.array(axis, dtype=float) for axis in table["breakpoints"]]
        )
    for increment in document["increments"]:
        found[f"estimates {increment['axis']}"] = np.array(increment["estimates"], dtype=float)
        found[f"covariance {increment['axis']}"] = np.array(increment["covariance"], dtype=float)
    return found


@pytest.mark.parametrize("step", sorted(RESULT_VERSION))
def test_what_a_step_returns_and_its_version_change_together(
    made: dict[str, tuple[str, str]], step: str
) -> None:
    key, digest = made[step]
    now = (RESULT_VERSION[step], key[:16], digest)
    assert step in GOLDEN, f"a new step: add {step!r}: {now} to GOLDEN"
    version, golden_key, golden_digest = GOLDEN[step]
    if RESULT_VERSION[step] == version:
        assert digest == golden_digest, (
            f"step '{step}' (or one before it) returns something else for the same input. If that"
            f" is meant, bump RESULT_VERSION['{step}'] in tasks/result_versions.py, then set"
            f" GOLDEN['{step}'] to {now} with the new number"
        )
    assert now == (
        version,
        golden_key,
        golden_digest,
    ), f"the key of step '{step}' changed: if that is meant, set it to {now}"


def test_the_version_is_part_of_the_key_and_the_order_of_settings_is_not() -> None:
    one = result_key({"log": "a"}, {"x": 1, "y": 2.0}, "ingest", 1)
    assert one == result_key({"log": "a"}, {"y": 2, "x": 1}, "ingest", 1)
    assert (
        len(
            {
                one,
                result_key({"log": "a"}, {"x": 1, "y": 2.0}, "ingest", 2),
                result_key({"log": "b"}, {}, "ingest", 1),
            }
        )
        == 3
    )
