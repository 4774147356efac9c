//! Services.

use futures::StreamExt;
use ros2_client::{Message, Name, QosProfile, ServiceMapping, ServiceTypeName, qos::History};
use roscausal_core::{Error, Result};
use tracing::warn;

use super::Participant;

/// Requests that wait for their answer.
const WAITING: usize = 10;

impl Participant {
    /// Offers the service `name` of this node, of the type `rcl_interfaces/kind`. Each request is answered with what
    /// `handle` makes of it, on the thread on which all that comes is read, until that is `None`.
    ///
    /// # Errors
    /// If the library refuses, or the node has left.
    pub(crate) fn serve<Req, Resp>(
        &self,
        name: &str,
        kind: &str,
        handle: impl Fn(Req) -> Option<Resp> + Send + 'static,
    ) -> Result<()>
    where
        Req: Message + Clone + Send + 'static,
        Resp: Message + Clone + Send + 'static,
    {
        let failed = |reason: String| Error::Middleware(format!("service {name}: {reason}"));
        let full = Name::new(&self.names().full_name(), name).map_err(|error| failed(error.to_string()))?;
        let kind = ServiceTypeName::new("rcl_interfaces", kind);
        let profile = QosProfile::publisher_default().history(History::KeepLast { depth: WAITING });
        let server = self.session(|session| {
            session.node.create_server::<Req, Resp>(mapping(), &full, &kind, profile.clone(), profile)
        })?;
        let server = server.map_err(|error| failed(error.to_string()))?;
        let name = name.to_owned();
        self.spawn(format!("service {name}"), move || async move {
            let mut requests = server.receive_request_stream();
            while let Some(request) = requests.next().await {
                match request {
                    Ok((id, request)) => {
                        let Some(response) = handle(request) else { return };
                        if let Err(error) = server.async_send_response(id, response).await {
                            warn!("service {name}: an answer was not sent: {error}");
                        }
                    }
                    Err(error) => warn!("service {name}: a request was not understood: {error}"),
                }
            }
        });
        Ok(())
    }
}

/// Fast DDS and Cyclone DDS carry the identity of a request in different places.
fn mapping() -> ServiceMapping {
    match std::env::var("RMW_IMPLEMENTATION").as_deref() {
        Ok("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
        _ => ServiceMapping::Enhanced,
    }
}
