//! The web server: the page's files and the stream of events.

use std::{
    convert::Infallible,
    io,
    net::{IpAddr, SocketAddr, TcpListener},
    sync::Arc,
    thread::{self, JoinHandle},
    time::Duration,
};

use axum::{
    Router,
    extract::{Extension, State},
    http::{HeaderMap, StatusCode, Uri, header},
    middleware,
    response::{
        IntoResponse, Response,
        sse::{Event, KeepAlive, Sse},
    },
    routing::get,
};
use futures_util::stream;
use roscausal_core::{Error, Result};
use roscausal_discovery::draw;
use serde_json::{Value as Json, json};
use tokio::sync::{Semaphore, oneshot};

use crate::{
    asked::{Asked, Parsed, Question},
    connections::{self, Limits, Streams},
    guard::{self, Guard},
    hub::{Frame, Hub, Keep},
};

/// Time between two keep-alive messages on a quiet stream.
const ALIVE: Duration = Duration::from_secs(5);
/// Most variables and links, and the largest lag, of a model that is drawn.
const MOST_DRAWN: (usize, usize, usize) = (150, 2_000, 1_000);
/// Models that are drawn at a time.
const DRAWING: usize = 2;
/// The page may load only from this server.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The type of a script.
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// The page's files: path, type, content.
const ASSETS: [(&str, &str, &str); 15] = [
    ("/", "text/html; charset=utf-8", include_str!("../assets/index.html")),
    ("/style.css", "text/css; charset=utf-8", include_str!("../assets/style.css")),
    ("/draw.js", SCRIPT, include_str!("../assets/draw.js")),
    ("/page.js", SCRIPT, include_str!("../assets/page.js")),
    ("/models.js", SCRIPT, include_str!("../assets/models.js")),
    ("/nodes.js", SCRIPT, include_str!("../assets/nodes.js")),
    ("/scene.js", SCRIPT, include_str!("../assets/scene.js")),
    ("/view.js", SCRIPT, include_str!("../assets/view.js")),
    ("/moments.js", SCRIPT, include_str!("../assets/moments.js")),
    ("/timeline.js", SCRIPT, include_str!("../assets/timeline.js")),
    ("/charts.js", SCRIPT, include_str!("../assets/charts.js")),
    ("/evidence.js", SCRIPT, include_str!("../assets/evidence.js")),
    ("/ahead.js", SCRIPT, include_str!("../assets/ahead.js")),
    ("/graph.js", SCRIPT, include_str!("../assets/graph.js")),
    ("/icon.svg", "image/svg+xml", include_str!("../assets/icon.svg")),
];

/// A running web server. It ends when dropped.
pub struct Server {
    url: String,
    pub(crate) hub: Hub,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Serves the page on `address`; port 0 is any free port. For `token` see [`crate::parameters`].
    ///
    /// # Errors
    /// A port that is in use, an address that is not this machine's, or a token with characters that addresses do
    /// not allow.
    pub fn start(address: IpAddr, port: u16, token: &str) -> Result<Self> {
        Self::start_within(Limits::of_this_process(), address, port, token)
    }

    fn start_within(limits: Limits, address: IpAddr, port: u16, token: &str) -> Result<Self> {
        let guard = Guard::new(address, token)?;
        let listener = TcpListener::bind((address, port)).map_err(|error| refused(address, port, &error))?;
        let fault = |error: io::Error| Error::Middleware(format!("the page cannot be served: {error}"));
        let local = listener.local_addr().map_err(fault)?;
        listener.set_nonblocking(true).map_err(fault)?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(DRAWING)
            .build()
            .map_err(fault)?;
        let hub = Hub::new();
        let app = app(hub.clone(), guard.clone(), limits.streams);
        let (end, ended) = oneshot::channel();
        let serve = move || {
            runtime.block_on(async move {
                let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
                // Open streams never end by themselves; they end with the runtime.
                tokio::select! {
                    () = connections::serve(listener, app, limits) => (),
                    _ = ended => (),
                }
            });
        };
        let thread = thread::Builder::new().name("dashboard".into()).spawn(serve).map_err(fault)?;
        let url = format!("http://{}/{}", shown(local), guard.suffix());
        Ok(Self { url, hub, end: Some(end), thread: Some(thread) })
    }

    /// The address of the page, including the token if it needs one.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Tells the page when the run has ended; it lives on when the server is moved away.
    pub fn teller(&self) -> Teller {
        Teller(self.hub.clone())
    }
}

