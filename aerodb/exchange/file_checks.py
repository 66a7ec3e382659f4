"""Outcome of the check cases that a database file brings along: does the import give its numbers?

DAVE-ML files hold static shots (AIAA S-119), exports of this product to JSBSim a ``<check_cases>``
element. CSV, MAT and NetCDF files are tested while they are read and refused if they fail.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.errors import AeroError, InputError
from aerodb.exchange.daveml import SignalEvaluator, is_daveml, read_check_cases, verify_cases
from aerodb.exchange.jsbsim import read_jsbsim_cases
from aerodb.nomenclature import AXES
from aerodb.support import Array
from aerodb.tables import AeroDatabase, TableCall, failed_check_cases, table_calls

_LISTED: Final = 20


@dataclass(frozen=True)
class FileChecks:
    """What came of the check cases of a file.

    cases, values : how many, and how many numbers were compared. failed : how many numbers are
    beyond their tolerance. failures : a sentence for each of the first of them. reached, nodes :
    nodes of gridded tables on which a case bears, and all of them.
    """

    cases: int
    values: int
    failed: int
    failures: tuple[str, ...]
    reached: int = 0
    nodes: int = 0

    @property
    def passed(self) -> bool:
        return self.failed == 0

    def __str__(self) -> str:
        if not self.cases and self.passed:
            return "the file has no check cases: nothing shows that its numbers are as intended"
        if self.passed:
            return (
                f"{self.cases} check cases of the file pass ({self.values} numbers); they bear on"
                f" {self.reached} of {self.nodes} breakpoints of its tables"
            )
        return (
            f"{self.failed} of {self.values} numbers in the {self.cases} check cases of the file"
            " differ"
        )


def check_file(data: bytes, name: str, database: AeroDatabase) -> FileChecks:
    """Compare a database with the check cases of the XML file (DAVE-ML or JSBSim, in its own units)
    it was imported from.

    data : content of the file. name : of the file. Cases that cannot be read (an `AeroError`) count
    as one failure, and raise nothing.
    """
    try:
        return _daveml(data, name, database) if is_daveml(data) else _jsbsim(data, name, database)
    except AeroError as error:
        return FileChecks(1, 1, 1, (f"the check cases cannot be evaluated: {error.what}",))


def _daveml(data: bytes, name: str, database: AeroDatabase) -> FileChecks:
    cases = read_check_cases(data, name=name)
    results = verify_cases(database, cases)
    failures = [f"{each.name}: {text}" for each in results for text in each.failures]
    values = sum(each.internals + each.outputs for each in results)
    calls = table_calls(database)
    signals = SignalEvaluator(database, [x for call in calls for x in call.arguments])
    given = [{signal.identity: signal.value for signal in case.inputs} for case in cases]
    reached = _reached(database, calls, [signals.values_of(each) for each in given])
    return FileChecks(
        len(results), values, len(failures), tuple(failures[:_LISTED]), reached, _nodes(database)
    )


def _jsbsim(data: bytes, name: str, database: AeroDatabase) -> FileChecks:
    cases = read_jsbsim_cases(data, name)
    if not cases:
        return FileChecks(0, 0, 0, ())
    settled = {state.name for state in database.states}
    lacking = sorted(set(database.inputs) - set(cases[0].inputs) - settled)
    if lacking:
        raise InputError(f"they do not give {', '.join(lacking)}", name)
    failures = failed_check_cases(database, cases)
    calls = table_calls(database)
    program = database.compiled(
        [x for call in calls for x in call.arguments],
        {key: variable.expression for key, variable in database.variables.items()},
        {**database.tables, **database.scattered},
    )
    points = [
        [float(np.ravel(x)[0]) for x in program.run(values).values]
        for case in cases
        for values in [database.resolved(program.inputs, case.inputs)]
    ]
    return FileChecks(
        len(cases),
        len(cases) * len(AXES),
        len(failures),
        failures[:_LISTED],
        _reached(database, calls, points),
        _nodes(database),
    )


def _nodes(database: AeroDatabase) -> int:
    return sum(table.values.size for table in database.tables.values())


def _reached(
    database: AeroDatabase, calls: Sequence[TableCall], points: Sequence[Sequence[float]]
) -> int:
    """Number of nodes of gridded tables that have a weight at one of the points.

    points : per case, the values of all arguments of `calls`, in order.
    """
    marks = {
        name: np.zeros(table.values.shape, dtype=bool) for name, table in database.tables.items()
    }
    for point in points:
        first = 0
        for call in calls:
            values = point[first : first + len(call.arguments)]
            first += len(call.arguments)
            if call.table in marks:
                axes = database.tables[call.table].breakpoints
                near = [_neighbours(axis, x) for axis, x in zip(axes, values, strict=True)]
                marks[call.table][np.ix_(*near)] = True
    return sum(int(mark.sum()) for mark in marks.values())


def _neighbours(axis: Array, value: float) -> list[int]:
    """Indices of the breakpoints between which a value lies; one where it is a breakpoint, or
    outside."""
    right = int(np.searchsorted(axis, value))
    if right == axis.size or right == 0 or axis[right] == value:
        return [min(right, axis.size - 1)]
    return [right - 1, right]
