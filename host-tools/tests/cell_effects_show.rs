//! Every hidden effect of the simulated cell moves the tool where it is asked to and not at
//! all at size zero.

use truepose_host::cell::{Arm, Cell, Conditions, Hidden, Instrument, Seen};

/// Readings of an arm that is read too early differ, not its poses.
const ONLY_READINGS: &str = "early-reading";

fn kinds() -> impl Iterator<Item = &'static str> {
    Hidden::CATALOGUE.into_iter().chain(Hidden::OUTSIDE)
}

#[test]
fn every_kind_is_drawn_under_its_own_name() {
    for kind in kinds() {
        let drawn: Vec<Hidden> = (0..40)
            .filter_map(|seed| Hidden::draw(kind, Arm::Stanford, seed))
            .collect();
        assert_eq!(drawn.len(), 40, "{kind}");
        assert!(drawn.iter().all(|h| h.kind() == kind));
    }
    assert_eq!(Hidden::draw("no-such-effect", Arm::Stanford, 0), None);
    assert_eq!(
        Hidden::draw("prismatic-straightness", Arm::Puma560, 0),
        None
    );
}

#[test]
fn nothing_moves_at_size_zero_and_something_does_above() {
    let conditions = Conditions::rich();
    for kind in kinds().filter(|kind| *kind != ONLY_READINGS) {
        let plain = Cell::new(Arm::Stanford, 4);
        let visits = plain.schedule(&conditions, 40, 0);
        let mut moved = 0_usize;
        for seed in 0..10 {
            let hidden = Hidden::draw(kind, Arm::Stanford, seed).unwrap();
            let none = plain.clone().with(hidden, 0.0);
            let some = plain.clone().with(hidden, 0.3 * hidden.plausible());
            let farthest = |cell: &Cell| {
                let apart = |v| (cell.truth(v) - plain.truth(v)).abs().max();
                visits.iter().map(apart).fold(0.0_f64, f64::max)
            };
            assert!(farthest(&none) < 1e-15, "{hidden:?}");
            moved += usize::from(farthest(&some) > 1e-5);
            assert!(farthest(&some) < 0.05, "{hidden:?}: {}", farthest(&some));
        }
        assert!(moved > 0, "{kind} never moves the tool");
    }
}

#[test]
fn every_kind_can_be_made_to_show() {
    let conditions = Conditions::rich();
    for kind in kinds() {
        let mut shown = 0_usize;
        for seed in 0..12 {
            let arm = Arm::ALL[seed as usize % Arm::ALL.len()];
            let Some(hidden) = Hidden::draw(kind, arm, seed) else {
                continue;
            };
            let cell = Cell::new(arm, seed);
            let visits = cell.schedule(&conditions, 120, 0);
            let instrument = Instrument::new(if seed % 2 == 0 {
                Seen::Position
            } else {
                Seen::Pose
            });
            if let Ok(cell) = cell.showing(hidden, 1.8, &visits, &instrument) {
                let size = cell.hidden().next().unwrap().1;
                assert!(size.abs() <= hidden.plausible() && size.abs() > 0.0);
                shown += 1;
            }
        }
        assert!(shown >= 2, "{kind} shows in {shown} of 12 cells");
    }
}

#[test]
fn what_geometry_takes_up_cannot_be_made_to_show() {
    // A gain of a joint that hardly moves is its offset.
    let conditions = Conditions {
        range: 1e-6,
        ..Conditions::default()
    };
    let cell = Cell::new(Arm::Puma560, 1);
    let visits = cell.schedule(&conditions, 60, 0);
    let gain = Hidden::JointGain { joint: 2 };
    let refused = cell
        .showing(gain, 2.0, &visits, &Instrument::new(Seen::Position))
        .unwrap_err();
    assert!(refused.needed > refused.plausible, "{refused}");
}
