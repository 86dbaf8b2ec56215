//! The baked chain against the plain product of the described transforms, and every
//! analytic derivative against central differences, for all conventions and 1 to 7 joints.

use crate::random::Random;
use nalgebra::Vector3;
use truepose::jacobian::{joint_column, parameter_twists};
use truepose::{BakedJoint, Frame, Gauge, Joint, LinkMass, Pose, bake, forward};

struct Arm {
    base: Pose<f64>,
    joints: Vec<Joint<f64>>,
    masses: Vec<LinkMass<f64>>,
    tool: Pose<f64>,
}

struct Baked {
    base: Pose<f64>,
    joints: Vec<BakedJoint<f64>>,
    gauges: Vec<Gauge<f64>>,
    tool: Pose<f64>,
}

impl Arm {
    fn random(random: &mut Random, count: usize) -> Self {
        Self {
            base: random.pose(1.0),
            joints: (0..count).map(|_| random.joint()).collect(),
            masses: (0..count).map(|_| random.mass()).collect(),
            tool: random.pose(0.3),
        }
    }

    fn product(&self, q: &[f64]) -> Pose<f64> {
        let links = self.joints.iter().zip(q);
        links
            .fold(self.base, |t, (joint, &q)| t.then(&joint.transform(q)))
            .then(&self.tool)
    }

    fn bake(&self) -> Baked {
        let mut joints = vec![BakedJoint::identity(); self.joints.len()];
        let mut gauges = vec![Pose::identity(); self.joints.len()];
        let (base, tool) = bake(
            &self.base,
            &self.joints,
            &self.masses,
            &self.tool,
            &mut joints,
            &mut gauges,
        );
        Baked {
            base,
            joints,
            gauges,
            tool,
        }
    }
}

fn readings(random: &mut Random, count: usize) -> Vec<f64> {
    (0..count).map(|_| random.within(3.0)).collect()
}

fn distance(a: &Pose<f64>, b: &Pose<f64>) -> f64 {
    (a.rotation - b.rotation).norm() + (a.translation - b.translation).norm()
}

#[test]
fn baked_chain_equals_the_product_of_its_transforms() {
    let mut random = Random(1);
    for case in 0..700 {
        let count = 1 + case % 7;
        let arm = Arm::random(&mut random, count);
        let baked = arm.bake();
        for _ in 0..5 {
            let q = readings(&mut random, count);
            let mut frames = vec![Frame::identity(); count];
            let tool = forward(&baked.base, &baked.joints, &q, &mut frames).then(&baked.tool);
            // a dozen products of matrices with entries up to 7 m
            assert!(distance(&tool, &arm.product(&q)) < 1e-13 * 7.0 * 12.0);
        }
        for joint in &baked.joints {
            assert!(joint.theta.abs() <= std::f64::consts::FRAC_PI_2 + 1e-12);
        }
    }
}

#[test]
fn f32_chain_stays_within_its_rounding() {
    let mut random = Random(2);
    for case in 0..700 {
        let count = 1 + case % 7;
        let arm = Arm::random(&mut random, count);
        let baked = arm.bake();
        let joints: Vec<BakedJoint<f32>> = baked.joints.iter().map(BakedJoint::cast).collect();
        let q: Vec<f32> = (0..count).map(|_| random.within(3.0) as f32).collect();
        let wide: Vec<f64> = q.iter().map(|&x| f64::from(x)).collect();
        let mut frames = vec![Frame::identity(); count];
        let tool = forward(&baked.base.cast(), &joints, &q, &mut frames).then(&baked.tool.cast());
        // 2^-24 relative, entries up to 7 m, some tens of operations in a random walk
        assert!(distance(&tool.cast(), &arm.product(&wide)) < 6e-8 * 7.0 * 20.0);
    }
}

#[test]
fn centres_of_mass_move_with_their_links() {
    let mut random = Random(3);
    for case in 0..200 {
        let count = 1 + case % 7;
        let arm = Arm::random(&mut random, count);
        let baked = arm.bake();
        let q = readings(&mut random, count);
        let mut frames = vec![Frame::identity(); count];
        forward(&baked.base, &baked.joints, &q, &mut frames);
        let mut distal = arm.base;
        for j in 0..count {
            distal = distal.then(&arm.joints[j].transform(q[j]));
            let expected = distal.point(&arm.masses[j].com);
            let found = frames[j].origin + frames[j].rotation * baked.joints[j].mass.com;
            assert!((found - expected).norm() < 1e-12);
        }
    }
}

