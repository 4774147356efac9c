//! Plots of a link's evidence: its lag function and its samples.

use super::{
    axis::Axis,
    point::Point,
    svg::{INK, NEGATIVE, POSITIVE, Svg, UNSIGNED, cut, display},
};
use crate::evidence::LinkEvidence;

const WIDTH: f64 = 300.0;
const HEIGHT: f64 = 210.0;
const LEFT: f64 = 50.0;
const BOTTOM: f64 = HEIGHT - 42.0;
const TOP: f64 = 26.0;
const RIGHT: f64 = WIDTH - 12.0;
/// Most letters of a name.
const LETTERS: usize = 16;

/// Strength against lag. Full dots are significant at `alpha`; the shaded band holds what is not, where the test has a
/// formula for it. A ring marks the lag of this link. Colours show the sign, if strengths have one.
pub fn lag_function(link: &LinkEvidence, alpha: f64, has_sign: bool) -> String {
    let mut svg = frame("strength at each lag", "lag in steps", "");
    let values = || link.lags.iter().map(|at| at.value);
    let band = link.band.unwrap_or(0.0);
    let y = Axis::around(values().chain([0.0, band, if band > 0.0 { -band } else { 0.0 }]), BOTTOM, TOP);
    let first = link.lags.first().map_or(0, |at| at.lag) as f64;
    let last = link.lags.last().map_or(1, |at| at.lag) as f64;
    let x = Axis { low: first - 0.6, high: last + 0.6, from: LEFT, to: RIGHT };
    if band > 0.0 {
        let (top, width, height) = (y.at(band), RIGHT - LEFT, y.at(-band) - y.at(band));
        svg.raw(&format!(
            "<rect class=\"band\" x=\"{LEFT}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"#9aa5b1\" \
             fill-opacity=\"0.25\"/>"
        ));
    }
    y.draw_left(&mut svg, LEFT, RIGHT, 5);
    let zero = y.at(0.0);
    let colours = if has_sign { [POSITIVE, NEGATIVE] } else { [UNSIGNED; 2] };
    let every = link.lags.len().div_ceil(12).max(1);
    for (place, at) in link.lags.iter().enumerate() {
        let (px, py) = (x.at(at.lag as f64), y.at(at.value));
        let colour = colours[usize::from(at.value < 0.0)];
        svg.raw(&format!(
            "<path d=\"M {px:.1} {zero:.1} V {py:.1}\" stroke=\"{colour}\" stroke-width=\"1.6\"/>"
        ));
        let fill = if at.p_value <= alpha { colour } else { "#ffffff" };
        svg.circle(Point::new(px, py), 3.6, fill, colour, 1.4);
        if at.lag == link.lag {
            svg.circle(Point::new(px, py), 7.0, "none", INK, 1.2);
        }
        if place % every == 0 {
            svg.text(Point::new(px, BOTTOM + 14.0), 10.0, "middle", INK, &at.lag.to_string());
        }
    }
    svg.raw(&format!("<path d=\"M {LEFT} {zero:.1} H {RIGHT}\" stroke=\"{INK}\" stroke-width=\"1\"/>"));
    svg.finish()
}

/// The samples of a link: cause at `t - lag` across, effect at `t` upwards.
pub fn scatter(link: &LinkEvidence) -> String {
    dots(link, &format!("{} of {} samples", link.scatter.len(), link.n_samples), &link.scatter)
}

/// What the conditions leave of cause and effect; `None` without conditions.
pub fn residual_scatter(link: &LinkEvidence) -> Option<String> {
    (!link.residuals.is_empty()).then(|| dots(link, "after the conditions (linear)", &link.residuals))
}

fn dots(link: &LinkEvidence, title: &str, points: &[[f32; 2]]) -> String {
    let at = |lag: usize| if lag == 0 { "(t)".to_owned() } else { format!("(t−{lag})") };
    let (cause, effect) = (cut(&display(&link.cause), LETTERS), cut(&display(&link.effect), LETTERS));
    let mut svg = frame(title, &format!("{cause}{}", at(link.lag)), &format!("{effect}(t)"));
    let x = Axis::around(points.iter().map(|p| f64::from(p[0])), LEFT, RIGHT);
    let y = Axis::around(points.iter().map(|p| f64::from(p[1])), BOTTOM, TOP);
    y.draw_left(&mut svg, LEFT, RIGHT, 5);
    x.draw_below(&mut svg, BOTTOM, 5);
    let known = points.iter().filter(|p| p[0].is_finite() && p[1].is_finite());
    let dot = |p: &[f32; 2]| format!("M{:.1} {:.1}h0", x.at(f64::from(p[0])), y.at(f64::from(p[1])));
    let d: String = known.map(dot).collect();
    svg.raw(&format!(
        "<path class=\"dots\" d=\"{d}\" stroke=\"{NEGATIVE}\" stroke-width=\"3.4\" stroke-linecap=\"round\" \
         stroke-opacity=\"0.55\" fill=\"none\"/>"
    ));
    svg.finish()
}

fn frame(title: &str, across: &str, upwards: &str) -> Svg {
    let mut svg = Svg::new(WIDTH, HEIGHT);
    svg.text(Point::new(LEFT, 14.0), 11.0, "start", INK, title);
    svg.text(Point::new((LEFT + RIGHT) / 2.0, HEIGHT - 8.0), 11.0, "middle", INK, across);
    if !upwards.is_empty() {
        svg.text(Point::new(RIGHT, 14.0), 11.0, "end", INK, &format!("↑ {upwards}"));
    }
    svg.raw(&format!(
        "<path d=\"M {LEFT} {TOP} V {BOTTOM} H {RIGHT}\" fill=\"none\" stroke=\"{INK}\" stroke-width=\"1\"/>"
    ));
    svg
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::AtLag;

    fn link() -> LinkEvidence {
        LinkEvidence {
            cause: "<b>".into(),
            effect: "y".into(),
            lag: 2,
            n_samples: 3,
            interval: None,
            conditions: vec![],
            note: String::new(),
            lags: (1..=3)
                .map(|lag| AtLag { lag, value: 0.3, p_value: if lag == 2 { 0.01 } else { 0.5 } })
                .collect(),
            band: Some(0.2),
            scatter: vec![[1.0, 2.0], [2.0, f32::NAN], [3.0, 4.0]],
            residuals: vec![],
        }
    }

    #[test]
    fn the_significant_lag_is_full_and_the_links_own_lag_has_a_ring() {
        let svg = lag_function(&link(), 0.05, true);
        assert_eq!(svg.matches("r=\"3.6\" fill=\"#ffffff\"").count(), 2);
        assert_eq!(svg.matches("r=\"7\"").count(), 1);
        assert_eq!(svg.matches("class=\"band\"").count(), 1);
        let unsigned = lag_function(&link(), 0.05, false);
        assert!(svg.contains(POSITIVE) && !unsigned.contains(POSITIVE), "no colour without a sign");
    }

    #[test]
    fn each_finite_sample_is_a_dot_and_a_name_stays_text() {
        let svg = scatter(&link());
        assert_eq!(svg.matches("h0").count(), 2);
        assert!(svg.contains("&lt;b&gt;(t−2)") && svg.contains(">3 of 3 samples<") && !svg.contains("NaN"));
        assert!(residual_scatter(&link()).is_none());
    }
}
