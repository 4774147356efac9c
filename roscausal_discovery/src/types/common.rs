//! Columns that recordings of one time have in common, such as the robot's in the recordings of several people.
//!
//! Each person of a batch is a recording, and the robot's columns stand in all of them. A test between two of the robot's columns
//! would count each of its rows once for every person, and find links by chance far more often than its level says. So such a test
//! sees each time in one recording only, in those of the people in turn: what it holds fixed may be a person's. Other tests have all
//! rows; how many of them count is in `methods/shared_times`.

use ndarray::Array2;

/// Whether two values are the same; missing ones are.
pub fn same_value((a, b): (&f64, &f64)) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// In order, each once.
pub(crate) fn unique<T: Ord>(mut all: Vec<T>) -> Vec<T> {
    all.sort_unstable();
    all.dedup();
    all
}

/// Adds what is not yet there.
pub(crate) fn add_new<T: PartialEq>(all: &mut Vec<T>, one: T) {
    if !all.contains(&one) {
        all.push(one);
    }
}

/// Which columns are common, and to which recordings.
#[derive(Clone, Debug)]
pub(super) struct Common {
    /// By variable: whether recordings of one time hold the same values.
    pub(super) columns: Vec<bool>,
    /// By recording: the first one of its time, itself or an earlier one.
    pub(super) firsts: Vec<usize>,
}

impl Common {
    /// What the recordings have in common; recordings with the same number in `sources` are of one time. `None`: no two are.
    pub(super) fn of(recordings: &[Array2<f64>], sources: &[usize]) -> Option<Self> {
        let first = |k: usize| (0..=k).find(|&other| sources[other] == sources[k]).unwrap_or(k);
        let firsts: Vec<usize> = (0..recordings.len()).map(first).collect();
        let n_vars = recordings.first().map_or(0, Array2::ncols);
        let same = |var: usize| {
            firsts.iter().enumerate().all(|(k, &first)| {
                let [a, b] = [k, first].map(|k| recordings[k].column(var));
                a.len() == b.len() && a.iter().zip(b).all(same_value)
            })
        };
        let repeats = firsts.iter().enumerate().any(|(k, &first)| k != first);
        let columns: Vec<bool> = (0..n_vars).map(same).collect();
        repeats.then_some(Self { columns, firsts })
    }

    /// The same of some of the variables.
    pub(super) fn select(&self, vars: &[usize]) -> Self {
        Self { columns: vars.iter().map(|&var| self.columns[var]).collect(), firsts: self.firsts.clone() }
    }

    /// By recording, some of its `times`, so that each time is there once: in the recordings of that time in turn, as far as they have
    /// all values then.
    pub(super) fn once(&self, recordings: &[Array2<f64>], times: &[Vec<usize>]) -> Vec<Vec<usize>> {
        let mut once = vec![Vec::new(); recordings.len()];
        for (first, listed) in times.iter().enumerate().filter(|(k, _)| self.firsts[*k] == *k) {
            let of: Vec<usize> = (first..recordings.len()).filter(|&k| self.firsts[k] == first).collect();
            for &t in listed {
                let whole = |k: &usize| recordings[*k].row(t).iter().all(|value| !value.is_nan());
                let whole: Vec<usize> = of.iter().copied().filter(whole).collect();
                once[if whole.is_empty() { first } else { whole[t % whole.len()] }].push(t);
            }
        }
        once
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn columns_are_common_where_all_recordings_of_each_time_agree() {
        let nan = f64::NAN;
        let (one, two) = (array![[1.0, 5.0], [nan, 6.0]], array![[1.0, 7.0], [nan, 8.0]]);
        let later = array![[3.0, 5.0]];
        let all = [one.clone(), later.clone(), two];
        let common = Common::of(&all, &[0, 1, 0]).expect("the first column");
        assert_eq!((&common.columns[..], &common.firsts[..]), (&[true, false][..], &[0, 1, 0][..]));
        assert_eq!(common.once(&all, &[vec![0, 1], vec![0], vec![0, 1]]), [vec![0, 1], vec![0], vec![]]);
        let mut people = all.clone();
        people.iter_mut().for_each(|of| of.mapv_inplace(|v| if v.is_nan() { 2.0 } else { v }));
        assert_eq!(common.once(&people, &[vec![0, 1], vec![0], vec![0, 1]]), [vec![0], vec![0], vec![1]]);
        assert!(Common::of(&all, &[0, 1, 2]).is_none(), "each is of another time");
        let none = Common::of(&[one, later], &[0, 0]).expect("of one time");
        assert_eq!(none.columns, [false, false], "no column agrees");
    }
}
