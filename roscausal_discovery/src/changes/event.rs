//! What the detector tells.

use serde::{Deserialize, Serialize};

/// What of a mechanism is compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// The slope of each link.
    #[default]
    Slope,
    /// A smooth curve of any form.
    Curve,
}

impl Form {
    /// The form that goes with an independence test: a curve where the test sees more than lines.
    pub fn of_test(test: &str) -> Self {
        match test.replace(['-', '_'], "").as_str() {
            "gpdc" | "gpdcpython" | "cmiknn" => Self::Curve,
            _ => Self::Slope,
        }
    }
}

/// How sure an event is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// One batch differs; the next one decides.
    Suspected,
    /// The next batch shows it, too.
    Confirmed,
    /// The next batch does not show it.
    Withdrawn,
}

impl Status {
    /// As it stands in files.
    pub fn name(self) -> &'static str {
        ["suspected", "confirmed", "withdrawn"][self as usize]
    }
}

/// What became of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Kind {
    /// It was not there before.
    Appeared,
    /// It is not there any more.
    Vanished,
    /// It has the other sign.
    Reversed,
    /// It is stronger.
    Stronger,
    /// It is weaker.
    Weaker,
}

impl Kind {
    /// As it stands in files.
    pub fn name(self) -> &'static str {
        ["appeared", "vanished", "reversed", "stronger", "weaker"][self as usize]
    }
}

/// A link whose mechanism changed, or seems to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangeEvent {
    /// The same through all its stages.
    pub id: String,
    /// How sure it is.
    pub status: Status,
    /// What became of the link.
    pub kind: Kind,
    /// Name of the cause.
    pub cause: String,
    /// Name of the effect.
    pub effect: String,
    /// Steps from cause to effect.
    pub lag: usize,
    /// The slope before, in the variables' units; of curves the deviation of the cause's part of the effect.
    pub before: f64,
    /// The same after; negative where a curve is turned over.
    pub after: f64,
    /// What was compared.
    pub form: Form,
    /// P-value of one mechanism before and after.
    pub p_value: f64,
    /// Rows read when it was told.
    pub time: usize,
    /// Rows between which the link changed; of a confirmed event.
    pub changed_between: Option<[usize; 2]>,
    /// Number of the regime that begins; of a confirmed event. The first regime has the number 1.
    pub regime: Option<usize>,
    /// An earlier regime whose slopes the new one has again.
    pub same_as: Option<usize>,
    /// Of a link that appeared: the lag that it had before, and vanished at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moved_from: Option<usize>,
}

impl ChangeEvent {
    /// The event in words.
    pub fn sentence(&self) -> String {
        let Self { cause, effect, lag, before, after, time, .. } = self;
        let what = if self.form == Form::Slope { "slope" } else { "its part" };
        let slopes = format!("{what} {before:.3} before, {after:.3} after");
        let what = match self.kind {
            Kind::Appeared => {
                let before = self.moved_from.map(|before| format!("where it was lag {before} before"));
                let before = before.unwrap_or_else(|| "which it did not before".to_owned());
                format!("{cause} drives {effect} (lag {lag}), {before}")
            }
            Kind::Vanished => format!("{cause} no longer drives {effect} (lag {lag})"),
            Kind::Reversed => format!("{cause} drives {effect} (lag {lag}) in the opposite direction"),
            Kind::Stronger => format!("{cause} drives {effect} (lag {lag}) more strongly"),
            Kind::Weaker => format!("{cause} drives {effect} (lag {lag}) less strongly"),
        };
        let when = match self.changed_between {
            Some([from, to]) => format!("; changed between rows {from} and {to}"),
            None => String::new(),
        };
        let what = if self.status == Status::Withdrawn { format!("that {what}") } else { what };
        let again = self.same_as.map_or(String::new(), |regime| format!("; as in regime {regime} again"));
        format!("{} at row {time}: {what}: {slopes}{when}{again}", self.status.name())
    }
}
