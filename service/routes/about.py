"""What the service allows and knows: limits, formats, measures, profiles, filters."""

from __future__ import annotations

from service.auth import Reader
from service.checks import MAX_PAGE
from service.context import Here
from service.routes.common import api_router
from service.schemas.about import (
    DenoisingFilter,
    FiltersValue,
    Format,
    FormatsValue,
    LimitsValue,
    Measure,
    MeasuresValue,
    NamedProfile,
    ProfilesValue,
)

__all__ = ["WRITTEN", "router"]

router = api_router("service")

WRITTEN = {
    "ply": "model/ply",
    "glb": "model/gltf-binary",
    "obj": "model/obj",
    "stl": "model/stl",
    "off": "model/off",
}
"""Formats that a shape's meshes are given back in, with their media types."""


@router.get("/limits", operation_id="getLimits", summary="What a request may hold")
def limits(here: Here, _: Reader) -> LimitsValue:
    """The limits of this service; they are settings."""
    values = here.settings.model_dump()
    chosen = {name: values[name] for name in LimitsValue.model_fields if name in values}
    return LimitsValue(**chosen, max_page=MAX_PAGE)


@router.get("/formats", operation_id="listFormats", summary="Formats")
def formats(_: Reader) -> FormatsValue:
    """What can be uploaded, and what meshes are given back in."""
    from reebase.mesh.read import FORMATS

    known = [Format(name=name, media_type=media_type) for name, media_type in FORMATS.items()]
    return FormatsValue(items=known, written=list(WRITTEN))


@router.get("/measures", operation_id="listMeasures", summary="Measures of D")
def measures(_: Reader) -> MeasuresValue:
    """The dissimilarities that a query or an evaluation can name."""
    from reebase.matching import MEASURES

    known = [Measure(name=measure.name, description=measure.summary) for measure in MEASURES.values()]
    return MeasuresValue(items=known, default="matching")


@router.get("/profiles", operation_id="listProfiles", summary="Profiles")
def profiles(_: Reader) -> ProfilesValue:
    """Parameters of the pipeline by name, what a profile's `base` can be."""
    from reebase.pipeline import PROFILES

    known = [NamedProfile(name=name, profile=profile.to_json()) for name, profile in PROFILES.items()]
    return ProfilesValue(items=known, default="default")


@router.get("/filters", operation_id="listFilters", summary="Denoising filters")
def filters(_: Reader) -> FiltersValue:
    """What a profile's `denoise` can name."""
    from reebase.denoise import METHODS
    from reebase.pipeline import Profile

    known = [DenoisingFilter(name=method.name, description=method.summary) for method in METHODS.values()]
    none = DenoisingFilter(name="none", description="leaves the mesh as it is")
    return FiltersValue(items=[*known, none], default=Profile().denoise)
