//! Reads post-processed batches back for one analysis: several recordings, several people, interventions.

use std::{
    collections::{BTreeMap, BTreeSet, HashSet},
    path::Path,
};

use ndarray::Array2;

use roscausal_discovery::{DataFrame, names, same_value};

use super::{
    Table,
    pool::sidecar,
    table::{Note, Reading, common_step},
};
use crate::{Error, Result, bounded};

/// A person with fewer complete rows than this is not analysed.
const FEWEST_ROWS: usize = 30;

/// Which models are made when a batch has several people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum People {
    /// One model: each person is a recording of the same system.
    #[default]
    Pooled,
    /// One model per person.
    Each,
    /// One model per person, and the pooled one last.
    Both,
    /// One model with the variables of all people.
    Joint,
}

roscausal_discovery::words!(People, "people": Pooled "pooled", Each "each", Both "both", Joint "joint");

/// What the metadata beside a batch says. A batch without metadata counts as complete.
#[derive(Clone, Debug, PartialEq)]
pub struct Facts {
    /// The batch has its full length.
    pub complete: bool,
    /// Frame of all positions.
    pub frame: String,
    /// Columns of interventions.
    pub context: Vec<String>,
    /// The people in it.
    pub ids: Vec<u32>,
}

impl Facts {
    /// Reads the facts of the batch at `path`.
    pub fn read(path: &Path) -> Self {
        let name = path.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned());
        let beside = Some(path.with_file_name(sidecar(&name))).filter(|file| file.is_file());
        let json: serde_json::Value =
            beside.and_then(|file| bounded::read_json(&file).ok()).unwrap_or_default();
        let items = |key: &str| json[key].as_array().cloned().unwrap_or_default();
        Self {
            complete: json["complete"].as_bool().unwrap_or(true),
            frame: json["frame"].as_str().unwrap_or("map").to_owned(),
            context: items("context").iter().filter_map(|item| item.as_str().map(str::to_owned)).collect(),
            ids: items("ids").iter().filter_map(|id| id.as_u64().and_then(|id| id.try_into().ok())).collect(),
        }
    }
}

/// Batches that are analysed together.
#[derive(Clone, Debug)]
pub struct Joint {
    tables: Vec<(Table, Facts)>,
    /// Columns of interventions that vary, of all batches.
    context: Vec<String>,
    /// The step that they share.
    pub dt: Option<f64>,
    /// What a reader of the model should know.
    pub warnings: Vec<String>,
}

/// The data of one model.
#[derive(Clone, Debug)]
pub struct Part {
    /// The person that the model is about, if it is about one.
    pub person: Option<u32>,
    /// The data.
    pub data: DataFrame,
    /// The variables that may be causes only: interventions.
    pub exogenous: Vec<String>,
    /// The batch that each recording is of, by its place.
    pub sources: Vec<usize>,
}

impl Joint {
    /// Reads batches and their metadata.
    ///
    /// # Errors
    /// No batch, or one that cannot be read; batches with different steps.
    pub fn read(paths: &[impl AsRef<Path>]) -> Result<Self> {
        Self::read_within(paths, None)
    }

