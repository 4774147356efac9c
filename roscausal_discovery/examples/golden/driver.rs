//! Reads golden cases, runs them, and returns the results in the same layout.

#[path = "csv_file.rs"]
mod csv_file;

use std::{path::Path, sync::Arc};

use ndarray::{Array2, Array3};
use roscausal_discovery::{
    CondIndTest, Control, DataFrame, LinkAssumptions, MaskType, Node, Samples,
    independence_tests::{self, Confidence, GpOptimum, NullDistributions, Significance, TestSettings},
    methods::{
        Fdr, FpcmciSettings, LpcmciSettings, PCMCIPLUS_ALPHAS, PcmciPlusSettings, PcmciResult, PcmciSettings,
        get_lagged_dependencies, run_bivci, run_fullci, run_lpcmci, run_mci, run_pc_stable, run_pcmci,
        run_pcmciplus,
    },
    transfer_entropy::Selected,
};
use serde_json::{Value, json};

pub(crate) use csv_file::read_csv;

type Answer<T> = Result<T, String>;

/// Folders of cases.
#[allow(dead_code, reason = "used by the example, not by the tests that share this file")]
pub(crate) const KINDS: [&str; 3] = ["cases", "single", "fpcmci"];

/// Sorted names of the JSON files in a folder; none if there is no folder.
pub(crate) fn files(folder: &Path) -> Answer<Vec<String>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.ends_with(".json"))
        .collect();
    names.sort();
    Ok(names)
}

/// The JSON of a file.
pub(crate) fn read_json(path: &Path) -> Answer<Value> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

/// Runs the case in `dir/kind/file`.
pub(crate) fn run_file(dir: &Path, kind: &str, file: &str) -> Answer<Value> {
    let case = read_json(&dir.join(kind).join(file))?;
    let result = match kind {
        "cases" => run_case(dir, &case)?,
        "single" => run_single(&case)?,
        _ => run_fpcmci(dir, &case)?,
    };
    Ok(json!({ "id": case["id"], "result": result }))
}

fn run_case(dir: &Path, case: &Value) -> Answer<Value> {
    let method = text(&case["method"])?;
    let (test, mask_type) = test_of(&case["test"])?;
    let data = data_of(dir, case, mask_type)?;
    let params = &case["params"];
    let settings = settings_of(params, method, data.n_vars())?;
    let control = Control::default();
    let (test, data) = (test.as_ref(), &data);
    let result = match method {
        "pcmci" => run_pcmci(data, test, &settings, &control),
        "pcmciplus" => run_pcmciplus(data, test, &settings, &plus_of(params)?, &control),
        "pc_stable" => run_pc_stable(data, test, &settings, &control),
        "fullci" => run_fullci(data, test, &settings, &control),
        "bivci" => run_bivci(data, test, &settings, &control),
        "lagged_dependencies" => get_lagged_dependencies(data, test, &settings, &control),
        "mci" => run_mci(data, test, &settings, &parents_of(&params["parents"], data.n_vars())?, &control),
        "lpcmci" => {
            let usual = LpcmciSettings::default();
            let pc_alpha = params["pc_alpha"].as_f64().unwrap_or(usual.pc_alpha);
            let PcmciSettings { tau_min, tau_max, .. } = settings;
            let lpcmci = LpcmciSettings { tau_min, tau_max, pc_alpha, ..usual };
            run_lpcmci(data, test, &lpcmci, &control).map(|found| {
                let mut result = found.result;
                // Where LPCMCI tests nothing the reference writes 0, we 1.
                (0..data.n_vars()).for_each(|i| result.p_matrix[[i, i, 0]] = 0.0);
                result
            })
        }
        other => return Err(format!("method '{other}' is not part of this engine")),
    }
    .map_err(|e| e.to_string())?;
    let mut answer = answer_of(method, &result);
    if let ("pcmciplus", true, Some(&last)) =
        (method, result.optimal_alpha.is_some(), levels(&settings).last())
    {
        // The reference lists the parents of the level that it tried last; we list those of the chosen level.
        let settings = PcmciSettings { pc_alpha: vec![last], ..settings };
        let result = run_pc_stable(data, test, &settings, &control).map_err(|e| e.to_string())?;
        answer["all_parents"] = answer_of("pc_stable", &result)["all_parents"].take();
    }
    Ok(answer)
}

