//! The one check of evidence that is read from a file.

use std::collections::HashSet;

use serde::{Deserialize, Deserializer, de::Error as _};

use super::{EVIDENCE_SCHEMA, Evidence, Unchecked};
use crate::types::{
    Error, Result, ensure,
    text::{check_names, check_nesting, check_schema, is_share, quoted, reason_of},
};

/// What evidence of any version has.
#[derive(Deserialize)]
struct Head {
    schema: String,
}

impl Evidence {
    /// Reads the evidence in the text of a file.
    ///
    /// # Errors
    /// Text that is not evidence of [`EVIDENCE_SCHEMA`], or one of which two parts do not fit together.
    pub fn from_json(text: &[u8]) -> Result<Self> {
        check_nesting(text).map_err(|e| invalid(&e))?;
        let head: Head = serde_json::from_slice(text).map_err(|e| invalid(&reason_of(e)))?;
        check_schema(&head.schema, EVIDENCE_SCHEMA)?;
        // Read unchecked first: the check words its faults itself.
        let mut json = serde_json::Deserializer::from_slice(text);
        let read = Unchecked::deserialize(&mut json).and_then(|evidence| json.end().map(|()| evidence));
        let evidence = read.map_err(|e| invalid(&reason_of(e)))?;
        evidence.check()?;
        Ok(evidence)
    }

    /// Checks version, names, lags and numbers.
    ///
    /// # Errors
    /// The first fault, in a sentence.
    pub fn check(&self) -> Result<()> {
        check_schema(&self.schema, EVIDENCE_SCHEMA)?;
        self.parts().map_err(|reason| invalid(&reason))
    }

    fn parts(&self) -> std::result::Result<(), String> {
        check_names(self.variables.iter().map(|facts| &facts.name)).map_err(|error| error.to_string())?;
        let known: HashSet<&String> = self.variables.iter().map(|facts| &facts.name).collect();
        let mut links = HashSet::new();
        for (k, link) in self.links.iter().enumerate() {
            let names = [&link.cause, &link.effect].into_iter();
            let mut names = names.chain(link.conditions.iter().map(|condition| &condition.name));
            if let Some(name) = names.find(|name| !known.contains(name)) {
                return Err(format!("links[{k}] names {}, which is not one of its variables", quoted(name)));
            }
            if !links.insert((&link.cause, &link.effect, link.lag)) {
                let (cause, effect) = (quoted(&link.cause), quoted(&link.effect));
                return Err(format!("links has {cause} -> {effect} at lag {} twice", link.lag));
            }
            let lags = link.lags.iter().map(|at| at.lag).chain(link.conditions.iter().map(|node| node.lag));
            if let Some(lag) = lags.chain([link.lag]).find(|lag| Error::check_lags(0, *lag).is_err()) {
                return Err(format!("links[{k}] has lag {lag}, which no analysis has"));
            }
            // Of 32 bits: a number of a file may be too large for them.
            let finite = link.scatter.iter().chain(&link.residuals).flatten().all(|value| value.is_finite());
            ensure(finite, || format!("links[{k}] has a point that is not finite"))?;
            let shares = link.lags.iter().all(|at| is_share(at.p_value));
            ensure(shares, || format!("links[{k}] has a p_value that is not a number from 0 to 1"))?;
        }
        Ok(())
    }
}

fn invalid(reason: &dyn std::fmt::Display) -> Error {
    Error::Data(format!("not valid evidence ({EVIDENCE_SCHEMA}): {reason}"))
}

impl<'de> Deserialize<'de> for Evidence {
    fn deserialize<D: Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
        let evidence = Unchecked::deserialize(from)?;
        evidence.check().map_err(D::Error::custom)?;
        Ok(evidence)
    }
}
