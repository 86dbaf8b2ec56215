//! From the bytes of a body to the model of the loop, with little room: what is not in the
//! model is there only while it is needed. Baked in `f64`, rounded once.

use nalgebra::{Matrix3, Vector3};

use super::body::Body;
use super::{BlobError, LABEL, NAME, WITHOUT_TABLES};
use crate::chain::{BakedJoint, Gauge, LinkMass, bake};
use crate::effects::{Description, Effect};
use crate::model::{BakedChain, MAX_EFFECTS, Model};
use crate::taught::Taught;
use crate::{Convention, Joint, JointKind, Pose, Scalar, Settings, StoredPose};

/// An arm as it is described, at its bare size.
struct Described<const N: usize> {
    base: Pose<f64>,
    joints: [Joint<f64>; N],
    tool: Pose<f64>,
}

/// Fills `model` from a body of `layout` that [`super::check::check`] has let pass for N joints.
#[inline(never)]
pub(super) fn load<'a, T: Scalar, const N: usize>(
    bytes: &'a [u8],
    layout: u16,
    model: &mut Model<'a, T, N>,
) -> Result<(), BlobError> {
    let mut body = Body::new(bytes);
    body.text(NAME)?;
    arm(&mut body, model)?;
    model.settings = body.take::<Settings<f64>>()?.cast();
    taught(&mut body, layout, model)
}

/// Both chains, and the effects attached to the calibrated one. The descriptions take most of
/// the room; it is free again when this returns.
#[inline(never)]
fn arm<'a, T: Scalar, const N: usize>(
    body: &mut Body<'a>,
    model: &mut Model<'a, T, N>,
) -> Result<(), BlobError> {
    let mut arm = Described {
        base: Pose::identity(),
        joints: [Joint::new(JointKind::Revolute, Convention::Dh); N],
        tool: Pose::identity(),
    };
    let mut gauges = [Pose::identity(); N];
    arm.read(body, &mut model.nominal, &mut gauges)?;
    let nominal = arm.base.rotation;
    let base = arm.read(body, &mut model.calibrated, &mut gauges)?;
    commands(body, model, [&nominal, &arm.base.rotation])?;
    let described = Description {
        base: &base.inverse().then(&arm.base),
        joints: &arm.joints,
        gauges: &gauges,
        tool: &arm.tool,
    };
    model.effects.clear();
    for _ in 0..body.count(MAX_EFFECTS)? {
        let effect = effect(body, &described)?;
        model.effects.push(effect).map_err(|_| BlobError::Body)?;
    }
    Ok(())
}

impl<const N: usize> Described<N> {
    /// Reads a description and bakes it. Returns the baked base.
    #[inline(never)]
    fn read<T: Scalar>(
        &mut self,
        body: &mut Body<'_>,
        chain: &mut BakedChain<T, N>,
        gauges: &mut [Gauge<f64>; N],
    ) -> Result<Pose<f64>, BlobError> {
        let mut masses = [LinkMass::none(); N];
        let mut joints = [BakedJoint::identity(); N];
        self.base = Pose::from(&body.take::<StoredPose>()?);
        body.list(&mut self.joints)?;
        body.list(&mut masses)?;
        self.tool = Pose::from(&body.take::<StoredPose>()?);
        let (base, tool) = bake(
            &self.base,
            &self.joints,
            &masses,
            &self.tool,
            &mut joints,
            gauges,
        );
        for (to, from) in chain.joints.iter_mut().zip(&joints) {
            *to = from.cast();
        }
        chain.base = base.cast();
        chain.tool = tool.cast();
        Ok(base)
    }
}

/// Limits, resolutions and gravity, which turns with the described bases.
#[inline(never)]
fn commands<T: Scalar, const N: usize>(
    body: &mut Body<'_>,
    model: &mut Model<'_, T, N>,
    [nominal, calibrated]: [&Matrix3<f64>; 2],
) -> Result<(), BlobError> {
    let mut limits = [[0.0; 2]; N];
    body.list(&mut limits)?;
    model.limits = limits.map(|both| both.map(T::of));
    let mut resolution = [0.0; N];
    body.list(&mut resolution)?;
    model.resolution = resolution.map(T::of);
    let gravity = Vector3::from(body.take::<[f64; 3]>()?);
    model.nominal.gravity = (nominal * gravity).map(T::of);
    model.calibrated.gravity = (calibrated * gravity).map(T::of);
    Ok(())
}

/// Tables, which stand behind the provenance.
#[inline(never)]
fn taught<'a, T: Scalar, const N: usize>(
    body: &mut Body<'a>,
    layout: u16,
    model: &mut Model<'a, T, N>,
) -> Result<(), BlobError> {
    model.taught = Taught::default();
    if layout > WITHOUT_TABLES {
        body.text(LABEL)?;
        body.text(NAME)?;
        body.text(LABEL)?;
        body.take::<[u32; 2]>()?;
        body.take::<[f64; 2]>()?;
        model.taught = body.take::<Taught<'a, f64>>()?.cast();
    }
    Ok(())
}

/// The next effect, attached to the arm.
#[inline(never)]
fn effect<'a, T: Scalar>(
    body: &mut Body<'a>,
    described: &Description<'_, f64>,
) -> Result<Effect<'a, T>, BlobError> {
    let mut effect: Effect<'a, f64> = body.take()?;
    effect.attach(described);
    Ok(effect.cast())
}
