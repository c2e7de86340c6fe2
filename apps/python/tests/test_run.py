"""Runs: inputs, parameters, results, warnings, interruption, what is not done twice."""

from __future__ import annotations

import os
import pickle
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pandas
import pytest
import xarray

import halfarrow as ha
from conftest import MODELS


def exact(t: np.ndarray, force: float = 3.0, m: float = 2.0, b: float = 1.0) -> np.ndarray:
    return force / b * (1 - np.exp(-b / m * t))


def test_a_run(cart: ha.Model) -> None:
    r = cart.simulate(to=4, every=0.5, push=3, rtol=1e-10)
    assert list(r) == ["cart.f", "speed"] and r.units == {"cart.f": "m/s", "speed": "km/h"}
    np.testing.assert_allclose(r["cart.f"], exact(r.t), atol=1e-8)
    np.testing.assert_allclose(r["speed"], 3.6 * r["cart.f"], rtol=1e-14)
    assert r.complete and r.reached == 4.0 and r.report["steps"] > 0
    assert r.audit.verdict == "holds" and r.audit.power is not None
    assert set(r.tolerances) == {"cart.f"}
    assert "Cart to t = 4 s" in repr(r) and "<svg" in r._repr_html_()


def test_every_kind_of_input(cart: ha.Model, tmp_path: Path) -> None:
    t = np.array([0.0, 1.0, 1.0, 4.0])
    v = np.array([0.0, 2.0, 5.0, 1.0])
    (tmp_path / "push.csv").write_text("t,push\n" + "".join(f"{a},{b}\n" for a, b in zip(t, v)))

    def run(push: object) -> bytes:
        return cart.simulate(to=4, every=0.1, inputs={"push": push})["cart.f"].tobytes()  # type: ignore[dict-item]

    wanted = run((t, v))
    assert run((list(t), list(v))) == wanted
    assert run(tmp_path / "push.csv") == wanted
    assert run(str(tmp_path / "push.csv")) == wanted
    assert run(pandas.Series(v, index=t)) == wanted
    assert run(xarray.DataArray(v, dims="time", coords={"time": t})) == wanted
    unaligned = np.frombuffer(b"." + v.tobytes(), dtype=np.uint8)[1:].view(np.float64)
    assert not unaligned.flags.aligned and run((t, unaligned)) == wanted
    assert run((np.arange(8.0)[::2], np.ones(4))) == run(1) == run(np.float64(1.0))


def test_functions_of_time_are_sampled(cart: ha.Model) -> None:
    asked: list[float] = []

    def push(t: float) -> float:
        asked.append(t)
        return np.sin(t)

    a = cart.simulate(to=2, every=0.25, push=push)
    np.testing.assert_allclose(asked, np.arange(0, 2.25, 0.25))
    t = np.linspace(0, 2, 9)
    assert a["cart.f"].tobytes() == cart.simulate(to=2, every=0.25, push=(t, np.sin(t)))["cart.f"].tobytes()
    asked.clear()
    cart.simulate(to=2, every=0.25, push=push, sample=0.1)
    assert len(asked) == 21


def test_parameters_are_keywords(cart: ha.Model) -> None:
    for m in (1, "1 kg", "1000 g", np.float64(1.0)):
        r = cart.simulate(to=4, every=4, push=3, m=m, rtol=1e-10)
        assert r["cart.f"][-1] == pytest.approx(exact(np.array(4.0), m=1.0), abs=1e-7)
    assert cart.simulate(to=1, parameters={"m": 1}, inputs={"push": 3})["cart.f"][-1] > 0
    assert cart.parameters["m"].value == 2.0


def test_unknown_names_are_refused_with_the_nearest(cart: ha.Model, car: ha.Model) -> None:
    with pytest.raises(ha.UnknownNameError, match="`pus` is no parameter or input of Cart.*did you mean `push`"):
        cart.simulate(to=1, pus=3)
    with pytest.raises(ha.UnknownNameError, match="no argument of simulate; did you mean `method`"):
        cart.simulate(to=1, metod="rk4")
    with pytest.raises(ha.UnknownNameError, match="no argument of sweep; did you mean `reduce`"):
        cart.sweep(to=1, m=[1, 2], reduc={})
    with pytest.raises(ha.UnknownNameError, match="no input `raod`; did you mean `road`"):
        car.simulate(to=1, inputs={"raod": 1})
    with pytest.raises(ha.UnknownNameError, match="no parameter `kss`; did you mean `ks`"):
        car.simulate(to=1, parameters={"kss": 1})
    with pytest.raises(ha.UnknownNameError, match="did you mean `body.f`"):
        car.simulate(to=1, record="bodi.f")
    r = car.simulate(to=1)
    with pytest.raises(ha.UnknownNameError, match="did you mean `body.f`"):
        r["body.g"]
    with pytest.raises(KeyError):
        r["nothing"]


