"""What the restitution of a latch's contact does to its bouncing, in pictures.

    python3 parameter_study.py SCENE    (data/sets/bouncing_latch/scene.toml)
"""

import sys

import matplotlib.pyplot as plt

import unfurl


def main(scene: str, picture: str = "parameter_study.png") -> int:
    figure, (motion, impacts) = plt.subplots(1, 2, figsize=(10, 4))
    values = [0.5, 0.6, 0.7, 0.8, 0.9]
    counts = []
    for restitution in values:
        run = unfurl.simulate(scene, set={"contact.lock.restitution": restitution})
        if not run.usable:
            raise RuntimeError(f"restitution {restitution}: {run.message}")
        struck = [event.t for event in run.events if event.kind == "contact_start"]
        counts.append(len(struck))
        after = run.t > struck[0] - 0.02
        motion.plot(run.t[after], 1e3 * run["hinge.theta"][after], label=f"e = {restitution:g}")
        print(f"restitution {restitution:g}: {len(struck)} impacts, the last at {struck[-1]:.3f} s")
    motion.set(xlabel="t [s]", ylabel="angle of the hinge [mrad]", xlim=(None, 2.0))
    motion.legend()
    impacts.plot(values, counts, "o-")
    impacts.set(xlabel="restitution [-]", ylabel="impacts")
    figure.tight_layout()
    figure.savefig(picture)
    print(f"-> {picture}")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