    /// As [`Joint::read`]; reading a batch may take `max_memory` bytes.
    ///
    /// # Errors
    /// As [`Joint::read`]; a batch that does not fit.
    pub fn read_within(paths: &[impl AsRef<Path>], max_memory: Option<u64>) -> Result<Self> {
        let reading = Reading { max_memory, ..Reading::default() };
        let read = |path: &Path| Ok((Table::read_as(path, &reading)?, Facts::read(path)));
        let tables: Vec<(Table, Facts)> =
            paths.iter().map(|path| read(path.as_ref())).collect::<Result<_>>()?;
        Error::ensure_data(!tables.is_empty(), || "there is no batch to analyse")?;
        let dt = common_step(paths.iter().map(AsRef::as_ref).zip(tables.iter().map(|(table, _)| table)))?;
        let mut notes_on_context = Vec::new();
        let reported: BTreeSet<&String> = tables
            .iter()
            .flat_map(|(table, facts)| facts.context.iter().filter(|name| table.names.contains(name)))
            .collect();
        let mut context = Vec::new();
        for name in reported {
            let mut values = tables.iter().flat_map(|(table, _)| column(table, name));
            let first = values.next();
            if values.all(|value| Some(value) == first) {
                notes_on_context
                    .push(format!("'{name}' is the same in all rows: the intervention is not analysed"));
            } else {
                context.push(name.clone());
            }
        }
        // What is constant in one batch may vary from batch to batch.
        let varies = |note: &&Note| matches!(note, Note::Constant { column, .. } if context.contains(column));
        // A column that is empty in all of them is left out, and told of then.
        let columns = tables.iter().flat_map(|(table, _)| table.names.iter().zip(table.values.columns()));
        let full = columns.filter(|(_, values)| values.iter().any(|value| value.is_finite()));
        let full: HashSet<&String> = full.map(|(name, _)| name).collect();
        let goes = |note: &&Note| matches!(note, Note::Empty { column } if !full.contains(column));
        let notes = tables.iter().flat_map(|(table, _)| &table.notes);
        let notes = notes.filter(|note| !varies(note) && !goes(note)).map(|note| (0, note));
        let notes = Note::gathered(notes).into_iter().map(|(_, note)| note.to_string());
        let warnings = notes.chain(notes_on_context).collect();
        Ok(Self { tables, context, dt, warnings })
    }

    /// Stamps of the first and the last row in seconds, if the batches have times.
    pub fn span(&self) -> (Option<f64>, Option<f64>) {
        let first = self.tables.first().and_then(|(table, _)| table.time.as_ref()?.first().copied());
        (first, self.tables.last().and_then(|(table, _)| table.time.as_ref()?.last().copied()))
    }

    /// The columns of interventions, also of those that are the same in all rows; of all batches, one after the other.
    pub fn announced(&self) -> Vec<(String, Vec<f64>)> {
        let names: BTreeSet<&String> = self.tables.iter().flat_map(|(_, facts)| &facts.context).collect();
        let all = |name: &String| self.tables.iter().flat_map(|(table, _)| column(table, name)).collect();
        names.into_iter().map(|name| (name.clone(), all(name))).collect()
    }

    /// Frame of the first batch.
    pub fn frame(&self) -> &str {
        &self.tables[0].1.frame
    }

    /// The data of each requested model. With at most one person there is one model.
    ///
    /// # Errors
    /// Batches whose columns do not match, or nobody with enough rows.
    pub fn parts(&mut self, people: People) -> Result<Vec<Part>> {
        let several = self.tables.iter().any(|(_, facts)| facts.ids.len() > 1);
        if people == People::Joint || !several {
            let recordings = self.tables.iter().map(|(table, facts)| self.columns(table, facts, None));
            let mut of = BTreeMap::from([(0, recordings.enumerate().collect::<Vec<_>>())]);
            self.leave_out_empty(&mut of);
            return Ok(vec![self.part(None, &of[&0])?]);
        }
        let mut of: BTreeMap<u32, Vec<(usize, Named)>> = BTreeMap::new();
        for (place, (table, facts)) in self.tables.iter().enumerate() {
            for id in &facts.ids {
                of.entry(*id).or_default().push((place, self.columns(table, facts, Some(*id))));
            }
        }
        let mut parts = Vec::new();
        self.leave_out_empty(&mut of);
        if people != People::Pooled {
            for (id, recordings) in &of {
                let rows: usize = recordings.iter().map(|(_, one)| complete_rows(one)).sum();
                if rows >= FEWEST_ROWS {
                    parts.push(self.part(Some(*id), recordings)?);
                } else {
                    let note = format!("no model of person {id}: {rows} rows without a missing value");
                    self.warnings.push(note);
                }
            }
        }
        if people != People::Each {
            let all: Vec<_> = of.into_values().flatten().filter(|(_, one)| complete_rows(one) > 0).collect();
            Error::ensure_data(!all.is_empty(), || "no person has a row without a missing value")?;
            parts.push(self.part(None, &all)?);
        }
        Error::ensure_data(!parts.is_empty(), || self.warnings.last().cloned().unwrap_or_default())?;
        Ok(parts)
    }

