//! What the header row says.

use std::path::Path;

use truepose::JointKind;
use truepose::effects::MAX_SENSORS;

use super::{Expected, Purpose};
use crate::error::{Error, Place};
use crate::units::{Quantity, split_suffix};

/// Meaning of one column. All indices count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Field {
    Joint(usize),
    Command(usize),
    Direction(usize),
    /// Target (0: the tool point) and axis.
    Position(usize, usize),
    /// w, x, y, z.
    Quaternion(usize),
    Length,
    /// Number of a pair of rows.
    Pair,
    Distance,
    /// Number of a fixed point.
    Point,
    /// Number of a fixed plane.
    Plane,
    /// Station, and 0 for the azimuth, 1 for the elevation.
    Bearing(usize, usize),
    /// What an instrument on the tool sees of fixed things.
    Seen(Seen),
    Payload,
    PayloadCom(usize),
    Temperature(usize),
    Time,
    Session,
    Set,
}

/// Columns `seen_x` and on, in the tool's own frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Seen {
    /// Fixed thing (0: the board, or the first point) and axis.
    Position(usize, usize),
    /// Of the board: w, x, y, z.
    Quaternion(usize),
    /// Fixed thing, and 0 for the azimuth, 1 for the elevation.
    Bearing(usize, usize),
}

/// A column with a meaning.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub(super) field: Field,
    /// As the file spells it.
    pub(super) name: String,
    /// Place in the row, from 0.
    pub(super) index: usize,
    /// Times this gives SI.
    pub(super) factor: f64,
    pub(super) quantity: Quantity,
}

/// The header row, understood.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    pub(super) known: Vec<Column>,
    /// Names of the others.
    pub(super) unknown: Vec<String>,
    /// Number of columns, known or not.
    pub(super) width: usize,
    /// Line of the file that the names stand in.
    pub(super) line: usize,
}

const AXES: [&str; 3] = ["x", "y", "z"];
const BEARING: [&str; 2] = ["azimuth", "elevation"];
const QUATERNION: [&str; 4] = ["qw", "qx", "qy", "qz"];
const SEEN: &str = "seen_";

impl Columns {
    /// Reads the header row `names` and checks that what `purpose` needs is there.
    pub(super) fn of(
        file: &Path,
        line: usize,
        names: &[String],
        expected: &Expected,
        purpose: Purpose,
    ) -> Result<Self, Error> {
        let mut columns = Self {
            width: names.len(),
            line,
            ..Self::default()
        };
        for (index, name) in names.iter().enumerate() {
            let (base, suffix) = split_suffix(name);
            let Some(field) = field(base) else {
                columns.unknown.push(if name.is_empty() {
                    format!("(column {} has no name)", index + 1)
                } else {
                    name.clone()
                });
                continue;
            };
            let place = || Place::line(file, line).column(name);
            let quantity = quantity(field, expected)
                .ok_or_else(|| wrong_joint(place(), name, expected.kinds.len()))?;
            if let Some(twin) = columns.known.iter().find(|c| c.field == field) {
                return Err(place().bad(
                    format!("{name} beside {}", twin.name),
                    "each quantity once",
                    "delete or rename one of the two columns",
                ));
            }
            let factor = match suffix {
                None => 1.0,
                Some(suffix) if suffix.quantity == quantity => suffix.factor,
                Some(suffix) => {
                    let unit = match quantity {
                        Quantity::Length => "a length: m, or a name ending in _mm or _um",
                        Quantity::Angle => "an angle: rad, or a name ending in _deg",
                        Quantity::Other => "a number without unit suffix",
                    };
                    return Err(place().bad(
                        format!("the unit suffix {}", suffix.text),
                        unit,
                        "correct the name",
                    ));
                }
            };
            columns.known.push(Column {
                field,
                name: name.clone(),
                index,
                factor,
                quantity,
            });
        }
        columns.check(file, names, expected, purpose)?;
        Ok(columns)
    }

    /// The column of a field.
    pub(super) fn get(&self, field: Field) -> Option<&Column> {
        self.known.iter().find(|c| c.field == field)
    }

    fn has(&self, field: Field) -> bool {
        self.get(field).is_some()
    }