fn central(step: f64, pose: impl Fn(f64) -> Pose<f64>) -> [f64; 6] {
    let (minus, plus) = (pose(-step), pose(step));
    let rows = minus.twist_to(&plus).rows();
    rows.map(|x| x / (2.0 * step))
}

fn assert_close(analytic: &[f64; 6], numeric: &[f64; 6], what: &str) {
    for (a, n) in analytic.iter().zip(numeric) {
        // truncation h^2/6 of third derivatives up to 10, rounding eps/h
        assert!((a - n).abs() < 2e-9, "{what}: {a} {n}");
    }
}

#[test]
fn joint_jacobian_equals_central_differences() {
    let mut random = Random(4);
    for case in 0..200 {
        let count = 1 + case % 7;
        let arm = Arm::random(&mut random, count);
        let baked = arm.bake();
        let q = readings(&mut random, count);
        let mut frames = vec![Frame::identity(); count];
        let tool = forward(&baked.base, &baked.joints, &q, &mut frames).then(&baked.tool);
        for j in 0..count {
            let column = joint_column(baked.joints[j].kind, &frames[j], &tool.translation);
            let numeric = central(1e-5, |h| {
                let mut moved = q.clone();
                moved[j] += h;
                arm.product(&moved)
            });
            assert_close(&column.rows(), &numeric, "joint");
        }
    }
}

#[test]
fn identification_jacobian_equals_central_differences() {
    let mut random = Random(5);
    let mut tried = 0;
    for case in 0..400 {
        let count = 1 + case % 7;
        let arm = Arm::random(&mut random, count);
        let baked = arm.bake();
        let q = readings(&mut random, count);
        let mut frames = vec![Frame::identity(); count];
        let tool = forward(&baked.base, &baked.joints, &q, &mut frames).then(&baked.tool);
        let base = baked.base.inverse().then(&arm.base);
        for j in 0..count {
            for &parameter in arm.joints[j].parameters() {
                let column = parameter_twists(&base, &arm.joints, &baked.gauges, j, parameter)
                    .iter()
                    .flatten()
                    .map(|t| t.column(&baked.base, &frames, &tool.translation))
                    .fold([0.0; 6], |sum, c| {
                        let rows = c.rows();
                        std::array::from_fn(|i| sum[i] + rows[i])
                    });
                let numeric = central(1e-5, |h| {
                    let mut joints = arm.joints.clone();
                    *joints[j].parameter_mut(parameter) += h;
                    Arm {
                        joints,
                        masses: arm.masses.clone(),
                        ..arm
                    }
                    .product(&q)
                });
                let what = format!("{:?} {:?}", arm.joints[j].convention, parameter);
                assert_close(&column, &numeric, &what);
                tried += 1;
            }
        }
    }
    assert!(tried > 5000);
}

#[test]
fn rotation_vector_and_quaternion_survive_their_singular_points() {
    let pi = std::f64::consts::PI;
    for angle in [
        0.0,
        1e-300,
        1e-12,
        1e-8,
        1.4e-8,
        1.6e-8,
        1e-4,
        1.0,
        pi - 1e-9,
        pi,
    ] {
        for axis in [
            Vector3::x(),
            Vector3::y(),
            Vector3::z(),
            Vector3::new(0.6, 0.0, 0.8),
            Vector3::new(-0.48, 0.6, 0.64),
        ] {
            let w = axis * angle;
            let pose = Pose::from_rotation_vector(&w);
            let back = Pose::from_rotation_vector(&pose.rotation_vector());
            assert!((pose.rotation - back.rotation).norm() < 4e-15, "{w}");
            let q = pose.quaternion();
            let again = Pose::from_quaternion(q, Vector3::zeros()).map(|p| p.rotation);
            assert!(again.is_some_and(|r| (pose.rotation - r).norm() < 4e-15));
            if angle < 3.0 {
                // the axis of a turn by nearly pi is only defined up to its sign
                assert!((pose.rotation_vector() - w).norm() < 4e-15, "{w}");
            }
        }
    }
}
