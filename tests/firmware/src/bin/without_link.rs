#![cfg_attr(target_os = "none", no_std, no_main)]
//! What `no_panic` is without the link, without a blob in the program, and with inverse
//! kinematics that are not there: all compensators, all effects, decoding, storage.
//! `tools/no-panic` builds this and reports its size.

#[cfg(target_os = "none")]
mod target {
    use core::hint::black_box;

    use cortex_m_semihosting::debug::{self, EXIT_FAILURE, EXIT_SUCCESS};
    use truepose::params::decode_into;
    use truepose::{Model, Pose};
    use truepose_firmware::arm::JOINTS;
    use truepose_firmware::parameters::ROOM;
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
        let mut room = [0; ROOM];
        let nothing_there = controller::store(&mut room);
        let mut model = Model::<f32, JOINTS>::empty();
        let decoded = decode_into(black_box(&room), &mut model);
        let inverse = |_: &Pose<f32>, near: &[f32; JOINTS]| black_box(Some(*near));
        let ends_well =
            nothing_there && decoded.is_ok() && controller::run(&model, &clock(), Some(&inverse));
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
