//! The rows under the header.

use std::path::Path;

use super::columns::{self, Column, Columns, Field};
use super::lines::Lines;
use super::{Available, Dataset, Expected, Measured, Noise, Purpose, Relations, Row, Seen, Set};
use crate::error::{Error, Place};
use crate::warning::Warning;

/// A table before it is judged as a whole.
pub(super) struct Parsed {
    pub(super) dataset: Dataset,
    /// What the `set` column says of each row of the dataset.
    pub(super) sets: Vec<Option<Set>>,
    pub(super) columns: Columns,
}

/// No number in a table is larger, in SI.
const LARGEST: f64 = 1e9;
/// No elevation is larger, rad.
const HIGHEST: f64 = 89.0 * std::f64::consts::PI / 180.0;
const ORIENTATION: &str = "qw, qx, qy, qz";
const SEEN_TURN: &str = "seen_qw, seen_qx, seen_qy, seen_qz";
/// A quaternion may be off unit length by this much: four printed decimals at worst.
const QUATERNION_SLACK: f64 = 0.01;

/// Reads all rows. Does not hold any back yet: every row's set is `Identify`.
pub(super) fn parse(
    file: &Path,
    text: &str,
    expected: &Expected,
    purpose: Purpose,
) -> Result<Parsed, Error> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let mut lines = Lines::of(text);
    let mut record = csv::StringRecord::new();
    let mut next = |record: &mut csv::StringRecord| -> Result<Option<usize>, Error> {
        let more = reader.read_record(record).map_err(|e| {
            Place::file(file).bad(e.to_string(), "comma-separated values", "correct the file")
        })?;
        let offset = record.position().map_or(0, csv::Position::byte);
        Ok(more.then(|| lines.of_record_at(offset)))
    };
    let Some(line) = next(&mut record)? else {
        return Err(Place::file(file).bad(
            "nothing",
            "a header row naming the columns, then one row a pose",
            "check that it is the right file",
        ));
    };
    let names: Vec<String> = record.iter().map(|n| n.trim().to_owned()).collect();
    let columns = Columns::of(file, line, &names, expected, purpose)?;

    let mut table = Reading::new(file, &columns, expected, purpose);
    let mut number = 0;
    while let Some(line) = next(&mut record)? {
        number += 1;
        table.row(number, line, &record)?;
    }
    if number == 0 {
        return Err(Place::file(file).bad(
            "a header without rows",
            "one row a pose",
            "check that it is the right file",
        ));
    }
    let (dataset, sets) = table.finish();
    Ok(Parsed {
        dataset,
        sets,
        columns,
    })
}

/// Rows as they come in.
struct Reading<'a> {
    file: &'a Path,
    columns: &'a Columns,
    joints: usize,
    targets: usize,
    sensors: usize,
    purpose: Purpose,
    has_position: bool,
    rows: Vec<Row>,
    sets: Vec<Option<Set>>,
    left_out: Vec<usize>,
    /// Rows with some blanks, for each group of columns that belong together.
    partly: Vec<(String, Vec<usize>)>,
    /// Conditions as columns, in the order of `condition_columns`.
    conditions: Vec<Vec<Option<f64>>>,
    condition_columns: Vec<&'a Column>,
}

impl<'a> Reading<'a> {
    fn new(file: &'a Path, columns: &'a Columns, expected: &Expected, purpose: Purpose) -> Self {
        let condition_columns: Vec<&Column> = columns
            .known
            .iter()
            .filter(|c| {
                matches!(
                    c.field,
                    Field::Payload
                        | Field::PayloadCom(_)
                        | Field::Temperature(_)
                        | Field::Time
                        | Field::Session
                )
            })
            .collect();
        Self {
            file,
            columns,
            joints: expected.kinds.len(),
            targets: columns.targets().saturating_sub(1),
            sensors: columns.sensors(),
            purpose,
            has_position: columns.targets() > 0,
            rows: Vec::new(),
            sets: Vec::new(),
            left_out: Vec::new(),
            partly: Vec::new(),
            conditions: vec![Vec::new(); condition_columns.len()],
            condition_columns,
        }
    }

    fn place(&self, number: usize, line: usize) -> Place {
        Place {
            row: Some(number),
            ..Place::line(self.file, line)
        }
    }

