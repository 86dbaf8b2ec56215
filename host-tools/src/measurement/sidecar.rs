//! `NAME.toml` beside `NAME.csv`: the instrument's noise and the further targets.

use super::{Dataset, Noise};
use crate::error::{Error, read_text};
use crate::keys::{Document, Table};
use crate::units::Quantity;
use crate::warning::Warning;

/// Reads the sidecar into `dataset`, if there is one.
pub(super) fn read(dataset: &mut Dataset) -> Result<(), Error> {
    let file = dataset.file.with_extension("toml");
    let is_there = file.is_file() && file != dataset.file;
    if is_there {
        let text = read_text(&file)?;
        let document = Document {
            file: &file,
            text: &text,
        };
        let root = document.parse()?;
        let mut table = Table::root(document, &root);
        if table.has("joint") {
            dataset
                .warnings
                .push(Warning::NotASidecar { file: file.clone() });
        } else {
            dataset.noise = Noise {
                position: sigma(&mut table, "position_sigma", Quantity::Length)?,
                orientation: sigma(&mut table, "orientation_sigma", Quantity::Angle)?,
                length: sigma(&mut table, "length_sigma", Quantity::Length)?,
                distance: sigma(&mut table, "distance_sigma", Quantity::Length)?,
                contact: sigma(&mut table, "contact_sigma", Quantity::Length)?,
                bearing: sigma(&mut table, "bearing_sigma", Quantity::Angle)?,
            };
            let offsets = table.lists::<3>("targets", Quantity::Length)?;
            if offsets.len() > dataset.target_offsets.len() {
                return Err(table.place_of("targets").bad(
                    format!("offsets of {} further targets", offsets.len()),
                    format!(
                        "{}, as {} has columns x2, y2, z2 and on",
                        dataset.target_offsets.len(),
                        dataset.file.display()
                    ),
                    "delete offsets or add columns",
                ));
            }
            dataset.targets_known = table.flag("targets_known")?;
            if dataset.targets_known && offsets.len() < dataset.target_offsets.len() {
                return Err(table.place_of("targets_known").bad(
                    format!("offsets of {} further targets", offsets.len()),
                    format!("{}, one a further target", dataset.target_offsets.len()),
                    "give them all in targets_mm, or delete targets_known",
                ));
            }
            table.finish()?;
            let given = offsets.len();
            for (to, from) in dataset.target_offsets.iter_mut().zip(offsets) {
                *to = from;
            }
            return note_missing(dataset, given, file);
        }
    }
    note_missing(dataset, 0, file)
}

fn note_missing(
    dataset: &mut Dataset,
    given: usize,
    file: std::path::PathBuf,
) -> Result<(), Error> {
    let targets: Vec<usize> = (given..dataset.target_offsets.len())
        .map(|k| k + 2)
        .collect();
    if !targets.is_empty() {
        dataset
            .warnings
            .push(Warning::NoTargetOffset { file, targets });
    }
    Ok(())
}

fn sigma(table: &mut Table<'_, '_>, key: &str, quantity: Quantity) -> Result<Option<f64>, Error> {
    let sigma = table.number(key, quantity)?;
    match sigma {
        Some(s) if s <= 0.0 => Err(table.place_of(key).bad(
            format!("{s}"),
            "a standard deviation above zero",
            "correct it, or delete it if it is not known",
        )),
        _ => Ok(sigma),
    }
}
