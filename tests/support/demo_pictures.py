"""The pictures of README.md, out of the report of the demo, and those of the method pages: ``make
pictures``.

The first are what the report shows, byte for byte; a test asserts that every one of them is used and
small enough for a repository.
"""

import base64
import re
import sys
from pathlib import Path
from typing import Final

from aerodb.tasks.steps.report import update_page
from aerodb.tasks.workspace_access import access_workspace
from tests.support.method_pictures import drawn

#: File -> how the text of the picture in the report begins.
PICTURES: Final = {
    "errors.svg": "Error per axis",
    "votes.svg": "Estimates of",
    "residuals.svg": "Flight minus model",
    "slices.svg": "Slices through",
}
_FOUND: Final = re.compile(r'src="data:image/svg\+xml;base64,([^"]+)" alt="([^"]+)"')


def pictures(page: str) -> dict[str, str]:
    """File -> SVG of the first picture of its kind on a report's page; KeyError where there is
    none."""
    shown: dict[str, str] = {}
    for source, alt in _FOUND.findall(page):
        for file, begins in PICTURES.items():
            if alt.startswith(begins):
                shown.setdefault(file, base64.b64decode(source).decode("utf-8"))
    return {file: shown[file] for file in PICTURES}


def main(workspace: str, folder: str) -> None:
    """Write the pictures of the candidate of the demo in `workspace` into `folder`."""
    access = access_workspace(workspace)
    candidate = access.catalogue.version("phoenix", "candidate").id
    Path(folder).mkdir(parents=True, exist_ok=True)
    shown = pictures("".join(update_page(candidate, workspace=workspace, run=""))) | drawn(access)
    for file, svg in shown.items():
        (Path(folder) / file).write_text(svg, encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
