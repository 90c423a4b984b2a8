"""The sandbox tells every way in which a child can end, and outlives them all."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import pytest

from worker.guards import ChildLimits
from worker.sandbox import ChildError, Sandbox, SandboxError

LIMITS = ChildLimits(
    memory_bytes=256 << 20, cpu_seconds=1, wall_seconds=5.0, file_bytes=8 << 20, open_files=64
)
MODULE = "tests.unit.worker.misbehaving"
linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="a guard of Linux")


@pytest.fixture(scope="module")
def sandbox():
    with Sandbox(LIMITS, MODULE) as started:
        yield started


def failure(sandbox, name, arguments=None, outputs=(), **more):
    with pytest.raises(ChildError) as caught, sandbox.run(name, arguments or {}, b"", outputs, **more):
        pass
    return caught.value


def alive(process):
    """False also for a process that is dead and not yet waited for."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


def test_a_job_gets_its_input_and_brings_files_answer_and_progress(sandbox, tmp_path):
    seen = []
    path = tmp_path / "input"
    path.write_bytes(b"mesh")
    with path.open("rb") as source, sandbox.run(
        "double", {}, source, ("first", "second"), progress=lambda *step: seen.append(step)
    ) as finished:
        assert finished.answer == {"length": 4, "thread_ok": True}
        assert {name: file.read() for name, file in finished.files.items()} == {
            "first": b"meshmesh", "second": b"meshmesh",
        }  # fmt: skip
        assert finished.peak_bytes > 1 << 20
    assert seen == [("half", 0.5)]
    with sandbox.run("double", {}, b"bytes do too") as finished:
        assert finished.answer["length"] == 12


def test_a_refusal_keeps_its_code_and_details(sandbox):
    error = failure(sandbox, "refuse")
    assert (error.code, error.lasting) == ("degenerate_mesh", True)
    assert error.detail == {"message": "There is nothing left.", "faces": 0}


def test_a_bug_is_named_and_not_hidden(sandbox):
    error = failure(sandbox, "bug")
    assert (error.code, error.lasting) == ("internal_error", True)
    assert error.detail["message"] == "IndexError: list index out of range"


@pytest.mark.parametrize(
    ("name", "code", "lasting"),
    [
        ("allocate_in_c", "out_of_memory", True),
        ("crash", "child_crashed", True),
        ("kill", "child_crashed", False),
        ("flood_messages", "child_crashed", True),
        ("write_too_much", "limit_exceeded", True),
        ("open_too_many", "internal_error", True),
        ("spin", "timed_out", True),
    ],
)
def test_each_death_has_its_code_and_the_next_job_is_served(sandbox, name, code, lasting):
    zygote = sandbox.zygote
    error = failure(sandbox, name, outputs=("result",))
    assert (error.code, error.lasting) == (code, lasting)
    assert error.detail["message"].endswith(".") or code == "internal_error"
    with sandbox.run("double", {}, b"ab") as finished:
        assert finished.answer["length"] == 2
    assert sandbox.zygote == zygote


@linux
def test_memory_is_limited(sandbox):
    error = failure(sandbox, "allocate")
    assert error.code == "out_of_memory"
    assert "256 MiB" in error.detail["message"]
    assert error.detail["peak_bytes"] < LIMITS.memory_bytes + (128 << 20)


def test_a_crash_says_which_signal_and_where(sandbox):
    error = failure(sandbox, "crash")
    assert "SIGSEGV" in error.detail["message"]
    assert "in crash" in error.detail["errors"]


def test_a_child_that_leaves_without_a_word_has_crashed(sandbox):
    for status in (0, 7):
        error = failure(sandbox, "leave", {"status": status})
        assert (error.code, error.lasting) == ("child_crashed", True)


def test_an_error_stream_without_end_stops_nobody(sandbox):
    with sandbox.run("flood_errors", {}) as finished:
        assert finished.answer == {}


def test_wall_time_is_limited():
    with Sandbox(ChildLimits(wall_seconds=0.3), MODULE) as sandbox:
        start = time.monotonic()
        error = failure(sandbox, "sleep")
        assert (error.code, error.lasting) == ("timed_out", True)
        assert time.monotonic() - start < 3


