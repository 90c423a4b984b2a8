"""The tables. ``migrations/`` builds exactly these; a test compares the two.

Every invariant that a bug could break stands here as a constraint, with its reason beside it.
Tables are STRICT on SQLite, so that a column holds the type it names.
"""

from __future__ import annotations

from sqlalchemy import (
    CheckConstraint,
    Column,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
    exists,
    text,
)

from store.sql import BIG, DOUBLE, Json, Moment

__all__ = [
    "api_key", "collection", "described", "descriptor", "endpoint_features", "evaluation", "health", "idempotency",
    "metadata", "present", "revision", "shape", "shape_metadata", "shape_tag", "skeleton", "task",
    "task_output", "tombstone",
]  # fmt: skip

metadata = MetaData()

collection = Table(
    "collection",
    metadata,
    Column("id", Text, primary_key=True),
    Column("name", Text, nullable=False),
    Column("description", Text, nullable=False),
    # All parameters of the pipeline, not only those given: a later default must not change the past.
    Column("profile", Json, nullable=False),
    Column("profile_key", Text, nullable=False),
    Column("created_at", Moment, nullable=False),
    Column("updated_at", Moment, nullable=False),
    UniqueConstraint("name", name="collection_name_once"),
    CheckConstraint("length(name) BETWEEN 1 AND 63", name="collection_name_length"),
    sqlite_strict=True,
)

shape = Table(
    "shape",
    metadata,
    Column("id", Text, primary_key=True),
    Column("collection_id", Text, ForeignKey("collection.id", ondelete="CASCADE"), nullable=False),
    Column("sha256", Text, nullable=False),
    Column("bytes", BIG, nullable=False),
    Column("format", Text, nullable=False),
    Column("filename", Text),
    Column("name", Text, nullable=False),
    Column("label", Text),
    Column("metadata", Json, nullable=False),
    Column("state", Text, nullable=False),
    # The task that the state follows. No foreign key: the two rows point at each other.
    Column("task_id", Text),
    # The API key that uploaded it, for quotas; it may be gone by now.
    Column("owner", Text),
    Column("created_at", Moment, nullable=False),
    Column("updated_at", Moment, nullable=False),
    # When it was deleted. Until the sweep purges it, it can be restored; to everyone else it is gone.
    Column("deleted_at", Moment),
    CheckConstraint("length(sha256) = 64", name="shape_sha256_length"),
    CheckConstraint("bytes >= 0", name="shape_bytes_positive"),
    CheckConstraint(
        "state IN ('queued', 'running', 'indexed', 'failed', 'cancelled')", name="shape_state_known"
    ),
    # The same bytes twice are one shape, also when both uploads run at once. A deleted shape does not count:
    # its bytes may come again before it is purged.
    Index(
        "shape_bytes_once", "collection_id", "sha256", unique=True,
        sqlite_where=text("deleted_at IS NULL"), postgresql_where=text("deleted_at IS NULL"),
    ),
    Index(
        "shape_deleted", "deleted_at",
        sqlite_where=text("deleted_at IS NOT NULL"), postgresql_where=text("deleted_at IS NOT NULL"),
    ),
    Index("shape_by_label", "collection_id", "label"),
    Index("shape_by_name", "collection_id", "name"),
    Index("shape_by_owner", "owner"),
    Index("shape_by_task", "task_id"),
    # The sweep asks of every blob whether a shape still names it.
    Index("shape_by_sha256", "sha256"),
    sqlite_strict=True,
)  # fmt: skip

present = shape.c.deleted_at.is_(None)
"""Whoever asks for shapes asks for this: a deleted one is only there for those who restore it."""

# Tags and metadata stand in rows of their own so that filters use an index on every database.
shape_tag = Table(
    "shape_tag",
    metadata,
    Column("shape_id", Text, ForeignKey("shape.id", ondelete="CASCADE"), primary_key=True),
    Column("tag", Text, primary_key=True),
    Index("shape_tag_by_tag", "tag", "shape_id"),
    sqlite_strict=True,
)

shape_metadata = Table(
    "shape_metadata",
    metadata,
    Column("shape_id", Text, ForeignKey("shape.id", ondelete="CASCADE"), primary_key=True),
    Column("key", Text, primary_key=True),
    # Canonical JSON, so that equality of values is equality of text.
    Column("value", Text, nullable=False),
    Index("shape_metadata_by_key", "key", "shape_id"),
    sqlite_strict=True,
)

