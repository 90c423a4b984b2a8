"""From how a child ended to what the owner of the mesh is told."""

from __future__ import annotations

import signal

import pytest

from worker.guards import ChildLimits
from worker.verdict import ChildError, End, judge

LIMITS = ChildLimits(memory_bytes=1 << 30, cpu_seconds=10, wall_seconds=20.0)


def verdict(*, killed_for_memory=False, **end):
    with pytest.raises(ChildError) as caught:
        judge(End(**end), LIMITS, killed_for_memory=killed_for_memory)
    return caught.value.code, caught.value.lasting


def test_an_answer_is_an_answer_only_from_a_child_that_left_well():
    assert judge(End(code=0, done={"a": 1}), LIMITS, killed_for_memory=False) == {"a": 1}
    assert verdict(code=-signal.SIGSEGV, done={"a": 1}) == ("child_crashed", True)
    assert verdict(code=0, done={"a": 1}, said_too_much=True) == ("child_crashed", True)


@pytest.mark.parametrize(
    ("end", "expected"),
    [
        ({"code": -signal.SIGKILL, "out_of_time": True}, ("timed_out", True)),
        ({"code": -signal.SIGXCPU}, ("timed_out", True)),
        ({"code": -signal.SIGKILL, "cpu_seconds": 10.1}, ("timed_out", True)),
        ({"code": -signal.SIGKILL, "killed_for_memory": True}, ("out_of_memory", True)),
        ({"code": -signal.SIGKILL}, ("child_crashed", False)),
        ({"code": None}, ("child_crashed", False)),
        ({"code": 0, "error": "out_of_memory"}, ("out_of_memory", True)),
        ({"code": 0, "error": "no_faces", "detail": {"message": "None."}}, ("no_faces", True)),
        ({"code": 0, "error": "storage_full", "detail": {"message": "Full."}}, ("storage_full", False)),
        ({"code": -signal.SIGABRT, "errors": "what():  std::bad_alloc"}, ("out_of_memory", True)),
        ({"code": -signal.SIGSEGV, "peak_bytes": 1 << 30}, ("out_of_memory", True)),
        ({"code": -signal.SIGSEGV}, ("child_crashed", True)),
        ({"code": 1}, ("child_crashed", True)),
        ({"code": 0}, ("child_crashed", True)),
    ],
)
def test_every_end_has_its_code_and_says_whether_another_attempt_makes_sense(end, expected):
    assert verdict(**end) == expected


def test_a_death_within_the_wall_time_is_not_taken_for_a_time_out():
    with pytest.raises(ChildError) as caught:
        judge(End(code=-signal.SIGSEGV, errors="Fatal Python error"), LIMITS, killed_for_memory=False)
    assert "SIGSEGV" in caught.value.detail["message"]
    assert caught.value.detail["errors"] == "Fatal Python error"
