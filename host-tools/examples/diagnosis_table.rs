//! How often the diagnosis names what a simulated cell hides.
//!
//! `cargo run --release -p truepose-host-tools --example diagnosis_table -- SEEDS [KIND,...]`
//! prints one line a kind of effect: runs, named first, named first or listed as a rival,
//! runs with a further name, verify rms over the noise's share (median and 95 % point).

use std::error::Error;

use truepose_host::cell::{Arm, Cell, Conditions, Hidden, Instrument, Seen};
use truepose_host::diagnose::hypothesis::Hypothesis;
use truepose_host::diagnose::{Diagnosis, diagnose};
use truepose_host::identify::assess::{Statistics, errors};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::readings::identify_file;

const KINDS: &str = "nothing,joint-gain,gear-eccentricity,gear-ripple,joint-curve,\
    joint-compliance,cross-axis-compliance,tool-load,link-bending,base-flex,backlash,\
    thermal-growth,thermal-drift,time-drift,warm-up,step-change,joint-coupling,axis-wobble,\
    early-reading";

const ARMS: [Arm; 4] = [Arm::Puma560, Arm::Ur10, Arm::Irb120, Arm::Panda];

fn same(hypothesis: &Hypothesis, hidden: Hidden) -> bool {
    let order = hidden.order().map(f64::from);
    let joint = match hypothesis.kind {
        "joint-compliance" | "tool-load" => true,
        _ => hypothesis.joint == hidden.joint(),
    };
    hypothesis.kind == hidden.kind()
        && joint
        && match (hypothesis.order, order) {
            (Some(a), Some(b)) => (a - b).abs() < 0.6,
            _ => true,
        }
}

/// What was hidden, if anything, and what was made of it.
type Run = (Option<Hidden>, Diagnosis);

fn run(kind: &str, seed: u64) -> Result<Option<Run>, Box<dyn Error>> {
    let arm = ARMS[(seed % 4) as usize];
    let seen = if seed.is_multiple_of(2) {
        Seen::Position
    } else {
        Seen::Pose
    };
    let mut conditions = Conditions::rich();
    conditions.approached = kind != "early-reading";
    let instrument = Instrument::new(seen);
    let mut cell = Cell::new(arm, seed);
    let visits = cell.schedule(&conditions, 150, 0);
    let mut hidden = None;
    if kind != "nothing" {
        let ratio = 1.5 + (seed % 5) as f64 / 4.0;
        let Some(drawn) = Hidden::draw(kind, arm, seed) else {
            return Ok(None);
        };
        match cell.clone().showing(drawn, ratio, &visits, &instrument) {
            Ok(with) => cell = with,
            Err(_) => return Ok(None),
        }
        hidden = Some(drawn);
    }
    let data = cell.measure(&visits, &conditions, &instrument, 0).dataset();
    let identified = identify_file(&cell.robot(), &data, Vec::new())
        .map_err(|failure| format!("{kind} {seed}: {failure:?}"))?;
    let diagnosis = diagnose(identified, &|_| {}).map_err(|failure| format!("{failure:?}"))?;
    Ok(Some((hidden, diagnosis)))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments
        .next()
        .unwrap_or_else(|| "20".to_owned())
        .parse()?;
    let kinds = arguments.next().unwrap_or_else(|| KINDS.to_owned());
    println!("kind | runs | first | listed | with a further name | structure | final / geometric");
    for kind in kinds.split(',') {
        let (mut runs, mut first, mut listed, mut extra, mut structure) = (0, 0, 0, 0, 0);
        let mut ratios = Vec::new();
        for seed in 0..seeds {
            let Some((hidden, diagnosis)) = run(kind, seed)? else {
                continue;
            };
            runs += 1;
            let named = &diagnosis.named;
            if let Some(hidden) = hidden {
                let is_first = named
                    .first()
                    .is_some_and(|n| same(&n.step.hypothesis, hidden));
                let is_listed = named.iter().any(|n| {
                    same(&n.step.hypothesis, hidden)
                        || n.rivals
                            .iter()
                            .any(|r| r.delta_bic < 10.0 && same(&r.hypothesis, hidden))
                });
                first += usize::from(is_first);
                listed += usize::from(is_listed);
                if !is_first {
                    let labels: Vec<String> =
                        named.iter().map(|n| n.step.hypothesis.label()).collect();
                    eprintln!("{kind} {seed}: hidden {hidden:?}, named {labels:?}");
                }
            }
            extra += usize::from(named.len() > usize::from(hidden.is_some()));
            structure += usize::from(diagnosis.whiteness.as_ref().is_some_and(|w| w.structure));
            let problem = &diagnosis.identified.problem;
            let verify: Vec<&Observation> = problem.verify.iter().collect();
            let calibration = &diagnosis.identified.calibration;
            let rms = |arm| Statistics::of(&errors(arm, &verify).distances).map_or(0.0, |s| s.rms);
            ratios.push(rms(&calibration.complete.arm) / rms(&calibration.geometric.arm));
        }
        ratios.sort_by(f64::total_cmp);
        let at = |share: f64| ratios.get((share * ratios.len() as f64) as usize).copied();
        println!(
            "{kind} | {runs} | {first} | {listed} | {extra} | {structure} | {:.3} ({:.3})",
            at(0.5).unwrap_or(1.0),
            at(0.95).or(ratios.last().copied()).unwrap_or(1.0)
        );
    }
    Ok(())
}
