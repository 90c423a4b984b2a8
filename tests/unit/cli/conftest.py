"""The command line inside this process."""

from __future__ import annotations

import pytest

from tests.command import Command


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Command:
    return Command(capfd, monkeypatch)
