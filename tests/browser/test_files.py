"""The page's files themselves, without a browser: what is vendored, what is fetched first, what is in nobody's way."""

from __future__ import annotations

import gzip
import hashlib
import json
import re
from pathlib import Path

import pytest

from tests.http.serving import ROOT

PAGE = ROOT / "service" / "page"
VENDOR = PAGE / "vendor"
FIRST_PAINT = 200_000
OWN = sorted(path for path in PAGE.rglob("*.js") if VENDOR not in path.parents)
NEVER = ("http://", "https://", "innerHTML", "eval(", "new Function", "javascript:", "localStorage", "document.write")
_IMPORT = re.compile(r"""(?:from|import)\s*\(?\s*["']([^"']+)["']""")


def test_what_is_vendored_is_what_was_taken() -> None:
    record = json.loads((VENDOR / "vendor.json").read_text())
    found = {name: hashlib.sha256((VENDOR / name).read_bytes()).hexdigest() for name in record["sha256"]}
    assert found == record["sha256"], "vendored files were changed by hand: run service/page/vendor/renew.py"
    others = {path.name for path in VENDOR.iterdir()} - set(record["sha256"])
    assert others == {"renew.py", "vendor.json"}


def imports(path: Path) -> list[Path]:
    """The modules that a module names, resolved. Every one must be a relative path: there is no import map."""
    named = _IMPORT.findall(path.read_text())
    assert all(name.startswith((".", "/page/")) for name in named), (path, named)
    return [(PAGE / name[6:] if name.startswith("/page/") else path.parent / name).resolve() for name in named]


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.relative_to(PAGE).as_posix())
def test_a_module_names_only_modules_that_are_there(path: Path) -> None:
    for target in imports(path):
        assert target.is_file(), f"{path.name} imports {target}"


@pytest.mark.parametrize("path", [*OWN, PAGE / "index.html", *PAGE.glob("style/*.css")], ids=lambda path: path.name)
def test_nothing_comes_from_elsewhere_or_from_text(path: Path) -> None:
    text = path.read_text().replace("http://www.w3.org/", "")
    for never in NEVER:
        assert never not in text, never


def test_every_module_is_used() -> None:
    used = {target for path in OWN for target in imports(path)}
    assert [path.name for path in OWN if path.resolve() not in used] == ["main.js"]


def test_the_first_paint_is_small() -> None:
    """All of our own files together, whatever view is opened first: three.js alone comes on top, and only for 3D."""
    files = [*OWN, *PAGE.glob("*.html"), *PAGE.glob("*.svg"), *PAGE.glob("style/*.css")]
    size = sum(len(gzip.compress(path.read_bytes(), 9)) for path in files)
    assert size < FIRST_PAINT
