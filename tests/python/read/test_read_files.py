"""Logs in the formats of others, each file written by the library of its format."""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import FACTORS, FAST, MAP, SLOW, UNITS, check_values, measured, read_told, table

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.log import Log
from sysid_vehicle.read import FORMATS, propose_channels, read_log

pytestmark = pytest.mark.filterwarnings(
    # What the libraries say of themselves and of each other.
    "ignore::DeprecationWarning",
    "ignore::FutureWarning",
    "ignore::PendingDeprecationWarning",
    "ignore::ResourceWarning",
)


class TestTables:
    def test_parquet_and_arrow(self, tmp_path: Path) -> None:
        pa = pytest.importorskip("pyarrow")
        parquet = importlib.import_module("pyarrow.parquet")
        feather = importlib.import_module("pyarrow.feather")
        fields = [pa.field(n, pa.float64(), metadata={"unit": UNITS.get(n, "s")}) for n in table()]
        columns = [
            pa.array([None if np.isnan(x) else x for x in values]) for values in table().values()
        ]
        data = pa.Table.from_arrays(columns, schema=pa.schema(fields))
        parquet.write_table(data, tmp_path / "run.parquet")
        feather.write_feather(data, tmp_path / "run.arrow", compression="uncompressed")
        check_values(read_told(tmp_path / "run.parquet"))
        check_values(read_told(tmp_path / "run.arrow"))
        check_values(read_told(data))

    def test_pandas_with_stamps_for_an_index(self) -> None:
        pd = pytest.importorskip("pandas")
        stamps = pd.Timestamp("2024-05-01T10:00:00Z") + pd.to_timedelta(FAST, unit="s")
        data = pd.DataFrame({n: v for n, v in table().items() if n != "time_s"}, index=stamps)
        factors = {c: {"column": s, "factor": FACTORS.get(c, 1.0)} for c, s in MAP.items()}
        check_values(read_log(data, factors, check=False), atol=1e-6)

    def test_polars_and_its_parquet(self, tmp_path: Path) -> None:
        pl = pytest.importorskip("polars")
        pytest.importorskip("pyarrow")
        data = pl.DataFrame(table())
        data.write_parquet(tmp_path / "run.parquet")
        factors = {c: {"column": s, "factor": FACTORS.get(c, 1.0)} for c, s in MAP.items()}
        for source in (data, tmp_path / "run.parquet"):
            check_values(read_log(source, factors, check=False))

    def test_xarray_with_two_rates(self) -> None:
        xr = pytest.importorskip("xarray")
        start = np.datetime64("2024-05-01T10:00:00", "ns")
        for fast, slow in (
            (FAST, SLOW),
            tuple(start + np.round(t * 1e9).astype("timedelta64[ns]") for t in (FAST, SLOW)),
        ):
            data = xr.Dataset(coords={"t": fast, "t_gps": slow})
            for name in UNITS:
                dim, time_s = ("t_gps", SLOW) if name == "Speed" else ("t", FAST)
                data[name] = (dim, measured(time_s)[name], {"units": UNITS[name]})
            check_values(read_told(data))

    def test_pairs_of_times_and_values(self) -> None:
        data = {n: (FAST, v) for n, v in measured(FAST).items()}
        data["Speed"] = SLOW, measured(SLOW)["Speed"]
        factors = {c: {"column": s, "factor": FACTORS.get(c, 1.0)} for c, s in MAP.items()}
        check_values(read_log(data, factors, check=False))


