"""The text of a file that defines an effect."""

_TEXT = """
from sysid_vehicle import define_effect, parameter
define_effect(
    "{id}",
    title="side wind",
    parameters=[parameter("gain", "N", typical=100.0, lower=-1e3, upper=1e3)],
    force_y=lambda d, p: p.gain + 0.0 * d.v_x,
)
"""


def side_wind(id_: str, also: str = "") -> str:
    """A program that defines the effect and does something else as well."""
    return f"{also}\n{_TEXT.format(id=id_)}"
