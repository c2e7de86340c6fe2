//! Machine code gives its pages back: the only test of its process, as others would make code meanwhile.

mod common;

use halfarrow_exec::Model;

fn compiled(model: &Model) -> Model {
    let mut machine = model.clone();
    machine.compile_machine().expect("machine code");
    machine
}

/// Bytes that are executable and belong to no file.
fn executable() -> usize {
    let maps = std::fs::read_to_string("/proc/self/maps").expect("the maps of this process");
    let lines = maps.lines().filter(|line| line.contains("r-xp") && line.split_whitespace().count() == 5);
    let size = |line: &str| {
        let (from, to) = line.split_whitespace().next()?.split_once('-')?;
        Some(usize::from_str_radix(to, 16).ok()? - usize::from_str_radix(from, 16).ok()?)
    };
    lines.map(|line| size(line).expect("a range of addresses")).sum()
}

#[test]
fn memory_of_code_is_given_back() {
    if !cfg!(target_os = "linux") {
        return; // There is no /proc to look into.
    }
    let (_, program) = common::models().swap_remove(0);
    let model = Model::new(program).expect("parameters that fit");
    let kept = compiled(&model);
    let before = executable();
    let several: Vec<Model> = (0..5).map(|_| compiled(&model)).collect();
    let copies: Vec<Model> = several.iter().flat_map(|m| [m.clone(), m.clone()]).collect();
    assert!(executable() > before, "code stands in pages of its own");
    drop(several);
    assert!(executable() > before, "copies share the code");
    drop(copies);
    let after = executable();
    assert_eq!(after, before, "executable bytes");
    drop(kept);
}
