"""A trial from recording to comparison, in a virtual laboratory.

    python3 trial.py SETS    (the folder data/sets/deployment)
"""

import sys
from pathlib import Path

import numpy as np

import unfurl


def main(sets: str) -> int:
    folder = Path(sets)
    # What no trial tells: the clearance of the latches with which it was made.
    joints = [f"joint.joint{k}.latch.theta_{stop}" for k in (1, 2, 3, 4) for stop in "ab"]
    truth = unfurl.simulate(
        folder / "scene_suspension_4.toml", set={key: 0.0059 for key in joints}, duration=1.5
    )
    print(truth)
    for event in truth.events:
        if event.kind == "latch":
            print(f"  {event.where} latched at {event.t:.4f} s")

    trial, flashes = unfurl.expose(truth, folder / "lab.toml", "trial.h5")
    tracks = unfurl.reconstruct(trial, folder / "rig.h5")
    print(trial, tracks, sep="\n")
    error = np.linalg.norm((tracks.p - flashes.p)[tracks.usable], axis=1)
    print(f"found within {1e3 * np.median(error):.3f} mm of the truth (median)")

    drawn = unfurl.simulate(folder / "scene_suspension_4.toml", duration=1.5)
    agree = unfurl.compare(tracks, drawn)
    print(agree.verdict)
    for e in agree.errors:
        print(f"  {e.mark}: {1e3 * e.rmse:.2f} mm RMS, {e.sigmas:.1f} of its sigmas")
    return 0 if agree.usable else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
