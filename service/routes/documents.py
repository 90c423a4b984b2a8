"""OpenAPI for the routes that read their bodies themselves, because these are meshes that stream."""

from __future__ import annotations

from typing import Any

__all__ = ["DENOISE", "QUERY", "UPLOAD"]

_BYTES: dict[str, Any] = {"schema": {"type": "string", "format": "binary"}}

_ABOUT_SHAPE: dict[str, dict[str, Any]] = {
    "name": {"type": "string", "description": "By default the file's name."},
    "label": {"type": "string", "description": "Class, for filters and evaluation."},
    "tags": {
        "type": "array",
        "items": {"type": "string"},
        "description": "Repeated, or separated by commas.",
    },
    "metadata": {"type": "string", "description": "A JSON object.", "examples": ['{"source": "scan"}']},
    "format": {"type": "string", "description": "One of /v1/formats, where content and name do not tell."},
}

_ABOUT_QUERY: dict[str, dict[str, Any]] = {
    "k": {"type": "integer", "minimum": 1, "default": 10},
    "descriptor": {"type": "string", "description": "What ranks: one of /v1/descriptors, which names the default."},
    "measure": {"type": "string", "description": "How that is compared; by default its first measure."},
    "rerank": {"type": "boolean", "description": "Of `fused`; the default is yes."},
    "tolerance": {"type": "string", "description": "Whole number, or `null` for any. Default: 2 for `srg`, else any."},
    "label": {"type": "string"},
    "tags": {"type": "array", "items": {"type": "string"}},
    "metadata": {"type": "string", "description": "A JSON object."},
    "max_dissimilarity": {"type": "number", "minimum": 0},
    "format": {"type": "string"},
}


_ABOUT_DENOISING: dict[str, dict[str, Any]] = {
    "method": {"type": "string", "description": "One of /v1/filters, but `none`.", "default": "auto"},
    "iterations": {"type": "integer", "minimum": 1, "maximum": 1000, "default": 1},
    "boundary": {"type": "string", "enum": ["curve", "fixed", "free"], "default": "curve"},
    "parameters": {
        "type": "string", "description": "A JSON object: the method's, by name.", "examples": ['{"step": 0.5}'],
    },
    "wait": {"type": "number", "minimum": 0, "maximum": 60, "default": 30},
    "format": {"type": "string", "description": "One of /v1/formats, where content and name do not tell."},
}  # fmt: skip
_TRUTH = {"type": "string", "format": "binary", "description": "The true mesh, with the same faces."}


def _parameters(fields: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    return [
        {
            "name": name, "in": "query", "required": False,
            "description": f"{schema.get('description', '')} For a body of bytes.".strip(),
            "schema": {key: value for key, value in schema.items() if key not in {"description", "examples"}},
        }
        for name, schema in fields.items()
    ]  # fmt: skip


def _form(fields: dict[str, dict[str, Any]]) -> dict[str, Any]:
    file = {"type": "string", "format": "binary", "description": "The mesh."}
    properties = {"file": file, **fields}
    return {
        "schema": {
            "type": "object",
            "properties": properties,
            "required": ["file"],
            "additionalProperties": False,
        }
    }


UPLOAD: dict[str, Any] = {
    "parameters": [
        *_parameters(_ABOUT_SHAPE),
        {"name": "filename", "in": "query", "required": False, "schema": {"type": "string"},
         "description": "The file's own name. For a body of bytes."},
    ],
    "requestBody": {
        "required": True,
        "content": {"multipart/form-data": _form(_ABOUT_SHAPE), "application/octet-stream": _BYTES},
    },
}  # fmt: skip
"""POST …/shapes."""

QUERY: dict[str, Any] = {
    "parameters": [
        *_parameters(_ABOUT_QUERY),
        {"name": "wait", "in": "query", "required": False, "description": "Seconds, for a query by mesh.",
         "schema": {"type": "number", "minimum": 0, "maximum": 60, "default": 30}},
    ],
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {"schema": {"$ref": "#/components/schemas/QueryBody"}},
            "multipart/form-data": _form(_ABOUT_QUERY),
            "application/octet-stream": _BYTES,
        },
    },
}  # fmt: skip
"""POST …/query."""

DENOISE: dict[str, Any] = {
    "parameters": _parameters(_ABOUT_DENOISING),
    "requestBody": {
        "required": True,
        "content": {
            "multipart/form-data": _form({**_ABOUT_DENOISING, "truth": _TRUTH}),
            "application/octet-stream": _BYTES,
        },
    },
}
"""POST /v1/denoise."""
