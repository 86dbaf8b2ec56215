//! The blob: everything that the controller has to know of its arm, in one piece of bytes.
//!
//! `docs/BLOB.md` is the standard; this follows it. The host writes with [`Blob::encode`], the
//! controller reads with [`decode`] or [`decode_into`], whoever does not know the number of
//! joints beforehand reads with [`Blob::decode`].

mod baked;
mod body;
mod check;
mod described;
mod error;
mod load;
mod write;

use heapless::{String, Vec};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::chain::{BakedJoint, Gauge, LinkMass, bake};
use crate::effects::Effect;
use crate::model::{BakedChain, MAX_EFFECTS, Model};
use crate::taught::Taught;
use crate::{Joint, Pose, Scalar, Settings, StoredPose};
use baked::Baked;

pub use error::BlobError;
pub(crate) use load::Load;

/// Joints that a blob can hold.
pub const MAX_JOINTS: usize = 12;

/// The layout that this version writes, the newest that it reads.
pub const LAYOUT: u16 = 3;

/// The oldest layout that it reads: a controller bakes no more, which those before were for.
pub const OLDEST_LAYOUT: u16 = LAYOUT;

/// First four bytes of every blob.
pub const MAGIC: [u8; 4] = *b"TPB\0";

/// Length of the header in bytes.
pub const HEADER: usize = 16;

/// Bytes of the name of a robot or of measurements, at most.
pub const NAME: usize = 64;

/// Bytes of any other text, at most.
pub const LABEL: usize = 32;

/// Limits of a joint command that has none: as far as sine and cosine in `f32` are exact.
pub const UNLIMITED: [f64; 2] = [-100.0, 100.0];

/// The largest magnitude that any number in a blob may have.
pub const LARGEST: f64 = 1e9;

static CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// CRC-32 of `bytes`, as blobs, slots and frames carry it (ISO-HDLC, the one of zlib).
pub fn checksum(bytes: &[u8]) -> u32 {
    checksum_onwards(0, bytes)
}

/// [`checksum`] of what has the checksum `crc`, followed by `bytes`; that of nothing is 0.
#[inline(never)]
pub fn checksum_onwards(crc: u32, bytes: &[u8]) -> u32 {
    let mut digest = CRC.digest_with_initial((!crc).reverse_bits());
    digest.update(bytes);
    digest.finalize()
}

/// An arm as it is described: base, joints with what gravity acts on, tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// World to robot base.
    pub base: StoredPose,
    /// Base to tool.
    pub joints: Vec<Joint<f64>, MAX_JOINTS>,
    /// One a joint, in the link's distal frame.
    pub masses: Vec<LinkMass<f64>, MAX_JOINTS>,
    /// Last link's distal frame to tool.
    pub tool: StoredPose,
}

/// Where the parameters come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// What wrote the blob, with its version.
    pub tool: String<LABEL>,
    /// Name of the measurements.
    pub data: String<NAME>,
    /// Date of the measurements or of the fit, as its writer puts it; may be empty.
    pub date: String<LABEL>,
    /// Rows that the fit used.
    pub rows_identify: u32,
    /// Rows held back from it.
    pub rows_verify: u32,
    /// Rms position error of the held-back rows with the nominal model, m.
    pub rms_before: f64,
    /// The same with the calibrated model, m.
    pub rms_after: f64,
}

/// What a blob says, without what is baked of it. `'a`: the bytes, in which tables are read in
/// place.
#[derive(Clone, Debug, PartialEq)]
pub struct Blob<'a> {
    /// Name of the robot.
    pub robot: String<NAME>,
    /// What the controller's own kinematics believe; base and tool aligned with the world.
    pub nominal: Description,
    /// The arm as identified: the same number and kinds of joints.
    pub calibrated: Description,
    /// Lower and upper limit of each joint command, rad or m.
    pub limits: Vec<[f64; 2], MAX_JOINTS>,
    /// Smallest step of each joint command, rad or m; 0 where unknown.
    pub resolution: Vec<f64, MAX_JOINTS>,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: [f64; 3],
    /// What the rigid chain lacks.
    pub effects: Vec<Effect<'a, f64>, MAX_EFFECTS>,
    /// How to compensate.
    pub settings: Settings<f64>,
    /// Where all this comes from.
    pub provenance: Provenance,
    /// Corrections from tables.
    pub taught: Taught<'a, f64>,
}

