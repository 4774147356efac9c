//! The standard parameter services, and `/parameter_events`.

use std::sync::Arc;

use futures::StreamExt;
use ros2_client::{
    Message, Name, Publisher, QosProfile, ServiceMapping, ServiceTypeName,
    parameters::raw,
    qos::{History, WhenFull},
    rcl_interfaces::{
        DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
        GetParameterTypesResponse, GetParametersRequest, GetParametersResponse, ListParametersRequest,
        ListParametersResponse, SetParametersAtomicallyResponse, SetParametersRequest, SetParametersResponse,
    },
};
use roscausal_core::{Error, Result, params::Value};
use tracing::warn;

use crate::{node::Inner, parameters::from_wire};

/// The topic of changes of parameters.
pub(crate) struct ParameterEvents {
    publisher: Publisher<raw::ParameterEvent>,
}

fn failed(error: impl std::fmt::Display) -> Error {
    Error::Middleware(format!("parameter services: {error}"))
}

/// Offers the services of a node's parameters in the graph.
///
/// # Errors
/// When the middleware refuses.
pub(crate) fn serve(inner: &Arc<Inner>) -> Result<()> {
    let parameters = inner.parameters.clone();
    answer(inner, "get_parameters", "GetParameters", move |request: GetParametersRequest| {
        let values = request.names.iter().map(|name| parameters.get(name)).collect();
        GetParametersResponse { values }
    })?;
    let parameters = inner.parameters.clone();
    answer(inner, "get_parameter_types", "GetParameterTypes", move |request: GetParameterTypesRequest| {
        let values = request.names.iter().map(|name| parameters.get(name).ptype).collect();
        GetParameterTypesResponse { values }
    })?;
    let parameters = inner.parameters.clone();
    answer(inner, "list_parameters", "ListParameters", move |request: ListParametersRequest| {
        ListParametersResponse { result: parameters.list(&request.prefixes, request.depth) }
    })?;
    let parameters = inner.parameters.clone();
    answer(inner, "describe_parameters", "DescribeParameters", move |request: DescribeParametersRequest| {
        let values = request.names.iter().map(|name| parameters.describe(name)).collect();
        DescribeParametersResponse { values }
    })?;
    let node = Arc::downgrade(inner);
    answer(inner, "set_parameters", "SetParameters", move |request: SetParametersRequest| {
        let node = node.upgrade();
        let changes = from_wire(request).into_iter();
        SetParametersResponse { results: changes.map(|change| set(node.as_ref(), vec![change])).collect() }
    })?;
    let node = Arc::downgrade(inner);
    answer(
        inner,
        "set_parameters_atomically",
        "SetParametersAtomically",
        move |request: SetParametersRequest| SetParametersAtomicallyResponse {
            result: set(node.upgrade().as_ref(), from_wire(request)),
        },
    )
}

impl ParameterEvents {
    /// # Errors
    /// When the middleware refuses.
    pub(crate) fn new(context: &ros2_client::Context, node: &mut ros2_client::Node) -> Result<Self> {
        let profile = QosProfile::publisher_default()
            .reliability_reliable(WhenFull::Fail)
            .history(History::KeepLast { depth: 1000 });
        let publisher = node.create_publisher(&context.get_parameter_events_topic(), Some(profile));
        Ok(Self { publisher: publisher.map_err(failed)? })
    }

    /// Publishes on `/parameter_events` that parameters are new, or have new values.
    pub(crate) fn announce(&self, inner: &Inner, names: &[&str], new: bool) {
        let parameter =
            |name: &&str| raw::Parameter { name: (*name).to_owned(), value: inner.parameters.get(name) };
        let values: Vec<_> = names.iter().map(parameter).collect();
        let (new_parameters, changed_parameters) = if new { (values, vec![]) } else { (vec![], values) };
        let now = inner.clock.now();
        let event = raw::ParameterEvent {
            stamp: ros2_client::builtin_interfaces::Time::new(now.sec, now.nanosec),
            node: inner.names.full_name(),
            new_parameters,
            changed_parameters,
            deleted_parameters: vec![],
        };
        // An event that nobody takes is lost, as everywhere in ROS 2.
        let _ = self.publisher.publish(event);
    }
}

fn set(node: Option<&Arc<Inner>>, changes: Vec<(String, Option<Value>)>) -> raw::SetParametersResult {
    let Some(node) = node else {
        return raw::SetParametersResult { successful: false, reason: "the node is ending".into() };
    };
    match node.parameters.set(changes) {
        Ok(set) => {
            set.iter().for_each(|(name, value)| node.parameter_set(name, value));
            let names: Vec<_> = set.iter().map(|(name, _)| name.as_str()).collect();
            node.parameter_events.announce(node, &names, false);
            raw::SetParametersResult { successful: true, reason: String::new() }
        }
        Err(reason) => {
            warn!("refused: {reason}");
            raw::SetParametersResult { successful: false, reason }
        }
    }
}

/// Fast DDS and Cyclone DDS carry a request's identity in different places.
fn service_mapping() -> ServiceMapping {
    match std::env::var("RMW_IMPLEMENTATION").as_deref() {
        Ok("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
        _ => ServiceMapping::Enhanced,
    }
}

/// Offers one service, and answers its requests on the node's spinner.
fn answer<Req, Resp>(
    inner: &Inner,
    name: &str,
    kind: &str,
    handle: impl Fn(Req) -> Resp + Send + 'static,
) -> Result<()>
where
    Req: Message + Clone + Send + 'static,
    Resp: Message + Clone + Send + 'static,
{
    let profile = QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
    let name = Name::new(&inner.names.full_name(), name).map_err(failed)?;
    let kind = ServiceTypeName::new("rcl_interfaces", kind);
    let server = inner.session(|session| {
        session.node.create_server::<Req, Resp>(service_mapping(), &name, &kind, profile.clone(), profile)
    })?;
    let server = server.map_err(failed)?;
    inner.spinner.spawn("parameter services".into(), move || async move {
        let mut requests = server.receive_request_stream();
        while let Some(request) = requests.next().await {
            match request {
                Ok((id, request)) => {
                    if let Err(error) = server.async_send_response(id, handle(request)).await {
                        warn!("a parameter service's answer was not sent: {error}");
                    }
                }
                Err(error) => warn!("a request to a parameter service was not understood: {error}"),
            }
        }
    });
    Ok(())
}
