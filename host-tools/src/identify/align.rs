//! Where the instrument stands, from the measurements alone.
//!
//! Known: where the drawing puts the flange in the robot base at every row. Wanted: the base
//! in the world, the tool in the flange, further targets in the tool, the anchor of a wire.
//! First guesses here are closed forms; Gauss-Newton on the same unknowns finishes.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use truepose::{Frame, Pose, forward};

use super::arm::ArmModel;
use super::observation::Observation;
use super::relation::{Plane, Relation};
use super::three_targets::pose_of;
use super::view::{Sightings, board};

/// The rotation and translation that take points `from` to points `to` with the least sum
/// of squares (Arun, Huang and Blostein 1987: SVD of the cross-covariance).
pub fn best_fit(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Option<Pose<f64>> {
    let n = from.len().min(to.len());
    if n < 3 {
        return None;
    }
    let mean = |points: &[Vector3<f64>]| points[..n].iter().sum::<Vector3<f64>>() / n as f64;
    let (a, b) = (mean(from), mean(to));
    let mut h = Matrix3::zeros();
    for (p, q) in from.iter().zip(to) {
        h += (q - b) * (p - a).transpose();
    }
    let r = nearest_rotation(&h)?;
    Some(Pose::new(r, b - r * a))
}

/// Rotation nearest to a matrix, in the sense that makes the trace of `Rᵀ m` largest.
pub fn nearest_rotation(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let svd = m.svd(true, true);
    let (u, vt) = (svd.u?, svd.v_t?);
    let mut fix = Matrix3::identity();
    if (u * vt).determinant() < 0.0 {
        // the smallest singular value's axis is turned round
        let (smallest, _) = svd.singular_values.argmin();
        fix[(smallest, smallest)] = -1.0;
    }
    Some(u * fix * vt)
}

/// Pose of the last link's distal frame in the robot base, by the drawing.
pub fn flange_poses(arm: &ArmModel, observations: &[&Observation]) -> Vec<Pose<f64>> {
    let mut frames = vec![Frame::identity(); arm.joint_count()];
    let view = arm.view(0);
    let from_base = arm.bases[0].inverse().then(view.base);
    let to_flange = view.tool.then(&arm.tool.inverse());
    observations
        .iter()
        .map(|o| forward(&from_base, view.joints, &o.q, &mut frames).then(&to_flange))
        .collect()
}

/// Measured pose of the tool in the world, as far as a row has it; the pose of a board, seen
/// from the tool, is that of the tool in the board's frame.
fn measured(o: &Observation) -> (Option<Vector3<f64>>, Option<Matrix3<f64>>) {
    match board(o) {
        Some(board) => {
            let tool = board.inverse();
            (Some(tool.translation), Some(tool.rotation))
        }
        None => (o.position, o.rotation),
    }
}

/// Sets bases, tool, targets and anchor of `arm` to first guesses. `tool`: where in the
/// flange to assume it; its turn is found where it shows. `held` puts base and tool back where they are not to be found.
pub(super) fn first_guess(
    arm: &mut ArmModel,
    observations: &[&Observation],
    tool: Pose<f64>,
    sessions: usize,
    held: impl Fn(&mut ArmModel),
) {
    arm.tool = tool;
    let tool = tool.translation;
    arm.bake();
    let flanges = flange_poses(arm, observations);
    let first = arm.bases[0];
    arm.bases.resize(sessions.max(1), first);
    for session in 0..sessions {
        let (mut from, mut to) = (Vec::new(), Vec::new());
        for (o, flange) in observations.iter().zip(&flanges) {
            if let (true, Some(p)) = (o.session == session, measured(o).0) {
                from.push(flange.point(&tool));
                to.push(p);
            }
        }
        if let Some(base) = best_fit(&from, &to) {
            arm.bases[session] = base;
        } else if let Some(base) = seen_from(0, session, &tool, observations, &flanges) {
            arm.bases[session] = base;
        }
    }
    held(arm);
    let mut turns = Matrix3::zeros();
    for (o, flange) in observations.iter().zip(&flanges) {
        if let Some(measured) = measured(o).1 {
            let base = &arm.bases[o.session];
            turns += flange.rotation.transpose() * base.rotation.transpose() * measured;
        }
    }
    if turns.norm() > 0.0
        && let Some(r) = nearest_rotation(&turns)
    {
        arm.tool.rotation = r;
    }
    held(arm);
    guess_targets(arm, observations, &flanges);
    guess_around(arm, observations, &flanges);
    arm.bake();
}

/// Sets the anchor, points, planes and further stations of `arm` to first guesses, the last
/// link being at `flanges` in its base.
pub(crate) fn guess_around(
    arm: &mut ArmModel,
    observations: &[&Observation],
    flanges: &[Pose<f64>],
) {
    guess_anchor(arm, observations, flanges);
    guess_surroundings(arm, observations, flanges);
}

/// Pose of the robot base of `session` seen from a station, by its bearings alone.
fn seen_from(
    station: usize,
    session: usize,
    tool: &Vector3<f64>,
    observations: &[&Observation],
    flanges: &[Pose<f64>],
) -> Option<Pose<f64>> {
    let (mut points, mut directions) = (Vec::new(), Vec::new());
    for (o, flange) in observations.iter().zip(flanges) {
        for relation in o.relations.iter().filter(|_| o.session == session) {
            if let Some(direction) = relation.sight(station) {
                points.push(flange.point(tool));
                directions.push(direction);
            }
        }
    }
    resected(&points, &directions)
}

/// The pose that puts `points` onto rays from the origin along `directions` (resection by the
/// direct linear transform): the null vector of `d × (A p + t) = 0`, its A made a rotation.
/// `None` for fewer than six points or where they lie in a plane.
pub fn resected(points: &[Vector3<f64>], directions: &[Vector3<f64>]) -> Option<Pose<f64>> {
    let n = points.len().min(directions.len());
    if n < 6 {
        return None;
    }
    let centre = points[..n].iter().sum::<Vector3<f64>>() / n as f64;
    let size = points.iter().map(|p| (p - centre).norm()).sum::<f64>() / n as f64;
    let mut normal = DMatrix::<f64>::zeros(12, 12);
    for (p, d) in points.iter().zip(directions) {
        let p = ((p - centre) / size).push(1.0);
        let cross = d.cross_matrix();
        let square = cross.transpose() * cross;
        for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
            let mut block = normal.view_mut((3 * i, 3 * j), (3, 3));
            block += square * (p[i] * p[j]);
        }
    }
    let eigen = normal.symmetric_eigen();
    let mut order: Vec<usize> = (0..12).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    // two null vectors: the points lie in a plane
    if eigen.eigenvalues[order[1]] < 1e-9 * eigen.eigenvalues[order[11]] {
        return None;
    }
    let v = eigen.eigenvectors.column(order[0]);
    let mut a = Matrix3::from_fn(|row, column| v[3 * column + row]);
    let mut t = Vector3::new(v[9], v[10], v[11]);
    let ahead =
        |(p, d): (&Vector3<f64>, &Vector3<f64>)| d.dot(&(a * (p - centre) / size + t)).signum();
    if points.iter().zip(directions).map(ahead).sum::<f64>() < 0.0 {
        (a, t) = (-a, -t);
    }
    let scale = a.svd(false, false).singular_values.mean();
    let r = nearest_rotation(&a)?;
    Some(Pose::new(r, t * (size / scale) - r * centre))
}

