"""Models: loading, errors, names, parts, parameters."""

from __future__ import annotations

import pickle
import xml.dom.minidom
from pathlib import Path

import pytest

import halfarrow as ha
from conftest import CART, MODELS


def test_names(car: ha.Model) -> None:
    assert car.name == "QuarterCar"
    assert car.states == ["wheel.f", "tread.q", "body.f", "spring.q"]
    assert (car.parameters["ks"].value, car.parameters["ks"].unit) == (18e3, "N/m")
    assert car.inputs["road"].unit == "m/s"
    assert car.variables["body.f"].unit == "m/s" and car.variables["body.f"].default
    assert not car.variables["damper.e"].default


def test_errors_have_place_reason_and_remedy() -> None:
    with pytest.raises(ha.ModelError) as caught:
        ha.model("model M\nSe:a(1) -> 1:v -> I:m(mas)\nparam mass = 2 kg\n", name="m.bond")
    text = str(caught.value)
    assert "m.bond:2:23" in text and "`mas`" in text and "did you mean `mass`" in text, text
    [diagnostic] = caught.value.diagnostics
    assert (diagnostic.severity, diagnostic.line, diagnostic.column) == ("error", 2, 23)
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == text and again.diagnostics == caught.value.diagnostics


def test_errors_of_later_stages_are_model_errors_too() -> None:
    clash = ha.model("model M\nSf:a(1) -> 1:v\nSf:b(2) -> v\nv -> R:r(1)\n")
    with pytest.raises(ha.ModelError):
        clash.simulate(to=1)


def test_warnings_are_python_warnings() -> None:
    with pytest.warns(ha.ModelWarning) as caught:
        ha.model("model M\nSe:a(1) -> I:m(1)\nSe:b(1) -> I:n(1)\n", name="m.bond")
    warning = caught[0].message
    assert isinstance(warning, ha.ModelWarning) and warning.diagnostic is not None
    assert "not connected" in str(warning) and warning.diagnostic.line == 3
    assert caught[0].filename == __file__


def test_files(tmp_path: Path) -> None:
    parts = "component Load(port p) { p -> 1:axis -> I:mass(2 kg) }\n"
    text = 'model Drop\nimport "parts.bond"\nSe:weight(9.81 N) -> Load:load\n'
    memory = ha.model(text, files={"parts.bond": parts})
    (tmp_path / "drop.bond").write_text(text)
    (tmp_path / "parts.bond").write_text(parts)
    disk = ha.load(tmp_path / "drop.bond")
    (tmp_path / "parts.bond").unlink()
    for model in (memory, disk, pickle.loads(pickle.dumps(disk))):
        assert model.simulate(to=2)["load.mass.f"][-1] == pytest.approx(9.81)
    assert list(disk.files.values()) == [parts]


def test_files_elsewhere_have_to_be_allowed(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "parts.bond").write_text("component Load(port p) { p -> I:mass(2 kg) }\n")
    (inner / "drop.bond").write_text('model Drop\nimport "../parts.bond"\nSe:weight(1 N) -> Load:load\n')
    with pytest.raises(ha.ModelError, match=r'`allow=\["'):
        ha.load(inner / "drop.bond")
    assert ha.load(inner / "drop.bond", allow=[tmp_path]).name == "Drop"


def test_a_file_that_is_not_there() -> None:
    with pytest.raises(ha.FileError, match="nothing.bond cannot be read"):
        ha.load("nothing.bond")
    with pytest.raises(OSError):
        ha.load("nothing.bond")


def test_parameters(cart: ha.Model) -> None:
    heavy = cart.with_parameters(m="4000 g", b=3)
    assert heavy.parameters["m"].value == 4.0 and heavy.parameters["b"].value == 3.0
    assert cart.parameters["m"].value == 2.0
    assert ha.model(CART, parameters={"m": "2*3 kg"}).parameters["m"].value == 6.0
    again = pickle.loads(pickle.dumps(heavy))
    assert again.parameters["m"].value == 4.0
    with pytest.raises(ha.UsageError, match="mm"):
        cart.with_parameters(mm=1)
    with pytest.raises(ha.ModelError):
        cart.with_parameters(m="3 s")


