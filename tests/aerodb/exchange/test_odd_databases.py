"""Databases at the edge of what can be written: without inputs, on scattered points, of one node.
Whatever is asked of them is answered, or refused as InputError with a reason, never by accident."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aerodb.errors import AeroError, InputError
from aerodb.exchange import (
    check_file,
    export_csv,
    export_daveml,
    export_jsbsim,
    export_mat,
    export_netcdf,
    from_document,
    import_csv,
    import_daveml,
    import_jsbsim,
    import_mat,
    import_netcdf,
    input_properties,
    jsbsim_check_cases,
    to_document,
)
from aerodb.increments import sign_reasons, with_extrapolated_slopes
from aerodb.tables import (
    AeroDatabase,
    ScatteredTable,
    Table,
    Term,
    Variable,
    consolidate,
    evaluate_database,
    failed_check_cases,
    make_check_cases,
    parse,
    plan_consolidation,
)
from tests.support.generated_databases import generated

SCATTERED = ScatteredTable(
    "S",
    ("alpha", "mach"),
    np.array([[0, 0.1], [0.1, 0.1], [0.1, 0.2], [0, 0.25]]),
    np.arange(4.0),
)
NODE = Table("T", ("alpha",), (np.array([0.0]),), np.array([1.0]))


def database(axis: str = "CX", text: str = "0.1", **more: Any) -> AeroDatabase:
    return AeroDatabase(
        "odd",
        generated(1).reference,
        more.pop("variables", {}),
        more.pop("tables", {}),
        (Term("a", axis, parse(text)),),
        **more,
    )


ODD = {
    "no inputs": database(),
    "no inputs in wind axes": database("C_lift"),
    "no terms": replace(database(), terms=()),
    "a constant variable": database(text="2*k", variables={"k": Variable(parse("3"), "1")}),
    "lengths only": database(text="c_ref/b_ref"),
    "scattered": database(text="S(alpha, mach)", scattered={"S": SCATTERED}),
    "scattered, in a variable": database(
        text="k",
        variables={"k": Variable(parse("2*S(alpha, mach)"), "1")},
        scattered={"S": SCATTERED},
    ),
    "scattered, at constants": database(text="S(0.05, 0.15)", scattered={"S": SCATTERED}),
    "scattered, not used": database(scattered={"S": SCATTERED}),
    "one node": database(text="T(alpha)", tables={"T": NODE}),
    "a table at a constant": database(text="T(0.1)", tables={"T": NODE}),
    "a table that is not used": database(tables={"T": NODE}),
    "a free input only": database(text="free", free_inputs={"free": "a number"}),
    "a rate only": database("Cm", "q_hat"),
    "infinite at a point": database(text="1/alpha"),
    "never a number": database(text="sqrt(0 - 1)"),
    **{f"generated {seed}": generated(seed) for seed in (2, 5)},
}


def through_jsbsim(odd: AeroDatabase) -> object:
    xml = export_jsbsim(odd, name="odd", cases=jsbsim_check_cases(odd))
    checks = check_file(xml, "odd.xml", import_jsbsim(xml, name="odd"))
    assert checks.passed, checks.failures
    return checks


def through_daveml(odd: AeroDatabase) -> object:
    xml = export_daveml(odd)
    checks = check_file(xml, "odd.dml", import_daveml(xml, name="odd"))
    assert checks.passed, checks.failures
    return checks


ASKED: dict[str, Callable[[AeroDatabase], object]] = {
    "csv": lambda odd: import_csv(export_csv(odd)),
    "mat": lambda odd: import_mat(export_mat(odd)),
    "netcdf": lambda odd: import_netcdf(export_netcdf(odd)),
    "daveml": through_daveml,
    "jsbsim": through_jsbsim,
    "document": lambda odd: from_document(to_document(odd)),
    "check cases": lambda odd: failed_check_cases(odd, make_check_cases(odd)),
    "cases for jsbsim": jsbsim_check_cases,
    "properties": input_properties,
    "consolidation": lambda odd: (plan_consolidation(odd), consolidate(odd)),
    "evaluation": lambda odd: evaluate_database(odd, {n: np.full(5, 0.1) for n in odd.inputs}),
    "at numbers": lambda odd: odd.predict(dict.fromkeys(odd.inputs, 0.1)),
    "signs": lambda odd: sign_reasons(odd, odd),
    "slopes": with_extrapolated_slopes,
}


@pytest.mark.parametrize("name", ODD)
def test_every_question_is_answered_or_refused(name: str) -> None:
    for ask in ASKED.values():
        try:
            ask(ODD[name])
        except AeroError as error:
            assert error.what  # noqa: PT017


def test_scattered_points_have_no_jsbsim_table_and_the_refusal_says_so() -> None:
    assert len(jsbsim_check_cases(ODD["scattered"])) == 20
    with pytest.raises(InputError, match="table 'S' on scattered points has no equivalent"):
        through_jsbsim(ODD["scattered"])


def test_a_database_without_inputs_has_one_value_everywhere() -> None:
    again = import_jsbsim(export_jsbsim(ODD["no inputs"], name="o", cases=()), name="o")
    assert ODD["no inputs"].inputs == ()
    assert again.inputs == ()
    assert again.predict({}).coefficients["CX"] == pytest.approx([0.1])
