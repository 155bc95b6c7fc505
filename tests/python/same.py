"""Whether two objects hold the same."""

import dataclasses
import types

import numpy as np


def same(a: object, b: object, where: str = "") -> None:
    """Assert that two objects hold the same, field by field."""
    assert type(a) is type(b), where
    if isinstance(a, np.ndarray):
        np.testing.assert_array_equal(a, b, err_msg=where)
    elif isinstance(a, dict):
        assert isinstance(b, dict)
        assert a.keys() == b.keys(), where
        for key, value in a.items():
            same(value, b[key], f"{where}[{key!r}]")
    elif isinstance(a, list | tuple):
        assert isinstance(b, list | tuple)
        assert len(a) == len(b), where
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            same(x, y, f"{where}[{i}]")
    elif dataclasses.is_dataclass(a):
        for f in dataclasses.fields(a):
            same(getattr(a, f.name), getattr(b, f.name), f"{where}.{f.name}")
    elif isinstance(a, float):
        assert a == b or (a != a and b != b), where
    elif not isinstance(a, type | types.FunctionType) and type(a).__eq__ is not object.__eq__:
        assert a == b, where
