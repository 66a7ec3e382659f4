"""``aerodb estimate`` and ``aerodb update --method``: methods beside each other, by command."""

from pathlib import Path

import pytest

from aerodb.flows.cli.estimating import _known_best
from aerodb.identification import METHODS
from tests.support.command import aerodb, asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import MODEL, NAME, TRUTH

LINEAR = """
[state_space]
states = ["alpha"]
inputs = ["delta_elevator", "q"]
outputs = ["alpha"]
a = [["Za"]]
b = [["Zd", 1]]
c = [[1]]
state_bias = ["Z0"]
initial = ["alpha"]
own = ["Z0"]
[[parameter]]
name = "Za"
value = -1.0
"""


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    root = tmp_path_factory.mktemp("estimate") / "w"
    shared.ingested(root)
    (root.parent / "model.toml").write_text(MODEL)
    return root


def _estimated(root: Path, *options: str) -> dict:
    model = str(root.parent / "model.toml")
    return asked(root, "estimate", "--vehicle", NAME, "--model", model, *options)


@pytest.mark.parametrize("method", [m.name for m in METHODS.values() if not m.display])
def test_each_method_finds_what_was_planted(root: Path, method: str) -> None:
    """The slopes of the increments lie within four standard errors of what was flown, or the
    method says why it gives none."""
    document = _estimated(root, "--method", method)
    (answer,) = document["methods"]
    if "reason" in answer:
        # The glider's logs have no attitude: nothing can be flown, and the answer says so.
        assert METHODS[method].kind == "dynamic"
        assert "phi" in answer["reason"]
        assert "theta" in answer["reason"]
        return
    found = {each["name"]: each for each in answer["estimates"]}
    for axis, terms in TRUTH.items():
        for term, truth in terms.items():
            if term != "1":
                each = found[f"{axis}_{term}"]
                assert each["standing"] == "estimated", each
                assert abs(each["value"] - truth) < 4 * each["standard_error"], each


def test_all_methods_stand_beside_each_other(root: Path) -> None:
    document = _estimated(root, "--methods", "all")
    given = [each["method"] for each in document["methods"] if "reason" not in each]
    assert document["believe"] in given
    for row in document["parameters"]:
        assert set(row["estimates"]) <= set(given)
        if len(row["estimates"]) > 1:
            assert row["agree"] == (row["spread"] <= 2.0)
            assert set(row["furthest"]) <= set(given)
    again = _estimated(root, "--methods", "all")
    assert again == document  # stored under its key


def test_without_a_database_the_derivatives_are_whole(root: Path) -> None:
    increments, whole = (
        {e["name"]: e["value"] for e in _estimated(root, *given)["methods"][0]["estimates"]}
        for given in ((), ("--baseline", "none"))
    )
    assert increments["CX_alpha"] + 0.4 == pytest.approx(whole["CX_alpha"], abs=1e-9)
    assert whole["CX_0"] == pytest.approx(increments["CX_0"] - 0.03, abs=1e-9)


def test_an_unknown_method_is_refused_with_the_nearest_name(root: Path) -> None:
    model = str(root.parent / "model.toml")
    given = ("estimate", "--vehicle", NAME, "--model", model, "--method", "regresion")
    refused = aerodb(root, *given)
    assert refused.returncode == 3
    assert "did you mean 'regression'?" in refused.stderr


def test_the_report_names_estimates_and_what_the_method_assumes(root: Path) -> None:
    model = str(root.parent / "model.toml")
    told = aerodb(root, "estimate", "--vehicle", NAME, "--model", model, "--report")
    assert told.returncode == 0, told.stderr
    assert "[[estimates]]" in told.stdout
    assert "[[assumes]]" in told.stdout
    for line in ("CZ_alpha", "CX_alpha"):
        assert any(
            text.strip().startswith(line) and "+-" in text for text in told.stdout.splitlines()
        )