    /// Number of targets, the tool point included.
    pub(super) fn targets(&self) -> usize {
        let count = |c: &Column| match c.field {
            Field::Position(target, _) => target + 1,
            _ => 0,
        };
        self.known.iter().map(count).max().unwrap_or(0)
    }

    /// Number of stations that bearings are taken from.
    pub(super) fn stations(&self) -> usize {
        let count = |c: &Column| match c.field {
            Field::Bearing(station, _) => station + 1,
            _ => 0,
        };
        self.known.iter().map(count).max().unwrap_or(0)
    }

    /// Number of fixed things that an instrument on the tool sees.
    pub(super) fn seen(&self) -> usize {
        let count = |c: &Column| match c.field {
            Field::Seen(Seen::Position(thing, _) | Seen::Bearing(thing, _)) => thing + 1,
            _ => 0,
        };
        self.known.iter().map(count).max().unwrap_or(0)
    }

    /// Columns of [`super::Relations`].
    pub(super) fn relations(&self) -> Vec<&Column> {
        let is = |c: &&Column| c.field.is_relation();
        self.known.iter().filter(is).collect()
    }

    /// Number of temperature sensors.
    pub(super) fn sensors(&self) -> usize {
        let is = |c: &&Column| matches!(c.field, Field::Temperature(_));
        self.known.iter().filter(is).count()
    }

    /// Every group of columns is complete, and what the purpose needs is there.
    fn check(
        &self,
        file: &Path,
        names: &[String],
        expected: &Expected,
        purpose: Purpose,
    ) -> Result<(), Error> {
        let missing = |name: &str, why: String| {
            let advice = match names {
                [one] if one.contains([';', '\t']) => {
                    "separate the columns by commas, with a point in the numbers".to_owned()
                }
                _ if names.iter().any(|n| n.eq_ignore_ascii_case(name)) => {
                    "column names are in lower case".to_owned()
                }
                _ if names.iter().all(|n| n.parse::<f64>().is_ok()) => {
                    "the first row must name the columns".to_owned()
                }
                _ => format!("add it; the columns here are {}", names.join(", ")),
            };
            Place::line(file, self.line)
                .column(name)
                .bad("no such column", why, advice)
        };
        let joints = expected.kinds.len();
        for k in 0..joints {
            if !self.has(Field::Joint(k)) {
                let why = format!("q1 to q{joints}, one a joint of the robot");
                return Err(missing(&format!("q{}", k + 1), why));
            }
        }
        if (0..joints).any(|k| self.has(Field::Command(k))) {
            for k in 0..joints {
                if !self.has(Field::Command(k)) {
                    let why = format!("qcmd1 to qcmd{joints}, or none of them");
                    return Err(missing(&format!("qcmd{}", k + 1), why));
                }
            }
        }
        self.check_seen(file, purpose, &missing)?;
        for target in 0..self.targets() {
            let number = if target == 0 {
                String::new()
            } else {
                (target + 1).to_string()
            };
            for (axis, name) in AXES.iter().enumerate() {
                if !self.has(Field::Position(target, axis)) {
                    let why = "x, y and z of every target, targets counted from 2 on".to_owned();
                    return Err(missing(&format!("{name}{number}"), why));
                }
            }
        }
        for station in 0..self.stations() {
            let number = match station {
                0 => String::new(),
                _ => (station + 1).to_string(),
            };
            for (k, name) in BEARING.iter().enumerate() {
                if !self.has(Field::Bearing(station, k)) {
                    let why = "azimuth and elevation of every station, stations counted from 2 on";
                    return Err(missing(&format!("{name}{number}"), why.to_owned()));
                }
            }
        }
        if self.has(Field::Distance) && !self.has(Field::Pair) {
            let why = "pair beside distance: which two rows it is between".to_owned();
            return Err(missing("pair", why));
        }
        if self.has(Field::Pair) && !self.has(Field::Distance) {
            let why = "distance beside pair: how far its two rows are apart".to_owned();
            return Err(missing("distance", why));
        }
        let has_position = self.targets() > 0;
        let has_orientation = (0..4).any(|c| self.has(Field::Quaternion(c)));
        let needs_pose = purpose == Purpose::Targets;
        let otherwise = self.has(Field::Length) || !self.relations().is_empty();
        let needs_position = needs_pose || has_orientation || (purpose.leaves_out() && !otherwise);
        if needs_position && !has_position {
            let why = match purpose {
                Purpose::Targets => "x, y, z, qw, qx, qy, qz: the pose to reach".to_owned(),
                _ if has_orientation => "x, y, z beside qw, qx, qy, qz".to_owned(),
                _ => "something measured: x, y, z, or a pose with qw, qx, qy, qz, or length, or \
                      azimuth and elevation, pair and distance, point, plane, or what a camera on \
                      the tool sees: seen_x and on"
                    .to_owned(),
            };
            return Err(missing("x", why));
        }
        if needs_pose || has_orientation {
            for (c, name) in QUATERNION.iter().enumerate() {
                if !self.has(Field::Quaternion(c)) {
                    let why = "the whole quaternion qw, qx, qy, qz".to_owned();
                    return Err(missing(name, why));
                }
            }
        }
        for k in 0..self.sensors() {
            if !self.has(Field::Temperature(k)) {
                let why = "temp1, temp2, ... without gaps".to_owned();
                return Err(missing(&format!("temp{}", k + 1), why));
            }
        }
        if (0..3).any(|k| self.has(Field::PayloadCom(k))) {
            for (k, axis) in AXES.iter().enumerate() {
                if !self.has(Field::PayloadCom(k)) {
                    let why = "payload_com_x, payload_com_y and payload_com_z".to_owned();
                    return Err(missing(&format!("payload_com_{axis}"), why));
                }
            }
        }
        Ok(())
    }
}

