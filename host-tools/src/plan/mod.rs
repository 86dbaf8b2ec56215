//! Which poses to measure.
//!
//! A pose is worth what its rows add to the information on the parameters. Out of all poses
//! within the joint limits, a set is chosen that makes the determinant of the information
//! large (D-optimal, the same as large O1: it does not depend on the parameters' scaling), or
//! the largest variance of the predicted tool anywhere small (minimax, G-optimal): first by
//! exchange with a random pool, then by simulated annealing in the joint values themselves.

mod arm;
mod bound;
mod choice;
mod design;
mod discriminate;
mod forecast;
mod search;

use nalgebra::DMatrix;

use crate::observability::{Observability, Unobservable, scale_columns};
use crate::random::Random;

pub use arm::{MeasuredArm, limits};
pub use choice::{Choice, Seen};
pub use discriminate::{Decision, Dispute, discriminate};

use design::Blocks;
pub use forecast::Forecast;
use search::{Aim, Chosen, Pool, anneal, exchange};

/// What a set of poses is chosen for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Criterion {
    /// Small volume of the parameters' confidence region, large O1.
    Determinant,
    /// Small largest error of the predicted tool point.
    Minimax,
}

/// How the search goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Number of poses to choose.
    pub poses: usize,
    /// What for.
    pub criterion: Criterion,
    /// Random poses that the exchange chooses from.
    pub pool: usize,
    /// Moves that the annealing tries.
    pub proposals: usize,
    /// Places at which the predicted tool is looked at.
    pub places: usize,
    /// Same seed, same plan.
    pub seed: u64,
}

impl Settings {
    /// `poses` of them, a search of some seconds.
    pub fn new(poses: usize) -> Self {
        Self {
            poses,
            criterion: Criterion::Determinant,
            pool: 1500,
            proposals: 80_000,
            places: 400,
            seed: 1,
        }
    }
}

/// The arm as far as a plan is concerned: what a pose shows of the parameters.
pub trait Sensitivity {
    /// Number of parameters.
    fn parameters(&self) -> usize;

    /// Rows that one measured pose gives.
    fn height(&self) -> usize;

    /// Lower and upper end of every joint, rad or m, or of whatever else a pose is chosen by.
    fn limits(&self) -> &[[f64; 2]];

    /// Moves `q` to a choice nearby that can be measured; false where there is none.
    fn bring(&mut self, q: &mut [f64]) -> bool {
        let _ = q;
        true
    }

    /// Rows of the identification Jacobian at the readings `q`: row after row, each over the
    /// instrument's sigma, each column times what may be expected of its parameter.
    fn rows(&mut self, q: &[f64], rows: &mut [f64]);

    /// d tool point / d parameters at the readings `q`, m, three rows, columns as in
    /// [`Self::rows`].
    fn tool(&mut self, q: &[f64], rows: &mut [f64]);
}

/// A chosen set.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Joint values, rad or m, the most telling first: any first few of them are a good set
    /// of their number.
    pub poses: Vec<Vec<f64>>,
    /// Of these poses and those measured already; each column times what may be expected of
    /// its parameter.
    pub observability: Observability,
    /// The same with each column of unit length (SH 45).
    pub of_unit_columns: Observability,
    /// Of as many random poses within the limits, the median.
    pub random: Option<Observability>,
    /// No set of as many poses within the limits has an O1 above this.
    pub o1_bound: f64,
    /// How far off the predicted tool will be, for growing numbers of poses.
    pub forecast: Vec<Forecast>,
}

/// Why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// So many poses cannot show all parameters: rows, parameters.
    TooFew(usize, usize),
    /// Poses within the limits do not show all parameters.
    Unobservable(Unobservable),
    /// Hardly any pose within the limits reaches what is to be touched.
    OutOfReach,
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::TooFew(rows, parameters) => write!(
                f,
                "{rows} measured numbers cannot show {parameters} parameters; ask for more poses"
            ),
            Self::Unobservable(Unobservable::RankDeficient(rank, parameters)) => write!(
                f,
                "poses within these limits show {rank} combinations of {parameters} parameters"
            ),
            Self::OutOfReach => write!(
                f,
                "what is to be touched is out of reach of poses within these limits"
            ),
            Self::Unobservable(Unobservable::NotANumber) => {
                write!(f, "the model gives numbers that are not finite")
            }
        }
    }
}

impl std::error::Error for Refused {}

/// Random numbers of the pool, the annealing, the workspace, the comparison and the bound.
const POOL: u64 = 1;
const ANNEAL: u64 = 2;
const PLACES: u64 = 3;
const COMPARE: u64 = 4;
const BOUND: u64 = 6;

/// Random sets that a plan is compared with.
const RANDOM_SETS: u64 = 21;

