"""Digests depend on each sample and on where it is stored, and follow what is written to a file."""

import numpy as np

from emacm.recordings import digests
from emacm.recordings.digests import content_digest, digest_of_file


def test_facts_types_and_shapes_count():
    zeros = np.zeros(6)
    kinds = [
        ("", [zeros]),
        ("b", [zeros]),
        ("", [zeros.astype(">f8")]),
        ("", [zeros.reshape(2, 3)]),
        ("", [zeros.reshape(3, 2)]),
        ("", [zeros, zeros]),
        ("", [zeros[:3], zeros[3:]]),
    ]
    assert len({content_digest(*kind) for kind in kinds}) == len(kinds)


def test_the_digest_of_a_file_is_that_of_its_bytes(tmp_path):
    path = tmp_path / "a.bin"
    for content in (b"one", b"two"):
        path.write_bytes(content)
        assert digest_of_file(path) == digests.sha256(content).hexdigest()
