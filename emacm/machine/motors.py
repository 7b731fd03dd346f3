"""Electric motors: synchronous, and induction motors with their slip."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from math import lcm
from typing import Any

import numpy as np
from scipy.signal import periodogram

from emacm._checks import check_count, check_number
from emacm.machine.parts import Line, Part, check_mounting
from emacm.recordings.inputs import check_channel_names
from emacm.recordings.recording import Recording


@dataclass(frozen=True)
class Motor(Part):
    """A permanent-magnet synchronous motor; orders refer to its shaft.

    Parameters
    ----------
    pole_pairs : int
        Half the number of poles; this is the order of the currents, Eq. (2.3) of Chirico.
    slots : int, optional
        Number of stator slots; required for the order of cogging.
    name : str
        Prefix of the names of its lines.

    Raises
    ------
    TypeError, ValueError
        If a value is out of range.

    See Also
    --------
    emacm.InductionMotor : With slip.

    Notes
    -----
    Imbalance, a bent shaft, an eccentric rotor and, by Chirico (section 4.5), possibly poor
    lubrication appear at multiples of the shaft order, and in the current at the supply order plus
    and minus these [1]_; the order does not distinguish them. Electrical noise appears at harmonics
    of the supply: magnetic pull at 2x, torque ripple from the 5th and 7th harmonics of the current
    at 6x. The number of cogging periods per revolution is lcm(slots, poles) [2]_.

    References
    ----------
    .. [1] Le Roux, Harley and Habetler, Detecting rotor faults in low power permanent
       magnet synchronous machines, IEEE Trans. Power Electron. 22 (2007).
    .. [2] Zhu and Howe, Influence of design parameters on cogging torque in permanent
       magnet machines, IEEE Trans. Energy Convers. 15 (2000).

    Examples
    --------
    >>> [(line.name, line.order) for line in Motor(6, slots=36).lines()]
    [('shaft', 1.0), ('supply', 6.0), ('cogging', 36.0)]
    """

    pole_pairs: int
    slots: int | None = None
    _: KW_ONLY
    name: str = ""

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_count(self.pole_pairs, "pole_pairs")
        if self.slots is not None:
            check_count(self.slots, "slots", at_least=2)
        check_mounting(self)

    @property
    def supply_order(self) -> float:
        """Periods of the supply per revolution of the shaft."""
        return float(self.pole_pairs)

    def lines(self) -> tuple[Line, ...]:
        """Return the lines of the shaft, the supply and, if `slots` is given, of cogging."""
        shaft = (("shaft", 1.0),)
        lines = [
            Line("shaft", "imbalance or eccentricity", 1.0, of_damage=False),
            Line("supply", "supply", float(self.pole_pairs), shaft, of_damage=False),
        ]
        if self.slots is not None:
            periods = float(lcm(self.slots, 2 * self.pole_pairs))
            lines.append(Line("cogging", "cogging", periods, shaft, of_damage=False))
        return tuple(lines)


@dataclass(frozen=True)
class InductionMotor(Part):
    """An induction motor with a squirrel cage; orders refer to its shaft.

    Parameters
    ----------
    pole_pairs : int
        Half the number of poles.
    slip : float
        Slip s: speed of the rotor below the synchronous speed, as a fraction of it: ``1 -
        pole_pairs * speed / mains`` with both in Hz. The slip changes with the load.
    bars : int, optional
        Number of rotor bars; required for the order at which they pass.
    name : str
        Prefix of the names of its lines.

    Raises
    ------
    TypeError, ValueError
        If a value is out of range.

    See Also
    --------
    emacm.Motor : With permanent magnets.

    Notes
    -----
    A revolution contains p / (1 - s) periods of the supply. Broken bars, a cracked end ring, or
    any other asymmetry of the cage modulate at twice the slip frequency ("pole pass"): the
    current has lines at (1 ± 2 k s) times the supply frequency, the vibration sidebands of the
    shaft order; the order does not distinguish bar and ring [1]_. Eccentricity is at supply ±
    shaft in the current. With R bars, the rotor bars pass at order R; in the current this gives
    the rotor slot harmonics R ± p / (1 - s), with sidebands of the shaft if the eccentricity is
    dynamic [2]_.

    ``fault_orders(motor, harmonics=2, signal="current")`` gives the lines in the current. They are
    those of one load: the slip changes with it, and with the slip the order of the supply. Describe
    the motor at the load of a recording by `from_current`.

    References
    ----------
    .. [1] Nandi, Toliyat and Li, Condition monitoring and fault diagnosis of electrical motors,
       a review, IEEE Trans. Energy Convers. 20 (2005).
    .. [2] Thomson and Fenger, Current signature analysis to detect induction motor faults,
       IEEE Ind. Appl. Mag. 7 (2001).

    Examples
    --------
    At 50 Hz and 1440 rpm the slip is 4 %, and broken bars give lines at 46 and 54 Hz:

    >>> from emacm import fault_orders
    >>> motor = InductionMotor(2, slip=1 - 2 * (1440 / 60) / 50)
    >>> orders = fault_orders(motor, signal="current")["order"] * 1440 / 60
    >>> orders[["supply-pole pass", "supply+pole pass"]].round(6).tolist()
    [46.0, 54.0]
    """

    pole_pairs: int
    slip: float
    bars: int | None = None
    _: KW_ONLY
    name: str = ""

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_count(self.pole_pairs, "pole_pairs")
        check_number(self.slip, "slip", above=0, at_most=0.5)
        if self.bars is not None:
            check_count(self.bars, "bars", at_least=2)
        check_mounting(self)

    @classmethod
    def from_current(
        cls, recording: Recording, channel: str, pole_pairs: int, **options: Any
    ) -> InductionMotor:
        """Describe a motor by the slip that the supply line of a recorded current shows.

        Parameters
        ----------
        recording : Recording
            At constant load; its speed is that of the motor.
        channel : str
            A phase current.
        pole_pairs : int
            Half the number of poles.
        **options
            As for the class: bars, name.

        Returns
        -------
        InductionMotor

        Raises
        ------
        ValueError
            If the highest line of the current belongs to no slip from 0 to 0.15.

        Examples
        --------
        >>> import numpy as np
        >>> from emacm import Recording
        >>> supply = np.sin(2 * np.pi * 50 * np.arange(10_000) / 1000)
        >>> run = Recording({"phase": supply}, 1000, velocity=2 * np.pi * 1440 / 60)
        >>> round(InductionMotor.from_current(run, "phase", 2).slip, 4)
        0.04
        """
        check_channel_names(recording.channels, [channel])
        synchronous = pole_pairs * float(np.abs(recording.velocity).mean()) / (2 * np.pi)  # Hz
        signal, fs = np.asarray(recording.signals[channel], np.float64), recording.fs[channel]
        frequencies, power = periodogram(signal, fs, "hann", detrend="constant")
        peak = int(np.clip(power.argmax(), 1, len(power) - 2))
        before, top, after = np.log(power[peak - 1 : peak + 2])
        place = peak + (before - after) / (2 * (before - 2 * top + after))  # of a parabola
        slip = 1 - synchronous / (place * frequencies[1])
        if not 0 < slip <= 0.15:
            raise ValueError(
                f"the highest line of channel {channel!r} is at {place * frequencies[1]:.4g} Hz; "
                f"the supply of {pole_pairs} pole pairs is at {synchronous:.4g} to "
                f"{synchronous / 0.85:.4g} Hz. Check pole_pairs, the speed and the channel."
            )
        return cls(pole_pairs, float(slip), **options)

    @property
    def supply_order(self) -> float:
        """Periods of the supply per revolution of the shaft."""
        return self.pole_pairs / (1 - self.slip)

    def lines(self) -> tuple[Line, ...]:
        """Return the lines of the shaft, the supply and the cage, and of `bars` if given."""
        poles, shaft = ("pole pass", 2 * self.slip * self.supply_order), ("shaft", 1.0)
        lines = [
            Line("shaft", "imbalance or eccentricity", 1.0, (poles,), of_damage=False),
            Line("supply", "supply", self.supply_order, (shaft,), of_damage=False),
            Line("pole pass", "broken bar or end ring", poles[1]),
        ]
        if self.bars is not None:
            sides = shaft, ("2xsupply", 2 * self.supply_order)
            lines.append(Line("bar pass", "rotor bars", float(self.bars), sides, of_damage=False))
        return tuple(lines)
