"""What can rank, of which shapes it is kept, and how the others get it."""

from __future__ import annotations

from service.auth import Reader, Writer
from service.context import Here
from service.routes.common import CollectionPath, api_router, open_collection
from service.schemas.rankings import (
    CoverageValue,
    DescriptorCoverage,
    DescriptorsValue,
    DescriptorValue,
    ReindexBody,
    ReindexValue,
)
from store import descriptors, tasks
from store.descriptors import SRG

__all__ = ["router"]

router = api_router("rankings")

_FUSED = "All its parts at once, each in units of the collection; with rerank refined by nearest neighbours."


@router.get("/descriptors", operation_id="listDescriptors", summary="What can rank")
def list_descriptors(here: Here, _: Reader) -> DescriptorsValue:
    """Everything that a query or an evaluation can name as `descriptor`, with its measures."""
    from reebase.descriptors import DESCRIPTORS
    from reebase.ranking import DEFAULT, FUSED, PARTS

    kept = {SRG, *here.settings.descriptors}
    fused = DescriptorValue(
        name=FUSED, description=_FUSED, measures=[], rerank=True, parts=list(PARTS), kept=kept.issuperset(PARTS),
        explained=any(DESCRIPTORS[part].comparison.explain is not None for part in PARTS),
    )  # fmt: skip
    single = [
        DescriptorValue(
            name=one.name, description=one.summary, measures=list(one.measures), rerank=False, parts=[one.name],
            kept=one.name in kept, explained=one.comparison.explain is not None,
        )
        for one in DESCRIPTORS.values()
    ]  # fmt: skip
    return DescriptorsValue(items=[fused, *single], default=DEFAULT)


@router.get(
    "/collections/{collection}/descriptors", operation_id="getCoverage", summary="Of which shapes what is kept"
)
def get_coverage(here: Here, principal: Reader, collection: CollectionPath) -> CoverageValue:
    """How many shapes have each descriptor; those that lack one are left out of rankings by it."""
    from reebase.descriptors import DESCRIPTORS

    with here.database.read() as conn:
        found = descriptors.coverage(conn, open_collection(conn, principal, collection), list(DESCRIPTORS))
    described = found[SRG]
    items = [
        DescriptorCoverage(
            name=name, kept=name in {SRG, *here.settings.descriptors}, shapes=shapes, lacking=described - shapes
        )
        for name, shapes in found.items()
    ]
    return CoverageValue(described=described, items=items)


@router.post(
    "/collections/{collection}/reindex", operation_id="reindexCollection", status_code=202,
    summary="Describe again what lacks something",
)  # fmt: skip
def reindex_collection(
    here: Here, principal: Writer, collection: CollectionPath, body: ReindexBody | None = None
) -> ReindexValue:
    """Queue every described shape that lacks a descriptor which this service keeps, or one that is named.

    The others stay as they are, and a shape can be found by what it has while it waits. What a shape was given once
    it is given again whenever it is described.
    """
    asked = [name for name in (body.descriptors if body else []) if name != SRG]
    with here.database.write() as conn:
        opened = open_collection(conn, principal, collection)
        lacking = descriptors.lacking(conn, opened, {descriptors.DUPLICATES, *here.settings.descriptors, *asked})
        params = {"descriptors": asked} if asked else {}
        return ReindexValue(queued=tasks.describe_anew(conn, opened.id, frozenset(lacking), params))
