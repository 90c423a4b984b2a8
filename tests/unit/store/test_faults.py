"""Faults strike where they are set, once where they are to, and nowhere else."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from store import faults

ONCE = "from store.faults import point; point('a'); point('b'); print('passed')"


def passing(code, fault):
    environment = {**os.environ, "REEBASE_FAULT": fault}
    return subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False, timeout=60
    )


def test_no_fault_is_set_in_a_process_that_was_told_none():
    faults.point("worker.claimed")


@pytest.mark.parametrize(
    ("fault", "status"),
    [
        ("", 0), ("c=kill", 0), ("a=kill", -signal.SIGKILL), ("c=kill,b=crash", -signal.SIGSEGV),
        ("a=raise", 1), ("a=freeze:0.01", 0),
    ],
)  # fmt: skip
def test_a_fault_strikes_at_its_point(fault, status):
    assert passing(ONCE, fault).returncode == status


def test_a_fault_with_a_marker_strikes_once(tmp_path):
    fault = f"b=kill@{tmp_path / 'marker'}"
    assert passing(ONCE, fault).returncode == -signal.SIGKILL
    assert passing(ONCE, fault).stdout == "passed\n"


def test_an_unknown_action_is_refused():
    assert "the choices are" in passing("import store.faults", "a=explode").stderr
