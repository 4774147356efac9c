//! The nearest-neighbour estimator of conditional mutual information.

use pulp::{Arch, Simd, WithSimd};

use super::coordinate::Coordinate;
use crate::{
    numeric::special::digamma_table,
    types::{Control, Result},
};

/// Conditional mutual information from nearest neighbours in the maximum norm, for the data and all surrogates at
/// once.
///
/// Frenzel and Pompe 2007 (doi:10.1103/PhysRevLett.99.204101): `psi(k) - <psi(k_xz) + psi(k_yz) - psi(k_z)>`, in
/// nats. The counts are of samples nearer than the k-th neighbour in the space of X, Y and Z, including the sample
/// itself. Without Z, `k_z` is the number of samples.
///
/// In surrogates X is a rearrangement of the same numbers. What depends only on Y and Z is computed once per sample
/// and serves all its surrogates. Memory grows with the number of samples, not with its square.
pub(crate) struct Estimator<'a, T> {
    /// Number of neighbours; at least 1 and less than the number of samples.
    pub(crate) k: usize,
    /// Rows of `n` samples; usually one.
    pub(crate) y: &'a [&'a [T]],
    /// Rows of `n` samples.
    pub(crate) z: &'a [Vec<T>],
    pub(crate) control: &'a Control,
}

/// Working memory for one sample.
struct Room<T: Coordinate> {
    in_z: Vec<T>,
    in_yz: Vec<T>,
    in_xyz: Vec<T>,
    in_xz: Vec<T>,
    scratch: Vec<T>,
    z_profile: T::Profile,
    yz_profile: T::Profile,
}

impl<T: Coordinate> Estimator<'_, T> {
    /// The information of each arrangement of X. A row of X (usually there is one) holds all arrangements one after
    /// the other, `n` samples each.
    ///
    /// # Errors
    /// If the control stops the run.
    pub(crate) fn information(&self, arrangements: &[&[T]]) -> Result<Vec<f64>> {
        let n = self.y[0].len();
        let psi = digamma_table(n);
        let mut sums = vec![0.0; arrangements[0].len() / n];
        let mut room = Room {
            in_z: vec![T::default(); n],
            in_yz: vec![T::default(); n],
            in_xyz: vec![T::default(); n],
            in_xz: vec![T::default(); n],
            scratch: Vec::new(),
            z_profile: T::Profile::default(),
            yz_profile: T::Profile::default(),
        };
        let arch = Arch::new();
        for i in 0..n {
            if i % 16 == 0 {
                self.control.check()?;
            }
            arch.dispatch(AddSample {
                estimator: self,
                i,
                arrangements,
                psi: &psi,
                room: &mut room,
                sums: &mut sums,
            });
        }
        Ok(sums.iter().map(|sum| psi[self.k] - sum / n as f64).collect())
    }

    /// Adds `psi(k_xz) + psi(k_yz) - psi(k_z)` of sample `i` to the sum of each arrangement.
    #[inline(always)]
    fn add_sample(&self, i: usize, arrangements: &[&[T]], psi: &[f64], room: &mut Room<T>, sums: &mut [f64]) {
        room.in_z.fill(T::default());
        for row in self.z {
            T::widen(&mut room.in_z, row[i], row);
        }
        room.in_yz.copy_from_slice(&room.in_z);
        for row in self.y {
            T::widen(&mut room.in_yz, row[i], row);
        }
        T::profile(&room.in_z, &mut room.z_profile);
        T::profile(&room.in_yz, &mut room.yz_profile);
        let mut radius = T::default();
        let n = self.y[0].len();
        for (number, sum) in sums.iter_mut().enumerate() {
            let rows = arrangements.iter().map(|row| &row[number * n..(number + 1) * n]);
            room.in_xyz.copy_from_slice(&room.in_yz);
            for x in rows.clone() {
                T::widen(&mut room.in_xyz, x[i], x);
            }
            // The radius changes little from one surrogate to the next.
            radius = T::radius(&room.in_xyz, self.k, radius, &mut room.scratch);
            let k_xz = match arrangements {
                [row] => T::count_within(
                    &room.in_z,
                    row[number * n + i],
                    &row[number * n..(number + 1) * n],
                    radius,
                ),
                _ => {
                    room.in_xz.copy_from_slice(&room.in_z);
                    for x in rows {
                        T::widen(&mut room.in_xz, x[i], x);
                    }
                    let first = &arrangements[0][number * n..(number + 1) * n];
                    T::count_within(&room.in_xz, first[i], first, radius)
                }
            };
            let k_yz = T::look_up(&room.yz_profile, radius);
            let k_z = T::look_up(&room.z_profile, radius);
            *sum += psi[k_xz] + psi[k_yz] - psi[k_z];
        }
    }
}

