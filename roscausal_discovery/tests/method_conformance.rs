//! Laws of the methods: what must not change their answer does not.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::collections::BTreeSet;

use ndarray::{Array2, Axis, concatenate};
use roscausal_discovery::{Control, DataFrame, Link, Model, Settings, analyse, methods::Method, mix};

/// Uniform noise of variance 1.
fn noise(seed: u64, i: usize) -> f64 {
    12_f64.sqrt() * (mix(seed.wrapping_mul(1_000_003) + i as u64) as f64 / u64::MAX as f64 - 0.5)
}

/// `a` drives `b`, `b` drives `c`, each one step later; `d` is alone, and `do_d` is imposed on it now and then. Two recordings, the
/// second of which has other levels.
fn system(seed: u64) -> DataFrame {
    let recording = |k: usize| {
        let mut x = Array2::from_shape_fn((250, 5), |(t, v)| match v {
            4 => f64::from(u8::from((t / 7) % 5 == k)),
            _ => noise(seed, 5000 * k + 5 * t + v),
        });
        for t in 0..250 {
            x[[t, 3]] += 2.0 * x[[t, 4]];
        }
        for t in 1..250 {
            x[[t, 1]] += 0.7 * x[[t - 1, 0]];
            x[[t, 2]] += 0.6 * x[[t - 1, 1]];
        }
        for v in 0..4 {
            x.column_mut(v).mapv_inplace(|value| value + (k * (v + 1)) as f64 / 6.0);
        }
        x
    };
    let names = ["a", "b", "c", "d", "do_d"].map(str::to_owned).to_vec();
    DataFrame::new(vec![recording(0), recording(1)], names).unwrap()
}

/// The columns that a method is for: interventions for CAnDOIT alone.
fn data_for(method: Method, seed: u64) -> DataFrame {
    let all = system(seed);
    if method == Method::Candoit { all } else { all.select(&[0, 1, 2, 3]) }
}

fn model(data: &DataFrame, method: Method) -> Model {
    model_by(data, method, "parcorr", 2)
}

fn model_by(data: &DataFrame, method: Method, test: &str, tau_max: usize) -> Model {
    let settings = Settings {
        method,
        cond_ind_test: test.into(),
        tau_min: method.info().tau_min,
        tau_max,
        acts_on: (method == Method::Candoit).then(|| vec![("do_d".into(), "d".into())]),
        ..Settings::default()
    };
    analyse(data, &settings, &Control::default()).unwrap()
}

/// Links with their marks, as names; a pair at lag 0 is read from the end that comes first in the alphabet.
fn links(model: &Model) -> BTreeSet<String> {
    let name = |link: &Link| {
        let Link { cause, effect, lag, mark, .. } = link;
        match *lag == 0 && cause > effect {
            true => format!("{effect} {cause} 0 {}", mark.mirrored()),
            false => format!("{cause} {effect} {lag} {mark}"),
        }
    };
    model.links.iter().map(name).collect()
}

/// The methods that find links, as opposed to dependencies.
fn methods() -> impl Iterator<Item = Method> {
    Method::all().filter(|method| *method != Method::Lagdep)
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    for method in Method::all() {
        let data = data_for(method, 1);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| model(&data, method).to_json())
        };
        assert_eq!(run(1), run(3), "{method}");
    }
}

#[test]
fn the_order_of_the_columns_does_not_matter() {
    for method in methods() {
        let differing = (0..6).filter(|&seed| {
            let data = data_for(method, seed);
            let turned: Vec<usize> = (0..data.n_vars()).rev().collect();
            links(&model(&data, method)) != links(&model(&data.select(&turned), method))
        });
        // LPCMCI and CAnDOIT promise it up to ties in the order of their searches.
        let allowed = usize::from(method.info().hidden_causes);
        assert!(differing.count() <= allowed, "{method}");
    }
}

