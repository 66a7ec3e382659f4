"""Maintenance of a workspace: verification, backup and restore.

`verify` compares files, object store and catalogue and gives a `VerificationReport` of `Problem`;
`report_lines` turns it into text. `back_up` copies catalogue and files into a folder, incrementally
if that holds an earlier backup; `restore` makes a new workspace from it and verifies it first.

Modules: `verification` (files against rows), `object_verification` (objects against rows), `audit`
(the catalogue itself), `problems` (the report), `backup`.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
