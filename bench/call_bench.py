"""What a call from Python costs over the same call in C++.

    PYTHONPATH=build/release/python /usr/bin/python3 bench/call_bench.py build/release/bench/call_bench

The least of the repeats by the processor's clock, in milliseconds: other work on the machine does not enter. The two take
turns.
"""

import subprocess
import sys
import time
from pathlib import Path

import unfurl

SETS = Path(__file__).resolve().parent.parent / "data" / "sets"
REPEATS, ROUNDS = 7, 3


def milliseconds(call):
    times = []
    for _ in range(REPEATS):
        start = time.process_time()
        call()
        times.append(1e3 * (time.process_time() - start))
    return min(times)


def main(program: str) -> None:
    scene = SETS / "bouncing_latch" / "scene.toml"
    model = unfurl.compile(scene)
    run = unfurl.simulate(model, duration=0.8)
    calls = {
        "read_scene": lambda: unfurl.read_scene(scene),
        "load_rig": lambda: unfurl.load(SETS / "deployment" / "rig.h5"),
        "simulate": lambda: unfurl.simulate(model, duration=0.8),
        "compare": lambda: unfurl.compare(run, run),
    }
    python, native = {name: [] for name in calls}, {name: [] for name in calls}
    for _ in range(ROUNDS):
        words = subprocess.run([program, SETS, str(REPEATS)], capture_output=True, check=True, text=True)
        for line in words.stdout.splitlines():
            name, value = line.split()
            native[name].append(float(value))
        for name, call in calls.items():
            python[name].append(milliseconds(call))
    print(f"{'call':<12}{'C++ [ms]':>10}{'Python [ms]':>13}{'over [ms]':>11}")
    for name in calls:
        a, b = min(native[name]), min(python[name])
        print(f"{name:<12}{a:>10.3f}{b:>13.3f}{b - a:>11.3f}")
    x = milliseconds(lambda: [run["tip.x"] for _ in range(1000)])
    print(f"a column of a run, without a copy: {x:.2f} us")


if __name__ == "__main__":
    main(sys.argv[1])