def test_arrays_of_parameters() -> None:
    text = "model M\nparam n = 2\nparam k[n] = 10 N/m\nfor i in 1..n {\n1:v[i] -> I:m[i](1 kg, f0 = 1 m/s)\nv[i] -> C:s[i](k = k[i])\nif i > 1 { v[i - 1] -> 0:j[i] -> v[i]\nj[i] -> R:r[i](1 N.s/m) }\n}\n"
    model = ha.model(text)
    both = model.simulate(to=0.1, k=20)["m[1].f"].tobytes()
    assert both == model.simulate(to=0.1, parameters={"k[1]": 20, "k[2]": "20 N/m"})["m[1].f"].tobytes()
    assert both == model.with_parameters(k=20).simulate(to=0.1)["m[1].f"].tobytes()
    assert both != model.simulate(to=0.1, parameters={"k[2]": 20})["m[1].f"].tobytes()
    assert model.with_parameters(k=[5, 6]).parameters["k[2]"].value == 6.0
    # A number that shapes the model: compiled anew.
    assert "m[3].f" in model.simulate(to=0.1, n=3)
    assert model.with_parameters(n=4).states[-1] == "s[4].q"


def test_loops(car: ha.Model) -> None:
    loops = ha.load(MODELS / "class2" / "model.bond").loops
    assert loops.paths[0].class_ == 2 and loops.paths[0].gain
    assert "zero-order causal path" in str(loops) and "<table>" in loops._repr_html_()
    assert list(loops.to_pandas()["class"]) == [path.class_ for path in loops]
    assert car.loops.dof == 4


def test_equations() -> None:
    pendulum = ha.load(MODELS / "pendulum" / "model.bond")
    minimal = pendulum.equations()
    assert minimal.text.startswith("(J + M a²) ω' = -M g a cos φ")
    assert "\\begin{align}" in minimal.latex and minimal._repr_latex_().startswith("$$")
    assert minimal.index == 0 and minimal.counts == {"differential": 1, "algebraic": 0}
    assert pendulum.equations(form="break").counts["algebraic"] > 0
    assert len(pendulum.equations(only=minimal.states[0].name).equations) == 1
    with pytest.raises(ha.UsageError, match="did you mean `lagrange`"):
        pendulum.equations(form="lagrang")  # type: ignore[arg-type]
    with pytest.raises(ha.UnknownNameError):
        pendulum.equations(only="nothing.f")


@pytest.mark.filterwarnings("ignore::halfarrow.ModelWarning")
@pytest.mark.parametrize("path", sorted(MODELS.glob("*/model.bond")), ids=lambda path: path.parent.name)
def test_equations_in_sympy(path: Path) -> None:
    """Every model: the rates that SymPy computes at the start are those that the library computes."""
    import sympy

    from halfarrow import _sympy

    model = ha.load(path)
    equations = model.equations()
    if equations.index or equations.algebraic or equations.definitions or model.inputs:
        pytest.skip("not explicit by itself")
    try:
        written = equations.sympy()
    except ha.UsageError as why:
        assert "has no word in SymPy" in str(why)
        pytest.skip(str(why))
    lin = model.linearize(outputs=[])
    t = sympy.Symbol("t")
    values = {sympy.Symbol(p.name): sympy.Float(p.value, 30) for p in model.parameters.values()}
    values[t] = sympy.Integer(0)
    if kept := [line.split(" = ", 1)[0] for line in equations.conserved]:
        for line in _sympy.equations(equations.conserved, {*model.parameters, *kept}):
            parts = line.rhs.atoms(sympy.core.function.AppliedUndef)
            r = model.simulate(to=1e-9, record=[part.func.__name__ for part in parts])
            values[line.lhs] = line.rhs.subs({part: sympy.Float(r[part.func.__name__][0], 30) for part in parts})
    at = {sympy.Function(name)(t): sympy.Float(x, 30) for name, x in zip(lin.states, lin.x)}
    for name, rate in zip(lin.states, lin.rates):
        derivative = sympy.Derivative(sympy.Function(name)(t), t)
        found = [equation for equation in written if equation.has(derivative)]
        if len(found) != 1:
            pytest.skip("rates depend on each other")
        others = {f.func.__name__ for e in found for f in e.atoms(sympy.core.function.AppliedUndef)} - set(lin.states)
        if others:
            pytest.skip(f"reads {sorted(others)}")
        difference = (found[0].lhs - found[0].rhs).subs(derivative, sympy.Float(rate, 30)).subs(at).subs(values)
        scale = max(
            abs(complex(term.subs(derivative, sympy.Float(rate, 30)).subs(at).subs(values)))
            for term in sympy.Add.make_args(sympy.expand(found[0].lhs)) + sympy.Add.make_args(found[0].rhs)
        )
        assert abs(complex(difference)) <= 1e-9 * max(scale, 1e-300), found[0]


