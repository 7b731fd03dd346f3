"""Writes measurement files by the libraries of their types."""

import numpy as np
import pandas as pd
import pytest

FORMATS = ("csv", "npz", "parquet", "h5", "tdms", "uff", "mf4")
every_format = pytest.mark.parametrize("suffix", FORMATS)
ignored = pytest.mark.filterwarnings("ignore")  # of the libraries, which leave files open


def library(name):
    reason = f"{name} cannot be imported (extra 'files' or 'mdf')"
    return pytest.importorskip(name, reason=reason, exc_type=ImportError)


def write(path, columns, times=None, *, fs=None, units=None, start=None):
    """Write columns with times or rates (of all, or of each), and their units; return the path."""
    units, suffix = units or {}, path.suffix[1:]
    rates = fs if isinstance(fs, dict) else dict.fromkeys(columns, fs)
    table = columns if times is None else {"time": times} | columns
    if suffix == "csv":
        names = {name: f"{name} [{unit}]" for name, unit in units.items()}
        pd.DataFrame(table).rename(columns=names).to_csv(path, index=False)
    elif suffix == "npz":
        np.savez(path, **table, **({"fs": fs} if fs else {}))
    elif suffix == "parquet":
        library("pyarrow")
        frame = pd.DataFrame(table)
        frame.attrs = {"units": units} | ({"fs": fs} if fs else {})
        frame.to_parquet(path)
    elif suffix == "h5":
        with library("h5py").File(path, "w") as file:
            for name, values in table.items():
                stated = {"fs": rates.get(name), "unit": units.get(name)}
                stated = {key: value for key, value in stated.items() if value}
                file.create_dataset(name, data=values).attrs.update(stated)
    elif suffix == "tdms":
        nptdms = library("nptdms")
        objects = []
        for name, values in table.items():
            step = 1 / rates[name] if rates.get(name) else None
            stated = {"wf_increment": step, "unit_string": units.get(name), "wf_start_time": start}
            stated = {key: value for key, value in stated.items() if value}
            objects.append(nptdms.ChannelObject("a", name, values, stated))
        with nptdms.TdmsWriter(path) as writer:
            writer.write_segment(objects)
    elif suffix == "uff":
        sets = []
        for name, values in columns.items():
            x = np.arange(len(values)) / rates[name] if times is None else times
            unit = units.get(name, "NONE")
            sets.append({"id1": name, "data": values, "x": x, "ordinate_axis_units_lab": unit})
        try:
            write_uff(path, sets, binary=1, abscissa_spacing=int(times is None))
        except Exception:
            if times is None or len(times) % 4 == 0:
                raise
            pytest.skip("this version of pyuff cannot write the rest of a line of an uneven set")
    else:
        signals = []
        for name, values in columns.items():
            x = np.arange(len(values)) / rates[name] if times is None else times
            signals.append({"samples": values, "timestamps": x, "name": name})
            signals[-1] |= {"unit": units.get(name, "")}
        write_mdf(path, signals, start)
    return path


def write_uff(path, sets, **options):
    path.unlink(missing_ok=True)
    file = library("pyuff").UFF(str(path))
    usual = {"type": 58, "binary": 0, "func_type": 1, "rsp_node": 1, "rsp_dir": 1, "ref_node": 1}
    usual |= {"ref_dir": 1, "abscissa_spacing": 1, "orddenom_spec_data_type": 0}
    usual |= {"z_axis_spec_data_type": 0, "orddenom_axis_lab": "", "abscissa_spec_data_type": 17}
    for one in sets:
        file.write_sets(usual | options | one, "add")


def write_mdf(path, signals, start=None):
    asammdf = library("asammdf")
    with asammdf.MDF(version="4.10") as file:
        if start is not None:
            file.start_time = pd.Timestamp(start, tz="UTC").to_pydatetime()
        for signal in signals:
            file.append([asammdf.Signal(**signal)])
        file.save(path, overwrite=True)


def write_segments(path, *segments):
    """Write segments of a TDMS channel with their properties; return the path."""
    nptdms = library("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        for values, properties in segments:
            writer.write_segment([nptdms.ChannelObject("a", "vib", values, properties)])
    return path