impl Columns {
    /// What an instrument on the tool sees is complete, and nothing else is measured.
    fn check_seen(
        &self,
        file: &Path,
        purpose: Purpose,
        missing: &dyn Fn(&str, String) -> Error,
    ) -> Result<(), Error> {
        let is_seen = |c: &&Column| matches!(c.field, Field::Seen(_));
        let Some(first) = self.known.iter().find(is_seen) else {
            return Ok(());
        };
        let from_beside = |c: &&Column| {
            matches!(
                c.field,
                Field::Position(..) | Field::Quaternion(_) | Field::Length
            ) || c.field.is_relation() && !is_seen(c)
        };
        if purpose.leaves_out()
            && let Some(other) = self.known.iter().find(from_beside)
        {
            return Err(Place::line(file, self.line).column(&other.name).bad(
                format!("{} beside {}", other.name, first.name),
                "either what an instrument on the tool sees, or what one beside the arm does: \
                 the tool's frame is the one's own and the other's target",
                "put them into two tables, or rename the columns that are not to count",
            ));
        }
        let has = |seen: Seen| self.has(Field::Seen(seen));
        for thing in 0..self.seen() {
            let number = match thing {
                0 => String::new(),
                _ => (thing + 1).to_string(),
            };
            let any = |one: &dyn Fn(usize) -> Seen, count| (0..count).any(|k| has(one(k)));
            let position = |k| Seen::Position(thing, k);
            let bearing = |k| Seen::Bearing(thing, k);
            let at = any(&position, 3);
            let towards = any(&bearing, 2);
            for (k, axis) in AXES.iter().enumerate() {
                if (at || !towards) && !has(position(k)) {
                    let why = "seen_x, seen_y, seen_z (or seen_azimuth, seen_elevation) of every \
                               fixed thing, counted from 2 on"
                        .to_owned();
                    return Err(missing(&format!("{SEEN}{axis}{number}"), why));
                }
            }
            for (k, name) in BEARING.iter().enumerate() {
                if towards && !has(bearing(k)) {
                    let why = "seen_azimuth and seen_elevation of every fixed thing, counted \
                               from 2 on"
                        .to_owned();
                    return Err(missing(&format!("{SEEN}{name}{number}"), why));
                }
            }
        }
        let turned = (0..4).any(|k| has(Seen::Quaternion(k)));
        for (k, name) in QUATERNION.iter().enumerate() {
            if turned && !has(Seen::Quaternion(k)) {
                let why = "the whole quaternion seen_qw, seen_qx, seen_qy, seen_qz".to_owned();
                return Err(missing(&format!("{SEEN}{name}"), why));
            }
        }
        for (k, axis) in AXES.iter().enumerate() {
            if turned && !has(Seen::Position(0, k)) {
                let why = "seen_x, seen_y, seen_z beside seen_qw, seen_qx, seen_qy, seen_qz";
                return Err(missing(&format!("{SEEN}{axis}"), why.to_owned()));
            }
        }
        Ok(())
    }
}

