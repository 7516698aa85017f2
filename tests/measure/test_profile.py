"""`--profile`: every second of a run is counted once."""

import pytest

from shadowbench.measure.profile import ACTIVITIES, Profile, complete_profile, share


def test_nested_activities_are_counted_once() -> None:
    clock = [100.0]
    profile = Profile(clock=lambda: clock[0])
    with profile.activity("waiting"):
        clock[0] += 1
        with profile.activity("files"):
            clock[0] += 2
        clock[0] += 4
    clock[0] += 8  # nobody's
    with profile.activity("files"):
        clock[0] += 16
    assert profile.seconds == {"waiting": 5, "files": 18}


def test_an_activity_that_fails_is_over() -> None:
    clock = [100.0]
    profile = Profile(clock=lambda: clock[0])

    def fail() -> None:
        with profile.activity("score"):
            clock[0] += 1
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    clock[0] += 2
    with profile.activity("files"):
        clock[0] += 4
    assert profile.seconds == {"score": 1, "files": 4}


def test_worker_times_replace_the_time_waited_for_them() -> None:
    seconds = complete_profile({"waiting": 10.0, "score": 2.0, "truth": 1.0}, {"passes": 7.0, "build": 1.0}, 15.0)
    assert list(seconds) == list(ACTIVITIES)
    assert sum(seconds.values()) == 15
    assert (seconds["waiting"], seconds["other"], seconds["files"]) == (2, 2, 0)
    assert share(seconds) == (7 + 2 + 1) / 15
