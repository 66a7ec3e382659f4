"""Questions of an import on a terminal: all of a file's open inputs in one go, with the proposed
bindings as defaults."""

import sys
from collections.abc import Sequence

import typer

from aerodb.errors import InputError, Question
from aerodb.flows.cli.output import Session, visible
from aerodb.support import counted

#: Words that stand for what only the user knows.
_BLANKS = ("FACTOR", "EXPRESSION", "NUMBER")


def can_ask(session: Session) -> bool:
    """Return whether somebody sits at a terminal, and no program waits for a document."""
    return not session.as_json and sys.stdin.isatty() and sys.stderr.isatty()


def ask(questions: Sequence[Question]) -> dict[str, str]:
    """Ask every question; returns input -> the expression that it is bound to."""
    typer.echo(
        f"{counted(len(questions), 'input')} of the file must be bound;"
        " Enter takes what is in brackets, Ctrl-C imports nothing.",
        err=True,
    )
    return {question.name: _answer(question) for question in questions}


def _answer(question: Question) -> str:
    fit = (text for text, _ in question.proposals if not any(word in text for word in _BLANKS))
    default = next(fit, None)
    typer.echo(f"\n{visible(question.text)}", err=True)
    for expression, case in question.proposals:
        typer.echo(f"  {visible(f'{expression}   {case}'.rstrip())}", err=True)
    while True:
        given = str(typer.prompt(visible(question.name), default=default, err=True))
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