def test_what_cannot_be_is_refused_in_words_of_python(cart: ha.Model) -> None:
    for words, options in [
        ("give it with step, as in `step=1e-3`", {"method": "rk4"}),
        ("did you mean `radau`", {"method": "rada"}),
        ("did you mean `equilibrium`", {"start": "equilibrum"}),
        ("as many values as times", {"push": ([0, 1], [0])}),
        ("what is no numbers", {"push": ([0, 1], ["a", "b"])}),
        ("a dict", {"push": {}}),
        ("a run has one", {"m": [1, 2]}),
        ("measures something else than kg", {"m": "3 s"}),
        ("write a number", {"m": "many"}),
        ("`m` is None: give a number", {"m": None}),
    ]:
        with pytest.raises(ha.UsageError, match=words):
            cart.simulate(to=1, **options)
    with pytest.raises(ha.UsageError):
        cart.simulate(to=-1)
    with pytest.raises(ha.UsageError, match="time goes back from 1 s to 0 s"):
        cart.simulate(to=1, push=([1, 0], [0, 1]))
    assert issubclass(ha.UsageError, ValueError)


def test_columns_are_not_copied(car: ha.Model) -> None:
    """The arrays are where the run wrote its numbers, in the frame and the dataset too."""
    from halfarrow.model import _options, _recorded

    options = _options(
        to=1.0, every=0.01, method="auto", step=None, rtol=1e-6, atol=None, form="minimal", start="given",
        record=_recorded(None, ()), project=False, minimum_norm=False, stiffness=None, damping=None, execution="auto",
        at=[], sensitivities=[],
    )  # fmt: skip
    ended = car._core.simulate(options, [], [], None)
    r = ha.Result(car, ended, 1.0)
    arrays = [r.t, *r.values()]
    assert [a.__array_interface__["data"][0] for a in arrays] == ended.addresses
    assert len(set(ended.addresses)) == len(arrays) and all(len(a) == 101 for a in arrays)
    data = r.to_xarray()
    frame = r.to_pandas()
    for name in r:
        assert np.shares_memory(data[name].values, r[name])
        assert np.shares_memory(frame[name].to_numpy(), r[name])


def test_frames_datasets_and_files(cart: ha.Model, tmp_path: Path) -> None:
    r = cart.simulate(to=1, every=0.5, push=3)
    frame = r.to_pandas()
    assert list(frame.columns) == list(r) and frame.index.name == "t"
    assert frame.attrs["units"]["speed"] == "km/h" and frame.attrs["audit"]["verdict"] == "holds"
    data = r.to_xarray()
    assert data["speed"].attrs["units"] == "km/h" and data.attrs["audit"]["verdict"] == "holds"
    assert data["speed"].sel(t=0.5).item() == r["speed"][1]
    r.save(tmp_path / "r.csv", units=True)
    assert (tmp_path / "r.csv").read_text().splitlines()[:2] == ["t,cart.f,speed", "s,m/s,km/h"]
    np.testing.assert_array_equal(pandas.read_csv(tmp_path / "r.csv", skiprows=[1])["speed"], r["speed"])
    r.save(tmp_path / "r.parquet")
    assert (tmp_path / "r.parquet").read_bytes()[:4] == b"PAR1"
    with pytest.raises(ha.UsageError, match="end in .csv or .parquet"):
        r.save(tmp_path / "r.txt")
    with pytest.raises(ha.FileError, match="cannot be written"):
        r.save(tmp_path / "nowhere" / "r.csv")


