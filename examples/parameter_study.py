"""What the restitution of a latch's contact does to its bouncing, in pictures.

    python3 parameter_study.py SCENE    (data/sets/bouncing_latch/scene.toml)
"""

import sys

import matplotlib.pyplot as plt

import unfurl

VALUES = [0.5, 0.6, 0.7, 0.8, 0.9]


def main(scene: str, picture: str = "parameter_study.png") -> int:
    figure = plt.figure(figsize=(10, 6), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[2, 1])
    motions = left.subplots(len(VALUES), 1, sharex=True, sharey=True)
    counts = []
    for axes, restitution in zip(motions, VALUES):
        run = unfurl.simulate(scene, set={"contact.lock.restitution": restitution})
        if not run.usable:
            raise RuntimeError(f"restitution {restitution}: {run.message}")
        struck = [event.t for event in run.events if event.kind == "contact_start"]
        counts.append(len(struck))
        after = run.t >= struck[0]
        axes.plot(run.t[after], 1e3 * run["hinge.theta"][after], linewidth=0.8)
        axes.set_title(f"restitution {restitution:g}", fontsize="small", loc="right", pad=2)
        print(f"restitution {restitution:g}: {len(struck)} impacts, the last at {struck[-1]:.3f} s")
    motions[-1].set_xlabel("t [s]")
    left.supylabel("angle of the hinge, latched [mrad]")
    impacts = right.subplots()
    impacts.plot(VALUES, counts, "o-")
    impacts.set(xlabel="restitution [-]", ylabel=f"impacts in {run.t[-1]:g} s")
    figure.savefig(picture)
    print(f"-> {picture}")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
