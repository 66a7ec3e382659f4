"""Run a notebook as its reader does, cell by cell, in the present folder: ``python -m
tests.support.run_notebook FILE``. It prints what the cells print, and the HTML of what they show; a
cell that fails ends it."""

import json
import sys
from pathlib import Path

from IPython.core.interactiveshell import InteractiveShell


def main(notebook: Path) -> None:
    """Run all code cells of a notebook."""
    shell = InteractiveShell.instance()
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            done = shell.run_cell("".join(cell["source"]))
            done.raise_error()
            shown = getattr(done.result, "_repr_html_", lambda: None)()
            if shown:
                print(shown)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