    fn row(&mut self, number: usize, line: usize, record: &csv::StringRecord) -> Result<(), Error> {
        if record.len() != self.columns.width {
            return Err(self.place(number, line).bad(
                format!("{} cells", record.len()),
                format!("{}, as in the header", self.columns.width),
                "complete the row (blank cells keep their commas)",
            ));
        }
        let mut q = vec![None; self.joints];
        let mut q_command = vec![None; self.joints];
        let mut direction = vec![0.0; self.joints];
        let mut points = vec![[None; 3]; self.targets + 1];
        let mut quaternion = [None; 4];
        let mut length = None;
        let [mut pair, mut distance, mut point, mut plane] = [None; 4];
        let mut bearings = vec![[None; 2]; self.columns.stations()];
        let mut seen_points = vec![[None; 3]; self.columns.seen()];
        let mut seen_bearings = vec![[None; 2]; self.columns.seen()];
        let mut seen_turn = [None; 4];
        let mut set = None;
        let mut conditions = vec![None; self.condition_columns.len()];
        let mut condition = conditions.iter_mut();
        for column in &self.columns.known {
            let cell = record.get(column.index).unwrap_or("").trim();
            if column.field == Field::Set {
                set = self.set_of(number, line, column, cell)?;
                continue;
            }
            let value = self.value(number, line, column, cell)?;
            if column.field == Field::Length && self.has_position {
                continue;
            }
            let slot = match column.field {
                Field::Joint(k) => q.get_mut(k),
                Field::Command(k) => q_command.get_mut(k),
                Field::Position(t, axis) => points.get_mut(t).and_then(|p| p.get_mut(axis)),
                Field::Quaternion(k) => quaternion.get_mut(k),
                Field::Length => Some(&mut length),
                Field::Pair => Some(&mut pair),
                Field::Distance => Some(&mut distance),
                Field::Point => Some(&mut point),
                Field::Plane => Some(&mut plane),
                Field::Bearing(station, k) => bearings.get_mut(station).and_then(|b| b.get_mut(k)),
                Field::Seen(columns::Seen::Position(thing, axis)) => {
                    seen_points.get_mut(thing).and_then(|p| p.get_mut(axis))
                }
                Field::Seen(columns::Seen::Quaternion(k)) => seen_turn.get_mut(k),
                Field::Seen(columns::Seen::Bearing(thing, k)) => {
                    seen_bearings.get_mut(thing).and_then(|b| b.get_mut(k))
                }
                Field::Direction(k) => {
                    if let Some(slot) = direction.get_mut(k) {
                        *slot = value.unwrap_or(0.0);
                    }
                    None
                }
                Field::Payload
                | Field::PayloadCom(_)
                | Field::Temperature(_)
                | Field::Time
                | Field::Session => condition.next(),
                Field::Set => None,
            };
            if let Some(slot) = slot {
                *slot = value;
            }
        }
        let orientation = self.complete(ORIENTATION, &quaternion, number);
        let orientation = match orientation {
            Some(wxyz) => Some(self.unit(number, line, ORIENTATION, wxyz)?),
            None => None,
        };
        let seen_turn = match self.complete(SEEN_TURN, &seen_turn, number) {
            Some(wxyz) => Some(self.unit(number, line, SEEN_TURN, wxyz)?),
            None => None,
        };
        let seen: Vec<Seen> = seen_points
            .iter()
            .zip(&seen_bearings)
            .map(|(point, bearing)| Seen {
                position: self.complete("seen_x, seen_y, seen_z", point, number),
                bearing: self.complete("seen_azimuth, seen_elevation", bearing, number),
            })
            .collect();
        // a board's turn is told with its place
        let seen_turn = seen_turn.filter(|_| seen.first().is_some_and(|s| s.position.is_some()));
        let mut points = points.iter();
        let position = points
            .next()
            .and_then(|p| self.complete("x, y, z", p, number));
        let targets: Vec<Option<[f64; 3]>> = points
            .zip(2..)
            .map(|(p, n)| self.complete(&format!("x{n}, y{n}, z{n}"), p, number))
            .collect();
        let label = |value: Option<f64>| value.map(|x| x as i64);
        let relations = Relations {
            pair: label(pair),
            distance,
            point: label(point),
            plane: label(plane),
            bearings: bearings
                .iter()
                .map(|b| self.complete("azimuth, elevation", b, number))
                .collect(),
            seen,
            seen_turn,
        };
        let q_command = self.all("qcmd1, ...", &q_command, number);

        let Some(q) = q.iter().copied().collect::<Option<Vec<f64>>>() else {
            return self.without(number, line, "q", "its joints");
        };
        let measured = position.is_some()
            || length.is_some()
            || targets.iter().any(Option::is_some)
            || !relations.is_empty();
        match self.purpose {
            Purpose::Fit | Purpose::Check if !measured => {
                self.left_out.push(number);
                return Ok(());
            }
            Purpose::Targets if position.is_none() || orientation.is_none() => {
                return self.without(number, line, "x, y, z, qw, qx, qy, qz", "its pose");
            }
            _ => {}
        }
        self.rows.push(Row {
            number,
            line,
            q,
            position,
            orientation,
            length,
            targets,
            relations,
            q_command,
            direction,
            payload: None,
            payload_com: None,
            temperature: vec![f64::NAN; self.sensors],
            time: None,
            session: None,
            set: Set::Identify,
        });
        self.sets.push(set);
        for (column, value) in self.conditions.iter_mut().zip(conditions) {
            column.push(value);
        }
        Ok(())
    }

