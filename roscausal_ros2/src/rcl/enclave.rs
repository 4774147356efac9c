//! The SROS2 enclave of a node, selected by `ROS_SECURITY_*` and `--enclave` as in rcl.

use std::path::{Path, PathBuf};

use super::{BadArgument, names::is_namespace};

/// The folder of an enclave that has every file that DDS Security needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Enclave {
    /// The enclave's folder.
    pub folder: PathBuf,
}

/// The files of an enclave, named as SROS2 names them.
const FILES: [&str; 6] = [
    "identity_ca.cert.pem",
    "cert.pem",
    "key.pem",
    "permissions_ca.cert.pem",
    "governance.p7s",
    "permissions.p7s",
];
/// A list of revoked certificates; the DDS library does not read it.
const REVOCATIONS: &str = "crl.pem";

impl Enclave {
    /// The enclave that the environment and `--enclave` (`argument`) select. `None` if they select none. Also
    /// `None`, with a warning that the node communicates in the clear, if the enclave cannot be used and
    /// `ROS_SECURITY_STRATEGY` is not `Enforce`. `built_in` says whether the program has DDS Security.
    ///
    /// # Errors
    /// A name that no enclave can have. With `Enforce` also: no keystore, no such enclave, missing files, a
    /// revocation list, or a program without DDS Security.
    pub fn from_env(
        env: impl Fn(&str) -> Option<String>,
        argument: Option<&str>,
        built_in: bool,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Self>, BadArgument> {
        let text = |name| env(name).filter(|value: &String| !value.is_empty());
        if let Some(name) = argument {
            check_name("--enclave", name)?;
        }
        if !text("ROS_SECURITY_ENABLE").is_some_and(|value| value.eq_ignore_ascii_case("true")) {
            return Ok(None);
        }
        let given = text("ROS_SECURITY_ENCLAVE_OVERRIDE");
        if let Some(name) = &given {
            check_name("ROS_SECURITY_ENCLAVE_OVERRIDE", name)?;
        }
        let enforced = match text("ROS_SECURITY_STRATEGY").as_deref() {
            Some("Enforce") => true,
            None | Some("Permissive") => false,
            // A misspelt Enforce must not weaken security.
            Some(other) => {
                return Err(BadArgument(format!(
                    "ROS_SECURITY_STRATEGY is '{other}'; use Enforce or Permissive"
                )));
            }
        };
        let keystore = text("ROS_SECURITY_KEYSTORE");
        let name = given.as_deref().or(argument).unwrap_or("/");
        match Self::find(built_in, keystore.as_deref().map(Path::new), name) {
            Ok(enclave) => Ok(Some(enclave)),
            Err(reason) if enforced => {
                Err(BadArgument(format!("ROS_SECURITY_STRATEGY is Enforce, but {reason}")))
            }
            Err(reason) => {
                warnings.push(format!(
                    "this node talks in the clear, although ROS_SECURITY_ENABLE is true: {reason}"
                ));
                Ok(None)
            }
        }
    }

    fn find(built_in: bool, keystore: Option<&Path>, name: &str) -> Result<Self, String> {
        if !built_in {
            return Err("this program was built without DDS Security; build it with \
                        'cargo build -p roscausal_ros2 --features security'"
                .to_owned());
        }
        let keystore = keystore.ok_or(
            "ROS_SECURITY_KEYSTORE names no keystore; set it to the folder that \
                                       'ros2 security create_keystore' made",
        )?;
        let folder = keystore.join("enclaves").join(name.trim_start_matches('/'));
        if !folder.is_dir() {
            let (folder, keystore) = (folder.display(), keystore.display());
            return Err(format!(
                "there is no enclave {name}: {folder} is not a folder; make it with 'ros2 security create_enclave {keystore} {name}'"
            ));
        }
        let missing: Vec<&str> = FILES.into_iter().filter(|file| !folder.join(file).is_file()).collect();
        if !missing.is_empty() {
            return Err(format!("the enclave {} has no {}", folder.display(), missing.join(", ")));
        }
        if folder.join(REVOCATIONS).exists() {
            return Err(format!(
                "the enclave {} has a {REVOCATIONS}, and these nodes cannot read lists of revoked certificates",
                folder.display()
            ));
        }
        Ok(Self { folder })
    }
}

/// An enclave is named like a namespace, so it cannot leave its folder.
fn check_name(what: &str, name: &str) -> Result<(), BadArgument> {
    if is_namespace(name) {
        return Ok(());
    }
    Err(BadArgument(format!("{what} is '{name}'; write the enclave's whole name, such as /robot/recorder")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(pairs: &[(&str, &str)], argument: Option<&str>) -> (Result<Option<Enclave>, String>, Vec<String>) {
        let mut warnings = Vec::new();
        let env = |name: &str| Some(pairs.iter().find(|(key, _)| *key == name)?.1.to_owned());
        (Enclave::from_env(env, argument, true, &mut warnings).map_err(|error| error.0), warnings)
    }

    #[test]
    fn security_that_is_not_asked_for_is_off() {
        for pairs in [&[][..], &[("ROS_SECURITY_ENABLE", "false"), ("ROS_SECURITY_STRATEGY", "Enforce")]] {
            assert_eq!(ask(pairs, None), (Ok(None), vec![]));
        }
    }

    #[test]
    fn a_node_that_must_be_secure_does_not_start_in_the_clear() {
        let on = ("ROS_SECURITY_ENABLE", "true");
        let enforced = ask(&[on, ("ROS_SECURITY_STRATEGY", "Enforce")], None).0.unwrap_err();
        assert!(enforced.contains("Enforce, but"), "{enforced}");
        let (permissive, warnings) = ask(&[on, ("ROS_SECURITY_STRATEGY", "Permissive")], None);
        assert!(permissive == Ok(None) && warnings[0].contains("in the clear"), "{warnings:?}");
        assert!(
            ask(&[on, ("ROS_SECURITY_STRATEGY", "enforce")], None).0.unwrap_err().contains("use Enforce")
        );
        assert!(Enclave::find(false, None, "/").unwrap_err().contains("built without DDS Security"));
    }

    #[test]
    fn the_name_of_an_enclave_does_not_leave_its_folder() {
        for name in ["robot", "/../x", "/a//b", "/a/", "", "/a.b", "/2robot"] {
            assert!(ask(&[], Some(name)).0.unwrap_err().contains("whole name"), "{name}");
        }
        assert_eq!(ask(&[], Some("/robot/recorder_2")).0, Ok(None));
    }

    #[test]
    fn the_enclave_is_found_and_what_it_lacks_is_named() {
        let keystore = tempfile::tempdir().unwrap();
        let root = keystore.path().to_str().unwrap();
        let enforce = |more: &[(&str, &str)], argument| {
            let always = [
                ("ROS_SECURITY_ENABLE", "true"),
                ("ROS_SECURITY_STRATEGY", "Enforce"),
                ("ROS_SECURITY_KEYSTORE", root),
            ];
            ask(&[&always, more].concat(), argument).0
        };
        let folder = keystore.path().join("enclaves/robot");
        assert!(enforce(&[], Some("/robot")).unwrap_err().contains("no enclave /robot"));
        std::fs::create_dir_all(&folder).unwrap();
        for file in FILES {
            assert!(enforce(&[], Some("/robot")).unwrap_err().contains(file));
            std::fs::write(folder.join(file), "").unwrap();
        }
        let found = Ok(Some(Enclave { folder: folder.clone() }));
        assert_eq!(enforce(&[], Some("/robot")), found);
        assert_eq!(enforce(&[("ROS_SECURITY_ENCLAVE_OVERRIDE", "/robot")], Some("/other")), found);
        assert!(enforce(&[], None).unwrap_err().contains("has no identity_ca"));
        std::fs::write(folder.join(REVOCATIONS), "").unwrap();
        assert!(enforce(&[], Some("/robot")).unwrap_err().contains(REVOCATIONS));
    }
}
