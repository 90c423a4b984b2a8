"""The public names of the library, and what importing it costs."""

import ast
import subprocess
import sys
from pathlib import Path

import reebase

HEAVY = {"numba", "trimesh", "matplotlib", "httpx", "typer", "robust_laplacian", "scipy.sparse.linalg", "sqlalchemy"}


def test_all_is_what_the_package_imports() -> None:
    source = ast.parse(Path(reebase.__file__).read_text())
    imported = {
        alias.asname or alias.name
        for node in ast.walk(source)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(imported) == sorted(reebase.__all__)
    assert all(getattr(reebase, name).__doc__ for name in reebase.__all__)


def test_import_loads_nothing_heavy() -> None:
    script = f"import sys, reebase; print(*sorted({HEAVY!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_the_command_without_its_packages_is_one_line() -> None:
    script = "import sys; sys.modules['typer'] = None; from reebase.__main__ import main; main()"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "reebase: The command line needs typer: pip install 'reebase[client]'. [missing_package]\n"


def test_the_module_is_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "reebase", "--help"], capture_output=True, text=True, check=True)
    assert "evaluate" in done.stdout and "serve" not in done.stdout
