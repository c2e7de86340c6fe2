//! `run` as its users see it: ticks of the wall clock, inputs and outputs by UDP and stdin.

use std::io::Write;
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;

const MODEL: &str = "model Follower\ninput force : kN = 0\nSe:pull(force) -> 1:a -> I:m(10 kg)\na -> R:drag(1000 N.s/m)\noutput speed = m.f : km/h\n";

fn folder(test: &str) -> std::path::PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    std::fs::create_dir_all(&path).expect("a folder");
    std::fs::write(path.join("follower.bond"), MODEL).expect("a file");
    path
}

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_halfarrow"));
    command.current_dir(folder).arg("run").arg("follower.bond").args(arguments);
    command
}

fn json(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{text}");
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

#[test]
fn ticks_are_counted_and_timed() {
    let here = folder("ticks");
    let report = json(&command(&here, &["--rate", "1kHz", "--for", "0.2", "--json"]).output().unwrap());
    assert_eq!((report["ticks"].as_u64(), report["reached"].as_f64()), (Some(200), Some(0.2)));
    for name in ["step", "jitter"] {
        let sum: u64 = report[name]["histogram"].as_array().unwrap().iter().map(|b| b[1].as_u64().unwrap()).sum();
        assert_eq!(sum, 200, "{name}");
        let [median, most] = ["median", "max"].map(|key| report[name][key].as_f64().unwrap());
        assert!(median > 0.0 && median <= most, "{name}: {median} {most}");
    }
}

#[test]
fn values_go_out_and_come_in_by_udp() {
    let here = folder("udp");
    let ours = UdpSocket::bind("127.0.0.1:0").unwrap();
    ours.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    // A port that was free a moment ago.
    let free = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let (input, output) = (format!("udp://{free}"), format!("udp://{}", ours.local_addr().unwrap()));
    let arguments = ["--rate", "500 Hz", "--for", "1", "--input", &input, "--output", &output, "--record", "speed"];
    let child = command(&here, &arguments).arg("--json").stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut buffer = [0; 200];
    let mut receive = || {
        let size = ours.recv(&mut buffer).expect("a datagram");
        let text = String::from_utf8_lossy(&buffer[..size]).into_owned();
        let fields: Vec<f64> = text.trim().split(',').map(|f| f.parse().expect("a number")).collect();
        (fields[0], fields[1])
    };
    assert_eq!(receive().1, 0.0, "at rest until a force comes");
    ours.send_to(b"clutch=1", free).unwrap();
    ours.send_to(b"force=2", free).unwrap();
    let mut last = receive();
    while last.0 < 0.999 {
        last = receive();
    }
    // 2 kN against 1000 N.s/m: 2 m/s, 7.2 km/h, with a time constant of 10 ms.
    assert!((last.1 - 7.2).abs() < 1e-6, "{last:?}");
    let report = json(&child.wait_with_output().unwrap());
    assert_eq!((report["received"].as_u64(), report["rejected"].as_u64()), (Some(1), Some(1)), "{report}");
    assert_eq!((report["sent"].as_u64(), report["outputs"][0].as_str()), (Some(500), Some("speed")));
}

#[test]
fn lines_of_stdin_are_inputs() {
    let here = folder("stdin");
    let arguments = ["--rate", "200", "--for", "0.5", "--input", "stdin", "--json"];
    let mut child = command(&here, &arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"1\n?\n2.5\n").unwrap();
    let report = json(&child.wait_with_output().unwrap());
    assert_eq!((report["received"].as_u64(), report["rejected"].as_u64()), (Some(2), Some(1)), "{report}");
}

#[test]
fn what_makes_no_sense_is_refused() {
    let here = folder("refused");
    for (arguments, says) in [
        (&["--rate", "fast"][..], "is no frequency"),
        (&["--rate", "1kHz", "--solver", "bdf"], "needs a method with fixed step"),
        (&["--rate", "1kHz", "--input", "udp://nowhere"], "is no address"),
        (&["--rate", "1kHz", "--input", "gas=x.csv"], "gas"),
        (&["--rate", "0"], "above 0"),
    ] {
        let output = command(&here, arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(text.contains(says), "{arguments:?}: {text}");
    }
}