fn levels(settings: &PcmciSettings) -> &[f64] {
    if settings.pc_alpha.is_empty() { &PCMCIPLUS_ALPHAS } else { &settings.pc_alpha }
}

fn plus_of(params: &Value) -> Answer<PcmciPlusSettings> {
    let mut plus = PcmciPlusSettings::default();
    if let Some(rule) = params["contemp_collider_rule"].as_str() {
        plus.contemp_collider_rule = rule.parse().map_err(|e: roscausal_discovery::Error| e.to_string())?;
    }
    plus.conflict_resolution = params["conflict_resolution"].as_bool().unwrap_or(plus.conflict_resolution);
    plus.reset_lagged_links = params["reset_lagged_links"].as_bool().unwrap_or(plus.reset_lagged_links);
    Ok(plus)
}

/// Runs the single test of a case whose X, Y and nodes of Z are vectors: `x[sample][component]`, `z[sample][component]` with the
/// number of components of each node in `z_dims`.
fn run_vectors(case: &Value, test: &dyn CondIndTest) -> Answer<Value> {
    let rows = |value: &Value| -> Answer<Vec<Vec<f64>>> {
        value.as_array().into_iter().flatten().map(numbers).collect()
    };
    let (x, y, z) = (rows(&case["x"])?, rows(&case["y"])?, rows(&case["z"])?);
    let mut dims = vec![x[0].len(), y[0].len()];
    dims.extend(
        case["z_dims"].as_array().into_iter().flatten().filter_map(Value::as_u64).map(|d| d as usize),
    );
    let joined: Vec<f64> = (0..x.len())
        .flat_map(|t| [x.get(t), y.get(t), z.get(t)].into_iter().flatten().flatten().copied())
        .collect();
    let n_columns = dims.iter().sum();
    let values = Array2::from_shape_vec((x.len(), n_columns), joined).map_err(|e| e.to_string())?;
    let names = (0..n_columns).map(|k| format!("V{k}")).collect();
    let mut first = 0;
    let groups: Vec<(String, Vec<usize>)> = dims
        .iter()
        .enumerate()
        .map(|(k, dim)| {
            first += dim;
            (format!("N{k}"), (first - dim..first).collect())
        })
        .collect();
    let data = DataFrame::new(vec![values], names).and_then(|data| data.with_vectors(&groups));
    let data = data.map_err(|e| e.to_string())?;
    let samples = Samples::new(&data, 0);
    let conditions: Vec<Node> = (2..dims.len()).map(|k| Node::new(k, 0)).collect();
    let result = test
        .prepare(&samples)
        .and_then(|prepared| prepared.run_test(Node::new(0, 0), Node::new(1, 0), &conditions))
        .map_err(|e| e.to_string())?;
    Ok(json!({ "val": result.value, "pval": result.p_value }))
}

/// Runs the single test of a case.
pub(crate) fn run_single(case: &Value) -> Answer<Value> {
    let (test, _) = test_of(&case["test"])?;
    if case["x"][0].is_array() {
        return run_vectors(case, test.as_ref());
    }
    let (x, y) = (numbers(&case["x"])?, numbers(&case["y"])?);
    let z: Vec<Vec<f64>> = match &case["z"] {
        Value::Null => Vec::new(),
        rows => rows.as_array().ok_or("z is not a list")?.iter().map(numbers).collect::<Answer<_>>()?,
    };
    let dz = z.first().map_or(0, Vec::len);
    let values = Array2::from_shape_fn((x.len(), 2 + dz), |(t, k)| match k {
        0 => x[t],
        1 => y[t],
        k => z[t][k - 2],
    });
    let names = (0..2 + dz).map(|k| format!("V{k}")).collect();
    let data = DataFrame::new(vec![values], names).map_err(|e| e.to_string())?;
    let samples = Samples::new(&data, 0);
    let conditions: Vec<Node> = (2..2 + dz).map(|k| Node::new(k, 0)).collect();
    let result = test
        .prepare(&samples)
        .and_then(|prepared| prepared.run_test(Node::new(0, 0), Node::new(1, 0), &conditions))
        .map_err(|e| e.to_string())?;
    let threshold = case["result"]["alpha_or_thres"].as_f64().unwrap_or(0.03);
    let dependent = test.decides_by_value().then(|| result.value.abs() >= threshold);
    let p_value = dependent.map_or(result.p_value, |d| if d { 0.0 } else { 1.0 });
    let mut answer = json!({ "val": result.value, "pval": p_value, "dependent": dependent,
                             "confidence": result.confidence.map(|(low, high)| [low, high]) });
    for (side, target) in [("gp_x", &x), ("gp_y", &y)] {
        if case["result"][side].is_object() {
            answer[side] = optimum(target, &z)?;
        }
    }
    Ok(answer)
}