#[test]
fn powers_of_two_as_units_change_no_value() {
    for method in Method::all() {
        let data = data_for(method, 6);
        // An intervention is 0 or 1.
        let powers = [530, -400, 3, 480, 0];
        let scaled = |of: &Array2<f64>| {
            Array2::from_shape_fn(of.dim(), |(t, var)| of[[t, var]] * 2.0_f64.powi(powers[var]))
        };
        let scaled = data.recordings().iter().map(scaled).collect();
        let scaled = DataFrame::new(scaled, data.var_names().to_vec()).unwrap();
        let numbers = |data: &DataFrame| -> Vec<String> {
            let of = |link: &Link| {
                let Link { cause, effect, lag, mark, value, p_value, .. } = link;
                format!("{cause} {effect} {lag} {mark} {value:?} {p_value:?}")
            };
            model(data, method).links.iter().map(of).collect()
        };
        assert_eq!(numbers(&data), numbers(&scaled), "{method}");
    }
}

/// Both models have the same links, of the same size to rounding.
fn assert_same(was: &Model, is: &Model, what: &str) {
    assert_eq!(links(was), links(is), "{what}");
    for link in &was.links {
        let ends = |of: &&Link| (&of.cause, &of.effect, of.lag) == (&link.cause, &link.effect, link.lag);
        if let (Some(was), Some(Some(is))) = (link.value, is.links.iter().find(ends).map(|of| of.value)) {
            assert!((was - is).abs() < 1e-6 * was.abs().max(1.0), "{what}: {link:?} {is}");
        }
    }
}

/// The data with each recording changed.
fn each_recording(data: &DataFrame, change: impl FnMut(&Array2<f64>) -> Array2<f64>) -> DataFrame {
    DataFrame::new(data.recordings().iter().map(change).collect(), data.var_names().to_vec()).unwrap()
}

#[test]
fn units_and_means_change_no_link() {
    for method in Method::all() {
        let data = data_for(method, 7);
        // An intervention stays 0 or 1.
        let (factors, means) = ([1000.0, 0.001, 3.6, 57.3, 1.0], [20_000.0, 3.0, -80.0, 1e4, 0.0]);
        let moved = each_recording(&data, |of| {
            Array2::from_shape_fn(of.dim(), |(t, var)| of[[t, var]] * factors[var] + means[var])
        });
        assert_same(&model(&data, method), &model(&moved, method), &format!("{method}"));
    }
}

#[test]
fn the_order_of_recordings_does_not_matter() {
    for method in Method::all() {
        let data = data_for(method, 9);
        let turned = data.recordings().iter().rev().cloned().collect();
        let turned = DataFrame::new(turned, data.var_names().to_vec()).unwrap();
        assert_same(&model(&data, method), &model(&turned, method), &format!("{method}"));
    }
}

/// Columns without time have rows in any order.
#[test]
fn without_lags_the_order_of_rows_does_not_matter() {
    for method in [Method::Varlingam, Method::Dynotears, Method::Lpcmci, Method::Tsfci] {
        let data = data_for(method, 10);
        let turned = each_recording(&data, |of| of.select(Axis(0), &(0..250).rev().collect::<Vec<_>>()));
        let run = |data: &DataFrame| model_by(data, method, "parcorr", 0);
        assert_same(&run(&data), &run(&turned), &format!("{method}"));
    }
}

/// The tests of categories answer the same for any names of these.
#[test]
fn names_of_categories_change_no_value() {
    // TiMINo regresses; CAnDOIT and J-PCMCI+ are for interventions and differing recordings.
    let others = [Method::Timino, Method::Candoit, Method::Jpcmciplus];
    for method in methods().filter(|method| method.info().uses_test && !others.contains(method)) {
        let category = |k: usize| {
            let mut of =
                Array2::from_shape_fn((600, 3), |(t, v)| (mix((9000 * k + 3 * t + v) as u64) % 3) as f64);
            for t in (1..600).filter(|t| t % 4 > 0) {
                of[[t, 1]] = of[[t - 1, 0]];
            }
            of
        };
        let names = ["a", "b", "c"].map(str::to_owned).to_vec();
        let data = DataFrame::new(vec![category(0), category(1)], names).unwrap();
        let renamed = each_recording(&data, |of| of.mapv(|v| [2.0, 0.0, 1.0][v as usize]));
        let run = |data: &DataFrame| model_by(data, method, "gsquared", 1);
        assert_same(&run(&data), &run(&renamed), &format!("{method}"));
        assert!(links(&run(&data)).iter().any(|link| link.starts_with("a b 1")), "{method}");
    }
}