    /// All columns, those of interventions last. Of one `person`: theirs, under the names that they have if they are alone, and the
    /// columns that belong to nobody.
    fn columns(&self, table: &Table, facts: &Facts, person: Option<u32>) -> Named {
        let mut columns = Named::new();
        for name in table.names.iter().filter(|name| !facts.context.contains(name)) {
            let name_alone = match person.and_then(|_| person_of(name, &facts.ids)) {
                Some((of, alone)) if Some(of) == person => alone,
                None => name.clone(),
                // In a batch with one person the names are plain.
                Some(_) => continue,
            };
            columns.push((name_alone, column(table, name)));
        }
        columns.extend(self.context.iter().map(|name| (name.clone(), column(table, name))));
        columns
    }

    /// Leaves out the columns that are empty for everybody, such as the distance to a goal that nobody told.
    fn leave_out_empty(&mut self, of: &mut BTreeMap<u32, Vec<(usize, Named)>>) {
        let mut full = BTreeSet::new();
        for (name, values) in of.values().flatten().flat_map(|(_, columns)| columns) {
            if values.iter().any(|value| value.is_finite()) {
                full.insert(names::plain(name));
            }
        }
        let mut left_out = BTreeSet::new();
        for (_, columns) in of.values_mut().flatten() {
            columns.retain(|(name, _)| {
                let is_full = full.contains(&names::plain(name));
                if !is_full {
                    left_out.insert(name.clone());
                }
                is_full
            });
        }
        let whom = if of.len() > 1 { " for everybody" } else { "" };
        let note = |name: &String| format!("'{name}' is empty{whom} and is not analysed");
        self.warnings.extend(left_out.iter().map(note));
    }

    fn part(&self, person: Option<u32>, recordings: &[(usize, Named)]) -> Result<Part> {
        let variables: Vec<String> = recordings[0].1.iter().map(|(name, _)| name.clone()).collect();
        let (mut tables, mut sources): (Vec<Array2<f64>>, Vec<usize>) = Default::default();
        for (source, columns) in recordings {
            let lacks = |name: &str| {
                Error::Data(format!(
                    "one batch has '{name}', another has not: they cannot be analysed together"
                ))
            };
            let mut own: BTreeMap<String, &Vec<f64>> =
                columns.iter().map(|(name, values)| (names::plain(name), values)).collect();
            let found =
                variables.iter().map(|name| own.remove(&names::plain(name)).ok_or_else(|| lacks(name)));
            let found = found.collect::<Result<Vec<_>>>()?;
            if let Some(more) = own.keys().next() {
                return Err(lacks(more));
            }
            let rows = found.first().map_or(0, |values| values.len());
            let table = Array2::from_shape_fn((rows, found.len()), |(row, i)| found[i][row]);
            // People of whom nothing is told but the robot's columns are one recording.
            let mut before = tables.iter().zip(&sources).filter(|(_, other)| *other == source);
            if before
                .all(|(other, _)| other.dim() != table.dim() || !other.iter().zip(&table).all(same_value))
            {
                tables.push(table);
                sources.push(*source);
            }
        }
        let data = DataFrame::new(tables, variables)?.of_sources(&sources)?;
        Ok(Part { person, data, exogenous: self.context.clone(), sources })
    }
}

/// Columns with their names.
type Named = Vec<(String, Vec<f64>)>;

/// A column; zeros where there is none: of an intervention, in a batch from before it was announced.
fn column(table: &Table, name: &str) -> Vec<f64> {
    let place = table.names.iter().position(|other| other == name);
    place.map_or_else(|| vec![0.0; table.values.nrows()], |place| table.values.column(place).to_vec())
}

fn complete_rows(columns: &Named) -> usize {
    let rows = columns.first().map_or(0, |(_, values)| values.len());
    (0..rows).filter(|row| columns.iter().all(|(_, values)| values[*row].is_finite())).count()
}

