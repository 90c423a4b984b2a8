"""The same examples in every run, and no deadline, since the first call may compile."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("reebase", deadline=None, derandomize=True)
settings.load_profile("reebase")
