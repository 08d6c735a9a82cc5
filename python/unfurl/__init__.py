"""Calibrate, reconstruct, simulate and correlate trials of deployable structures.

One call a step; records and paths are taken alike:

    import unfurl

    rig = unfurl.calibrate("survey.csv").rig
    tracks = unfurl.reconstruct("trial.h5", rig)
    run = unfurl.simulate("scene.toml")
    agree = unfurl.compare(tracks, run)
    fit = unfurl.fit_study("study.toml")

Arrays are NumPy's, views into what the library holds: read-only, without a copy. SI units and
radians; readings in pixels. What you can mend raises `unfurl.Error`; what numbers do is a status in
the result (`status`, `usable`, `verdict`). Ctrl-C ends every long call.
"""

from enum import IntEnum
from typing import Any

from . import _convert
from ._core import (
    Calibration,
    CameraReport,
    Campaign,
    Channel,
    CheckedCamera,
    CheckedCause,
    CheckResult,
    Comparison,
    Contribution,
    Cost,
    CostLine,
    CostPoint,
    Design,
    DesignCase,
    Error,
    Fault,
    Fit,
    FitChannel,
    FitParameter,
    FitProgress,
    FitRepeat,
    Health,
    Lab,
    LightChange,
    MachineError,
    MarkError,
    Model,
    ModelFailed,
    Modes,
    Parameter,
    Plan,
    PlanCase,
    ReadingScatter,
    RepeatParameter,
    Rig,
    RigCamera,
    Run,
    RunEvent,
    Sample,
    Scene,
    SceneEffect,
    SceneEffects,
    Score,
    Signal,
    Spectrum,
    SpectrumPair,
    Study,
    Survey,
    Tracks,
    Trial,
    TrialEffect,
    TrialEffects,
    Wand,
    WandCalibration,
    WandCamera,
    WandShape,
    __version__,
    calibrate,
    calibrate_wand,
    campaign,
    check,
    compare,
    compare_channels,
    compile,
    cost,
    design,
    effects,
    effects_study,
    expose,
    expose_survey,
    fit,
    fit_study,
    health,
    load,
    modes,
    parse_scene,
    plan,
    read_channels,
    read_health,
    read_lab,
    read_lines,
    read_scene,
    read_study,
    read_survey,
    read_wand,
    reconstruct,
    simulate,
)


class SampleStatus(IntEnum):
    """How a sample of Tracks came about."""

    GOOD = 0
    THREE_CAMERAS = 1
    REJECTED_READING = 2
    UNSOLVABLE = 3


def to_pandas(record: Any) -> Any:
    """A Run, Tracks, Survey, Fit or Campaign as a pandas.DataFrame: a row for each sample, point or run."""
    return _convert.to_pandas(record)


def to_xarray(record: Any) -> Any:
    """A Run or Tracks as an xarray.Dataset, with times and names as coordinates, and units."""
    return _convert.to_xarray(record)


__all__ = [
    "Calibration",
    "CameraReport",
    "Campaign",
    "Channel",
    "CheckedCamera",
    "CheckedCause",
    "CheckResult",
    "Comparison",
    "Contribution",
    "Cost",
    "CostLine",
    "CostPoint",
    "Design",
    "DesignCase",
    "Error",
    "Fault",
    "Fit",
    "FitChannel",
    "FitParameter",
    "FitProgress",
    "FitRepeat",
    "Health",
    "Lab",
    "LightChange",
    "MachineError",
    "MarkError",
    "Model",
    "ModelFailed",
    "Modes",
    "Parameter",
    "Plan",
    "PlanCase",
    "ReadingScatter",
    "RepeatParameter",
    "Rig",
    "RigCamera",
    "Run",
    "RunEvent",
    "Sample",
    "SampleStatus",
    "Scene",
    "SceneEffect",
    "SceneEffects",
    "Score",
    "Signal",
    "Spectrum",
    "SpectrumPair",
    "Study",
    "Survey",
    "Tracks",
    "Trial",
    "TrialEffect",
    "TrialEffects",
    "Wand",
    "WandCalibration",
    "WandCamera",
    "WandShape",
    "__version__",
    "calibrate",
    "calibrate_wand",
    "campaign",
    "check",
    "compare",
    "compare_channels",
    "compile",
    "cost",
    "design",
    "effects",
    "effects_study",
    "expose",
    "expose_survey",
    "fit",
    "fit_study",
    "health",
    "load",
    "modes",
    "parse_scene",
    "plan",
    "read_channels",
    "read_health",
    "read_lab",
    "read_lines",
    "read_scene",
    "read_study",
    "read_survey",
    "read_wand",
    "reconstruct",
    "simulate",
    "to_pandas",
    "to_xarray",
]
