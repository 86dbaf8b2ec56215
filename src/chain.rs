//! The arm as it is described, and its baked form for the loop.
//!
//! ```text
//! t_world_tool = base · J1(q1) · L1 · J2(q2) · L2 · ... · JN(qN) · LN · tool
//! ```
//! Each `J` turns about or slides along z, each `L` is constant. Frames may be slid along and
//! turned about a joint's axis without changing anything, since that commutes with the
//! joint's motion. [`bake`] uses this freedom to bring every link to the fewest numbers:
//!
//! - revolute: `Rz(q + theta) · T(tx, ty, 0) · Rx(alpha)`, 4 numbers, parallel axes included;
//! - prismatic: `Rz(theta) · Tz(q) · Rx(alpha)`, 2 numbers (a translation commutes with the
//!   slide, so it moves on towards the base);
//! - what is left over goes into base and tool.

use nalgebra::{Matrix3, Vector3};

use crate::pose::{both, columns, from_columns, seen};
use crate::vector::{along, less, plus, times};
use crate::{Convention, Joint, JointKind, Pose, Scalar};

/// What gravity acts on in one link.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LinkMass<T: Scalar> {
    /// kg.
    pub mass: T,
    /// Centre of mass in the link's distal frame, m. In a [`BakedJoint`]: in the joint frame
    /// after the motion.
    pub com: Vector3<T>,
}

impl<T: Scalar> LinkMass<T> {
    /// No mass at all.
    pub fn none() -> Self {
        Self {
            mass: T::zero(),
            com: Vector3::zeros(),
        }
    }
}

/// One joint with its link, in the form that the loop computes with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BakedJoint<T: Scalar> {
    /// Turns or slides.
    pub kind: JointKind,
    /// Constant angle about the axis, rad, in [-pi/2, pi/2].
    pub theta: T,
    /// Sine and cosine of `theta`.
    pub sincos_theta: [T; 2],
    /// Next axis' origin across this axis, m; zero for a prismatic joint.
    pub tx: T,
    /// m.
    pub ty: T,
    /// Sine of the angle between this axis and the next.
    pub sin_alpha: T,
    /// Cosine of the same.
    pub cos_alpha: T,
    /// The link's mass, its centre in the baked joint frame after the motion.
    pub mass: LinkMass<T>,
}

/// Baked frame of a joint after its motion: z along the axis, origin on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<T: Scalar> {
    /// Axes as columns; the third is the joint's axis.
    pub rotation: Matrix3<T>,
    /// m.
    pub origin: Vector3<T>,
}

impl<T: Scalar> Frame<T> {
    /// At the origin, axes along those of the surrounding frame.
    pub fn identity() -> Self {
        Self {
            rotation: Matrix3::identity(),
            origin: Vector3::zeros(),
        }
    }

    /// The joint's axis, unit.
    #[inline]
    pub fn axis(&self) -> Vector3<T> {
        let [_, _, z] = columns(&self.rotation);
        z
    }
}

impl<T: Scalar> BakedJoint<T> {
    /// No offset, no link.
    pub fn identity() -> Self {
        let (o, i) = (T::zero(), T::one());
        Self {
            kind: JointKind::Revolute,
            theta: o,
            sincos_theta: [o, i],
            tx: o,
            ty: o,
            sin_alpha: o,
            cos_alpha: i,
            mass: LinkMass::none(),
        }
    }

    /// The same in another number type, rounded once.
    pub fn cast<U: Scalar>(&self) -> BakedJoint<U> {
        let c = |x: T| U::of(x.widen());
        BakedJoint {
            kind: self.kind,
            theta: c(self.theta),
            sincos_theta: self.sincos_theta.map(c),
            tx: c(self.tx),
            ty: c(self.ty),
            sin_alpha: c(self.sin_alpha),
            cos_alpha: c(self.cos_alpha),
            mass: LinkMass {
                mass: c(self.mass.mass),
                com: self.mass.com.map(c),
            },
        }
    }
}

/// Where the baked frames stand relative to the described ones: `gauges[j]` is the described
/// joint frame after the motion, seen from the baked one. A pure turn about and slide along
/// z for a revolute joint, a turn about z and any slide for a prismatic one.
pub type Gauge<T> = Pose<T>;

