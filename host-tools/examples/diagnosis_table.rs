//! How often the diagnosis names what a simulated cell hides.
//!
//! `cargo run --release -p truepose-host-tools --example diagnosis_table -- SEEDS [LINE,...]
//! [FIRST]` prints one line a scenario or kind of effect (docs/DIAGNOSIS.md explains the
//! columns), and what went wrong on stderr. FIRST is the first seed, 0 unless given.

use std::error::Error;

use rayon::prelude::*;
use truepose_host::cell::{Arm, Cell, Conditions, Hidden, Instrument, Seen, Visit};
use truepose_host::diagnose::hypothesis::Hypothesis;
use truepose_host::diagnose::{Answer, Diagnosis, Named, diagnose, input, likelier};
use truepose_host::identify::arm::ArmModel;
use truepose_host::identify::assess::{Statistics, errors};
use truepose_host::identify::observation::Observation;
use truepose_host::identify::readings::identify_file;
use truepose_host::plan::discriminate;

const ARMS: [Arm; 4] = [Arm::Puma560, Arm::Ur10, Arm::Irb120, Arm::Panda];

/// Kinds of the catalogue that every arm can show.
const KINDS: [&str; 18] = [
    "joint-gain",
    "gear-eccentricity",
    "gear-ripple",
    "joint-curve",
    "joint-compliance",
    "cross-axis-compliance",
    "tool-load",
    "link-bending",
    "base-flex",
    "backlash",
    "thermal-growth",
    "thermal-drift",
    "time-drift",
    "warm-up",
    "step-change",
    "joint-coupling",
    "axis-wobble",
    "early-reading",
];

/// What a line of the table simulates.
#[derive(Clone)]
struct Scenario {
    name: String,
    /// Kinds that seeds take their effects from in turn, and how many of them at once.
    kinds: Vec<&'static str>,
    at_once: usize,
    rows: usize,
    /// Share of the joints' ranges that is used.
    range: f64,
    /// The temperature rises in proportion to time.
    warming: bool,
    /// Placements of the instrument that are written down.
    sessions: u32,
    /// Poses that are added where a first diagnosis leaves rivals, as `plan --discriminate`
    /// proposes them; other runs are left out.
    more: usize,
    instrument: fn(Seen) -> Instrument,
}

impl Scenario {
    fn named(name: &str) -> Option<Self> {
        let plain = |kinds: Vec<&'static str>, at_once| Self {
            name: name.to_owned(),
            kinds,
            at_once,
            rows: 150,
            range: 0.9,
            warming: false,
            sessions: 2,
            more: 0,
            instrument: Instrument::new,
        };
        let heavy = |seen| Instrument {
            student: Some(4),
            ..Instrument::new(seen)
        };
        let unbalanced = |seen| Instrument {
            declared: Some([1.73, 1.0 / 1.73]),
            ..Instrument::new(seen)
        };
        let outliers = |seen| Instrument {
            outliers: Some((0.04, 4e-3)),
            ..Instrument::new(seen)
        };
        Some(match name {
            "nothing" => plain(Vec::new(), 0),
            "nothing-heavy-tails" => Self {
                instrument: heavy,
                ..plain(Vec::new(), 0)
            },
            "nothing-wrong-ratio" => Self {
                instrument: unbalanced,
                ..plain(Vec::new(), 0)
            },
            "one" => plain(KINDS.to_vec(), 1),
            "two" => plain(KINDS.to_vec(), 2),
            "three" => plain(KINDS.to_vec(), 3),
            "one-outliers" => Self {
                instrument: outliers,
                ..plain(KINDS.to_vec(), 1)
            },
            "one-30-poses" => Self {
                rows: 45,
                ..plain(KINDS.to_vec(), 1)
            },
            "short-range" => Self {
                range: 0.15,
                ..plain(vec!["joint-gain", "gear-eccentricity"], 1)
            },
            "short-range-decided" => Self {
                more: 20,
                ..Self::named("short-range")?
            },
            "warming" => Self {
                warming: true,
                ..plain(vec!["thermal-drift", "time-drift"], 1)
            },
            "instrument-moved" => Self {
                sessions: 1,
                ..plain(vec!["instrument-moved"], 1)
            },
            "outside" => plain(Hidden::OUTSIDE.to_vec(), 1),
            name => {
                let all = KINDS.iter().chain(&Hidden::OUTSIDE);
                plain(vec![all.copied().find(|&k| k == name)?], 1)
            }
        })
    }
}

