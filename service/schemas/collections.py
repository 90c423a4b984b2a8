"""Collections on the wire."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from reebase.errors import ReebaseError
from reebase.pipeline import Profile, profile_named
from service.schemas.common import Body, CollectionName, Finite, Moment, Text, Value, printable, refused

__all__ = ["CollectionPatch", "CollectionValue", "Counts", "NewCollection", "ProfileBody"]

_DEFAULT = Profile()

Description = Annotated[str, AfterValidator(printable), Field(max_length=2000)]


class ProfileBody(Body):
    """Parameters of the pipeline; what is left out is as in the `base`, or where none is named has its default."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"denoise": "finite_volume", "iterations": 1, "bands": 64}]}
    )

    base: Text | None = Field(None, description="A profile of `GET /v1/profiles`, as `thesis`.")
    denoise: Text = Field(_DEFAULT.denoise, description="Name of a filter, or `none`.")
    iterations: int = Field(_DEFAULT.iterations, ge=1, le=1000, description="Of the filter.")
    field: Text = Field(_DEFAULT.field, description="Name of the scalar field.")
    bands: int = Field(_DEFAULT.bands, ge=2, le=1024, description="Bands of the Reeb graph.")
    levels: Text = Field(
        _DEFAULT.levels, description="Bands of equal `area`, or of equal `width` in the field as in the thesis."
    )
    saliency: Text = Field(_DEFAULT.saliency, description="What a branch's share is of: `area` or `length`.")
    threshold: Finite = Field(
        _DEFAULT.threshold, ge=0, le=0.99, description="Branches with less than this share are pruned."
    )
    area: Text = Field(_DEFAULT.area, description="Reading of the relative node area: `band` or `ring`.")
    operator: Text = Field(_DEFAULT.operator, description="`cotangent`, `tufted`, or `auto`: tufted where it must be.")

    components: Text = Field(
        _DEFAULT.components,
        description="The skeleton of a shape in several parts: of all, `joined` where they are nearest, or of the "
        "`largest` alone.",
    )

    root: Text = Field(
        _DEFAULT.root,
        description="The root node: the `median`, with the shortest mean way to the whole surface, or the node nearest "
        "to the `centroid`, as in the thesis.",
    )

    @field_validator("denoise", "field", "levels", "saliency", "area", "operator", "components", "root")
    @classmethod
    def _known(cls, name: str, info: ValidationInfo) -> str:
        """Refuse here what the pipeline would."""
        try:
            Profile(**{str(info.field_name): name})  # type: ignore[arg-type]  # each of these is a text
        except ReebaseError as refusal:
            raise refused(refusal) from None
        return name

    @field_validator("base")
    @classmethod
    def _base(cls, name: str | None) -> str | None:
        try:
            if name is not None:
                profile_named(name)
            return name
        except ReebaseError as refusal:
            raise refused(refusal) from None

    def given(self) -> dict[str, Any]:
        """The parameters that were named, by a base or by themselves."""
        own = self.model_dump(exclude_unset=True, exclude={"base"})
        return own if self.base is None else {**profile_named(self.base).to_json(), **own}


class NewCollection(Body):
    """A collection to make."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"name": "animals", "description": "Poses", "profile": {"bands": 64}}]
        }
    )

    name: CollectionName
    description: Description = ""
    profile: ProfileBody = Field(default_factory=lambda: ProfileBody.model_validate({}))


class CollectionPatch(Body):
    """What to change. A new profile queues every shape of the collection to be described again."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"description": "Articulated animals"}]})

    description: Description | None = None
    profile: ProfileBody | None = None

    @model_validator(mode="after")
    def _something(self) -> CollectionPatch:
        if not self.model_fields_set:
            raise ValueError("give at least one of description, profile")
        for name in self.model_fields_set:
            if getattr(self, name) is None:
                raise ValueError(f"{name} must not be null")
        return self


class Counts(Value):
    """How many shapes there are: in all, by state, and indexed ones by endpoint count (the buckets)."""

    shapes: int
    states: dict[str, int] = Field(examples=[{"indexed": 12, "failed": 1}])
    endpoints: dict[str, int] = Field(examples=[{"4": 7, "5": 5}])


class CollectionValue(Value):
    """A collection."""

    name: str
    description: str
    profile: dict[str, Any]
    profile_key: str = Field(description="Hash of the pipeline's version and the profile.")
    counts: Counts
    created_at: Moment
    updated_at: Moment
