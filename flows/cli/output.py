"""Output of the commands: text and tables for people, one JSON document for programs, progress
bars."""

import math
import sys
import textwrap
import threading
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import typer
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from aerodb.errors import AeroError, InputError
from aerodb.tasks.view import as_json

# Help must not wait for the catalogue to import: what needs it is imported where it is used.
if TYPE_CHECKING:
    from aerodb.flows.run import How
    from aerodb.storage.catalogue import Catalogue
    from aerodb.storage.workspace import Workspace
    from aerodb.units import UnitSystem

#: Environment variable of the units in which a user is shown quantities.
UNITS_VARIABLE: Final = "AERODB_UNITS"

#: What is said below a table of such values.
HALF_INTERVAL: Final = "+-: half of the 95 % interval"
#: A name or number is never divided between two lines.
_WHOLE_WORDS: Final[dict[str, Any]] = {"break_long_words": False, "break_on_hyphens": False}


#: Least width of a column of text, which may be divided.
_TEXT: Final = 8
#: A column of names stays whole if it takes at most one part in so many of a line.
_NAME: Final = 3
#: Spaces between columns.
_GAP: Final = 2


def visible(text: str, keep: str = "") -> str:
    """`text` with control characters and broken Unicode as escapes: a name in a log cannot move the
    cursor.

    >>> visible("a\\nb\\x1b[31m")
    'a\\\\nb\\\\x1b[31m'
    """
    if text.isprintable():
        return text
    hidden = (
        c for c in set(text) if c not in keep and unicodedata.category(c) in ("Cc", "Cf", "Cs")
    )
    return text.translate(
        {ord(c): c.encode("unicode_escape", "surrogatepass").decode() for c in hidden}
    )


def divided(step: str, room: int) -> list[str]:
    """Return what to do next in lines of at most `room` characters, and the command in it on a line
    of its own: as a whole, so that it can be copied.

    >>> divided("declare it, then aerodb update --model model.toml", 12)
    ['declare it,', 'then', 'aerodb update --model model.toml']
    """
    said, found, command = step.partition("aerodb ")
    return [*textwrap.wrap(said, room, **_WHOLE_WORDS), *([found + command] if found else [])]


def complaint(what: str, where: str, remedy: str) -> str:
    """Return an error message: where and what in a line, then the remedy, which may be several.

    >>> print(complaint("2 mistakes", "model file", "no axis\\nno terms"))
    aerodb: model file: 2 mistakes
    no axis
    no terms
    """
    lines = (f"aerodb: {where}: {what}" if where else f"aerodb: {what}", *remedy.split("\n"))
    return "\n".join(visible(line) for line in lines if line)


def plus_minus(value: float, error: float | None, digits: int = 4, factor: float = 1.0) -> str:
    """Return a value +- half of its 95 % interval; the value alone where `error`, its standard
    error, is None or zero. factor : to the unit that is shown.

    >>> plus_minus(0.25, 0.01), plus_minus(1.0, None), plus_minus(1.0, 0.0)
    ('0.25 +- 0.02', '1', '1')
    """
    from aerodb.support import half_interval

    shown = f"{factor * value:.{digits}g}"
    return f"{shown} +- {factor * half_interval(error):.2g}" if error else shown


def percent(share: float | None) -> str:
    """Return a share in per cent, and '-' where there is none.

    >>> percent(0.1234), percent(0.997), percent(4.86), percent(None)
    ('12 %', '100 %', '486 %', '-')
    """
    if share is None or not math.isfinite(share):
        return "-"
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"


