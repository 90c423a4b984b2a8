"""Words that messages share: counted things, and the name of the command that was typed."""

from __future__ import annotations

import os

__all__ = ["counted", "program"]


_MANY = {"vertex": "vertices"}


def counted(number: int, one: str) -> str:
    """A number with its noun: "1 face", "2,000 vertices"."""
    return f"{number:,} {one if number == 1 else _MANY.get(one, one + 's')}"


def program() -> str:
    """What a person types before a command's name: ``reebase``, or what ``REEBASE_COMMAND`` says, as ``./run`` does."""
    return os.environ.get("REEBASE_COMMAND") or "reebase"
