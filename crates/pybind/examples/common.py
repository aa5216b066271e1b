"""What the gallery's scripts share."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def finish(figure: Figure) -> None:
    """Writes the figure to the file that was asked for, or shows it."""
    for axes in figure.axes:
        axes.grid(alpha=0.3)
    figure.tight_layout()
    if len(sys.argv) > 1:
        figure.savefig(sys.argv[1], dpi=120)
    else:
        plt.show()
