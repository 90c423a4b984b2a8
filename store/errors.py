"""Every error that the store raises on purpose.

ReebaseError
└── StoreError               store_error
    ├── NotFound             not_found                a name or id that is not there
    │   ├── CollectionNotFound   collection_not_found
    │   ├── ShapeNotFound        shape_not_found
    │   ├── TaskNotFound         task_not_found
    │   ├── EvaluationNotFound   evaluation_not_found
    │   ├── KeyNotFound          key_not_found
    │   ├── ResultNotFound       result_not_found     the shape is there, what it needs is not computed
    │   └── BlobNotFound         blob_not_found
    ├── Conflict             conflict                 the state of things forbids it
    │   ├── CollectionExists     collection_exists
    │   ├── ShapeExists          shape_exists         another shape has the bytes of the one to be restored
    │   ├── TaskExists           task_exists
    │   ├── TaskNotCancellable   task_not_cancellable
    │   ├── TaskNotRetryable     task_not_retryable
    │   ├── ProfileChanged       profile_changed      a mesh was described under another profile
    │   ├── NothingToCompare     nothing_to_compare   no shape has what the descriptor compares
    │   ├── IdempotencyConflict  idempotency_conflict
    │   └── TargetNotEmpty       target_not_empty
    ├── InvalidCursor        invalid_cursor
    ├── QuotaExceeded        quota_exceeded
    ├── StaleClaim           stale_claim              the worker no longer holds the task
    ├── CorruptBlob          corrupt_blob
    ├── CorruptBackup        corrupt_backup
    ├── StoreBusy            store_busy
    ├── StorageFull          storage_full
    └── UnsupportedDatabase  unsupported_database
"""

from __future__ import annotations

from reebase.errors import ReebaseError

__all__ = [
    "BlobNotFound", "CollectionExists", "CollectionNotFound", "Conflict", "CorruptBackup", "CorruptBlob",
    "EvaluationNotFound", "IdempotencyConflict", "InvalidCursor", "KeyNotFound",
    "NotFound", "NothingToCompare", "ProfileChanged", "QuotaExceeded", "ResultNotFound", "ShapeExists", "ShapeNotFound",
    "StaleClaim", "StorageFull",
    "StoreBusy", "StoreError", "TargetNotEmpty", "TaskExists", "TaskNotCancellable", "TaskNotFound",
    "TaskNotRetryable", "UnsupportedDatabase",
]  # fmt: skip


class StoreError(ReebaseError):
    """The store refuses this or could not do it."""

    code = "store_error"


class NotFound(StoreError):
    """There is nothing by that name or id."""

    code = "not_found"


class CollectionNotFound(NotFound):
    """There is no collection by that name."""

    code = "collection_not_found"


class ShapeNotFound(NotFound):
    """There is no shape by that id in this collection."""

    code = "shape_not_found"


class TaskNotFound(NotFound):
    """There is no task by that id."""

    code = "task_not_found"


class EvaluationNotFound(NotFound):
    """There is no evaluation by that id."""

    code = "evaluation_not_found"


class KeyNotFound(NotFound):
    """There is no API key by that id."""

    code = "key_not_found"


class ResultNotFound(NotFound):
    """The result is not computed yet, or its computation failed; the detail says which."""

    code = "result_not_found"


class BlobNotFound(NotFound):
    """There is no blob with that hash."""

    code = "blob_not_found"


class Conflict(StoreError):
    """The present state forbids this."""

    code = "conflict"


class CollectionExists(Conflict):
    """There is already a collection by that name."""

    code = "collection_exists"


class ShapeExists(Conflict):
    """The collection has another shape with these bytes, which were uploaded again after the deletion."""

    code = "shape_exists"


class TaskExists(Conflict):
    """The shape already has a task that is queued or running."""

    code = "task_exists"


class TaskNotCancellable(Conflict):
    """The task has ended, so it cannot be cancelled."""

    code = "task_not_cancellable"


class TaskNotRetryable(Conflict):
    """Only a task that failed or was cancelled can be retried."""

    code = "task_not_retryable"


class ProfileChanged(Conflict):
    """The collection has had another profile since the mesh was described, so the two cannot be compared."""

    code = "profile_changed"


class NothingToCompare(Conflict):
    """No shape of the collection has what the descriptor compares."""

    code = "nothing_to_compare"


class IdempotencyConflict(Conflict):
    """This Idempotency-Key was used before with another request; take a new key."""

    code = "idempotency_conflict"


class TargetNotEmpty(Conflict):
    """The target is not empty; nothing was written."""

    code = "target_not_empty"


class InvalidCursor(StoreError):
    """The cursor is not one that a previous page gave."""

    code = "invalid_cursor"


class QuotaExceeded(StoreError):
    """The API key's quota of shapes is used up."""

    code = "quota_exceeded"


class StaleClaim(StoreError):
    """The task is no longer held by this claim, so its result was not written."""

    code = "stale_claim"


class CorruptBlob(StoreError):
    """The bytes of a blob do not have its hash."""

    code = "corrupt_blob"


class CorruptBackup(StoreError):
    """The backup is not complete or not as it was written; nothing was restored."""

    code = "corrupt_backup"


class StoreBusy(StoreError):
    """Another process kept the database locked for too long; try again."""

    code = "store_busy"


class StorageFull(StoreError):
    """There is no space left to write to; nothing was stored."""

    code = "storage_full"


class UnsupportedDatabase(StoreError):
    """This database cannot be used."""

    code = "unsupported_database"
