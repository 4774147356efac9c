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
    if let Ok(style) = ProgressStyle::with_template("{prefix:12} {wide_bar} {pos}/{len}  {elapsed} eta {eta}")
    {
        bar.set_style(style);
    }
    bar.set_prefix(what.to_owned());
    bar
}

/// Shows how far an analysis is. It is at its end only when it is: the estimate of all tests grows on the way.
pub(crate) fn show(bar: &ProgressBar, progress: Progress) {
    bar.set_length(progress.estimated_total.max(progress.done + 1) as u64);
    bar.set_position(progress.done as u64);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_bar_is_full_before_the_first_test_or_before_the_end() {
        let bar = bar("discovery", 0, true);
        assert_eq!(bar.length(), None);
        for (done, estimated_total) in [(0, 0), (1, 1), (3, 9), (9, 9)] {
            show(&bar, Progress { done, estimated_total });
            assert!(bar.length() > Some(bar.position()), "{done}");
        }
    }
}
