"""Error rates of the closed loop over aircraft and instruments, through the commands.

``python -m tests.campaigns.closed_loop --aircraft 737 --cell declared --flights 3 6 --seed 1``
appends one line of JSON per run to a file; ``--report`` prints what that file holds.
"""

import argparse
import json
import shutil
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from tests.campaigns.fleet import CONDITIONS, airframe
from tests.campaigns.instruments import CELLS
from tests.campaigns.runs import judged, looped, prepared, record

CLASSES = ("confirmed", "aerodynamic", "unnamed", "sensor")


def run_null(
    aircraft: str, cell: str, flights: Sequence[int], seed: int, folder: Path
) -> Iterable[dict[str, Any]]:
    """The runs of one cell with nothing missing, of the first n flights of the same campaign.

    Folders of runs with a wrong claim are kept.
    """
    craft = airframe(aircraft)
    here = Path(tempfile.mkdtemp(prefix=f"{craft.vehicle}-", dir=folder))
    numbers = [(seed * 5 + k) % 16 for k in range(max(flights))]
    ready = prepared(craft, cell, numbers, seed, here / "all", folder / "flights")
    wrong = False
    for n in flights:
        loop = looped(craft, ready, n, here / f"{n}-flights")
        verdicts = Counter(list(ready.verdicts.values())[:n])
        line: dict[str, Any] = {
            "aircraft": aircraft, "cell": cell, "flights": n, "seed": seed,
            "consistency": dict(verdicts), "loop_cpu": round(loop.cpu, 2),
            "ingest_cpu": round(ready.cpu, 2), "refused": loop.refused,
        }  # fmt: skip
        if loop.found is not None:
            line |= record(judged(loop.found, CELLS[cell])) | {"added": loop.found["added"]}
            line["findings"] = [[f["verdict"], f["hypothesis"]] for f in loop.found["findings"]]
        bad = bool(loop.refused) or any(line.get(name) for name in CLASSES)
        if bad:
            line["folder"] = str(loop.folder)
        else:
            shutil.rmtree(loop.folder)
        wrong = wrong or bad
        yield line
    if not wrong:
        shutil.rmtree(here)


def report(lines: Sequence[dict[str, Any]]) -> str:
    """Counts of wrong claims per cell and pooled, and which they were."""
    done = [line for line in lines if not line["refused"]]
    text = [f"{len(lines)} runs, {len(lines) - len(done)} refused; of {len(done)}:"]

    def counted(name: str, chosen: Sequence[dict[str, Any]]) -> str:
        wrong = [sum(bool(line[kind]) for line in chosen) for kind in CLASSES]
        return f"{name:28} {len(chosen):4}  " + "  ".join(f"{k:4}" for k in wrong)

    text.append(f"{'runs with a wrong claim':28} runs  " + "  ".join(k[:4] for k in CLASSES))
    text.append(counted("all", done))
    for key in ("cell", "aircraft", "flights"):
        for value in sorted({line[key] for line in done}, key=str):
            text.append(counted(f"{value}", [line for line in done if line[key] == value]))
    for kind in CLASSES:
        patterns = Counter(claim.split()[0] for line in done for claim in line[kind])
        text.append(f"{kind}: " + ", ".join(f"{name} {k}" for name, k in patterns.most_common()))
    return "\n".join(text)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--aircraft", nargs="+", default=list(CONDITIONS), choices=[*CONDITIONS])
    parser.add_argument("--cell", nargs="+", default=list(CELLS), choices=[*CELLS])
    parser.add_argument("--flights", nargs="+", type=int, default=[3, 6, 12])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path("campaign"))
    parser.add_argument("--report", action="store_true")
    chosen = parser.parse_args(arguments)
    results = chosen.folder / "results.jsonl"
    if not chosen.report:
        warnings.simplefilter("ignore")
        chosen.folder.mkdir(parents=True, exist_ok=True)
        for cell in chosen.cell:
            for aircraft in chosen.aircraft:
                for line in run_null(aircraft, cell, chosen.flights, chosen.seed, chosen.folder):
                    with results.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(line) + "\n")
    print(report([json.loads(line) for line in results.read_text(encoding="utf-8").splitlines()]))


if __name__ == "__main__":
    main()
