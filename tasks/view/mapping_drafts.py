"""Mappings that are drafted for logs of any format; nothing is stored."""

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from aerodb.errors import InputError
from aerodb.logs import MappingDraft, choose_mapping, draft_mapping
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.workspace_settings import load_settings
from aerodb.tasks.workers import parsed_log


@contextmanager
def drafted_mapping(
    log: Path, workspace: Path, name: str = ""
) -> Iterator[tuple[MappingDraft, Recording]]:
    """Parse a log under the limits of a workspace (its folder), and draft a mapping for it.

    name : of the log; '' is that of the file. Raises InputError for a log that cannot be read.
    """
    stem = Path(name or log.name).stem
    short = re.sub(r"[^a-z0-9_-]", "-", stem.lower())[:60].lstrip("-_") or "log"
    limits = load_settings(workspace).limits
    with (
        tempfile.TemporaryDirectory(prefix="aerodb-") as folder,
        parsed_log(log, Path(folder) / "topics", limits) as parsed,
    ):
        recording = parsed.recording
        try:
            known = choose_mapping(recording, builtin_mappings().values())
        except InputError:  # none fits, or several do
            known = None
        yield draft_mapping(recording, short, known), recording
