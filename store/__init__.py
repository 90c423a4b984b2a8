"""What service and worker share, and the only room that knows SQL.

Places: ``settings``, ``engine`` (one writer, readers beside it), ``blobs`` (bytes by hash), ``migrate``.
Rows: ``collections``, ``shapes``, ``tasks``, ``results``, ``evaluations``, ``keys``, ``idempotency``. Their
functions take a connection first, so that a caller composes one transaction, and return ``records``.
Above them: ``follower`` (the index in memory), ``answers``, ``overview``, ``sweep``, ``backup``.
"""
