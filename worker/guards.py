"""What the child that works on one mesh is not allowed: memory, time, files, network, other processes.

Each guard is applied where the system has it and reported as on or off, with the reason, so that the worker
can name at start what protects it. None of them is needed for a right result.
"""

from __future__ import annotations

import ctypes
import errno
import functools
import os
import resource
import signal
import sys
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

__all__ = ["ChildLimits", "Guard", "apply", "die_with_parent", "native_threads", "prepare", "release_reserve"]

_PR_SET_PDEATHSIG = 1
_CLONE_THREAD = 0x10000
_REPORTING_MEMORY = 64 << 20  # of address space, freed for the report of a child that ran out of its own


@dataclass(frozen=True)
class ChildLimits:
    """What one child may use.

    memory_bytes: address space beyond what the zygote has mapped. cpu_seconds, wall_seconds: of the whole
    job. file_bytes: of each file it writes. open_files: descriptors.
    """

    memory_bytes: int = 4 << 30
    cpu_seconds: int = 300
    wall_seconds: float = 600.0
    file_bytes: int = 1 << 30
    open_files: int = 64

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True)
class Guard:
    """One protection: its name, whether it is on, and its measure or the reason why it is off."""

    name: str
    on: bool
    note: str


@functools.cache
def prepare() -> Any:
    """Load the library that ``apply`` needs, before a fork: finding it runs another program, which takes long.

    Raises ImportError, RuntimeError or OSError where it is missing.
    """
    import pyseccomp

    return pyseccomp


def apply(limits: ChildLimits, parent: int) -> tuple[Guard, ...]:
    """Apply every guard to the calling process and report them. parent: the process id that must be its
    parent."""
    return (
        die_with_parent(parent),
        _limit_memory(limits.memory_bytes),
        _limit("cpu_time", resource.RLIMIT_CPU, limits.cpu_seconds, f"{limits.cpu_seconds} s"),
        _limit("file_size", resource.RLIMIT_FSIZE, limits.file_bytes, f"{limits.file_bytes >> 20} MiB"),
        _limit("open_files", resource.RLIMIT_NOFILE, limits.open_files, f"{limits.open_files} descriptors"),
        _limit("core_dump", resource.RLIMIT_CORE, 0, "none"),
        _first_victim(),
        _filter_system_calls(),
    )


def die_with_parent(parent: int) -> Guard:
    """Have the kernel kill the calling process when its parent dies; leave at once if it is dead already.

    The signal follows the death of the parent's *thread* that made this process (prctl(2)), so that thread
    must live as long as the parent.
    """
    if not sys.platform.startswith("linux"):
        return Guard("dies_with_parent", False, f"{sys.platform} has no parent-death signal")
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0) != 0:
        return Guard("dies_with_parent", False, os.strerror(ctypes.get_errno()))
    # A parent that died before the call sends no signal any more.
    if os.getppid() != parent:
        os._exit(1)
    return Guard("dies_with_parent", True, "SIGKILL")


def native_threads() -> int | None:
    """Threads of this process as the kernel counts them, those of C libraries too; None where it cannot be
    known."""
    try:
        return int(_status_field("Threads:"))
    except OSError:
        return None


def release_reserve() -> None:
    """Lift the soft limit of memory to the hard one, so that a child that ran out can still report it."""
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (hard, hard))


def _status_field(name: str) -> str:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(name):
            return line.split()[1]
    raise FileNotFoundError(name)


def _limit_memory(budget: int) -> Guard:
    if sys.platform == "darwin":
        return Guard("memory", False, "macOS does not enforce RLIMIT_AS")
    try:
        # BLAS, numba and the allocator reserve address space that they never touch, so the budget counts
        # from here.
        mapped = int(_status_field("VmSize:")) << 10
    except OSError:
        return Guard("memory", False, "the size of the process cannot be read from /proc")
    soft = mapped + budget
    return _limit("memory", resource.RLIMIT_AS, soft, f"{budget >> 20} MiB", reserve=_REPORTING_MEMORY)


def _limit(name: str, which: int, value: int, note: str, *, reserve: int = 0) -> Guard:
    _, ceiling = resource.getrlimit(which)
    hard = value + reserve
    if which == resource.RLIMIT_CPU:
        hard = value + 1  # SIGXCPU at the soft limit says why it died; SIGKILL at the hard one would not
    if ceiling != resource.RLIM_INFINITY and hard > ceiling:
        hard, value = ceiling, min(value, ceiling)
        note = f"{note}, capped by the system's limit {ceiling}" if value == ceiling else note
    try:
        resource.setrlimit(which, (value, hard))
    except (OSError, ValueError) as error:
        return Guard(name, False, str(error))
    return Guard(name, True, note)


def _first_victim() -> Guard:
    """When the whole machine runs out of memory the kernel should take this child and not the database's
    writer."""
    try:
        Path("/proc/self/oom_score_adj").write_text("1000")
    except OSError as error:
        return Guard("first_out_of_memory", False, error.strerror or str(error))
    return Guard("first_out_of_memory", True, "oom_score_adj 1000")


_DENIED = (
    "socket", "socketpair", "connect", "bind", "listen", "accept4", "sendto", "sendmsg", "sendmmsg",
    "io_uring_setup", "execve", "execveat", "ptrace", "process_vm_readv", "process_vm_writev", "pidfd_open",
    "pidfd_send_signal", "tkill", "rt_sigqueueinfo", "rt_tgsigqueueinfo", "unshare", "setns", "mount", "bpf",
    "perf_event_open", "userfaultfd",
)  # fmt: skip
_DENIED_WHERE_THEY_EXIST = ("accept", "fork", "vfork")  # newer architectures have only their successors


def _filter_system_calls() -> Guard:
    """No network, no other program, no other process; threads and signals to itself stay allowed."""
    name = "no_network"
    if not sys.platform.startswith("linux"):
        return Guard(name, False, f"{sys.platform} has no seccomp")
    try:
        seccomp = prepare()
    except (ImportError, RuntimeError, OSError) as error:
        return Guard(name, False, f"libseccomp cannot be loaded: {error}")
    try:
        rules = seccomp.SyscallFilter(defaction=seccomp.ALLOW)
        refuse = seccomp.ERRNO(errno.EPERM)
        for call in _DENIED:
            rules.add_rule(refuse, call)
        for call in _DENIED_WHERE_THEY_EXIST:
            with suppress(OSError):
                rules.add_rule(refuse, call)
        for call in ("kill", "tgkill"):
            rules.add_rule(refuse, call, seccomp.Arg(0, seccomp.NE, os.getpid()))
        rules.add_rule(refuse, "clone", seccomp.Arg(0, seccomp.MASKED_EQ, _CLONE_THREAD, 0))
        # A filter cannot follow the pointer to its flags; told "unknown", the C library takes clone.
        rules.add_rule(seccomp.ERRNO(errno.ENOSYS), "clone3")
        rules.load()
    except OSError as error:
        return Guard(name, False, f"the kernel refuses a seccomp filter: {error}")
    return Guard(name, True, "seccomp: no sockets, programs or other processes")

