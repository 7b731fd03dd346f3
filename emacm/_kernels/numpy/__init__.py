"""The inner loops in NumPy and SciPy: the reference, used where numba is not installed.

Each function has a twin in `emacm._kernels.numba`, with the same arguments and results.
"""

from emacm._kernels.numpy.control import follow, limited_torque, resonate
from emacm._kernels.numpy.motion import integrate, set_checkpoints
from emacm._kernels.numpy.resampling import (
    BLOCK,
    READ_BLOCK,
    decimate,
    interpolate_linear,
    interpolation_weights,
    resample,
    spread,
    upsample,
)
from emacm._kernels.numpy.spectra import SEGMENT_BYTES, powers, segment_powers, windowed

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