/// Where a GPDC test's regression of `target` on the conditions `z[sample][dimension]` ends.
fn optimum(target: &[f64], z: &[Vec<f64>]) -> Answer<Value> {
    let rows: Vec<Vec<f64>> =
        (0..z.first().map_or(0, Vec::len)).map(|k| z.iter().map(|sample| sample[k]).collect()).collect();
    let found = GpOptimum::find(target, &rows, &TestSettings::default()).map_err(|e| e.to_string())?;
    Ok(json!({ "rbf_length_scale": found.length_scale, "white_noise_level": found.noise,
               "log_marginal_likelihood": found.log_likelihood }))
}

/// PCMCI, alone or after the transfer-entropy filter, with the matrices as in the ROS message.
fn run_fpcmci(dir: &Path, case: &Value) -> Answer<Value> {
    let params = &case["params"];
    let (test, _) = test_of(&case["test"])?;
    let case_data = json!({ "csv": [case["csv"]] });
    let data = data_of(dir, &case_data, MaskType::default())?;
    let pcmci = PcmciSettings {
        tau_min: count(&params["min_lag"])?.unwrap_or(1),
        tau_max: count(&params["max_lag"])?.unwrap_or(1),
        alpha_level: params["pcmci_alpha"].as_f64().unwrap_or(0.05),
        pc_alpha: vec![params["pc_alpha"].as_f64().unwrap_or(0.2)],
        ..PcmciSettings::default()
    };
    let (tau_min, control) = (pcmci.tau_min, Control::default());
    let neglect = params["neglect_only_autodep"].as_bool().unwrap_or(true);
    let names = data.var_names();
    let named = |vars: &[usize]| vars.iter().map(|&var| names[var].clone()).collect::<Vec<_>>();
    if case["mode"] == "pcmci" {
        let result = run_pcmci(&data, test.as_ref(), &pcmci, &control).map_err(|e| e.to_string())?;
        let features = result.connected_features(neglect);
        let mut answer = model_of(&result.on_features(&features), tau_min);
        answer["features"] = json!(named(&features));
        answer["pcmci_on_selected"] = answer_of("pcmci", &result);
        return Ok(answer);
    }
    let settings = FpcmciSettings {
        te_estimator: params["te_estimator"]
            .as_str()
            .unwrap_or("gaussian")
            .parse()
            .map_err(|e: roscausal_discovery::Error| e.to_string())?,
        f_alpha: params["f_alpha"].as_f64().unwrap_or(0.05),
        neglect_only_autodep: neglect,
        pcmci,
        ..FpcmciSettings::default()
    };
    let result = roscausal_discovery::methods::run_fpcmci(&data, test.as_ref(), &settings, &control)
        .map_err(|e| e.to_string())?;
    let Some(pcmci) = &result.pcmci else { return Ok(json!({ "features": null })) };
    let position = |var: &usize| result.selected.iter().position(|s| s == var);
    let kept: Vec<usize> = result.features.iter().filter_map(position).collect();
    let mut answer = model_of(&pcmci.on_features(&kept), tau_min);
    answer["features"] = json!(named(&result.features));
    answer["selected_features"] = json!(named(&result.selected));
    answer["pcmci_on_selected"] = answer_of("pcmci", pcmci);
    answer["filter"] = json!({});
    for target in result.filter.iter().flat_map(|filter| &filter.targets) {
        let source = |s: &Selected| json!({ "cause": names[s.source.var], "lag": s.source.lag, "score_nats": s.value, "pval": s.p_value });
        answer["filter"][&names[target.target]] = target.selected().map(source).collect();
    }
    answer["link_assumptions"] = (0..result.selected.len())
        .flat_map(|effect| result.link_assumptions.of_target(effect).map(move |(node, a)| (effect, node, a)))
        .map(|(effect, node, a)| {
            json!({ "effect": names[result.selected[effect]], "cause": names[result.selected[node.var]],
                    "lag": node.lag, "type": a.symbol() })
        })
        .collect();
    Ok(answer)
}