/// Points that are touched, planes that are touched, and further stations.
fn guess_surroundings(arm: &mut ArmModel, observations: &[&Observation], flanges: &[Pose<f64>]) {
    let mut touched: [Vec<Vec<Vector3<f64>>>; 2] = Default::default();
    let mut seen: Vec<Sightings> = Vec::new();
    let mut stations = 1;
    for (o, flange) in observations.iter().zip(flanges) {
        let tool = arm.bases[o.session].then(flange).then(&arm.tool);
        let p = tool.translation;
        for relation in &o.relations {
            let (kind, index) = match *relation {
                Relation::Point { point, .. } => (0, point),
                Relation::Plane { plane, .. } => (1, plane),
                Relation::Bearing { station, .. } => {
                    stations = stations.max(station + 1);
                    continue;
                }
                Relation::View(ref view) => {
                    if let Some(point) = view.point() {
                        seen.resize(seen.len().max(point + 1), Sightings::default());
                        seen[point].add(view, &tool);
                    }
                    continue;
                }
                Relation::Distance { .. } => continue,
            };
            if touched[kind].len() <= index {
                touched[kind].resize(index + 1, Vec::new());
            }
            touched[kind][index].push(p);
        }
    }
    let [points, planes] = touched;
    let mean = |of: &[Vector3<f64>]| of.iter().sum::<Vector3<f64>>() / of.len().max(1) as f64;
    // a table touches points or sees them
    arm.points = points.iter().map(|of| mean(of)).collect();
    arm.points.extend(seen.iter().map(Sightings::place));
    arm.planes = planes
        .iter()
        .map(|of| {
            let centre = mean(of);
            let spread = |p: &Vector3<f64>| (p - centre) * (p - centre).transpose();
            let eigen = of
                .iter()
                .map(spread)
                .sum::<Matrix3<f64>>()
                .symmetric_eigen();
            let (least, _) = eigen.eigenvalues.argmin();
            Plane::new(&centre, &eigen.eigenvectors.column(least).into_owned())
        })
        .collect();
    arm.stations.resize(stations, Pose::identity());
    for station in 1..stations {
        let base = |session| {
            let base = seen_from(
                station,
                session,
                &arm.tool.translation,
                observations,
                flanges,
            )?;
            Some(arm.bases[session].then(&base.inverse()))
        };
        if let Some(found) = (0..arm.bases.len()).find_map(base) {
            arm.stations[station] = found;
        }
    }
}