/// [`Estimator::add_sample`] for the widest vectors: a closure need not be inlined into code for them, this is.
struct AddSample<'a, 'e, T: Coordinate> {
    estimator: &'a Estimator<'e, T>,
    i: usize,
    arrangements: &'a [&'a [T]],
    psi: &'a [f64],
    room: &'a mut Room<T>,
    sums: &'a mut [f64],
}

impl<T: Coordinate> WithSimd for AddSample<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.estimator.add_sample(self.i, self.arrangements, self.psi, self.room, self.sums);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::numeric::{random::Rng, rows::random_ranks};

    /// The definition, term by term.
    fn by_definition(x: &[f64], y: &[f64], z: &[Vec<f64>], k: usize) -> f64 {
        let n = x.len();
        let psi = digamma_table(n);
        let apart = |row: &[f64], i: usize, j: usize| (row[i] - row[j]).abs();
        let in_z = |i: usize, j: usize| z.iter().map(|row| apart(row, i, j)).fold(0.0, f64::max);
        let mut sum = 0.0;
        for i in 0..n {
            let joint = |j: usize| in_z(i, j).max(apart(x, i, j)).max(apart(y, i, j));
            let mut others: Vec<f64> = (0..n).filter(|&j| j != i).map(joint).collect();
            others.sort_by(f64::total_cmp);
            let count =
                |d: &dyn Fn(usize) -> f64| 1 + (0..n).filter(|&j| j != i && d(j) < others[k - 1]).count();
            sum += psi[count(&|j| in_z(i, j).max(apart(x, i, j)))]
                + psi[count(&|j| in_z(i, j).max(apart(y, i, j)))]
                - psi[if z.is_empty() { n } else { count(&|j| in_z(i, j)) }];
        }
        psi[k] - sum / n as f64
    }

    fn ranks(row: &[f64]) -> Vec<i16> {
        random_ranks(row, &mut Rng::new(1)).iter().map(|&rank| rank as i16).collect()
    }

    proptest! {
        #[test]
        fn counts_agree_with_the_definition(
            values in prop::collection::vec(-1e3..1e3_f64, 60 * 4),
            dimensions in 0..3_usize,
            k in 1..40_usize,
        ) {
            let rows: Vec<Vec<f64>> = values.chunks(60).map(<[f64]>::to_vec).collect();
            let (x, y, z) = (&rows[0], &rows[1], &rows[2..2 + dimensions]);
            let control = Control::default();
            let floats = Estimator { k, y: &[y], z, control: &control }.information(&[x]).unwrap();
            prop_assert!((floats[0] - by_definition(x, y, z, k)).abs() < 1e-12);

            // A copy of a row does not change a maximum, so several rows of X and of Y can be tested together.
            let rows_of_y: [&[f64]; 2] = [y, y];
            let doubled = Estimator { k, y: &rows_of_y, z, control: &control }.information(&[x, x]).unwrap();
            prop_assert_eq!(doubled[0], floats[0]);

            let ranked: Vec<Vec<i16>> = rows.iter().map(|row| ranks(row)).collect();
            let (y, z) = (&ranked[1], &ranked[2..2 + dimensions]);
            // The same X twice, and reversed: surrogates do not affect each other.
            let reversed: Vec<i16> = ranked[0].iter().rev().copied().collect();
            let arrangements = [&ranked[0][..], &reversed, &ranked[0]].concat();
            let integers = Estimator { k, y: &[y], z, control: &control }.information(&[&arrangements]).unwrap();
            let as_floats: Vec<Vec<f64>> =
                ranked.iter().map(|row| row.iter().map(|&v| f64::from(v)).collect()).collect();
            let expected = by_definition(&as_floats[0], &as_floats[1], &as_floats[2..2 + dimensions], k);
            prop_assert!((integers[0] - expected).abs() < 1e-12);
            prop_assert_eq!(integers[0], integers[2]);
        }
    }

    #[test]
    fn a_stopped_control_ends_the_search() {
        let control = Control::default().out_of_time(|| true);
        let row: Vec<f64> = (0..20).map(f64::from).collect();
        assert!(Estimator { k: 3, y: &[&row], z: &[], control: &control }.information(&[&row]).is_err());
    }
}
