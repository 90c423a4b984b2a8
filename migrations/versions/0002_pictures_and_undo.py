"""Undo of deletion, pictures and display meshes, further kinds of tasks and what they make.

SQLite changes a constraint only by building the table anew, so that is how each of them is changed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

# STRICT tables of SQLite know INTEGER and REAL only.
BIG = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
DOUBLE = sa.Double().with_variant(sa.REAL(), "sqlite")

_KINDS = {
    "0001": "'describe', 'query', 'evaluate'",
    "0002": "'describe', 'query', 'evaluate', 'denoise', 'duplicates', 'map', 'synthesise', 'report'",
}


def upgrade() -> None:
    # Bands had equal width before profiles said so; a later default must not change these.
    _profiles(lambda profile: {"levels": "width", **profile})
    _rebuild("shape", lambda: _shape(undo=True))
    _rebuild("task", lambda: _task("0002"))
    _rebuild("skeleton", lambda: _skeleton(pictures=True))
    op.execute("DELETE FROM idempotency WHERE status IS NULL")
    _rebuild("idempotency", lambda: _idempotency(locks=False))
    # Nothing filled it so far.
    op.drop_table("descriptor")
    _descriptor(rows=True)
    op.create_table(
        "task_output",
        sa.Column("task_id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("task_id", "name"),
        sa.CheckConstraint("length(sha256) = 64", name="task_output_sha256_length"),
        sa.ForeignKeyConstraint(["task_id"], ["task.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )
    op.create_index("task_output_by_sha256", "task_output", ["sha256"])


def downgrade() -> None:
    _profiles(lambda profile: {name: value for name, value in profile.items() if name != "levels"})
    op.drop_table("task_output")
    op.drop_table("descriptor")
    _descriptor(rows=False)
    op.execute("DELETE FROM shape WHERE deleted_at IS NOT NULL")
    for name in ("shape_tag", "shape_metadata", "endpoint_features", "skeleton", "health"):
        op.execute(f"DELETE FROM {name} WHERE shape_id NOT IN (SELECT id FROM shape)")  # noqa: S608 - names of this file
    op.execute(f"DELETE FROM task WHERE kind NOT IN ({_KINDS['0001']})")  # noqa: S608 - names of this file
    _rebuild("idempotency", lambda: _idempotency(locks=True))
    _rebuild("skeleton", lambda: _skeleton(pictures=False))
    _rebuild("task", lambda: _task("0001"))
    _rebuild("shape", lambda: _shape(undo=False))


def _profiles(change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    table = sa.table("collection", sa.column("id", sa.Text()), sa.column("profile", sa.JSON()))
    for row in op.get_bind().execute(sa.select(table)).all():
        op.execute(sa.update(table).where(table.c.id == row.id).values(profile=change(row.profile)))


def _rebuild(name: str, create: Callable[[], None]) -> None:
    """The table as ``create`` makes it, with the old rows in the columns that both have."""
    op.execute(f"CREATE TABLE old_{name} AS SELECT * FROM {name}")  # noqa: S608 - names of this file
    before = _columns(name)
    op.drop_table(name)
    create()
    both = ", ".join(column for column in _columns(name) if column in before)
    op.execute(f"INSERT INTO {name} ({both}) SELECT {both} FROM old_{name}")  # noqa: S608 - names of this file
    op.drop_table(f"old_{name}")


def _columns(name: str) -> list[str]:
    return [column["name"] for column in sa.inspect(op.get_bind()).get_columns(name)]


def _where(condition: str) -> dict[str, sa.TextClause]:
    return {"sqlite_where": sa.text(condition), "postgresql_where": sa.text(condition)}


def _shape(*, undo: bool) -> None:
    extra = (
        [sa.Column("deleted_at", BIG, nullable=True)]
        if undo
        else [sa.UniqueConstraint("collection_id", "sha256", name="shape_bytes_once")]
    )
    op.create_table(
        "shape",
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("collection_id", sa.Text(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("bytes", BIG, nullable=False),
        sa.Column("format", sa.Text(), nullable=False),
        sa.Column("filename", sa.Text(), nullable=True),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("label", sa.Text(), nullable=True),
        sa.Column("metadata", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("task_id", sa.Text(), nullable=True),
        sa.Column("owner", sa.Text(), nullable=True),
        sa.Column("created_at", BIG, nullable=False),
        sa.Column("updated_at", BIG, nullable=False),
        *extra,
        sa.PrimaryKeyConstraint("id"),
        sa.CheckConstraint("length(sha256) = 64", name="shape_sha256_length"),
        sa.CheckConstraint("bytes >= 0", name="shape_bytes_positive"),
        sa.CheckConstraint(
            "state IN ('queued', 'running', 'indexed', 'failed', 'cancelled')", name="shape_state_known"
        ),
        sa.ForeignKeyConstraint(["collection_id"], ["collection.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )
    if undo:
        op.create_index(
            "shape_bytes_once", "shape", ["collection_id", "sha256"], unique=True, **_where("deleted_at IS NULL")
        )
        op.create_index("shape_deleted", "shape", ["deleted_at"], **_where("deleted_at IS NOT NULL"))
        op.create_index("shape_by_name", "shape", ["collection_id", "name"])
    op.create_index("shape_by_label", "shape", ["collection_id", "label"])
    op.create_index("shape_by_owner", "shape", ["owner"])
    op.create_index("shape_by_sha256", "shape", ["sha256"])
    op.create_index("shape_by_task", "shape", ["task_id"])


def _task(schema: str) -> None:
    op.create_table(
        "task",
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("priority", sa.Integer(), nullable=False),
        sa.Column("collection_id", sa.Text(), nullable=True),
        sa.Column("shape_id", sa.Text(), nullable=True),
        sa.Column("params", sa.Text(), nullable=False),
        sa.Column("blob", sa.Text(), nullable=True),
        sa.Column("result", sa.Text(), nullable=True),
        sa.Column("error_code", sa.Text(), nullable=True),
        sa.Column("error_detail", sa.Text(), nullable=True),
        sa.Column("stage", sa.Text(), nullable=True),
        sa.Column("fraction", DOUBLE, nullable=False),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("crashes", sa.Integer(), nullable=False),
        sa.Column("cancel_requested", sa.Integer(), nullable=False),
        sa.Column("worker", sa.Text(), nullable=True),
        sa.Column("lease_until", BIG, nullable=True),
        sa.Column("created_at", BIG, nullable=False),
        sa.Column("started_at", BIG, nullable=True),
        sa.Column("finished_at", BIG, nullable=True),
        sa.PrimaryKeyConstraint("id"),
        sa.CheckConstraint(f"kind IN ({_KINDS[schema]})", name="task_kind_known"),
        sa.CheckConstraint(
            "state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')", name="task_state_known"
        ),
        sa.CheckConstraint("(state = 'running') = (lease_until IS NOT NULL)", name="task_lease_while_running"),
        sa.CheckConstraint("(state = 'running') = (worker IS NOT NULL)", name="task_worker_while_running"),
        sa.CheckConstraint(
            "(state IN ('succeeded', 'failed', 'cancelled')) = (finished_at IS NOT NULL)",
            name="task_finished_at_end",
        ),
        sa.CheckConstraint("(state = 'failed') = (error_code IS NOT NULL)", name="task_failure_has_code"),
        sa.CheckConstraint("result IS NULL OR state = 'succeeded'", name="task_result_of_success"),
        sa.CheckConstraint("kind <> 'describe' OR shape_id IS NOT NULL", name="task_describes_a_shape"),
        sa.CheckConstraint("fraction BETWEEN 0 AND 1", name="task_fraction_range"),
        sa.CheckConstraint("attempt >= 0 AND crashes >= 0", name="task_counts_positive"),
        sa.CheckConstraint("cancel_requested IN (0, 1)", name="task_cancel_flag"),
        sqlite_strict=True,
    )
    op.create_index("task_by_blob", "task", ["blob"], **_where("blob IS NOT NULL"))
    latest = ["kind", "id"] if schema == "0002" else []
    if latest:
        op.create_index("task_by_end", "task", ["finished_at"], **_where("finished_at IS NOT NULL"))
    op.create_index("task_by_collection", "task", ["collection_id", *latest])
    op.create_index("task_by_shape", "task", ["shape_id"])
    op.create_index("task_leases", "task", ["lease_until"], **_where("state = 'running'"))
    op.create_index(
        "task_one_description", "task", ["shape_id"], unique=True,
        **_where("kind = 'describe' AND state IN ('queued', 'running')"),
    )  # fmt: skip
    op.create_index("task_queue", "task", ["priority", "created_at", "id"], **_where("state = 'queued'"))


def _skeleton(*, pictures: bool) -> None:
    names = ("thumbnail_sha256", "display_sha256") if pictures else ()
    op.create_table(
        "skeleton",
        sa.Column("shape_id", sa.Text(), nullable=False),
        sa.Column("profile_key", sa.Text(), nullable=False),
        sa.Column("pipeline_version", sa.Integer(), nullable=False),
        sa.Column("graph", sa.LargeBinary(), nullable=False),
        sa.Column("eigenvalues", sa.LargeBinary(), nullable=False),
        sa.Column("cleaned_sha256", sa.Text(), nullable=False),
        sa.Column("denoised_sha256", sa.Text(), nullable=False),
        *(sa.Column(name, sa.Text(), nullable=True) for name in names),
        *([sa.Column("limbs", sa.LargeBinary(), nullable=True)] if pictures else []),
        sa.PrimaryKeyConstraint("shape_id"),
        sa.CheckConstraint("length(cleaned_sha256) = 64", name="skeleton_cleaned_sha256_length"),
        sa.CheckConstraint("length(denoised_sha256) = 64", name="skeleton_denoised_sha256_length"),
        *(
            sa.CheckConstraint(f"{name} IS NULL OR length({name}) = 64", name=f"skeleton_{name}_length")
            for name in names
        ),
        sa.ForeignKeyConstraint(["shape_id"], ["shape.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )
    for name in ("cleaned_sha256", "denoised_sha256", *names):
        op.create_index(f"skeleton_by_{name.removesuffix('_sha256')}", "skeleton", [name])


def _descriptor(*, rows: bool) -> None:
    extra = (
        [
            sa.Column("width", sa.Integer(), nullable=False),
            sa.Column("positions", sa.LargeBinary(), nullable=True),
            sa.CheckConstraint("width > 0", name="descriptor_width"),
            sa.CheckConstraint(
                'positions IS NULL OR length(positions) * width = length("values") * 3',
                name="descriptor_positions_size",
            ),
        ]
        if rows
        else []
    )
    size = 'length("values") % (4 * width) = 0' if rows else 'length("values") % 4 = 0'
    op.create_table(
        "descriptor",
        sa.Column("shape_id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("version", sa.Text(), nullable=False),
        sa.Column("values", sa.LargeBinary(), nullable=False),
        *extra,
        sa.PrimaryKeyConstraint("shape_id", "name"),
        sa.CheckConstraint(size, name="descriptor_size"),
        sa.ForeignKeyConstraint(["shape_id"], ["shape.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )


def _idempotency(*, locks: bool) -> None:
    extra = (
        [
            sa.Column("holder", sa.Text(), nullable=True),
            sa.Column("locked_until", BIG, nullable=True),
            sa.CheckConstraint("(holder IS NULL) = (locked_until IS NULL)", name="idempotency_lock_whole"),
            sa.CheckConstraint("(holder IS NULL) = (status IS NOT NULL)", name="idempotency_held_or_answered"),
            sa.CheckConstraint(
                "(status IS NULL) = (headers IS NULL) AND (status IS NULL) = (body IS NULL)",
                name="idempotency_answer_whole",
            ),
        ]
        if locks
        else []
    )
    op.create_table(
        "idempotency",
        sa.Column("key", sa.Text(), nullable=False),
        sa.Column("principal", sa.Text(), nullable=False),
        sa.Column("method", sa.Text(), nullable=False),
        sa.Column("path", sa.Text(), nullable=False),
        sa.Column("fingerprint", sa.Text(), nullable=False),
        *extra,
        sa.Column("status", sa.Integer(), nullable=locks),
        sa.Column("headers", sa.Text(), nullable=locks),
        sa.Column("body", sa.LargeBinary(), nullable=locks),
        sa.Column("expires_at", BIG, nullable=False),
        sa.PrimaryKeyConstraint("key", "principal", "method", "path"),
        sqlite_strict=True,
    )
    op.create_index("idempotency_expiry", "idempotency", ["expires_at"])