/// Mean position of every further target in the tool frame.
fn guess_targets(arm: &mut ArmModel, observations: &[&Observation], flanges: &[Pose<f64>]) {
    let count = observations
        .iter()
        .map(|o| o.targets.len())
        .max()
        .unwrap_or(0);
    for i in arm.targets.len()..count {
        let (mut sum, mut n) = (Vector3::zeros(), 0.0);
        for (o, flange) in observations.iter().zip(flanges) {
            if let Some(Some(p)) = o.targets.get(i) {
                let pose = arm.bases[o.session].then(flange).then(&arm.tool);
                sum += pose.inverse().point(p);
                n += 1.0;
            }
        }
        arm.targets.push(if n > 0.0 { sum / n } else { sum });
    }
}

/// Anchor of a wire by linear least squares in the anchor and its squared distance from the
/// origin: `L² = |x|² - 2 x·a + |a|²`.
fn guess_anchor(arm: &mut ArmModel, observations: &[&Observation], flanges: &[Pose<f64>]) {
    let mut points = Vec::new();
    for (o, flange) in observations.iter().zip(flanges) {
        if let Some(length) = o.length {
            let x = arm.bases[o.session]
                .then(flange)
                .point(&arm.tool.translation);
            points.push((x, length));
        }
    }
    if points.len() < 4 {
        return;
    }
    let rows = points.len();
    let mut a = DMatrix::zeros(rows, 4);
    let mut b = DVector::zeros(rows);
    for (i, (x, length)) in points.iter().enumerate() {
        for axis in 0..3 {
            a[(i, axis)] = -2.0 * x[axis];
        }
        a[(i, 3)] = 1.0;
        b[i] = length * length - x.norm_squared();
    }
    if let Ok(solution) = a.svd(true, true).solve(&b, 1e-12) {
        arm.anchor = Vector3::new(solution[0], solution[1], solution[2]);
    }
}

/// Turns the tool frame to the mean of the poses that three known targets give.
pub(super) fn turn_tool_to_poses(arm: &mut ArmModel, observations: &[&Observation]) {
    let flanges = flange_poses(arm, observations);
    let mut turns = Matrix3::zeros();
    for (o, flange) in observations.iter().zip(&flanges) {
        if let Some(pose) = pose_of(o, &arm.targets) {
            let base = &arm.bases[o.session];
            turns += flange.rotation.transpose() * base.rotation.transpose() * pose.rotation;
        }
    }
    if turns.norm() > 0.0
        && let Some(r) = nearest_rotation(&turns)
    {
        arm.tool.rotation = r;
        arm.bake();
    }
}

/// Turns the tool frame so that the identified further targets stand as near as possible to
/// where the tool's drawing has them; says nothing where fewer than two are known.
pub fn turn_tool_to_targets(arm: &mut ArmModel, nominal: &[Vector3<f64>]) {
    if nominal.len() < 2 || arm.targets.len() < 2 {
        return;
    }
    // the tool point itself is the third point, at the origin of both
    let mut h = Matrix3::zeros();
    for (found, drawn) in arm.targets.iter().zip(nominal) {
        h += found * drawn.transpose();
    }
    if let Some(turn) = nearest_rotation(&h) {
        arm.tool.rotation *= turn;
        for target in &mut arm.targets {
            *target = turn.transpose() * *target;
        }
        arm.bake();
    }
}
