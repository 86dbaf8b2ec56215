//! Which poses the cell's arm is sent to, and under which conditions.

use super::drawing::Drawing;
use crate::random::Random;

/// One stop of the arm: what it is sent to and what holds there.
#[derive(Clone, Debug, PartialEq)]
pub struct Visit {
    /// Joint command, rad or m.
    pub q: Vec<f64>,
    /// Joints that it comes from; the same as `q` where nobody knows.
    pub previous: Vec<f64>,
    /// kg.
    pub payload: f64,
    /// Payload's centre of mass in the tool frame, m.
    pub payload_com: [f64; 3],
    /// degC.
    pub temperature: f64,
    /// s since the start.
    pub time: f64,
    /// Placement of the instrument, from 0.
    pub session: u32,
    /// True: a row that no fit may use.
    pub verify: bool,
}

impl Visit {
    /// At rest at `q`, unloaded, at 20 degC, at the start.
    pub fn at(q: &[f64]) -> Self {
        Self {
            q: q.to_vec(),
            previous: q.to_vec(),
            payload: 0.0,
            payload_com: [0.0; 3],
            temperature: 20.0,
            time: 0.0,
            session: 0,
            verify: false,
        }
    }

    /// Sign of the last move of a joint: -1, 0 (none) or +1.
    pub fn direction(&self, joint: usize) -> f64 {
        match (self.q.get(joint), self.previous.get(joint)) {
            (Some(q), Some(p)) if q > p => 1.0,
            (Some(q), Some(p)) if q < p => -1.0,
            _ => 0.0,
        }
    }
}

/// How a series of poses is run and what is written down about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Conditions {
    /// Share of every joint's range that is used, about its middle.
    pub range: f64,
    /// Share of the rows that are for verification only, in `set`.
    pub verify_share: f64,
    /// Payloads that are put on in turn for blocks of rows, kg; none: no such columns.
    pub payloads: Vec<f64>,
    /// The direction of each joint's last move is written down.
    pub direction: bool,
    /// Every pose is approached by a short move of its own, each joint from either side.
    pub approached: bool,
    /// The temperature is written down. It rises and, after a pause, falls.
    pub temperature: bool,
    /// The time is written down.
    pub time: bool,
    /// Placements of the instrument; more than one: written down.
    pub sessions: u32,
    /// Commands are written down beside the readings.
    pub commands: bool,
}

impl Default for Conditions {
    /// Joints alone, the middle 90 % of their range, one row in three for verification.
    fn default() -> Self {
        Self {
            range: 0.9,
            verify_share: 1.0 / 3.0,
            payloads: Vec::new(),
            direction: false,
            approached: false,
            temperature: false,
            time: false,
            sessions: 1,
            commands: false,
        }
    }
}

impl Conditions {
    /// Everything that can be written down, but the commands: payloads of 0, 2 and 5 kg,
    /// approaches from both sides, temperature, time, two placements of the instrument.
    pub fn rich() -> Self {
        Self {
            payloads: vec![0.0, 2.0, 5.0],
            direction: true,
            approached: true,
            temperature: true,
            time: true,
            sessions: 2,
            ..Self::default()
        }
    }
}

/// Where a payload's centre of mass is, tool frame, m.
const PAYLOAD_COM: [f64; 3] = [0.01, -0.02, 0.06];
/// One pose takes this long, s.
const SECONDS_A_POSE: f64 = 20.0;
/// Pause before the arm cools down, s.
const PAUSE: f64 = 2400.0;

/// `count` random stops. Postures, moves and set are independent of the conditions that are
/// switched on.
pub(crate) fn schedule(
    drawing: &Drawing,
    conditions: &Conditions,
    count: usize,
    random: &mut Random,
) -> Vec<Visit> {
    let mut previous: Option<Vec<f64>> = None;
    let mut visits = Vec::with_capacity(count);
    for i in 0..count {
        let q: Vec<f64> = drawing
            .links
            .iter()
            .map(|link| {
                let [low, high] = link.limits;
                let middle = 0.5 * (low + high);
                middle + 0.5 * (high - low) * conditions.range * random.between(-1.0, 1.0)
            })
            .collect();
        let aside: Vec<f64> = q.iter().map(|q| q - 0.03 * random.sign()).collect();
        let verify = random.unit() < conditions.verify_share;
        // Three blocks: warming up, a pause at half past, cooling.
        let share = i as f64 / count.max(1) as f64;
        let mut time = SECONDS_A_POSE * i as f64;
        let warm = 12.0 * (1.0 - libm::exp(-4.0 * share.min(0.5)));
        let mut temperature = 20.0 + warm;
        if share >= 0.5 {
            time += PAUSE;
            let cooled = libm::exp(-2.0 * (share - 0.5) - 0.5);
            temperature = 20.0 + warm * cooled;
        }
        let blocks = conditions.payloads.len();
        let payload = match blocks {
            0 => 0.0,
            // Six blocks over the run, so that load and time are not one thing.
            _ => conditions
                .payloads
                .get((share * 2.0 * blocks as f64) as usize % blocks)
                .copied()
                .unwrap_or(0.0),
        };
        let session = (share * f64::from(conditions.sessions)) as u32;
        let from = match (&previous, conditions.approached) {
            (_, true) => aside,
            (Some(previous), false) => previous.clone(),
            (None, false) => q.clone(),
        };
        previous = Some(q.clone());
        visits.push(Visit {
            previous: from,
            payload,
            payload_com: if payload > 0.0 { PAYLOAD_COM } else { [0.0; 3] },
            temperature,
            time,
            session,
            verify,
            q,
        });
    }
    visits
}
