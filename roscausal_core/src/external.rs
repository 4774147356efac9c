//! A method in another language: a program that reads batches and answers with matrices.
//!
//! It is called as `PROGRAM BATCH.csv [BATCH.csv ...]`. It gets the settings as one JSON object on stdin and prints
//! one JSON object on stdout: `features`, `val_matrix` and `p_matrix` as `[cause][effect][lag 0..=tau_max]`, and
//! optionally `graph` (marks, at lag 0 from both ends; without it, links are `-->` where p <= alpha and the lag is at least tau_min, and
//! `o-o` where that holds of a pair at lag 0 in both directions).

use std::{
    io::{Read, Write},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::Duration,
};

use roscausal_discovery::{Control, FoundBy, LinkMark, Matrices, Model, Settings};
use serde::Deserialize;

use crate::{Error, Result, grammar::Parsed, params::instead};

/// The most that a program may print, in bytes.
const MAX_OUTPUT: u64 = 64 << 20;
const LOOK_AGAIN: Duration = Duration::from_millis(50);

#[derive(Deserialize)]
struct Answer {
    features: Vec<String>,
    val_matrix: Vec<Vec<Vec<f64>>>,
    p_matrix: Vec<Vec<Vec<f64>>>,
    graph: Option<Vec<Vec<Vec<LinkMark>>>>,
}

/// The program of the method `name` in the folder `dir`.
///
/// # Errors
/// A name that leaves the folder, or no such program; the message lists those that exist.
pub fn program(dir: &Path, name: &str) -> Result<PathBuf> {
    Error::ensure(!name.contains(['/', '\\']) && !name.starts_with('.'), "cd_method", || {
        format!("'{name}' is not the name of a program in {}", dir.display())
    })?;
    let path = dir.join(name);
    if path.is_file() {
        return Ok(path);
    }
    let entries = std::fs::read_dir(dir).map_err(|e| Error::file(dir, e))?;
    let mut known: Vec<String> = entries.flatten().filter_map(|e| e.file_name().into_string().ok()).collect();
    known.sort();
    let reason = format!("there is no '{name}' in {}; {}", dir.display(), instead(&known, name, "there:"));
    Err(Error::param("cd_method", reason))
}

/// Runs the program on `batches` and turns its answer into a model. Ends the program when `control` says so.
///
/// # Errors
/// A program that does not start, fails, is stopped, or gives an answer other than the one described above.
pub fn run(
    program: &Path,
    batches: &[PathBuf],
    settings: &Settings,
    threads: usize,
    control: &Control,
) -> Result<Model> {
    let parameters = serde_json::json!({
        "alpha": settings.alpha, "pc_alpha": settings.level_of_pc(), "f_alpha": settings.f_alpha,
        "cond_ind_test": settings.cond_ind_test, "tau_min": settings.tau_min, "tau_max": settings.tau_max,
        "fdr": settings.fdr.name(), "seed": settings.seed, "exogenous": settings.exogenous,
        "threads": threads, "max_memory": settings.test.max_memory,
    });
    let fault = |e: &dyn std::fmt::Display| Error::file(program, e);
    let mut child = Command::new(program)
        .args(batches)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::inherit())
        .spawn()
        .map_err(|e| fault(&format!("the method does not start: {e}")))?;
    if let Some(bytes) = settings.test.max_memory {
        limit_memory(&child, bytes);
    }
    if let Some(mut stdin) = child.stdin.take() {
        // A program that does not read its settings closes the pipe. That is not an error.
        let _ = stdin.write_all(parameters.to_string().as_bytes());
    }
    let stdout = child.stdout.take().ok_or_else(|| fault(&"its output cannot be read"))?;
    let reader = thread::spawn(move || {
        let mut text = Vec::new();
        stdout.take(MAX_OUTPUT).read_to_end(&mut text).map(|_| text)
    });
    wait(&mut child, program, control)?;
    let text = reader.join().map_err(|_| fault(&"reading its output failed"))?.map_err(|e| fault(&e))?;
    let answer: Answer =
        serde_json::from_slice(&text).map_err(|e| fault(&format!("its answer is not as documented: {e}")))?;
    let name = program.file_name().unwrap_or_default().to_string_lossy().into_owned();
    model(answer, name, settings).map_err(|reason| fault(&reason))
}

