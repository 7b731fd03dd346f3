"""A run of chapter 3 is the same however it is asked for."""

from emacm.simulation import chapter3_recording, chapter3_recordings


def test_a_run_is_the_same_however_it_was_asked_for():
    few, _ = chapter3_recordings(2, seed=4)
    many, _ = chapter3_recordings(5, seed=4)
    assert few[1] == many[1] == chapter3_recording("healthy", 1, seed=4)
    assert few[2] == many[5] == chapter3_recording("defect 1", 0, seed=4)
    assert few[0] != few[1]
    assert few[0] != chapter3_recording("healthy", 0, seed=5)
