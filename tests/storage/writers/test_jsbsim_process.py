"""Exports are compared inside JSBSim in a process of its own: same figures, under limits, and what
happens to it happens to nobody else."""

import os
import stat
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from aerodb.errors import InputError, StoreError
from aerodb.exchange import export_jsbsim, input_properties, jsbsim_check_cases, read_native
from aerodb.exchange.jsbsim.check_cases import check_in_jsbsim
from aerodb.storage.limits import Limits
from aerodb.storage.writers import agreement_in_jsbsim
from aerodb.storage.writers.jsbsim_executive import loaded_in_jsbsim
from tests.support.small_glider import DATABASE

pytest.importorskip("jsbsim")
GLIDER = read_native(DATABASE)
CASES = jsbsim_check_cases(GLIDER)
FILE = export_jsbsim(GLIDER, name="glider", cases=CASES)


def test_it_finds_what_jsbsim_finds_here() -> None:
    there = agreement_in_jsbsim(GLIDER, FILE, CASES, Limits())
    here = check_in_jsbsim(GLIDER, loaded_in_jsbsim(FILE), CASES, input_properties(GLIDER))
    assert there == here
    assert there.passed


def test_a_file_that_differs_is_found_to_differ() -> None:
    other = export_jsbsim(read_native(DATABASE.replace("-0.65", "-0.66")), name="glider")
    assert not agreement_in_jsbsim(GLIDER, other, CASES, Limits()).passed


@pytest.mark.campaign
def test_many_at_once_agree_and_this_process_lives() -> None:
    with ThreadPoolExecutor(6) as threads:
        asked = [
            threads.submit(agreement_in_jsbsim, GLIDER, FILE, CASES, Limits()) for _ in range(6)
        ]
        assert all(one.result().passed for one in asked)


def test_what_jsbsim_refuses_is_said() -> None:
    with pytest.raises(InputError, match="JSBSim cannot load the file"):
        agreement_in_jsbsim(GLIDER, b"<fdm_config name='x'/>", CASES, Limits())


@pytest.mark.parametrize(
    ("code", "limits", "said"),
    [
        ("import time; time.sleep(600)", {"wall": 0.5}, "was stopped after 0.5 s"),
        ("import os; os.abort()", {}, "crashed JSBSim .SIGABRT."),
        ("import os; os.kill(os.getpid(), 9)", {}, "most likely because memory ran out"),
        ("raise SystemExit(7)", {}, "exit code 7"),
    ],
)
def test_a_process_that_gives_no_answer_is_an_error_only(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, code: str, limits: dict[str, float], said: str
) -> None:
    program = tmp_path / "python"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{code}"\n', encoding="utf-8")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(sys, "executable", str(program))
    with pytest.raises(InputError, match=said):
        agreement_in_jsbsim(GLIDER, FILE, CASES, Limits(**limits))


def test_its_memory_is_limited() -> None:
    with pytest.raises(InputError, match=r"more than 1 MB of memory|exit code|crashed"):
        agreement_in_jsbsim(GLIDER, FILE, CASES, Limits(memory=1_000_000))


def test_a_process_that_cannot_start_is_a_fault_of_the_machine(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "executable", os.devnull)
    with pytest.raises(StoreError, match="cannot be started"):
        agreement_in_jsbsim(GLIDER, FILE, CASES, Limits())