impl Description {
    /// Brings the description to baked form, each slice with one place a joint. Returns baked
    /// base and tool.
    pub fn bake(
        &self,
        baked: &mut [BakedJoint<f64>],
        gauges: &mut [Gauge<f64>],
    ) -> (Pose<f64>, Pose<f64>) {
        let (base, tool) = (Pose::from(&self.base), Pose::from(&self.tool));
        bake(&base, &self.joints, &self.masses, &tool, baked, gauges)
    }

    /// The baked chain of N joints. `gravity`: in the base frame, m/s^2; `gauges`: set as by
    /// [`bake`]. `None` where the description has another number of joints.
    pub fn chain<const N: usize>(
        &self,
        gravity: [f64; 3],
        gauges: &mut [Gauge<f64>; N],
    ) -> Option<BakedChain<f64, N>> {
        if self.joints.len() != N {
            return None;
        }
        let mut joints = [BakedJoint::identity(); N];
        let (base, tool) = self.bake(&mut joints, gauges);
        Some(BakedChain {
            base,
            joints,
            tool,
            gravity: self.in_world(gravity),
        })
    }

    /// Gravity in the world.
    fn in_world(&self, gravity: [f64; 3]) -> Vector3<f64> {
        Pose::from(&self.base).rotation * Vector3::from(gravity)
    }

    /// Lengths of all links and the tool added up, m: how far the arm can reach at most with
    /// its slides drawn in.
    pub fn reach(&self) -> f64 {
        let mut baked = [BakedJoint::identity(); MAX_JOINTS];
        let mut gauges = [Pose::identity(); MAX_JOINTS];
        let (_, tool) = self.bake(&mut baked, &mut gauges);
        let links: f64 = baked
            .iter()
            .map(|j| (j.tx * j.tx + j.ty * j.ty).root())
            .sum();
        links + tool.translation.norm_squared().root()
    }
}

impl<'a> Blob<'a> {
    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.nominal.joints.len()
    }

    /// Writes header and body into `buffer` and returns the bytes used. Refuses what
    /// [`Blob::decode`] would refuse.
    pub fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], BlobError> {
        let (header, body) = buffer
            .split_at_mut_checked(HEADER)
            .ok_or(BlobError::BufferTooSmall)?;
        let length = write::write(self, body)?;
        let body = body.get(..length).ok_or(BlobError::BufferTooSmall)?;
        described::read(body, self.joints())?;
        let joints = u8::try_from(self.joints()).map_err(|_| BlobError::Body)?;
        let size = u32::try_from(length).map_err(|_| BlobError::Body)?;
        let fields = MAGIC
            .into_iter()
            .chain(LAYOUT.to_le_bytes())
            .chain([joints, 0])
            .chain(size.to_le_bytes())
            .chain(checksum(body).to_le_bytes());
        for (byte, value) in header.iter_mut().zip(fields) {
            *byte = value;
        }
        buffer
            .get(..HEADER + length)
            .ok_or(BlobError::BufferTooSmall)
    }

    /// Reads a blob of any number of joints and checks every promise that `docs/BLOB.md`
    /// makes of its contents.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, BlobError> {
        let (joints, body) = open(bytes)?;
        described::read(body, joints)
    }

    /// The model of N joints in the number type of the controller: baked in `f64`, rounded
    /// once.
    pub fn model<T: Scalar, const N: usize>(&self) -> Result<Model<'a, T, N>, BlobError> {
        let wrong = BlobError::Joints {
            found: self.joints(),
            expected: N,
        };
        let mut limits = [[T::zero(); 2]; N];
        for (to, from) in limits.iter_mut().zip(&self.limits) {
            *to = from.map(T::of);
        }
        let mut resolution = [T::zero(); N];
        for (to, from) in resolution.iter_mut().zip(&self.resolution) {
            *to = T::of(*from);
        }
        let mut gauges = [Pose::identity(); N];
        let nominal = self.nominal.chain::<N>(self.gravity, &mut gauges);
        let calibrated = self.calibrated.chain::<N>(self.gravity, &mut gauges);
        let (nominal, calibrated) = (nominal.ok_or(wrong)?, calibrated.ok_or(wrong)?);
        let baked = Baked::of(&self.calibrated, self.gravity);
        Ok(Model {
            nominal: nominal.cast(),
            calibrated: calibrated.cast(),
            effects: self
                .effects
                .iter()
                .map(|effect| {
                    let mut effect = *effect;
                    baked.attach(&mut effect);
                    effect.cast()
                })
                .collect(),
            limits,
            resolution,
            settings: self.settings.cast(),
            taught: self.taught.cast(),
        })
    }
}

