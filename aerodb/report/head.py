"""The head of a page: where its result comes from."""

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True)
class Head:
    """When a result was made, by whom, with which version of the program, and in which workspace
    (its folder) or from which files. Empty text: not recorded."""

    made: datetime
    author: str
    program: str
    workspace: str
    files: tuple[str, ...] = ()
