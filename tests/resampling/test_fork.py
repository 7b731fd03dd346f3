"""A process may be forked while threads of it resample."""

import os
import subprocess
import sys

import pytest

FORKS = """
import os, threading, time, warnings
import numpy as np
from emacm import OrderResampler, Recording
from emacm.resampling.signal_cache import SignalCache

warnings.simplefilter("ignore")  # Python 3.12 warns of any fork with threads
angle = 30 * np.sin(np.arange(40_000) / 900)
X = [Recording({"a": np.ones(40_000)}, 1000, angle=angle + k) for k in range(4)]
resampler = OrderResampler(2 * np.pi / 16).fit(X)

def read_all():
    for row in SignalCache().fit_transform(resampler.transform(X)):
        for stroke in row.strokes:
            assert stroke.path.fastest > 0
            assert stroke.path.max_reversal >= 0
            assert stroke.signals.any()

def read_for_ever():
    while not done:
        read_all()

read_all()  # compiles
done = False
threads = [threading.Thread(target=read_for_ever, daemon=True) for _ in range(4)]
for thread in threads:
    thread.start()
children = []
for _ in range(40):
    time.sleep(0.003)
    child = os.fork()
    if not child:
        read_all()
        os._exit(0)
    children.append(child)
for child in children:
    assert os.waitpid(child, 0)[1] == 0
done = True
print("done")
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_child_forked_while_threads_resample_ends():
    found = subprocess.run(
        [sys.executable, "-c", FORKS], capture_output=True, text=True, timeout=300, check=False
    )
    assert found.stdout == "done\n", found.stderr
