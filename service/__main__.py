"""`python -m service COMMAND`: the library's commands and the application's."""

from __future__ import annotations

from reebase.cli import app, main
from service.commands import extend

if __name__ == "__main__":
    extend(app)
    main()