/// Assumptions say what is tested; the conditions remain the whole past.
#[test]
fn full_conditions_do_not_depend_on_assumptions() {
    use roscausal_discovery::{
        Assumption, LinkAssumptions, Node,
        independence_tests::{TestSettings, by_name},
        methods::{PcmciSettings, run_bivci, run_fullci},
    };
    let (data, test) = (data_for(Method::Fullci, 8), by_name("parcorr", &TestSettings::default()).unwrap());
    let mut few = LinkAssumptions::none(data.n_vars());
    few.insert(0, 1, 1, Assumption::Test).unwrap();
    let all = PcmciSettings { tau_max: 2, ..PcmciSettings::default() };
    let fewer = PcmciSettings { link_assumptions: Some(few), ..all.clone() };
    for run in [run_fullci, run_bivci] {
        let [all, fewer] =
            [&all, &fewer].map(|settings| run(&data, test.as_ref(), settings, &Control::default()).unwrap());
        let at = Node::new(0, 1);
        let value = |of: &roscausal_discovery::methods::PcmciResult| of.val_matrix[[at.var, 1, at.lag]];
        assert_eq!((value(&all), fewer.n_tests), (value(&fewer), 1));
    }
}

#[test]
fn an_exact_lagged_effect_is_one_link() {
    let mut values = Array2::from_shape_fn((300, 2), |(t, v)| noise(5, 2 * t + v));
    for t in 1..300 {
        values[[t, 0]] = values[[t - 1, 1]];
    }
    let data = DataFrame::new(vec![values], ["x1", "x2"].map(str::to_owned).to_vec()).unwrap();
    for method in [Method::Granger, Method::Varlingam] {
        let settings = Settings { method, tau_min: method.info().tau_min, tau_max: 1, ..Settings::default() };
        let model = analyse(&data, &settings, &Control::default()).unwrap();
        let found: Vec<_> = model.links.iter().map(|link| (&*link.cause, &*link.effect, link.lag)).collect();
        assert_eq!(found, [("x2", "x1", 1)], "{method}");
        assert!(
            (model.links[0].drawn_strength() - 1.0).abs() < 1e-9 && model.warnings.is_empty(),
            "{method}: {:?}",
            model.warnings
        );
    }
}

#[test]
fn a_copy_of_every_recording_changes_no_coefficient_and_loses_no_link() {
    for method in methods() {
        let data = data_for(method, 3);
        let (once, names) = (model(&data, method), data.var_names().to_vec());
        let twice = DataFrame::new([data.recordings(), data.recordings()].concat(), names).unwrap();
        let twice = model(&twice, method);
        for link in once
            .links
            .iter()
            .filter(|link| link.value.is_some_and(|value| value.abs() > 0.3) && link.cause != link.effect)
        {
            let same = twice.links.iter().find(|other| {
                (&other.cause, &other.effect, other.lag) == (&link.cause, &link.effect, link.lag)
            });
            let same = same.unwrap_or_else(|| panic!("{method}: {link:?}"));
            // Tests may choose other conditions with more samples; a model of all variables has none.
            if !method.info().uses_test && method != Method::Varlingam {
                let difference = same.drawn_strength() - link.drawn_strength();
                assert!(difference.abs() < 1e-3, "{method}: {link:?} {same:?}");
            }
        }
    }
}

#[test]
fn an_irrelevant_column_changes_no_strong_link() {
    for method in methods() {
        let data = data_for(method, 4);
        let wider = |k: usize, of: &Array2<f64>| {
            let column = Array2::from_shape_fn((of.nrows(), 1), |(t, _)| noise(77, 5000 * k + t));
            concatenate(Axis(1), &[of.view(), column.view()]).unwrap()
        };
        let recordings = data.recordings().iter().enumerate().map(|(k, of)| wider(k, of)).collect();
        let names = data.var_names().iter().cloned().chain(["noise".to_owned()]).collect();
        let wide = model(&DataFrame::new(recordings, names).unwrap(), method);
        let plain = model(&data, method);
        for link in plain
            .links
            .iter()
            .filter(|link| link.value.is_some_and(|value| value.abs() > 0.3) && link.cause != link.effect)
        {
            let is_same = |other: &&Link| {
                (&other.cause, &other.effect, other.lag) == (&link.cause, &link.effect, link.lag)
            };
            assert!(wide.links.iter().any(|other| is_same(&other)), "{method}: {link:?}");
        }
    }
}
