"""States of streams as bytes."""

import pytest

from emacm.streams.packed_state import packed


def test_what_would_be_stored_as_code_is_refused():
    with pytest.raises(TypeError, match=r"arrays, numbers and texts, got .* at 'readings/#1'"):
        packed({"readings": [1.5, lambda: 0]})
