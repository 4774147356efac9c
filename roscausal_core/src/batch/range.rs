//! What a recorded quantity can be at all. A tracker that jumps reports speeds of 100 m/s; such a cell is emptied and counted.

use std::collections::BTreeMap;

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

/// Empties the cells of `batch` that cannot be, and returns how many of each column: `r_v`, `h_7_v`, `robot2_v`.
pub(super) fn empty_impossible(batch: &mut Recording) -> BTreeMap<String, usize> {
    let mut emptied = BTreeMap::new();
    let mut check = |body: &str, rows: &mut [Values]| {
        for field in Field::ALL {
            let mut count = 0;
            for values in rows.iter_mut().filter(|values| values.get(field).abs() > largest(field)) {
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
