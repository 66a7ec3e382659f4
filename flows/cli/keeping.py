"""``aerodb verify``, ``backup`` and ``restore``: integrity checks and copies, while others work."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session
from aerodb.support import counted


def verify(
    context: typer.Context,
    fetch: Annotated[
        bool,
        typer.Option(
            "--fetch", help="Also read every object of the object store; default: check sizes only."
        ),
    ] = False,
    chain: Annotated[
        str, typer.Option(help="Hash that an earlier verification gave as the end of the chain.")
    ] = "",
) -> None:
    """Verify every file, reference and identity of the workspace; exits with 1 if there is a
    problem.

    Example: aerodb verify
    """
    # Imported here, and below, because a query must not wait for the science to import.
    from aerodb.storage import upkeep

    session: Session = context.obj
    workspace = session.workspace()
    with session.waiting("verifying"), session.catalogue() as catalogue:
        report = upkeep.verify(workspace, catalogue, fetch, chain)
    words = upkeep.problem_words(report)
    told = counted(len(words), "problem") if words else "no problems"
    session.headlines(
        f"{session.root.name}: {told}",
        [("first", words[0] if words else ""), ("checked", upkeep.counted(report))],
        "" if words else "aerodb backup FOLDER",
        [("chain", report.chain)],
    )
    for line in words[1:]:
        session.say(line)
    problems = [asdict(problem) for problem in report.problems]
    session.answer(
        {
            "clean": not problems,
            "checked": report.checked,
            "pending": report.pending,
            "chain": report.chain,
            "problems": problems,
        }
    )
    if problems:
        raise typer.Exit(1)


def backup(
    context: typer.Context,
    target: Annotated[
        Path,
        typer.Argument(
            help="A new folder, or an earlier backup, to which only new files are copied."
        ),
    ],
) -> None:
    """Copy catalogue and store consistently while others may write; exits with 1 if a file is
    damaged.

    Example: aerodb backup /mnt/backup/aerodb
    """
    from aerodb.storage.upkeep import back_up

    session: Session = context.obj
    workspace = session.workspace()
    with session.waiting("copying"):
        outcome = back_up(workspace, target)
    n = len(outcome.problems)
    session.headlines(
        f"{target.name} is {f'INCOMPLETE: {n} not copied' if n else 'a complete backup'}:"
        f" {outcome.files} files, {outcome.bytes / 1e6:.1f} MB",
        [
            ("copied", f"{outcome.copied} files that were not in it yet"),
            ("hash", outcome.sha256),
        ],
        f"aerodb restore {target} --workspace restored --sha256 HASH",
        [("note", "keep the hash elsewhere: it tells this backup from another")],
    )
    for problem in outcome.problems:
        session.say(f"not copied: {problem.where}: {problem.what}; {problem.remedy}")
    session.answer({"target": str(target), **asdict(outcome)})
    if outcome.problems:
        raise typer.Exit(1)


def restore(
    context: typer.Context,
    source: Annotated[Path, typer.Argument(help="The folder that `aerodb backup` wrote.")],
    workspace: Annotated[
        Path | None, typer.Option(help="The new workspace; it must not exist yet.")
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(help="Settings to use instead of the backup's; they may name a database."),
    ] = None,
    sha256: Annotated[
        str, typer.Option(help="Hash that `aerodb backup` gave; another backup is refused.")
    ] = "",
) -> None:
    """Restore a workspace from a backup, and verify it; exits with 1 if a file was damaged in the
    backup. Settings of the backup that run commands or connect elsewhere are shown and left off.

    Example: aerodb restore /mnt/backup/aerodb --workspace restored
    """
    from aerodb.storage.upkeep import restore as restored

    session: Session = context.obj
    root = workspace or session.root
    if settings is not None and not settings.is_file():
        raise InputError(
            "no such file", str(settings), "name a settings.toml for the new workspace"
        )
    with session.waiting("copying and verifying"):
        manifest = restored(source, root, settings, sha256)
    for problem in manifest["problems"]:
        session.say(
            f"not as stored when it was backed up: {problem['where']}: {problem['what']};"
            f" {problem['remedy']}"
        )
    session.say(
        f"{root} is the workspace of {manifest['made_utc']}: {manifest['files']} files, verified"
    )
    for each in manifest["left_off"]:
        session.say(f"left off until you confirm it: {each}")
    if manifest["left_off"]:
        session.say(f"to confirm: copy {source / 'settings.toml'} to {root / 'settings.toml'}")
    if not sha256:
        session.say(
            "nothing says yet that this backup is yours: compare its hash with the one that `aerodb"
            f" backup` gave, {manifest['sha256']}"
        )
    session.answer({"workspace": str(root), **manifest})
    if manifest["problems"]:
        raise typer.Exit(1)
