//! The standard parameter services, and `/parameter_events`.

use std::sync::Arc;

use futures::StreamExt;
use ros2_client::{
    Message, Name, Publisher, QosProfile, ServiceMapping, ServiceTypeName,
    builtin_interfaces::Time,
    parameters::raw,
    qos::{History, WhenFull},
    rcl_interfaces::{
        DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
        GetParameterTypesResponse, GetParametersRequest, GetParametersResponse, ListParametersRequest,
        ListParametersResponse, ListParametersResult, SetParametersAtomicallyResponse, SetParametersRequest,
        SetParametersResponse,
    },
};
use roscausal_core::{Error, Result, params::Value};
use roscausal_rmw::Participant;
use tracing::warn;

use crate::{
    node::Inner,
    wire::{descriptor, from_wire, to_wire},
};

/// The topic that announces changes of parameters.
pub(crate) struct ParameterEvents {
    publisher: Publisher<raw::ParameterEvent>,
}

fn failed(error: impl std::fmt::Display) -> Error {
    Error::Middleware(format!("parameter services: {error}"))
}

/// Offers the parameter services of a node.
///
/// # Errors
/// If the middleware refuses.
pub(crate) fn serve(inner: &Arc<Inner>) -> Result<()> {
    answer(inner, "get_parameters", "GetParameters", |node, request: GetParametersRequest| {
        let value = |name: &String| to_wire(node.parameters.get(name)).into();
        GetParametersResponse { values: request.names.iter().map(value).collect() }
    })?;
    answer(inner, "get_parameter_types", "GetParameterTypes", |node, request: GetParameterTypesRequest| {
        let kind = |name: &String| to_wire(node.parameters.get(name)).to_parameter_type() as u8;
        GetParameterTypesResponse { values: request.names.iter().map(kind).collect() }
    })?;
    answer(inner, "list_parameters", "ListParameters", |node, request: ListParametersRequest| {
        let (names, prefixes) = node.parameters.list(&request.prefixes, request.depth);
        ListParametersResponse { result: ListParametersResult { names, prefixes } }
    })?;
    answer(
        inner,
        "describe_parameters",
        "DescribeParameters",
        |node, request: DescribeParametersRequest| {
            let described =
                |name: &String| descriptor(name, node.parameters.get(name), node.parameters.spec(name));
            DescribeParametersResponse { values: request.names.iter().map(described).collect() }
        },
    )?;
    answer(inner, "set_parameters", "SetParameters", |node, request: SetParametersRequest| {
        let changes = from_wire(request).into_iter();
        SetParametersResponse { results: changes.map(|change| set(node, vec![change])).collect() }
    })?;
    let (name, kind) = ("set_parameters_atomically", "SetParametersAtomically");
    answer(inner, name, kind, |node, request: SetParametersRequest| SetParametersAtomicallyResponse {
        result: set(node, from_wire(request)),
    })
}

impl ParameterEvents {
    /// # Errors
    /// If the middleware refuses.
    pub(crate) fn new(participant: &Participant) -> Result<Self> {
        let profile = QosProfile::publisher_default()
            .reliability_reliable(WhenFull::Fail)
            .history(History::KeepLast { depth: 1000 });
        let publisher = participant.session(|session| {
            let topic = session.context.get_parameter_events_topic();
            session.node.create_publisher(&topic, Some(profile))
        })?;
        Ok(Self { publisher: publisher.map_err(failed)? })
    }

    /// Publishes on `/parameter_events` that parameters are new or have new values.
    pub(crate) fn announce(&self, inner: &Inner, names: &[&str], new: bool) {
        let parameter = |name: &&str| raw::Parameter {
            name: (*name).to_owned(),
            value: to_wire(inner.parameters.get(name)).into(),
        };
        let values: Vec<_> = names.iter().map(parameter).collect();
        let (new_parameters, changed_parameters) = if new { (values, vec![]) } else { (vec![], values) };
        let now = inner.clock.now();
        let event = raw::ParameterEvent {
            stamp: Time::new(now.sec, now.nanosec),
            node: inner.participant.names().full_name(),
            new_parameters,
            changed_parameters,
            deleted_parameters: vec![],
        };
        // An event that nobody receives is lost, as everywhere in ROS 2.
        let _ = self.publisher.publish(event);
    }
}

fn set(node: &Arc<Inner>, changes: Vec<(String, Option<Value>)>) -> raw::SetParametersResult {
    let set = node.parameters.set(changes).map(|set| {
        set.iter().for_each(|(name, value)| node.parameter_set(name, value));
        let names: Vec<_> = set.iter().map(|(name, _)| name.as_str()).collect();
        node.parameter_events.announce(node, &names, false);
    });
    set.inspect_err(|reason| warn!("refused: {reason}")).into()
}

/// Fast DDS and Cyclone DDS carry the identity of a request in different places.
fn service_mapping() -> ServiceMapping {
    match std::env::var("RMW_IMPLEMENTATION").as_deref() {
        Ok("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
        _ => ServiceMapping::Enhanced,
    }
}

/// Offers one service and answers its requests for as long as the node lives.
fn answer<Req, Resp>(
    inner: &Arc<Inner>,
    name: &str,
    kind: &str,
    handle: impl Fn(&Arc<Inner>, Req) -> Resp + Send + 'static,
) -> Result<()>
where
    Req: Message + Clone + Send + 'static,
    Resp: Message + Clone + Send + 'static,
{
    let profile = QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
    let name = Name::new(&inner.participant.names().full_name(), name).map_err(failed)?;
    let kind = ServiceTypeName::new("rcl_interfaces", kind);
    let server = inner.participant.session(|session| {
        session.node.create_server::<Req, Resp>(service_mapping(), &name, &kind, profile.clone(), profile)
    })?;
    let server = server.map_err(failed)?;
    let node = Arc::downgrade(inner);
    inner.participant.spawn("parameter services", move || async move {
        let mut requests = server.receive_request_stream();
        while let Some(request) = requests.next().await {
            match request {
                Ok((id, request)) => {
                    let Some(response) = node.upgrade().map(|node| handle(&node, request)) else { return };
                    if let Err(error) = server.async_send_response(id, response).await {
                        warn!("a parameter service's answer was not sent: {error}");
                    }
                }
                Err(error) => warn!("a request to a parameter service was not understood: {error}"),
            }
        }
    });
    Ok(())
}
