//! Post-processing by a program of the user, called as the original ROS-Causal calls it.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::atomic::{AtomicU64, Ordering},
    thread,
    time::{Duration, Instant},
};

use crate::{Error, Result};

/// Time between two checks whether the program has ended.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// Bytes of the program's error output that are reported.
const TOLD: usize = 600;

/// A program that turns a raw batch into one for the analysis. It is called as `PROGRAM --csv NAME --data_dir D
/// --pp_data_dir P --obs_size .. --safe_dist .. --sel_agent .. --delete_traj ..`, reads `D/NAME` and writes
/// `P/NAME`.
#[derive(Clone, Debug, PartialEq)]
pub struct Script {
    program: PathBuf,
    obs_size: f64,
    safe_dist: f64,
    sel_agent: String,
    delete_traj: bool,
    time_limit: Duration,
}

impl Script {
    /// The program `name` in the folder `dir`.
    ///
    /// # Errors
    /// A name that leaves the folder, or a file that is not there or cannot be run.
    pub fn new(dir: &Path, name: &str, time_limit: Duration) -> Result<Self> {
        if name.is_empty() || name.contains("..") || name.starts_with('/') {
            let reason =
                format!("'{name}' is not a file in pp_script_dir; give its name, such as postprocess.py");
            return Err(Error::param("pp_script", reason));
        }
        let program = dir.join(name);
        Error::ensure(program.is_file(), "pp_script", || {
            format!("there is no file {}; check pp_script_dir and pp_script", program.display())
        })?;
        let script = Self {
            program,
            obs_size: 2.0,
            safe_dist: 5.0,
            sel_agent: "1000".to_owned(),
            delete_traj: false,
            time_limit,
        };
        script.command()?;
        Ok(script)
    }

    /// The arguments that are passed on to the program.
    pub fn with_arguments(
        mut self,
        obs_size: f64,
        safe_dist: f64,
        sel_agent: &str,
        delete_traj: bool,
    ) -> Self {
        (self.obs_size, self.safe_dist, self.delete_traj) = (obs_size, safe_dist, delete_traj);
        self.sel_agent = sel_agent.to_owned();
        self
    }

    /// Runs the program on `data_dir/name`. Returns what it wrote as `name` into its output folder below
    /// `pp_data_dir`.
    ///
    /// # Errors
    /// A program that cannot be started, fails, takes too long or writes no output; the message has its error
    /// output.
    pub fn run(&self, name: &str, data_dir: &Path, pp_data_dir: &Path) -> Result<Vec<u8>> {
        static RUNS: AtomicU64 = AtomicU64::new(0);
        let run = RUNS.fetch_add(1, Ordering::Relaxed);
        let work = pp_data_dir.join(format!(".work-{}-{run}", std::process::id()));
        fs::create_dir_all(&work).map_err(|e| Error::file(&work, e))?;
        let outcome = self.run_in(&work, name, data_dir);
        let _ = fs::remove_dir_all(&work);
        outcome
    }

    fn run_in(&self, work: &Path, name: &str, data_dir: &Path) -> Result<Vec<u8>> {
        let fault = |reason: String| Error::file(&self.program, reason);
        let complaint = work.join(".complaint");
        let stderr = File::create(&complaint).map_err(|e| Error::file(&complaint, e))?;
        // Folders end in '/', because scripts concatenate folder and name.
        let folder = |path: &Path| -> Result<String> {
            let absolute = std::path::absolute(path).map_err(|e| Error::file(path, e))?;
            Ok(format!("{}/", absolute.display()).replace("//", "/"))
        };
        let mut child = self
            .command()?
            .args(["--csv", name])
            .args(["--data_dir", &folder(data_dir)?])
            .args(["--pp_data_dir", &folder(work)?])
            .args(["--obs_size", &format!("{:?}", self.obs_size)])
            .args(["--safe_dist", &format!("{:?}", self.safe_dist)])
            .args(["--sel_agent", &self.sel_agent])
            .args(["--delete_traj", if self.delete_traj { "True" } else { "False" }])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(stderr)
            .spawn()
            .map_err(|e| fault(format!("cannot be started: {e}")))?;
        let ended = wait(&mut child, self.time_limit).map_err(|e| fault(e.to_string()))?;
        let stated = fs::read(&complaint).unwrap_or_default();
        let stated = String::from_utf8_lossy(&stated[stated.len().saturating_sub(TOLD)..]).trim().to_owned();
        let limit = self.time_limit.as_secs();
        let reason = match ended {
            None => format!("took longer than {limit} s on {name} and was ended; see pp_time_limit"),
            Some(status) if !status.success() => format!("failed on {name} ({status}): {stated}"),
            Some(_) => match fs::read(work.join(name)) {
                Ok(bytes) if !bytes.is_empty() => return Ok(bytes),
                Ok(_) => format!("wrote an empty {name}; it said: {stated}"),
                Err(_) => {
                    format!(
                        "ended without writing {name} into the folder of --pp_data_dir; it said: {stated}"
                    )
                }
            },
        };
        Err(fault(reason))
    }

