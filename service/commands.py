"""The application's commands: serve, worker, migrate, keys, backup, restore, on the library's command line."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.table import Table

from reebase.words import counted, program

if TYPE_CHECKING:
    from service.settings import ServiceSettings
    from store.engine import Database

__all__ = ["extend"]

keys = typer.Typer(help="API keys: who may do what.", no_args_is_help=True)

LAUNCHER = "./run"
"""What the launcher of a checkout calls itself; it has commands of its own."""

LogLevel = Literal["debug", "info", "warning", "error"]
Port = Annotated[int, typer.Option(help="0 for any free one.", min=0, max=65535, envvar="REEBASE_PORT")]


def extend(app: typer.Typer) -> None:
    """Add the application's commands to the library's."""
    from service.demo import demo

    for command in (serve, demo, worker, migrate, backup, restore):
        # `worker` hands its options on to `python -m worker`, which knows them.
        handed_on = {"allow_extra_args": True, "ignore_unknown_options": True} if command is worker else None
        app.command(context_settings=handed_on)(command)
    app.add_typer(keys, name="keys")
    if program() == LAUNCHER:
        app.info.epilog = f"Also: {LAUNCHER} test [ARGS], the tests; {LAUNCHER} python [ARGS], the interpreter."


def _settings() -> ServiceSettings:
    from pydantic import ValidationError

    from service.settings import ServiceSettings

    try:
        return ServiceSettings()
    except ValidationError as error:
        for one in error.errors():
            name = "REEBASE_" + "_".join(str(part) for part in one["loc"]).upper()
            _say(f"{name}: {one['msg']}")
        raise typer.Exit(1) from None


def _say(text: str) -> None:
    Console(stderr=True, highlight=False, markup=False, soft_wrap=True).print(text)


def _print(text: str) -> None:
    Console(highlight=False, markup=False, soft_wrap=True).print(text)


def _tell(text: str) -> None:
    """As _say, when whoever read it may be gone and that must not matter."""
    with contextlib.suppress(OSError):
        print(text, file=sys.stderr, flush=True)  # noqa: T201 - words for whoever typed the command


def _opened(settings: ServiceSettings, *, any_schema: bool = False) -> Database:
    """The database as it is. Raises UnsupportedDatabase when there is none, or its schema is not this version's."""
    from store import migrate as migrations
    from store.engine import Database

    migrations.check(settings.database_url, any_schema=any_schema)
    return Database(settings.database_url)


def _renewed(settings: ServiceSettings) -> Database:
    """The database, brought to this version."""
    from store import collections
    from store import migrate as migrations
    from store.engine import Database

    migrations.upgrade(settings.database_url)
    database = Database(settings.database_url)
    with database.write() as conn:
        collections.renew_profiles(conn)
    return database