class Session:
    """One call of the command line: its workspace, and how it prints.

    units : name of the system of units that was asked for; empty: that of the settings.
    """

    def __init__(self, root: Path, as_json: bool, debug: bool, units: str = "") -> None:
        self._units = units
        self.root = root
        self.as_json = as_json
        self.debug = debug
        self._agreed = False
        self.people = Console(stderr=as_json, highlight=False, soft_wrap=True, emoji=False)
        if not self.people.is_terminal:
            self.people.width = (
                160  # a file or a pipe has no width of its own, and must not be cut to 80
            )

    @cached_property
    def units(self) -> "UnitSystem":
        """The units in which quantities are printed: as asked for, else by the settings."""
        from aerodb.storage.catalogue import SETTINGS_FILE
        from aerodb.units import UnitSystem

        if self._units or not (self.root / SETTINGS_FILE).is_file():
            return UnitSystem(self._units or "si")
        from aerodb.storage.workspace_settings import load_settings

        return UnitSystem(load_settings(self.root).show.units)

    def saying(self) -> AbstractContextManager[None]:
        """Context in which views write their sentences in the units shown; with ``--json`` in SI
        units."""
        from aerodb.units import SI, shown_in

        return shown_in(SI if self.as_json else self.units)

    def workspace(self, create: bool = False) -> "Workspace":
        """Return the workspace; InputError if there is none and `create` is false."""
        from aerodb.storage.workspace import Workspace

        workspace = Workspace.open(self.root, create)
        self._agree_to_migration(workspace.catalogue)
        return workspace

    def _agree_to_migration(self, catalogue: Path) -> None:
        """Ask before an earlier version's catalogue is changed; InputError if the answer is no.

        Nobody is asked where nobody can answer: the migration keeps the former catalogue.
        """
        if self._agreed or self.as_json or not (sys.stdin.isatty() and sys.stderr.isatty()):
            return
        from aerodb.storage.catalogue import Catalogue

        try:
            pending = Catalogue.pending_migration(catalogue)
        except AeroError:
            return  # the command itself says what is wrong
        self._agreed = True
        if pending is not None and not typer.confirm(
            f"The catalogue was written by an earlier version of aerodb ({pending[0]}). This"
            f" version changes it ({pending[1]}), and keeps the former one. Go on?",
            err=True,
        ):
            raise InputError(
                "the catalogue stays as it was",
                str(catalogue),
                "use the version of aerodb that wrote it, or answer yes",
            )

    def catalogue(self, create: bool = False) -> "Catalogue":
        """Return the workspace's catalogue."""
        from aerodb.storage.catalogue import Catalogue

        return Catalogue.open(self.workspace(create).catalogue, create)

    def say(self, text: str = "") -> None:
        """Print a line for people; text is never parsed as markup, because names come from logs.

        On a terminal a line that is too long goes on below, unless it has a command, which is to be
        copied as a whole.
        """
        shown = visible(text, keep="\n\t")
        if self.people.is_terminal and len(shown) > self.people.width:
            shown = "\n".join(map(self._wrapped, shown.split("\n")))
        self.people.print(shown, markup=False)

    def _wrapped(self, line: str) -> str:
        room = self.people.width
        if len(line) <= room or "aerodb " in line:
            return line
        hanging = " " * (len(line) - len(line.lstrip()) + 2)
        return textwrap.fill(line, room, subsequent_indent=hanging, **_WHOLE_WORDS)

    def headlines(
        self,
        verdict: str,
        lines: Sequence[tuple[str, str]],
        then: str = "",
        more: Sequence[tuple[str, str]] = (),
    ) -> None:
        """Print the verdict, below it what each label says, what to do next, and `more`.

        lines, more : label (empty: as above) and text; a text that is longer than the terminal
        goes on below its own beginning, and one that is empty is left out. then : the next command,
        which is never divided, so that it can be copied; empty: none.
        """
        labels = [label for label, text in (*lines, ("next", then), *more) if text]
        margin = 4 + max(map(len, labels), default=0)
        for part in textwrap.wrap(
            verdict, self.people.width, subsequent_indent="  ", **_WHOLE_WORDS
        ):
            self.say(part)
        for label, text in (*lines, ("next", then), *more):
            room = max(self.people.width - margin, 40)
            beginning = f"  {label}".ljust(margin)
            parts = textwrap.wrap(text, room, **_WHOLE_WORDS)
            if text is then:
                parts = divided(then, room) if self.people.is_terminal else [then]
            for part in parts if text else ():
                self.say(f"{beginning}{part}")
                beginning = " " * margin

    def fitting(self, text: str, beside: int = 0) -> str:
        """Return `text` cut to one line of the terminal beside so many characters, with ... where
        something is missing."""
        text, width = "; ".join(visible(text, keep="\n").splitlines()), self.people.width - beside
        return text if len(text) <= width else textwrap.shorten(text, width, placeholder=" ...")

    def table(
        self,
        columns: Sequence[str],
        rows: Sequence[Sequence[str]],
        numbers: Sequence[int] = (),
        spare: Sequence[int] = (),
    ) -> None:
        """Print a table for people; columns whose indices are in `numbers` are right-aligned, and
        never cut: where they do not fit side by side, the table is printed in parts.

        spare : indices of columns that a narrow terminal leaves out, the first one first; it says
        so. A table that fits is printed as it is; rich lays out only one whose cells have to be
        divided, which takes a hundred times as long.
        """
        cells = [[visible(cell) for cell in row] for row in rows]
        if self._fits(columns, cells, numbers):
            return
        if self.people.is_terminal and all(len(row) == len(columns) for row in cells):
            self._narrow(columns, cells, numbers, spare)
        else:
            self._laid_out(columns, cells, numbers)

    def _narrow(
        self,
        columns: Sequence[str],
        rows: Sequence[Sequence[str]],
        numbers: Sequence[int],
        spare: Sequence[int],
    ) -> None:
        """Print a table that is wider than the terminal: without spare columns, or in parts."""
        wide = [max(map(cell_len, column)) for column in zip(columns, *rows, strict=True)]
        kept = [k for k in range(len(columns)) if not rows or any(row[k] for row in rows)]
        left_out = []
        for k in spare:
            if k in kept and self._over(wide[each] for each in kept):
                kept.remove(k)
                left_out.append(columns[k])
        least = [
            wide[k] if k in numbers or self._names(k, wide[k]) else min(wide[k], _TEXT)
            for k in range(len(columns))
        ]
        parts = [kept[:1]]
        for k in kept[1:]:
            if self._over(least[each] for each in [*parts[-1], k]):
                parts.append(kept[:1])
            parts[-1].append(k)
        for number, part in enumerate(parts):
            right = [place for place, k in enumerate(part) if k in numbers]
            shown = [[row[k] for k in part] for row in rows]
            if len(parts) > 1:
                shown = [row for row in shown if any(row[1:])]
            if number:
                self.say()
            if not self._fits([columns[k] for k in part], shown, right):
                self._laid_out([columns[k] for k in part], shown, right)
        if left_out:
            self.say(f"not shown on a terminal this narrow: {', '.join(left_out)}")

    def _names(self, k: int, wide: int) -> bool:
        """Whether column k names the rows and is short enough to stay whole."""
        return k == 0 and _NAME * wide <= self.people.width

    def _over(self, widths: Iterable[int]) -> bool:
        """Whether columns of these widths do not fit side by side."""
        held = list(widths)
        return sum(held) + _GAP * (len(held) - 1) > self.people.width

    def _laid_out(
        self, columns: Sequence[str], cells: Sequence[Sequence[str]], numbers: Sequence[int]
    ) -> None:
        """Print a table whose cells have to be divided."""
        grid = Table(box=None, header_style="bold", pad_edge=False)
        for k, column in enumerate(columns):
            wide = max(map(cell_len, (column, *(row[k] for row in cells if k < len(row)))))
            grid.add_column(
                Text(column),
                justify="right" if k in numbers else "left",
                no_wrap=k in numbers or self._names(k, wide),
            )
        for row in cells:
            grid.add_row(*map(Text, row))
        self.people.print(grid)

    def _fits(
        self, columns: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int]
    ) -> bool:
        """Print a table whose rows fit lines of the terminal; return whether they do."""
        if any(len(row) != len(columns) for row in rows):
            return False  # rich fills up what is missing
        plain = "".join(chain(columns, *rows)).isascii()
        width = len if plain else cell_len  # ASCII takes one column a character
        wide = [max(map(width, column)) for column in zip(columns, *rows, strict=True)]
        if sum(wide) + _GAP * (len(wide) - 1) > self.people.width:
            return False

        def line(row: Sequence[str]) -> str:
            cells = []
            for k, cell in enumerate(row):
                room = " " * (wide[k] - width(cell))
                cells.append(room + cell if k in numbers else cell + room)
            return (" " * _GAP).join(cells)

        self.people.print(Text(line(columns), "bold"))
        if rows:
            out = self.people.file
            out.write("\n".join(map(line, rows)) + "\n")
            out.flush()
        return True

    @contextmanager
    def waiting(self, what: str) -> Iterator[None]:
        """Show what is being done while it takes long, if standard error is a terminal."""
        with Console(stderr=True).status(what):
            yield

    def write_page(self, output: Path, page: str, as_pdf: bool = False) -> tuple[Path, int]:
        """Save a page (`save_page`) and say so."""
        written, size = self.save_page(output, page, as_pdf)
        self.say(f"wrote {written} ({size / 1e3:.0f} kB)")
        return written, size

    def save_page(self, output: Path, page: str, as_pdf: bool = False) -> tuple[Path, int]:
        """Write a page (HTML), as PDF where asked for or where the file ends so; return the file
        and its size [bytes]."""
        from aerodb.storage.workspace import write_for_user

        data = page.encode("utf-8")
        if as_pdf or output.suffix.lower() == ".pdf":
            from aerodb.report import pdf

            data = pdf(page)
        written = write_for_user(self.workspace(), output, data)
        return written, len(data)

    def answer(self, document: Any) -> None:
        """Print the JSON document if ``--json`` was given."""
        if self.as_json:
            sys.stdout.write(as_json(document, indent=1) + "\n")

    def run(
        self, body: Any, parameters: dict[str, Any], direct: bool, attended: bool = True
    ) -> Any:
        """Run a flow (`run_flow`), with a progress bar for steps that take longer than two seconds;
        the reports that it writes are in the units of this session."""
        from aerodb.flows.run import run_flow
        from aerodb.storage.workspace_settings import load_settings
        from aerodb.units import shown_in

        workspace = self.workspace(create=True)
        how: How = "direct" if direct or load_settings(workspace.root).work.direct else "auto"
        waited_for = "starting" if how == "direct" else "starting Prefect (not with --direct)"
        with shown_in(self.units), _progress(waited_for) as report:
            return run_flow(body, parameters, workspace, how, report, attended=attended)


def begin_server(context: typer.Context, direct: bool) -> bool:
    """Start Prefect's server while the command still reads its other options: both import for
    seconds, and side by side they take half the time. The command says itself what is wrong."""
    session: Session = context.obj
    if not direct and not context.resilient_parsing:
        from aerodb.flows.prefect_environment import prefect_environment
        from aerodb.storage.workspace import Workspace
        from aerodb.storage.workspace_settings import load_settings

        with suppress(AeroError, OSError):
            root = Workspace.open(session.root, create=False).root
            if not load_settings(root).work.direct:
                context.with_resource(prefect_environment(root))
    return direct


@contextmanager
def _progress(waited_for: str) -> Iterator[Any]:
    """A progress bar on standard error that appears after two seconds; none without a terminal.

    waited_for : what is said until the first step reports.
    """
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        SpinnerColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    console = Console(stderr=True)
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task(waited_for, total=None, visible=False)
        appears = threading.Timer(2.0, lambda: bar.update(task, visible=True))
        appears.daemon = True
        appears.start()

        def report(step: str, done: int, total: int) -> None:
            bar.update(task, description=step, completed=done, total=total)

        try:
            yield report
        finally:
            appears.cancel()