class TestMatlab:
    def test_arrays_and_structs(self, tmp_path: Path) -> None:
        from scipy.io import savemat

        factors = {c: {"column": s, "factor": FACTORS.get(c, 1.0)} for c, s in MAP.items()}
        plain = tmp_path / "plain.mat"
        savemat(plain, table())
        check_values(read_log(plain, factors, check=False))
        savemat(plain, {"log": table(), "note": "wet"})
        check_values(read_log(plain, factors, check=False))
        fast = {"t": FAST, **{n: v for n, v in measured(FAST).items() if n != "Speed"}}
        gps = {"time": SLOW, "Speed": measured(SLOW)["Speed"]}
        savemat(tmp_path / "two.mat", {"imu": fast, "gps": gps, "mass": 1500.0})
        log = read_log(tmp_path / "two.mat", factors, check=False)
        check_values(log)
        single = {n: {"time": FAST, "data": v} for n, v in measured(FAST).items()}
        single["Speed"] = {"time": SLOW, "data": measured(SLOW)["Speed"]}
        savemat(plain, single)
        check_values(read_log(plain, factors, check=False))
        savemat(plain, {**single, "Speed": single["Steer"]})
        assert read_log(plain, factors, check=False)["vx_mps"].size == FAST.size

    def test_simulink_and_dspace(self, tmp_path: Path) -> None:
        from scipy.io import savemat

        def logged(names: list[str], time_s: np.ndarray) -> dict[str, Any]:
            signals = np.zeros(len(names), dtype=[("values", object), ("label", object)])
            for k, name in enumerate(names):
                signals[k] = measured(time_s)[name], name
            return {"time": time_s, "signals": signals}

        fast = [name for name in UNITS if name != "Speed"]
        factors = {c: {"column": s, "factor": FACTORS.get(c, 1.0)} for c, s in MAP.items()}
        savemat(tmp_path / "s.mat", {"imu": logged(fast, FAST), "gps": logged(["Speed"], SLOW)})
        check_values(read_log(tmp_path / "s.mat", factors, check=False))

        axes = np.zeros(2, dtype=[("Name", object), ("Data", object)])
        axes[0], axes[1] = ("host", FAST), ("gps", SLOW)
        signals = np.zeros(
            len(UNITS), dtype=[(n, object) for n in ("Name", "Unit", "Data", "XIndex")]
        )
        for k, (name, unit) in enumerate(UNITS.items()):
            slow = name == "Speed"
            signals[k] = name, unit, measured(SLOW if slow else FAST)[name], 2 if slow else 1
        savemat(tmp_path / "d.mat", {"rec1_001": {"X": axes, "Y": signals}})
        check_values(read_told(tmp_path / "d.mat"))

    def test_version_7_3(self, tmp_path: Path) -> None:
        """MATLAB keeps its header before the HDF5 part, and arrays with the columns first."""
        h5py = pytest.importorskip("h5py")
        path = tmp_path / "run.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            for group, time_s in (("imu", FAST), ("gps", SLOW)):
                held = {"time": time_s, **measured(time_s)}
                for name in ["time", *UNITS]:
                    if name == "time" or (name == "Speed") == (group == "gps"):
                        data = file.create_dataset(f"{group}/{name}", data=held[name][None, :])
                        data.attrs["MATLAB_class"] = np.bytes_(b"double")
            text = file.create_dataset("note", data=np.array([[119], [101]], dtype=np.uint16))
            text.attrs["MATLAB_class"] = np.bytes_(b"char")
        with path.open("r+b") as raw:
            raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + b" " * 8 + b"\0\2IM")
        factors = {c: {"column": s, "factor": FACTORS.get(c, 1.0)} for c, s in MAP.items()}
        check_values(read_log(path, factors, check=False))

    def test_hdf5_with_units(self, tmp_path: Path) -> None:
        h5py = pytest.importorskip("h5py")
        with h5py.File(tmp_path / "run.h5", "w") as file:
            for name, values in table().items():
                file[name] = values
                file[name].attrs["units"] = UNITS.get(name, "s")
        check_values(read_told(tmp_path / "run.h5"))


class TestMdf:
    def write(self, path: Path, version: str) -> Path:
        asammdf = pytest.importorskip("asammdf")
        fast = [
            asammdf.Signal(v, FAST, name=n, unit=UNITS[n])
            for n, v in measured(FAST).items()
            if n != "Speed"
        ]
        gps = asammdf.Signal(measured(SLOW)["Speed"], SLOW, name="Speed", unit="km/h")
        twice = asammdf.Signal(np.zeros(SLOW.size), SLOW, name="Status", unit="")
        with asammdf.MDF(version=version) as mdf:
            mdf.append([*fast, asammdf.Signal(FAST + 7.0, FAST, name="Oil", unit="bar")])
            mdf.append([gps, twice])
            mdf.append([twice], acq_name="GPS")
            return Path(mdf.save(path, overwrite=True))

    @pytest.mark.parametrize(("version", "suffix"), [("4.10", "mf4"), ("3.30", "mdf")])
    def test_groups_keep_their_rates(self, tmp_path: Path, version: str, suffix: str) -> None:
        log = read_told(self.write(tmp_path / f"run.{suffix}", version))
        check_values(log)
        np.testing.assert_allclose(log["Oil"], log["time_s"] + 7.0)  # came with its group

    def test_the_same_name_in_two_groups(self, tmp_path: Path) -> None:
        path = self.write(tmp_path / "run.mf4", "4.10")
        with pytest.raises(InvalidInput, match=r"last part of 2 channels; .*GPS\.Status"):
            read_log(path, {**MAP, "vy_mps": "Status"}, check=False)
        log = read_told(path, {**MAP, "vy_mps": "GPS.Status"})
        assert np.nanmax(log["vy_mps"]) == 0.0

    def test_a_unit_of_another_quantity(self, tmp_path: Path) -> None:
        path = self.write(tmp_path / "run.mf4", "4.10")
        with pytest.raises(InvalidInput, match=r"fx_n: the file states 'bar'.*a pressure, but"):
            read_log(path, {**MAP, "fx_n": "Oil"}, check=False)

    def test_samples_that_the_file_calls_invalid(self, tmp_path: Path) -> None:
        asammdf = pytest.importorskip("asammdf")
        signals = [
            asammdf.Signal(v, FAST, name=n, unit=UNITS[n], invalidation_bits=FAST < 0.3)
            for n, v in measured(FAST).items()
        ]
        with asammdf.MDF(version="4.10") as mdf:
            mdf.append(signals)
            path = Path(mdf.save(tmp_path / "run.mf4"))
        log = read_told(path)
        assert log.n == FAST.size
        assert np.flatnonzero(np.isfinite(log["ay_mps2"]))[0] == 30

    def test_the_time_is_not_mapped(self, tmp_path: Path) -> None:
        path = self.write(tmp_path / "run.mf4", "4.10")
        with pytest.raises(InvalidInput, match=r"time_s: every channel of this log has its own"):
            read_log(path, {**MAP, "time_s": "time"}, check=False)

    def test_a_broken_file(self, tmp_path: Path) -> None:
        pytest.importorskip("asammdf")
        path = tmp_path / "run.mf4"
        path.write_bytes(b"MDF     4.10    " + bytes(range(256)))
        with pytest.raises(InvalidInput, match=r"run\.mf4: begins as an ASAM MDF file, but"):
            read_log(path)


