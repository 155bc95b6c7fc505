"""Curves of friction over slip, and what is known of them beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.typed import typed, typed_fields
from ...errors import InvalidInput


@dataclass(frozen=True)
class MuSlipPrior:
    """What is known of the parameters before the first reading: mean and standard deviations."""

    mean: tuple[float, ...]
    std: tuple[float, ...]

    @typed_fields
    def __post_init__(self) -> None:
        if len(self.mean) != len(self.std):
            raise InvalidInput(
                f"prior: {len(self.mean)} means and {len(self.std)} standard deviations; give as "
                f"many of one as of the other"
            )
        if not (np.isfinite(self.mean).all() and np.isfinite(self.std).all()):
            raise InvalidInput("prior: a value is not finite; give numbers")
        if min(self.std) <= 0.0:
            raise InvalidInput("prior: a standard deviation is not above 0; give a small one")

    def covariance(self) -> FloatArray:
        """As a diagonal matrix."""
        return np.diag(np.square(as_float64(self.std)))


@dataclass(frozen=True)
class MuSlipCurve:
    """A formula mu(slip); every curve begins with the peak and the slip of the peak.

    Attributes
    ----------
    name : str
        Name on the command line.
    parameters : tuple of str
        Names of the parameters; all are without unit.
    prior : MuSlipPrior
        Covers tyres on surfaces from ice to dry road, as seen by an aircraft wheel.
    fit_bounds : tuple
        Box of the least-squares fit of the same source.
    """

    name: str
    parameters: tuple[str, ...]
    prior: MuSlipPrior
    fit_bounds: tuple[tuple[float, ...], tuple[float, ...]]
    kernels: type[_core._Curve] = field(repr=False)
    filter_type: type[_core._CurveFilter] = field(repr=False)

    @typed
    def vector(self, values: npt.ArrayLike, name: str = "values") -> FloatArray:
        """Check parameters and return them as an array.

        Raises
        ------
        InvalidInput
            If their number is wrong or one is outside the range in which the formula holds.
        """
        found = as_float64(values)
        if found.shape != (len(self.parameters),):
            raise InvalidInput(
                f"{name}: shape {found.shape}; the {self.name} curve has the "
                f"{len(self.parameters)} parameters {', '.join(self.parameters)}"
            )
        for p, x, low, high in zip(
            self.parameters, found, self.kernels.LOWER, self.kernels.UPPER, strict=True
        ):
            if not low <= x <= high:
                raise InvalidInput(f"{name}: {p} = {x:g}; choose {low:g} to {high:g}")
        return found

    @typed
    def points(
        self, slip: npt.ArrayLike, values: npt.ArrayLike
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Friction (n,), its gradient (n, p) and Hessian (n, p, p) in the parameters, all exact."""
        return self.kernels.points(as_float64(np.atleast_1d(slip)), self.vector(values))

    @typed
    def mu(self, slip: npt.ArrayLike, values: npt.ArrayLike) -> FloatArray:
        """Friction at each slip, shape (n,)."""
        return self.points(slip, values)[0]


TWO_PARAMETER = MuSlipCurve(
    "two-parameter",
    ("mu_peak", "slip_peak"),
    MuSlipPrior((0.6, 0.2), (0.6, 0.2)),
    ((0.0, 0.1), (0.6, 0.2)),
    _core.TwoParameterCurve,
    _core.TwoParameterFilter,
)
"""mu = 2 mu_p s / (s_p (1 + (s/s_p)^2)); Rudd, The Mathematica Journal 11:1, In[1]."""

MAGIC_FORMULA = MuSlipCurve(
    "magic-formula",
    ("mu_peak", "slip_peak", "shape", "slope"),
    MuSlipPrior((0.6, 0.2, 1.65, 2.4), (0.6, 0.2, 0.25, 0.8)),
    ((0.0, 0.01, 1.1, 1.2), (2.0, 0.6, 2.2, 10.0)),
    _core.MagicFormulaCurve,
    _core.MagicFormulaFilter,
)
"""Pacejka's longitudinal curve by its peak, the slip of the peak, the shape factor C and the slope
at the origin as a multiple of mu_p / s_p (2 for the two-parameter curve)."""


@typed
def magic_formula_coefficients(values: Sequence[float]) -> tuple[float, float, float, float]:
    """B, C, D, E of the Magic Formula for parameters of :data:`MAGIC_FORMULA`."""
    return _core.magic_formula_coefficients(MAGIC_FORMULA.vector(values))
