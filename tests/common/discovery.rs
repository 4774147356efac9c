//! A live discovery node on batches that are there already. A file of its own, as only two files of tests start the node.

use std::{
    fs,
    path::Path,
    thread,
    time::{Duration, Instant},
};

use roscausal_core::{Time, loopback::Loopback, middleware::Middleware, nodes, params::Value};

/// Runs the node, with PCMCI and ParCorr, from the second `now` on until it has read all batches of `dir/pp`; its models go to
/// `dir/models`.
pub(crate) fn discover(dir: &Path, now: f64, window_batches: i64) {
    let bus = Loopback::live(move || Time::from_secs_f64(now));
    let text = |name: &str| Value::Str(dir.join(name).display().to_string());
    for (name, value) in [
        ("data_dir", text("pp")),
        ("res_dir", text("models")),
        ("cd_method", Value::Str("pcmci".into())),
        ("cond_ind_test", Value::Str("parcorr".into())),
        ("window_batches", Value::Int(window_batches)),
        ("threads", Value::Int(1)),
    ] {
        bus.set_node_param("discovery", name, value);
    }
    let node = bus.node("discovery");
    let its_own = node.clone();
    let thread = thread::spawn(move || nodes::run("discovery", &its_own));
    let end = Instant::now() + Duration::from_secs(300);
    while waiting(&dir.join("pp")) {
        assert!(Instant::now() < end && !thread.is_finished(), "it does not come to an end");
        thread::sleep(Duration::from_millis(5));
    }
    node.shutdown();
    thread.join().expect("no panic").expect("ends well");
}

/// Whether a batch waits in a pool. Asks for names only: a node may take the batch meanwhile.
fn waiting(pool: &Path) -> bool {
    fs::read_dir(pool).into_iter().flatten().flatten().any(|entry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        name.ends_with(".csv") && !name.starts_with('.')
    })
}
