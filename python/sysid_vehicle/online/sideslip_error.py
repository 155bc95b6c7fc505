"""How far an estimated sideslip is from the true one."""

from __future__ import annotations

from dataclasses import dataclass

from .._common.text import text_table


@dataclass(frozen=True)
class SideslipError:
    """Estimated less true sideslip.

    Attributes
    ----------
    rms_deg, max_deg : float
        Size of the error.
    covered : float
        Share of samples whose true sideslip lies in the band of 2 standard deviations, of the
        estimate and of the noise of the measured sideslip together.
    noise_deg : float
        What the noise of the measured sideslip makes of the rms.
    bands : tuple of (low, high, rms_deg, samples)
        Error by size of the lateral acceleration [m/s2].
    """

    rms_deg: float
    max_deg: float
    covered: float
    bands: tuple[tuple[float, float, float, int], ...]
    noise_deg: float = 0.0

    def __str__(self) -> str:
        noise = f", {self.noise_deg:.3f} of it noise of the measured one" if self.noise_deg else ""
        rows = [[f"{a:g} .. {b:g}", f"{rms:.3f}", str(n)] for a, b, rms, n in self.bands]
        return (
            f"error: {self.rms_deg:.3f} deg rms{noise}, {self.max_deg:.2f} deg at most; "
            f"{100.0 * self.covered:.1f} % of samples inside 2 sigma\n"
            + text_table(["|a_y| [m/s2]", "rms [deg]", "samples"], rows)
        )
