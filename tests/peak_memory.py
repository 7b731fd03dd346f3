"""How much memory a call needs."""

import tracemalloc


def peak_bytes(function, *args):
    """Most memory in use at a time, beyond what was in use before, while a function runs."""
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        result = function(*args)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    del result
    return peak - before
