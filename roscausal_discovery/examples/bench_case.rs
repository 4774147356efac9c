//! Runs one analysis and prints its cost as one line of JSON, for side-by-side measurements.
//!
//! `bench_case METHOD TEST CSV TAU_MIN TAU_MAX [THREADS [SCHEME RESAMPLES]]`: METHOD is any of `roscausal methods`; TEST is `none` for
//! one that asks none; SCHEME is how rows are drawn.
//! Rows with different numbers in a column `recording` are recordings of their own; a column `do_X` is an intervention on `X`. CPU seconds
//! are those of the analysis in all threads of this process, without reading the file, after one of a short piece that is not
//! counted. Peak memory is that of the process.

#[path = "golden/csv_file.rs"]
mod csv_file;

use std::{fs, path::Path, process::ExitCode, time::Instant};

use roscausal_discovery::{
    Control, DataFrame, Error, Settings, analyse,
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
    let case = Case {
        method: args[0].parse()?,
        test: if args[1] == "none" { "parcorr" } else { &args[1] },
        tau_min: number(3)?,
        tau_max: number(4)?,
        resampling: match args.len() {
            8 => {
                Some(Resampling { resamples: number(7)?, scheme: args[6].parse()?, ..Resampling::default() })
            }
            _ => None,
        },
    };
    let (names, table) = csv_file::read_csv(Path::new(&args[2]))?;
    // One working thread in total: the calling thread only waits for the pool.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    // As the references: a short piece first, which is not counted. That it may be too short for a method does no harm.
    let rows = if case.method == Method::Jpcmciplus { 600 } else { 40 + 4 * case.tau_max };
    let piece =
        recordings(table.slice(ndarray::s![..rows.min(table.nrows()), ..]).to_owned(), names.clone())?;
    let warm_up =
        Case { resampling: case.resampling.clone().map(|all| Resampling { resamples: 2, ..all }), ..case };
    let _ = pool.install(|| warm_up.once(&piece));
    let data = recordings(table, names)?;
    let (cpu_before, start) = (cpu_seconds(), Instant::now());
    let (links, tests) = pool.install(|| case.once(&data))?;
    let (wall, cpu) = (start.elapsed().as_secs_f64(), cpu_seconds() - cpu_before);
    Ok(format!(
        r#"{{"cpu_s": {cpu}, "wall_s": {wall}, "peak_mb": {}, "links": {links}, "tests": {tests}}}"#,
        peak_megabytes().unwrap_or(0.0)
    ))
}

/// An analysis.
struct Case<'a> {
    method: Method,
    test: &'a str,
    tau_min: usize,
    tau_max: usize,
    resampling: Option<Resampling>,
}

impl Case<'_> {
    /// The number of links found and of tests asked.
    fn once(&self, data: &DataFrame) -> Result<(usize, usize), Error> {
        let control = Control::default();
        let counts =
            |found: &PcmciResult| (found.graph.iter().filter(|mark| mark.is_link()).count(), found.n_tests);
        let test = by_name(self.test, &TestSettings::default())?;
        let (tau_min, tau_max) = (self.tau_min, self.tau_max);
        let mut pcmci = PcmciSettings { tau_min, tau_max, ..PcmciSettings::default() };
        match self.method {
            Method::Pcmci if self.resampling.is_none() => {
                Ok(counts(&run_pcmci(data, test.as_ref(), &pcmci, &control)?))
            }
            Method::Pcmciplus => {
                pcmci.pc_alpha = vec![0.01];
                let plus = PcmciPlusSettings::default();
                Ok(counts(&run_pcmciplus(data, test.as_ref(), &pcmci, &plus, &control)?))
            }
            Method::Fpcmci => {
                // The published filter: the same question as the reference is asked.
                let te_estimator = TeEstimator::Gaussian;
                let settings = FpcmciSettings { pcmci, te_estimator, ..FpcmciSettings::default() };
                let found = run_fpcmci(data, test.as_ref(), &settings, &control)?.pcmci;
                Ok(found.as_ref().map_or((0, 0), counts))
            }
            Method::Candoit => {
                // Without the rule that contexts join their variables as conditions: the reference's LPCMCI, which is told of the
                // context, has none, and asks the same question.
                let settings = LpcmciSettings { tau_max, ..LpcmciSettings::default() };
                let contexts = interventions(data);
                Ok(counts(&run_candoit(data, test.as_ref(), &settings, &contexts, false, &control)?.result))
            }
            method => {
                let settings = Settings {
                    method,
                    cond_ind_test: self.test.to_owned(),
                    tau_min,
                    tau_max,
                    ..Settings::default()
                };
                let model = match &self.resampling {
                    Some(resampling) => analyse_resampled(data, &settings, resampling, &control)?,
                    None => analyse(data, &settings, &control)?,
                };
                Ok((model.links.len(), control.done()))
            }
        }
    }
}

/// The columns `do_X`: interventions on `X`.
fn interventions(data: &DataFrame) -> Vec<Intervened> {
    let names = data.var_names();
    let of = |(context, name): (usize, &String)| {
        let variable = name.strip_prefix("do_")?;
        Some(Intervened { variable: names.iter().position(|other| other == variable), context })
    };
    names.iter().enumerate().filter_map(of).collect()
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