/// Limits the memory of the program to `bytes`.
fn limit_memory(child: &Child, bytes: u64) {
    #[cfg(target_os = "linux")]
    {
        use rustix::process::{Pid, Resource, Rlimit, prlimit};
        let most = Some(bytes);
        let limited =
            prlimit(Some(Pid::from_child(child)), Resource::As, Rlimit { current: most, maximum: most });
        // It may have ended already.
        if let Err(error) = limited {
            tracing::debug!("max_memory does not hold for this program: {error}");
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = (child, bytes);
}

fn wait(child: &mut Child, program: &Path, control: &Control) -> Result<()> {
    loop {
        if let Some(status) = child.try_wait().map_err(|e| Error::file(program, e))? {
            return if status.success() {
                Ok(())
            } else {
                let reason = format!("the method failed ({status}); its own words are on stderr");
                Err(Error::file(program, reason))
            };
        }
        if let Err(stopped) = control.check() {
            let _ = child.kill();
            let _ = child.wait();
            return Err(stopped.into());
        }
        thread::sleep(LOOK_AGAIN);
    }
}

fn model(answer: Answer, method: String, settings: &Settings) -> Parsed<Model> {
    let n = answer.features.len();
    check_shape("val_matrix", &answer.val_matrix, n, settings.tau_max)?;
    check_shape("p_matrix", &answer.p_matrix, n, settings.tau_max)?;
    let found = |i: usize, j: usize, lag: usize| {
        lag >= settings.tau_min && answer.p_matrix[i][j][lag] <= settings.alpha && (lag > 0 || i != j)
    };
    let mark = |i: usize, j: usize, lag: usize| match (found(i, j, lag), lag == 0 && found(j, i, lag)) {
        (true, true) => LinkMark::Unoriented,
        (true, false) => LinkMark::Forward,
        (false, true) => LinkMark::Backward,
        (false, false) => LinkMark::Absent,
    };
    let of = |i, j| (0..=settings.tau_max).map(|lag| mark(i, j, lag)).collect();
    let graph = answer.graph.unwrap_or_else(|| (0..n).map(|i| (0..n).map(|j| of(i, j)).collect()).collect());
    check_shape("graph", &graph, n, settings.tau_max)?;
    let matrices =
        Matrices { graph, val_matrix: answer.val_matrix, p_matrix: answer.p_matrix, ..Matrices::default() };
    // What the program filters, it alone knows.
    let blank = Model { method: FoundBy::Program(method), f_alpha: None, ..settings.blank_model() };
    let model = blank.with_matrices(answer.features, matrices);
    model.check().map_err(|error| error.to_string())?;
    Ok(model)
}

fn check_shape<T>(name: &str, matrix: &[Vec<Vec<T>>], n: usize, tau_max: usize) -> Parsed<()> {
    let fits = matrix.len() == n
        && matrix.iter().all(|row| row.len() == n && row.iter().all(|lags| lags.len() == tau_max + 1));
    if fits { Ok(()) } else { Err(format!("its {name} is not {n} x {n} x {} numbers", tau_max + 1)) }
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    fn script(text: &str) -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("method");
        std::fs::write(&path, format!("#!/bin/sh\n{text}\n")).expect("writes");
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("makes it a program");
        (dir, path)
    }

    #[test]
    fn a_programs_matrices_become_a_model() {
        let answer = r#"{"features":["a","b"],"val_matrix":[[[0,0],[0,0.7]],[[0,0],[0,0]]],"p_matrix":[[[1,1],[1,0.01]],[[1,1],[1,0.5]]]}"#;
        let (_dir, path) = script(&format!("cat > /dev/null; echo '{answer}'"));
        let model = run(&path, &[], &Settings::default(), 1, &Control::default()).expect("runs");
        assert_eq!(model.links.len(), 1);
        assert_eq!((model.method.name(), model.f_alpha), ("method", None));
        assert_eq!((model.links[0].cause.as_str(), model.links[0].effect.as_str()), ("a", "b"));
    }

    #[test]
    fn a_hostile_answer_is_refused_or_a_model() {
        let seed = r#"{"features":["a","b"],"val_matrix":[[[0,0],[0,0.7]],[[0,0],[0,0]]],"p_matrix":[[[1,1],[1,0.01]],[[1,1],[1,0.5]]],
            "graph":[[["",""],["","-->"]],[["",""],["","o->"]]]}"#;
        let target = roscausal_fuzz::Target {
            corpus: concat!(env!("CARGO_MANIFEST_DIR"), "/tests/corpus/method_answer").into(),
            seeds: vec![seed.into(), seed.replace("graph", "note").into()],
            tokens: &[b"[", b"]", b"[]", b"null", b"\"-->\"", b"1e999", b","],
            bytes_per_byte: 1000,
        };
        target.run(|input| {
            for tau_max in [0, 1] {
                let settings = Settings { tau_min: 0, tau_max, ..Settings::default() };
                let Ok(answer) = serde_json::from_slice::<Answer>(input) else { return };
                drop(model(answer, "method".into(), &settings).map(|model| model.to_file_json()));
            }
        });
    }

    #[test]
    fn what_a_program_answers_is_checked_as_a_file_is() {
        let settings = Settings { tau_min: 0, tau_max: 0, ..Settings::default() };
        let answer = |p: [f64; 2], graph: Option<[&str; 2]>, names: [&str; 2]| {
            let of =
                |[ab, ba]: [f64; 2], none: f64| vec![vec![vec![none], vec![ab]], vec![vec![ba], vec![none]]];
            let graph = graph.map(|[ab, ba]| {
                let mark = |mark: &str| vec![mark.parse().expect("a mark")];
                vec![vec![mark(""), mark(ab)], vec![mark(ba), mark("")]]
            });
            let features = names.map(str::to_owned).to_vec();
            Answer { features, val_matrix: of([0.5, 0.5], 0.0), p_matrix: of(p, 1.0), graph }
        };
        let model = |given| super::model(given, "method".into(), &settings);
        let marks = |p| model(answer(p, None, ["a", "b"])).expect("a model").graph.concat().concat();
        let read = |symbols: [&str; 4]| symbols.map(|mark| mark.parse::<LinkMark>().expect("a mark"));
        assert_eq!(marks([0.01, 0.01]), read(["", "o-o", "o-o", ""]));
        assert_eq!(marks([0.9, 0.01]), read(["", "<--", "-->", ""]));
        for (reported, given) in [
            ("the other way round", answer([0.01; 2], Some(["-->", ""]), ["a", "b"])),
            ("not a number from 0 to 1", answer([-1.0, 0.5], None, ["a", "b"])),
            ("there twice", answer([0.5; 2], None, ["a", "a"])),
            ("no name", answer([0.5; 2], None, ["a", ""])),
        ] {
            let error = model(given).expect_err(reported);
            assert!(error.contains(reported), "{error}");
        }
    }

    #[test]
    fn a_program_that_fails_or_babbles_is_named() {
        for (text, word) in [("exit 3", "failed"), ("echo hello", "not as documented")] {
            let (_dir, path) = script(text);
            let error =
                run(&path, &[], &Settings::default(), 1, &Control::default()).expect_err(text).to_string();
            assert!(error.contains(word) && error.contains("method"), "{error}");
        }
    }

    #[test]
    fn a_method_cannot_leave_its_folder() {
        let (dir, _path) = script("exit 0");
        assert!(program(dir.path(), "../method").is_err());
        let error = program(dir.path(), "methd").expect_err("unknown").to_string();
        assert!(error.contains("did you mean 'method'?"), "{error}");
    }
}