    /// A row that lacks something: left out of measurements, an error elsewhere.
    fn without(
        &mut self,
        number: usize,
        line: usize,
        columns: &str,
        what: &str,
    ) -> Result<(), Error> {
        if self.purpose.leaves_out() {
            self.left_out.push(number);
            return Ok(());
        }
        Err(self.place(number, line).column(columns).bad(
            "a blank cell",
            format!("a row with {what}"),
            "complete or delete the row: the output has one row for each row here",
        ))
    }

    fn value(
        &self,
        number: usize,
        line: usize,
        column: &Column,
        cell: &str,
    ) -> Result<Option<f64>, Error> {
        if cell.is_empty() {
            return Ok(None);
        }
        let bad = |expected: String, advice: &str| {
            let found: String = cell.chars().take(40).collect();
            self.place(number, line).column(&column.name).bad(
                format!("{found:?}"),
                expected,
                advice,
            )
        };
        let blank = "correct the cell, or leave it blank if it was not measured";
        let number = match cell.parse::<f64>() {
            Ok(x) if x.is_finite() => x,
            _ => return Err(bad("a finite number".to_owned(), blank)),
        };
        let value = number * column.factor;
        let unit = column.quantity.unit();
        let is_sign = number.fract() == 0.0 && number.abs() <= 1.0;
        match column.field {
            _ if value.abs() > LARGEST => Err(bad(format!("at most {LARGEST:e} {unit}"), blank)),
            Field::Direction(_) if !is_sign => {
                let expected = "-1, 0 or 1: the sign of the joint's last move".to_owned();
                Err(bad(
                    expected,
                    "correct the cell, or leave it blank if it is not known",
                ))
            }
            Field::Session | Field::Pair | Field::Point | Field::Plane if number.fract() != 0.0 => {
                Err(bad("an integer".to_owned(), blank))
            }
            Field::Bearing(_, 1) | Field::Seen(columns::Seen::Bearing(_, 1))
                if value.abs() > HIGHEST =>
            {
                Err(bad(
                    "an elevation within 89 deg of level: the azimuth means nothing at the zenith"
                        .to_owned(),
                    "check the unit and the order of the columns, or blank the row",
                ))
            }
            Field::Bearing(_, 0) | Field::Seen(columns::Seen::Bearing(_, 0))
                if value.abs() > 4.0 * std::f64::consts::PI =>
            {
                Err(bad(
                    "an angle within two turns, rad".to_owned(),
                    "if the column is in degrees, name it with _deg at the end",
                ))
            }
            Field::Length | Field::Distance if value <= 0.0 => {
                Err(bad("a length above zero".to_owned(), blank))
            }
            _ => Ok(Some(value)),
        }
    }

    fn set_of(
        &self,
        number: usize,
        line: usize,
        column: &Column,
        cell: &str,
    ) -> Result<Option<Set>, Error> {
        match cell {
            "" => Ok(None),
            "identify" => Ok(Some(Set::Identify)),
            "verify" => Ok(Some(Set::Verify)),
            other => Err(self.place(number, line).column(&column.name).bad(
                format!("{other:?}"),
                "identify or verify",
                "correct the cell, or leave it blank to let the program decide",
            )),
        }
    }

    fn unit(
        &self,
        number: usize,
        line: usize,
        columns: &str,
        wxyz: [f64; 4],
    ) -> Result<[f64; 4], Error> {
        let norm = wxyz.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > QUATERNION_SLACK {
            return Err(self.place(number, line).column(columns).bad(
                format!("a quaternion of length {norm:.4}"),
                "length 1",
                "check the order w, x, y, z and that no component is missing",
            ));
        }
        Ok(wxyz.map(|x| x / norm))
    }

    /// All of a group, or none; a group with some blanks is noted.
    fn complete<const K: usize>(
        &mut self,
        name: &str,
        values: &[Option<f64>; K],
        number: usize,
    ) -> Option<[f64; K]> {
        self.all(name, values, number)?.try_into().ok()
    }

