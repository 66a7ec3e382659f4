"""Methods beside each other on a glider without vanes: what the reconstruction made of its motion is
no measurement for output error, which would take its errors for motion."""

import pytest

from tests.support.command import asked
from tests.support.guide_flights import prepare
from tests.support.paths import ROOT

GUIDE = ROOT / "docs" / "guides" / "px4-without-vanes.md"
MODEL = """
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "q_hat", "delta_elevator"]
[[increment]]
axis = "Cm"
terms = ["1", "alpha", "q_hat", "delta_elevator"]
"""
#: What the flown glider has beyond its handbook: a lift slope alone.
PLANTED = {"CZ_alpha": -1.0, "CZ_q_hat": 0.0, "CZ_delta_elevator": 0.0}


@pytest.mark.campaign
def test_regression_finds_what_output_error_loses_in_a_reconstructed_angle(tmp_path) -> None:
    prepare(GUIDE.read_text(encoding="utf-8"), tmp_path)
    root = tmp_path / "w"
    asked(root, "vehicle", "add", str(tmp_path / "my-glider.toml"))
    asked(root, "database", "import", str(tmp_path / "handbook.toml"), "--vehicle", "my-glider")
    logs = [str(path) for path in sorted(tmp_path.glob("*.ulg"))]
    asked(root, "flight", "ingest", *logs, "--vehicle", "my-glider", "--direct")
    (tmp_path / "model.toml").write_text(MODEL)
    given = ("--vehicle", "my-glider", "--model", str(tmp_path / "model.toml"))
    methods = ("--methods", "regression", "--methods", "output-error")
    document = asked(root, "estimate", *given, *methods)
    regression, flown = (
        {each["name"]: each for each in entry["estimates"]} for entry in document["methods"]
    )
    for name, truth in PLANTED.items():
        assert abs(regression[name]["value"] - truth) < 3.0 * regression[name]["standard_error"]
        assert abs(flown[name]["value"] - truth) > 3.0 * flown[name]["standard_error"]
    assert document["believe"] == "regression"
    assert any("output-error fits alpha" in why for why in document["reasons"])
    assert any("CZ_alpha" in why and "joint uncertainty" in why for why in document["reasons"])
    update = asked(root, "update", *given, "--method", "output-error", "--direct")
    assert any("no sensor measured alpha" in remark for remark in update["remarks"])
