"""The typed client of the HTTP service.

    with Client("http://127.0.0.1:8000") as service:
        service.create_collection("zoo")
        upload = service.upload("zoo", "octopus.ply", label="octopuses")
        service.wait(upload.task)
        for hit in service.query("zoo", shape=upload.shape.id).hits:
            print(hit.rank, hit.shape.name, hit.dissimilarity)

Every refusal of the service is raised as a ServiceError with the service's own stable ``code`` and words. A request
is repeated while the connection breaks or the service is busy, where that is safe: reads and changes always, whatever
creates something under an Idempotency-Key, anything else only when it was surely not done.
"""

from reebase.errors import MissingPackage

try:
    from reebase.client.client import Client
    from reebase.client.errors import (
        RequestBroken,
        ServiceError,
        ServiceUnreachable,
        TaskFailed,
        UnexpectedReply,
        WaitTimeout,
    )
    from reebase.client.records import (
        Answer,
        Choice,
        Collection,
        Counts,
        Coverage,
        Denoised,
        DenoisingPart,
        Descriptor,
        Duplicate,
        Duplicates,
        Errors,
        Evaluation,
        Failure,
        Filter,
        Formats,
        Hit,
        HitShape,
        Matrix,
        Measure,
        Pair,
        Part,
        PartMatch,
        Progress,
        Readiness,
        ServiceLimits,
        Shape,
        Task,
        Unmatched,
        Upload,
    )
    from reebase.client.requests import Source
except ModuleNotFoundError as missing:  # pragma: no cover - depends on what is installed
    if missing.name != "httpx":
        raise
    raise MissingPackage("The client needs httpx: pip install 'reebase[client]'.") from missing

__all__ = [
    "Answer", "Choice", "Client", "Collection", "Counts", "Coverage", "Denoised", "DenoisingPart", "Descriptor",
    "Duplicate", "Duplicates", "Errors", "Evaluation", "Failure", "Filter", "Formats", "Hit", "HitShape", "Matrix",
    "Measure", "Pair", "Part", "PartMatch", "Progress", "Readiness", "RequestBroken", "ServiceError", "ServiceLimits",
    "ServiceUnreachable", "Shape", "Source", "Task", "TaskFailed", "UnexpectedReply", "Unmatched", "Upload",
    "WaitTimeout",
]  # fmt: skip
