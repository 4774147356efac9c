//! Granger causality.

use std::path::Path;

use ndarray::s;
use roscausal_discovery::{
    Control,
    methods::{GrangerSettings, run_granger},
};
use serde_json::{Value, json};

use crate::data::{count, frame, nested};

/// Runs one case.
pub(crate) fn run(case: &Value, set: &Path) -> Result<Value, String> {
    let data = frame(case, set)?;
    let settings = GrangerSettings { tau_max: count(case, "lags")?, ..GrangerSettings::default() };
    let result = run_granger(&data, &settings, &Control::default()).map_err(|e| e.to_string())?;
    let [aic, bic, hqic] = result.criteria;
    Ok(json!({
        "f_matrix": nested(result.f_matrix.view()),
        "fp_matrix": nested(result.fp_matrix.view()),
        "coef": nested(result.coef.slice(s![.., .., 1..])),
        "t_matrix": nested(result.t_matrix.slice(s![.., .., 1..])),
        "p_matrix": nested(result.p_matrix.slice(s![.., .., 1..])),
        "n_samples": result.links.samples[[0, 0, 1]].map(|samples| samples.used),
        "df": [result.df.0, result.df.1],
        "rss": result.rss,
        "aic": aic, "bic": bic, "hqic": hqic,
    }))
}
