//! Everything that `docs/BLOB.md` promises of a body, looked at while going through it once.

use serde::Deserialize;

use super::body::Body;
use super::{BlobError, LABEL, MAX_JOINTS, NAME, UNLIMITED, WITHOUT_TABLES};
use crate::chain::LinkMass;
use crate::effects::Effect;
use crate::model::MAX_EFFECTS;
use crate::taught::{self, Cmac, Polynomial};
use crate::{Joint, JointKind, Method, Settings, StoredPose};

/// A body under examination. The refusals rank as `docs/BLOB.md` orders them: what does not
/// follow the layout ends the examination, the others are kept, the first of each rank.
struct Examination<'a> {
    body: Body<'a>,
    /// Joints that the header promises.
    joints: usize,
    /// Lists of another length than that.
    lists: Option<BlobError>,
    /// Values that cannot be meant.
    meaning: Option<BlobError>,
}

/// Refuses a body of `layout` for `joints` joints that is not what it should be.
#[inline(never)]
pub(super) fn check(body: &[u8], layout: u16, joints: usize) -> Result<(), BlobError> {
    let mut look = Examination {
        body: Body::new(body),
        joints,
        lists: None,
        meaning: None,
    };
    if joints == 0 {
        look.lists = Some(BlobError::Joints {
            found: 0,
            expected: 1,
        });
    }
    look.body.text(NAME)?;
    let nominal = look.description()?;
    let calibrated = look.description()?;
    let other = nominal ^ calibrated;
    if other != 0 {
        let joint = number(other.trailing_zeros() as usize);
        look.note(false, BlobError::Kind { joint });
    }
    look.commands()?;
    look.effects()?;
    // In single precision as well as the effects.
    let settings: Settings<f32> = look.take()?;
    look.note(settings.sound(), BlobError::Settings);
    look.provenance()?;
    look.taught(layout, settings.method)?;
    let bytes = look.body.rest();
    if bytes != 0 {
        return Err(BlobError::Trailing { bytes });
    }
    let numbers = look.body.unsound().then_some(BlobError::Number);
    match look.lists.or(numbers).or(look.meaning) {
        None => Ok(()),
        Some(refusal) => Err(refusal),
    }
}

/// What is counted from 0, counted from 1.
fn number(j: usize) -> u8 {
    u8::try_from(j).unwrap_or(u8::MAX).saturating_add(1)
}

impl<'a> Examination<'a> {
    fn take<V: Deserialize<'a>>(&mut self) -> Result<V, BlobError> {
        self.body.take()
    }

    /// Length of a list of joints.
    fn list(&mut self) -> Result<usize, BlobError> {
        let found = self.body.count(MAX_JOINTS)?;
        let expected = self.joints;
        if found != expected {
            self.lists
                .get_or_insert(BlobError::Joints { found, expected });
        }
        Ok(found)
    }

    fn note(&mut self, sound: bool, refusal: BlobError) {
        if !sound {
            self.meaning.get_or_insert(refusal);
        }
    }

    /// A description. Returns its prismatic joints, a bit each.
    fn description(&mut self) -> Result<u16, BlobError> {
        let _base: StoredPose = self.take()?;
        let mut prismatic = 0;
        for j in 0..self.list()? {
            let one: Joint<f64> = self.take()?;
            prismatic |= u16::from(one.kind == JointKind::Prismatic) << j;
            let unit = (one.axis.norm_squared() - 1.0).abs() <= 1e-6;
            self.note(unit, BlobError::Axis { joint: number(j) });
        }
        for j in 0..self.list()? {
            let link: LinkMass<f64> = self.take()?;
            self.note(link.mass >= 0.0, BlobError::Mass { joint: number(j) });
        }
        let _tool: StoredPose = self.take()?;
        Ok(prismatic)
    }

    /// Limits and resolutions of the joint commands, gravity.
    fn commands(&mut self) -> Result<(), BlobError> {
        let [lowest, highest] = UNLIMITED;
        for j in 0..self.list()? {
            let [low, high]: [f64; 2] = self.take()?;
            let sound = low <= high && low >= lowest && high <= highest;
            self.note(sound, BlobError::Limits { joint: number(j) });
        }
        for j in 0..self.list()? {
            let resolution: f64 = self.take()?;
            self.note(
                resolution >= 0.0,
                BlobError::Resolution { joint: number(j) },
            );
        }
        let _gravity: [f64; 3] = self.take()?;
        Ok(())
    }

    fn effects(&mut self) -> Result<(), BlobError> {
        for k in 0..self.body.count(MAX_EFFECTS)? {
            // In single precision for one reader of effects less in a controller's program: all that
            // is looked at here are integers.
            let effect: Effect<'a, f32> = self.take()?;
            let sound = effect.is_sound(self.joints);
            self.note(sound, BlobError::Effect { effect: number(k) });
        }
        Ok(())
    }

    /// Tables, where the layout has any, and those that `method` needs. Each is gone before the
    /// next is taken.
    fn taught(&mut self, layout: u16, method: Method) -> Result<(), BlobError> {
        let (mut polynomial, mut cmac) = (false, false);
        if layout > WITHOUT_TABLES {
            polynomial = self.polynomial()?;
            cmac = self.cmac()?;
        }
        let there = taught::suffices(method, polynomial, cmac);
        self.note(there, BlobError::NotTaught);
        Ok(())
    }

    /// Whether there are polynomials.
    #[inline(never)]
    fn polynomial(&mut self) -> Result<bool, BlobError> {
        let polynomial: Option<Polynomial<'a, f64>> = self.take()?;
        let sound = polynomial.as_ref().is_none_or(|p| p.is_sound(self.joints));
        self.note(sound, BlobError::Taught);
        Ok(polynomial.is_some())
    }

    /// Whether there are tables of cells.
    #[inline(never)]
    fn cmac(&mut self) -> Result<bool, BlobError> {
        let cmac: Option<Cmac<'a, f64>> = self.take()?;
        let sound = cmac.as_ref().is_none_or(|c| c.is_sound(self.joints));
        self.note(sound, BlobError::Taught);
        Ok(cmac.is_some())
    }

    fn provenance(&mut self) -> Result<(), BlobError> {
        self.body.text(LABEL)?;
        self.body.text(NAME)?;
        self.body.text(LABEL)?;
        let _rows: [u32; 2] = self.take()?;
        let _rms: [f64; 2] = self.take()?;
        Ok(())
    }
}