/// The matrices of the ROS message, nested and flat: `[lag - tau_min][effect][cause]`, 0 where there is no link.
fn model_of(result: &PcmciResult, tau_min: usize) -> Value {
    let (n, _, n_lags) = result.graph.dim();
    let shape = (n_lags.saturating_sub(tau_min), n, n);
    let is_link = |(lag, effect, cause): (usize, usize, usize)| {
        !matches!(result.graph[[cause, effect, lag + tau_min]].symbol(), "" | "<--")
    };
    let of = |matrix: &Array3<f64>| {
        let value = |at: (usize, usize, usize)| {
            if is_link(at) { matrix[[at.2, at.1, at.0 + tau_min]] } else { 0.0 }
        };
        Array3::from_shape_fn(shape, value)
    };
    let structure = Array3::from_shape_fn(shape, |at| i32::from(is_link(at)));
    let (values, p_values) = (of(&result.val_matrix), of(result.deciding_p()));
    json!({
        "causal_structure": nested(&structure, |v| json!(v)),
        "val_matrix": nested(&values, |v| json!(v)),
        "pval_matrix": nested(&p_values, |v| json!(v)),
        "original_shape": structure.shape(),
        "causal_structure_flat_int32": structure.iter().collect::<Vec<_>>(),
        "val_matrix_flat": values.iter().collect::<Vec<_>>(),
        "pval_matrix_flat": p_values.iter().collect::<Vec<_>>(),
    })
}

/// A result in the layout of the reference.
fn answer_of(method: &str, result: &PcmciResult) -> Value {
    let parents = |of: &dyn Fn(&Node) -> Value| -> Value {
        let list = |k: usize| result.parents[k].parents.iter().map(of).collect::<Vec<_>>();
        (0..result.parents.len())
            .map(|k| (k.to_string(), Value::from(list(k))))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    let mut answer =
        json!({ "all_parents": parents(&|n| json!([n.var, -(n.lag as i64)])), "n_tests": result.n_tests });
    if method != "pc_stable" {
        answer["graph"] = nested(&result.graph, |mark| json!(mark.symbol()));
        answer["val_matrix"] = nested(&result.val_matrix, |v| json!(v));
        answer["p_matrix"] = nested(result.deciding_p(), |p| json!(p));
    }
    if let Some(conf) = &result.conf_matrix {
        answer["conf_matrix"] =
            nested(conf, |c| c.map_or(json!([0.0, 0.0]), |(low, high)| json!([low, high])));
    }
    answer["optimal_pc_alpha"] = result.parents.iter().map(|p| json!(p.optimal_pc_alpha)).collect();
    answer["optimal_alpha"] = json!(result.optimal_alpha);
    answer
}

fn nested<T>(matrix: &Array3<T>, cell: impl Fn(&T) -> Value) -> Value {
    let row = |plane: ndarray::ArrayView2<'_, T>| -> Value {
        plane.outer_iter().map(|lags| lags.iter().map(&cell).collect::<Value>()).collect()
    };
    matrix.outer_iter().map(row).collect()
}