def test_show_and_draw(car: ha.Model, tmp_path: Path) -> None:
    assert car.show("causal_graph")
    with pytest.raises(ha.UsageError, match="did you mean `program`"):
        car.show("programm")  # type: ignore[arg-type]
    drawing = car.draw(laws=False)
    drawing.save(tmp_path / "car.svg")
    drawing.save(tmp_path / "car.png")
    assert (tmp_path / "car.png").read_bytes()[1:4] == b"PNG"
    with pytest.raises(ha.UsageError, match="end in .svg or .png"):
        drawing.save(tmp_path / "car.pdf")
    with pytest.raises(ha.UsageError, match="there is no path 99"):
        car.draw(paths=[99])


def test_notebooks_show_drawing_parameters_and_warnings() -> None:
    with pytest.warns(ha.ModelWarning):
        model = ha.model("model M\nparam m = 2 kg\nSe:a(1) -> I:m(m)\nSe:b(1) -> I:n(1)\n")
    page = model._repr_html_()
    assert "<svg" in page and "<td>m</td><td>2</td><td>kg</td>" in page and "not connected" in page


def test_a_model_is_pickled_as_text(car: ha.Model) -> None:
    changed = car.with_parameters(ks="20 kN/m")
    data = pickle.dumps(changed)
    assert len(data) < 2 * len(car.text)
    again = pickle.loads(data)
    a, b = changed.simulate(to=1), again.simulate(to=1)
    assert a.t.tobytes() == b.t.tobytes() and a["body.f"].tobytes() == b["body.f"].tobytes()


def test_library_and_layout() -> None:
    assert "Resistor" in [c.name for c in ha.library()[0].components]
    with pytest.raises(ha.ModelError):
        ha.format("model M\n->\n")


def test_help_is_a_guide() -> None:
    import pydoc

    text = pydoc.plain(pydoc.render_doc(ha))
    for word in ("simulate", "sweep", "linearize", "stepper", "export", "AuditWarning"):
        assert word in text


def test_everything_public_is_documented() -> None:
    for name in ha.__all__:
        thing = getattr(ha, name)
        if callable(thing):
            assert thing.__doc__, name
            for own, value in vars(thing).items() if isinstance(thing, type) else []:
                if not own.startswith("_") and (callable(value) or isinstance(value, property)):
                    assert value.__doc__, f"{name}.{own}"


def test_mathml(car: ha.Model) -> None:
    table = xml.dom.minidom.parseString(car.equations().mathml)
    assert len(table.getElementsByTagName("mtr")) == len(car.equations().equations)
    assert "<mover><mi>f</mi><mo>˙</mo></mover>" in car.equations().mathml
    assert repr(car.equations()).startswith("<Equations of QuarterCar, form minimal>\n")


def test_equations_that_are_not_there(car: ha.Model) -> None:
    with pytest.raises(ha.UnknownNameError, match="did you mean `spring.q`"):
        car.equations(only="sprng.q")
    with pytest.raises(ha.UsageError, match="ask for variables of elements"):
        car.equations(only="chassis.f")
    assert not car.equations(only="damper.f").text.startswith("\n")


def test_texts_and_paths_are_told_apart() -> None:
    with pytest.raises(ha.UsageError, match="`halfarrow.load` reads files"):
        ha.model("car.bond")
    with pytest.raises(ha.UsageError, match="to `halfarrow.model`"):
        ha.load("model Drop\nSe:weight(9.81 N) -> I:mass(1 kg)\n")
