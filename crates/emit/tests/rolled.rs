//! Models of many equal cells in C, which tells them once, in loops: the trajectory of the interpreter, to the last bit.

use crate::c::{check, driver};
use crate::common::{self, Exported, build_by, build_with, export, export_program};
use halfarrow_emit::Method;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/rolled").join(format!("{name}.bond"))
}

/// Loops over cells in a source.
fn loops(one: &Exported) -> usize {
    one.written.source.matches("for (k = 0; k < ").count()
}

fn exported() -> Vec<Exported> {
    let mut all = vec![
        export(&model("ladder"), Method::Rk4, 1e-4),
        export(&model("net"), Method::Heun, 1e-3),
        export(&model("grid"), Method::Heun, 1e-4),
        export(&model("cells"), Method::Rk4, 1e-2),
        export(&model("cells"), Method::Rosenbrock, 1e-2),
        export(&model("ladder"), Method::ImplicitMidpoint, 1e-4),
    ];
    let mut net = common::read_program(&model("net"));
    net.name = "NetAlong".into();
    all.push(export_program(net, Method::Rosenbrock, 1e-3, true));
    all
}

#[test]
fn cells_are_told_once_and_do_what_the_interpreter_does() {
    let all = exported();
    for one in &all {
        assert!(loops(one) > 0, "no loops in {}", one.written.name);
    }
    check("rolled", &all, &driver(&all, &|_| (-1, 0.0)), |one| one.simulate(common::STEPS));
}

/// Loops read nothing that was not written, and other compilers and levels give the same bits.
#[test]
fn loops_are_clean() {
    let all = exported().split_off(3);
    let driver = driver(&all, &|_| (-1, 0.0));
    let flags = ["-O0", "-g", "-fsanitize=undefined", "-fno-sanitize-recover=all"];
    let wanted = build_with("rolled_undefined", &all, &driver, &flags).run(&[]);
    let required = std::env::var_os("HALFARROW_C_TOOLS").is_some();
    let there = |tool: &str| Command::new(tool).arg("--version").output().is_ok_and(|out| out.status.success());
    if required || there("clang") {
        let with_clang = build_by("clang", "rolled_clang", &all, &driver, &["-O2"]);
        assert!(with_clang.run(&[]) == wanted, "clang gives other bits");
    }
    if required || there("valgrind") {
        let plain = build_with("rolled_plain", &all, &driver, &["-O1", "-g"]);
        let out = Command::new("valgrind").args(["--error-exitcode=9", "--quiet"]).arg(plain.path()).output();
        let out = out.expect("valgrind runs");
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        assert!(String::from_utf8_lossy(&out.stdout) == wanted, "valgrind gives other bits");
    }
}

/// Cells with laws at random, with neighbours at random distances.
#[test]
fn random_cells_do_what_the_interpreter_does() {
    let folder = common::folder("random_cells_models");
    let mut random = Random(1);
    let all: Vec<Exported> = (0..8)
        .map(|i| {
            let path = folder.join(format!("random{i}.bond"));
            std::fs::write(&path, random.model(i)).expect("a model");
            export(&path, [Method::Heun, Method::Rosenbrock][i % 2], 1e-2)
        })
        .collect();
    let rolled = all.iter().filter(|one| loops(one) > 0).count();
    assert!(rolled >= 6, "{rolled} of {} have loops", all.len());
    check("random_cells", &all, &driver(&all, &|_| (-1, 0.0)), |one| one.simulate(common::STEPS));
}

struct Random(u64);

impl Random {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }

    /// A law that grows with a variable.
    fn law(&mut self, of: &str) -> String {
        let terms = [
            of.to_string(),
            format!("0.3*{of}^3"),
            format!("0.1*sin({of})"),
            format!("0.2*{of}*cos({of})*cos({of})"),
            format!("tanh({of})/i"),
            format!("{of}/sqrt(1 + {of}^2)"),
            format!("(0.1 + 0.01*i)*{of}^5"),
            format!("g*{of}"),
        ];
        let chosen: Vec<&str> = (0..=self.below(3)).map(|_| &*terms[self.below(8) as usize]).collect();
        format!("{of} + {}", chosen.join(" + "))
    }

    fn model(&mut self, number: usize) -> String {
        let (n, far) = (40 + self.below(20), 1 + self.below(3));
        let mut text = format!("model Random{number}\nparam n = {n}, g = 0.7\nfor i in 1..n {{\n");
        let _ = writeln!(text, "    1:v[i] -> I:m[i](1 + 0.05*i, f0 = 0.1*sin(i))");
        let _ = writeln!(text, "    v[i] -> R:drag[i](e = {})", self.law("f"));
        let _ = writeln!(text, "    if i <= {far} {{\n        v[i] -> C:held[i](2)\n    }} else {{");
        let _ = writeln!(
            text,
            "        v[i] -> 0:joint[i] -> v[i - {far}]\n        joint[i] -> C:link[i](e = {})",
            self.law("q")
        );
        if self.below(2) == 0 {
            let _ = writeln!(text, "        joint[i] -> R:slip[i](f = {})", self.law("e"));
        }
        if self.below(2) == 0 {
            let _ = writeln!(text, "        v[i] -> Se:load[i](0.01*i)");
        }
        text + "    }\n}\n"
    }
}
