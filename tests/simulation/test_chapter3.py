"""The signals of chapter 3 are those of Eqs. (3.1) to (3.6), at any duration."""

import numpy as np
import pytest

from emacm import OrderPSD, OrderResampler
from emacm.simulation import CHAPTER3_ORDERS, chapter3_recording, chapter3_recordings

TURN = 2 * np.pi


@pytest.mark.parametrize("label", ["defect 1", "defect 2"])
def test_a_defect_stands_at_its_order(label):
    runs, _ = chapter3_recordings(4)
    resampled = OrderResampler(TURN / 64).fit_transform(runs)
    psd = OrderPSD(16)
    spectra = psd.fit_transform(resampled).reshape(3, 4, -1).mean(axis=1)
    line = np.argmin(np.abs(psd.orders_ - CHAPTER3_ORDERS[label]))
    assert spectra[list(CHAPTER3_ORDERS).index(label), line] > 5 * spectra[0, line]


def test_a_run_is_the_same_however_it_was_asked_for():
    few, _ = chapter3_recordings(2, seed=4)
    many, _ = chapter3_recordings(5, seed=4)
    assert few[1] == many[1] == chapter3_recording("healthy", 1, seed=4)
    assert few[2] == many[5] == chapter3_recording("defect 1", 0, seed=4)
    assert few[0] != few[1]
    assert few[0] != chapter3_recording("healthy", 0, seed=5)