task = Table(
    "task",
    metadata,
    Column("id", Text, primary_key=True),
    Column("kind", Text, nullable=False),
    Column("state", Text, nullable=False),
    # Lower goes first: someone waits for a query.
    Column("priority", Integer, nullable=False),
    # No foreign keys: a task outlives what it was about, as the record of what happened.
    Column("collection_id", Text),
    Column("shape_id", Text),
    Column("params", Json, nullable=False),
    Column("blob", Text),
    Column("result", Json),
    Column("error_code", Text),
    Column("error_detail", Json),
    Column("stage", Text),
    Column("fraction", DOUBLE, nullable=False),
    # The fencing token: every claim raises it, and only the latest claim may write.
    Column("attempt", Integer, nullable=False),
    Column("crashes", Integer, nullable=False),
    Column("cancel_requested", Integer, nullable=False),
    Column("worker", Text),
    Column("lease_until", Moment),
    Column("created_at", Moment, nullable=False),
    Column("started_at", Moment),
    Column("finished_at", Moment),
    CheckConstraint(
        "kind IN ('describe', 'query', 'evaluate', 'denoise', 'duplicates', 'map', 'synthesise', 'report')",
        name="task_kind_known",
    ),
    CheckConstraint(
        "state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')", name="task_state_known"
    ),
    # A running task without a lease would never be retaken; a lease on another could be.
    CheckConstraint("(state = 'running') = (lease_until IS NOT NULL)", name="task_lease_while_running"),
    CheckConstraint("(state = 'running') = (worker IS NOT NULL)", name="task_worker_while_running"),
    CheckConstraint(
        "(state IN ('succeeded', 'failed', 'cancelled')) = (finished_at IS NOT NULL)",
        name="task_finished_at_end",
    ),
    CheckConstraint("(state = 'failed') = (error_code IS NOT NULL)", name="task_failure_has_code"),
    CheckConstraint("result IS NULL OR state = 'succeeded'", name="task_result_of_success"),
    CheckConstraint("kind <> 'describe' OR shape_id IS NOT NULL", name="task_describes_a_shape"),
    CheckConstraint("fraction BETWEEN 0 AND 1", name="task_fraction_range"),
    CheckConstraint("attempt >= 0 AND crashes >= 0", name="task_counts_positive"),
    CheckConstraint("cancel_requested IN (0, 1)", name="task_cancel_flag"),
    # One live description a shape: two would race to write the same rows.
    Index(
        "task_one_description", "shape_id", unique=True,
        sqlite_where=text("kind = 'describe' AND state IN ('queued', 'running')"),
        postgresql_where=text("kind = 'describe' AND state IN ('queued', 'running')"),
    ),
    # The order of claiming.
    Index(
        "task_queue", "priority", "created_at", "id",
        sqlite_where=text("state = 'queued'"), postgresql_where=text("state = 'queued'"),
    ),
    Index(
        "task_leases", "lease_until",
        sqlite_where=text("state = 'running'"), postgresql_where=text("state = 'running'"),
    ),
    # What ended lately, for those who watch.
    Index(
        "task_by_end", "finished_at",
        sqlite_where=text("finished_at IS NOT NULL"), postgresql_where=text("finished_at IS NOT NULL"),
    ),
    Index("task_by_shape", "shape_id"),
    # The latest of a kind in a collection, however many shapes were described since.
    Index("task_by_collection", "collection_id", "kind", "id"),
    # The sweep asks of every blob whether a live task still names it.
    Index(
        "task_by_blob", "blob",
        sqlite_where=text("blob IS NOT NULL"), postgresql_where=text("blob IS NOT NULL"),
    ),
    sqlite_strict=True,
)  # fmt: skip

# What a task made that is no JSON, by name: a mesh, a picture. Kept as long as the task.
task_output = Table(
    "task_output",
    metadata,
    Column("task_id", Text, ForeignKey("task.id", ondelete="CASCADE"), primary_key=True),
    Column("name", Text, primary_key=True),
    Column("sha256", Text, nullable=False),
    CheckConstraint("length(sha256) = 64", name="task_output_sha256_length"),
    Index("task_output_by_sha256", "sha256"),
    sqlite_strict=True,
)

