"""The numerical packages are imported when something is computed, not when a module is imported."""

from __future__ import annotations

import subprocess
import sys


def test_importing_the_rooms_loads_neither_numba_nor_scipy():
    rooms = "reebase.matching, reebase.search, reebase.descriptors, reebase.ranking, reebase.evaluation"
    code = f"import sys, {rooms}; print([name for name in ('numba', 'scipy') if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
