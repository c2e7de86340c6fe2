//! Names: where each is declared, and every place of the text that uses it.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use halfarrow::{Disk, Model, Name, NameKind, Override, Place, Source};

const MAIN: &str = "\
model Yard
import \"parts.bond\"
param m = 3
param c = 2
input pull = 0
let twice(x) = c*x
Se:weight(9.81*m + twice(pull)) -> 1:hook
Pair:left(m = 2*m)
hook -> left.p as rope
constraint equal: rope.f = left.two.axis.f
output speed = left.one.axis.f + table(\"curve.csv\", left.one.m)
prefer hook
";

const PARTS: &str = "\
const half = 0.5
component Load(port p; param m = 1) {
  p -> 1:axis -> I:body(m)
  axis -> R:drag(half*m + body.f)
}
component Pair(port p; param m) {
  p -> 1:split
  Load:one(m = half*m)
  Load:two
  split -> one.p
  split -> two.p
}
";

fn yard() -> Model {
    let files = [("parts.bond", PARTS), ("curve.csv", "0,1\n9,2\n")];
    let files: BTreeMap<String, String> = files.into_iter().map(|(k, v)| (k.into(), v.into())).collect();
    Model::new(Source::text("yard.bond", MAIN).with_files(files), &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn at(place: &Place) -> String {
    let file = if place.file == "yard.bond" { "" } else { place.file.trim_end_matches(".bond") };
    format!("{file}@{}:{}", place.line, place.column)
}

fn written(names: &[Name]) -> String {
    let mut text = String::new();
    for name in names {
        let uses: Vec<String> = name.uses.iter().map(at).collect();
        let line = format!("{} {} {} | {}", name.kind.word(), name.name, at(&name.declared), uses.join(" "));
        writeln!(text, "{}", line.trim_end()).expect("text");
    }
    text
}

/// Imports, instances in instances, and a parameter `m` in each of them besides that of the model.
#[test]
fn every_use_of_a_name_has_its_place() {
    let expected = "\
model Yard @1:7 |
file parts.bond parts@1:1 | @2:8
table curve.csv curve.csv@1:1 | @11:40
component Load parts@2:11 | parts@8:3 parts@9:3
component Pair parts@6:11 | @8:1
parameter m @3:7 | @7:16 @8:17
parameter c @4:7 | @6:16
parameter left.one.m parts@2:30 | @11:62 parts@3:25 parts@4:23 parts@8:12
parameter left.two.m parts@2:30 | parts@3:25 parts@4:23
parameter left.m parts@6:30 | @8:11 parts@8:21
constant half parts@1:7 | parts@4:18 parts@8:16
input pull @5:7 | @7:26
output speed @11:8 |
function twice @6:5 | @7:20
element weight @7:4 |
element left.one.body parts@3:20 | parts@4:27
element left.two.body parts@3:20 | parts@4:27
element left.one.drag parts@4:13 |
element left.two.drag parts@4:13 |
junction hook @7:38 | @9:1 @12:8
junction left.one.axis parts@3:10 | @11:25 parts@4:3
junction left.two.axis parts@3:10 | @10:37 parts@4:3
junction left.split parts@7:10 | parts@10:3 parts@11:3
instance left @8:6 | @9:9 @10:28 @11:16 @11:53
instance left.one parts@8:8 | @11:21 @11:58 parts@10:12
instance left.two parts@9:8 | @10:33 parts@11:12
port left.one.p parts@2:21 | parts@3:3 parts@10:16
port left.two.p parts@2:21 | parts@3:3 parts@11:16
port left.p parts@6:21 | @9:14 parts@7:3
bond rope @9:19 | @10:19
constraint equal @10:12 |
";
    let names = yard().names();
    let (told, implied): (Vec<Name>, Vec<Name>) = names.into_iter().partition(|n| !n.name.starts_with("equal."));
    assert_eq!(written(&told), expected);
    assert!(implied.iter().all(|n| n.uses.is_empty() && n.declared.line == 10), "{implied:?}");
}

/// Names of two kinds may be alike; each has its own uses and readers.
#[test]
fn a_parameter_and_an_element_of_one_name_are_two() {
    let text = "model Two\nparam k = 2\nSe:push(1) -> 1:w -> I:m(1)\nw -> C:k(k = k)\noutput e = k.e\n";
    let names = Model::from_text("two.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false))).names();
    let of = |kind: NameKind| names.iter().find(|n| (n.name.as_str(), n.kind) == ("k", kind)).expect("a name");
    let places = |name: &Name| -> Vec<(usize, usize)> { name.uses.iter().map(|p| (p.line, p.column)).collect() };
    assert_eq!(
        (places(of(NameKind::Parameter)), of(NameKind::Parameter).read_by.as_slice()),
        (vec![(4, 14)], &["k".into()][..])
    );
    assert_eq!(
        (places(of(NameKind::Element)), of(NameKind::Element).read_by.contains(&"e".into())),
        (vec![(5, 12)], true)
    );
}

/// A value that replaces one of the model is a text of its own, which uses names too.
#[test]
fn the_text_of_a_new_value_uses_names() {
    let set = [Override { name: "m".into(), value: "4*c".into() }];
    let names = yard().with(&set).unwrap_or_else(|e| panic!("{}", e.render(false))).names();
    let c = names.iter().find(|n| n.name == "c").expect("a name");
    assert!(c.uses.iter().any(|place| place.file == "--set m"), "{c:?}");
}

/// The places of a name hold its last part and nothing else, in all models.
#[test]
fn what_stands_at_a_place_is_the_name() {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let mut uses = 0;
    for folder in std::fs::read_dir(&models).expect("models").map(|entry| entry.expect("a folder").path()) {
        let path = folder.join("model.bond");
        if !path.is_file() {
            continue;
        }
        let disk = Disk::below(&models).expect("models");
        let text = std::fs::read_to_string(&path).expect("a model");
        let model = Model::new(Source::text(path.to_string_lossy(), text).with_files(disk), &[]).expect("a model");
        let source = model.source();
        for name in model.names() {
            let own = name.name.rsplit('.').next().unwrap_or_default();
            let inside = name.uses.iter().filter(|p| p.file == source.name() && name.kind != NameKind::File);
            for place in inside.filter(|_| name.kind != NameKind::Table) {
                assert_eq!(&source.content()[place.start..place.end], own, "{} of {}", name.name, path.display());
                uses += 1;
            }
        }
    }
    assert!(uses > 1000, "{uses}");
}
