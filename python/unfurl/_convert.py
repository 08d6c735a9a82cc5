"""Records as pandas and xarray know them; both are imported only where they are asked for."""

from typing import Any

import numpy as np

from . import _core

_AXES = ["x", "y", "z"]
_COMPONENTS = ["xx", "xy", "xz", "yy", "yz", "zz"]


def to_pandas(record: Any) -> Any:
    import pandas

    if isinstance(record, _core.Run):
        frame = pandas.DataFrame({name: record[name] for name in record.keys()})
        frame.index = pandas.Index(record.t, name="t")
        return frame
    if isinstance(record, _core.Tracks):
        columns = {"t": record.t, "mark": np.asarray(record.marks, dtype=object)[record.mark]}
        columns |= {axis: record.p[:, k] for k, axis in enumerate(_AXES)}
        columns |= {f"c{name}": record.cov[:, k] for k, name in enumerate(_COMPONENTS)}
        return pandas.DataFrame(columns | {"status": record.status})
    if isinstance(record, _core.Survey):
        columns = {axis: record.p[:, k] for k, axis in enumerate(_AXES)}
        if not record.has_lines:
            columns |= {f"u {name}": record.u[:, k] for k, name in enumerate(record.cameras)}
            columns |= {f"s {name}": record.s[:, k] for k, name in enumerate(record.cameras)}
        return pandas.DataFrame(columns, index=pandas.Index(record.id, name="id"))
    if isinstance(record, _core.Campaign):
        frame = pandas.DataFrame(record.variables | record.responses)
        frame.index.name = "run"
        return frame
    if isinstance(record, _core.Fit):
        rows = [(p.name, p.value, p.sigma, *p.interval, p.unit, p.verdict) for p in record.parameters]
        header = ["name", "value", "sigma", "low95", "high95", "unit", "verdict"]
        return pandas.DataFrame(rows, columns=header).set_index("name")
    raise TypeError(f"no table is known of {type(record).__name__}")


def to_xarray(record: Any) -> Any:
    import xarray

    if isinstance(record, _core.Run):
        series = {
            name: ("t", record[name], _attributes(record.units(name), record.description(name)))
            for name in record.keys()
        }
        return xarray.Dataset(series, {"t": ("t", record.t, _attributes("s", "time"))})
    if isinstance(record, _core.Tracks):
        data = {
            "p": (("t", "axis"), record.p, _attributes("m", f"position in frame {record.frame}")),
            "cov": (("t", "component"), record.cov, _attributes("m^2", "random covariance")),
            "mark": ("t", np.asarray(record.marks)[record.mark]),
            "status": ("t", record.status),
        }
        if record.shared.shape[2] > 0:
            what = _attributes("m", "one sigma of each of the calibration's errors")
            data["shared"] = (("t", "axis", "direction"), record.shared, what)
        time = ("t", record.t, _attributes("s", "time stamp"))
        return xarray.Dataset(data, {"t": time, "axis": _AXES, "component": _COMPONENTS})
    raise TypeError(f"no dataset is known of {type(record).__name__}")


def _attributes(units: str, description: str) -> dict[str, str]:
    return {"units": units, "description": description}