impl Field {
    /// True for what binds the tool point without giving it.
    pub(super) fn is_relation(self) -> bool {
        matches!(
            self,
            Self::Pair
                | Self::Distance
                | Self::Point
                | Self::Plane
                | Self::Bearing(..)
                | Self::Seen(_)
        )
    }
}

/// The meaning of a name without its unit; `None` for names that have none.
fn field(name: &str) -> Option<Field> {
    if let Some(seen) = name.strip_prefix(SEEN) {
        return match field(seen)? {
            Field::Position(thing, axis) => Some(Field::Seen(Seen::Position(thing, axis))),
            Field::Quaternion(k) => Some(Field::Seen(Seen::Quaternion(k))),
            Field::Bearing(thing, k) => Some(Field::Seen(Seen::Bearing(thing, k))),
            _ => None,
        };
    }
    let axis = |letter: &str| AXES.iter().position(|a| *a == letter);
    match name {
        "length" => return Some(Field::Length),
        "pair" => return Some(Field::Pair),
        "distance" => return Some(Field::Distance),
        "point" => return Some(Field::Point),
        "plane" => return Some(Field::Plane),
        "payload" => return Some(Field::Payload),
        "temp" => return Some(Field::Temperature(0)),
        "t" => return Some(Field::Time),
        "session" => return Some(Field::Session),
        "set" => return Some(Field::Set),
        _ => {}
    }
    if let Some(k) = QUATERNION.iter().position(|q| *q == name) {
        return Some(Field::Quaternion(k));
    }
    if let Some(k) = BEARING.iter().position(|b| *b == name) {
        return Some(Field::Bearing(0, k));
    }
    if let Some(letter) = name.strip_prefix("payload_com_") {
        return axis(letter).map(Field::PayloadCom);
    }
    if let Some(axis) = axis(name) {
        return Some(Field::Position(0, axis));
    }
    let digits = name.find(|c: char| c.is_ascii_digit())?;
    let (word, number) = name.split_at(digits);
    if number.starts_with('0') && number.len() > 1 {
        return None;
    }
    let number: usize = number.parse().ok()?;
    // A joint 0 is a joint that no robot has: it is refused, not ignored.
    let joint = number.wrapping_sub(1);
    match word {
        "q" => Some(Field::Joint(joint)),
        "qcmd" => Some(Field::Command(joint)),
        "dir" => Some(Field::Direction(joint)),
        "temp" if (1..=MAX_SENSORS).contains(&number) => Some(Field::Temperature(number - 1)),
        _ if (2..=MAX_TARGETS).contains(&number) => match BEARING.iter().position(|b| *b == word) {
            Some(k) => Some(Field::Bearing(number - 1, k)),
            None => axis(word).map(|axis| Field::Position(number - 1, axis)),
        },
        _ => None,
    }
}

/// Targets, and stations, that a table may have.
const MAX_TARGETS: usize = 64;

/// What a field measures; `None` for a joint that the robot does not have.
fn quantity(field: Field, expected: &Expected) -> Option<Quantity> {
    Some(match field {
        Field::Joint(k) | Field::Command(k) => match expected.kinds.get(k)? {
            JointKind::Revolute => Quantity::Angle,
            JointKind::Prismatic => Quantity::Length,
        },
        Field::Direction(k) => {
            expected.kinds.get(k)?;
            Quantity::Other
        }
        Field::Position(..)
        | Field::Length
        | Field::Distance
        | Field::PayloadCom(_)
        | Field::Seen(Seen::Position(..)) => Quantity::Length,
        Field::Bearing(..) | Field::Seen(Seen::Bearing(..)) => Quantity::Angle,
        Field::Quaternion(_)
        | Field::Seen(Seen::Quaternion(_))
        | Field::Pair
        | Field::Point
        | Field::Plane
        | Field::Payload
        | Field::Temperature(_)
        | Field::Time
        | Field::Session
        | Field::Set => Quantity::Other,
    })
}

fn wrong_joint(place: Place, name: &str, joints: usize) -> Error {
    place.bad(
        format!("a column {name}"),
        format!("joints 1 to {joints}: the robot has {joints}"),
        "take the robot file that belongs to this table, or delete the column",
    )
}
