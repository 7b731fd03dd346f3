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


def test_parts_of_one_mapped_file_have_digests_of_their_own(tmp_path):
    np.save(tmp_path / "a.npy", np.arange(300.0))
    whole = np.load(tmp_path / "a.npy", mmap_mode="r")
    parts = [whole[:100], whole[100:200], whole[::3], whole[200:299]]
    found = [content_digest("", [part]) for part in parts]
    assert found == [content_digest("", [np.array(part)]) for part in parts]


def test_the_digest_of_a_file_is_that_of_its_bytes(tmp_path):
    path = tmp_path / "a.bin"
    for content in (b"one", b"two"):
        path.write_bytes(content)
        assert digest_of_file(path) == digests.sha256(content).hexdigest()
