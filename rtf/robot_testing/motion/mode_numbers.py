"""Control modes as small numbers, for plots over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtf.robot.control_modes import STATES

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rtf.robot.interfaces import FloatArray

_NUMBERS = {int(mode): float(number) for number, mode in enumerate(STATES)}
_UNKNOWN = -1.0
#: The legend of such a plot.
LEGEND = (
    f"modes by number: {', '.join(f'{number} {mode.word}' for number, mode in enumerate(STATES))}, "
    f"{_UNKNOWN:g} none of them"
)


def mode_numbers(modes: ArrayLike) -> FloatArray:
    """Return the legend's numbers of modes given as packed words."""
    return np.array([_NUMBERS.get(mode, _UNKNOWN) for mode in np.asarray(modes).tolist()])
