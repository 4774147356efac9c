//! Progress bars on a terminal; nothing elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar of `total` steps named `what`, on stderr; hidden when `quiet` or not on a terminal.
pub(crate) fn bar(what: &str, total: u64, quiet: bool) -> ProgressBar {
    let bar = ProgressBar::new(total);
    if quiet {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    if let Ok(style) = ProgressStyle::with_template("{prefix:12} {wide_bar} {pos}/{len}  {elapsed} eta {eta}")
    {
        bar.set_style(style);
    }
    bar.set_prefix(what.to_owned());
    bar
}