    /// The program itself if it is executable, otherwise Python for a `.py`.
    fn command(&self) -> Result<Command> {
        if is_executable(&self.program) {
            let program = std::path::absolute(&self.program);
            return Ok(Command::new(program.unwrap_or_else(|_| self.program.clone())));
        }
        if self.program.extension().is_some_and(|extension| extension == "py") {
            let mut command = Command::new("python3");
            command.arg(&self.program);
            return Ok(command);
        }
        let reason = format!("{} may not be executed; run: chmod +x {0}", self.program.display());
        Err(Error::param("pp_script", reason))
    }
}

#[cfg(unix)]
fn is_executable(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    fs::metadata(path).is_ok_and(|meta| meta.permissions().mode() & 0o111 != 0)
}

#[cfg(not(unix))]
fn is_executable(path: &Path) -> bool {
    path.extension().is_none_or(|extension| extension != "py")
}

/// Waits for the end of the program; `None` if its time was up and it was killed.
fn wait(child: &mut Child, limit: Duration) -> std::io::Result<Option<std::process::ExitStatus>> {
    let end = Instant::now() + limit;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if Instant::now() >= end {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        thread::sleep(LOOK_AGAIN);
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    struct Setup {
        dir: tempfile::TempDir,
        script: Script,
    }

    fn setup(text: &str, time_limit: Duration) -> Setup {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("pp.sh");
        fs::write(&path, text).expect("writes");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("sets");
        fs::create_dir_all(dir.path().join("raw")).expect("makes");
        fs::write(dir.path().join("raw/data_1.csv"), "a\n1\n").expect("writes");
        let script =
            Script::new(dir.path(), "pp.sh", time_limit).expect("runs").with_arguments(2.0, 5.0, "7", true);
        Setup { dir, script }
    }

    impl Setup {
        fn run(&self) -> Result<String> {
            let bytes =
                self.script.run("data_1.csv", &self.dir.path().join("raw"), &self.dir.path().join("pp"))?;
            Ok(String::from_utf8_lossy(&bytes).into_owned())
        }

        fn left(&self) -> Vec<String> {
            let names = fs::read_dir(self.dir.path().join("pp")).expect("lists");
            names.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
        }
    }

    const LONG: Duration = Duration::from_secs(20);

    #[test]
    fn a_script_gets_the_documented_arguments_and_its_output_is_taken_whole() {
        let setup = setup("#!/bin/sh\ncat \"$4$2\" > \"$6$2\"\necho \"$@\" >> \"$6$2\"\n", LONG);
        let text = setup.run().expect("post-processes");
        assert!(text.starts_with("a\n1\n--csv data_1.csv --data_dir /"), "{text}");
        assert!(
            text.ends_with("--obs_size 2.0 --safe_dist 5.0 --sel_agent 7 --delete_traj True\n"),
            "{text}"
        );
        assert!(setup.left().is_empty());
    }

    #[test]
    fn a_script_that_fails_is_quoted() {
        let failing = setup("#!/bin/sh\necho no such column >&2\nexit 3\n", LONG);
        let reason = failing.run().expect_err("fails").to_string();
        assert!(reason.contains("no such column") && reason.contains("3"), "{reason}");
        assert!(failing.left().is_empty());
        let idle = setup("#!/bin/sh\n", LONG);
        assert!(idle.run().expect_err("writes nothing").to_string().contains("without writing data_1.csv"));
    }

    #[test]
    fn a_script_that_hangs_is_ended() {
        let hanging = setup("#!/bin/sh\nexec sleep 60\n", Duration::from_millis(200));
        let start = Instant::now();
        assert!(hanging.run().expect_err("hangs").to_string().contains("took longer"));
        assert!(start.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn a_script_that_cannot_be_run_is_refused_at_the_start() {
        let dir = tempfile::tempdir().expect("a folder");
        fs::write(dir.path().join("pp.sh"), "#!/bin/sh\n").expect("writes");
        let refusal = |name: &str| Script::new(dir.path(), name, LONG).expect_err(name).to_string();
        assert!(refusal("pp.sh").contains("chmod +x"));
        assert!(refusal("none.py").contains("there is no file"));
        assert!(refusal("../pp.sh").contains("is not a file in pp_script_dir"));
    }
}
