//! The structural model as a file beside the model: graph, rows, and what took long to find. Reading fits the lines and the members
//! anew on the same rows with the same seed, so the answers are the same to the last bit.

use ndarray::Array2;
use roscausal_discovery::{
    Error, LinkMark, Result, ensure,
    text::{check_nesting, check_step, is_share, quoted, reason_of},
};
use serde::{Deserialize, Serialize};

use super::{
    directed::{Settings, Summary},
    structural::{Facts, StructuralModel},
};
use crate::{
    graph::{Arrow, Graph, Pair},
    quality::Quality,
    samples::Samples,
};

/// Version of the layout. A reader refuses another major version.
pub const SCHEMA: &str = "roscausal/structural_model/1";

/// What a file of any version has.
#[derive(Deserialize)]
struct Head {
    schema: String,
}

#[derive(Serialize, Deserialize)]
struct File {
    schema: String,
    variables: Vec<String>,
    largest_lag: usize,
    links: Vec<Link>,
    settings: Settings,
    facts: Facts,
    members: Vec<MemberFile>,
    /// `[recording][row][variable]`; null where a value is missing.
    rows: Vec<Vec<Vec<Option<f64>>>>,
    /// `[recording]` of `[row, variable]` where an experiment imposed the variable.
    imposed: Vec<Vec<(usize, usize)>>,
    /// `[recording]` of the rows that are not effects; left out where there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    masked: Vec<Vec<usize>>,
}

#[derive(Serialize, Deserialize)]
struct Link {
    cause: String,
    effect: String,
    lag: usize,
    mark: LinkMark,
}

#[derive(Serialize, Deserialize)]
struct MemberFile {
    equations: Vec<Summary>,
    quality: Option<Quality>,
}

impl File {
    /// What no fit would find: facts that cannot be, and parts of another size than the graph's.
    fn check(&self) -> std::result::Result<(), String> {
        check_step(self.facts.dt).map_err(|error| error.to_string())?;
        let n = self.variables.len();
        ensure(self.rows.last().is_some_and(|rows| !rows.is_empty()), || "it has no rows at its end")?;
        if let Some((cause, effect, ..)) = self.facts.p_values.iter().find(|fact| !is_share(fact.3)) {
            return Err(format!("the p-value of {} -> {} is not 0 to 1", quoted(cause), quoted(effect)));
        }
        for member in &self.members {
            let processes = member.equations.iter().filter_map(|equation| equation.process);
            let fit = processes.into_iter().all(|(scale, noise)| scale > 0.0 && noise >= 0.0);
            ensure(fit, || "an equation has a length scale that is not above 0, or a noise below 0")?;
            let Some(quality) = &member.quality else { continue };
            let skills = quality.skill_over_persistence.iter().chain(&quality.skill_over_var).map(Vec::len);
            let rows = skills.chain(quality.widening.iter().map(Vec::len)).chain([quality.coverage.len()]);
            ensure(rows.into_iter().all(|length| length == n), || {
                format!("its quality is not of {n} variables")
            })?;
        }
        Ok(())
    }
}

impl StructuralModel {
    /// The model as JSON with a final newline: same seed, same bytes.
    pub fn to_json(&self) -> String {
        let name = |var: usize| self.graph().names()[var].clone();
        let link = |cause, effect, lag, mark| Link { cause: name(cause), effect: name(effect), lag, mark };
        let arrows = self.graph().arrows().map(|a: Arrow| link(a.cause, a.effect, a.lag, LinkMark::Forward));
        let pairs = self.graph().pairs().iter().map(|p: &Pair| {
            link(p.a, p.b, 0, if p.conflict { LinkMark::Conflict } else { LinkMark::Unoriented })
        });
        let cell = |value: &f64| value.is_finite().then_some(*value);
        let rows = |recording: &Array2<f64>| {
            recording.outer_iter().map(|row| row.iter().map(cell).collect()).collect()
        };
        let imposed =
            |marks: &Array2<bool>| marks.indexed_iter().filter(|(_, is)| **is).map(|(at, _)| at).collect();
        let numbers = |marks: &Vec<bool>| (0..).zip(marks).filter(|(_, is)| **is).map(|(t, _)| t).collect();
        let masked: Vec<Vec<usize>> = self.samples().masked.iter().map(numbers).collect();
        let member = |member: &super::structural::Member| MemberFile {
            equations: member.model.summaries.clone(),
            quality: member.quality.clone(),
        };
        let file = File {
            schema: SCHEMA.to_owned(),
            variables: self.graph().names().to_vec(),
            largest_lag: self.graph().largest_lag(),
            links: arrows.chain(pairs).collect(),
            settings: self.settings().clone(),
            facts: self.facts.clone(),
            members: self.members().iter().map(member).collect(),
            rows: self.samples().recordings().iter().map(rows).collect(),
            imposed: self.samples().imposed.iter().map(imposed).collect(),
            masked: if masked.iter().all(Vec::is_empty) { Vec::new() } else { masked },
        };
        // A struct of strings, numbers and lists always serialises.
        let mut json = serde_json::to_string(&file).unwrap_or_default();
        json.push('\n');
        json
    }

