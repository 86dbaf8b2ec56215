//! Which way the undamped steps go, and that both ways lead to the same joints.

use crate::budget::Budget;
use crate::compensate::{Compensator, Outcome, Request, Status};
use crate::model::{BakedChain, Model};
use crate::{BakedJoint, Joint, JointKind, LinkMass, Pose, Scalar, Settings, Twist, bake};
use nalgebra::Vector3;

struct Random(u64);

impl Random {
    fn within(&mut self, range: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0) * range
    }

    fn vector(&mut self, range: f64) -> Vector3<f64> {
        Vector3::new(self.within(range), self.within(range), self.within(range))
    }
}

/// An arm as drawn.
struct Drawing {
    base: Pose<f64>,
    joints: [Joint<f64>; 6],
    tool: Pose<f64>,
}

impl Drawing {
    /// Of any lengths and twists whose second and third axes are parallel and whose last three
    /// meet.
    fn drawn(random: &mut Random) -> Self {
        let mut joints = [Joint::dh(JointKind::Revolute, 0.0, 0.0, 0.0, 0.0); 6];
        for (k, joint) in joints.iter_mut().enumerate() {
            joint.theta = random.within(3.0);
            // The wrist centre lies on axis 4, the tool is beyond axis 6.
            let [d, a] = if k < 3 { [0.3, 0.5] } else { [0.0; 2] };
            (joint.d, joint.a) = (random.within(d), random.within(a));
            joint.alpha = match k {
                1 if random.within(1.0) < 0.0 => core::f64::consts::PI,
                1 => 0.0,
                _ => 1.5 + random.within(0.6),
            };
        }
        joints[3].d = random.within(0.5);
        joints[5].d = random.within(0.2);
        Self {
            base: Pose::from_xyz_rpy(random.vector(1.0), random.vector(1.0)),
            joints,
            tool: Pose::from_xyz_rpy(random.vector(0.2), random.vector(1.0)),
        }
    }

    fn baked<T: Scalar>(&self) -> BakedChain<T, 6> {
        let mut joints = [BakedJoint::identity(); 6];
        let (masses, mut gauges) = ([LinkMass::none(); 6], [Pose::identity(); 6]);
        let (base, tool) = bake(
            &self.base,
            &self.joints,
            &masses,
            &self.tool,
            &mut joints,
            &mut gauges,
        );
        BakedChain {
            base,
            joints,
            tool,
            gravity: Vector3::new(0.0, 0.0, -9.81),
        }
        .cast()
    }

    /// Calibrated: joint offsets, base and tool, and lengths along axes and links.
    fn calibrated(&self, random: &mut Random) -> Self {
        let mut joints = self.joints;
        for (k, joint) in joints.iter_mut().enumerate() {
            joint.theta += random.within(2e-3);
            if k < 3 {
                joint.d += random.within(5e-4);
                joint.a += random.within(5e-4);
            }
        }
        let off = |random: &mut Random| Twist::new(random.vector(1e-3), random.vector(1e-3));
        Self {
            base: self.base.displaced(&off(random)),
            joints,
            tool: self.tool.displaced(&off(random)),
        }
    }
}

fn model<T: Scalar>(nominal: &Drawing, calibrated: &Drawing) -> Model<'static, T, 6> {
    Model {
        nominal: nominal.baked(),
        calibrated: calibrated.baked(),
        limits: [[T::of(-4.0), T::of(4.0)]; 6],
        resolution: [T::zero(); 6],
        settings: Settings::<f64>::default().cast(),
        ..Model::empty()
    }
}

/// Whether the compensator of such an arm takes the closed form.
fn chosen(nominal: &Drawing, calibrated: &Drawing) -> [bool; 2] {
    fn of<T: Scalar>(nominal: &Drawing, calibrated: &Drawing) -> bool {
        let model = model::<T>(nominal, calibrated);
        Compensator::new(&model).constants.unwrap().spherical
    }
    [
        of::<f32>(nominal, calibrated),
        of::<f64>(nominal, calibrated),
    ]
}

