"""The inner loops compiled by numba; `emacm._kernels.numpy` documents each of them.

The loops release Python's lock where they take time, so threads process recordings in parallel.
They have no branch and no variable offset inside, so that the compiler can vectorise them.
"""

from emacm._kernels.numba.control import follow, limited_torque, resonate
from emacm._kernels.numba.motion import integrate, set_checkpoints
from emacm._kernels.numba.resampling import (
    BLOCK,
    READ_BLOCK,
    decimate,
    interpolate_linear,
    interpolation_weights,
    resample,
    upsample,
)
from emacm._kernels.numba.spectra import SEGMENT_BYTES, add_powers, low_pass, set_segments

__all__ = [
    "BLOCK",
    "READ_BLOCK",
    "SEGMENT_BYTES",
    "add_powers",
    "decimate",
    "follow",
    "integrate",
    "interpolate_linear",
    "interpolation_weights",
    "limited_torque",
    "low_pass",
    "resample",
    "resonate",
    "set_checkpoints",
    "set_segments",
    "upsample",
]
