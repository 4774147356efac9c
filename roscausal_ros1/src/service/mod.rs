//! Services of ROS 1: TCP connections with a header and frames (<https://wiki.ros.org/ROS/TCPROS>).
//!
//! They are ours, because rosrust's answer one question per connection, so that persistent clients fail at the second;
//! wait for ever on a client that says nothing, while all others wait behind it; read messages of any length; and are
//! not registered again after a restart of the master.

mod client;
mod connection;
mod frame;

use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::{Arc, Mutex, Weak};
use std::{thread, time::Duration};

use roscausal_core::{Error, Result, gate::Gate, middleware::Reply};
use roscausal_msgs::Service;
use roscausal_ros::in_time;

use crate::{PATIENCE, master::Role, session::Session};

pub(crate) use client::call;
use connection::attend;

/// How long a connection may take that only asks whether somebody listens.
const KNOCK: Duration = Duration::from_millis(500);
/// Connections of one service at a time; more are closed at once.
const MOST_CONNECTIONS: usize = 256;

/// What a service does with a question.
type Callback<S> = Box<dyn FnMut(<S as Service>::Request, Reply<<S as Service>::Response>) + Send>;

/// What the connections of a service share.
struct Shared<S: Service> {
    service: String,
    node: String,
    /// Closed when the service ends.
    gate: Gate,
    callback: Mutex<Callback<S>>,
}

/// A service of a [`crate::Ros1`]. Dropping it ends the service.
pub struct Server {
    session: Weak<Session>,
    id: u64,
    service: String,
    api: String,
    address: SocketAddr,
    end: Box<dyn Fn() + Send>,
}

/// Offers a service under its resolved name.
///
/// # Errors
/// A service that somebody offers already, or a master or network that cannot be used.
pub(crate) fn serve<S: Service>(
    session: &Arc<Session>,
    service: String,
    callback: impl FnMut(S::Request, Reply<S::Response>) + Send + 'static,
) -> Result<Server> {
    let fail = |reason: String| Error::Service { service: service.clone(), reason };
    let master = session.membership.master()?;
    if let Ok(api) = master.lookup_service(&service)
        && address_of(&api).is_some_and(|address| TcpStream::connect_timeout(&address, KNOCK).is_ok())
    {
        return Err(fail(format!("a node at {api} offers it already")));
    }
    let listener = TcpListener::bind(("0.0.0.0", 0)).map_err(|error| fail(error.to_string()))?;
    let port = listener.local_addr().map_err(|error| fail(error.to_string()))?.port();
    let api = format!("rosrpc://{}:{port}", session.membership.host());
    let shared = Arc::new(Shared::<S> {
        service: service.clone(),
        node: session.membership.node().to_owned(),
        gate: Gate::default(),
        callback: Mutex::new(Box::new(callback)),
    });
    let its_own = shared.clone();
    let acceptor = thread::Builder::new().name(format!("service {service}"));
    acceptor.spawn(move || accept(&listener, &its_own)).map_err(|error| fail(error.to_string()))?;
    let id = session.membership.keep(Role::Service, &service, api.clone());
    let server = Server {
        session: Arc::downgrade(session),
        id,
        service: service.clone(),
        api: api.clone(),
        address: SocketAddr::from(([127, 0, 0, 1], port)),
        end: Box::new(move || shared.gate.close()),
    };
    master.register(Role::Service, &service, &api).map_err(|error| fail(error.to_string()))?;
    Ok(server)
}

/// Takes connections until the service ends, each on a thread of its own.
fn accept<S: Service>(listener: &TcpListener, shared: &Arc<Shared<S>>) {
    let open = Arc::new(());
    for stream in listener.incoming() {
        if !shared.gate.is_open() {
            return;
        }
        let Ok(stream) = stream else { continue };
        if Arc::strong_count(&open) > MOST_CONNECTIONS {
            tracing::warn!(
                "service '{}': {MOST_CONNECTIONS} connections are open; another one is refused",
                shared.service
            );
            continue;
        }
        let (shared, counted) = (shared.clone(), open.clone());
        let client = thread::Builder::new().name("service client".to_owned());
        let attended = client.spawn(move || {
            let _counted = counted;
            if let Err(error) = attend(stream, &shared) {
                tracing::debug!("service '{}': {error}", shared.service);
            }
        });
        if let Err(error) = attended {
            tracing::warn!(
                "service '{}': no thread for a client: {error}",
                listener.local_addr().map_or_else(|_| String::new(), |a| a.to_string())
            );
        }
    }
}

/// The address behind `rosrpc://host:port`.
fn address_of(api: &str) -> Option<SocketAddr> {
    api.strip_prefix("rosrpc://")?.trim_end_matches('/').to_socket_addrs().ok()?.next()
}

impl Drop for Server {
    fn drop(&mut self) {
        (self.end)();
        // Wakes the thread that accepts, which then ends.
        let _ = TcpStream::connect_timeout(&self.address, KNOCK);
        if let Some(session) = self.session.upgrade() {
            session.membership.forget(self.id);
            let (service, api) = (self.service.clone(), self.api.clone());
            in_time(PATIENCE, move || {
                let master = session.membership.master();
                let _ = master.map(|master| master.unregister(Role::Service, &service, &api));
            });
        }
    }
}
