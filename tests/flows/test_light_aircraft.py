"""A rough build-up is corrected by flights of JSBSim's c172p, an aircraft that shares no code with the
product. The study docs/studies/light-aircraft.md is the whole of it; here is the longitudinal part."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.command import asked
from tests.support.guide_flights import blocks
from tests.support.paths import ROOT

jsbsim = pytest.importorskip("jsbsim")

from tests.campaigns.fleet import trimmed  # noqa: E402
from tests.support.guide_build_up import write_table  # noqa: E402
from tests.support.guide_light_aircraft import START, measured, plans  # noqa: E402

PARAMETERS = (
    "wing_slope", "wing_zero", "wing_moment", "tail_slope", "tail_downwash", "elevator_part",
)  # fmt: skip


def short_period() -> complex:
    """The root of JSBSim's own linearisation at the flights' trim [rad/s]."""
    executive = trimmed("c172p", START["ic/h-sl-ft"], START["ic/vc-kts"], 0.01)
    linear = jsbsim.FGLinearization(executive)
    names = list(linear.x_names)
    own = [names.index(name) for name in ("Vt", "Alpha", "Q", "Theta")]
    roots = np.linalg.eigvals(np.array(linear.system_matrix)[np.ix_(own, own)])
    return complex(roots[np.argmax(np.abs(roots))])


def test_sweeps_bring_the_short_period_to_that_of_jsbsim(tmp_path: Path) -> None:
    root = tmp_path / "workspace"
    page = (ROOT / "docs" / "studies" / "light-aircraft.md").read_text(encoding="utf-8")
    files = {title: text for _, title, text in blocks(page) if title}
    for name in ("vehicle.toml", "rough.toml"):
        (tmp_path / name).write_text(files[name], encoding="utf-8")
    model = tmp_path / "parameters.toml"
    model.write_text(f"own_constants = false\nparameters = {list(PARAMETERS)}\n", encoding="utf-8")
    asked(root, "vehicle", "add", str(tmp_path / "vehicle.toml"))
    asked(root, "database", "import", str(tmp_path / "rough.toml"))
    logs = [
        str(write_table(tmp_path / f"flight-{k}.csv", measured(plan, k)))
        for k, plan in enumerate(plans()[:2])
    ]
    asked(root, "flight", "ingest", *logs, "--mapping", "canonical", "--direct")
    asked(
        root, "update", "--model", str(model), "--baseline", "v0001", "--hold-out", "none",
        "--direct",
    )  # fmt: skip

    def found(version: str) -> tuple[float, float]:
        told = asked(root, "version", "modes", version, "--speed", "52.6", "--altitude", "1524")
        own = next(mode["figures"] for mode in told["modes"] if mode["name"] == "short period")
        return own["omega"], own["zeta"]

    true = short_period()
    frequency, damping = abs(true), -true.real / abs(true)
    before, after = found("v0001"), found("v0002")
    assert before[0] > 1.15 * frequency
    assert after[0] == pytest.approx(frequency, rel=0.08)
    assert after[1] == pytest.approx(damping, rel=0.15)
