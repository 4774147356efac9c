//! Our own messages. `msg/*.msg` documents them for users of ROS.

use serde::{Deserialize, Serialize};

use crate::{
    Time,
    geometry_msgs::{Point, Pose2D, Twist},
    std_msgs::{Float32MultiArray, Header, Int32MultiArray},
};

/// The state of the robot at one moment, in the frame that the header names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotState {
    /// Stamp of the measurement; the frame of `pose2d` and `goal`.
    pub header: Header,
    /// Position and heading. ROS 1 calls the field `pose2D`, which is not a legal name in ROS 2.
    pub pose2d: Pose2D,
    /// Velocity of the base, in its own frame.
    pub twist: Twist,
    /// The robot's goal; NaN while it has none.
    pub goal: Point,
}
message!(own RobotState uses [Header, Pose2D, Twist, Point]);

/// The state of one person at one moment, in the frame that the header names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HumanState {
    /// Stamp of the measurement; the frame of all other fields.
    pub header: Header,
    /// The tracker's id for this person.
    pub id: u32,
    /// Position and heading. ROS 1 calls the field `pose2D`, which is not a legal name in ROS 2.
    pub pose2d: Pose2D,
    /// Velocity.
    pub twist: Twist,
    /// The person's goal; NaN if unknown.
    pub goal: Point,
}
message!(own HumanState uses [Header, Pose2D, Twist, Point]);

/// All people seen at one moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Humans {
    /// Stamp of the measurement; the frame of every person.
    pub header: Header,
    /// One entry per person, in ascending order of id.
    pub humans: Vec<HumanState>,
}
message!(own Humans uses [Header, HumanState]);

/// A causal model found in one batch. Its arrays are `[lag, effect, cause]` (lag index 0 is the smallest lag),
/// flattened in row-major order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CausalModel {
    /// When the analysis ended; the frame in which the batch was recorded.
    pub header: Header,
    /// The variables, in the order of the axes.
    pub features: Vec<String>,
    /// 1 where a link was found, otherwise 0.
    pub causal_structure: Int32MultiArray,
    /// Test statistic of each link, 0 where there is none.
    pub val_matrix: Float32MultiArray,
    /// p-value of each link, 0 where there is none.
    pub pval_matrix: Float32MultiArray,
    /// Lengths of the three axes.
    pub original_shape: Vec<i32>,
}
message!(own CausalModel uses [Header, Int32MultiArray, Float32MultiArray]);

/// One link of a causal model: `cause(t - lag)` drives `effect(t)`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CausalLink {
    /// Name of the driving variable.
    pub cause: String,
    /// Name of the driven variable.
    pub effect: String,
    /// Lag in samples.
    pub lag: u32,
    /// Test statistic; NaN if it was not tested.
    pub value: f64,
    /// p-value; NaN if it was not tested.
    pub p_value: f64,
    /// Fraction of resampled batches in which the link was found, 0 to 1; -1 if not computed.
    pub confidence: f64,
    /// The link in words.
    pub description: String,
    /// Its mark, such as `-->` or `o-o`; empty is taken for `-->`.
    pub mark: String,
    /// Whether a test found it; if not, `value` and `p_value` are NaN.
    pub tested: bool,
    /// Samples that its test used; 0: not known.
    pub samples: u32,
    /// How likely the link is real, 0 to 1; NaN: not measured.
    pub chance: f64,
}
message!(own CausalLink uses []);

/// How a [`CausalModel`] was found; published beside it with the same header.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CausalModelInfo {
    /// The same as that of the model.
    pub header: Header,
    /// Name of the batch: file name without extension.
    pub batch_id: String,
    /// Discovery method, such as `fpcmci`.
    pub method: String,
    /// Conditional independence test, such as `gpdc`.
    pub cond_ind_test: String,
    /// Correction for multiple testing: `none` or `fdr_bh`.
    pub fdr_method: String,
    /// Significance level of the model's links.
    pub alpha: f64,
    /// Significance level of the condition selection (PC1).
    pub pc_alpha: f64,
    /// Smallest lag, in samples.
    pub min_lag: u32,
    /// Largest lag, in samples.
    pub max_lag: u32,
    /// Time step of the samples, seconds.
    pub dt: f64,
    /// Samples that the tests used.
    pub n_samples: u32,
    /// Stamp of the batch's first sample.
    pub start_time: Time,
    /// Stamp of the batch's last sample.
    pub end_time: Time,
    /// Seed of all randomness in the analysis.
    pub seed: u64,
    /// Duration of the analysis, seconds.
    pub run_time_s: f64,
    /// Version of the software that made the model.
    pub software_version: String,
    /// Variables given to the method, before any selection.
    pub candidate_features: Vec<String>,
    /// Links of the model, strongest first.
    pub links: Vec<CausalLink>,
    /// Links that the previous model did not have, as `cause -> effect (lag n)`.
    pub links_gained: Vec<String>,
    /// Links that the previous model had and this one does not.
    pub links_lost: Vec<String>,
}
message!(own CausalModelInfo uses [Header, CausalLink]);

/// A link whose mechanism changed, or seems to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelChange {
    /// The same through all its stages.
    pub id: String,
    /// [`ModelChange::SUSPECTED`], [`ModelChange::CONFIRMED`] or [`ModelChange::WITHDRAWN`].
    pub status: u8,
    /// `appeared`, `vanished`, `reversed`, `stronger` or `weaker`.
    pub kind: String,
    /// Name of the driving variable.
    pub cause: String,
    /// Name of the driven variable.
    pub effect: String,
    /// Lag in samples.
    pub lag: u32,
    /// The slope before, in the variables' units.
    pub before: f64,
    /// The slope after.
    pub after: f64,
    /// p-value of one slope before and after.
    pub p_value: f64,
    /// Stamp of the last sample that was read when it was told.
    pub told: Time,
    /// Stamps between which the link changed; zero unless confirmed.
    pub changed_from: Time,
    /// The later one.
    pub changed_to: Time,
    /// Name of the batch with the last sample.
    pub batch_id: String,
    /// The change in words.
    pub description: String,
}
message!(own ModelChange uses []);

impl ModelChange {
    /// One stretch of samples differs; the next one decides.
    pub const SUSPECTED: u8 = 0;
    /// The next one shows it, too.
    pub const CONFIRMED: u8 = 1;
    /// The next one does not show it.
    pub const WITHDRAWN: u8 = 2;
}

/// The last events of mechanisms that changed, oldest first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelChanges {
    /// When it was published; the frame of the batch.
    pub header: Header,
    /// Stamp of the first sample of the present regime.
    pub regime_since: Time,
    /// Batches of the present regime so far.
    pub batches: u32,
    /// At most 64.
    pub changes: Vec<ModelChange>,
}
message!(own ModelChanges uses [Header, ModelChange]);