@linux
def test_there_is_no_way_out(sandbox):
    with sandbox.run("escape", {}) as finished:
        attempts = ("socket", "fork", "signal", "program")
        assert finished.answer == dict.fromkeys(attempts, "PermissionError")
    assert {guard.name: guard.on for guard in sandbox.guards} == dict.fromkeys(
        ("dies_with_parent", "memory", "cpu_time", "file_size", "open_files", "core_dump", "first_out_of_memory",
         "no_network"), True,
    )  # fmt: skip


def test_no_secret_of_the_service_reaches_the_child(monkeypatch):
    monkeypatch.setenv("REEBASE_DATABASE_URL", "postgresql://user:secret@host/db")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    with Sandbox(LIMITS, MODULE) as sandbox, sandbox.run("environment", {}) as finished:
        assert not {"REEBASE_DATABASE_URL", "AWS_SECRET_ACCESS_KEY"} & set(finished.answer["names"])
        assert finished.answer["descriptors"] <= 10


def test_what_tick_raises_kills_the_child_and_goes_on_to_the_caller(sandbox):
    class StopError(Exception):
        pass

    seen = []

    def tick():
        if sandbox.child:
            seen.append(sandbox.child)
            raise StopError

    with pytest.raises(StopError), sandbox.run("sleep", {}, tick=tick):
        pass
    assert not alive(seen[0])
    assert sandbox.child is None
    with sandbox.run("double", {}, b"") as finished:
        assert finished.answer["length"] == 0


@linux
def test_a_killed_zygote_takes_its_child_along_and_is_replaced():
    with Sandbox(LIMITS, MODULE) as sandbox:
        first, children = sandbox.zygote, []

        def tick():
            if sandbox.child and not children:
                children.append(sandbox.child)
                os.kill(first, signal.SIGKILL)

        error = failure(sandbox, "sleep", tick=tick)
        assert (error.code, error.lasting) == ("child_crashed", False)
        deadline = time.monotonic() + 5
        while alive(children[0]) and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not alive(children[0])
        with sandbox.run("double", {}, b"abc") as finished:
            assert finished.answer["length"] == 3
        assert sandbox.zygote not in (None, first)


def test_a_zygote_that_freezes_at_work_is_replaced(monkeypatch):
    monkeypatch.setattr("worker.exchange._DEATH_SECONDS", 0.3)
    with Sandbox(ChildLimits(wall_seconds=0.5), MODULE) as sandbox:
        first = sandbox.zygote

        def tick():
            if sandbox.child:
                os.kill(first, signal.SIGSTOP)

        assert failure(sandbox, "sleep", tick=tick).code == "timed_out"
        with sandbox.run("double", {}, b"abc") as finished:
            assert finished.answer["length"] == 3
        assert sandbox.zygote not in (None, first)


def test_a_zygote_that_freezes_at_rest_is_replaced(monkeypatch):
    monkeypatch.setattr("worker.exchange._DEATH_SECONDS", 0.3)
    with Sandbox(LIMITS, MODULE) as sandbox:
        first = sandbox.zygote
        os.kill(first, signal.SIGSTOP)
        with sandbox.run("double", {}, b"abc") as finished:
            assert finished.answer["length"] == 3
        assert sandbox.zygote not in (None, first)


def test_a_child_that_goes_on_after_its_report_is_killed(sandbox):
    with sandbox.run("linger", {}) as finished:
        child = finished.answer["process"]
    with sandbox.run("double", {}, b"") as finished:
        assert finished.answer["length"] == 0
    assert not alive(child)


def test_a_zygote_that_cannot_start_says_so():
    with pytest.raises(SandboxError, match="died while it warmed up"):
        Sandbox(LIMITS, "tests.unit.worker.no_such_module").start()


def test_limits_above_those_of_the_system_are_capped():
    with Sandbox(ChildLimits(open_files=1 << 40), MODULE) as sandbox:
        (guard,) = [guard for guard in sandbox.guards if guard.name == "open_files"]
        assert guard.on
        assert "capped" in guard.note
