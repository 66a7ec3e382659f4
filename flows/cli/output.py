"""What a command says: text and tables for people, one JSON document for programs, a progress bar
for the patient."""

import sys
import time
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Table
from rich.text import Text

from aerodb.flows.run import How, run_flow
from aerodb.storage.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.tasks.view import as_json


def visible(text: str, keep: str = "") -> str:
    """`text` with control characters and broken Unicode as escapes: a name in a log cannot move the
    cursor.

    >>> visible("a\\nb\\x1b[31m")
    'a\\\\nb\\\\x1b[31m'
    """
    hidden = (
        c for c in set(text) if c not in keep and unicodedata.category(c) in ("Cc", "Cf", "Cs")
    )
    return text.translate(
        {ord(c): c.encode("unicode_escape", "surrogatepass").decode() for c in hidden}
    )


def complaint(what: str, where: str, remedy: str) -> str:
    """A refusal in two lines: where and what, then what to do; one line when nothing can be
    done."""
    lines = (f"aerodb: {where}: {what}" if where else f"aerodb: {what}", remedy)
    return "\n".join(visible(line) for line in lines if line)


class Session:
    """One call of the command line: where the workspace is, and how to answer."""

    def __init__(self, root: Path, as_json: bool, debug: bool) -> None:
        self.root = root
        self.as_json = as_json
        self.debug = debug
        self.people = Console(stderr=as_json, highlight=False, soft_wrap=True, emoji=False)
        if not self.people.is_terminal:
            self.people.width = (
                160  # a file or a pipe has no width of its own, and must not be cut to 80
            )

    def workspace(self, create: bool = False) -> Workspace:
        """The workspace; InputError when there is none and it is not to be made."""
        return Workspace.open(self.root, create)

    def catalogue(self, create: bool = False) -> Catalogue:
        """The workspace's catalogue."""
        return Catalogue.open(self.workspace(create).catalogue, create)

    def say(self, text: str = "") -> None:
        """A line for people. Text is never markup: names in logs are not ours."""
        self.people.print(visible(text, keep="\n\t"), markup=False)

    def table(
        self, columns: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()
    ) -> None:
        """A table for people; columns whose positions are in `numbers` are set right."""
        made = Table(box=None, header_style="bold", pad_edge=False)
        for k, column in enumerate(columns):
            made.add_column(
                Text(column), justify="right" if k in numbers else "left", no_wrap=k in numbers
            )
        for row in rows:
            made.add_row(*(Text(visible(cell)) for cell in row))
        self.people.print(made)

    @contextmanager
    def waiting(self, what: str) -> Iterator[None]:
        """Says what takes long while it lasts, where somebody watches."""
        with Console(stderr=True).status(what):
            yield

    def answer(self, document: Any) -> None:
        """The one JSON document, when that is what was asked for."""
        if self.as_json:
            sys.stdout.write(as_json(document, indent=1) + "\n")

    def run(self, body: Any, parameters: dict[str, Any], direct: bool) -> Any:
        """Runs a flow, with a progress bar for whatever takes longer than two seconds."""
        how: How = "direct" if direct else "auto"
        with _progress(self.as_json) as report:
            return run_flow(body, parameters, self.workspace(create=True), how, report)


@contextmanager
def _progress(as_json: bool) -> Iterator[Any]:
    """A bar on standard error that appears two seconds after the start; nothing where nobody
    watches."""
    console = Console(stderr=True)
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    started = time.monotonic()
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("starting", total=None, visible=False)

        def report(step: str, done: int, total: int) -> None:
            visible = time.monotonic() - started > 2.0
            bar.update(task, description=step, completed=done, total=total, visible=visible)

        yield report
