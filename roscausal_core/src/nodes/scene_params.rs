//! Parameters of the nodes that show the scene, and of the risk.

use roscausal_msgs::{HumanState, RobotState};

use super::in_namespace;
use crate::{
    Error, Result,
    batch::Select,
    param_specs,
    params::{Allowed, ParamSpec, Params, Value},
    state::scene::RiskCone,
};

/// Parameters of the risk: names, defaults, allowed values and descriptions.
pub(super) fn risk_specs() -> Vec<ParamSpec> {
    use Allowed::Range;
    use Value::Double;
    param_specs! {
        of_data "obs_size" = Double(2.0), Range(0.01, 100.0), "radius added around the robot, metres";
        of_data "safe_dist" = Double(5.0), Range(0.01, 1000.0),
            "distance beyond which there is no collision course, metres";
    }
}

roscausal_discovery::with_defaults! {
    /// Whose goal and risk a view of the scene shows.
    #[derive(Clone, Debug, PartialEq)]
    pub struct SceneOptions {
        /// Name of the robot, the namespace of its topics; empty: none.
        pub robot: String = String::new(),
        /// The person; the first of several.
        pub agents: Select = Select::Ids([1000].into()),
        /// Radius that is added around the robot, metres.
        pub obs_size: f64 = 2.0,
        /// Distance beyond which nobody is on collision course, metres.
        pub safe_dist: f64 = 5.0,
    }
}

impl SceneOptions {
    /// Names, defaults, allowed values and descriptions of the parameters.
    pub fn specs() -> Vec<ParamSpec> {
        let whose = "person whose goal and risk are shown: an id or nearest:1; if absent, the first person, or nobody if robot is set";
        let robot = "name of the robot, the namespace of its topics; empty: none";
        let mut specs = param_specs! {
            "robot" = Value::Str(String::new()), Allowed::Any, robot;
            "sel_agent" = Value::Str("1000".into()), Allowed::Any, whose;
        };
        specs.extend(risk_specs());
        specs
    }

    /// The topic of the robot's state.
    ///
    /// # Errors
    /// A name that is not a namespace, as an error of the parameter `robot`.
    pub fn robot_topic(&self) -> Result<String> {
        in_namespace("robot", &self.robot, "roscausal/robot")
    }

    /// Reads the options from the parameters of [`SceneOptions::specs`].
    ///
    /// # Errors
    /// A `sel_agent` that selects nobody.
    pub fn read(params: &Params) -> Result<Self> {
        let agents = params.text("sel_agent").parse();
        Ok(Self {
            robot: params.text("robot"),
            agents: agents.map_err(|reason| Error::param("sel_agent", reason))?,
            obs_size: params.double("obs_size"),
            safe_dist: params.double("safe_dist"),
        })
    }

    /// The person shown; `None` if nobody is there.
    pub fn person(&self, people: &[HumanState], robot: Option<&RobotState>) -> Option<HumanState> {
        self.agents.one(people, robot.map(|robot| &robot.pose2d), self.robot.is_empty())
    }

    /// The risk cone of `person` towards `robot`; `None` as in [`RiskCone::new`].
    pub fn cone(&self, person: &HumanState, robot: &RobotState) -> Option<RiskCone> {
        RiskCone::new(person, robot, self.obs_size, self.safe_dist)
    }
}