VBO = """File created on 31/07/2026 at 23:59:58

[header]
satellites
time
velocity kmh
Longitudinal acceleration g
Lateral acceleration g
YawRate
Steer

[channel units]
deg/s
rad

[comments]
(c) 2001 2026 Racelogic
Log Rate (Hz) : 100.00

[column names]
sats time velocity LongAcc LatAcc YawRate Steer

[data]
"""


class TestText:
    """Formats that no library writes: files made by their makers' descriptions."""

    def test_vbox_over_midnight(self, tmp_path: Path) -> None:
        rows = []
        for t in FAST:
            v = {name: value.item() for name, value in measured(np.float64(t)).items()}
            clock = f"{235958 + t:.2f}" if t < 1.995 else f"{t - 2.0 + 1e-9:09.2f}"
            rows.append(
                f"009 {clock} {v['Speed']:+012.7f} {v['LongAcc']:.7E} {v['LatAcc']:.7E} "
                f"{v['YawRate']:.7E} {v['Steer']:.7E}"
            )
        path = tmp_path / "run.vbo"
        path.write_bytes((VBO + "\n".join(rows) + "\n").replace("\n", "\r\n").encode("latin-1"))
        log = read_told(path, {**MAP, "vx_mps": "velocity"})
        shifted = {c: log[c] for c in log.channels}
        shifted["time_s"] = log["time_s"] - log["time_s"][0]
        check_values(Log.from_arrays(shifted, check=False), slow=(), atol=1e-6)

    def test_motec(self, tmp_path: Path) -> None:
        names = ["Time", *UNITS, "Oil Temp"]
        lines = [
            '"Format","MoTeC CSV File",,,"Workbook",""',
            '"Venue","Ring",,,"Worksheet",""',
            '"Time","15:51:12",,,"Lap",""',
            '"Sample Rate","100.000","Hz",,"End Time","4.0","s"',
            "",
            ",".join(f'"{name}"' for name in names),
            ",".join(f'"{unit}"' for unit in ("s", *UNITS.values(), "C")),
            '"",' * 6 + '""',
            "",
        ]
        for k, t in enumerate(FAST):
            values = [measured(t)[name] for name in UNITS]
            cells = [f'"{x:.9f}"' for x in (t, *values, 90.0)]
            if k % 5:
                cells[names.index("Speed")] = '""'
            lines.append(",".join(cells))
        path = tmp_path / "run.csv"
        path.write_text("\n".join(lines), encoding="utf-8-sig")
        check_values(read_told(path), atol=1e-7)


