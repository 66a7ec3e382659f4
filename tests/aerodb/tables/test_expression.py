"""The expression language: evaluation, round trip through text, and rejection of anything else."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodb.errors import InputError
from aerodb.tables.expression import (
    MAX_DEPTH,
    MAX_NESTING,
    Call,
    Expression,
    Name,
    Negation,
    Number,
    Operation,
    TableCall,
    number,
    parse,
)
from aerodb.tables.functions import FUNCTIONS
from aerodb.tables.program import compile_program, evaluate
from aerodb.tables.table import Table

NAMES = st.sampled_from(["alpha", "beta", "q_hat", "S_ref", "_x1", "e1", "sinus"])
NUMBERS = st.floats(min_value=0.0, allow_infinity=False, allow_nan=False).map(
    lambda x: Number(abs(x))
)


def branches(children: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    def call(name: str) -> st.SearchStrategy[Expression]:
        function = FUNCTIONS[name]
        most = function.most or function.least + 2
        return st.lists(children, min_size=function.least, max_size=most).map(
            lambda a: Call(name, tuple(a))
        )

    return st.one_of(
        st.builds(Negation, children),
        st.builds(Operation, st.sampled_from(list("+-*/^")), children, children),
        st.sampled_from(sorted(FUNCTIONS)).flatmap(call),
        st.lists(children, min_size=1, max_size=3).map(lambda a: TableCall("CZ_0", tuple(a))),
    )


TREES = st.recursive(st.one_of(NUMBERS, NAMES.map(Name)), branches, max_leaves=15)


@settings(deadline=None)
@given(TREES)
def test_text_of_a_tree_reads_back_as_the_same_tree(tree: Expression) -> None:
    assert parse(str(tree)) == tree


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2 + 3*4", 14.0),
        ("2 - 3 - 4", -5.0),
        ("16/4/2", 2.0),
        ("2^3^2", 512.0),
        ("-2^2", -4.0),
        ("2**-1", 0.5),
        ("(2 + 3)*-4", -20.0),
        ("--3", 3.0),
        ("+1.5e2 + .5 + 2.", 152.5),
        ("min(3, 1, 2) + max(1, 2, 7)", 8.0),
        ("clip(5, -1, 2) + clip(-5, -1, 2)", 1.0),
        ("step(0) + 2*step(1e-9) + 4*step(-1)", 2.0),
        ("sign(-3) + abs(-2) + sqrt(9)", 4.0),
        ("exp(log(2)) + atan2(0, 1)", 2.0),
        ("asin(sin(0.3)) + acos(cos(0.2)) + atan(tan(0.1))", 0.6),
    ],
)
def test_precedence_and_functions(text: str, expected: float) -> None:
    assert evaluate(parse(text), {}) == pytest.approx(expected, rel=1e-14)


def test_phoenix_rate_factor_on_arrays() -> None:
    """003 eq. 6: ``dCZ_q(alpha) q L_ref / V`` with a linear table."""
    table = Table("dCZq", ("alpha",), (np.array([0.0, 0.2]),), np.array([-1.0, -3.0]))
    alpha, q = np.array([0.0, 0.1, 0.3]), np.array([0.1, 0.2, 0.3])
    tree = parse("dCZq(alpha)*q*c_ref/V")
    assert tree.names == {"alpha", "q", "c_ref", "V"}
    assert tree.tables == {"dCZq"}
    result = evaluate(tree, {"alpha": alpha, "q": q, "c_ref": 6.0, "V": 60.0}, {"dCZq": table})
    assert result == pytest.approx(np.array([-1.0, -2.0, -3.0]) * q * 0.1, rel=1e-14)


def test_each_distinct_part_is_computed_once() -> None:
    calls = []

    class Counting(Table):
        def lookup(self, *arguments):  # type: ignore[no-untyped-def]
            calls.append(arguments)
            return super().lookup(*arguments)

    table = Counting("T", ("x",), (np.array([0.0, 1.0]),), np.array([0.0, 2.0]))
    program = compile_program([parse("T(x + 1) + y"), parse("T(x + 1)*2")], {"T": table})
    first, second = program.run({"x": np.array([-0.5]), "y": 1.0}).values
    assert (first[0], second[0], len(calls)) == (2.0, 2.0, 1)


def test_division_by_zero_gives_inf_and_no_warning() -> None:
    assert evaluate(parse("1/x"), {"x": np.array([0.0, 2.0])}).tolist() == [math.inf, 0.5]


def test_number_of_either_sign() -> None:
    assert str(number(-2.5)) == "-2.5"
    assert parse(str(number(-1e-7))) == number(-1e-7)
    assert number(-0.0) == Number(0.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "unexpected end at position 1"),
        ("2 +", "unexpected end at position 4"),
        ("2 $ 3", "unexpected '$' at position 3"),
        ("alpha.real", "unexpected '.' at position 6"),
        ("__import__('os')", "unexpected ''' at position 12"),
        ("a[0]", "unexpected '[' at position 2"),
        ("a = 1", "unexpected '=' at position 3"),
        ("(1", "expected ')' instead of 'the end' at position 3"),
        ("f(1,)", "unexpected ')' at position 5"),
        ("1 2", "unexpected '2' at position 3"),
        ("atan2(1)", "'atan2' takes 2 argument(s), here 1 at position 1"),
        ("2*sin", "function 'sin' without arguments at position 3"),
        ("1e999", "too large at position 1"),
        ("α", "unexpected 'α' at position 1"),
    ],
)
def test_bad_syntax_is_refused_with_its_position(text: str, message: str) -> None:
    with pytest.raises(InputError) as refusal:
        parse(text)
    assert message in str(refusal.value)


HOSTILE = [
    "(" * 10_000,
    "-" * 10_000 + "1",
    "2^" * 5_000 + "1",
    "sin(" * 3_000,
    "1" + "+1" * 9_000,
    "1" * 30_000,
]


@pytest.mark.parametrize("text", HOSTILE, ids=[text[:4] for text in HOSTILE])
def test_hostile_texts_are_refused_without_exhausting_the_stack(text: str) -> None:
    with pytest.raises(InputError):
        parse(text)


def test_limits_leave_room_for_real_expressions() -> None:
    deep = "(" * (MAX_NESTING - 1) + "1" + ")" * (MAX_NESTING - 1)
    long = " + ".join(["x"] * MAX_DEPTH)
    assert evaluate(parse(deep), {}) == 1.0
    assert evaluate(parse(long), {"x": 1.0}) == MAX_DEPTH


@settings(deadline=None, max_examples=300)
@given(st.text(alphabet="ab1.e+-*/^(), \n$", max_size=40))
def test_any_text_parses_or_is_refused(text: str) -> None:
    try:
        tree = parse(text)
    except InputError:
        return
    assert parse(str(tree)) == tree


def test_missing_value_and_unknown_table_are_named() -> None:
    with pytest.raises(InputError, match="no value for beta"):
        evaluate(parse("alpha*beta"), {"alpha": 1.0})
    with pytest.raises(InputError, match=r"no table or function 'CZO'\ndid you mean 'CZ0'"):
        evaluate(
            parse("CZO(1)"),
            {},
            {"CZ0": Table("CZ0", ("x",), (np.array([0.0, 1.0]),), np.array([0.0, 1.0]))},
        )


def test_comparisons_and_pieces() -> None:
    """True is 1; a condition on what is not a number stays visible; comparisons bind less than
    sums."""
    a = np.array([-3.0, 0.0, 5.0, np.nan])
    found = evaluate(parse("piecewise(-2, a < -2, b, a >= b + 1, a)"), {"a": a, "b": 2.0})
    assert np.array_equal(found, [-2.0, 0.0, 2.0, np.nan], equal_nan=True)
    assert np.array_equal(
        evaluate(parse("piecewise(1, a == 0)"), {"a": a}),
        [np.nan, 1.0, np.nan, np.nan],
        equal_nan=True,
    )
    assert np.array_equal(
        evaluate(parse("and(a > -5, a < 1) + 10*or(a < -1, a > 4) + 100*not(a)"), {"a": a}),
        [11.0, 101.0, 10.0, np.nan],
        equal_nan=True,
    )


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("root(-8, 3)", -2.0),
        ("root(16, 4)", 2.0),
        ("rem(-7, 3)", -1.0),
        ("log10(1000)", 3.0),
        ("asinh(sinh(0.7))", 0.7),
        ("ceil(1.2) + floor(-1.2)", 0.0),
        ("(1 < 2) + (2 <= 1) + (1 != 2)", 2.0),
    ],
)
def test_functions_of_daveml(text: str, value: float) -> None:
    assert float(evaluate(parse(text), {})) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    "text", ["a < b", "(a < b) < c", "-(a >= b)^2", "not(a != b + 1)", "(a == b)*2 - 1", "lt(a, b)"]
)
def test_comparisons_are_printed_as_they_are_read(text: str) -> None:
    assert parse(str(parse(text))) == parse(text)


@pytest.mark.parametrize("text", ["a < b < c", "a = b", "a <", "and(a)", "piecewise(a)", "!a"])
def test_what_is_no_comparison_is_refused(text: str) -> None:
    with pytest.raises(InputError):
        parse(text)
