//! What a recorded quantity can be at all. A tracker that jumps reports speeds of 100 m/s; such a cell is emptied and counted.

use std::{borrow::Cow, collections::BTreeMap};

use super::{
    recording::Recording,
    tracks::{Field, Values},
};

/// Largest magnitude of a quantity: m, rad, m/s or rad/s. No person, and no robot among people, is faster than 180 km/h;
/// map coordinates (UTM) stay below 10,000 km.
fn largest(field: Field) -> f64 {
    match field {
        Field::Gx | Field::Gy | Field::X | Field::Y => 1e8,
        Field::Theta => 1e6,
        Field::V => 50.0,
        Field::Omega => 100.0,
    }
}

/// The batch without the cells that cannot be, and how many these are of each column: `r_v`, `h_7_v`, `robot2_v`. A batch may be large:
/// it is copied only where it has some.
pub(super) fn possible(batch: &Recording) -> (Cow<'_, Recording>, BTreeMap<String, usize>) {
    let is_far = |values: &Values| Field::ALL.into_iter().any(|field| is_impossible(values, field));
    let bodies = batch.people.values().chain(batch.others.values());
    if !std::iter::once(&batch.robot).chain(bodies).flatten().any(is_far) {
        return (Cow::Borrowed(batch), BTreeMap::new());
    }
    let mut batch = batch.clone();
    let emptied = empty_impossible(&mut batch);
    (Cow::Owned(batch), emptied)
}

fn is_impossible(values: &Values, field: Field) -> bool {
    values.get(field).abs() > largest(field)
}

fn empty_impossible(batch: &mut Recording) -> BTreeMap<String, usize> {
    let mut emptied = BTreeMap::new();
    let mut check = |body: &str, rows: &mut [Values]| {
        for field in Field::ALL {
            let mut count = 0;
            for values in rows.iter_mut().filter(|values| is_impossible(values, field)) {
                values.set(field, f64::NAN);
                count += 1;
            }
            if count > 0 {
                emptied.insert(format!("{body}_{}", field.name()), count);
            }
        }
    };
    check("r", &mut batch.robot);
    batch.people.iter_mut().for_each(|(id, rows)| check(&format!("h_{id}"), rows));
    batch.others.iter_mut().for_each(|(name, rows)| check(name, rows));
    emptied
}