/// What one run gave.
#[derive(Default)]
struct Run {
    hidden: usize,
    /// Hidden effects named, named or listed as rivals.
    named: usize,
    listed: usize,
    first: bool,
    /// Names of the catalogue, and how many of them beyond the number of hidden effects.
    names: usize,
    further: usize,
    unnamed: bool,
    /// The table was blamed for what it does not have.
    blamed: bool,
    answer: Option<Answer>,
    /// Verify rms: geometry alone, complete, the same rows without the effect (geometry), a
    /// fit that is told what is hidden.
    rms: [f64; 4],
    /// Chance that all its names are right, by the odds against the rivals of each.
    credence: f64,
    remark: String,
}

/// Chance that a name is right if one of its rivals or itself is: likelihoods by BIC, each times the
/// candidate's share.
fn credence(named: &Named) -> f64 {
    let own = named.step.hypothesis.ln_weight;
    let odds = named
        .rivals
        .iter()
        .map(|r| (r.hypothesis.ln_weight - own - 0.5 * r.delta_bic).exp());
    1.0 / (1.0 + odds.sum::<f64>())
}

fn same(hypothesis: &Hypothesis, hidden: Hidden) -> bool {
    let order = hidden.order().map(f64::from);
    let joint = match hypothesis.kind {
        // any of its joints, or the group
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

/// `None` where these poses cannot show the effect.
fn run(scenario: &Scenario, seed: u64) -> Result<Option<Run>, String> {
    let arm = ARMS[(seed % 4) as usize];
    let seen = if seed.is_multiple_of(2) {
        Seen::Position
    } else {
        Seen::Pose
    };
    let pick = |i: usize| {
        let kinds = &scenario.kinds;
        kinds[(seed as usize * (1 + 6 * i) + seed as usize / 4 + 5 * i) % kinds.len()]
    };
    let kinds: Vec<&str> = (0..scenario.at_once).map(pick).collect();
    let mut conditions = Conditions::rich();
    conditions.approached = !kinds.contains(&"early-reading");
    conditions.range = scenario.range;
    let instrument = (scenario.instrument)(seen);
    let empty = Cell::new(arm, seed);
    let mut visits = empty.schedule(&conditions, scenario.rows, 0);
    for visit in visits.iter_mut().filter(|_| scenario.warming) {
        visit.temperature = 20.0 + visit.time / 400.0;
    }
    let mut cell = empty.clone();
    let mut hidden = Vec::new();
    for (i, kind) in kinds.iter().enumerate() {
        let ratio = 1.5 + ((seed + i as u64) % 5) as f64 / 4.0;
        let Some(drawn) = Hidden::draw(kind, arm, seed + 1000 * i as u64) else {
            return Ok(None);
        };
        if kinds[..i].contains(kind) {
            return Ok(None);
        }
        match cell.clone().showing(drawn, ratio, &visits, &instrument) {
            Ok(with) => cell = with,
            Err(_) => return Ok(None),
        }
        hidden.push(drawn);
    }
    // the instrument may move without anybody writing it down
    conditions.sessions = scenario.sessions;
    let fitted = |cell: &Cell, visits: &[Visit]| {
        let measured = cell.measure(visits, &conditions, &instrument, 0);
        let gross: Vec<usize> = (0..measured.rows.len())
            .filter(|&i| measured.rows[i].outlier)
            .map(|i| i + 1)
            .collect();
        identify_file(&cell.robot(), &measured.dataset(), Vec::new())
            .map(|identified| (identified, gross))
            .map_err(|failure| format!("{hidden:?} {seed}: {failure:?}"))
    };
    if scenario.more > 0 {
        let (identified, _) = fitted(&cell, &visits)?;
        let found = diagnose(identified, &|_| {}).map_err(|f| format!("{hidden:?}: {f:?}"))?;
        match further(&cell, &visits, &found, scenario.more, seed) {
            Some(further) => visits.extend(further),
            None => return Ok(None),
        }
    }
    let (floor, _) = fitted(&empty, &visits)?;
    let (identified, gross) = fitted(&cell, &visits)?;
    let measured = cell.measure(&visits, &conditions, &instrument, 0);
    let data = measured.dataset();
    let geometric = Some(&identified.calibration.geometric);
    let findings = input::check(&identified.problem, &data, &cell.robot(), geometric);
    let is_hidden = |kind: input::Kind| {
        let hidden_as = match kind {
            input::Kind::EarlyReading => "early-reading",
            input::Kind::InstrumentMoved => "instrument-moved",
            _ => return false,
        };
        kinds.contains(&hidden_as)
    };
    let false_findings: Vec<input::Kind> = findings
        .iter()
        .map(|f| f.kind)
        .filter(|&kind| !is_hidden(kind))
        .collect();
    let diagnosis = diagnose(identified, &|_| {})
        .map_err(|failure| format!("{hidden:?} {seed}: {failure:?}"))?;
    let rms = |arm: &ArmModel, rows: &[Observation]| {
        let verify: Vec<&Observation> = rows.iter().filter(|o| !gross.contains(&o.row)).collect();
        Statistics::of(&errors(arm, &verify).distances).map_or(0.0, |s| s.rms)
    };
    let rows = &diagnosis.identified.problem.verify;
    let without = rms(&floor.calibration.geometric.arm, &floor.problem.verify);
    let calibration = &diagnosis.identified.calibration;
    let mut run = judged(
        &diagnosis,
        &hidden,
        [
            rms(&calibration.geometric.arm, rows),
            rms(&calibration.complete.arm, rows),
            without,
            if hidden.is_empty() {
                without
            } else {
                cell.told(&measured)
            },
        ],
        seed,
    );
    if !false_findings.is_empty() {
        run.blamed = true;
        run.remark += &format!(" table blamed for {false_findings:?}");
    }
    Ok(Some(run))
}

/// Visits to the poses that would decide; `None` where nothing is open.
fn further(
    cell: &Cell,
    visits: &[Visit],
    found: &Diagnosis,
    count: usize,
    seed: u64,
) -> Option<Vec<Visit>> {
    let joints = cell.robot().joints;
    let limits: Option<Vec<[f64; 2]>> = joints.iter().map(|j| j.limits).collect();
    let decision = discriminate(found, &limits?, count, seed)?;
    let last = visits.last()?;
    let visits = decision.poses.iter().enumerate().map(|(i, q)| Visit {
        q: q.clone(),
        previous: q.clone(),
        time: last.time + 20.0 * (i + 1) as f64,
        verify: false,
        ..last.clone()
    });
    Some(visits.collect())
}

fn judged(diagnosis: &Diagnosis, hidden: &[Hidden], rms: [f64; 4], seed: u64) -> Run {
    let named = &diagnosis.named;
    let is_named = |h: &&Hidden| named.iter().any(|n| same(&n.step.hypothesis, **h));
    let is_listed = |h: &&Hidden| {
        let rivals = named.iter().flat_map(|n| &n.rivals);
        let mut close = rivals.filter(|r| r.delta_bic < 10.0);
        is_named(h) || close.any(|r| same(&r.hypothesis, **h))
    };
    let physical = named.iter().filter(|n| n.step.hypothesis.kind != "unnamed");
    let names = physical.count();
    let label = |n: &Named| {
        let rivals = n.rivals.iter().filter(|r| r.delta_bic < 10.0).map(|r| {
            let (label, similarity) = (r.hypothesis.label(), r.similarity);
            format!("{label} ({:.1} worse, cosine {similarity:.3})", r.delta_bic)
        });
        let rivals: Vec<String> = rivals.collect();
        match rivals.is_empty() {
            true => n.step.hypothesis.label(),
            false => format!("{} or {}", n.step.hypothesis.label(), rivals.join(" or ")),
        }
    };
    let labels: Vec<String> = named.iter().map(label).collect();
    let mut run = Run {
        hidden: hidden.len(),
        named: hidden.iter().filter(is_named).count(),
        listed: hidden.iter().filter(is_listed).count(),
        first: match (named.first(), hidden) {
            (None, []) => true,
            (Some(first), _) => hidden.iter().any(|h| same(&first.step.hypothesis, *h)),
            _ => false,
        },
        names,
        further: names.saturating_sub(hidden.len()),
        unnamed: named.iter().any(|n| n.step.hypothesis.kind == "unnamed"),
        blamed: false,
        answer: Some(diagnosis.answer()),
        rms,
        credence: named.iter().map(credence).product(),
        remark: String::new(),
    };
    let [geometric, complete, floor, told] = rms.map(|x| x * 1e3);
    let remains = diagnosis.answer() == Answer::StructureRemains;
    let truth = match run.named < run.hidden {
        true => against_truth(diagnosis, hidden),
        false => String::new(),
    };
    if remains || run.named < run.hidden || named.len() > run.hidden || complete > 1.02 * told {
        run.remark = format!(
            "{seed}: {hidden:?},{truth} {geometric:.4} to {complete:.4} of {floor:.4} (told {told:.4}) mm, {:?}, {labels:?}, \
             chances: {}",
            diagnosis.answer(),
            chances(diagnosis)
        );
    }
    run
}

/// Whether these rows speak for what is hidden or for what was named instead.
fn against_truth(diagnosis: &Diagnosis, hidden: &[Hidden]) -> String {
    let wanted: Vec<_> = hidden
        .iter()
        .map(|&h| move |candidate: &Hypothesis| same(candidate, h))
        .collect();
    let wanted: Vec<&dyn Fn(&Hypothesis) -> bool> = wanted.iter().map(|w| w as &_).collect();
    match likelier(diagnosis, &wanted) {
        Some(by) if by > 0.0 => format!(" the truth likelier by {by:.1},"),
        Some(by) => format!(" the truth less likely by {:.1},", -by),
        None => " the truth not comparable,".to_owned(),
    }
}

/// Chances by which the verdict was found.
fn chances(diagnosis: &Diagnosis) -> String {
    let white = diagnosis.whiteness.as_ref().map_or(f64::NAN, |w| w.p_value);
    let unseen = diagnosis.unseen.map_or(f64::NAN, |u| u.p_value);
    let bent = diagnosis
        .disproportion
        .as_ref()
        .map_or(f64::NAN, |d| d.ln_p.exp());
    let opponent = diagnosis
        .opponent
        .as_ref()
        .map_or(f64::NAN, |o| o.ln_p.exp());
    let friction = diagnosis.friction.map_or(f64::NAN, |f| f.ln_odds);
    format!(
        "white {white:.3}, unseen {unseen:.4}, bent {bent:.1e}, opponent {opponent:.1e}, \
         friction ln {friction:.1}"
    )
}

fn at(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    let place = (share * last as f64).round() as usize;
    sorted.get(place).copied().unwrap_or(f64::NAN)
}

fn line(scenario: &Scenario, runs: &[Run]) -> String {
    let count = |is: &dyn Fn(&Run) -> bool| runs.iter().filter(|r| is(r)).count();
    let sorted = |value: &dyn Fn(&Run) -> f64| {
        let mut values: Vec<f64> = runs.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let over_floor = sorted(&|r| r.rms[1] / r.rms[2]);
    let over_told = sorted(&|r| r.rms[1] / r.rms[3]);
    let over_geometry = sorted(&|r| r.rms[1] / r.rms[0]);
    let removed = sorted(&|r| {
        let [geometric, complete, floor, _] = r.rms.map(|x| x * x);
        (geometric - complete) / (geometric - floor)
    });
    let removed = match scenario.at_once {
        0 => "-".to_owned(),
        _ => format!("{:.2}", at(&removed, 0.5)),
    };
    let remains = |r: &Run| r.answer == Some(Answer::StructureRemains);
    format!(
        "| {} | {} | {} | {} | {:.0} | {} | {} | {} | {} | {} | {} | {} | {:.3} / {:.3} | {:.3} / {:.3} | {:.3} | {removed} |",
        scenario.name,
        runs.len(),
        count(&|r| r.first),
        count(&|r| r.named == r.hidden),
        runs.iter().map(|r| r.credence).sum::<f64>(),
        count(&|r| r.listed == r.hidden),
        count(&|r| r.further > 0),
        count(&|r| r.unnamed),
        count(&|r| r.blamed),
        count(&remains),
        count(&|r| r.answer == Some(Answer::Ambiguous)),
        count(&|r| r.names > 0 && !remains(r)),
        at(&over_floor, 0.5),
        at(&over_floor, 0.95),
        at(&over_told, 0.5),
        at(&over_told, 0.95),
        at(&over_geometry, 1.0),
    )
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = match arguments.next() {
        Some(seeds) => seeds.parse()?,
        None => 20,
    };
    let lines = arguments.next().unwrap_or_else(|| {
        let scenarios = "nothing,nothing-heavy-tails,nothing-wrong-ratio,one,one-outliers,\
                         one-30-poses,short-range,warming,two,three,\
                         instrument-moved";
        let kinds = KINDS.iter().chain(&Hidden::OUTSIDE);
        kinds.fold(scenarios.to_owned(), |all, kind| format!("{all},{kind}"))
    });
    let first: u64 = match arguments.next() {
        Some(first) => first.parse()?,
        None => 0,
    };
    println!(
        "| line | runs | first | all named | by its odds | all listed | further name | unnamed | table blamed | \
         structure remains | ambiguous | name without it | final / floor: median / 95 % | \
         final / told: median / 95 % | \
         worst final / geometry | excess removed |"
    );
    println!("|{}", " --- |".repeat(16));
    for name in lines.split(',') {
        let scenario = Scenario::named(name).ok_or_else(|| format!("no line {name}"))?;
        let runs: Vec<Option<Run>> = (first..first + seeds)
            .into_par_iter()
            .map(|seed| run(&scenario, seed))
            .collect::<Result<_, _>>()?;
        let runs: Vec<Run> = runs.into_iter().flatten().collect();
        println!("{}", line(&scenario, &runs));
        for run in runs.iter().filter(|r| !r.remark.is_empty()) {
            eprintln!("{name} {}", run.remark);
        }
    }
    Ok(())
}
