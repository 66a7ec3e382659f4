"""Questions of an import on a terminal: all of a file's open inputs in one go, with the proposed
bindings as defaults."""

import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session, visible

_BINDING = re.compile(r"\s+--bind (?P<name>[^=]+)=(?P<rest>.*)")
#: Words that stand for what only the user knows.
_BLANKS = ("FACTOR", "EXPRESSION")


@dataclass(frozen=True)
class Question:
    """What is open about an input, its name in the file, and the expressions proposed for it, each
    with the case in which it is right."""

    text: str
    name: str
    proposals: tuple[tuple[str, str], ...]

    @property
    def default(self) -> str | None:
        """The first proposal that can be taken as it is."""
        fit = (text for text, _ in self.proposals if not any(word in text for word in _BLANKS))
        return next(fit, None)


def can_ask(session: Session) -> bool:
    """Return whether somebody sits at a terminal, and no program waits for a document."""
    return not session.as_json and sys.stdin.isatty() and sys.stderr.isatty()


def questions_of(lines: Sequence[str]) -> Iterator[Question]:
    """Yield the questions in lines of `aerodb.errors.OpenQuestionsError`.

    >>> next(questions_of(["- which sign?", "  --bind b=beta   if like beta", "  --bind b=0"]))
    Question(text='which sign?', name='b', proposals=(('beta', 'if like beta'), ('0', '')))
    """
    text, found = "", list[tuple[str, str, str]]()
    for line in [*lines, "- "]:
        binding = _BINDING.fullmatch(line)
        if binding is not None:
            expression, _, case = binding["rest"].partition("   ")
            found.append((binding["name"], expression.strip(), case.strip()))
        elif line.startswith("- "):
            if found:
                yield Question(text, found[0][0], tuple(each[1:] for each in found))
            text, found = line[2:], []


def ask(lines: Sequence[str]) -> dict[str, str]:
    """Ask every question; returns input -> the expression that it is bound to."""
    questions = list(questions_of(lines))
    typer.echo(
        f"{len(questions)} input{'' if len(questions) == 1 else 's'} of the file must be bound;"
        " Enter takes what is in brackets, Ctrl-C imports nothing.",
        err=True,
    )
    return {question.name: _answer(question) for question in questions}


def _answer(question: Question) -> str:
    typer.echo(f"\n{visible(question.text)}", err=True)
    for expression, case in question.proposals:
        typer.echo(f"  {visible(f'{expression}   {case}'.rstrip())}", err=True)
    while True:
        given = str(typer.prompt(visible(question.name), default=question.default, err=True))
        if fault := _fault(given):
            typer.echo(visible(fault), err=True)
        else:
            return given.strip()


def _fault(expression: str) -> str:
    """Return why a text is no expression; empty if it is one."""
    from aerodb.tables import parse  # help must not wait for it

    if any(word in expression for word in _BLANKS):
        return "write a number in place of the word in capitals"
    try:
        parse(expression)
    except InputError as error:
        return error.what
    return ""
