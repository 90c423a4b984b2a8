"""The skeleton of each part of a shape; collections of before keep the largest part and the centroid as root."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

_BEFORE = {"components": "largest", "root": "centroid"}


def upgrade() -> None:
    # So it was before profiles said so; a later default must not change these.
    _profiles(lambda profile: {**_BEFORE, **profile})
    op.add_column("skeleton", sa.Column("parts", sa.LargeBinary(), nullable=True))


def downgrade() -> None:
    _profiles(lambda profile: {name: value for name, value in profile.items() if name not in _BEFORE})
    op.drop_column("skeleton", "parts")


def _profiles(change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    table = sa.table("collection", sa.column("id", sa.Text()), sa.column("profile", sa.JSON()))
    for row in op.get_bind().execute(sa.select(table)).all():
        op.execute(sa.update(table).where(table.c.id == row.id).values(profile=change(row.profile)))
