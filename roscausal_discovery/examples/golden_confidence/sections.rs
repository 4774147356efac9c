//! The sections of the comparison, one function each.

use std::{fs, path::Path};

use roscausal_discovery::{
    Control, DataFrame, Model, PcAlpha, Settings,
    changes::{Detector, Form, Levels},
    confidence::{Resampling, Scheme, analyse_resampled, bootstrap_rows},
    rolling::{Windows, roll},
};
use serde_json::{Value, json};

use crate::csv_file::read_csv;

type Done = Result<(), String>;
type Section = fn(&Path, &Path) -> Done;

/// All sections by name.
pub(crate) const ALL: [(&str, Section); 6] = [
    ("draws", draws),
    ("boot", boot),
    ("window", window),
    ("calibration", calibration),
    ("changes", changes),
    ("power", power),
];

fn json_of(path: &Path) -> Result<Value, String> {
    let text = fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

fn write(path: &Path, text: &str) -> Done {
    let fail = |e: std::io::Error| format!("{}: {e}", path.display());
    path.parent().map_or(Ok(()), fs::create_dir_all).map_err(fail)?;
    fs::write(path, text).map_err(fail)
}

fn number(value: &Value, name: &str) -> Result<usize, String> {
    let number = value[name].as_u64().ok_or_else(|| format!("'{name}' is not a number"))?;
    usize::try_from(number).map_err(|e| e.to_string())
}

fn draws(set: &Path, out: &Path) -> Done {
    let cases = json_of(&set.join("draws.json"))?;
    let mut ours = Vec::new();
    for case in cases.as_array().ok_or("draws.json is not a list")? {
        let seed = case["seed"].as_u64().ok_or("'seed' is not a number")?;
        let (b, n) = (number(case, "resample")?, number(case, "rows")?);
        let rows = bootstrap_rows(seed, b, n, number(case, "block")?);
        ours.push(json!({ "first": rows[..24.min(rows.len())], "sum": rows.iter().sum::<usize>() }));
    }
    write(&out.join("draws.json"), &Value::from(ours).to_string())
}

/// A table, or the tables `NAME_1`, `NAME_2` .. of one system.
fn data_of(folder: &Path, name: &str) -> Result<DataFrame, String> {
    let one = folder.join(format!("{name}.csv"));
    let several = (1..).map(|k| folder.join(format!("{name}_{k}.csv"))).take_while(|path| path.exists());
    let paths: Vec<_> = if one.exists() { vec![one] } else { several.collect() };
    let tables = paths.iter().map(|path| read_csv(path)).collect::<Result<Vec<_>, _>>()?;
    let names = tables.first().ok_or_else(|| format!("{name}: no table"))?.0.clone();
    DataFrame::new(tables.into_iter().map(|table| table.1).collect(), names).map_err(|e| e.to_string())
}

fn model_of(data: &DataFrame, settings: &Settings, resampling: &Resampling) -> Result<Model, String> {
    analyse_resampled(data, settings, resampling, &Control::default()).map_err(|e| e.to_string())
}

fn boot(set: &Path, out: &Path) -> Done {
    let folder = set.join("boot");
    for entry in fs::read_dir(&folder).map_err(|e| e.to_string())? {
        let path = entry.map_err(|e| e.to_string())?.path();
        let Some(case) = path.file_name().and_then(|n| n.to_str()).and_then(|n| n.strip_suffix(".json"))
        else {
            continue;
        };
        let reference = json_of(&path)?;
        let text =
            |name: &str| reference[name].as_str().ok_or_else(|| format!("{case}: '{name}' is not text"));
        let level = |name: &str| reference[name].as_f64().ok_or_else(|| format!("{case}: no '{name}'"));
        let data = data_of(&folder, text("system")?)?;
        let settings = Settings {
            method: text("method")?.parse().map_err(|e: roscausal_discovery::Error| e.to_string())?,
            cond_ind_test: text("test")?.into(),
            tau_min: number(&reference, "tau_min")?,
            tau_max: number(&reference, "tau_max")?,
            pc_alpha: PcAlpha::Fixed(level("pc_alpha")?),
            alpha: level("alpha")?,
            seed: reference["seed"].as_u64().unwrap_or(42),
            ..Settings::default()
        };
        let block = reference["block"].to_string().replace('"', "");
        let resampling = Resampling {
            resamples: number(&reference, "resamples")?,
            scheme: Scheme::Bootstrap,
            block: block.parse().map_err(|e: roscausal_discovery::Error| format!("{case}: {e}"))?,
            ..Resampling::default()
        };
        let model = model_of(&data, &settings, &resampling)?;
        write(&out.join("boot").join(format!("{case}.json")), &model.to_json())?;
        for share in ["0.5", "0.632"] {
            if reference.get(format!("subsample_{share}")).is_some() {
                let number = share.parse().map_err(|_| "no share")?;
                let subsample = Resampling { scheme: Scheme::Subsample, share: number, ..resampling.clone() };
                let name = format!("{}_{}_sub{share}.json", text("system")?, text("test")?);
                write(&out.join("boot").join(name), &model_of(&data, &settings, &subsample)?.to_json())?;
            }
        }
    }
    Ok(())
}

fn window(set: &Path, out: &Path) -> Done {
    for entry in fs::read_dir(set.join("window")).map_err(|e| e.to_string())? {
        let path = entry.map_err(|e| e.to_string())?.path();
        let reference = json_of(&path)?;
        let text = |name: &str| reference[name].as_str().ok_or_else(|| format!("'{name}' is not text"));
        let data = data_of(&set.join("boot"), text("system")?)?;
        let settings = Settings {
            cond_ind_test: text("test")?.into(),
            tau_min: number(&reference, "tau_min")?,
            ..usual(number(&reference, "tau_max")?)
        };
        let windows =
            Windows { length: number(&reference, "window")?, step: number(&reference, "step")?, last: false };
        let mut ours = Vec::new();
        roll(&data, &settings, &windows, &Control::default(), |window| {
            ours.push(json!(window));
            Ok(())
        })
        .map_err(|e| e.to_string())?;
        let name = path.file_name().unwrap_or_default();
        write(&out.join("window").join(name), &json!({ "windows": ours }).to_string())?;
    }
    Ok(())
}

/// What the page says of both sets of small systems: PCMCI with ParCorr.
fn usual(tau_max: usize) -> Settings {
    Settings {
        method: roscausal_discovery::methods::Method::Pcmci,
        cond_ind_test: "parcorr".into(),
        tau_max,
        ..Settings::default()
    }
}

fn each_system(set: &Path, out: &Path, section: &str, resampling: &Resampling) -> Done {
    let truth = json_of(&set.join(section).join("truth.json"))?;
    for name in truth.as_object().ok_or("truth.json is not an object")?.keys() {
        let data = data_of(&set.join(section).join("data"), name)?;
        let model = model_of(&data, &usual(2), resampling)?;
        write(&out.join(section).join(format!("{name}.json")), &model.to_json())?;
    }
    Ok(())
}

/// Rows of a part that the detector reads at a time, unless the number of variables asks for more.
const CHANGE_ROWS: usize = 150;

/// The names of the nonlinear systems begin with `n`; curves are compared there.
fn changes(set: &Path, out: &Path) -> Done {
    let truth = json_of(&set.join("changes/truth.json"))?;
    for name in truth.as_object().ok_or("truth.json is not an object")?.keys() {
        let data = data_of(&set.join("changes/data"), name)?;
        let form = if name.starts_with('n') { Form::Curve } else { Form::Slope };
        let detector =
            Detector::new(data.var_names().to_vec(), 2, &[], Levels::default()).map_err(|e| e.to_string())?;
        let mut detector = detector.of_form(form);
        let rows = CHANGE_ROWS.max(detector.fewest_rows());
        let mut events = Vec::new();
        for recording in data.recordings() {
            let reported = detector.read_in_parts(recording.view(), &[], rows, &Control::default());
            events.extend(reported.map_err(|e| format!("{name}: {e}"))?);
        }
        write(&out.join("changes").join(format!("{name}.json")), &json!({ "events": events }).to_string())?;
    }
    Ok(())
}

fn calibration(set: &Path, out: &Path) -> Done {
    each_system(set, out, "calibration", &Resampling::default())
}

fn power(set: &Path, out: &Path) -> Done {
    each_system(set, out, "power", &Resampling { resamples: 1000, ..Resampling::default() })
}