#[test]
fn arms_whose_axes_still_meet_take_the_closed_form() {
    let mut random = Random(1);
    for _ in 0..300 {
        let nominal = Drawing::drawn(&mut random);
        let calibrated = nominal.calibrated(&mut random);
        // A nominal model serves reprogramming by endpoint sensing.
        assert_eq!(chosen(&nominal, &nominal), [true; 2]);
        assert_eq!(chosen(&nominal, &calibrated), [true; 2]);
        // Nominal axes do not matter.
        let mut other = Drawing::drawn(&mut random);
        other.joints[3].a = 0.1;
        assert_eq!(chosen(&other, &calibrated), [true; 2]);
    }
}

/// As little as the single precision tells apart from none is enough.
#[test]
fn arms_that_are_off_take_the_general_step() {
    let mut random = Random(2);
    for _ in 0..300 {
        let nominal = Drawing::drawn(&mut random);
        let calibrated = nominal.calibrated(&mut random);
        let off: [fn(&mut [Joint<f64>; 6]); 6] = [
            |joints| joints[1].alpha += 3e-6,
            |joints| joints[1].alpha -= 2e-3,
            |joints| joints[3].a += 3e-6,
            |joints| joints[4].a -= 3e-6,
            |joints| joints[4].d += 4e-6,
            // A wrist that is none: fourth and fifth axis nearly parallel.
            |joints| joints[3].alpha = 0.05,
        ];
        for off in off {
            let mut joints = calibrated.joints;
            off(&mut joints);
            let calibrated = Drawing {
                joints,
                ..calibrated
            };
            assert_eq!(chosen(&nominal, &calibrated), [false; 2]);
        }
    }
}

/// Shows `look` the answers by the closed form and by the general step to the same requests.
fn answers<T: Scalar>(iterations: u8, mut look: impl FnMut([Outcome<T, 6>; 2])) {
    let mut random = Random(3);
    for _ in 0..60 {
        let nominal = Drawing::drawn(&mut random);
        let calibrated = nominal.calibrated(&mut random);
        let model = model::<T>(&nominal, &calibrated);
        for _ in 0..50 {
            let q = core::array::from_fn(|_| T::of(random.within(3.0)));
            let request = Request::pose(model.nominal_pose(&q), q);
            let closed = Compensator::new(&model).with_settings(Settings {
                max_iterations: iterations,
                ..model.settings
            });
            let mut general = closed.clone();
            general.constants.as_mut().unwrap().spherical = false;
            look(
                [closed, general]
                    .map(|mut compensator| compensator.correct(&request, &mut Budget::unlimited())),
            );
        }
    }
}

fn both_lead_to_the_same_joints<T: Scalar>(rounding: f64) {
    for iterations in [1, 2, 8] {
        let (mut all, mut converged) = (0, 0);
        answers::<T>(iterations, |[closed, general]| {
            all += 1;
            assert_eq!(closed.status, general.status);
            assert_eq!(closed.iterations, general.iterations);
            converged += usize::from(closed.status == Status::Converged);
            for (closed, general) in closed.q.iter().zip(general.q) {
                let apart = (*closed - general).abs().widen();
                assert!(apart <= rounding, "{apart:e}, {iterations} iterations");
            }
        });
        // Elsewhere a singularity is near.
        assert!(
            iterations == 1 || converged * 10 > all * 4,
            "{converged} of {all}"
        );
    }
}

/// Joints are up to 3 rad, and singular values that count as clear above 0.03.
#[test]
fn both_lead_to_the_same_joints_in_single_precision() {
    both_lead_to_the_same_joints::<f32>(3.0 * 4.0 * f64::from(f32::EPSILON) / 0.03);
}

#[test]
fn both_lead_to_the_same_joints_in_double_precision() {
    both_lead_to_the_same_joints::<f64>(3.0 * 4.0 * f64::EPSILON / 0.03);
}
