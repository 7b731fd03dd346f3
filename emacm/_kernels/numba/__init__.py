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
    spread,
    upsample,
)
from emacm._kernels.numba.spectra import SEGMENT_BYTES, segment_powers
from emacm._kernels.numpy.spectra import powers, windowed

__all__ = [
    "BLOCK",
    "READ_BLOCK",
    "SEGMENT_BYTES",
    "decimate",
    "follow",
    "integrate",
    "interpolate_linear",
    "interpolation_weights",
    "limited_torque",
    "powers",
    "resample",
    "resonate",
    "segment_powers",
    "set_checkpoints",
    "spread",
    "upsample",
    "windowed",
]
