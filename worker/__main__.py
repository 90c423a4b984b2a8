"""``python -m worker [--once] [--name NAME]``: do background tasks until told to stop.

Exit status: 0 when it was told to stop, or found nothing more to do with ``--once``; 1 when it cannot work,
with the reason in the log. SIGTERM and SIGINT let what runs go on for the grace period, then put it back
into the queue; a second signal does so at once.
"""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys

from reebase.words import program
from worker.sandbox import Sandbox, SandboxError


def main(arguments: list[str] | None = None) -> int:
    """Run one worker; the return value is the exit status."""
    parser = argparse.ArgumentParser(prog=f"{program()} worker", description="Do background tasks.")
    parser.add_argument("--once", action="store_true", help="stop when no task is waiting")
    parser.add_argument("--name", help="how the worker is called in logs and tasks (default: host:pid)")
    parser.add_argument("--grace", type=float, default=5.0, metavar="SECONDS",
                        help="how long what runs may go on after SIGTERM (default: 5)")  # fmt: skip
    parser.add_argument("--log-level", choices=("debug", "info", "warning", "error"),
                        help="what is logged (default: warning on a terminal, else info)")  # fmt: skip
    chosen = parser.parse_args(arguments)
    sandbox = Sandbox()
    try:
        return _run(chosen, sandbox)
    finally:
        sandbox.close()


def _run(chosen: argparse.Namespace, sandbox: Sandbox) -> int:
    # Two processes have much to import; the zygote begins while this one still does.
    sandbox.launch()
    import structlog
    from pydantic import ValidationError

    from reebase.errors import ReebaseError
    from store.settings import Settings
    from worker.claim import Stop, StoppedError
    from worker.main import Worker, await_schema

    _configure_logs(chosen.log_level)
    log = structlog.get_logger("worker")
    # Whoever starts workers may hand them a pipe as standard input, which is at its end once it has died.
    lifeline = sys.stdin.fileno() if os.environ.get("REEBASE_LIFELINE") else None
    stop = Stop(chosen.grace, lifeline)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.request())
    try:
        settings = Settings()
        await_schema(settings.database_url, stop)
        with Worker(settings, chosen.name, stop, sandbox) as worker:
            worker.run(once=chosen.once)
    except StoppedError:
        return 0
    except (ReebaseError, SandboxError, ValidationError, OSError) as error:
        log.error("cannot_work", error=str(error))
        return 1
    return 0


def _configure_logs(level: str | None) -> None:
    """Lines for people on a terminal, from level warning on; else JSON, from info on: as the API does."""
    import structlog

    terminal = sys.stderr.isatty()
    level = level or ("warning" if terminal else "info")
    last: list[structlog.types.Processor] = (
        [structlog.dev.ConsoleRenderer(exception_formatter=structlog.dev.plain_traceback)]
        if terminal
        else [structlog.processors.format_exc_info, structlog.processors.JSONRenderer()]
    )
    structlog.configure(
        processors=[
            structlog.stdlib.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            lambda _, __, event: {**event, "logger": "worker"},
            *last,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=structlog.WriteLoggerFactory(file=sys.stderr),
    )
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING)


if __name__ == "__main__":
    sys.exit(main())