/// Tells the page what no message says.
pub struct Teller(Hub);

impl Teller {
    /// The run has ended: what is shown stays, and nothing more comes. `text` says so, in a few words.
    pub fn ended(&self, text: &str) {
        self.0.send(Frame { kind: "ended", data: Json::from(text).to_string().into() }, Keep::Last);
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(end) = self.end.take() {
            let _ = end.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// An address that a browser can open.
fn shown(local: SocketAddr) -> String {
    let port = local.port();
    match local.ip() {
        ip if !ip.is_unspecified() => local.to_string(),
        IpAddr::V4(_) => format!("127.0.0.1:{port}"),
        IpAddr::V6(_) => format!("[::1]:{port}"),
    }
}

fn refused(address: IpAddr, port: u16, error: &io::Error) -> Error {
    let (name, reason) = match error.kind() {
        io::ErrorKind::AddrInUse => {
            let way = "choose another, or 0 for any free one";
            ("port", format!("{port} on {address} is in use by another program; {way}"))
        }
        io::ErrorKind::AddrNotAvailable => {
            ("address", format!("{address} is none of this machine's; use 127.0.0.1, or 0.0.0.0 for all"))
        }
        io::ErrorKind::PermissionDenied => {
            ("port", format!("{port} is not allowed to you; choose one from 1024 on"))
        }
        _ => ("address", format!("{address}, port {port}: {error}")),
    };
    Error::param(name, reason)
}

fn app(hub: Hub, guard: Guard, streams: usize) -> Router {
    let places = Arc::new(Semaphore::new(streams));
    let asked = Router::new()
        .route("/scene", get(scene))
        .route("/series", get(series))
        .route("/model", get(model))
        .route("/whatif", get(what_if))
        .route("/explain", get(explain))
        .with_state(hub.clone());
    let mut router = Router::new().route("/events", get(events)).with_state((hub, places)).merge(asked);
    for (path, kind, content) in ASSETS {
        let headers = [
            (header::CONTENT_TYPE, kind),
            (header::CACHE_CONTROL, "no-cache"),
            (header::CONTENT_SECURITY_POLICY, POLICY),
            (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
            (header::REFERRER_POLICY, "no-referrer"),
        ];
        router = router.route(path, get(move || async move { (headers, content) }));
    }
    router.layer(middleware::from_fn_with_state(guard, guard::check))
}

/// The event stream of one browser. A browser that is too far behind is dropped; it reconnects by itself.
async fn events(
    State((hub, places)): State<(Hub, Arc<Semaphore>)>,
    Extension(streams): Extension<Streams>,
) -> Response {
    let Ok(place) = places.try_acquire_owned() else {
        let full = "Enough browsers watch already; close one of them.\n";
        return (StatusCode::SERVICE_UNAVAILABLE, full).into_response();
    };
    streams.mark();
    let (first, receiver) = hub.join();
    let first = std::collections::VecDeque::<Frame>::from(first);
    let stream = stream::unfold((first, receiver, place), |(mut first, mut receiver, place)| async move {
        let frame = if let Some(frame) = first.pop_front() { frame } else { receiver.recv().await.ok()? };
        let event = Event::default().event(frame.kind).data(&*frame.data);
        Some((Ok::<_, Infallible>(event), (first, receiver, place)))
    });
    Sse::new(stream).keep_alive(KeepAlive::new().interval(ALIVE)).into_response()
}

/// A number in the question part of an address: `/scene?t=12.5`.
fn asked<T: std::str::FromStr>(uri: &Uri, name: &str) -> Option<T> {
    let mut pairs = uri.query().unwrap_or_default().split('&').filter_map(|pair| pair.split_once('='));
    pairs.find(|(key, _)| *key == name).and_then(|(_, value)| value.parse().ok())
}

/// The scene at `t`, for `person`.
async fn scene(State(hub): State<Hub>, uri: Uri) -> Response {
    let Some(t) = asked(&uri, "t").filter(|t: &f64| t.is_finite()) else {
        return (StatusCode::BAD_REQUEST, "Say which moment: /scene?t=SECONDS.\n").into_response();
    };
    as_json(&hub.history().scene(t, asked(&uri, "person")))
}

/// The variables over the whole run, for `person`.
async fn series(State(hub): State<Hub>, uri: Uri) -> Response {
    as_json(&hub.history().series(asked(&uri, "person")))
}

/// The pictures of the model `number`; null if it is not kept or too large.
async fn model(State(hub): State<Hub>, headers: HeaderMap, uri: Uri) -> Response {
    if let Some(refused) = elsewhere(&headers) {
        return refused;
    }
    let draw = move || {
        let model = hub.model(asked(&uri, "number")?)?;
        let (variables, links, lag) = MOST_DRAWN;
        let fits = model.features.len() <= variables && model.links.len() <= links && model.tau_max <= lag;
        fits.then(|| draw::dag_and_matrix(&model))
    };
    // A large one takes its time, and the stream of events goes on meanwhile.
    let drawn = tokio::task::spawn_blocking(draw).await.ok().flatten();
    as_json(&drawn.map_or(Json::Null, |(graph, matrix)| json!({"graph": graph, "matrix": matrix})))
}

/// What if: see [`Question::what_if`] for `/whatif?q=`.
async fn what_if(State(hub): State<Hub>, headers: HeaderMap, uri: Uri) -> Response {
    ask(&hub, &headers, &uri, Question::what_if).await
}

/// Why: see [`Question::explain`] for `/explain?q=`.
async fn explain(State(hub): State<Hub>, headers: HeaderMap, uri: Uri) -> Response {
    ask(&hub, &headers, &uri, Question::explain).await
}

/// The refusal of a page elsewhere, which may not make this machine compute.
fn elsewhere(headers: &HeaderMap) -> Option<Response> {
    let site = headers.get("sec-fetch-site").map_or("same-origin", |site| site.to_str().unwrap_or_default());
    let refused = (StatusCode::FORBIDDEN, "Questions are for the page itself.\n");
    (!matches!(site, "same-origin" | "none")).then(|| refused.into_response())
}

/// Passes a question on to the reasoning node and waits for its answer.
async fn ask(hub: &Hub, headers: &HeaderMap, uri: &Uri, parse: fn(&str) -> Parsed<Question>) -> Response {
    if let Some(refused) = elsewhere(headers) {
        return refused;
    }
    let text = asked::<String>(uri, "q").and_then(|text| decoded(&text)).unwrap_or_default();
    let question = match parse(&text) {
        Ok(question) => question,
        Err(reason) => return (StatusCode::BAD_REQUEST, reason).into_response(),
    };
    let (reply, answer) = oneshot::channel();
    let busy = (StatusCode::SERVICE_UNAVAILABLE, "Other questions are open; ask again.\n");
    if !hub.ask(Asked { question, reply }) {
        return busy.into_response();
    }
    answer.await.map_or_else(|_| busy.into_response(), |answer| as_json(&answer))
}

/// The text behind `%20` and its kin; `None` if it is none.
fn decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        let digit = |byte: Option<u8>| char::from(byte?).to_digit(16);
        bytes.push(match byte {
            b'%' => u8::try_from(16 * digit(rest.next())? + digit(rest.next())?).ok()?,
            other => other,
        });
    }
    String::from_utf8(bytes).ok()
}

fn as_json(value: &Json) -> Response {
    let headers = [
        (header::CONTENT_TYPE, "application/json"),
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    ];
    (headers, value.to_string()).into_response()
}

#[cfg(test)]
mod tests {
    use std::{
        io::{Read, Write},
        net::{Ipv4Addr, TcpStream},
        time::Instant,
    };

    use roscausal_core::nodes::model_messages::model_of;
    use roscausal_msgs::{CausalLink, CausalModelInfo};

    use super::*;

    const HERE: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

    fn port(server: &Server) -> u16 {
        let after = server.url().trim_start_matches("http://127.0.0.1:");
        after.split('/').next().unwrap().parse().unwrap()
    }

    fn ask(server: &Server, path: &str) -> TcpStream {
        let mut stream = TcpStream::connect((HERE, port(server))).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
        stream
    }

    fn answer(server: &Server, path: &str) -> String {
        let mut text = String::new();
        ask(server, path).read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn every_file_that_the_page_names_is_there() {
        let server = Server::start(HERE, 0, "").unwrap();
        for (path, kind, content) in ASSETS {
            let text = answer(&server, path);
            assert!(
                text.starts_with("HTTP/1.1 200") && text.contains(kind) && text.ends_with(content),
                "{path}"
            );
            assert!(text.contains("content-security-policy"), "{path}");
        }
        assert!(answer(&server, "/passwd").starts_with("HTTP/1.1 404"));
        assert!(answer(&server, "/scene").starts_with("HTTP/1.1 400"));
        assert!(answer(&server, "/scene?t=1").ends_with("null"));
        assert!(answer(&server, "/series?person=x").contains("\"rows\":[]"));
        assert!(
            ["/model", "/model?number=x", "/model?number=1"]
                .map(|path| answer(&server, path))
                .iter()
                .all(|text| text.ends_with("null"))
        );
        // Nobody answers questions yet.
        assert!(answer(&server, "/whatif?q=%7B%22actions%22:[]%7D").starts_with("HTTP/1.1 503"));
        for bad in ["/whatif", "/whatif?q=%7", "/whatif?q=%ff", "/explain?q=%7B%7D"] {
            assert!(answer(&server, bad).starts_with("HTTP/1.1 400"), "{bad}");
        }
        let named = |file: &str| ASSETS.iter().any(|(path, ..)| path.trim_start_matches('/') == file);
        for (_, _, content) in ASSETS {
            let names = content.split('"').filter(|text| text.ends_with(".js") || text.ends_with(".css"));
            assert!(names.map(|name| name.trim_start_matches("./")).all(named));
        }
    }

    #[test]
    fn a_model_is_drawn_and_its_names_stay_text() {
        let server = Server::start(HERE, 0, "").unwrap();
        let link = |cause: &str, effect: &str, mark: &str| CausalLink {
            cause: cause.into(),
            effect: effect.into(),
            lag: 1,
            value: 0.5,
            p_value: 0.01,
            mark: mark.into(),
            tested: true,
            ..CausalLink::default()
        };
        let model =
            |links: Vec<CausalLink>| model_of(&CausalModelInfo { links, ..CausalModelInfo::default() });
        let hub = &server.hub;
        hub.keep_model(1, model(vec![link("<b>", "a", "-->"), link("a", "<b>", "-->")]));
        hub.keep_model(2, model(vec![link("a", "<b>", "o->"), link("a", "a", "-->")]));
        let chain = (0..20).map(|k| link(&format!("v{k}"), &format!("v{}", k + 1), "-->"));
        hub.keep_model(3, model(chain.collect()));
        hub.keep_model(4, model(vec![CausalLink { lag: u32::MAX, ..link("a", "b", "-->") }]));
        let drawn = |number: u32| -> Json {
            let text = answer(&server, &format!("/model?number={number}"));
            serde_json::from_str(text.split_once("\r\n\r\n").unwrap().1).unwrap()
        };
        let graph = drawn(2)["graph"].as_str().unwrap().to_owned();
        assert_eq!(graph.matches("<g class=\"node\">").count(), 2);
        for (cause, effect) in [("a", "&lt;b&gt;"), ("a", "a")] {
            assert!(graph.contains(&format!("data-cause=\"{cause}\" data-effect=\"{effect}\"")), "{graph}");
        }
        assert!(graph.contains("something not recorded drives both") && !graph.contains("<b>"), "{graph}");
        assert!(drawn(2)["matrix"].is_null() && !drawn(1)["graph"].as_str().unwrap().contains("recorded"));
        // From 16 variables on there is a matrix with a disc for each link, in their order.
        let matrix = drawn(3)["matrix"].as_str().unwrap().to_owned();
        let discs: Vec<_> = matrix
            .lines()
            .filter(|line| line.contains("class=\"cell\"") && line.contains("<title>"))
            .collect();
        assert_eq!(discs.len(), 20);
        assert!(
            (0..20).all(|k| discs[k].contains(&format!("<title>v{k} → v{}, lag 1: 0.50", k + 1))),
            "{matrix}"
        );
        // What would take too long is not drawn.
        assert!(drawn(4).is_null());
    }

    #[test]
    fn a_page_elsewhere_may_not_ask() {
        let server = Server::start(HERE, 0, "").unwrap();
        let whatif = "/whatif?q=%7B%22actions%22:[]%7D";
        for (path, site, code) in [
            (whatif, "cross-site", "403"),
            (whatif, "same-site", "403"),
            (whatif, "same-origin", "503"),
            ("/model?number=1", "cross-site", "403"),
            ("/model?number=1", "same-origin", "200"),
        ] {
            let mut stream = TcpStream::connect((HERE, port(&server))).unwrap();
            let head = "HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n";
            write!(stream, "GET {path} {head}Sec-Fetch-Site: {site}\r\n\r\n").unwrap();
            let mut text = String::new();
            stream.read_to_string(&mut text).unwrap();
            assert_eq!(&text[9..12], code, "{path} from {site}: {text}");
        }
    }

    #[test]
    fn a_port_in_use_is_one_sentence_with_a_way_out() {
        let server = Server::start(HERE, 0, "").unwrap();
        let error = Server::start(HERE, port(&server), "").err().unwrap().to_string();
        assert!(error.contains("in use by another program; choose another"), "{error}");
        let error = Server::start("192.0.2.1".parse().unwrap(), 0, "").err().unwrap().to_string();
        assert!(error.contains("none of this machine's"), "{error}");
    }

    #[test]
    fn a_browser_that_stops_reading_is_dropped_and_others_go_on() {
        let server = Server::start(HERE, 0, "").unwrap();
        let mut lazy = ask(&server, "/events");
        let mut awake = ask(&server, "/events");
        let big: Arc<str> = "x".repeat(1 << 20).into();
        let reader = thread::spawn(move || {
            let (mut bytes, mut chunk) = (0_u64, vec![0; 1 << 16]);
            while let Ok(count @ 1..) = awake.read(&mut chunk) {
                bytes += count as u64;
                if bytes > 60 << 20 {
                    return bytes;
                }
            }
            bytes
        });
        let begin = Instant::now();
        for _ in 0..64 {
            server.hub.send(Frame { kind: "scene", data: big.clone() }, Keep::Last);
            thread::sleep(Duration::from_millis(20));
        }
        assert!(reader.join().unwrap() > 60 << 20, "the browser that reads gets all");
        assert!(begin.elapsed() < Duration::from_secs(30));
        // What the slow reader finds when it reads at last: the contents of the buffers, then the end.
        let mut chunk = vec![0; 1 << 16];
        let mut bytes = 0_u64;
        while let Ok(count @ 1..) = lazy.read(&mut chunk) {
            bytes += count as u64;
        }
        assert!(bytes < 30 << 20, "{bytes} bytes were kept for a browser that does not read");
    }

    #[test]
    fn there_are_places_for_so_many_browsers_and_they_are_free_again() {
        let server = Server::start(HERE, 0, "").unwrap();
        let status = |stream: &mut TcpStream| {
            let mut line = [0; 12];
            stream.read_exact(&mut line).unwrap();
            String::from_utf8_lossy(&line[9..]).into_owned()
        };
        let mut browsers: Vec<TcpStream> =
            (0..Limits::of_this_process().streams).map(|_| ask(&server, "/events")).collect();
        assert!(browsers.iter_mut().all(|browser| status(browser) == "200"));
        assert!(answer(&server, "/events").contains("browsers watch already"));
        browsers.clear();
        let begin = Instant::now();
        loop {
            server.hub.send(Frame { kind: "scene", data: "{}".into() }, Keep::Last);
            if status(&mut ask(&server, "/events")) == "200" {
                break;
            }
            assert!(begin.elapsed() < Duration::from_secs(10), "no place is free again");
            thread::sleep(Duration::from_millis(50));
        }
    }

    /// A server that allows 16 connections, each with this time for a request.
    fn small(headers: Duration) -> Server {
        let limits = Limits { connections: 16, streams: 2, headers };
        Server::start_within(limits, HERE, 0, "").unwrap()
    }

    /// Sends these bytes and nothing more.
    fn begin(server: &Server, bytes: &str) -> TcpStream {
        let mut stream = TcpStream::connect((HERE, port(server))).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        stream.write_all(bytes.as_bytes()).unwrap();
        stream
    }

    /// What a connection sends until the server closes it; a close with unread bytes is an error of the socket.
    fn rest(stream: &mut TcpStream) -> String {
        let (mut bytes, mut chunk) = (Vec::new(), [0; 4096]);
        loop {
            match stream.read(&mut chunk) {
                Ok(0) => break,
                Ok(count) => bytes.extend_from_slice(&chunk[..count]),
                Err(error) if error.kind() == io::ErrorKind::ConnectionReset => break,
                Err(error) => panic!("not closed: {error}"),
            }
        }
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// The sockets that this process has on a port of its own as their near end.
    fn sockets(port: u16) -> usize {
        let table = std::fs::read_to_string("/proc/self/net/tcp").unwrap();
        let near = format!(":{port:04X} ");
        // State 01: open.
        table
            .lines()
            .filter(|line| {
                line.split_once(": ")
                    .is_some_and(|(_, line)| line[8..].starts_with(&near) && line.contains(" 01 "))
            })
            .count()
    }

    #[test]
    fn who_sends_nothing_keeps_nobody_out_and_few_files() {
        let server = small(Duration::from_secs(60));
        let mut watching = ask(&server, "/events");
        watching.read_exact(&mut [0; 12]).unwrap();
        let mut silent = Vec::new();
        for round in 0..10 {
            silent.extend((0..20).map(|_| begin(&server, ["", "GET / HTTP/1.1\r\nHost: "][round % 2])));
            assert!(answer(&server, "/").starts_with("HTTP/1.1 200"), "{} silent ones", silent.len());
        }
        if cfg!(target_os = "linux") {
            assert!(sockets(port(&server)) <= 16, "{} connections", sockets(port(&server)));
        }
        // Who watches goes on watching.
        server.hub.send(Frame { kind: "scene", data: "\"still here\"".into() }, Keep::Last);
        let (mut text, mut chunk) = (String::new(), [0; 512]);
        while !text.contains("still here") {
            let count = watching.read(&mut chunk).unwrap();
            assert!(count > 0, "the stream has ended: {text}");
            text += &String::from_utf8_lossy(&chunk[..count]);
        }
    }

    #[test]
    fn a_request_has_its_time_and_a_stream_outlives_it() {
        let server = small(Duration::from_millis(500));
        let mut watching = ask(&server, "/events");
        watching.read_exact(&mut [0; 12]).unwrap();
        let begun = Instant::now();
        // Nothing; half a first line; headers that never end; a second request that never comes.
        let idle = "GET /icon.svg HTTP/1.1\r\nHost: localhost\r\n\r\n";
        for bytes in ["", "GET /", "GET / HTTP/1.1\r\nHost: localhost\r\nX: ", idle] {
            let mut stream = begin(&server, bytes);
            let text = rest(&mut stream);
            assert_eq!(text.starts_with("HTTP/1.1 200"), bytes == idle, "{bytes}: {text}");
        }
        assert!(begun.elapsed() < Duration::from_secs(30), "{:?}", begun.elapsed());
        // A byte now and then is no more time.
        let mut slow = begin(&server, "GET / HTTP/1.1\r\n");
        let begun = Instant::now();
        while slow.write_all(b"X").is_ok() {
            assert!(begun.elapsed() < Duration::from_secs(30), "headers may take for ever");
            thread::sleep(Duration::from_millis(50));
        }
        server.hub.send(Frame { kind: "scene", data: "{}".into() }, Keep::Last);
        watching.read_exact(&mut [0; 12]).unwrap();
    }

    #[test]
    fn bodies_and_endless_headers_are_refused_at_once() {
        let server = small(Duration::from_secs(60));
        let head = "/events HTTP/1.1\r\nHost: localhost\r\n";
        for (kind, body) in [
            ("GET", "Content-Length: 1000000000"),
            ("POST", "Content-Length: 5"),
            ("POST", "Transfer-Encoding: chunked"),
            ("PUT", "Content-Length: 5\r\nExpect: 100-continue"),
        ] {
            let text = rest(&mut begin(&server, &format!("{kind} {head}{body}\r\n\r\n")));
            assert!(
                text.starts_with("HTTP/1.1 413") && text.contains("takes no request with a body"),
                "{text}"
            );
        }
        for long in [
            format!("GET /{} HTTP/1.1\r\n", "x".repeat(1 << 17)),
            format!("GET {head}X: {}\r\n", "x".repeat(1 << 17)),
        ] {
            let mut stream = TcpStream::connect((HERE, port(&server))).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
            // The server may close before all is sent.
            let _ = stream.write_all(long.as_bytes());
            let text = rest(&mut stream);
            assert!(text.is_empty() || text.starts_with("HTTP/1.1 4"), "{text}");
        }
        let text = rest(&mut begin(&server, "GET / HTTP/1.1\r\nHost: [::1].evil.example\r\n\r\n"));
        assert!(text.starts_with("HTTP/1.1 403") && text.contains("connection: close"), "{text}");
    }

    #[test]
    fn the_end_of_the_server_ends_open_streams() {
        let server = Server::start(HERE, 0, "").unwrap();
        let mut stream = ask(&server, "/events");
        stream.read_exact(&mut [0; 12]).unwrap();
        drop(server);
        let mut rest = Vec::new();
        assert!(stream.read_to_end(&mut rest).is_ok());
    }
}
