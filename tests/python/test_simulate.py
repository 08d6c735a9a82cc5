"""Simulation from Python: against closed forms, observed, and interrupted."""

import os
import pickle
import signal
import threading

import numpy as np
import pytest

import unfurl


def period_of_pendulum(amplitude: float) -> float:
    """Of a uniform rod of 1 m on a pin, by the arithmetic-geometric mean (Gauss)."""
    slow = 2 * np.pi * np.sqrt((1 / 3) / (0.5 * 9.81))  # of small swings
    a, b = 1.0, np.cos(amplitude / 2)
    for _ in range(6):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return slow / a


def test_period_of_a_pendulum(pendulum):
    run = unfurl.simulate(pendulum, duration=4.0, rtol=1e-9)
    assert run.usable and run.status == "good"
    theta = run["pin.theta"]
    crossings = [
        run.t[i] - theta[i] * (run.t[i + 1] - run.t[i]) / (theta[i + 1] - theta[i])
        for i in range(len(theta) - 1)
        if theta[i] > 0 >= theta[i + 1]
    ]
    period = period_of_pendulum(1.0)
    assert crossings[0] == pytest.approx(period / 4, abs=1e-7)
    assert crossings[1] - crossings[0] == pytest.approx(period, abs=1e-7)


def test_frequency_of_small_swings(pendulum):
    modes = unfurl.modes(pendulum)
    expected = np.sqrt(0.5 * 9.81 / (1 / 3)) / (2 * np.pi)
    # The pendulum is drawn at 1 rad: what it slides to is where it hangs.
    assert modes.usable
    assert modes.frequency == pytest.approx([expected], rel=1e-6)
    assert modes.shape.shape == (1, len(modes.places), 3)


def test_keys_of_a_scene_are_set(sets):
    scene = sets / "double_pendulum" / "scene.toml"
    run = unfurl.simulate(scene, set={"joint.shoulder.theta": 0.25}, duration=0.01)
    assert run["shoulder.theta"][0] == pytest.approx(0.25)
    with pytest.raises(unfurl.Error, match="theta"):
        unfurl.simulate(scene, set={"joint.shoulder.thet": 0.25})


def test_in_memory_and_in_a_file_are_the_same(pendulum, tmp_path):
    a = unfurl.simulate(pendulum)
    b = unfurl.simulate(pendulum, output=tmp_path / "run.h5")
    assert a.keys() == b.keys()
    for name in a:
        np.testing.assert_array_equal(a[name], b[name])
    assert a.summary == b.summary


def test_beams_are_kept_in_memory_in_files_and_pickles(sets, tmp_path):
    scene = sets / "deployment" / "scene_suspension_4.toml"
    run = unfurl.simulate(scene, duration=0.3, output=tmp_path / "streamed.h5")
    in_memory = unfurl.simulate(scene, duration=0.3)
    in_memory.write(tmp_path / "written.h5")
    assert run.shapes and len(run.shape_t) >= 200  # fifty a second, but of a run as short as this more
    for other in (in_memory, unfurl.load(tmp_path / "written.h5"), pickle.loads(pickle.dumps(run))):
        np.testing.assert_array_equal(other.shape_t, run.shape_t)
        assert sorted(other.shapes) == sorted(run.shapes)
        for name, xy in run.shapes.items():
            assert xy.shape[0] == len(run.shape_t) and xy.shape[2] == 2
            np.testing.assert_array_equal(other.shapes[name], xy)
        assert other.summary == run.summary
        assert [(e.t, e.kind, e.where, e.data) for e in other.events] == [
            (e.t, e.kind, e.where, e.data) for e in run.events
        ]


def test_a_run_goes_to_a_file_and_back(tmp_path, sets):
    run = unfurl.simulate(sets / "bouncing_latch" / "scene.toml", duration=1.2)
    assert run.events
    run.write(tmp_path / "run.h5")
    again = unfurl.load(tmp_path / "run.h5")
    assert again.summary == run.summary and again.text == run.text and again.keys() == run.keys()
    assert [(e.t, e.kind, e.where, e.data) for e in again.events] == [
        (e.t, e.kind, e.where, e.data) for e in run.events
    ]
    assert dict(unfurl.load(tmp_path / "run.h5").shapes) == {}