/// Chooses poses for `arm`. `measured`: readings of poses that are measured already. `tell`
/// is called with the share done, 0 to 1.
pub fn plan(
    arm: &mut dyn Sensitivity,
    settings: &Settings,
    measured: &[Vec<f64>],
    tell: &mut dyn FnMut(f64),
) -> Result<Plan, Refused> {
    let (width, height) = (arm.parameters(), arm.height());
    let limits = arm.limits().to_vec();
    let total = settings.poses + measured.len();
    if total * height < width || settings.poses == 0 {
        return Err(Refused::TooFew(total * height, width));
    }
    let before = blocks(arm, measured);
    let mut fixed = DMatrix::zeros(width, width);
    (0..before.len()).for_each(|i| before.inform(i, &mut fixed));

    let mut random = Random::new(settings.seed, POOL);
    let q = draw(arm, settings.pool.max(2 * settings.poses), &mut random);
    if q.len() < settings.poses {
        return Err(Refused::OutOfReach);
    }
    let pool = Pool {
        blocks: blocks(arm, &q),
        q,
    };
    let members = exchange(&pool, &fixed, settings.poses);
    tell(0.2);

    let mut chosen = Chosen {
        q: members
            .iter()
            .filter_map(|&i| pool.q.get(i).cloned())
            .collect(),
        blocks: Blocks::new(width, height),
    };
    members
        .iter()
        .for_each(|&i| chosen.blocks.push(pool.blocks.get(i)));
    let looked_at = random_poses(
        &limits,
        settings.places,
        &mut Random::new(settings.seed, PLACES),
    );
    let places = tools(arm, &looked_at);
    let mut chance = Random::new(settings.seed, ANNEAL);
    let mut steps = vec![(Aim::Determinant, settings.proposals)];
    if settings.criterion == Criterion::Minimax {
        // Close to D-optimal is close to minimax; a quarter, since each move is dearer.
        steps.push((Aim::Largest(&places), settings.proposals / 4));
    }
    for (aim, proposals) in &steps {
        anneal(
            &mut chosen,
            &fixed,
            &limits,
            aim,
            *proposals,
            &mut chance,
            arm,
        );
        tell(0.7);
    }
    tell(0.9);

    let order = forecast::order(&chosen.blocks, &fixed);
    let poses: Vec<Vec<f64>> = order
        .iter()
        .filter_map(|&i| chosen.q.get(i).cloned())
        .collect();
    let forecast = forecast::forecast(&chosen.blocks, &order, &before, &places);
    let observability = observe(&before, &chosen.blocks).map_err(Refused::Unobservable)?;
    let mut jacobian = stacked(&before, &chosen.blocks);
    scale_columns(&mut jacobian);
    let of_unit_columns = Observability::of(&jacobian, total).map_err(Refused::Unobservable)?;

    let mut random = Random::new(settings.seed, BOUND);
    let room = bound::room_for_improvement(arm, &chosen.blocks, &fixed, &mut random);
    let o1_bound = observability.o1() * room.unwrap_or(f64::INFINITY);

    let mut random = Random::new(settings.seed, COMPARE);
    let mut compared: Vec<Observability> = (0..RANDOM_SETS)
        .filter_map(|_| {
            let q = draw(arm, settings.poses, &mut random);
            observe(&before, &blocks(arm, &q)).ok()
        })
        .collect();
    compared.sort_by(|a, b| a.o1().total_cmp(&b.o1()));
    let middle = compared.len() / 2;
    tell(1.0);
    Ok(Plan {
        poses,
        observability,
        of_unit_columns,
        random: compared.into_iter().nth(middle),
        o1_bound,
        forecast,
    })
}

/// Observability of a set of poses as they are.
pub fn assess(
    arm: &mut dyn Sensitivity,
    poses: &[Vec<f64>],
) -> Result<Observability, Unobservable> {
    let (width, height) = (arm.parameters(), arm.height());
    observe(&Blocks::new(width, height), &blocks(arm, poses))
}

/// Poses at random that can be measured; fewer than `count` where hardly any can.
pub fn draw(arm: &mut dyn Sensitivity, count: usize, random: &mut Random) -> Vec<Vec<f64>> {
    let limits = arm.limits().to_vec();
    brought(&limits, count, random, |q| arm.bring(q))
}

/// Random choices within `limits` that `bring` can make measurable.
fn brought(
    limits: &[[f64; 2]],
    count: usize,
    random: &mut Random,
    mut bring: impl FnMut(&mut [f64]) -> bool,
) -> Vec<Vec<f64>> {
    let mut drawn = Vec::with_capacity(count);
    let mut tries = 0;
    while drawn.len() < count && tries < TRIES * (drawn.len() + 1) {
        tries += 1;
        let mut found = random_poses(limits, 1, random);
        found.retain_mut(|q| bring(q));
        drawn.extend(found);
    }
    drawn
}

/// Random poses of which one must be measurable.
const TRIES: usize = 1000;

/// Evenly distributed joint values within the limits.
pub fn random_poses(limits: &[[f64; 2]], count: usize, random: &mut Random) -> Vec<Vec<f64>> {
    (0..count)
        .map(|_| {
            limits
                .iter()
                .map(|&[low, high]| random.between(low, high))
                .collect()
        })
        .collect()
}

fn blocks(arm: &mut dyn Sensitivity, poses: &[Vec<f64>]) -> Blocks {
    let mut blocks = Blocks::new(arm.parameters(), arm.height());
    let mut block = vec![0.0; blocks.width * blocks.height];
    for q in poses {
        arm.rows(q, &mut block);
        blocks.push(&block);
    }
    blocks
}

fn tools(arm: &mut dyn Sensitivity, poses: &[Vec<f64>]) -> Blocks {
    let mut blocks = Blocks::new(arm.parameters(), 3);
    let mut block = vec![0.0; blocks.width * 3];
    for q in poses {
        arm.tool(q, &mut block);
        blocks.push(&block);
    }
    blocks
}

fn stacked(before: &Blocks, chosen: &Blocks) -> DMatrix<f64> {
    let numbers: Vec<f64> = before
        .numbers
        .iter()
        .chain(&chosen.numbers)
        .copied()
        .collect();
    let rows = numbers.len() / chosen.width.max(1);
    DMatrix::from_row_slice(rows, chosen.width, &numbers)
}

fn observe(before: &Blocks, chosen: &Blocks) -> Result<Observability, Unobservable> {
    Observability::of(&stacked(before, chosen), before.len() + chosen.len())
}
