//! Hostile files of `--links` and `--null-dist`.

use clap::Parser;
use roscausal_fuzz::InputFile;

use super::MethodArgs;
use crate::hostile_tests::{TOML, run};

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    method: MethodArgs,
}

/// Reads an input as the file of this flag.
fn target(flag: &str, name: &str, seeds: &[&str]) {
    let names = ["a", "b", "c"].map(str::to_owned);
    let file = InputFile::new().expect("a file");
    run(name, seeds.iter().map(|seed| (*seed).into()).collect(), &TOML, 4000, |input| {
        let path = file.with(input).expect("it is written");
        let words = ["test", "--method=pcmciplus", "--tau-max=2", flag].map(AsRef::as_ref);
        let line = Line::parse_from(words.into_iter().chain([path.as_os_str()]));
        let _ = line.method.request(1).map(|request| line.method.for_variables(&request, &names));
    });
}

#[test]
fn a_hostile_file_of_links_is_refused_or_used() {
    let seeds = [
        "[[link]]\ncause = 'a'\neffect = 'b'\nlags = [1, 2]\nis = 'required'\n[[link]]\ncause = '*'\neffect = 'c'\nis = 'forbidden'\n",
        "only = true\n[[link]]\ncause = 'c'\neffect = 'b'\nlags = [0]\nis = 'directed'\n[[link]]\ncause = 'b'\neffect = 'b'\nis = 'allowed'\n",
    ];
    target("--links", "links", &seeds);
}

#[test]
fn a_hostile_file_of_null_distributions_is_refused_or_used() {
    target("--null-dist", "null_dist", &["100,150\n0.1,0.05\n0.2,0.08\n0.15,\n"]);
}
