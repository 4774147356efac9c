//! Progress bars on a terminal; nothing elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use roscausal_discovery::Progress;

use crate::terminal;

/// A bar of `total` steps (0: not known yet) named `what`, on stderr; hidden when `quiet` or not on a terminal.
pub(crate) fn bar(what: &str, total: u64, quiet: bool) -> ProgressBar {
    // A bar of length 0 would be full.
    let bar = if total == 0 { ProgressBar::no_length() } else { ProgressBar::new(total) };
    if quiet || terminal::is_quiet() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let count = if total == 0 { "{percent:>3} %" } else { "{pos}/{len}" };
    let template = format!("{{prefix:12}} {{wide_bar}} {count}  {{elapsed}} eta {{eta}}");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar.set_prefix(what.to_owned());
    bar
}

/// Parts of a bar of an analysis.
const PARTS: u64 = 1000;

/// Shows how far an analysis is, as a part of the whole. The estimate of all tests grows on the way; the bar neither grows nor goes back,
/// and it is at its end only when the analysis is.
pub(crate) fn show(bar: &ProgressBar, progress: Progress) {
    let total = progress.estimated_total.max(progress.done + 1) as f64;
    let part = (PARTS as f64 * progress.done as f64 / total) as u64;
    bar.set_length(PARTS);
    bar.set_position(part.min(PARTS - 1).max(bar.position()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_bar_is_full_before_the_end_grows_or_goes_back() {
        let bar = bar("discovery", 0, true);
        assert_eq!(bar.length(), None);
        let mut before = 0;
        for (done, estimated_total) in [(0, 0), (3, 9), (4, 90), (9, 9), (10, 10)] {
            show(&bar, Progress { done, estimated_total });
            assert!(bar.length() == Some(PARTS) && bar.position() < PARTS, "{done}");
            assert!(bar.position() >= before, "{done}");
            before = bar.position();
        }
    }
}