/// The test of a case and its mask type.
fn test_of(spec: &Value) -> Answer<(Box<dyn CondIndTest>, MaskType)> {
    let mut settings = TestSettings { as_tigramite: true, ..TestSettings::default() };
    let mut mask_type = MaskType::default();
    let none = serde_json::Map::new();
    for (name, value) in spec["kwargs"].as_object().unwrap_or(&none) {
        match name.as_str() {
            "significance" => {
                settings.significance = Some(match text(value)? {
                    "analytic" => Significance::Analytic,
                    "shuffle_test" => Significance::ShuffleTest,
                    "fixed_thres" => Significance::FixedThres,
                    other => return Err(format!("significance '{other}' is unknown")),
                });
            }
            "confidence" => {
                settings.confidence = match value.as_str() {
                    None => None,
                    Some("analytic") => Some(Confidence::Analytic),
                    Some("bootstrap") => Some(Confidence::Bootstrap),
                    Some(other) => return Err(format!("confidence '{other}' is unknown")),
                };
            }
            "mask_type" => {
                if let Some(letters) = value.as_str() {
                    mask_type = letters.parse().map_err(|e: roscausal_discovery::Error| e.to_string())?;
                }
            }
            "sig_samples" => settings.sig_samples = count(value)?,
            "sig_blocklength" => settings.sig_blocklength = count(value)?,
            "conf_lev" => settings.conf_lev = value.as_f64().unwrap_or(settings.conf_lev),
            "conf_samples" => settings.conf_samples = count(value)?.unwrap_or(settings.conf_samples),
            "conf_blocklength" => settings.conf_blocklength = count(value)?,
            "seed" => settings.seed = value.as_u64().unwrap_or(settings.seed),
            "knn" => settings.knn = value.as_f64().unwrap_or(settings.knn),
            "shuffle_neighbors" => {
                settings.shuffle_neighbors = count(value)?.unwrap_or(settings.shuffle_neighbors);
            }
            "transform" => settings.transform = value.as_str().unwrap_or("none").to_owned(),
            "null_distributions" => {
                let of_size = |(size, values): (&String, &Value)| {
                    Ok((size.parse::<usize>().map_err(|e| e.to_string())?, numbers(values)?))
                };
                let given = value.as_object().ok_or("null distributions are not an object")?;
                let given = given.iter().map(of_size).collect::<Answer<Vec<_>>>()?;
                let given = NullDistributions::new(given).map_err(|e| e.to_string())?;
                settings.null_distributions = Some(Arc::new(given));
            }
            "gp_search" => {
                settings.gp_search =
                    text(value)?.parse().map_err(|e: roscausal_discovery::Error| e.to_string())?;
            }
            "as_tigramite" => settings.as_tigramite = value.as_bool().unwrap_or(true),
            "workers" | "verbosity" | "recycle_residuals" => {}
            other => return Err(format!("option '{other}' of the test is unknown")),
        }
    }
    let test = independence_tests::by_name(text(&spec["name"])?, &settings).map_err(|e| e.to_string())?;
    Ok((test, mask_type))
}

fn data_of(dir: &Path, case: &Value, mask_type: MaskType) -> Answer<DataFrame> {
    let paths = |value: &Value| -> Vec<String> {
        match value {
            Value::String(path) => vec![path.clone()],
            Value::Array(paths) => paths.iter().filter_map(|p| p.as_str().map(str::to_owned)).collect(),
            _ => Vec::new(),
        }
    };
    let tables: Vec<_> = paths(&case["csv"]).iter().map(|p| read_csv(&dir.join(p))).collect::<Answer<_>>()?;
    let names = tables.first().ok_or("no data file")?.0.clone();
    let masks: Vec<_> = paths(&case["mask"]).iter().map(|p| read_csv(&dir.join(p))).collect::<Answer<_>>()?;
    let flag = case["missing_flag"].as_f64();
    let seen = |value: f64| if Some(value) == flag { f64::NAN } else { value };
    let tables = tables.into_iter().map(|(_, values)| values.mapv(seen)).collect();
    let mut data = DataFrame::new(tables, names).map_err(|e| e.to_string())?;
    if !masks.is_empty() {
        let masks = masks.into_iter().map(|(_, table)| table.mapv(|v| v != 0.0)).collect();
        data = data.with_mask(masks, mask_type).map_err(|e| e.to_string())?;
    }
    let remove = case["dataframe"]["remove_missing_upto_maxlag"].as_bool().unwrap_or(false);
    Ok(data.with_remove_missing_upto_maxlag(remove))
}