# What the pipeline learnt of a shape: one row each, replaced when it is described again.
# ``profile_key`` hashes the pipeline's version and parameters; only equal keys are compared.
endpoint_features = Table(
    "endpoint_features",
    metadata,
    Column("shape_id", Text, ForeignKey("shape.id", ondelete="CASCADE"), primary_key=True),
    # Repeated here so that the index of a collection loads without a join.
    Column("collection_id", Text, ForeignKey("collection.id", ondelete="CASCADE"), nullable=False),
    Column("profile_key", Text, nullable=False),
    Column("pipeline_version", Integer, nullable=False),
    # The bucket.
    Column("endpoint_count", Integer, nullable=False),
    # count x 3 float64, little endian.
    Column("features", LargeBinary, nullable=False),
    Column("revision", BIG, nullable=False),
    CheckConstraint("endpoint_count >= 0", name="endpoint_features_count"),
    # A row whose bytes do not fit its count would be read as other numbers.
    CheckConstraint("length(features) = 24 * endpoint_count", name="endpoint_features_size"),
    Index("endpoint_features_bucket", "collection_id", "profile_key", "endpoint_count"),
    Index("endpoint_features_revision", "collection_id", "revision"),
    sqlite_strict=True,
)

described = (
    exists()
    .where(endpoint_features.c.shape_id == shape.c.id, collection.c.id == endpoint_features.c.collection_id)
    .where(collection.c.profile_key == endpoint_features.c.profile_key)
    .correlate(shape)
)
"""Whether a shape is described under the present profile of its collection, so that searches find it."""

skeleton = Table(
    "skeleton",
    metadata,
    Column("shape_id", Text, ForeignKey("shape.id", ondelete="CASCADE"), primary_key=True),
    Column("profile_key", Text, nullable=False),
    Column("pipeline_version", Integer, nullable=False),
    # The graph's arrays as npz.
    Column("graph", LargeBinary, nullable=False),
    # First eigenvalues at unit area, float64, little endian.
    Column("eigenvalues", LargeBinary, nullable=False),
    # Blobs: PLY of the meshes; the denoised one carries the scalar field.
    Column("cleaned_sha256", Text, nullable=False),
    Column("denoised_sha256", Text, nullable=False),
    # Blobs: a small picture (WebP or PNG) and a mesh light enough to be drawn (GLB). None in descriptions of
    # before they were made.
    Column("thumbnail_sha256", Text),
    Column("display_sha256", Text),
    # The skeleton whose endpoints `extended` matches, as npz; none where that is not kept.
    Column("limbs", LargeBinary),
    # Of a shape in several parts the skeleton of each by itself, packed.
    Column("parts", LargeBinary),
    CheckConstraint("length(cleaned_sha256) = 64", name="skeleton_cleaned_sha256_length"),
    CheckConstraint("length(denoised_sha256) = 64", name="skeleton_denoised_sha256_length"),
    CheckConstraint(
        "thumbnail_sha256 IS NULL OR length(thumbnail_sha256) = 64", name="skeleton_thumbnail_sha256_length"
    ),
    CheckConstraint("display_sha256 IS NULL OR length(display_sha256) = 64", name="skeleton_display_sha256_length"),
    Index("skeleton_by_cleaned", "cleaned_sha256"),
    Index("skeleton_by_denoised", "denoised_sha256"),
    Index("skeleton_by_thumbnail", "thumbnail_sha256"),
    Index("skeleton_by_display", "display_sha256"),
    sqlite_strict=True,
)

health = Table(
    "health",
    metadata,
    Column("shape_id", Text, ForeignKey("shape.id", ondelete="CASCADE"), primary_key=True),
    Column("profile_key", Text, nullable=False),
    Column("pipeline_version", Integer, nullable=False),
    Column("report", Json, nullable=False),
    # Stage -> seconds.
    Column("seconds", Json, nullable=False),
    sqlite_strict=True,
)

descriptor = Table(
    "descriptor",
    metadata,
    Column("shape_id", Text, ForeignKey("shape.id", ondelete="CASCADE"), primary_key=True),
    Column("name", Text, primary_key=True),
    Column("version", Text, nullable=False),
    # Numbers in a row of ``values``; a vector is one row.
    Column("width", Integer, nullable=False),
    # float32, little endian.
    Column("values", LargeBinary, nullable=False),
    # Where the rows lie on the denoised mesh, when they are endpoints: rows x 3 float32, little endian.
    Column("positions", LargeBinary),
    CheckConstraint("width > 0", name="descriptor_width"),
    CheckConstraint('length("values") % (4 * width) = 0', name="descriptor_size"),
    CheckConstraint(
        'positions IS NULL OR length(positions) * width = length("values") * 3', name="descriptor_positions_size"
    ),
    sqlite_strict=True,
)

