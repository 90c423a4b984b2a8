"""The error tree: drawn as it is, with codes that never collide."""

from __future__ import annotations

import re

from reebase.errors import ReebaseError
from store import errors


def test_the_drawing_is_the_tree() -> None:
    drawn = dict(re.findall(r"[├└]── (\w+) +(\w+)", errors.__doc__ or ""))
    found = {name: getattr(errors, name).code for name in errors.__all__}
    assert drawn == found
    assert sorted(errors.__all__) == list(errors.__all__)


def test_codes_are_unique_and_messages_are_sentences() -> None:
    classes = [getattr(errors, name) for name in errors.__all__]
    assert len({error.code for error in classes}) == len(classes)
    for error in classes:
        assert issubclass(error, ReebaseError)
        assert error().message.endswith(".")
