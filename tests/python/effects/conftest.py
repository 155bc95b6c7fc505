"""What tests of effects share."""

from collections.abc import Iterator

import pytest

import sysid_vehicle as sv


@pytest.fixture
def no_effects_left() -> Iterator[None]:
    """Forget the effects that a test registers."""
    before = {e.id for e in sv.catalogue()}
    yield
    for e in sv.catalogue():
        if e.id not in before:
            sv.forget_effect(e.id)