# One row: the counter that every change of what is searched bumps, inside its transaction.
# Bumping it first serialises such transactions, so a reader never sees revision r before r - 1.
revision = Table(
    "revision",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("value", BIG, nullable=False),
    # Tombstones up to here are purged: whoever has seen less loads anew.
    Column("floor", BIG, nullable=False),
    CheckConstraint("id = 1", name="revision_one_row"),
    CheckConstraint("floor <= value", name="revision_floor"),
    sqlite_strict=True,
)

# Shapes that were deleted, for those who follow the revision.
tombstone = Table(
    "tombstone",
    metadata,
    Column("shape_id", Text, primary_key=True),
    Column("collection_id", Text, ForeignKey("collection.id", ondelete="CASCADE"), nullable=False),
    Column("revision", BIG, nullable=False),
    Column("deleted_at", Moment, nullable=False),
    Index("tombstone_revision", "collection_id", "revision"),
    sqlite_strict=True,
)

api_key = Table(
    "api_key",
    metadata,
    Column("id", Text, primary_key=True),
    Column("name", Text, nullable=False),
    # SHA-256 of the secret; the secret itself is shown once and kept nowhere.
    Column("hash", Text, nullable=False),
    # The first characters of the secret, so that people can tell keys apart.
    Column("prefix", Text, nullable=False),
    Column("scope", Text, nullable=False),
    # A key for one collection goes with it.
    Column("collection_id", Text, ForeignKey("collection.id", ondelete="CASCADE")),
    Column("requests_per_minute", Integer),
    Column("max_shapes", Integer),
    Column("created_at", Moment, nullable=False),
    Column("last_used_at", Moment),
    Column("revoked_at", Moment),
    UniqueConstraint("hash", name="api_key_hash_once"),
    CheckConstraint("scope IN ('read', 'write', 'admin')", name="api_key_scope_known"),
    CheckConstraint("length(hash) = 64", name="api_key_hash_length"),
    CheckConstraint("requests_per_minute IS NULL OR requests_per_minute > 0", name="api_key_rate_positive"),
    CheckConstraint("max_shapes IS NULL OR max_shapes >= 0", name="api_key_quota_positive"),
    # An admin key sees everything, so it cannot belong to one collection.
    CheckConstraint("scope <> 'admin' OR collection_id IS NULL", name="api_key_admin_everywhere"),
    Index("api_key_by_collection", "collection_id"),
    sqlite_strict=True,
)

evaluation = Table(
    "evaluation",
    metadata,
    Column("id", Text, primary_key=True),
    Column("task_id", Text, ForeignKey("task.id"), nullable=False),
    # No foreign key: the report outlives the collection.
    Column("collection_id", Text),
    Column("params", Json, nullable=False),
    Column("report", Json),
    # The rows of the matrix in order: id, name, label.
    Column("items", Json),
    # Blob: the dissimilarity matrix as npy.
    Column("matrix_sha256", Text),
    Column("created_at", Moment, nullable=False),
    UniqueConstraint("task_id", name="evaluation_task_once"),
    # A report and its rows come together.
    CheckConstraint("(report IS NULL) = (items IS NULL)", name="evaluation_complete"),
    CheckConstraint("matrix_sha256 IS NULL OR length(matrix_sha256) = 64", name="evaluation_matrix_sha256_length"),
    Index("evaluation_by_matrix", "matrix_sha256"),
    sqlite_strict=True,
)

idempotency = Table(
    "idempotency",
    metadata,
    Column("key", Text, primary_key=True),
    Column("principal", Text, primary_key=True),
    Column("method", Text, primary_key=True),
    Column("path", Text, primary_key=True),
    Column("fingerprint", Text, nullable=False),
    Column("status", Integer, nullable=False),
    Column("headers", Json, nullable=False),
    Column("body", LargeBinary, nullable=False),
    Column("expires_at", Moment, nullable=False),
    Index("idempotency_expiry", "expires_at"),
    sqlite_strict=True,
)
