//! Columns of all unknowns of a rigid arm at once.
//!
//! Each is a constant twist in one frame of the pass, so the lever from the frame to the tool
//! point, seen in the frame, serves all of them: one cross product and one rotation a column.

use nalgebra::{Matrix3, Vector3};
use truepose::jacobian::{AttachedTwist, Attachment};
use truepose::{Frame, Pose, Twist};

/// Frames that twists are attached to: the baked base, the joints, the described base.
struct Slot {
    rotation: Matrix3<f64>,
    /// Frame's origin to tool point, in the frame.
    lever: Vector3<f64>,
}

/// A twist of an unknown, times the unknown's scale.
struct Part {
    column: usize,
    slot: usize,
    linear: Vector3<f64>,
    angular: Vector3<f64>,
}

/// What is known of the unknowns before any observation.
#[derive(Default)]
pub(super) struct Attached {
    parts: Vec<Part>,
    slots: Vec<Slot>,
}

/// Where an arm is at one observation.
pub(super) struct At<'a> {
    pub(super) baked_base: &'a Pose<f64>,
    pub(super) base: &'a Vector3<f64>,
    pub(super) frames: &'a [Frame<f64>],
    pub(super) tool: &'a Vector3<f64>,
}

impl Attached {
    /// Takes a twist in, of unknown `column`; of one column in succession.
    pub(super) fn push(&mut self, column: usize, twist: &AttachedTwist<f64>, scale: f64) {
        let slot = match twist.at {
            Attachment::Base => 0,
            Attachment::Joint(j) => 2 + j,
        };
        self.part(column, slot, &twist.twist, scale);
    }

    /// The same for a twist in world axes at the origin of the described base.
    pub(super) fn push_base(&mut self, column: usize, twist: &Twist<f64>, scale: f64) {
        self.part(column, 1, twist, scale);
    }

    fn part(&mut self, column: usize, slot: usize, twist: &Twist<f64>, scale: f64) {
        self.parts.push(Part {
            column,
            slot,
            linear: twist.linear * scale,
            angular: twist.angular * scale,
        });
    }

    /// Displacement of the tool per scaled unit of every unknown taken in, world axes at the
    /// tool point; their turns only where `turns`, zero otherwise.
    pub(super) fn twists(
        &mut self,
        at: &At<'_>,
        turns: bool,
        mut each: impl FnMut(usize, Twist<f64>),
    ) {
        self.slots.clear();
        let slot = |rotation: &Matrix3<f64>, origin: &Vector3<f64>| Slot {
            rotation: *rotation,
            lever: rotation.tr_mul(&(at.tool - origin)),
        };
        let base = slot(&at.baked_base.rotation, &at.baked_base.translation);
        self.slots.push(base);
        self.slots.push(slot(&Matrix3::identity(), at.base));
        let frames = at.frames.iter().map(|f| slot(&f.rotation, &f.origin));
        self.slots.extend(frames);
        let mut sum: Option<(usize, Twist<f64>)> = None;
        for part in &self.parts {
            let Some(slot) = self.slots.get(part.slot) else {
                continue;
            };
            let linear = slot.rotation * (part.linear + part.angular.cross(&slot.lever));
            let angular = match turns {
                true => slot.rotation * part.angular,
                false => Vector3::zeros(),
            };
            let mut twist = Twist::new(linear, angular);
            if let Some((column, before)) = sum.take() {
                if column == part.column {
                    twist = twist.plus(&before);
                } else {
                    each(column, before);
                }
            }
            sum = Some((part.column, twist));
        }
        if let Some((column, twist)) = sum {
            each(column, twist);
        }
    }
}
