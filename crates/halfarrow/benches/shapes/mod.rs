//! Models of any size, as text.

use std::fmt::Write;

/// An RC ladder of `n` sections, fed by a voltage.
pub fn ladder(n: usize) -> String {
    let mut text = head("Ladder");
    for i in 1..=n {
        _ = writeln!(text, "s{i} -> R:R{i}(r)\ns{i} -> 0:n{i}\nn{i} -> C:C{i}(c)");
        if i < n {
            _ = writeln!(text, "n{i} -> 1:s{}", i + 1);
        }
    }
    text
}

/// The ladder with its end at its start.
pub fn ring(n: usize) -> String {
    let mut text = ladder(n);
    _ = writeln!(text, "n{n} -> s1");
    text
}

/// A ring of `n` 1-junctions and `n` 0-junctions, nearly bare.
pub fn junction_ring(n: usize) -> String {
    let mut text = head("JunctionRing");
    _ = writeln!(text, "s1 -> R:R(r)\nC:C(c)");
    for i in 1..=n {
        let next = if i < n { format!("1:s{}", i + 1) } else { "s1".into() };
        _ = writeln!(text, "s{i} -> 0:n{i} -> {next}");
    }
    text + "n1 -> C\n"
}

/// A net of resistors with `n` times `n` nodes; at every `storages`th node a capacitor, at the others a resistor, so
/// that they lie on loops of class 2 unless `storages` is 1.
pub fn mesh(n: usize, storages: usize) -> String {
    let mut text = head("Mesh") + "s1 -> R:input(r)\n";
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let here = format!("n{i}_{j}");
        let element = if (i * n + j).is_multiple_of(storages) { "C" } else { "R" };
        let value = element.to_lowercase();
        _ = writeln!(text, "0:{here} -> {element}:{element}{i}_{j}({value})");
        for (name, far, inside) in
            [("v", format!("n{}_{j}", i + 1), i + 1 < n), ("h", format!("n{i}_{}", j + 1), j + 1 < n)]
        {
            if inside {
                _ = writeln!(text, "{here} -> 1:{name}{i}_{j} -> {far}\n{name}{i}_{j} -> R:R{name}{i}_{j}(r)");
            }
        }
    }
    text + "s1 -> n0_0\n"
}

/// `n` inertias, each geared to the one before it: one degree of freedom.
pub fn gear_train(n: usize) -> String {
    let mut text = "model GearTrain\nSe:motor(1 N.m) -> 1:w1 -> I:I1(1 kg.m2)\n".to_string();
    for i in 2..=n {
        _ = writeln!(text, "param g{i} = 1.01\nw{} -> TF:T{i}(g{i}) -> 1:w{i} -> I:I{i}(1 kg.m2)", i - 1);
    }
    text
}

/// A plane pendulum of `n` point masses on rods without mass.
pub fn pendulum(n: usize) -> String {
    let mut text = "model Pendulum\nparam m = 1, l = 1, g = 9.81\n".to_string();
    for i in 1..=n {
        _ = writeln!(text, "1:w{i}\nstate a{i}' = w{i}.f from {}/10", i);
        _ = writeln!(text, "1:x{i} -> I:mx{i}(m)\n1:y{i} -> I:my{i}(m)\nSe:G{i}(-m*g) -> y{i}");
        for (axis, function) in [("x", "cos"), ("y", "sin")] {
            let end =
                if i > 1 { format!("0:j{axis}{i} -> {axis}{i}\n{axis}{} -> j{axis}{i}", i - 1) } else { String::new() };
            let joint = if i > 1 { format!("j{axis}{i}") } else { format!("{axis}{i}") };
            _ = writeln!(text, "{end}\nw{i} -> TF:c{axis}{i}(l*{function}(a{i})) -> {joint}");
        }
    }
    text
}

fn head(name: &str) -> String {
    format!("model {name}\nparam r = 1 ohm, c = 1 mF\nSe:source(1 V) -> 1:s1\n")
}
