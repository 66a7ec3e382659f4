"""Groups of commands: their list in sections, with whole sentences, and options that may stand
anywhere."""

from typing import Any, Final

from typer.core import TyperGroup

#: Command -> section of the list of commands, in order.
SECTIONS: Final[dict[str, tuple[str, ...]]] = {
    "First steps": ("demo", "vehicle", "mapping", "log"),
    "Flights": ("flight", "calibration", "recalibrate", "estimate", "estimate-online"),
    "Databases and versions": ("database", "version", "update", "close-loop", "derivatives"),
    "Reports and console": ("report", "web", "status", "schema"),
    "Service": ("serve", "nightly", "retry", "dismiss", "store", "user"),
    "Upkeep": ("verify", "backup", "restore"),
}
#: Options of the program that are also taken behind a command: those alone, and those with a value.
_ANYWHERE: Final = ("--json",)
_WITH_VALUE: Final = ("--units",)


class Commands(TyperGroup):
    """A group whose list of commands shows the whole first sentence of each."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands in their sections; those in none come last, under Commands."""
        left = {name: self.commands[name] for name in self.list_commands(ctx)}
        sections = [
            (title, [name for name in names if name in left]) for title, names in SECTIONS.items()
        ]
        if ctx.parent is not None:
            sections = []
        listed = {name for _, names in sections for name in names}
        sections.append(("Commands", [name for name in left if name not in listed]))
        for title, names in sections:
            rows = [(name, _sentence(left[name].help or "")) for name in names]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


class RootCommands(Commands):
    """The program: its own options may also stand behind a command."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Move the options that may stand anywhere to the front; what follows ``--`` stays."""
        end = args.index("--") if "--" in args else len(args)
        front, rest, words = dict[str, None](), list[str](), iter(args[:end])
        valued: list[str] = []
        for word in words:
            if word in _ANYWHERE:
                front[word] = None
            elif word in _WITH_VALUE:
                valued += [word, *([value] if (value := next(words, None)) is not None else [])]
            elif word.startswith(tuple(f"{name}=" for name in _WITH_VALUE)):
                valued.append(word)
            else:
                rest.append(word)
        moved: Any = super().parse_args(ctx, [*front, *valued, *rest, *args[end:]])
        return list(moved)


def _sentence(text: str) -> str:
    """The first paragraph of a help text, in one line.

    >>> _sentence("List versions,\\noldest first.\\n\\nExample: x")
    'List versions, oldest first.'
    """
    return " ".join(text.strip().split("\n\n", 1)[0].split())