def test_quantities_are_chosen(pendulum):
    run = unfurl.simulate(pendulum, quantities=["tip.*"], duration=0.1)
    assert "tip.x" in run and "pin.theta" not in run


def test_observer_sees_every_sample(pendulum):
    seen = []
    run = unfurl.simulate(pendulum, observer=lambda s: seen.append((s.t, s["tip.x"])))
    np.testing.assert_array_equal([t for t, _ in seen], run.t)
    np.testing.assert_array_equal([x for _, x in seen], run["tip.x"])


def test_events_and_progress_are_told(sets):
    events, done = [], []
    run = unfurl.simulate(
        sets / "bouncing_latch" / "scene.toml", on_event=events.append, progress=done.append
    )
    assert [(e.t, e.kind) for e in events] == [(e.t, e.kind) for e in run.events]
    assert events[0].kind == "latch" and events[0].where == "hinge"
    assert all(0.0 <= x <= 1.0 for x in done)


def test_exception_of_an_observer_is_raised_here(pendulum):
    calls = []

    def observer(sample):
        calls.append(sample.t)
        if len(calls) == 5:
            raise ZeroDivisionError("of mine")

    with pytest.raises(ZeroDivisionError, match="of mine"):
        unfurl.simulate(pendulum, observer=observer)
    assert len(calls) == 5
    assert unfurl.simulate(pendulum, duration=0.1).usable  # nothing is left of it


def endless(pendulum, **arguments):
    """Hours of work, were it not interrupted."""
    return unfurl.simulate(pendulum, duration=1e7, rate=0.001, rtol=1e-12, **arguments)


def interrupt_soon():
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    return timer


def test_ctrl_c_ends_a_long_call(pendulum):
    before = signal.getsignal(signal.SIGINT)
    timer = interrupt_soon()
    with pytest.raises(KeyboardInterrupt):
        endless(pendulum)
    timer.join()
    assert signal.getsignal(signal.SIGINT) is before
    # Python's own handler is back: this one is raised by Python and by nothing of ours.
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    assert unfurl.simulate(pendulum, duration=0.1).usable


def test_a_handler_of_the_users_own_is_called(pendulum):
    class Mine(Exception):
        pass

    def handler(number, frame):
        raise Mine

    before = signal.signal(signal.SIGINT, handler)
    try:
        timer = interrupt_soon()
        with pytest.raises(Mine):
            endless(pendulum)
        timer.join()
    finally:
        signal.signal(signal.SIGINT, before)


def test_ctrl_c_within_an_observer(pendulum):
    timer = interrupt_soon()
    with pytest.raises(KeyboardInterrupt):
        endless(pendulum, progress=lambda done: None)
    timer.join()


def test_the_lock_is_released(pendulum):
    """Another thread computes while a long call runs; with the lock held it would not begin."""
    ticks = []
    stop = threading.Event()

    def tick():
        while not stop.is_set():
            ticks.append(1)
            if len(ticks) > 20:
                os.kill(os.getpid(), signal.SIGINT)
                return
            stop.wait(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        endless(pendulum)
    stop.set()
    thread.join()
    assert len(ticks) > 20


def test_errors_have_three_parts(sets, tmp_path):
    path = tmp_path / "scene.toml"
    text = (sets / "double_pendulum" / "scene.toml").read_text()
    path.write_text(text.replace("mass = 1.0", "mas = 1.0", 1))
    with pytest.raises(unfurl.Error) as caught:
        unfurl.read_scene(path)
    error = caught.value
    assert isinstance(error, ValueError)
    assert error.where.startswith(str(path)) and error.what and error.remedy
    assert error.what in str(error) and error.where in str(error) and error.remedy in str(error)
    assert "\n" not in str(error)
    with pytest.raises(unfurl.Error, match="rtol"):
        unfurl.simulate(sets / "double_pendulum" / "scene.toml", rtol=-1.0)
    with pytest.raises(unfurl.Error, match="no such file"):
        unfurl.load(tmp_path / "nothing.h5")


def test_machine_errors_are_told_apart(pendulum, tmp_path):
    assert issubclass(unfurl.MachineError, unfurl.Error)
    with pytest.raises(unfurl.Error):
        unfurl.simulate(pendulum, output=tmp_path / "no" / "such" / "folder" / "run.h5")