def _listen(host: str, port: int) -> socket.socket:
    """A listening socket, taken before anything is started, so that a taken port is known at once."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(2048)
    except socket.gaierror:
        _say(f"reebase: {host} is not an address of this machine.")
        raise typer.Exit(1) from None
    except (OSError, OverflowError) as error:
        _say(f"reebase: cannot listen on {host}:{port}: {getattr(error, 'strerror', error)}. Choose with --port.")
        raise typer.Exit(1) from None
    return listener


def _check_keys(settings: ServiceSettings, database: Database) -> str:
    """What guards the door, in words. Refuses to open one that nobody guards."""
    from store import keys as stored

    if settings.anonymous:
        where = "this machine alone reaches the service" if settings.loopback else "REEBASE_ALLOW_ANONYMOUS"
        return f"no API key needed ({where})"
    with database.read() as conn:
        if stored.any_active(conn):
            return "API keys required"
    _say(
        f"reebase: there is no API key, and {settings.host} can be reached from other machines, so nobody could "
        "use the service and nobody should without a key.\n"
        f"Make one:            {program()} keys create --scope admin\n"
        f"or, if others guard: {program()} serve --allow-anonymous"
    )
    raise typer.Exit(1)


def serve(
    host: Annotated[str | None, typer.Option(help="Address to listen on.", show_default="127.0.0.1")] = None,
    port: Port = 8000,
    workers: Annotated[int, typer.Option(help="Worker processes.", min=0, max=256)] = 1,
    no_worker: Annotated[bool, typer.Option("--no-worker", help="Only the API.")] = False,
    allow_anonymous: Annotated[
        bool, typer.Option("--allow-anonymous", help="Need no API keys on any address.")
    ] = False,
    log_level: Annotated[
        LogLevel | None,
        typer.Option(help="At info, each request and task is a line.", show_default="warning in a terminal, else info"),
    ] = None,
) -> None:
    """Start the API, a page at / and the worker; Ctrl-C stops them in order."""
    from service.logs import configure

    settings = _settings()
    if host is not None:
        settings = settings.model_copy(update={"host": host})
    if allow_anonymous:
        settings = settings.model_copy(update={"allow_anonymous": True})
    level = log_level or ("warning" if sys.stderr.isatty() else "info")
    configure(level)
    listener = _listen(settings.host, port)
    database = _renewed(settings)
    try:
        guard = _check_keys(settings, database)
    finally:
        database.close()
    count = 0 if no_worker else workers
    _announce(settings, listener.getsockname()[1], guard, count)
    _run(settings, listener, count, level)


def _announce(settings: ServiceSettings, port: int, guard: str, workers: int) -> None:
    import reebase

    name = f"[{settings.host}]" if ":" in settings.host else settings.host
    _print(f"Reebase {reebase.__version__}")
    _print(f"  home      {settings.home}")
    _print(f"  database  {settings.database_url}")
    _print(f"  blobs     {settings.blobs}")
    _print(f"  guards    {guard}; each mesh in a process of its own, with limits (the worker's log says which)")
    _print(f"  workers   {workers or 'none here'}")
    _print(f"  address   http://{name}:{port}")
    here = "127.0.0.1" if settings.host in ("0.0.0.0", "::") else name  # noqa: S104 - no address to go to
    _print(f"Open http://{here}:{port} in a browser; Ctrl-C stops it.")
    sys.stdout.flush()


def _run(settings: ServiceSettings, listener: socket.socket, workers: int, log_level: str) -> None:
    """Serve until SIGTERM or SIGINT: then the API finishes what it answers, and the workers stop after it."""
    import uvicorn

    from service.app import create_app
    from service.supervisor import Supervisor

    app = create_app(settings)

    class Server(uvicorn.Server):
        def handle_exit(self, sig: int, frame: object) -> None:
            app.state.stopping.set()  # requests that wait for a task answer now
            super().handle_exit(sig, frame)  # type: ignore[arg-type]

        async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
            _tell("Stopping: first what is being answered, then the workers ...")
            await super().shutdown(sockets)

    server = Server(
        uvicorn.Config(
            app, log_config=None, access_log=False, server_header=False, timeout_graceful_shutdown=10,
            h11_max_incomplete_event_size=64 * 1024, lifespan="on", proxy_headers=False,
            limit_concurrency=settings.max_connections,
        )
    )  # fmt: skip
    # Before the server listens to signals, one must not be lost; once it has stopped it raises them again,
    # and that must not end us before the workers.
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: setattr(server, "should_exit", True))
    supervisor = Supervisor(workers, log_level)
    supervisor.start()
    try:
        server.run(sockets=[listener])
    finally:
        supervisor.stop()
        _tell("Stopped.")
    if not server.started:
        raise typer.Exit(1)


def worker(context: typer.Context) -> None:
    """Start a worker by itself, beside an API that runs elsewhere on this database."""
    from service.supervisor import WORKER, worker_environment

    # In this process's place, so that signals and the exit status are the worker's.
    os.execve(sys.executable, WORKER + context.args, worker_environment())  # noqa: S606 - our own worker


def migrate() -> None:
    """Bring the database to this version; `serve` does so by itself."""
    from store import migrate as migrations

    settings = _settings()
    before = migrations.current(settings.database_url)
    migrations.upgrade(settings.database_url)
    _print(f"{settings.database_url}: {before or 'empty'} -> {migrations.head()}")


def backup(target: Annotated[Path, typer.Argument(help="A directory that is made.", metavar="DIR")]) -> None:
    """Copy database and blobs while the service runs; nothing is migrated."""
    from store.backup import backup as make
    from store.blobs import open_blobs

    settings = _settings()
    database = _opened(settings, any_schema=True)
    try:
        manifest = make(database, open_blobs(settings), target)
    finally:
        database.close()
    _print(f"{target}: database and {counted(len(manifest.blobs), 'blob')}, {sum(manifest.blobs.values())} bytes")


def restore(source: Annotated[Path, typer.Argument(help="A backup.", metavar="DIR")]) -> None:
    """Put a backup into the home, which must have no database yet. Stop the service before."""
    from store.backup import restore as put_back

    settings = _settings()
    manifest = put_back(source, settings)
    _print(f"{settings.home}: restored the backup of {manifest.created}, {counted(len(manifest.blobs), 'blob')}")


@keys.command("create")
def create_key(
    scope: Annotated[str, typer.Option(help="read, write or admin; each allows what the ones before allow.")],
    collection: Annotated[str | None, typer.Option(help="The only collection that it opens.")] = None,
    name: Annotated[str, typer.Option(help="Whose it is, for the list.")] = "",
    requests_per_minute: Annotated[int | None, typer.Option(help="Rate limit of this key.", min=1)] = None,
    max_shapes: Annotated[int | None, typer.Option(help="Quota of shapes that it may keep.", min=0)] = None,
) -> None:
    """Make an API key; its secret is printed once and kept nowhere."""
    from store import keys as stored

    database = _opened(_settings())
    try:
        with database.write() as conn:
            key, secret = stored.create(
                conn, scope, collection, name, requests_per_minute=requests_per_minute, max_shapes=max_shapes
            )
    finally:
        database.close()
    _say(f"Key {key.id} ({key.scope}{f', {collection} alone' if collection else ''}); shown this once:")
    _print(secret)


@keys.command("list")
def list_keys() -> None:
    """All API keys, without their secrets."""
    from store import keys as stored

    database = _opened(_settings())
    try:
        with database.read() as conn:
            found = stored.list_all(conn)
    finally:
        database.close()
    names = ("id", "begins", "scope", "collection", "created", "last used", "revoked", "name")
    rows = []
    for key in found:
        moments = (key.created_at, key.last_used_at, key.revoked_at)
        when = (moment.isoformat(timespec="seconds") if moment else "" for moment in moments)
        rows.append((key.id, key.prefix, key.scope, key.collection or "", *when, key.name))
    if not sys.stdout.isatty():  # for programs: one line a key, whole
        for row in (names, *rows):
            _print("\t".join(row))
        return
    table = Table(*names)
    for row in rows:
        table.add_row(*row)
    Console(markup=False).print(table)


@keys.command("revoke")
def revoke_key(key: Annotated[str, typer.Argument(help="Id of the key, as the list shows it.")]) -> None:
    """End an API key, at once and for good."""
    from store import keys as stored

    database = _opened(_settings())
    try:
        with database.write() as conn:
            revoked = stored.revoke(conn, key)
    finally:
        database.close()
    _print(f"{revoked.id} is revoked.")
