"""Denoising of a mesh that is not kept in a collection: a mesh in, a mesh out."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any, Literal

from fastapi import Query
from sqlalchemy import Connection
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from service.auth import Principal, Reader
from service.context import Context, Here
from service.downloads import file_response
from service.forms import model_of_fields
from service.routes.about import WRITTEN
from service.routes.common import IdempotencyKey, IdPath, api_router
from service.routes.documents import DENOISE
from service.routes.tasks import own_task
from service.routes.unkept import answer_of_task, enqueue
from service.schemas.denoise import DenoisedValue, DenoisingParameters, PendingDenoising
from service.uploads import received
from store import outputs
from store.errors import TaskNotFound
from store.records import Task

__all__ = ["router"]

router = api_router("denoising")

TRUTH = "truth"
"""The form's second file."""

_OF_THE_FILE = frozenset({"format", "filename"})

_PENDING: dict[int | str, dict[str, Any]] = {
    202: {
        "description": "The mesh is still being denoised; look at its task.",
        "model": PendingDenoising,
        "headers": {"Location": {"description": "The task.", "schema": {"type": "string"}}},
    },
}
_BINARY: dict[str, Any] = {"schema": {"type": "string", "format": "binary"}}
_MESH: dict[int | str, dict[str, Any]] = {
    200: {"description": "The mesh.", "content": dict.fromkeys(WRITTEN.values(), _BINARY)},
    304: {"description": "Not modified."},
}


@router.post(
    "/denoise", operation_id="denoise", summary="Take the noise from a mesh", response_model=DenoisedValue,
    responses=_PENDING, openapi_extra=DENOISE,
)  # fmt: skip
async def denoise(
    request: Request, here: Here, principal: Reader, idempotency_key: IdempotencyKey = None
) -> Response:
    """What was done, where the mesh is, and with a `truth` beside it the errors before and after.

    Send the mesh as multipart (`file`, perhaps `truth` with the same faces) or its bytes. What is not done within
    `wait` seconds is answered with its task. Triangles that share no vertices, as in STL, are joined first.
    """
    principal.need_everywhere()
    async with received(request, here.blobs, here.settings.max_upload_bytes, beside=(TRUTH,)) as upload:
        asked = model_of_fields(DenoisingParameters, upload.fields, leave=_OF_THE_FILE)
        await run_in_threadpool(_check, asked)
        parts = {name: asdict(part) for name, part in upload.parts.items()}
        params = {**asked.model_dump(exclude={"wait"}), "parts": parts}
        enqueued = await run_in_threadpool(
            enqueue, request, here, principal, upload, "denoise", params, idempotency_key, PendingDenoising
        )
    return await answer_of_task(request, here, enqueued, asked.wait, _value, PendingDenoising)


def _check(asked: DenoisingParameters) -> None:
    """Raises UnknownName, ParameterError."""
    from reebase.denoise import METHODS
    from reebase.errors import unknown_name

    if asked.method not in METHODS:
        raise unknown_name("method", asked.method[:80], METHODS)
    METHODS[asked.method].checked(asked.parameters)


def _value(task: Task) -> DenoisedValue:
    return DenoisedValue.model_validate(
        {"task": task.id, "mesh": f"/v1/denoise/{task.id}/mesh", **(task.result or {})}
    )


def _denoised(conn: Connection, here: Context, principal: Principal, task: str) -> tuple[Task, str]:
    found = own_task(conn, here, principal, task)
    if found.kind != "denoise":
        raise TaskNotFound(f"The task {found.id} denoises no mesh; it is of the kind {found.kind}.")
    return found, outputs.find(conn, found, "mesh")


@router.get("/denoise/{task}", operation_id="getDenoised", summary="What was done to a mesh")
def get_denoised(here: Here, principal: Reader, task: IdPath) -> DenoisedValue:
    """The answer of the request that was answered with this task, once it succeeded.

    Only for the API key that asked, and for those with the scope admin, as the mesh is.
    """
    with here.database.read() as conn:
        return _value(_denoised(conn, here, principal, task)[0])


@router.get(
    "/denoise/{task}/mesh", operation_id="getDenoisedMesh", summary="A denoised mesh", response_class=Response,
    responses=_MESH,
)  # fmt: skip
def get_denoised_mesh(
    request: Request, here: Here, principal: Reader, task: IdPath,
    format: Annotated[Literal["ply", "glb", "obj", "stl", "off"], Query()] = "ply",
) -> Response:  # fmt: skip
    """The mesh; PLY and GLB carry the length of each vertex's way as `displacement`."""
    from reebase.mesh.read import read_scalars
    from reebase.mesh.write import to_bytes

    with here.database.read() as conn:
        _, sha256 = _denoised(conn, here, principal, task)

    def content() -> bytes:
        data = here.blobs.get(sha256)
        if format == "ply":
            return data
        mesh, scalars = read_scalars(data)
        return to_bytes(mesh, format, scalars=scalars if format == "glb" else None)

    return file_response(
        request, content, etag=f"{sha256}-{format}", media_type=WRITTEN[format], filename=f"denoised.{format}"
    )
