//! Runs one analysis and prints its cost as one line of JSON, for side-by-side measurements.
//!
//! `bench_case METHOD TEST CSV TAU_MIN TAU_MAX [THREADS [SCHEME RESAMPLES]]`: METHOD is any of `roscausal methods`; TEST is `none` for
//! one that asks none; SCHEME is how rows are drawn.
//! Rows with different numbers in a column `recording` are recordings of their own; a column `do_X` is an intervention on `X`. CPU seconds
//! are those of the analysis in all threads of this process, without reading the file. Peak memory is that of the
//! process.

#[path = "golden/csv_file.rs"]
mod csv_file;

use std::{fs, path::Path, process::ExitCode, time::Instant};

use roscausal_discovery::{
    Control, DataFrame, Settings, analyse,
    confidence::{Resampling, analyse_resampled},
    independence_tests::{TestSettings, by_name},
    methods::{
        FpcmciSettings, Intervened, LpcmciSettings, Method, PcmciPlusSettings, PcmciResult, PcmciSettings,
        run_candoit, run_fpcmci, run_pcmci, run_pcmciplus,
    },
    transfer_entropy::TeEstimator,
};

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (5 | 6 | 8) = args.len() else {
        eprintln!("usage: bench_case METHOD TEST CSV TAU_MIN TAU_MAX [THREADS [SCHEME RESAMPLES]]");
        return ExitCode::from(2);
    };
    match run(&args) {
        Ok(line) => {
            println!("{line}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &[String]) -> Result<String, Box<dyn std::error::Error>> {
    let number = |i: usize| args[i].parse::<usize>().map_err(|e| format!("'{}': {e}", args[i]));
    let threads = if args.len() > 5 { number(5)? } else { 1 };
    let (names, table) = csv_file::read_csv(Path::new(&args[2]))?;
    let data = recordings(table, names)?;
    let test_name = if args[1] == "none" { "parcorr" } else { &args[1] };
    let test = by_name(test_name, &TestSettings::default())?;
    let mut settings = PcmciSettings { tau_min: number(3)?, tau_max: number(4)?, ..PcmciSettings::default() };
    let control = Control::default();
    // One working thread in total: the calling thread only waits for the pool.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let (cpu_before, start) = (cpu_seconds(), Instant::now());
    if args.len() == 8 {
        let resampling =
            Resampling { resamples: number(7)?, scheme: args[6].parse()?, ..Resampling::default() };
        let settings = Settings {
            method: args[0].parse()?,
            cond_ind_test: test_name.to_owned(),
            tau_min: number(3)?,
            tau_max: number(4)?,
            ..Settings::default()
        };
        let model = pool.install(|| analyse_resampled(&data, &settings, &resampling, &control))?;
        let (wall, cpu) = (start.elapsed().as_secs_f64(), cpu_seconds() - cpu_before);
        return Ok(line(wall, cpu, model.links.len(), control.done()));
    }
    let result: Option<PcmciResult> = match args[0].as_str() {
        "pcmci" => Some(pool.install(|| run_pcmci(&data, test.as_ref(), &settings, &control))?),
        "pcmciplus" => {
            settings.pc_alpha = vec![0.01];
            let plus = PcmciPlusSettings::default();
            Some(pool.install(|| run_pcmciplus(&data, test.as_ref(), &settings, &plus, &control))?)
        }
        "fpcmci" => {
            // The published filter: the same question as the reference is asked.
            let settings = FpcmciSettings {
                pcmci: settings,
                te_estimator: TeEstimator::Gaussian,
                ..FpcmciSettings::default()
            };
            pool.install(|| run_fpcmci(&data, test.as_ref(), &settings, &control))?.pcmci
        }
        "candoit" => {
            // Without the rule that contexts join their variables as conditions: the reference's LPCMCI, which is told of the context,
            // has none, and asks the same question.
            let column = |name: &str| data.var_names().iter().position(|other| other == name);
            let intervened = |name: &String| {
                let variable = column(name.strip_prefix("do_")?);
                Some(Intervened { variable, context: column(name)? })
            };
            let interventions: Vec<Intervened> = data.var_names().iter().filter_map(intervened).collect();
            let settings = LpcmciSettings { tau_max: number(4)?, ..LpcmciSettings::default() };
            let found = pool
                .install(|| run_candoit(&data, test.as_ref(), &settings, &interventions, false, &control))?;
            Some(found.result)
        }
        other => {
            let method: Method = other.parse()?;
            let acts_on = |name: &String| Some((name.clone(), name.strip_prefix("do_")?.to_owned()));
            let acts_on: Vec<_> = data.var_names().iter().filter_map(acts_on).collect();
            let settings = Settings {
                method,
                cond_ind_test: test_name.to_owned(),
                tau_min: number(3)?,
                tau_max: number(4)?,
                acts_on: (method == Method::Candoit && !acts_on.is_empty()).then_some(acts_on),
                ..Settings::default()
            };
            let model = pool.install(|| analyse(&data, &settings, &control))?;
            let (wall, cpu) = (start.elapsed().as_secs_f64(), cpu_seconds() - cpu_before);
            return Ok(line(wall, cpu, model.links.len(), control.done()));
        }
    };
    let (wall, cpu) = (start.elapsed().as_secs_f64(), cpu_seconds() - cpu_before);
    let links = result.as_ref().map_or(0, |r| r.graph.iter().filter(|mark| mark.is_link()).count());
    let tests = result.as_ref().map_or(0, |r| r.n_tests);
    Ok(line(wall, cpu, links, tests))
}

fn line(wall: f64, cpu: f64, links: usize, tests: usize) -> String {
    format!(
        r#"{{"cpu_s": {cpu}, "wall_s": {wall}, "peak_mb": {}, "links": {links}, "tests": {tests}}}"#,
        peak_megabytes().unwrap_or(0.0)
    )
}

/// The table as recordings: one for each number in the column `recording`, if there is one.
fn recordings(
    table: ndarray::Array2<f64>,
    names: Vec<String>,
) -> Result<DataFrame, Box<dyn std::error::Error>> {
    let Some(place) = names.iter().position(|name| name == "recording") else {
        return Ok(DataFrame::new(vec![table], names)?);
    };
    let rest: Vec<usize> = (0..names.len()).filter(|&column| column != place).collect();
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for row in 0..table.nrows() {
        match parts.last_mut() {
            Some(part) if table[[part[0], place]] == table[[row, place]] => part.push(row),
            _ => parts.push(vec![row]),
        }
    }
    let of = |rows: &Vec<usize>| table.select(ndarray::Axis(0), rows).select(ndarray::Axis(1), &rest);
    let names = rest.iter().map(|&column| names[column].clone()).collect();
    Ok(DataFrame::new(parts.iter().map(of).collect(), names)?)
}

/// CPU time of all threads of this process so far, in seconds; 0 if the system does not tell.
fn cpu_seconds() -> f64 {
    let of_thread = |entry: fs::DirEntry| -> Option<f64> {
        let text = fs::read_to_string(entry.path().join("schedstat")).ok()?;
        Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
    };
    fs::read_dir("/proc/self/task").map_or(0.0, |threads| threads.flatten().filter_map(of_thread).sum())
}

/// Largest resident memory of this process so far, in MB (10^6 bytes).
fn peak_megabytes() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? * 1024e-6)
}
