//! What a table says of a robot that nobody has described.

use std::path::Path;

use truepose::JointKind;

use super::Expected;
use crate::error::{Error, Place, read_text};
use crate::units::{Quantity, split_suffix};

impl Expected {
    /// Of the columns `q1` .. `qN` of a table, and the kinds that their units tell; a column
    /// without a unit is taken for a revolute joint's here.
    pub fn of_table(file: &Path) -> Result<(Self, Vec<Option<JointKind>>), Error> {
        let text = read_text(file)?;
        let header = text
            .lines()
            .find(|line| !line.trim_start().starts_with('#') && !line.trim().is_empty());
        let names: Vec<&str> = header.unwrap_or("").split(',').map(str::trim).collect();
        let kind = |joint: usize| {
            let wanted = format!("q{joint}");
            names.iter().find_map(|name| {
                let (base, suffix) = split_suffix(name);
                (base == wanted).then(|| match suffix.map(|s| s.quantity) {
                    Some(Quantity::Angle) => Some(JointKind::Revolute),
                    Some(Quantity::Length) => Some(JointKind::Prismatic),
                    _ => None,
                })
            })
        };
        let kinds: Vec<Option<JointKind>> = (1..).map_while(kind).collect();
        if kinds.is_empty() {
            return Err(Place::file(file).bad(
                "no column q1",
                "a header row naming q1 .. qN and x, y, z",
                "check that it is the right file",
            ));
        }
        let expected = Self {
            limits: vec![None; kinds.len()],
            reach: None,
            kinds: kinds
                .iter()
                .map(|kind| kind.unwrap_or(JointKind::Revolute))
                .collect(),
        };
        Ok((expected, kinds))
    }
}