fn settings_of(params: &Value, method: &str, n_vars: usize) -> Answer<PcmciSettings> {
    let plus = method == "pcmciplus";
    let default_min = usize::from(method == "pc_stable");
    let pc_alpha = match &params["pc_alpha"] {
        Value::Null if params.get("pc_alpha").is_none() => vec![if plus { 0.01 } else { 0.2 }],
        Value::Null => Vec::new(),
        Value::Array(list) => list.iter().filter_map(Value::as_f64).collect(),
        one => vec![one.as_f64().ok_or("pc_alpha is not a number")?],
    };
    let link_assumptions = match &params["link_assumptions"] {
        Value::Null => None,
        given => {
            let mut links = LinkAssumptions::none(n_vars);
            for link in given["links"].as_array().ok_or("link_assumptions has no links")? {
                let index = |name: &str| count(&link[name])?.ok_or(format!("a link has no {name}"));
                let assumption =
                    text(&link["type"])?.parse().map_err(|e: roscausal_discovery::Error| e.to_string())?;
                links
                    .insert(index("cause")?, index("effect")?, index("lag")?, assumption)
                    .map_err(|e| e.to_string())?;
            }
            Some(links)
        }
    };
    Ok(PcmciSettings {
        tau_min: count(&params["tau_min"])?.unwrap_or(default_min),
        tau_max: count(&params["tau_max"])?.unwrap_or(1),
        pc_alpha,
        alpha_level: params["alpha_level"].as_f64().unwrap_or(0.05),
        max_conds_dim: count(&params["max_conds_dim"])?,
        max_combinations: count(&params["max_combinations"])?.unwrap_or(1),
        max_conds_py: count(&params["max_conds_py"])?,
        max_conds_px: count(&params["max_conds_px"])?,
        max_conds_px_lagged: count(&params["max_conds_px_lagged"])?,
        fdr: match params["fdr_method"].as_str() {
            None | Some("none") => Fdr::None,
            Some("fdr_bh") => Fdr::BhLagged,
            Some(other) => return Err(format!("fdr_method '{other}' is unknown")),
        },
        link_assumptions,
    })
}

fn parents_of(parents: &Value, n_vars: usize) -> Answer<Vec<Vec<Node>>> {
    let none = Vec::new();
    (0..n_vars)
        .map(|j| parents[j.to_string()].as_array().unwrap_or(&none).iter().map(node_of).collect())
        .collect()
}

fn node_of(pair: &Value) -> Answer<Node> {
    match (pair[0].as_u64(), pair[1].as_i64()) {
        (Some(var), Some(lag)) => Ok(Node::new(var as usize, lag.unsigned_abs() as usize)),
        _ => Err(format!("{pair} is not a node")),
    }
}

fn text(value: &Value) -> Answer<&str> {
    value.as_str().ok_or_else(|| format!("{value} is not a text"))
}

fn count(value: &Value) -> Answer<Option<usize>> {
    match value {
        Value::Null => Ok(None),
        value => value.as_u64().map(|v| Some(v as usize)).ok_or_else(|| format!("{value} is not a count")),
    }
}

fn numbers(value: &Value) -> Answer<Vec<f64>> {
    let cell = |v: &Value| v.as_f64().or_else(|| (v == "NaN").then_some(f64::NAN));
    let list = value.as_array().ok_or("not a list of numbers")?;
    list.iter().map(|v| cell(v).ok_or_else(|| format!("{v} is not a number"))).collect()
}

/// Runs single tests `[X, Y, Z, ..]` on the data of a case. Returns value and p-value of each.
#[allow(dead_code, reason = "used by the test that shares this file with the example")]
pub(crate) fn run_tests(dir: &Path, case: &Value, tests: &[&Value]) -> Answer<Vec<(f64, f64)>> {
    let (test, mask_type) = test_of(&case["test"])?;
    let data = data_of(dir, case, mask_type)?;
    let tau_max = count(&case["params"]["tau_max"])?.unwrap_or(1);
    let samples = Samples::new(&data, 2 * tau_max);
    let prepared = test.prepare(&samples).map_err(|e| e.to_string())?;
    let run = |spec: &&Value| {
        let z: Vec<Node> = spec[2].as_array().ok_or("no Z")?.iter().map(node_of).collect::<Answer<_>>()?;
        let result =
            prepared.run_test(node_of(&spec[0])?, node_of(&spec[1])?, &z).map_err(|e| e.to_string())?;
        Ok((result.value, result.p_value))
    };
    tests.iter().map(run).collect()
}
