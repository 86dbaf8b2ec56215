//! Where C keeps a compensator: a piece of memory of a known size whose inside is ours.

use core::mem::{MaybeUninit, align_of, size_of};

use truepose::Model;
use truepose::compensate::Compensator;

use crate::{JOINTS, truepose_error};

/// Size of a `truepose_compensator` in words of 8 bytes, for the largest build.
pub const TRUEPOSE_WORDS: usize = 1088;

/// A compensator with its model. Room for it is the caller's: a static variable, or a local one
/// that lives long enough. Set it to zero before `truepose_init`.
///
/// Once it is ready it may not be moved or copied: it points into itself. There is nothing to
/// free; it ends when its memory is used for something else. Several may be used side by side;
/// one must not be used by two tasks at a time.
#[repr(C)]
#[derive(Debug)]
pub struct truepose_compensator {
    /// Not for the caller.
    inside: [u64; TRUEPOSE_WORDS],
}

/// What is in there.
struct Instance {
    /// [`READY`], or zero.
    ready: u32,
    model: MaybeUninit<Model<'static, f32, JOINTS>>,
    compensator: MaybeUninit<Compensator<'static, f32, JOINTS>>,
}

/// Says that the rest is there. Memory that is zero does not say so.
const READY: u32 = 0x5450_4F4B;

const _: () = {
    assert!(size_of::<Instance>() <= size_of::<truepose_compensator>());
    assert!(align_of::<Instance>() <= align_of::<truepose_compensator>());
};

/// The places of an instance. Never one reference to all of it: the compensator holds one to
/// the model beside it.
pub(crate) struct Parts {
    ready: *mut u32,
    pub(crate) model: *mut Model<'static, f32, JOINTS>,
    pub(crate) compensator: *mut Compensator<'static, f32, JOINTS>,
}

impl Parts {
    /// # Safety
    /// `arm`: not null, to memory of that type.
    pub(crate) unsafe fn of(arm: *mut truepose_compensator) -> Self {
        let instance = arm.cast::<Instance>();
        // SAFETY: inside the caller's memory, which is large enough and aligned, see above.
        unsafe {
            Self {
                ready: &raw mut (*instance).ready,
                model: (&raw mut (*instance).model).cast(),
                compensator: (&raw mut (*instance).compensator).cast(),
            }
        }
    }

    /// # Safety
    /// The memory is all zero, or was made ready and not moved since.
    pub(crate) unsafe fn is_ready(&self) -> bool {
        // SAFETY: any bits are a number.
        unsafe { self.ready.read() == READY }
    }

    /// # Safety
    /// Model and compensator are there.
    pub(crate) unsafe fn set_ready(&self) {
        // SAFETY: inside the caller's memory.
        unsafe { self.ready.write(READY) };
    }
}

/// The compensator inside, to work with.
///
/// # Safety
/// `arm`: null, all zero, or made ready and not moved since; nobody else uses it meanwhile.
pub(crate) unsafe fn compensator<'i>(
    arm: *mut truepose_compensator,
) -> Result<&'i mut Compensator<'static, f32, JOINTS>, truepose_error> {
    if arm.is_null() {
        return Err(truepose_error::TRUEPOSE_NULL_POINTER);
    }
    // SAFETY: not null, and the caller's word.
    unsafe {
        let parts = Parts::of(arm);
        if !parts.is_ready() {
            return Err(truepose_error::TRUEPOSE_NOT_READY);
        }
        Ok(&mut *parts.compensator)
    }
}

/// The model inside.
///
/// # Safety
/// As for [`compensator`], but others may read.
pub(crate) unsafe fn model<'i>(
    arm: *const truepose_compensator,
) -> Result<&'i Model<'static, f32, JOINTS>, truepose_error> {
    if arm.is_null() {
        return Err(truepose_error::TRUEPOSE_NULL_POINTER);
    }
    // SAFETY: not null, and the caller's word; nothing is written.
    unsafe {
        let parts = Parts::of(arm.cast_mut());
        if !parts.is_ready() {
            return Err(truepose_error::TRUEPOSE_NOT_READY);
        }
        Ok(&*parts.model)
    }
}
