"""Digests depend on each sample and on where it is stored, and follow what is written to a file."""

import os
import time
from hashlib import file_digest

import numpy as np
import pytest

from emacm.recordings import digests
from emacm.recordings.digests import content_digest, digest_of_file, file_stamps, is_mapped


def settled(path, seconds=3600):
    """Let a file have been written some time ago."""
    os.utime(path, (time.time() - seconds,) * 2)
    return path


@pytest.mark.parametrize("n_times", [1, 7, digests._BLOCK, digests._BLOCK + 1, 2 * digests._BLOCK])
def test_each_sample_counts(n_times):
    samples = np.zeros(n_times, np.float32)
    found = {content_digest("", [samples])}
    places = {0, n_times // 2, min(n_times, digests._BLOCK) - 1, n_times - 1}
    for place in places:
        changed = samples.copy()
        changed[place] = 1
        found.add(content_digest("", [changed]))
    assert len(found) == 1 + len(places)


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
    settled(tmp_path / "a.npy")
    whole = np.load(tmp_path / "a.npy", mmap_mode="r")
    parts = [whole[:100], whole[100:200], whole[::3], whole[200:299]]
    found = [content_digest("", [part], remember_files=True) for part in parts]
    assert found == [content_digest("", [np.array(part)]) for part in parts]
    offsets = [stamps[0][1] for stamps in map(file_stamps, ([part] for part in parts))]
    start = whole.offset  # of the samples, after the header of the file
    assert offsets == [start, start + 800, start, start + 1600]


def test_a_digest_is_remembered_until_a_file_is_written(tmp_path, monkeypatch):
    path = tmp_path / "a.npy"
    np.save(path, np.arange(50.0))
    mapped = np.load(settled(path), mmap_mode="r")
    reads, read = [], digests._read

    def counted(array):
        reads.append(len(array))
        return read(array)

    monkeypatch.setattr(digests, "_read", counted)
    first = content_digest("", [mapped], remember_files=True)
    assert content_digest("", [mapped], remember_files=True) == first
    assert reads == [50]
    assert content_digest("", [mapped]) == first  # without remembering, it is read
    assert reads == [50, 50]

    def written_to(array):
        digest = counted(array)
        np.save(path, np.arange(50.0) + 1)
        settled(path, 1800)
        return digest

    settled(path, 2700)
    monkeypatch.setattr(digests, "_read", written_to)
    content_digest("", [mapped], remember_files=True)
    monkeypatch.setattr(digests, "_read", counted)
    settled(path, 2700)
    content_digest("", [mapped], remember_files=True)
    assert reads == [50] * 4  # what was written to meanwhile is read again


def test_digests_of_several_files_are_remembered(tmp_path, monkeypatch):
    parts = []
    for name in "ab":
        np.save(tmp_path / f"{name}.npy", np.arange(50.0) + ord(name))
        parts.append(np.load(settled(tmp_path / f"{name}.npy"), mmap_mode="r"))
    reads, read = [], digests._read

    def counted(array):
        reads.append(array[0])
        return read(array)

    monkeypatch.setattr(digests, "_read", counted)
    for part in (*parts, *parts):
        content_digest("", [part], remember_files=True)
    assert reads == [ord("a"), ord("b")]


def test_a_view_of_a_buffer_in_memory_is_no_memory_map(tmp_path):
    in_memory = np.asarray(memoryview(bytes(16)))
    assert not is_mapped(in_memory)
    assert file_stamps([in_memory]) == ()
    np.save(tmp_path / "a.npy", np.arange(5.0))
    assert is_mapped(np.load(tmp_path / "a.npy", mmap_mode="r")[1:3])


@pytest.mark.parametrize(("age", "known"), [(1.5, False), (2.6, True)])
def test_what_was_written_in_the_last_two_seconds_has_no_stamp(tmp_path, age, known):
    np.save(tmp_path / "a.npy", np.arange(5.0))
    mapped = np.load(settled(tmp_path / "a.npy", age), mmap_mode="r")
    assert (file_stamps([np.zeros(3), mapped]) is not None) is known
    assert file_stamps([np.zeros(3)]) == ()
    os.unlink(tmp_path / "a.npy")
    assert file_stamps([mapped]) is None


def test_the_digest_of_a_file_is_that_of_its_bytes(tmp_path):
    path = tmp_path / "a.bin"
    for content in (b"one", b"two"):
        path.write_bytes(content)
        assert digest_of_file(path) == digests.sha256(content).hexdigest()


@pytest.mark.parametrize("n_times", [3, digests._BLOCK + 5])
def test_a_digest_does_not_depend_on_how_an_array_is_read(n_times):
    samples = np.arange(n_times, dtype=np.float32)
    inner = digests.sha256(f"<f4({n_times},)".encode() + samples.tobytes()).digest()
    expected = digests.sha256("färben".encode() + inner).hexdigest()
    assert content_digest("färben", [samples]) == expected
    assert content_digest("färben", [np.repeat(samples, 2)[::2]]) == expected


@pytest.mark.parametrize(("seconds", "n_read"), [(-1e9, 1), (1e9, 2)])
def test_a_file_is_read_once_for_its_digest_if_it_was_not_just_written(
    tmp_path, monkeypatch, seconds, n_read
):
    read, path = [], tmp_path / "a.bin"
    path.write_bytes(b"one")

    def counting(file, kind):
        read.append(kind)
        return file_digest(file, kind)

    monkeypatch.setattr(digests, "file_digest", counting)
    monkeypatch.setattr(digests, "_SETTLED", seconds)
    assert digest_of_file(path) == digest_of_file(path) == digests.sha256(b"one").hexdigest()
    assert len(read) == n_read


@pytest.mark.parametrize(("ahead", "n_kept"), [(0, 1), (3600, 0)])
def test_the_digest_of_a_file_of_the_future_is_not_kept(tmp_path, monkeypatch, ahead, n_kept):
    path = tmp_path / "a.bin"
    path.write_bytes(b"one")
    settled(path, -ahead)
    kept = {}
    monkeypatch.setattr(digests, "_digests_of_files", kept)
    monkeypatch.setattr(digests.time, "time", lambda now=time.time: now() + 1800)
    digest_of_file(path)
    assert len(kept) == n_kept


def test_the_digest_of_a_file_that_is_written_to_meanwhile_is_not_kept(tmp_path, monkeypatch):
    path = tmp_path / "a.bin"
    path.write_bytes(b"one")

    def writing(file, kind):
        found = file_digest(file, kind)
        path.write_bytes(path.read_bytes() + b" more")
        return found

    monkeypatch.setattr(digests, "_SETTLED", -1e9)
    kept = dict(digests._digests_of_files)
    monkeypatch.setattr(digests, "file_digest", writing)
    assert digest_of_file(path) == digests.sha256(b"one").hexdigest()
    assert kept == digests._digests_of_files
