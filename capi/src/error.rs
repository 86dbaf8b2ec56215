//! What a function answers.

use truepose::params::BlobError;

/// What a function answers. Zero is success; every other one says why nothing was done.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(non_camel_case_types, reason = "the names that C sees")]
pub enum truepose_error {
    /// Done.
    TRUEPOSE_OK = 0,
    /// A pointer is null.
    TRUEPOSE_NULL_POINTER = 1,
    /// `truepose_init` was not called, or refused its blob.
    TRUEPOSE_NOT_READY = 2,
    /// The bytes are not a blob, or one that is cut short or has something behind it.
    TRUEPOSE_BLOB_NOT_ONE = 3,
    /// The blob has been altered: its checksum is wrong.
    TRUEPOSE_BLOB_CHECKSUM = 4,
    /// The blob's layout is newer or older than what this version reads.
    TRUEPOSE_BLOB_LAYOUT = 5,
    /// The blob is for an arm with another number of joints than `truepose_joints`.
    TRUEPOSE_BLOB_JOINTS = 6,
    /// The blob's body does not follow its layout.
    TRUEPOSE_BLOB_BODY = 7,
    /// The blob holds values that cannot be meant.
    TRUEPOSE_BLOB_VALUES = 8,
}

impl From<BlobError> for truepose_error {
    fn from(refusal: BlobError) -> Self {
        match refusal {
            BlobError::TooShort { .. } | BlobError::Magic | BlobError::Length { .. } => {
                Self::TRUEPOSE_BLOB_NOT_ONE
            }
            BlobError::Checksum => Self::TRUEPOSE_BLOB_CHECKSUM,
            BlobError::LayoutNewer { .. } | BlobError::LayoutOlder { .. } => {
                Self::TRUEPOSE_BLOB_LAYOUT
            }
            BlobError::Joints { .. } => Self::TRUEPOSE_BLOB_JOINTS,
            BlobError::Reserved
            | BlobError::Body
            | BlobError::Trailing { .. }
            | BlobError::BufferTooSmall => Self::TRUEPOSE_BLOB_BODY,
            _ => Self::TRUEPOSE_BLOB_VALUES,
        }
    }
}
