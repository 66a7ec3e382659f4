"""The campaign as a command: see the package."""

import argparse
import itertools
import json
import shutil
import signal
import sys
import tempfile
from pathlib import Path

from tests.campaigns import kills
from tests.campaigns.kills.checks import wrong
from tests.campaigns.kills.commands import COMMANDS
from tests.campaigns.kills.trial import Campaign, report


def main() -> None:
    parser = argparse.ArgumentParser(
        description=kills.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--in-a-row", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--command", action="append", choices=list(COMMANDS), default=None)
    parser.add_argument("--but", action="append", choices=list(COMMANDS), default=[])
    parser.add_argument("--to", type=Path, default=None)
    parser.add_argument("--report", type=Path, nargs="*", default=None)
    given = parser.parse_args()
    if given.report is not None:
        texts = [file.read_text(encoding="utf-8") for file in given.report]
        print(report(json.loads(line) for text in texts for line in text.splitlines()))
        return
    names = [name for name in given.command or COMMANDS if name not in given.but]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # what has begun is ended
    folder = Path(tempfile.mkdtemp(prefix="kills-"))
    campaign, lines = Campaign(folder, given.seed), []
    turn = itertools.cycle(names)
    while len(lines) < given.kills:
        told = campaign.kill(next(turn), in_a_row=given.in_a_row)
        lines += told
        if given.to is not None:
            with given.to.open("a", encoding="utf-8") as file:
                file.writelines(json.dumps(said) + "\n" for said in told)
        for said in told:
            if found := wrong(said):
                print(f"{said['command']}: {', '.join(found)}: {json.dumps(said)}", flush=True)
    print(report(lines))
    if not any(map(wrong, lines)):
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
