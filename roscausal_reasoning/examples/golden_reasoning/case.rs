//! Reads a case: its input, its graph, its data.

use std::path::{Path, PathBuf};

use ndarray::Array2;
use roscausal_discovery::{DataFrame, Node};
use roscausal_reasoning::{
    Samples,
    graph::{Arrow, Graph, Pair},
};
use serde_json::Value;

pub(crate) type Answer<T> = Result<T, String>;

/// One case.
pub(crate) struct Case {
    set: PathBuf,
    pub(crate) kind: String,
    pub(crate) input: Value,
    /// Read for hyperparameters that are to be taken as given only.
    pub(crate) expected: Value,
}

/// Sorted names of the JSON files of a folder.
pub(crate) fn names(folder: &Path) -> Answer<Vec<String>> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.ends_with(".json"))
        .collect();
    names.sort();
    Ok(names)
}

impl Case {
    pub(crate) fn read(set: &Path, name: &str) -> Answer<Self> {
        let path = set.join("cases").join(name);
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let mut whole: Value = serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))?;
        let kind = whole["kind"].as_str().ok_or("a case without a kind")?.to_owned();
        Ok(Self {
            set: set.to_path_buf(),
            kind,
            input: whole["input"].take(),
            expected: whole["expected"].take(),
        })
    }

    /// Number of variables.
    pub(crate) fn n(&self) -> Answer<usize> {
        match self.input["names"].as_array() {
            Some(names) => Ok(names.len()),
            None => count(&self.input["n_vars"]),
        }
    }

    /// Names of the variables: the case's own, or `V0`, `V1`, ...
    pub(crate) fn variables(&self) -> Answer<Vec<String>> {
        let own = self.input["variables"].as_array().or(self.input["names"].as_array());
        match own {
            Some(names) => Ok(names.iter().filter_map(|name| name.as_str().map(str::to_owned)).collect()),
            None => Ok((0..self.n()?).map(|k| format!("V{k}")).collect()),
        }
    }

    pub(crate) fn arrows(&self) -> Answer<Vec<Arrow>> {
        let link = |link: &Value| {
            Ok(Arrow {
                cause: count(&link["cause"])?,
                effect: count(&link["effect"])?,
                lag: count(&link["lag"])?,
            })
        };
        list(&self.input["links"])?.iter().map(link).collect()
    }

    pub(crate) fn graph(&self) -> Answer<Graph> {
        let arrows = self.arrows()?;
        let pair = |pair: &Value| {
            Ok(Pair { a: count(&pair["a"])?, b: count(&pair["b"])?, conflict: pair["mark"] == "x-x" })
        };
        let none = Vec::new();
        let pairs: Vec<Pair> =
            self.input["unoriented"].as_array().unwrap_or(&none).iter().map(pair).collect::<Answer<_>>()?;
        let largest = arrows.iter().map(|arrow| arrow.lag).max().unwrap_or(0);
        let tau_max = self.input["tau_max"].as_u64().map_or(largest, |lag| lag as usize);
        Graph::new(self.variables()?, tau_max, &arrows, &pairs).map_err(|e| e.to_string())
    }

    /// The recordings, all columns.
    pub(crate) fn recordings(&self) -> Answer<Vec<Array2<f64>>> {
        match self.input["recordings"].as_array() {
            Some(paths) => paths.iter().map(|path| self.table(path)).collect(),
            None => Ok(vec![self.table(&self.input["data"])?]),
        }
    }

    /// The data as a frame with the graph's names.
    pub(crate) fn frame(&self) -> Answer<DataFrame> {
        DataFrame::new(self.recordings()?, self.variables()?).map_err(|e| e.to_string())
    }

    /// The data of the graph.
    pub(crate) fn samples(&self) -> Answer<Samples> {
        Samples::new(&self.frame()?, &self.graph()?, &Vec::new()).map_err(|e| e.to_string())
    }

    fn table(&self, path: &Value) -> Answer<Array2<f64>> {
        let path = self.set.join(path.as_str().ok_or("no data file")?);
        let fail = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
        let mut reader = csv::Reader::from_path(&path).map_err(|e| fail(&e))?;
        let header = reader.headers().map_err(|e| fail(&e))?.clone();
        let wanted = self.variables()?;
        // A column that is not a variable, such as the time, is left out.
        let is_variable = |name: &str| wanted.iter().any(|wanted| wanted == name);
        let all = !header.iter().any(is_variable);
        let kept: Vec<usize> = (0..header.len()).filter(|&k| all || is_variable(&header[k])).collect();
        let mut values = Vec::new();
        for record in reader.records() {
            let record = record.map_err(|e| fail(&e))?;
            for &column in &kept {
                values.push(record[column].parse::<f64>().map_err(|e| fail(&e))?);
            }
        }
        Array2::from_shape_vec((values.len() / kept.len(), kept.len()), values).map_err(|e| fail(&e))
    }
}

pub(crate) fn count(value: &Value) -> Answer<usize> {
    value.as_u64().map(|v| v as usize).ok_or_else(|| format!("{value} is not a count"))
}

pub(crate) fn number(value: &Value) -> Answer<f64> {
    value.as_f64().ok_or_else(|| format!("{value} is not a number"))
}

pub(crate) fn list(value: &Value) -> Answer<&Vec<Value>> {
    value.as_array().ok_or_else(|| format!("{value} is not a list"))
}

pub(crate) fn numbers(value: &Value) -> Answer<Vec<f64>> {
    list(value)?.iter().map(number).collect()
}

/// `[variable, -lag]`.
pub(crate) fn node(pair: &Value) -> Answer<Node> {
    match (pair[0].as_u64(), pair[1].as_i64()) {
        (Some(var), Some(lag)) => Ok(Node::new(var as usize, lag.unsigned_abs() as usize)),
        _ => Err(format!("{pair} is not a node")),
    }
}

pub(crate) fn nodes(pairs: &Value) -> Answer<Vec<Node>> {
    list(pairs)?.iter().map(node).collect()
}

/// Nodes as a case writes them.
pub(crate) fn written(nodes: &[Node]) -> Value {
    nodes.iter().map(|node| serde_json::json!([node.var, -(node.lag as i64)])).collect()
}

/// A matrix as nested lists.
pub(crate) fn matrix(values: &Array2<f64>) -> Value {
    values.outer_iter().map(|row| row.iter().copied().collect::<Value>()).collect()
}

/// Numbers in rows of `n`.
pub(crate) fn rows_of(values: &[f64], n: usize) -> Value {
    values.chunks_exact(n).map(|row| row.iter().copied().collect::<Value>()).collect()
}
