"""The in-memory index of endpoint features, bucketed by endpoint count (Kacem, section 4.3.1; METHOD §5).

``Index`` holds shapes by id and answers ``query`` with the k nearest ``Hit``s by a measure of D, exactly.
``Gallery`` holds what any descriptors keep of them and ranks all by any ``Ranking``, fused and re-ranked too.
"""

from reebase.search.gallery import Gallery, Ranked
from reebase.search.index import Hit, Index

__all__ = ["Gallery", "Hit", "Index", "Ranked"]