class TestRegistry:
    def test_every_format_has_its_home_and_its_extra(self, repo: Path) -> None:
        extras = (repo / "pyproject.toml").read_text("utf-8")
        for entry in FORMATS:
            assert (repo / "python/sysid_vehicle/read/formats" / f"{entry.module}.py").is_file()
            assert bool(entry.extra) == bool(entry.libraries)
            if entry.extra:
                assert f"\n{entry.extra} = [" in extras

    @pytest.mark.parametrize("entry", [f for f in FORMATS if f.libraries], ids=lambda f: f.what)
    def test_a_library_that_is_absent(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, entry: Any
    ) -> None:
        real: Callable[..., Any] = importlib.import_module

        def without(name: str, package: str | None = None) -> Any:
            if name.split(".")[0] in entry.libraries:
                raise ModuleNotFoundError(name)
            return real(name, package)

        monkeypatch.setattr(importlib, "import_module", without)
        path = tmp_path / "run.csv"  # the name tells nothing
        path.write_bytes(entry.signatures[0] + bytes(200))
        with pytest.raises(InvalidInput) as caught:
            read_log(path)
        assert str(caught.value).startswith(f"{path}: is {entry.what}")
        assert f"pip install 'sysid-vehicle[{entry.extra}]'" in str(caught.value)

    @pytest.mark.parametrize(
        "entry",
        [f for f in FORMATS if f.signatures and f.module != "can_log"],
        ids=lambda f: f.what,
    )
    def test_a_file_that_only_begins_so(self, tmp_path: Path, entry: Any) -> None:
        for library in entry.libraries:
            pytest.importorskip(library)
        path = tmp_path / "run.dat"
        path.write_bytes(entry.signatures[0] + bytes(range(256)) * 3)
        with pytest.raises(InvalidInput, match=r"^/.*run\.dat: (is|begins as) ") as caught:
            read_log(path)
        assert str(caught.value).count(str(path)) == 1
        assert entry.what in str(caught.value)

    @pytest.mark.parametrize("suffix", sorted({s for f in FORMATS for s in f.suffixes if s != "/"}))
    def test_a_file_that_holds_nothing_is_named(self, tmp_path: Path, suffix: str) -> None:
        path = tmp_path / f"run{suffix}"
        path.write_bytes(b"")
        told = f"{path}: the file holds nothing; record or export the log again"
        for reader in (read_log, propose_channels):
            with pytest.raises(InvalidInput) as caught:
                reader(path)
            assert str(caught.value) == told

    def test_what_the_checks_of_a_log_refuse_names_the_file_too(self, tmp_path: Path) -> None:
        path = tmp_path / "run.csv"
        header = "time_s,vx_mps,yaw_rate_radps,ay_mps2,steer_rad\n"
        path.write_text(header + "0,20,0,0,0\n1,20,0,inf,0\n")
        with pytest.raises(InvalidInput) as caught:
            read_log(path, name="second lap")
        assert str(caught.value).startswith(f"{path}: ay_mps2: infinite at sample 1")


class TestRows:
    """How channels of several times come into one log."""

    CHANNELS = tuple(MAP)

    def log(self, **times: np.ndarray) -> Log:
        data = {c: (times.get(c, FAST), np.sin(times.get(c, FAST))) for c in self.CHANNELS}
        return read_log(data, check=False)

    def test_jitter_of_a_hundredth_of_a_period_shares_the_row(self) -> None:
        log = self.log(ay_mps2=FAST + 5e-5 * np.sin(np.arange(400)))
        assert (log.n, round(log.rate_hz)) == (400, 100)
        assert np.isfinite(log["ay_mps2"]).all()

    def test_a_channel_between_the_rows_of_the_others_is_told(self) -> None:
        with pytest.warns(SysidWarning, match=r"resampled at 100 Hz, vx_mps at its own 20 Hz"):
            log = self.log(vx_mps=SLOW + 0.005)
        known = np.isfinite(log["vx_mps"])
        assert np.count_nonzero(known) == SLOW.size
        # On the grid of the log it is interpolated between its own samples, 50 ms apart.
        np.testing.assert_allclose(log["vx_mps"][known], np.sin(log["time_s"][known]), atol=5e-3)
        np.testing.assert_allclose(log["ay_mps2"], np.sin(log["time_s"]), atol=1e-9)

    def test_late_samples_are_sorted_and_told(self) -> None:
        late = FAST.copy()
        late[[100, 101]] = late[[101, 100]]
        with pytest.warns(SysidWarning, match=r"ay_mps2: 1 samples came late and were sorted"):
            log = self.log(ay_mps2=late)
        np.testing.assert_allclose(log["ay_mps2"], np.sin(log["time_s"]))

    def test_a_clock_that_was_set_back_is_refused(self) -> None:
        broken = np.where(FAST > 2.0, FAST - 1.5, FAST)
        with pytest.raises(InvalidInput, match=r"ay_mps2: its time goes back by 1\.49 s at sample"):
            self.log(ay_mps2=broken)

    def test_times_that_repeat_count_once(self) -> None:
        twice = FAST.copy()
        twice[50] = twice[49]
        with pytest.warns(SysidWarning, match=r"ay_mps2: 1 samples repeat the time of another"):
            log = self.log(ay_mps2=twice)
        assert log.n == 400
