"""`python -m reebase` and the `reebase` command: the command line, or in one line what it needs."""

from __future__ import annotations

import sys

from reebase.errors import MissingPackage


def main() -> None:
    """Run the command line. Without the packages that it needs: one line that names them, exit code 1."""
    try:
        from reebase.cli import main as command_line
    except MissingPackage as missing:
        sys.exit(f"reebase: {missing.message} [{missing.code}]")
    command_line()


if __name__ == "__main__":
    main()
