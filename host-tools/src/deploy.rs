//! From an identification to the bytes that the controller holds.

use std::path::Path;

use truepose::effects::{Effect, Place};
use truepose::params::{Blob, BlobError, Description, MAX_JOINTS, Provenance, UNLIMITED};
use truepose::taught::Taught;
use truepose::{LinkMass, Settings};

use crate::description::Robot;
use crate::diagnose::clock::needs_time;
use crate::error::Error;
use crate::identify::arm::ArmModel;
use crate::identify::{Calibration, Stage};

/// Room for the largest blob without taught corrections: 12 joints, 64 effects with their
/// tables.
const LARGEST_BLOB: usize = 1 << 20;

/// What the blob says of its own origin besides the arm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    /// Rows that the fit used.
    pub rows_identify: usize,
    /// Rows held back.
    pub rows_verify: usize,
    /// Rms of the verify rows before and after, m.
    pub rms: [f64; 2],
}

/// The blob of a calibrated robot. `data`: the measurements' file. Of several placements of
/// the instrument the first is the world.
pub fn blob(
    robot: &Robot,
    calibration: &Calibration,
    data: &Path,
    origin: &Origin,
) -> Result<Vec<u8>, Error> {
    let many = |what: &str| {
        Error::Usage(format!(
            "{}: too many {what} for the controller",
            robot.source.display()
        ))
    };
    let limits = robot.joints.iter().map(|j| j.limits.unwrap_or(UNLIMITED));
    let resolution = robot.joints.iter().map(|j| j.resolution.unwrap_or(0.0));
    let joints_fit = robot.joints.len() <= MAX_JOINTS;
    if !joints_fit {
        return Err(many("joints"));
    }
    let calibrated = &calibration.complete;
    let mut effects = heapless::Vec::new();
    for effect in identified_effects(calibrated) {
        effects.push(effect).map_err(|_| many("effects"))?;
    }
    let data = data.file_name().unwrap_or_default().to_string_lossy();
    let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let [rms_before, rms_after] = origin.rms;
    let blob = Blob {
        robot: short(&robot.name),
        nominal: described(&calibration.nominal.arm),
        calibrated: described(&calibrated.arm),
        limits: limits.collect(),
        resolution: resolution.collect(),
        gravity: robot.gravity.into(),
        effects,
        settings: Settings::default(),
        provenance: Provenance {
            tool: short(concat!("truepose ", env!("CARGO_PKG_VERSION"))),
            data: short(&data),
            date: heapless::String::new(),
            rows_identify: count(origin.rows_identify),
            rows_verify: count(origin.rows_verify),
            rms_before,
            rms_after,
        },
        taught: Taught::default(),
    };
    encoded(&blob).map_err(|cause| {
        Error::Usage(format!(
            "{}: the identified arm has no blob: {cause}",
            robot.source.display()
        ))
    })
}

/// The bytes of a blob.
pub fn encoded(blob: &Blob<'_>) -> Result<Vec<u8>, BlobError> {
    let taught = &blob.taught;
    let polynomial = taught
        .polynomial
        .as_ref()
        .map_or(0, |p| 4 * p.coefficients());
    let cmac = taught.cmac.as_ref().map_or(0, |c| c.table.len());
    let mut buffer = vec![0; LARGEST_BLOB + polynomial + cmac];
    Ok(blob.encode(&mut buffer)?.to_vec())
}

/// Effects of which the fit found any value; the others are zero. What drifts with the rows of
/// a file that has no time is none of the arm's clock.
fn identified_effects(stage: &Stage) -> impl Iterator<Item = Effect<'static, f64>> {
    let zero = |x: &f64| x.abs() < f64::MIN_POSITIVE;
    stage
        .arm
        .effects
        .iter()
        .filter(move |e| !e.model().values().iter().all(zero))
        .filter(|e| !moves_the_world(e))
        .filter(|e| !(stage.arm.counts_rows && needs_time(e)))
        .copied()
}

/// A base that jumped: the world is the first placement's, as with sessions, and nothing that
/// happened to the instrument later is compensated.
fn moves_the_world(effect: &Effect<'_, f64>) -> bool {
    matches!(effect, Effect::StepChange(step) if matches!(step.place, Place::Base { .. }))
}

fn described(arm: &ArmModel) -> Description {
    let masses = arm.masses.iter().copied();
    let none = std::iter::repeat(LinkMass::none());
    Description {
        base: arm
            .bases
            .first()
            .map_or_else(|| (&truepose::Pose::identity()).into(), |base| base.into()),
        joints: arm.joints.iter().copied().take(MAX_JOINTS).collect(),
        masses: masses.chain(none).take(arm.joints.len()).collect(),
        tool: (&arm.tool).into(),
    }
}

/// As much of `text` as fits.
fn short<const N: usize>(text: &str) -> heapless::String<N> {
    let mut out = heapless::String::new();
    for letter in text.chars() {
        if out.push(letter).is_err() {
            break;
        }
    }
    out
}