    /// Reads what [`StructuralModel::to_json`] wrote.
    ///
    /// # Errors
    /// Text of another layout, or parts that do not fit together.
    pub fn from_json(text: &str) -> Result<Self> {
        let broken = |reason: &dyn std::fmt::Display| {
            Error::Data(format!("this is not a structural model ({SCHEMA}): {reason}"))
        };
        check_nesting(text.as_bytes()).map_err(|e| broken(&e))?;
        let head: Head = serde_json::from_str(text).map_err(|e| broken(&reason_of(e)))?;
        let other = || format!("its schema is {}; fit it anew with this version", quoted(&head.schema));
        ensure(head.schema == SCHEMA, || broken(&other()))?;
        let file: File = serde_json::from_str(text).map_err(|e| broken(&reason_of(e)))?;
        file.check().map_err(|reason| broken(&reason))?;
        let n = file.variables.len();
        let find = |name: &str| {
            let position = file.variables.iter().position(|variable| variable == name);
            let reason = || format!("a link names {}, which is none of its variables", quoted(name));
            position.ok_or_else(|| broken(&reason()))
        };
        let (mut arrows, mut pairs) = (Vec::new(), Vec::new());
        for Link { cause, effect, lag, mark } in &file.links {
            let (cause, effect) = (find(cause)?, find(effect)?);
            match mark {
                LinkMark::Forward => arrows.push(Arrow { cause, effect, lag: *lag }),
                LinkMark::Unoriented | LinkMark::Conflict if *lag == 0 => {
                    pairs.push(Pair { a: cause, b: effect, conflict: *mark == LinkMark::Conflict })
                }
                mark => {
                    let mark = quoted(mark.symbol());
                    return Err(broken(&format!("{mark} at lag {lag} is not a mark of a link")));
                }
            }
        }
        let recording = |rows: &Vec<Vec<Option<f64>>>| {
            let values: Vec<f64> = rows.iter().flatten().map(|cell| cell.unwrap_or(f64::NAN)).collect();
            let whole = rows.iter().all(|row| row.len() == n);
            let shaped = if whole { Array2::from_shape_vec((rows.len(), n), values).ok() } else { None };
            shaped.ok_or_else(|| broken(&format!("a row has not {n} values")))
        };
        let values: Vec<Array2<f64>> = file.rows.iter().map(recording).collect::<Result<_>>()?;
        let marks = |(k, places): (usize, &Vec<(usize, usize)>)| {
            let mut marks = Array2::from_elem(values.get(k)?.dim(), false);
            for &place in places {
                *marks.get_mut(place)? = true;
            }
            Some(marks)
        };
        let imposed: Option<Vec<Array2<bool>>> = file.imposed.iter().enumerate().map(marks).collect();
        let masks = |(k, values): (usize, &Array2<f64>)| {
            let rows = file.masked.get(k).map_or(&[][..], Vec::as_slice);
            let mut marks = vec![false; if rows.is_empty() { 0 } else { values.nrows() }];
            for &row in rows {
                *marks.get_mut(row)? = true;
            }
            Some(marks)
        };
        let masked: Option<Vec<Vec<bool>>> = values.iter().enumerate().map(masks).collect();
        let samples =
            imposed.zip(masked).and_then(|(imposed, masked)| Samples::with_marks(values, imposed, masked));
        let samples = samples.ok_or_else(|| broken(&"its marks of rows do not match its rows"))?;
        let graph = Graph::new(file.variables, file.largest_lag, &arrows, &pairs)?;
        let processes =
            |member: &MemberFile| member.equations.iter().map(|equation| equation.process).collect();
        let kept = file.members.into_iter().map(|member| (processes(&member), member.quality));
        Self::restored(samples, graph, file.settings, file.facts, kept.collect())
    }
}
