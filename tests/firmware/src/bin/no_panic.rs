#![cfg_attr(target_os = "none", no_std, no_main)]
//! Everything that a controller runs, linked so that it cannot panic: the panic handler calls a
//! function that does not exist, so a panic path anywhere is an error of the linker.
//! `tools/no-panic` builds this and says which function still has one.

#[cfg(target_os = "none")]
mod target {
    use core::hint::black_box;

    use cortex_m_semihosting::debug::{self, EXIT_FAILURE, EXIT_SUCCESS};
    use truepose::Model;
    use truepose::compensate::spherical_wrist::SphericalWrist;
    use truepose::params::decode_into;
    use truepose_firmware::arm::JOINTS;
    use truepose_firmware::parameters::{ROOM, WITH_EFFECTS};
    use truepose_firmware::{clock, controller};

    #[expect(unsafe_code, reason = "names a function that is defined nowhere")]
    unsafe extern "C" {
        safe fn a_panic_path_remains() -> !;
    }

    #[panic_handler]
    fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
        a_panic_path_remains()
    }

    #[cortex_m_rt::entry]
    fn start() -> ! {
        let mut model = Model::<f32, JOINTS>::empty();
        let decoded = decode_into(black_box(WITH_EFFECTS), &mut model);
        let arm = model.nominal.clone();
        let wrist = SphericalWrist::of(&arm);
        let ends_well = decoded.is_ok()
            && wrist.is_some_and(|wrist| {
                let inverse = |pose: &_, near: &_| wrist.inverse(pose, near);
                controller::run(&model, &clock(), Some(&inverse))
            })
            && controller::keep(&mut [0; ROOM]);
        loop {
            debug::exit(if ends_well {
                EXIT_SUCCESS
            } else {
                EXIT_FAILURE
            });
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
