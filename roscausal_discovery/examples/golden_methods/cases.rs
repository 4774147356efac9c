//! Reads cases: their data, independence test, link assumptions; writes matrices.

use std::path::Path;

use ndarray::{Array2, Array3, Axis, concatenate};
use roscausal_discovery::{
    Assumption, CondIndTest, DataFrame, Dummy, LinkAssumptions, Node, PreparedTest, Result as Found, Samples,
    TestResult,
    independence_tests::{self, OracleCi, TestSettings},
};
use serde_json::Value;

pub(crate) use super::data::read_csv;

pub(crate) type Answer<T> = Result<T, String>;

pub(crate) fn count(value: &Value) -> Option<usize> {
    value.as_u64().map(|v| v as usize)
}

/// The recordings of a case; `joined`: as one. An oracle's case has none: then 50 rows of zeros.
pub(crate) fn data_of(case: &Value, set: &Path, joined: bool) -> Answer<DataFrame> {
    if !case["oracle"].is_null() {
        let n = case["oracle"]["observed"].as_array().map_or(0, Vec::len);
        let names = (0..n).map(|var| format!("V{var}")).collect();
        return DataFrame::new(vec![Array2::zeros((50, n))], names).map_err(|e| e.to_string());
    }
    let files: Vec<&str> = case["csv"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let tables = files.iter().map(|file| read_csv(&set.join(file))).collect::<Answer<Vec<_>>>()?;
    let names = tables.first().ok_or("no data file")?.0.clone();
    let mut recordings: Vec<Array2<f64>> = tables.into_iter().map(|(_, table)| table).collect();
    if joined {
        let views: Vec<_> = recordings.iter().map(|table| table.view()).collect();
        recordings = vec![concatenate(Axis(0), &views).map_err(|e| e.to_string())?];
    }
    DataFrame::new(recordings, names).map_err(|e| e.to_string())
}

/// The test of a case, by its name there.
pub(crate) fn test_of(case: &Value) -> Answer<Box<dyn CondIndTest>> {
    if !case["oracle"].is_null() {
        return Ok(Box::new(Observed::new(&case["oracle"])?));
    }
    let name = case["test"]["name"].as_str().ok_or("no test")?;
    // The vector test is what J-PCMCI+ makes of this one.
    let name = if name == "ParCorrMult" { "parcorr" } else { name };
    let settings = TestSettings { as_tigramite: true, ..TestSettings::default() };
    independence_tests::by_name(name, &settings).map_err(|e| e.to_string())
}

/// The link assumptions of a case; a link not listed is absent.
pub(crate) fn assumptions(list: &Value, n_vars: usize) -> Answer<Option<LinkAssumptions>> {
    let Some(list) = list.as_array() else { return Ok(None) };
    let mut links = LinkAssumptions::none(n_vars);
    for link in list {
        let at = |name: &str| count(&link[name]).ok_or(format!("a link has no {name}"));
        let assumption: Assumption = link["type"]
            .as_str()
            .unwrap_or_default()
            .parse()
            .map_err(|e: roscausal_discovery::Error| e.to_string())?;
        links.insert(at("cause")?, at("effect")?, at("lag")?, assumption).map_err(|e| e.to_string())?;
    }
    Ok(Some(links))
}

pub(crate) fn nested<T>(matrix: &Array3<T>, cell: impl Fn(&T) -> Value) -> Value {
    let row = |plane: ndarray::ArrayView2<'_, T>| -> Value {
        plane.outer_iter().map(|lags| lags.iter().map(&cell).collect::<Value>()).collect()
    };
    matrix.outer_iter().map(row).collect()
}

/// An oracle that answers for some of the variables of its graph.
#[derive(Clone)]
struct Observed {
    oracle: OracleCi,
    observed: Vec<usize>,
}

impl Observed {
    fn new(spec: &Value) -> Answer<Self> {
        let n_vars = count(&spec["n_vars"]).ok_or("no n_vars")?;
        let mut truth = LinkAssumptions::none(n_vars);
        for link in spec["links"].as_array().into_iter().flatten() {
            let at = |name: &str| count(&link[name]).ok_or(format!("a link has no {name}"));
            truth
                .insert(at("cause")?, at("effect")?, at("lag")?, Assumption::Exists)
                .map_err(|e| e.to_string())?;
        }
        let observed = spec["observed"].as_array().into_iter().flatten().filter_map(count).collect();
        Ok(Self { oracle: OracleCi::new(&truth).map_err(|e| e.to_string())?, observed })
    }
}

impl CondIndTest for Observed {
    fn name(&self) -> &'static str {
        "oracle"
    }

    /// It knows dummies as further variables.
    fn with_dummies(&self, _: &[Dummy]) -> Found<Box<dyn CondIndTest + '_>> {
        Ok(Box::new(self.clone()))
    }

    fn prepare<'a>(&'a self, _: &'a Samples<'a>) -> Found<Box<dyn PreparedTest + 'a>> {
        Ok(Box::new(self))
    }
}

impl PreparedTest for &Observed {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Found<TestResult> {
        let full = |node: &Node| Node::new(self.observed[node.var], node.lag);
        let z: Vec<Node> = z.iter().map(full).collect();
        let separated = self.oracle.is_separated(full(&x), full(&y), &z);
        let (value, p_value) = if separated { (0.0, 1.0) } else { (1.0, 0.0) };
        Ok(TestResult { value, p_value, confidence: None, n_samples: 0, n_lost: 0, dependent: None })
    }

    fn is_cheap(&self) -> bool {
        true
    }
}
