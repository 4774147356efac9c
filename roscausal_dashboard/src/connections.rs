//! Connections of browsers: at most so many at a time, each with a time-out for what it asks. A browser is always let in: where
//! all places are taken, the connection that is open longest is closed for it, event streams excepted.

use std::{
    collections::VecDeque,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use axum::{Router, extract::Request};
use hyper::{
    body::Incoming,
    server::conn::http1,
    service::{Service, service_fn},
};
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    service::TowerToHyperService,
};
use rustix::process::{Resource, getrlimit};
use tokio::{net::TcpListener, task::AbortHandle, time::sleep};

use crate::patience::Patient;

/// Most connections at a time.
const MOST: usize = 256;
/// Most browsers that watch at a time.
const BROWSERS: usize = 32;
/// Most bytes of a request: its first line and its headers.
const LONGEST: usize = 16 << 10;
/// Pause after a failed accept (too many open files).
const PAUSE: Duration = Duration::from_millis(200);

/// What the server allows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Connections at a time.
    pub(crate) connections: usize,
    /// Event streams at a time; fewer than connections.
    pub(crate) streams: usize,
    /// How long a request may take to arrive, and how long a connection may rest between two.
    pub(crate) headers: Duration,
}

impl Limits {
    /// The limits for this process: at most a quarter of the files that it may have open, the rest is for recordings.
    pub(crate) fn of_this_process() -> Self {
        let files = getrlimit(Resource::Nofile).current;
        Self::for_files(files.map_or(usize::MAX, |files| usize::try_from(files).unwrap_or(usize::MAX)))
    }

    fn for_files(files: usize) -> Self {
        let connections = (files / 4).clamp(4, MOST);
        Self { connections, streams: BROWSERS.min(connections / 2), headers: Duration::from_secs(10) }
    }
}

/// The mark of a connection that carries an event stream: it is not closed for another one.
#[derive(Clone, Default)]
pub(crate) struct Streams(Arc<AtomicBool>);

impl Streams {
    /// From now on, it carries one.
    pub(crate) fn mark(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Serves until it is dropped.
pub(crate) async fn serve(listener: TcpListener, app: Router, limits: Limits) {
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(limits.headers).max_header_size(LONGEST);
    let app = TowerToHyperService::new(app);
    // In the order of their beginnings.
    let mut open: VecDeque<(AbortHandle, Streams)> = VecDeque::new();
    loop {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(error) => {
                tracing::debug!("a browser could not be served: {error}");
                sleep(PAUSE).await;
                continue;
            }
        };
        open.retain(|(task, _)| !task.is_finished());
        if open.len() >= limits.connections {
            let oldest = open.iter().position(|(_, streams)| !streams.0.load(Ordering::Relaxed));
            if let Some((task, _)) = open.remove(oldest.unwrap_or_default()) {
                task.abort();
            }
        }
        let (streams, app) = (Streams::default(), app.clone());
        let mark = streams.clone();
        let asked = service_fn(move |mut request: Request<Incoming>| {
            request.extensions_mut().insert(mark.clone());
            app.call(request)
        });
        let connection = http.serve_connection(TokioIo::new(Patient::new(stream)), asked);
        let task = tokio::spawn(async move {
            if let Err(error) = connection.await {
                tracing::debug!("a browser was dropped: {error}");
            }
        });
        open.push_back((task.abort_handle(), streams));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn most_files_are_left_for_recordings() {
        for files in [16, 64, 256, 1024, 1 << 20, usize::MAX] {
            let limits = Limits::for_files(files);
            assert!(limits.connections <= MOST && limits.connections * 4 <= files, "{files}: {limits:?}");
            // So there is always one that may be closed for a new one.
            assert!(limits.streams >= 1 && limits.streams < limits.connections, "{files}: {limits:?}");
        }
        assert_eq!(Limits::for_files(1024).connections, 256);
        assert_eq!(Limits::for_files(1024).streams, 32);
    }
}