def test_plots(cart: ha.Model) -> None:
    import matplotlib.pyplot as plt

    r = cart.simulate(to=1, push=3)
    _, ax = plt.subplots()
    assert r.plot("speed", ax=ax) is ax
    [line] = ax.get_lines()
    np.testing.assert_array_equal(line.get_ydata(), r["speed"])
    assert ax.get_xlabel() == "t in s" and line.get_label() == "speed in km/h"
    assert len(r.plot(x="cart.f", ax=plt.subplots()[1]).get_lines()) == 2
    with pytest.raises(ha.UnknownNameError, match="did you mean `speed`"):
        r.plot("sped")
    plt.close("all")
    slow = cart.simulate(to=1, push=1)
    picture = r.picture("speed", beside={"slow": slow})
    assert "slow" in picture.svg and picture.svg != r.picture("speed").svg
    with pytest.raises(ha.UnknownNameError):
        r.picture("sped")


def test_results_are_pickled(cart: ha.Model) -> None:
    r = cart.simulate(to=1, every=0.5, push=3)
    again = pickle.loads(pickle.dumps(r))
    assert again["speed"].tobytes() == r["speed"].tobytes() and again.report == r.report
    assert again.picture().svg == r.picture().svg


def test_record(cart: ha.Model) -> None:
    assert list(cart.simulate(to=1, record=["drag.e"])) == ["drag.e"]
    assert list(cart.simulate(to=1, also="drag.e")) == ["cart.f", "speed", "drag.e"]
    assert "hand.e" in cart.simulate(to=1, record="all")


def test_forms_methods_and_executions_agree() -> None:
    pendulum = ha.load(MODELS / "pendulum" / "model.bond")
    base = pendulum.simulate(to=1, every=0.1, rtol=1e-10)
    name = pendulum.states[0]
    for options in [{"form": "lagrange"}, {"method": "radau"}, {"method": "rk4", "step": 1e-3}, {"form": "kane"}]:
        other = pendulum.simulate(to=1, every=0.1, rtol=1e-10, record=name, **options)  # type: ignore[arg-type]
        np.testing.assert_allclose(other[name], base[name], atol=1e-7)
    a, b = (pendulum.simulate(to=1, every=0.1, execution=e) for e in ("bytecode", "machine"))  # type: ignore[arg-type]
    assert a[name].tobytes() == b[name].tobytes()


def test_the_second_run_compiles_nothing(car: ha.Model) -> None:
    model = pickle.loads(pickle.dumps(car))
    model.simulate(to=0.1)
    before = model.timings
    model.simulate(to=0.1, ks=20e3, road=0.1)
    model.simulate(to=0.1, every=0.01, method="radau")
    model.sweep(to=0.1, step=1e-3, ks=[1e4, 2e4])
    with model.stepper(step=1e-3) as run:
        run.step(10)
    after = model.timings
    assert after["run"] > before["run"]
    compiling = ("ast", "bond_graph", "causal_graph", "equations", "program", "code")
    assert all(before[stage] > 0 for stage in compiling)
    assert {stage: after[stage] for stage in compiling} == {stage: before[stage] for stage in compiling}


def test_warnings_of_runs_and_audits() -> None:
    spring = ha.model("model M\n1:v -> I:m(1 kg, f0 = 1 m/s)\nv -> C:s(k = 100 N/m)\n")
    with pytest.warns(ha.AuditWarning, match="shorten step") as caught:
        r = spring.simulate(to=10, step=0.02, method="rk4")
    assert r.complete and r.audit.verdict == "doubtful" and r.audit.warnings
    assert all("--" not in str(w.message) and w.filename == __file__ for w in caught)
    constant = ha.model("model M\nSe:a(1) -> 1:v -> R:r(0 ohm)\nv -> I:m(1)\nlet none = 1/r.e\n")
    with pytest.warns(ha.ModelWarning, match="none"):
        constant.simulate(to=1, record="all")


def test_a_refused_result_is_kept_in_the_error() -> None:
    """Half a turn in one step: energy is not what it was."""
    spring = ha.model("model M\n1:v -> I:m(1 kg, f0 = 1 m/s)\nv -> C:s(k = 100 N/m)\n")
    with pytest.raises(ha.RunError, match="does not satisfy the model.*shorten step") as caught:
        spring.simulate(to=10, step=0.25, method="rk4")
    assert caught.value.result["m.f"].shape == caught.value.result.t.shape
    assert caught.value.result.audit.verdict == "refused"


def test_a_run_that_stops_keeps_what_it_had() -> None:
    growing = ha.model("model M\nstate x' = x^2 from 1\nSe:a(x) -> R:r(1)\n")
    with pytest.raises(ha.RunError, match="t = 0.99|t = 1") as caught:
        growing.simulate(to=2)
    result = caught.value.result
    assert any("grows without bound" in note for note in caught.value.__notes__)
    assert not result.complete and 0.9 < result.reached < 1.01 and result["x"][0] == 1.0
    again = pickle.loads(pickle.dumps(caught.value))
    assert again.result["x"].tobytes() == result["x"].tobytes()


