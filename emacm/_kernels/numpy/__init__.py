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
    upsample,
)
from emacm._kernels.numpy.spectra import SEGMENT_BYTES, add_powers, low_pass, set_segments

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
