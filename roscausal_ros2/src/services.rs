//! The standard parameter services, and `/parameter_events`.

use std::sync::Arc;

use ros2_client::rcl_interfaces::{
    DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
    GetParameterTypesResponse, GetParametersRequest, GetParametersResponse, ListParametersRequest,
    ListParametersResponse, ListParametersResult, SetParametersAtomicallyResponse, SetParametersRequest,
    SetParametersResponse,
};
use ros2_client::{builtin_interfaces::Time, parameters::raw};
use roscausal_core::{Result, params::Value};
use roscausal_ros::lock;
use tracing::warn;

use crate::wire::{descriptor, from_wire, to_wire};
use crate::{dds::Content, inner::Inner};

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
    let (name, kind) = ("describe_parameters", "DescribeParameters");
    answer(inner, name, kind, |node, request: DescribeParametersRequest| {
        let described =
            |name: &String| descriptor(name, node.parameters.get(name), node.parameters.spec(name));
        DescribeParametersResponse { values: request.names.iter().map(described).collect() }
    })?;
    answer(inner, "set_parameters", "SetParameters", |node, request: SetParametersRequest| {
        let changes = from_wire(request).into_iter();
        SetParametersResponse { results: changes.map(|change| set(node, vec![change])).collect() }
    })?;
    let (name, kind) = ("set_parameters_atomically", "SetParametersAtomically");
    answer(inner, name, kind, |node, request: SetParametersRequest| SetParametersAtomicallyResponse {
        result: set(node, from_wire(request)),
    })
}

impl Inner {
    /// Publishes on `/parameter_events` that parameters are new or have new values.
    pub(crate) fn announce(&self, names: &[&str], new: bool) {
        let parameter = |name: &&str| raw::Parameter {
            name: (*name).to_owned(),
            value: to_wire(self.parameters.get(name)).into(),
        };
        let values: Vec<_> = names.iter().map(parameter).collect();
        let (new_parameters, changed_parameters) = if new { (values, vec![]) } else { (vec![], values) };
        let now = self.clock.now();
        let event = raw::ParameterEvent {
            stamp: Time::new(now.sec, now.nanosec),
            node: self.participant.names.full_name(),
            new_parameters,
            changed_parameters,
            deleted_parameters: vec![],
        };
        // An event that nobody receives is lost, as everywhere in ROS 2.
        let _ = lock(&self.parameter_events).write(&self.participant, event);
    }
}

fn set(node: &Arc<Inner>, changes: Vec<(String, Option<Value>)>) -> raw::SetParametersResult {
    let set = node.parameters.set(changes).map(|set| {
        set.iter().for_each(|(name, value)| node.parameter_set(name, value));
        let names: Vec<_> = set.iter().map(|(name, _)| name.as_str()).collect();
        node.announce(&names, false);
    });
    set.inspect_err(|reason| warn!("refused: {reason}")).into()
}

/// Offers one service and answers its requests for as long as the node lives.
fn answer<Req: Content, Resp: Content>(
    inner: &Arc<Inner>,
    name: &str,
    kind: &str,
    handle: impl Fn(&Arc<Inner>, Req) -> Resp + Send + 'static,
) -> Result<()> {
    let node = Arc::downgrade(inner);
    inner.participant.serve_at_once(name, kind, move |request| Some(handle(&node.upgrade()?, request)))
}