    fn all(&mut self, name: &str, values: &[Option<f64>], number: usize) -> Option<Vec<f64>> {
        let all: Option<Vec<f64>> = values.iter().copied().collect();
        if all.is_none() && values.iter().any(Option::is_some) {
            match self.partly.iter_mut().find(|(n, _)| n == name) {
                Some((_, rows)) => rows.push(number),
                None => self.partly.push((name.to_owned(), vec![number])),
            }
        }
        all
    }

    fn finish(mut self) -> (Dataset, Vec<Option<Set>>) {
        let file = || self.file.to_path_buf();
        let mut warnings = Vec::new();
        if !self.columns.unknown.is_empty() {
            warnings.push(Warning::UnknownColumns {
                file: file(),
                columns: self.columns.unknown.clone(),
            });
        }
        if self.has_position && self.columns.get(Field::Length).is_some() {
            warnings.push(Warning::LengthUnused { file: file() });
        }
        for (columns, rows) in self.partly {
            warnings.push(Warning::PartlyMeasured {
                file: file(),
                columns,
                rows,
            });
        }
        if !self.left_out.is_empty() {
            warnings.push(Warning::RowsLeftOut {
                file: file(),
                rows: self.left_out.clone(),
            });
        }
        let mut available = Available {
            direction: self
                .columns
                .known
                .iter()
                .any(|c| matches!(c.field, Field::Direction(_))),
            command: self.rows.iter().any(|r| r.q_command.is_some()),
            set: self.columns.get(Field::Set).is_some(),
            ..Available::default()
        };
        for (column, values) in self.condition_columns.iter().zip(&self.conditions) {
            if values.iter().all(Option::is_none) {
                continue;
            }
            note(&mut available, column.field);
            let mut blank = Vec::new();
            for (row, value) in self.rows.iter_mut().zip(values) {
                match value {
                    Some(value) => set_condition(row, column.field, *value),
                    None => blank.push(row.number),
                }
            }
            if !blank.is_empty() {
                warnings.push(Warning::ConditionBlank {
                    file: file(),
                    column: column.name.clone(),
                    rows: blank,
                });
            }
        }
        let dataset = Dataset {
            file: file(),
            joints: self.joints,
            measured: measured(&self.rows),
            rows: self.rows,
            left_out: self.left_out,
            held_back: Vec::new(),
            available,
            noise: Noise::default(),
            target_offsets: vec![[0.0; 3]; self.targets],
            targets_known: false,
            warnings,
        };
        (dataset, self.sets)
    }
}

fn measured(rows: &[Row]) -> Measured {
    let seen = |is: fn(&Seen) -> bool| rows.iter().any(|r| r.relations.seen.iter().any(is));
    if rows
        .iter()
        .any(|r| r.orientation.is_some() && r.position.is_some())
    {
        Measured::Pose
    } else if rows
        .iter()
        .any(|r| r.position.is_some() || r.targets.iter().any(Option::is_some))
    {
        Measured::Position
    } else if rows.iter().any(|r| r.length.is_some()) {
        Measured::Length
    } else if rows
        .iter()
        .any(|r| r.relations.bearings.iter().any(Option::is_some))
    {
        Measured::Bearing
    } else if rows.iter().any(|r| r.relations.distance.is_some()) {
        Measured::Distance
    } else if rows.iter().any(|r| r.relations.point.is_some()) {
        Measured::Point
    } else if rows.iter().any(|r| r.relations.plane.is_some()) {
        Measured::Plane
    } else if rows.iter().any(|r| r.relations.seen_turn.is_some()) {
        Measured::Board
    } else if seen(|s| s.position.is_some()) {
        Measured::Mark
    } else if seen(|s| s.bearing.is_some()) {
        Measured::Sight
    } else {
        Measured::Nothing
    }
}

fn note(available: &mut Available, field: Field) {
    match field {
        Field::Payload => available.payload = true,
        Field::PayloadCom(_) => available.payload_com = true,
        Field::Temperature(k) => available.temperature = available.temperature.max(k + 1),
        Field::Time => available.time = true,
        Field::Session => available.session = true,
        _ => {}
    }
}

fn set_condition(row: &mut Row, field: Field, value: f64) {
    match field {
        Field::Payload => row.payload = Some(value),
        Field::PayloadCom(axis) => {
            let com = row.payload_com.get_or_insert_default();
            if let Some(slot) = com.get_mut(axis) {
                *slot = value;
            }
        }
        Field::Temperature(k) => {
            if let Some(slot) = row.temperature.get_mut(k) {
                *slot = value;
            }
        }
        Field::Time => row.time = Some(value),
        Field::Session => row.session = Some(value as i64),
        _ => {}
    }
}
