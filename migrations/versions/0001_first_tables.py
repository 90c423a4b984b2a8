"""The first tables. Why each constraint is there stands beside it in ``store/tables.py``."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

# STRICT tables of SQLite know INTEGER and REAL only.
BIG = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
DOUBLE = sa.Double().with_variant(sa.REAL(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "revision",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("value", BIG, nullable=False),
        sa.Column("floor", BIG, nullable=False),
        sa.PrimaryKeyConstraint("id"),
        sa.CheckConstraint("id = 1", name="revision_one_row"),
        sa.CheckConstraint("floor <= value", name="revision_floor"),
        sqlite_strict=True,
    )
    op.execute("INSERT INTO revision (id, value, floor) VALUES (1, 0, 0)")

    op.create_table(
        "collection",
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("description", sa.Text(), nullable=False),
        sa.Column("profile", sa.Text(), nullable=False),
        sa.Column("profile_key", sa.Text(), nullable=False),
        sa.Column("created_at", BIG, nullable=False),
        sa.Column("updated_at", BIG, nullable=False),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("name", name="collection_name_once"),
        sa.CheckConstraint("length(name) BETWEEN 1 AND 63", name="collection_name_length"),
        sqlite_strict=True,
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
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("collection_id", "sha256", name="shape_bytes_once"),
        sa.CheckConstraint("length(sha256) = 64", name="shape_sha256_length"),
        sa.CheckConstraint("bytes >= 0", name="shape_bytes_positive"),
        sa.CheckConstraint(
            "state IN ('queued', 'running', 'indexed', 'failed', 'cancelled')", name="shape_state_known"
        ),
        sa.ForeignKeyConstraint(["collection_id"], ["collection.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )
    op.create_index("shape_by_label", "shape", ["collection_id", "label"])
    op.create_index("shape_by_owner", "shape", ["owner"])
    op.create_index("shape_by_sha256", "shape", ["sha256"])
    op.create_index("shape_by_task", "shape", ["task_id"])

    op.create_table(
        "shape_tag",
        sa.Column("shape_id", sa.Text(), nullable=False),
        sa.Column("tag", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("shape_id", "tag"),
        sa.ForeignKeyConstraint(["shape_id"], ["shape.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )
    op.create_index("shape_tag_by_tag", "shape_tag", ["tag", "shape_id"])

    op.create_table(
        "shape_metadata",
        sa.Column("shape_id", sa.Text(), nullable=False),
        sa.Column("key", sa.Text(), nullable=False),
        sa.Column("value", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("shape_id", "key"),
        sa.ForeignKeyConstraint(["shape_id"], ["shape.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )
    op.create_index("shape_metadata_by_key", "shape_metadata", ["key", "shape_id"])

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
        sa.CheckConstraint("kind IN ('describe', 'query', 'evaluate')", name="task_kind_known"),
        sa.CheckConstraint(
            "state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')", name="task_state_known"
        ),
        sa.CheckConstraint(
            "(state = 'running') = (lease_until IS NOT NULL)", name="task_lease_while_running"
        ),
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
    named = sa.text("blob IS NOT NULL")
    op.create_index("task_by_blob", "task", ["blob"], sqlite_where=named, postgresql_where=named)
    op.create_index("task_by_collection", "task", ["collection_id"])
    op.create_index("task_by_shape", "task", ["shape_id"])
    running = sa.text("state = 'running'")
    op.create_index("task_leases", "task", ["lease_until"], sqlite_where=running, postgresql_where=running)
    described = sa.text("kind = 'describe' AND state IN ('queued', 'running')")
    op.create_index(
        "task_one_description", "task", ["shape_id"], unique=True,
        sqlite_where=described, postgresql_where=described,
    )  # fmt: skip
    queued = sa.text("state = 'queued'")
    op.create_index(
        "task_queue", "task", ["priority", "created_at", "id"], sqlite_where=queued, postgresql_where=queued
    )

    op.create_table(
        "endpoint_features",
        sa.Column("shape_id", sa.Text(), nullable=False),
        sa.Column("collection_id", sa.Text(), nullable=False),
        sa.Column("profile_key", sa.Text(), nullable=False),
        sa.Column("pipeline_version", sa.Integer(), nullable=False),
        sa.Column("endpoint_count", sa.Integer(), nullable=False),
        sa.Column("features", sa.LargeBinary(), nullable=False),
        sa.Column("revision", BIG, nullable=False),
        sa.PrimaryKeyConstraint("shape_id"),
        sa.CheckConstraint("endpoint_count >= 0", name="endpoint_features_count"),
        sa.CheckConstraint("length(features) = 24 * endpoint_count", name="endpoint_features_size"),
        sa.ForeignKeyConstraint(["shape_id"], ["shape.id"], ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["collection_id"], ["collection.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )
    op.create_index(
        "endpoint_features_bucket", "endpoint_features", ["collection_id", "profile_key", "endpoint_count"]
    )
    op.create_index("endpoint_features_revision", "endpoint_features", ["collection_id", "revision"])

    op.create_table(
        "skeleton",
        sa.Column("shape_id", sa.Text(), nullable=False),
        sa.Column("profile_key", sa.Text(), nullable=False),
        sa.Column("pipeline_version", sa.Integer(), nullable=False),
        sa.Column("graph", sa.LargeBinary(), nullable=False),
        sa.Column("eigenvalues", sa.LargeBinary(), nullable=False),
        sa.Column("cleaned_sha256", sa.Text(), nullable=False),
        sa.Column("denoised_sha256", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("shape_id"),
        sa.CheckConstraint("length(cleaned_sha256) = 64", name="skeleton_cleaned_sha256_length"),
        sa.CheckConstraint("length(denoised_sha256) = 64", name="skeleton_denoised_sha256_length"),
        sa.ForeignKeyConstraint(["shape_id"], ["shape.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )
    op.create_index("skeleton_by_cleaned", "skeleton", ["cleaned_sha256"])
    op.create_index("skeleton_by_denoised", "skeleton", ["denoised_sha256"])

    op.create_table(
        "health",
        sa.Column("shape_id", sa.Text(), nullable=False),
        sa.Column("profile_key", sa.Text(), nullable=False),
        sa.Column("pipeline_version", sa.Integer(), nullable=False),
        sa.Column("report", sa.Text(), nullable=False),
        sa.Column("seconds", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("shape_id"),
        sa.ForeignKeyConstraint(["shape_id"], ["shape.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )

    op.create_table(
        "descriptor",
        sa.Column("shape_id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("version", sa.Text(), nullable=False),
        sa.Column("values", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("shape_id", "name"),
        sa.CheckConstraint('length("values") % 4 = 0', name="descriptor_size"),
        sa.ForeignKeyConstraint(["shape_id"], ["shape.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )

    op.create_table(
        "tombstone",
        sa.Column("shape_id", sa.Text(), nullable=False),
        sa.Column("collection_id", sa.Text(), nullable=False),
        sa.Column("revision", BIG, nullable=False),
        sa.Column("deleted_at", BIG, nullable=False),
        sa.PrimaryKeyConstraint("shape_id"),
        sa.ForeignKeyConstraint(["collection_id"], ["collection.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )
    op.create_index("tombstone_revision", "tombstone", ["collection_id", "revision"])

    op.create_table(
        "api_key",
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("hash", sa.Text(), nullable=False),
        sa.Column("prefix", sa.Text(), nullable=False),
        sa.Column("scope", sa.Text(), nullable=False),
        sa.Column("collection_id", sa.Text(), nullable=True),
        sa.Column("requests_per_minute", sa.Integer(), nullable=True),
        sa.Column("max_shapes", sa.Integer(), nullable=True),
        sa.Column("created_at", BIG, nullable=False),
        sa.Column("last_used_at", BIG, nullable=True),
        sa.Column("revoked_at", BIG, nullable=True),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("hash", name="api_key_hash_once"),
        sa.CheckConstraint("scope IN ('read', 'write', 'admin')", name="api_key_scope_known"),
        sa.CheckConstraint("length(hash) = 64", name="api_key_hash_length"),
        sa.CheckConstraint(
            "requests_per_minute IS NULL OR requests_per_minute > 0", name="api_key_rate_positive"
        ),
        sa.CheckConstraint("max_shapes IS NULL OR max_shapes >= 0", name="api_key_quota_positive"),
        sa.CheckConstraint("scope <> 'admin' OR collection_id IS NULL", name="api_key_admin_everywhere"),
        sa.ForeignKeyConstraint(["collection_id"], ["collection.id"], ondelete="CASCADE"),
        sqlite_strict=True,
    )
    op.create_index("api_key_by_collection", "api_key", ["collection_id"])

    op.create_table(
        "evaluation",
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("task_id", sa.Text(), nullable=False),
        sa.Column("collection_id", sa.Text(), nullable=True),
        sa.Column("params", sa.Text(), nullable=False),
        sa.Column("report", sa.Text(), nullable=True),
        sa.Column("items", sa.Text(), nullable=True),
        sa.Column("matrix_sha256", sa.Text(), nullable=True),
        sa.Column("created_at", BIG, nullable=False),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("task_id", name="evaluation_task_once"),
        sa.CheckConstraint("(report IS NULL) = (items IS NULL)", name="evaluation_complete"),
        sa.CheckConstraint(
            "matrix_sha256 IS NULL OR length(matrix_sha256) = 64", name="evaluation_matrix_sha256_length"
        ),
        sa.ForeignKeyConstraint(["task_id"], ["task.id"]),
        sqlite_strict=True,
    )
    op.create_index("evaluation_by_matrix", "evaluation", ["matrix_sha256"])

    op.create_table(
        "idempotency",
        sa.Column("key", sa.Text(), nullable=False),
        sa.Column("principal", sa.Text(), nullable=False),
        sa.Column("method", sa.Text(), nullable=False),
        sa.Column("path", sa.Text(), nullable=False),
        sa.Column("fingerprint", sa.Text(), nullable=False),
        sa.Column("holder", sa.Text(), nullable=True),
        sa.Column("locked_until", BIG, nullable=True),
        sa.Column("status", sa.Integer(), nullable=True),
        sa.Column("headers", sa.Text(), nullable=True),
        sa.Column("body", sa.LargeBinary(), nullable=True),
        sa.Column("expires_at", BIG, nullable=False),
        sa.PrimaryKeyConstraint("key", "principal", "method", "path"),
        sa.CheckConstraint("(holder IS NULL) = (locked_until IS NULL)", name="idempotency_lock_whole"),
        sa.CheckConstraint("(holder IS NULL) = (status IS NOT NULL)", name="idempotency_held_or_answered"),
        sa.CheckConstraint(
            "(status IS NULL) = (headers IS NULL) AND (status IS NULL) = (body IS NULL)",
            name="idempotency_answer_whole",
        ),
        sqlite_strict=True,
    )
    op.create_index("idempotency_expiry", "idempotency", ["expires_at"])


def downgrade() -> None:
    op.drop_table("idempotency")
    op.drop_table("evaluation")
    op.drop_table("api_key")
    op.drop_table("tombstone")
    op.drop_table("descriptor")
    op.drop_table("health")
    op.drop_table("skeleton")
    op.drop_table("endpoint_features")
    op.drop_table("task")
    op.drop_table("shape_metadata")
    op.drop_table("shape_tag")
    op.drop_table("shape")
    op.drop_table("collection")
    op.drop_table("revision")