def test_control_c_stops_a_run_and_keeps_it(long: ha.Model) -> None:
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    begun = time.perf_counter()
    with pytest.raises(ha.Interrupted, match="stopped at t =") as caught:
        long.simulate(to=1e7, every=100)
    assert time.perf_counter() - begun < 5
    result = caught.value.result
    assert isinstance(caught.value, KeyboardInterrupt)
    assert not result.complete and 0 < result.reached < 1e7 and len(result["mass.f"]) == len(result.t) > 1


def test_other_threads_go_on_meanwhile(long: ha.Model) -> None:
    count, done = 0, threading.Event()

    def work() -> None:
        long.simulate(to=2000, every=100)
        done.set()

    thread = threading.Thread(target=work)
    longest = 0.0
    thread.start()
    while not done.is_set():
        begun = time.perf_counter()
        sum(range(1000))
        count += 1
        longest = max(longest, time.perf_counter() - begun)
    thread.join()
    assert count > 100, "the interpreter stood still"
    assert longest < 0.5


def test_progress(long: ha.Model) -> None:
    class Bar:
        made: list[Bar] = []

        def __init__(self, total: float, desc: str, unit: str) -> None:
            self.total, self.desc, self.unit, self.reached, self.closed, self.calls = total, desc, unit, 0.0, False, 0
            Bar.made.append(self)

        def update(self, n: float) -> None:
            self.reached += n
            self.calls += 1

        def close(self) -> None:
            self.closed = True

    long.simulate(to=20000, every=1000, progress=Bar)
    [bar] = Bar.made
    assert bar.closed and bar.reached == pytest.approx(20000) and bar.calls > 1
    assert (bar.total, bar.desc, bar.unit) == (20000, "Long", "s")
    own = Bar(1, "", "")
    long.simulate(to=1, progress=own)
    assert own.reached == 1 and not own.closed
    with pytest.raises(ha.UsageError, match="progress is 3"):
        long.simulate(to=1, progress=3)


def test_what_a_bar_raises_ends_the_run(long: ha.Model) -> None:
    class Angry:
        def update(self, n: float) -> None:
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        long.simulate(to=1e7, every=1e4, progress=Angry())


def test_tqdm(long: ha.Model, capsys: pytest.CaptureFixture[str]) -> None:
    long.simulate(to=2000, every=100, progress=True)
    assert "Long" in capsys.readouterr().err


@pytest.mark.parametrize(
    "asked",
    [
        {"to": "1 s"},
        {"to": None},
        {"to": 1.0, "every": "0.1 s"},
        {"to": 1.0, "step": "1 ms", "method": "rk4"},
        {"to": 1.0, "rtol": "1e-6"},
        {"to": True},
    ],
)
def test_what_is_no_number_is_told(asked: dict[str, object]) -> None:
    spring = ha.model("model A\nparam k = 50 N/m\nSe:p(1) -> 1:v -> I:m(2)\nv -> C:c(k = k)\n")
    with pytest.raises(ha.UsageError, match="give a number"):
        spring.simulate(**asked)  # type: ignore[arg-type]
    with pytest.raises(ha.UsageError, match="2 dimensions"):
        spring.sweep(to=1.0, k=[[1.0, 2.0], [3.0, 4.0]])
    with pytest.raises(ha.UsageError, match="give a number of seconds"):
        spring.stepper(step="1 ms")  # type: ignore[arg-type]
    stepper = spring.stepper(step=1e-3)
    with pytest.raises(ha.UsageError, match="in SI units"):
        stepper["k"] = "0.06 kN/m"  # type: ignore[assignment]


def test_a_snapshot_of_another_model_is_refused() -> None:
    spring = ha.model("model A\nparam k = 50 N/m\nSe:p(1) -> 1:v -> I:m(2)\nv -> C:c(k = k)\n")
    mass = ha.model("model B\nSe:p(1) -> 1:v -> I:m(2)\n")
    saved = spring.stepper(step=1e-3).save()
    with pytest.raises(ha.UsageError, match="another model"):
        mass.stepper(step=1e-3).restore(saved)
    spring.stepper(step=1e-3, k=60.0).restore(saved)