/// All of `bytes`, in the format of a body.
#[cfg(feature = "link")]
pub(crate) fn read<'a, V: Deserialize<'a>>(bytes: &'a [u8]) -> Result<V, BlobError> {
    let mut body = body::Body::new(bytes);
    let value = body.take()?;
    match body.rest() {
        0 => Ok(value),
        bytes => Err(BlobError::Trailing { bytes }),
    }
}

/// Checks a blob as [`decode`] does, with little room. Returns the name of its robot and
/// its number of joints.
pub fn examine(bytes: &[u8]) -> Result<(&str, usize), BlobError> {
    let (joints, body) = open(bytes)?;
    check::check(body, joints)?;
    Ok((body::Body::new(body).text(NAME)?, joints))
}

/// Reads a blob on the controller.
///
/// `T`: number type of the loop, `N`: number of joints of the arm. Needs no heap; what
/// [`decode_into`] takes of the stack beside the model: `decode` in `docs/COST.md`. Anything
/// wrong is refused by name, see [`BlobError`].
///
/// ```
/// # fn f(flash: &[u8]) -> Result<(), truepose::params::BlobError> {
/// let model = truepose::params::decode::<f32, 6>(flash)?;
/// # Ok(()) }
/// ```
pub fn decode<T: Scalar, const N: usize>(bytes: &[u8]) -> Result<Model<'_, T, N>, BlobError> {
    let mut model = Model::empty();
    decode_into(bytes, &mut model)?;
    Ok(model)
}

/// [`decode`] into a model that is there already, which stays as it is if the blob is refused.
#[inline(never)]
pub fn decode_into<'a, T: Scalar, const N: usize>(
    bytes: &'a [u8],
    model: &mut Model<'a, T, N>,
) -> Result<(), BlobError> {
    let (joints, body) = open(bytes)?;
    if joints != N {
        return Err(BlobError::Joints {
            found: joints,
            expected: N,
        });
    }
    check::check(body, joints)?;
    load::load(body, model)
}

/// Checks header and checksum. Returns the number of joints and the body.
fn open(bytes: &[u8]) -> Result<(usize, &[u8]), BlobError> {
    let (header, body) = bytes
        .split_first_chunk::<HEADER>()
        .ok_or(BlobError::TooShort { bytes: bytes.len() })?;
    let [
        m0,
        m1,
        m2,
        m3,
        v0,
        v1,
        joints,
        zero,
        l0,
        l1,
        l2,
        l3,
        c0,
        c1,
        c2,
        c3,
    ] = *header;
    if [m0, m1, m2, m3] != MAGIC {
        return Err(BlobError::Magic);
    }
    let layout = u16::from_le_bytes([v0, v1]);
    if layout > LAYOUT {
        return Err(BlobError::LayoutNewer { found: layout });
    }
    if layout < OLDEST_LAYOUT {
        return Err(BlobError::LayoutOlder { found: layout });
    }
    if zero != 0 {
        return Err(BlobError::Reserved);
    }
    let expected = u32::from_le_bytes([l0, l1, l2, l3]);
    if usize::try_from(expected) != Ok(body.len()) {
        return Err(BlobError::Length {
            found: body.len(),
            expected,
        });
    }
    if checksum(body) != u32::from_le_bytes([c0, c1, c2, c3]) {
        return Err(BlobError::Checksum);
    }
    Ok((usize::from(joints), body))
}
