"""The comparison of an exported aircraft file with its database, inside JSBSim in another process:
``python -m aerodb.storage.writers.jsbsim_process``.

JSBSim keeps one logger per thread, which calls Python while the thread ends and aborts the whole
process, and its C++ code reads a file that users influence. So it never runs in a process that
serves others. The process gets one job (JSON) on standard input and answers with one document.
"""

import base64
import json
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from typing import Any, Final

from aerodb.errors import AeroError, InputError, StoreError
from aerodb.exchange import (
    JsbsimAgreement,
    check_in_jsbsim,
    from_document,
    input_properties,
    to_document,
)
from aerodb.storage.confined_environment import confined_environment
from aerodb.storage.confinement import confine, how_it_ended, subordinate
from aerodb.storage.limits import Limits
from aerodb.storage.writers.jsbsim_executive import loaded_in_jsbsim
from aerodb.tables import AeroDatabase, CheckCase

_WHERE: Final = "check of an export in JSBSim"
_REMEDY: Final = "nothing was written; raise [limits] in the workspace settings, or report it"
#: Each process takes a core and some hundred megabytes; further ones wait.
_turns: Final = threading.BoundedSemaphore(os.cpu_count() or 1)


def agreement_in_jsbsim(
    database: AeroDatabase, xml: bytes, cases: Sequence[CheckCase], limits: Limits
) -> JsbsimAgreement:
    """`check_in_jsbsim` of the exported file `xml`, in another process under `limits`.

    Raises InputError when JSBSim cannot load or run the file, exceeds the limits or crashes, and
    StoreError when the process cannot be started.
    """
    job = {
        "database": to_document(database),
        "xml": base64.b64encode(xml).decode("ascii"),
        "cases": [[dict(case.inputs), dict(case.coefficients)] for case in cases],
        "limits": limits.model_dump(),
    }
    with _turns:
        answer = _answer(json.dumps(job).encode("ascii"), limits)
    if answer.pop("ended") == "refused":
        raise InputError(**answer)
    reached, followed = tuple(answer["reached"]), tuple(answer["followed"])
    return JsbsimAgreement(answer["cases"], answer["errors"], reached, followed)


def _answer(job: bytes, limits: Limits) -> dict[str, Any]:
    command, late = [sys.executable, "-P", "-m", __name__], False
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=confined_environment(),
            start_new_session=True,
        )
    except OSError as error:
        what = f"the process for JSBSim cannot be started: {error.strerror or error}"
        raise StoreError(what, _WHERE, "check memory and open files, then try again") from error
    with process:
        try:
            reply, _ = process.communicate(job, limits.wall)
        except subprocess.TimeoutExpired:
            reply, late = b"", True
        finally:
            process.kill()
    if reply.endswith(b"\n"):
        answer: dict[str, Any] = json.loads(reply)
        return answer
    ended = how_it_ended(process.returncode, late, limits, "it", "JSBSim")
    raise InputError(ended, _WHERE, _REMEDY)


def main() -> None:
    """Run the job on standard input, and write its answer."""
    # What JSBSim prints must not be mixed with the answer.
    answers = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)
    job = json.loads(sys.stdin.buffer.read())
    subordinate()
    confine(Limits(**job["limits"]), for_good=True)
    answers.write(json.dumps(_compared(job)) + "\n")
    answers.flush()
    # Without the end of the interpreter, in which JSBSim's logger would be called once more.
    os._exit(0)


def _compared(job: dict[str, Any]) -> dict[str, Any]:
    try:
        database = from_document(job["database"])
        cases = [CheckCase(inputs, coefficients) for inputs, coefficients in job["cases"]]
        executive = loaded_in_jsbsim(base64.b64decode(job["xml"]))
        agreement = check_in_jsbsim(database, executive, cases, input_properties(database))
    except AeroError as error:
        return {
            "ended": "refused",
            "what": error.what,
            "where": error.where,
            "remedy": error.remedy,
        }
    except MemoryError:
        what = f"it needs more than {job['limits']['memory'] / 1e6:.0f} MB of memory"
        return {"ended": "refused", "what": what, "where": _WHERE, "remedy": _REMEDY}
    return {
        "ended": "done",
        "cases": agreement.cases,
        "errors": agreement.errors,
        "reached": agreement.reached,
        "followed": agreement.followed,
    }


if __name__ == "__main__":
    main()
