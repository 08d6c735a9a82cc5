"""A rig from a survey, and how far it can be trusted.

    python3 rig.py SURVEY [RIG]
"""

import sys

import numpy as np

import unfurl


def main(survey_path: str, rig_path: str = "rig.h5") -> int:
    result = unfurl.calibrate(survey_path)
    print(f"The rig is {result.verdict}.")
    for reason in result.reasons:
        print("  -", reason)
    for camera in result.cameras:
        print(f"{camera.name}: {camera.readings} readings, residual {camera.residual_rms:.4f} px")
    if not result.usable:
        return 1
    # Points that were found without having been used: what a measurement will be off by.
    errors = np.linalg.norm(result.held_out, axis=1)
    print(f"held-out points: {1e3 * np.sqrt(np.mean(errors**2)):.3f} mm RMS of {len(errors)}")
    result.rig.write(rig_path)

    plan = unfurl.plan(result.rig)
    for case in plan.cases:
        print(f"{case.name}: {100 * case.found:.0f}% found, half within {1e3 * case.quantile(0.5):.2f} mm")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
