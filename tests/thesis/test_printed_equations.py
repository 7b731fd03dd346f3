"""The equations as printed differ from their corrected form in the way stated."""

import numpy as np
import pytest

from printed_equations import printed_angle, printed_resampling


def test_resampling_as_printed_is_a_time_sample_early_at_constant_speed():
    angle = np.arange(2000.0)
    signal = np.sin(0.06 * angle)
    printed = printed_resampling(signal, angle, 1.0)  # at each time sample
    assert np.allclose(printed[:-1], signal[1:], atol=1e-12)


def test_eq_2_9_as_printed_adds_a_speed_to_an_angle():
    assert printed_angle(np.full(11, 3.0), 10)[-1] == pytest.approx(3.0 / 2 + 3.0)


def test_eq_2_13_is_not_defined_where_the_shaft_reverses():
    with pytest.raises(ValueError, match=r"angle must not decrease; Eq. \(2.13\)"):
        printed_resampling([0.0, 1.0, 2.0], [0.0, 1.0, 0.5], 0.1)
