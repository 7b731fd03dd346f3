"""Settings of the search for a shaft speed in a vibration signal."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SpeedSearchSettings:
    """Settings of `emacm.shaft.angle_from_vibration`.

    The values were chosen on simulated machines, none of which is among the 100 units in the notes
    of `angle_from_vibration`. No benchmark of this repository repeats the choice;
    ``pytest tests/shaft/test_vibration.py`` checks its results.

    Attributes
    ----------
    frames : tuple of (float, int, float)
        Durations of the frames [s], numbers of rates of change, and log likelihood ratios to any
        other speed that are needed. The longest frames give most evidence, the shortest follow
        faster changes.
    enough : float
        Share of reliable seconds at which no shorter frames are tried.
    cycles : float
        Shortest frame, in cycles of the smallest distance of two orders at the lowest speed.
    broad : float
        What is broader than this over the duration of a frame [Hz] is no line.
    joined_frames : int
        Neighbouring frames that decide together.
    excluded_score, absent_score : float
        Largest log likelihood ratio against a speed, and that of speeds outside of the range.
    alone : float
        Log likelihood ratio to noise that every single frame needs.
    same_speed : float
        Relative distance of speeds that count as one.
    mains : tuple of float
        Frequencies of the mains [Hz].
    mains_tolerance, mains_line : float
        Their relative tolerance, and the power over the background that makes a line.
    background_frame : float
        Duration of the frames of the background [s].
    lobe : float
        Half the main lobe of a Hann window, and a little less [1/duration].
    lines : tuple of (float, float)
        Probability that an order has a line, and distribution of its rank, Beta(shape, 1): of the
        first orders, and of the others.
    first_orders : int
        Orders that have lines in nearly all machines.
    many_orders, few_orders : tuple of int
        Numbers of orders that may have lines, from the first one on; the fewer ones in short
        frames, in which the lines of high orders are not separate.
    fractions : tuple of float
        Orders that have lines if the speed is a multiple of the true one.
    clear_line : float
        Power over the background of a clear line.
    top_ranks : (float, float)
        Limits of the share of bins with a clear line.
    skirt : float
        Power within six bins of a line, as a share of its power, that is no line of its own.
    n_ranked, n_knots, n_table : int
        Values from which the distribution of powers is estimated, ranks of which the powers are
        estimated, and logarithms of power of which the scores are computed.
    speed_step : float
        Step of the grid of speeds, in bins at the highest order.
    narrow : float
        Highest over lowest speed, below which a comb of the first orders decides, and from which
        the lines of `parts` must confirm the speed.
    comb_orders, comb_height : int, float
        Orders of the comb, and height from which all lines count alike [dB].
    comb_level, comb_margin : float
        Mean height of the lines, and its difference to that of any other speed [dB].
    fewest_bins : float
        Bins of the whole signal that a comb needs, within a third of the lowest speed.
    revolutions : float
        Fewest revolutions in a wide range: in fewer, lines of a cage (0.40) and of a bearing (3.6)
        look like multiples of a fraction of the speed.
    part_harmonics, part_margin : int, float
        Lines of a part, and difference of the mean height of all lines to that of any other speed
        [dB]. The margin is the lowest at which no speed was wrong on 150 simulated bearings, the
        drive end of CWRU and half of UESTC.
    part_slip : (float, float)
        Limits of the order of a rolling element, as fractions of its own.
    off_order : float
        Distance of a line of a part from the orders of the shaft that distinguishes the two.
    rounds : int
        Rounds of refinement by phase.
    aside : float
        Orders from a line to where there is none.
    clear_phase : float
        Power of a line over that between the orders, to be used for its phase.
    apart, agreed : float
        Distance of a line of the shaft from its order: in 1/duration, and as a fraction.
    leverage : float
        Orders between two lines whose spacing gives the speed.
    furthest : float
        Largest correction of the speed that sidebands give, as a fraction.
    strong : float
        Logarithm of the power over the median from which all lines count alike.
    line_width : int
        Bins of a line, either way.
    like_orders : float
        Height of lines that are as strong as the orders, as a fraction of their mean.
    families, family_width : int
        Families of lines beside that of the shaft (a damaged bearing has one for each harmonic),
        and bins that each needs.
    close, even, windows, unsteady : float
        Lines of a repeated motion: the fewest bins between two of them, their contrast as a
        fraction of that of the orders, the revolutions of the windows in which they are not
        separate, and the scatter of their level in these, relative to that of noise.
    blocks : tuple of float
        Shortest blocks in which lines keep their phase [s]; rounded up to whole periods.
    short_block : float
        Longest block for few lines [s]: a reversal of a tenth of a second may hide in longer ones.
    few_lines : float
        Lines of equal weight: so many keep their phases by chance.
    line_weight : float
        Largest weight of a line, in medians of all.
    noise_change : float
        Median change between two blocks (0 to 2; 1 of independent phases) from which noise alone
        may explain a change.
    steady_change : (float, float, float)
        Largest change of a steady second: the first number, plus the second one times the median,
        at most the third.
    """

    frames: tuple[tuple[float, int, float], ...] = ((4.0, 5, 4.0), (1.4, 15, 10.0))
    enough: float = 0.9
    cycles: float = 17
    broad: float = 16.0
    joined_frames: int = 3
    excluded_score: float = 100.0
    absent_score: float = -4.0
    alone: float = 2.0
    same_speed: float = 0.004
    mains: tuple[float, ...] = (50.0, 60.0)
    mains_tolerance: float = 1e-3
    mains_line: float = 20.0
    background_frame: float = 4.0
    lobe: float = 1.6
    lines: tuple[tuple[float, float], ...] = ((0.95, 0.08), (0.8, 0.25))
    first_orders: int = 2
    many_orders: tuple[int, ...] = (4, 6, 8, 12, 16, 24)
    few_orders: tuple[int, ...] = (4, 6, 8)
    fractions: tuple[float, ...] = (1 / 2, 1 / 3, 2 / 3)
    clear_line: float = 15.0
    top_ranks: tuple[float, float] = (5e-4, 0.03)
    skirt: float = 0.02
    n_ranked: int = 20_000
    n_knots: int = 129
    n_table: int = 1025
    speed_step: float = 0.5
    narrow: float = 1.5
    comb_orders: int = 6
    comb_height: float = 30.0
    comb_level: float = 14.0
    comb_margin: float = 5.5
    fewest_bins: float = 8.0
    revolutions: float = 50.0
    part_harmonics: int = 3
    part_margin: float = 3.0
    part_slip: tuple[float, float] = (0.98, 1.005)
    off_order: float = 0.02
    rounds: int = 3
    aside: float = 0.41
    clear_phase: float = 4.0
    apart: float = 0.1
    agreed: float = 5e-5
    leverage: float = 3.0
    furthest: float = 5e-3
    strong: float = 4.0
    line_width: int = 3
    like_orders: float = 0.65
    families: int = 7
    family_width: int = 8
    close: float = 2.5
    even: float = 0.1
    windows: float = 5
    unsteady: float = 1.15
    blocks: tuple[float, ...] = (0.1, 0.2, 0.4, 0.8)
    short_block: float = 0.21
    few_lines: float = 2.5
    line_weight: float = 4.0
    noise_change: float = 0.2
    steady_change: tuple[float, float, float] = (0.2, 3.0, 0.6)


SETTINGS = SpeedSearchSettings()
