//! The standard parameter services, and `/parameter_events`.

use std::sync::{Arc, Mutex};

use futures::StreamExt;
use ros2_client::{
    Context, Message, Name, Publisher, QosProfile, Server, ServiceMapping, ServiceTypeName,
    parameters::raw,
    qos::{History, WhenFull},
    rcl_interfaces::{
        DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
        GetParameterTypesResponse, GetParametersRequest, GetParametersResponse, ListParametersRequest,
        ListParametersResponse, SetParametersAtomicallyResponse, SetParametersRequest, SetParametersResponse,
    },
};
use roscausal_core::{Error, Result};
use roscausal_ros::lock;
use tracing::warn;

use crate::{
    names::Names,
    node::Inner,
    parameters::{Parameters, from_wire},
};

/// The services of one node, until [`ParameterServices::serve`] hands them to its spinner.
pub(crate) struct ParameterServices {
    waiting: Mutex<Option<Servers>>,
    events: Publisher<raw::ParameterEvent>,
}

struct Servers {
    get: Server<GetParametersRequest, GetParametersResponse>,
    get_types: Server<GetParameterTypesRequest, GetParameterTypesResponse>,
    list: Server<ListParametersRequest, ListParametersResponse>,
    describe: Server<DescribeParametersRequest, DescribeParametersResponse>,
    set: Server<SetParametersRequest, SetParametersResponse>,
    set_atomically: Server<SetParametersRequest, SetParametersAtomicallyResponse>,
}

impl ParameterServices {
    /// Offers the services in the graph.
    ///
    /// # Errors
    /// When the middleware refuses.
    pub(crate) fn new(context: &Context, node: &mut ros2_client::Node, names: &Names) -> Result<Self> {
        let failed =
            |error: ros2_client::CreateError| Error::Middleware(format!("parameter services: {error}"));
        let mut offer = Offer { node, full_name: names.full_name() };
        let servers = Servers {
            get: offer.server("get_parameters", "GetParameters").map_err(failed)?,
            get_types: offer.server("get_parameter_types", "GetParameterTypes").map_err(failed)?,
            list: offer.server("list_parameters", "ListParameters").map_err(failed)?,
            describe: offer.server("describe_parameters", "DescribeParameters").map_err(failed)?,
            set: offer.server("set_parameters", "SetParameters").map_err(failed)?,
            set_atomically: offer
                .server("set_parameters_atomically", "SetParametersAtomically")
                .map_err(failed)?,
        };
        let profile = QosProfile::publisher_default()
            .reliability_reliable(WhenFull::Fail)
            .history(History::KeepLast { depth: 1000 });
        let events =
            node.create_publisher(&context.get_parameter_events_topic(), Some(profile)).map_err(failed)?;
        Ok(Self { waiting: Mutex::new(Some(servers)), events })
    }

    /// Answers requests from now on.
    pub(crate) fn serve(&self, inner: &Arc<Inner>) {
        let Some(servers) = lock(&self.waiting).take() else { return };
        let parameters = inner.parameters.clone();
        answer(inner, servers.get, move |request| GetParametersResponse {
            values: request.names.iter().map(|name| parameters.get(name)).collect(),
        });
        let parameters = inner.parameters.clone();
        answer(inner, servers.get_types, move |request| GetParameterTypesResponse {
            values: request.names.iter().map(|name| parameters.get(name).ptype).collect(),
        });
        let parameters = inner.parameters.clone();
        answer(inner, servers.list, move |request| ListParametersResponse {
            result: parameters.list(&request.prefixes, request.depth),
        });
        let parameters = inner.parameters.clone();
        answer(inner, servers.describe, move |request| DescribeParametersResponse {
            values: request.names.iter().map(|name| parameters.describe(name)).collect(),
        });
        let node = Arc::downgrade(inner);
        answer(inner, servers.set, move |request| {
            let node = node.upgrade();
            let results =
                from_wire(request).into_iter().map(|change| set(node.as_ref(), vec![change])).collect();
            SetParametersResponse { results }
        });
        let node = Arc::downgrade(inner);
        answer(inner, servers.set_atomically, move |request| SetParametersAtomicallyResponse {
            result: set(node.upgrade().as_ref(), from_wire(request)),
        });
    }

    /// Publishes on `/parameter_events` that parameters are new, or have new values.
    pub(crate) fn announce(&self, inner: &Inner, names: &[&str], new: bool) {
        let parameters: &Parameters = &inner.parameters;
        let parameter =
            |name: &&str| raw::Parameter { name: (*name).to_owned(), value: parameters.get(name) };
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
        let _ = self.events.publish(event);
    }
}

fn set(
    node: Option<&Arc<Inner>>,
    changes: Vec<(String, Option<roscausal_core::params::Value>)>,
) -> raw::SetParametersResult {
    let Some(node) = node else {
        return raw::SetParametersResult { successful: false, reason: "the node is ending".into() };
    };
    match node.parameters.set(changes) {
        Ok(set) => {
            set.iter().for_each(|(name, value)| node.parameter_set(name, value));
            node.services().announce(
                node,
                &set.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(),
                false,
            );
            raw::SetParametersResult { successful: true, reason: String::new() }
        }
        Err(reason) => {
            warn!("refused: {reason}");
            raw::SetParametersResult { successful: false, reason }
        }
    }
}

struct Offer<'a> {
    node: &'a mut ros2_client::Node,
    full_name: String,
}

impl Offer<'_> {
    fn server<Req, Resp>(&mut self, name: &str, kind: &str) -> ros2_client::CreateResult<Server<Req, Resp>>
    where
        Req: Message + Clone + 'static,
        Resp: Message + Clone + 'static,
    {
        let profile = QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
        let wrong = |error: ros2_client::names::NameError| ros2_client::CreateError::BadParameter {
            reason: error.to_string(),
        };
        let name = Name::new(&self.full_name, name).map_err(wrong)?;
        let kind = ServiceTypeName::new("rcl_interfaces", kind);
        self.node.create_server(service_mapping(), &name, &kind, profile.clone(), profile)
    }
}

/// Fast DDS and Cyclone DDS carry a request's identity in different places.
fn service_mapping() -> ServiceMapping {
    match std::env::var("RMW_IMPLEMENTATION").as_deref() {
        Ok("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
        _ => ServiceMapping::Enhanced,
    }
}

fn answer<Req, Resp>(inner: &Inner, server: Server<Req, Resp>, handle: impl Fn(Req) -> Resp + Send + 'static)
where
    Req: Message + Send + 'static,
    Resp: Message + Send + 'static,
{
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
}