def test_what_is_known_best_stands_first_with_half_of_its_interval(root: Path) -> None:
    model = str(root.parent / "model.toml")
    given = ("estimate", "--vehicle", NAME, "--model", model)
    (method,) = asked(root, *given)["methods"]
    known = [each for each in method["estimates"] if each["standard_error"]]
    best = max(known, key=lambda each: abs(each["value"]) / each["standard_error"])
    second = aerodb(root, *given).stdout.splitlines()[1]
    said = f"{best['name']} {best['value']:.4g} +- {1.96 * best['standard_error']:.2g}"
    assert second.split(maxsplit=2) == ["known", "best", said]


def test_where_a_record_began_is_not_what_is_known_best() -> None:
    """A first airspeed is known to a ten-thousandth of itself, and tells nothing of the aircraft."""
    estimates = [
        {"name": "initial_V[one#1]", "value": 50.0, "standard_error": 0.005},
        {"name": "tail_slope", "value": 3.8, "standard_error": 0.01},
        {"name": "fin_slope", "value": 3.0, "standard_error": 0.02},
    ]
    given = [{"method": "output-error", "estimates": estimates}]
    assert _known_best(given, "output-error") == "tail_slope 3.8 +- 0.02"
    assert _known_best(given, "regression") == ""


def test_a_linear_model_of_a_file_is_fitted(root: Path) -> None:
    """The short period's angle of attack as a first-order lag of the elevator: what its matrices
    are is said by output error and by equation error."""
    file = root.parent / "linear.toml"
    file.write_text(LINEAR)
    given = ("estimate", "--vehicle", NAME, "--model", str(file))
    document = asked(root, *given, "--method", "output-error", "--method", "regression")
    error, regression = document["methods"]
    assert {"Za", "Zd"} <= {each["name"] for each in regression["estimates"]}
    found = {each["name"]: each for each in error["estimates"]}
    assert {"Za", "Zd", "Z0"} <= {name.split("[")[0] for name in found}
    assert all(each["standing"] for each in error["estimates"])
    file.write_text(LINEAR.replace("Zd", "Zd*Zd"))
    refused = aerodb(root, *given)
    assert refused.returncode == 3
    assert "no sum of parameters" in refused.stderr


def test_a_candidate_by_another_method_passes_through_the_same_update(root: Path) -> None:
    """The candidate holds the method's estimates, remembers the method, and `--like` repeats it."""
    model = str(root.parent / "model.toml")
    given = ("update", "--vehicle", NAME, "--direct", "--hold-out", "none")
    made = asked(root, *given, "--model", model, "--method", "frequency-domain")
    plain = asked(root, *given, "--model", model)
    assert (made["method"], plain["method"]) == ("frequency-domain", "regression")
    assert made["candidate"] != plain["candidate"]
    estimated = _estimated(root, "--method", "frequency-domain")["methods"][0]["estimates"]
    values = {each["name"]: each["value"] for each in estimated}
    for entry in made["increments"]:
        for term in entry["terms"]:
            name = f"{entry['axis']}_{'0' if term['term'] == '1' else term['term']}"
            assert term["value"] == pytest.approx(values[name], rel=1e-9)
    again = asked(root, *given, "--like", made["label"])
    assert again["candidate"] == made["candidate"]


def test_a_display_makes_no_candidate(root: Path) -> None:
    model = str(root.parent / "model.toml")
    refused = aerodb(root, "update", "--vehicle", NAME, "--model", model, "--method", "stepwise")
    assert refused.returncode == 3
    assert "display" in refused.stderr


def test_the_page_shows_each_method_with_its_residuals(root: Path, tmp_path: Path) -> None:
    model, page = str(root.parent / "model.toml"), tmp_path / "estimates.html"
    given = ("estimate", "--vehicle", NAME, "--model", model, "--output", str(page))
    document = asked(root, *given, "--method", "regression", "--method", "frequency-domain")
    assert "page" not in document
    text = page.read_text(encoding="utf-8")
    for method in ("regression", "frequency-domain"):
        assert f"<h2>{method}</h2>" in text
    assert text.count("<figure ") >= 2
    assert "CZ_alpha" in text
    assert "autocorrelation of the residual" in text
