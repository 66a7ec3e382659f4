"""Maintenance of a workspace: verification, backup and restore.

`verify` compares files, object store and catalogue and gives a `VerificationReport` of
`WorkspaceProblem`; `problem_words` and `counted` turn it into text. `back_up` copies catalogue and
files into a folder, incrementally if that holds an earlier backup; `restore` makes a new workspace
from it and verifies it first.

Modules: `verification` (files against rows), `object_verification` (objects against rows), `audit`
(the catalogue itself), `problems` (the report), `backup`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .backup import back_up, restore
    from .problems import VerificationReport, WorkspaceProblem, counted, problem_words
    from .verification import verify

__getattr__, __dir__, __all__ = attach(__name__, __file__)