/// The person that a column belongs to, and its name if they are alone: `h_7_v` is `h_v` of 7, `near_7` is `near` of
/// 7.
fn person_of(name: &str, ids: &[u32]) -> Option<(u32, String)> {
    ids.iter().find_map(|id| {
        let own = name.strip_prefix(&format!("h_{id}_")).map(|rest| format!("h_{rest}"));
        let alone = own.or_else(|| name.strip_suffix(&format!("_{id}")).map(str::to_owned))?;
        Some((*id, alone))
    })
}

#[cfg(test)]
mod tests {
    use std::{fs, path::PathBuf};

    use super::*;

    fn batch(dir: &Path, name: &str, csv: &str, facts: &str) -> PathBuf {
        fs::write(dir.join(format!("{name}.json")), facts).expect("writes");
        fs::write(dir.join(format!("{name}.csv")), csv).expect("writes");
        dir.join(format!("{name}.csv"))
    }

    fn rows(part: &Part) -> Vec<Vec<f64>> {
        part.data.recordings().iter().map(|recording| recording.iter().copied().collect()).collect()
    }

    fn two_people(dir: &Path) -> PathBuf {
        let header = "time,h_3_v,h_7_v,near_3,near_7,r_v\n";
        let lines: String = (0..40).map(|i| format!("{i},{i}.1,{i}.2,3,7,0.5\n")).collect();
        batch(dir, "a", &format!("{header}{lines}"), r#"{"ids": [3, 7]}"#)
    }

    #[test]
    fn each_person_is_a_recording_of_one_system() {
        let dir = tempfile::tempdir().expect("a folder");
        let mut joint = Joint::read(&[two_people(dir.path())]).expect("reads");
        let parts = joint.parts(People::Pooled).expect("one part");
        assert_eq!((parts.len(), parts[0].person), (1, None));
        assert_eq!(parts[0].data.var_names(), ["h_v", "near", "r_v"]);
        let rows = rows(&parts[0]);
        assert_eq!(
            (rows.len(), &rows[0][3..6], &rows[1][3..6]),
            (2, &[1.1, 3.0, 0.5][..], &[1.2, 7.0, 0.5][..])
        );
    }

    #[test]
    fn people_who_differ_in_no_column_are_one_recording() {
        let dir = tempfile::tempdir().expect("a folder");
        let lines: String = (0..40).map(|i| format!("{i},,,{i},0.5\n")).collect();
        let csv = format!("time,h_3_v,h_7_v,r_v,r_w\n{lines}");
        let path = batch(dir.path(), "a", &csv, r#"{"ids": [3, 7]}"#);
        let part = Joint::read(&[path]).expect("reads").parts(People::Pooled).expect("one").remove(0);
        assert_eq!((part.data.recordings().len(), part.sources), (1, vec![0]));
    }

    #[test]
    fn models_per_person_come_before_the_pooled_one() {
        let dir = tempfile::tempdir().expect("a folder");
        let mut joint = Joint::read(&[two_people(dir.path())]).expect("reads");
        let persons = |parts: Vec<Part>| parts.iter().map(|part| part.person).collect::<Vec<_>>();
        assert_eq!(persons(joint.parts(People::Both).expect("parts")), [Some(3), Some(7), None]);
        assert_eq!(persons(joint.parts(People::Each).expect("parts")), [Some(3), Some(7)]);
        let all = joint.parts(People::Joint).expect("parts");
        assert_eq!(all[0].data.var_names(), ["h_3_v", "h_7_v", "near_3", "near_7", "r_v"]);
    }

    #[test]
    fn people_who_were_hardly_there_have_no_model_of_their_own() {
        let dir = tempfile::tempdir().expect("a folder");
        let late = |i: usize| if i < 35 { String::new() } else { i.to_string() };
        let lines: String = (0..40).map(|i| format!("{i},{i},{}\n", late(i))).collect();
        let path = batch(dir.path(), "a", &format!("time,h_3_v,h_7_v\n{lines}"), r#"{"ids": [3, 7]}"#);
        let mut joint = Joint::read(&[path]).expect("reads");
        assert_eq!(joint.parts(People::Each).expect("one").len(), 1);
        assert!(joint.warnings.iter().any(|warning| warning.contains("person 7: 5 rows")));
    }

    #[test]
    fn what_nobody_told_is_left_out_and_everybody_is_analysed() {
        let dir = tempfile::tempdir().expect("a folder");
        let lines: String = (0..40).map(|i| format!("{i},{i}.1,{i}.2,,\n")).collect();
        let csv = format!("time,h_3_v,h_7_v,h_3_dg,h_7_dg\n{lines}");
        let path = batch(dir.path(), "a", &csv, r#"{"ids": [3, 7]}"#);
        let mut joint = Joint::read(&[path]).expect("reads");
        let parts = joint.parts(People::Both).expect("each and all");
        assert!(parts.iter().all(|part| part.data.var_names() == ["h_v"]) && parts.len() == 3);
        assert!(
            joint
                .warnings
                .iter()
                .any(|warning| warning == "'h_dg' is empty for everybody and is not analysed")
        );
    }

    #[test]
    fn observed_and_intervened_batches_are_analysed_together() {
        let dir = tempfile::tempdir().expect("a folder");
        let free = batch(dir.path(), "a", "time,h_v,h_dg\n0,1,2\n1,2,3\n", r#"{"ids": [1], "context": []}"#);
        let facts = r#"{"ids": [1], "context": ["do_robot_speed", "do_human_v"]}"#;
        let csv = "time,h_v,h_dg,do_robot_speed,do_human_v\n5,1,2,0,0\n6,2,3,0.2,0\n";
        let imposed = batch(dir.path(), "b", csv, facts);
        let mut joint = Joint::read(&[free, imposed]).expect("reads");
        let part = joint.parts(People::Pooled).expect("one").remove(0);
        assert_eq!(part.data.var_names(), ["h_v", "h_dg", "do_robot_speed"]);
        assert_eq!(part.exogenous, ["do_robot_speed"]);
        assert_eq!(rows(&part), [[1.0, 2.0, 0.0, 2.0, 3.0, 0.0], [1.0, 2.0, 0.0, 2.0, 3.0, 0.2]]);
        let all_along = batch(
            dir.path(),
            "c",
            "time,h_v,h_dg,do_robot_off\n7,1,2,1\n8,2,3,1\n",
            r#"{"ids": [1], "context": ["do_robot_off"]}"#,
        );
        let free = dir.path().join("a.csv");
        let part =
            Joint::read(&[free, all_along]).expect("reads").parts(People::Pooled).expect("one").remove(0);
        assert_eq!(part.exogenous, ["do_robot_off"], "imposed in all of one batch and in none of the other");
        assert!(
            joint.warnings.iter().any(|warning| warning.contains("'do_human_v' is the same in all rows"))
        );
        assert_eq!(part.sources, [0, 1]);
        let announced = [("do_human_v", vec![0.0; 4]), ("do_robot_speed", vec![0.0, 0.0, 0.0, 0.2])];
        assert_eq!(joint.announced(), announced.map(|(name, values)| (name.to_owned(), values)));
        assert_eq!((joint.span(), joint.dt), ((Some(0.0), Some(6.0)), Some(1.0)));
    }

    #[test]
    fn batches_with_different_steps_are_refused_and_both_are_named() {
        let dir = tempfile::tempdir().expect("a folder");
        let slow = batch(dir.path(), "a", "time,h_v,h_dg\n0,1,2\n0.3,2,3\n", "{}");
        let fast = batch(dir.path(), "b", "time,h_v,h_dg\n0,1,2\n0.1,2,3\n", "{}");
        let error = Joint::read(&[slow, fast]).expect_err("two steps").to_string();
        assert!(error.contains("a.csv is 0.3") && error.contains("b.csv: its step is 0.1"), "{error}");
    }

    #[test]
    fn batches_that_do_not_fit_are_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let one = batch(dir.path(), "a", "h_v,h_dg\n1,2\n", "{}");
        let two = batch(dir.path(), "b", "h_v,h_dg,h_risk\n1,2,3\n", "{}");
        for paths in [[&one, &two], [&two, &one]] {
            let error = Joint::read(&paths).expect("reads").parts(People::Pooled).expect_err("do not fit");
            assert!(error.to_string().contains("'h_risk'"), "{error}");
        }
        assert!(Joint::read(&[] as &[PathBuf]).is_err());
    }
}
