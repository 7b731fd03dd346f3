"""The kurtogram: spectral kurtosis over the centre and the width of the band."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from emacm.displays import _drawing
from emacm.displays._display import Display
from emacm.recordings.kurtogram import Kurtogram, kurtogram

_MAP = "viridis"


@dataclass(eq=False, repr=False)
class KurtogramDisplay(Display):
    """Spectral kurtosis of the bands of a signal; the band with the largest one is outlined.

    Parameters
    ----------
    found : Kurtogram
        Result of `kurtogram`.
    channel : str
        Name of the channel, for the label.

    Attributes
    ----------
    ax_, figure_
        Axes and figure, set when the display is drawn.
    colorbar_ : Colorbar
        Its colour bar.

    Raises
    ------
    TypeError
        If `found` is not a result of `kurtogram`.

    Notes
    -----
    Source of this kind of figure: J. Antoni, Mech. Syst. Signal Process. 21(1), 108-124, 2007.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import kurtogram
    >>> noise = np.random.default_rng(0).standard_normal(20_000)
    >>> len(KurtogramDisplay(kurtogram(noise, 10_000, levels=2)).frame())
    14
    """

    found: Kurtogram
    channel: str = field(default="signal", kw_only=True)

    def __post_init__(self) -> None:
        if not isinstance(self.found, Kurtogram):
            raise TypeError(f"found must be the result of kurtogram, got {self.found!r}.")

    @classmethod
    def from_signal(
        cls,
        signal: ArrayLike,
        fs: float,
        *,
        levels: int | None = None,
        channel: str = "signal",
        ax: Any = None,
    ) -> KurtogramDisplay:
        """Compute the kurtogram of a signal, and draw it.

        Parameters
        ----------
        signal, fs, levels
            As for `kurtogram`.
        channel : str
            Name of the channel, for the label.
        ax : matplotlib Axes, optional
            Where to draw.

        Returns
        -------
        KurtogramDisplay
        """
        return cls(kurtogram(signal, fs, levels=levels), channel=channel).plot(ax=ax)

    def frame(self) -> pd.DataFrame:
        """Return one row per band: "width" and "centre" [Hz], "kurtosis"."""
        found = self.found
        widths = np.repeat(found.widths, [len(centres) for centres in found.centres])
        columns = {"width": widths, "centre": np.concatenate(found.centres)}
        return pd.DataFrame(columns | {"kurtosis": np.concatenate(found.kurtosis)})

    def _draw(self, ax: Any) -> Any:
        (ax,) = _drawing.panel_axes(ax, height=3.0)
        found = self.found
        highest = max(float(values.max()) for values in found.kurtosis)
        scale = {"vmin": 0.0, "vmax": max(highest, 0.1), "cmap": _MAP, "rasterized": True}
        for level, (width, centres, values) in enumerate(
            zip(found.widths, found.centres, found.kurtosis, strict=True)
        ):
            edges = np.append(centres - width / 4, centres[-1] + width / 4)  # they overlap by half
            mesh = ax.pcolormesh(edges, [level - 0.5, level + 0.5], values[np.newaxis], **scale)
        low, high = found.band
        level = int(np.argmin(np.abs(np.array(found.widths) - (high - low))))
        text = f"{low:.0f} to {high:.0f} Hz"
        style = {"color": _drawing.COLOURS[1], "linewidth": 2}
        corners = [low, high, high, low, low], level + np.array([-0.5, -0.5, 0.5, 0.5, -0.5])
        ax.plot(*corners, label=text, clip_on=False, **style)
        ax.set(xlabel="frequency [Hz]", ylabel="width of the band [Hz]", xlim=(0, found.fs / 2))
        ax.set_yticks(range(len(found.widths)), [f"{width:.4g}" for width in found.widths])
        ax.set_ylim(len(found.widths) - 0.5, -0.5)
        ax.patch.set(facecolor="white", edgecolor=_drawing.MISSING, hatch="////")
        self.colorbar_ = ax.figure.colorbar(mesh, ax=ax)
        self.colorbar_.set_label(f"spectral kurtosis of {self.channel} [1]")
        _drawing.legend_above(ax)
        return ax
