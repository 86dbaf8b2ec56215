//! Planes, circles and lines through measured points, least squares of the distances.
//!
//! MRD 4.6.2 and 4.6.4 fit one coordinate by the others and turn the frame until that is the
//! distance; here the plane and the line come from the scatter's principal axes, which is
//! where those iterations end, and the circle from Gauss-Newton on its radial distances,
//! started by the linear fit 4.263.

use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, SymmetricEigen, Vector2, Vector3};

/// Principal axes of a set of points.
#[derive(Clone, Debug)]
pub struct Scatter {
    /// Their mean, m.
    pub mean: Vector3<f64>,
    /// Unit vectors, along the widest spread first.
    pub axes: [Vector3<f64>; 3],
    /// Sums of squares along them, m^2.
    pub squares: [f64; 3],
}

impl Scatter {
    /// Of at least one point.
    pub fn of(points: &[Vector3<f64>]) -> Self {
        let mean = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        let mut scatter = Matrix3::zeros();
        for p in points {
            let r = p - mean;
            scatter += r * r.transpose();
        }
        let eigen = SymmetricEigen::new(scatter);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let axes = order.map(|k| eigen.eigenvectors.column(k).into_owned());
        // Sums along the axes found: an eigenvalue is off by rounding of the largest.
        let along = |axis: &Vector3<f64>| {
            let squares = points.iter().map(|p| (p - mean).dot(axis).powi(2));
            squares.sum::<f64>()
        };
        Self {
            mean,
            squares: [along(&axes[0]), along(&axes[1]), along(&axes[2])],
            axes,
        }
    }
}

/// A line through points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// The mean of the points, m.
    pub point: Vector3<f64>,
    /// Unit vector, its sense open.
    pub direction: Vector3<f64>,
    /// Standard deviation of a point's distance in one direction across, m.
    pub sigma: f64,
    /// Standard error of the direction in each direction across, rad.
    pub direction_error: f64,
    /// Standard error of the mean across, m.
    pub point_error: f64,
}

/// The line that the points are nearest to; of at least 3. MRD 4.272 to 4.280.
pub fn line(points: &[Vector3<f64>]) -> Option<Line> {
    let n = points.len();
    if n < 3 {
        return None;
    }
    let scatter = Scatter::of(points);
    let [along, wide, narrow] = scatter.squares;
    // Two directions across, two numbers of the line in each.
    let sigma = ((wide + narrow) / (2 * n - 4) as f64).sqrt();
    (along > 0.0).then(|| Line {
        point: scatter.mean,
        direction: scatter.axes[0],
        sigma,
        direction_error: sigma / along.sqrt(),
        point_error: sigma / (n as f64).sqrt(),
    })
}

/// A plane through points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// The mean of the points, m.
    pub point: Vector3<f64>,
    /// Unit normal, its sense open.
    pub normal: Vector3<f64>,
    /// Unit vectors in the plane, right-handed with the normal.
    pub axes: [Vector3<f64>; 2],
    /// Standard deviation of a point's distance, m.
    pub sigma: f64,
    /// Standard errors of the normal's turn towards each of `axes`, rad.
    pub normal_errors: [f64; 2],
}

/// The plane that the points are nearest to; of at least 4 that are not on a line.
/// MRD 4.248 to 4.262 at the end of the iteration 4.288 to 4.295.
pub fn plane(points: &[Vector3<f64>]) -> Option<Plane> {
    let n = points.len();
    let scatter = Scatter::of(points);
    let [wide, narrow, off] = scatter.squares;
    if n < 4 || narrow <= 0.0 || narrow <= 1e-24 * wide {
        return None;
    }
    let sigma = (off / (n - 3) as f64).sqrt();
    let [x, y, _] = scatter.axes;
    Some(Plane {
        point: scatter.mean,
        normal: x.cross(&y),
        axes: [x, y],
        sigma,
        normal_errors: [sigma / wide.sqrt(), sigma / narrow.sqrt()],
    })
}

/// A circle in a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    /// m.
    pub center: Vector2<f64>,
    /// m.
    pub radius: f64,
    /// Standard deviation of a point's radial distance, m.
    pub sigma: f64,
    /// Covariance of the centre over that of a point.
    pub cofactor: Matrix2<f64>,
}

/// Steps of the circle's iteration; it usually needs five.
const STEPS: usize = 50;

/// The circle that the points of a plane are nearest to; of at least 4 that are not on a line.
/// MRD 4.263 to 4.271 for the start, 4.296 and 4.297 for what it ends at.
pub fn circle(points: &[Vector2<f64>]) -> Option<Circle> {
    let n = points.len();
    if n < 4 {
        return None;
    }
    // About the mean the linear fit is well scaled.
    let mean = points.iter().sum::<Vector2<f64>>() / n as f64;
    let scale = points.iter().map(|p| (p - mean).norm()).fold(0.0, f64::max);
    if scale <= 0.0 {
        return None;
    }
    let unit: Vec<Vector2<f64>> = points.iter().map(|p| (p - mean) / scale).collect();
    let a = DMatrix::from_fn(n, 3, |i, k| match k {
        2 => 1.0,
        k => unit[i][k],
    });
    let w = DVector::from_fn(n, |i, _| unit[i].norm_squared());
    let s = a.svd(true, true).solve(&w, 1e-12).ok()?;
    let mut center = Vector2::new(s[0], s[1]) / 2.0;
    let mut radius = (s[2] + center.norm_squared()).max(0.0).sqrt();
    let mut cofactor = Matrix3::zeros();
    for _ in 0..STEPS {
        let mut normal = Matrix3::zeros();
        let mut gradient = Vector3::zeros();
        for p in &unit {
            let away = p - center;
            let distance = away.norm();
            if distance <= 0.0 {
                return None;
            }
            let row = Vector3::new(-away.x / distance, -away.y / distance, -1.0);
            normal += row * row.transpose();
            gradient += row * (distance - radius);
        }
        cofactor = normal.try_inverse()?;
        let step = -(cofactor * gradient);
        center += Vector2::new(step.x, step.y);
        radius += step.z;
        if step.norm() <= 1e-14 * (1.0 + radius) {
            break;
        }
    }
    let squares: f64 = unit
        .iter()
        .map(|p| ((p - center).norm() - radius).powi(2))
        .sum();
    let good = radius > 0.0 && radius.is_finite() && center.iter().all(|x| x.is_finite());
    good.then(|| Circle {
        center: mean + center * scale,
        radius: radius * scale,
        sigma: (squares / (n - 3) as f64).sqrt() * scale,
        cofactor: cofactor.fixed_view::<2, 2>(0, 0).into_owned(),
    })
}
