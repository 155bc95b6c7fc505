import numpy as np
import numpy.typing as npt

_Array = npt.NDArray[np.float64]
_Places = npt.NDArray[np.int32]

def banded_gram(
    pointers: _Places,
    columns: _Places,
    values: _Array,
    size: int,
) -> _Array: ...
def banded_squares(
    factor: _Array,
    pointers: _Places,
    columns: _Places,
    values: _Array,
) -> _Array: ...
