//! Bode and Nyquist plots.

use halfarrow_trace::{Chart, Curve, Guide, Panel, Scale, ScaleKind, chart};

use super::response::Margin;
use super::{LinearizeReport, Response};
use crate::draw::Picture;

/// Curves in a picture.
const MOST: usize = 10;
/// What is farther than so many dB from the median is not drawn in a Bode plot.
const REACH: f64 = 160.0;
/// What is farther from the origin than so many times the median is not drawn in a Nyquist plot.
const FAR: f64 = 30.0;

impl LinearizeReport {
    /// Magnitude in dB and phase over frequency in Hz, one curve for each input and output. Where one loop is drawn, or
    /// responses without unit, their margins are marked: how far the phase is from -180° where the magnitude is 1, and
    /// the magnitude below 1 where the phase is -180°.
    pub fn bode(&self) -> Picture {
        let responses = self.drawn();
        let unit = self.common_unit(&responses);
        let scale = |label: &str, unit: &str, kind| Scale { label: label.into(), unit: unit.into(), kind };
        let frequency = || scale("frequency", "Hz", ScaleKind::Logarithmic);
        let over = |values: Vec<f64>, r: &Response| r.hertz().into_iter().zip(values).map(|(f, v)| [f, v]).collect();
        let curve = |r: &Response, values: Vec<f64>| Curve {
            name: self.curve_name(r),
            points: over(values, r),
            ..Curve::default()
        };
        let magnitudes = responses.iter().map(|r| curve(r, shown(r))).collect();
        let phases = responses.iter().map(|r| curve(r, r.phases())).collect();
        let margins: Vec<Margin> = match responses.len() == 1 || unit.is_empty() {
            true => responses.iter().flat_map(worst).collect(),
            false => Vec::new(),
        };
        let guides = |of_gain: bool| {
            let own = margins.iter().filter(move |m| m.of_gain == of_gain);
            own.map(|m| Guide::Span { x: m.hertz, y: [m.limit, m.value], name: m.text() }).collect()
        };
        let panel = |y, curves, height, guides| Panel { x: frequency(), y, height, equal: false, curves, guides };
        let decibel = if unit.is_empty() { "dB".to_string() } else { format!("dB of {unit}") };
        let panels = vec![
            panel(scale("magnitude", &decibel, ScaleKind::Linear), magnitudes, 220.0, guides(true)),
            panel(scale("phase", "degrees", ScaleKind::Angle), phases, 170.0, guides(false)),
        ];
        Picture {
            svg: chart(&Chart { title: format!("{}: frequency response", self.model), note: self.place(), panels }),
        }
    }

    /// Imaginary over real part for all frequencies, those below zero dashed, one curve for each input and output.
    pub fn nyquist(&self) -> Picture {
        let responses = self.drawn();
        let unit = self.common_unit(&responses);
        let far = FAR * median(&responses);
        let mut curves = Vec::new();
        for response in &responses {
            let near = |v: &[f64; 2]| if libm::hypot(v[0], v[1]) <= far { *v } else { [f64::NAN; 2] };
            let upper: Vec<[f64; 2]> = response.values.iter().map(near).collect();
            let lower = upper.iter().map(|v| [v[0], -v[1]]).collect();
            let name = self.curve_name(response);
            curves.push(Curve { name: name.clone(), points: upper, ..Curve::default() });
            curves.push(Curve { name, points: lower, dashed: true, ..Curve::default() });
        }
        let scale = |label: &str| Scale { label: label.into(), unit: unit.clone(), kind: ScaleKind::Linear };
        let guides = if unit.is_empty() { vec![Guide::Point([-1.0, 0.0], "−1".into())] } else { Vec::new() };
        let panel =
            Panel { x: scale("real part"), y: scale("imaginary part"), height: 420.0, equal: true, curves, guides };
        let title = format!("{}: Nyquist plot", self.model);
        Picture { svg: chart(&Chart { title, note: self.place(), panels: vec![panel] }) }
    }

    fn drawn(&self) -> Vec<Response> {
        let all = self.responses();
        let alive = |r: &Response| r.values.iter().any(|v| *v != [0.0, 0.0]);
        all.into_iter().filter(alive).take(MOST).collect()
    }

    fn curve_name(&self, response: &Response) -> String {
        match self.inputs.len() {
            1 => response.output.clone(),
            _ => format!("{} / {}", response.output, response.input),
        }
    }

    fn place(&self) -> String {
        let at = match self.at {
            "time" => format!("at t = {} s", self.t),
            "start" => "at the start".to_string(),
            other => format!("at the {other}"),
        };
        match &self.inputs[..] {
            [only] => format!("response to {}, {at}", only.name),
            _ => at,
        }
    }

    /// The unit of all responses, if they have the same: output by input.
    fn common_unit(&self, responses: &[Response]) -> String {
        let of =
            |list: &[super::Terminal], name: &str| list.iter().find(|t| t.name == name).and_then(|t| t.unit.clone());
        let unit = |r: &Response| match (of(&self.outputs, &r.output), of(&self.inputs, &r.input)) {
            (out, into) if out == into => String::new(),
            (Some(out), Some(into)) => format!("({out})/({into})"),
            (Some(out), None) => out,
            (None, Some(into)) => format!("1/({into})"),
            (None, None) => String::new(),
        };
        let mut units = responses.iter().map(unit);
        let first = units.next().unwrap_or_default();
        if units.all(|unit| unit == first) { first } else { "SI units".into() }
    }
}

/// The least margin of each kind of a response: what decides.
fn worst(response: &Response) -> Vec<Margin> {
    let all = response.margins();
    let least = |of_gain: bool| {
        let own = all.iter().filter(|m| m.of_gain == of_gain);
        own.min_by(|a, b| a.size().abs().total_cmp(&b.size().abs())).copied()
    };
    [least(true), least(false)].into_iter().flatten().collect()
}

/// Magnitudes in dB as far as a picture can show them: a pole on the imaginary axis leaves a gap.
fn shown(response: &Response) -> Vec<f64> {
    let all = response.decibels();
    let mut finite: Vec<f64> = all.iter().copied().filter(|x| x.is_finite()).collect();
    finite.sort_by(f64::total_cmp);
    let middle = finite.get(finite.len() / 2).copied().unwrap_or(0.0);
    all.into_iter().map(|x| if (x - middle).abs() <= REACH { x } else { f64::NAN }).collect()
}

/// The median of all magnitudes; 1 where there are none.
fn median(responses: &[Response]) -> f64 {
    let mut sizes: Vec<f64> = responses.iter().flat_map(Response::magnitudes).filter(|s| s.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().filter(|s| *s > 0.0).unwrap_or(1.0)
}
