"""What is compiled ahead is all that a mesh or a query needs."""

import subprocess
import sys

import pytest

import reebase.warm

SCRIPT = """
import gc

import numpy as np

import reebase
from numba.core.dispatcher import Dispatcher
from reebase.denoise import METHODS
from reebase.mesh import to_bytes
from reebase.warm import sample, warm


def compiled():
    kernels = (one for one in gc.get_objects() if isinstance(one, Dispatcher))
    return {f"{k.py_func.__module__}.{k.py_func.__name__}{s}" for k in kernels for s in k.signatures}


warm()
before = compiled()
assert before
whole = sample()
torn = np.vstack([whole.faces[:-50], [[0, 1, 700]], whole.faces[:3]])
parts = reebase.Mesh(np.vstack([whole.vertices, whole.vertices + 3]), np.vstack([whole.faces, whole.faces + 1538]))
for source in (whole, to_bytes(whole, "stl"), reebase.Mesh(whole.vertices, torn), parts):
    graph = reebase.describe(source).skeleton
reebase.describe(whole, reebase.Profile(field="height", saliency="length", area="ring"))
reebase.match(graph, reebase.skeleton(whole))
for method in METHODS:
    reebase.denoise(whole, method)
print("\\n".join(sorted(compiled() - before)))
"""


def test_nothing_is_left_to_compile() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n") == ["", ""]


def test_elsewhere_than_on_a_terminal_each_stage_is_a_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(reebase.warm, "warm", lambda say: [say(stage, 0.0) for stage in ("read", "clean")])
    reebase.warm.main()
    err = capsys.readouterr().err
    assert "\r" not in err
    assert [line.split(": ")[-1].split()[0] for line in err.splitlines()] == ["read", "clean", "the"]
