#!/usr/bin/env python3
"""Fetches three.js from its npm package into this folder, and notes what was taken.

    python service/page/vendor/renew.py            the version in vendor.json, to compare
    python service/page/vendor/renew.py 0.184.0    another version

The browser gets plain modules with relative imports: neither a build step nor an import map (which the page's
Content-Security-Policy refuses as an inline script) is needed.
"""

from __future__ import annotations

import hashlib
import io
import json
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
RECORD = HERE / "vendor.json"
TAKEN = {
    "build/three.module.min.js": "three.module.min.js",
    "build/three.core.min.js": "three.core.min.js",
    "examples/jsm/controls/OrbitControls.js": "OrbitControls.js",
    "LICENSE": "LICENSE",
}
"""Path in the package -> name here."""


def fetched(version: str) -> dict[str, bytes]:
    """The files of this version by their names here, imports made relative."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["npm", "pack", f"three@{version}", "--silent"], cwd=folder, check=True)  # noqa: S603, S607 - npm, wherever it is
        [package] = Path(folder).glob("*.tgz")
        with tarfile.open(fileobj=io.BytesIO(package.read_bytes())) as archive:
            return {name: _relative(_content(archive, path)) for path, name in TAKEN.items()}


def _content(archive: tarfile.TarFile, path: str) -> bytes:
    member = archive.extractfile(f"package/{path}")
    if member is None:
        raise SystemExit(f"The package has no file {path}: this version is built differently.")
    return member.read()


def _relative(data: bytes) -> bytes:
    return data.replace(b"from 'three'", b"from './three.module.min.js'")


def main() -> None:
    before = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    version = sys.argv[1] if len(sys.argv) > 1 else before["version"]
    files = fetched(version)
    for name, data in files.items():
        (HERE / name).write_bytes(data)
    hashes = {name: hashlib.sha256(data).hexdigest() for name, data in sorted(files.items())}
    RECORD.write_text(json.dumps({"package": "three", "version": version, "sha256": hashes}, indent=2) + "\n")
    print("unchanged" if before.get("sha256") == hashes else f"three {version} is here now: run the browser tests")  # noqa: T201 - a command


if __name__ == "__main__":
    main()