/// Brings a described arm to baked form.
///
/// `base`: world to robot base. `tool`: last link's distal frame to tool. `baked` and
/// `gauges` have one place a joint. Returns base and tool with what was left over.
pub fn bake<T: Scalar>(
    base: &Pose<T>,
    joints: &[Joint<T>],
    masses: &[LinkMass<T>],
    tool: &Pose<T>,
    baked: &mut [BakedJoint<T>],
    gauges: &mut [Gauge<T>],
) -> (Pose<T>, Pose<T>) {
    // This joint's baked frame before the motion, seen from the link before; turned about
    // the axis as the joint frame happens to be. For the last joint's link: the tool.
    let mut next = *tool;
    let mut beyond: Option<&mut BakedJoint<T>> = None;
    let mut baked_tool = *tool;
    for (((joint, baked), gauge), mass) in joints
        .iter()
        .zip(baked.iter_mut())
        .zip(gauges.iter_mut())
        .zip(masses.iter())
        .rev()
    {
        let after = joint.after();
        let link = after.then(&next);
        *baked = BakedJoint::identity();
        baked.kind = joint.kind;
        // Baked joint frame after the motion, seen from the described one.
        let slide = match beyond {
            None => {
                // The tool keeps all six numbers, the link before it has none.
                baked_tool = link;
                Pose::identity()
            }
            Some(beyond) => {
                // rotation = Rz(phi) Rx(alpha) Rz(theta of the next joint)
                let (r, t) = (&link.rotation, link.translation);
                let (sx, sy) = (r[(0, 2)], -r[(1, 2)]);
                let tiny = T::EPSILON * T::of(16.0);
                let square = both(sx, sx, sy, sy);
                let (mut s, mut c) = if square > tiny * tiny {
                    let norm = square.root();
                    (sx / norm, sy / norm)
                } else {
                    (T::zero(), T::one())
                };
                if both(r.m11, c, r.m21, s) < T::zero() {
                    // Half a turn on both sides, and alpha changes sign: theta stays small.
                    (s, c) = (-s, -c);
                }
                // Of Rz(-phi) rotation = Rx(alpha) Rz(theta): cosine and sine of theta, alpha.
                let (cosine, sine) = (both(r.m11, c, r.m21, s), -both(r.m12, c, r.m22, s));
                beyond.theta = T::angle(sine, cosine);
                beyond.sincos_theta = [sine, cosine];
                baked.sin_alpha = both(r.m13, s, r.m23, -c);
                baked.cos_alpha = r[(2, 2)];
                let (o, i) = (T::zero(), T::one());
                let turn = Matrix3::new(c, -s, o, s, c, o, o, o, i);
                match joint.kind {
                    JointKind::Revolute => {
                        baked.tx = both(t.x, c, t.y, s);
                        baked.ty = both(t.y, c, t.x, -s);
                        Pose::new(turn, Vector3::new(o, o, t.z))
                    }
                    JointKind::Prismatic => Pose::new(turn, t),
                }
            }
        };
        *gauge = slide.inverse();
        baked.mass = LinkMass {
            mass: mass.mass,
            com: seen(gauge, &seen(&after, &mass.com)),
        };
        next = match joint.convention {
            Convention::Dh | Convention::Hayati => slide,
            Convention::Mdh | Convention::ZeroReference => joint.before().then(&slide),
        };
        beyond = Some(baked);
    }
    (base.then(&next), baked_tool)
}

/// Forward kinematics of all frames in one pass.
///
/// `start`: frame in which everything is returned, seen to the first joint (the baked base
/// for world coordinates). `q`: readings with what the effects add, rad or m. `frames`: one
/// place a joint, each set to the joint's baked frame after its motion. Returns the pose of
/// the frame that `tool` follows. Cost: `tests/firmware` prints it.
#[inline]
pub fn forward<T: Scalar>(
    start: &Pose<T>,
    joints: &[BakedJoint<T>],
    q: &[T],
    frames: &mut [Frame<T>],
) -> Pose<T> {
    T::forward(start, joints, q, frames)
}

/// [`crate::forward`].
pub(crate) fn pass<T: Scalar>(
    start: &Pose<T>,
    joints: &[BakedJoint<T>],
    q: &[T],
    frames: &mut [Frame<T>],
) -> Pose<T> {
    let [mut x, mut y, mut z] = columns(&start.rotation);
    let mut p = start.translation;
    for ((joint, &q), frame) in joints.iter().zip(q).zip(frames.iter_mut()) {
        let (s, c) = match joint.kind {
            JointKind::Revolute => q.sincos_beside(joint.theta),
            JointKind::Prismatic => {
                p = along(&p, &z, q);
                (joint.sincos_theta[0], joint.sincos_theta[1])
            }
        };
        let x1 = along(&times(&x, c), &y, s);
        let y1 = less(&times(&y, c), &times(&x, s));
        *frame = Frame {
            rotation: from_columns(&[x1, y1, z]),
            origin: p,
        };
        p = plus(&p, &along(&times(&x1, joint.tx), &y1, joint.ty));
        x = x1;
        y = along(&times(&y1, joint.cos_alpha), &z, joint.sin_alpha);
        z = less(&times(&z, joint.cos_alpha), &times(&y1, joint.sin_alpha));
    }
    Pose::new(from_columns(&[x, y, z]), p)
}
