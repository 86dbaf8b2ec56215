//! Teaching what the controller looks up: joint corrections as polynomials or tables of the
//! joints. MRD 5.4.
//!
//! The teacher is the calibrated model itself, compensated to the end: where the book moves
//! the arm by hand onto its training points (step 3 of example 4), the model is asked. What
//! comes out holds for the conditions that it was taught at, the model's defaults.

pub mod cmac;
pub mod points;
pub mod polynomial;
pub mod wrist;

use heapless::Vec as Bounded;
use truepose::budget::Budget;
use truepose::compensate::{Compensator, Request};
use truepose::effects::Conditions;
use truepose::params::{Blob, BlobError, UNLIMITED};
use truepose::taught::cmac::Layout;
use truepose::taught::polynomial::{Block, MAX_DEGREE, terms};
use truepose::taught::{Cmac, Polynomial, Region};
use truepose::{Method, Settings};

use crate::joints::{first, with_joints};
use crate::random::Random;

/// Points of joint values and what is to be added to each, rad or m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lessons {
    /// Lowest and highest of each joint.
    pub region: Vec<[f64; 2]>,
    /// One a point.
    pub q: Vec<Vec<f64>>,
    /// One a point.
    pub corrections: Vec<Vec<f64>>,
}

/// How large an approximation is to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Polynomials up to a degree.
    Polynomial {
        /// Sum of the exponents.
        degree: u8,
    },
    /// Polynomials of the first three joints, and of the others as a translation of the tool:
    /// positions only, so that the settings' weight of the orientation becomes zero.
    Wrist {
        /// Sum of the exponents.
        degree: u8,
    },
    /// Tables.
    Cmac(Layout),
}

/// An approximation with its table.
#[derive(Clone, Debug, PartialEq)]
pub struct Approximation {
    /// What it is.
    pub form: Form,
    /// Lowest and highest of each joint.
    pub region: Vec<[f64; 2]>,
    /// rad or m a count, one a joint; tables only.
    pub scale: Vec<f64>,
    /// What goes into the blob.
    pub table: Vec<u8>,
}

/// Error of commands that were not taught.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Rms position error, m.
    pub position: f64,
    /// Rms orientation error, rad.
    pub orientation: f64,
}

/// Terms of the largest polynomials: teaching takes time with the cube of their number, looking
/// up with the number itself.
const TERMS: usize = 1000;

/// Points that an approximation is tested on, none of which was taught.
pub const TESTED: usize = 500;

impl Form {
    /// The largest form of `method` for `joints` joints whose table takes at most `room` bytes;
    /// with the room that the smallest takes where none fits. `None` for a method without
    /// tables.
    pub fn largest(method: Method, joints: usize, room: usize) -> Option<Result<Self, usize>> {
        let forms: Box<dyn Iterator<Item = Self>> = match method {
            Method::Polynomial => {
                let few = move |degree: &u8| terms(joints, usize::from(*degree)) <= TERMS;
                let degrees = (1..=MAX_DEGREE).take_while(few);
                Box::new(degrees.map(|degree| Self::Polynomial { degree }))
            }
            Method::Cmac => {
                let layers = cmac::layers(joints);
                Box::new((1..=u8::MAX).map(move |cells| Self::Cmac(Layout { layers, cells })))
            }
            Method::InverseJacobian | Method::Lqr | Method::TaskPoint => return None,
        };
        Some(Self::largest_of(forms, joints, room))
    }

    /// The largest [`Form::Wrist`], likewise.
    pub fn largest_wrist(joints: usize, room: usize) -> Result<Self, usize> {
        let forms = (1..=MAX_DEGREE).map(|degree| Self::Wrist { degree });
        Self::largest_of(forms, joints, room)
    }

    fn largest_of(
        mut forms: impl Iterator<Item = Self>,
        joints: usize,
        room: usize,
    ) -> Result<Self, usize> {
        let smallest = forms.next().ok_or(usize::MAX)?;
        let fits = |form: &Self| form.bytes(joints).is_some_and(|bytes| bytes <= room);
        if !fits(&smallest) {
            return Err(smallest.bytes(joints).unwrap_or(usize::MAX));
        }
        Ok(forms.take_while(fits).last().unwrap_or(smallest))
    }

    /// Bytes of its table, for as many outputs as inputs; `None` beyond what can be counted.
    pub fn bytes(&self, joints: usize) -> Option<usize> {
        match self {
            Self::Polynomial { degree } => {
                terms(joints, usize::from(*degree)).checked_mul(4 * joints)
            }
            Self::Wrist { degree } => {
                let degree = usize::from(*degree);
                let arm = terms(wrist::ARM, degree).checked_mul(joints)?;
                let rest = terms(joints.saturating_sub(wrist::ARM), degree).checked_mul(3)?;
                arm.checked_add(rest)?.checked_mul(4)
            }
            Self::Cmac(layout) => layout.words(joints)?.checked_mul(2 * joints),
        }
    }

    /// The method that uses it.
    pub fn method(&self) -> Method {
        match self {
            Self::Polynomial { .. } | Self::Wrist { .. } => Method::Polynomial,
            Self::Cmac(_) => Method::Cmac,
        }
    }
}

/// Teaches `form` over `region` of the joints of `blob`. `Err`: why it cannot be taught.
pub fn teach(
    blob: &Blob<'_>,
    form: Form,
    region: &[[f64; 2]],
) -> Result<Approximation, &'static str> {
    let q = match form {
        Form::Wrist { degree } => {
            let [arm, wrist] = wrist::teach(blob, region, degree)?;
            return Ok(Approximation {
                form,
                region: region.to_vec(),
                scale: Vec::new(),
                table: [arm, wrist].concat(),
            });
        }
        Form::Polynomial { degree } => points::chebyshev(region, usize::from(degree)),
        Form::Cmac(layout) => points::scattered(region, cmac::lessons(&layout, region.len())),
    };
    let corrections = corrections(blob, &q).map_err(|_| "the parameters have no model")?;
    from_lessons(
        form,
        &Lessons {
            region: region.to_vec(),
            q,
            corrections,
        },
    )
}

/// Teaches `form` from points of one's own. `Err`: why it cannot be taught.
pub fn from_lessons(form: Form, lessons: &Lessons) -> Result<Approximation, &'static str> {
    let (scale, table) = match form {
        Form::Polynomial { degree } => (Vec::new(), polynomial::fit(lessons, degree)?),
        Form::Wrist { .. } => return Err("the wrist is taught from the model alone"),
        Form::Cmac(layout) => cmac::fit(lessons, layout),
    };
    Ok(Approximation {
        form,
        region: lessons.region.clone(),
        scale,
        table,
    })
}

impl Approximation {
    /// Puts it into a blob and makes it the method in use.
    pub fn put<'a>(&'a self, blob: &mut Blob<'a>) {
        let region = Region(self.region.iter().copied().collect());
        match self.form {
            Form::Polynomial { degree } => {
                blob.taught.polynomial = Some(Polynomial {
                    joints: Block {
                        region,
                        degree,
                        coefficients: &self.table,
                    },
                    tool: None,
                });
            }
            Form::Wrist { degree } => {
                let joints = self.region.len();
                let arm = terms(wrist::ARM, usize::from(degree)) * joints * 4;
                let (arm, rest) = self.table.split_at(arm.min(self.table.len()));
                let block = |region: &[[f64; 2]], coefficients| Block {
                    region: Region(region.iter().copied().collect()),
                    degree,
                    coefficients,
                };
                let (first, others) = self.region.split_at(wrist::ARM.min(joints));
                blob.taught.polynomial = Some(Polynomial {
                    joints: block(first, arm),
                    tool: Some(block(others, rest)),
                });
                // Orientations are not looked at, nor spared.
                blob.settings.orientation_weight = 0.0;
            }
            Form::Cmac(layout) => {
                blob.taught.cmac = Some(Cmac {
                    region,
                    layout,
                    scale: self.scale.iter().copied().collect::<Bounded<_, _>>(),
                    table: &self.table,
                });
            }
        }
        blob.settings.method = self.form.method();
    }
}

/// The joint corrections that the model itself asks for at each of `q`.
fn corrections(blob: &Blob<'_>, q: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, BlobError> {
    let settings = Settings {
        method: Method::InverseJacobian,
        max_iterations: 30,
        ..blob.settings
    };
    let asked = outcomes(blob, settings, q)?;
    let one = |(q, (command, _)): (&Vec<f64>, &Answer)| {
        command.iter().zip(q).map(|(to, from)| to - from).collect()
    };
    Ok(q.iter().zip(&asked).map(one).collect())
}

/// A command, and the errors before and after that the model predicts.
type Answer = (Vec<f64>, [Held; 2]);

fn outcomes(
    blob: &Blob<'_>,
    settings: Settings<f64>,
    q: &[Vec<f64>],
) -> Result<Vec<Answer>, BlobError> {
    with_joints!(blob.joints(), N => sized::<N>(blob, settings, q)).unwrap_or(Err(BlobError::Body))
}

fn sized<const N: usize>(
    blob: &Blob<'_>,
    settings: Settings<f64>,
    q: &[Vec<f64>],
) -> Result<Vec<Answer>, BlobError> {
    let model = blob.model::<f64, N>()?;
    let mut compensator = Compensator::new(&model).with_settings(settings);
    let conditions = Conditions::default();
    let answer = |q: &Vec<f64>| {
        compensator.reset();
        let q = first(q);
        let outcome = compensator.correct(&Request::joints(q), &mut Budget::unlimited());
        let desired = model.nominal_pose(&q);
        let error = |q: &[f64; N]| {
            let twist = model.predict(q, &conditions).twist_to(&desired);
            Held {
                position: twist.linear.norm(),
                orientation: twist.angular.norm(),
            }
        };
        (outcome.q.to_vec(), [error(&q), error(&outcome.q)])
    };
    Ok(q.iter().map(answer).collect())
}

/// Rms errors of points of the region that were not taught: nominal commands, and corrected by
/// the method that the blob names.
pub fn test(blob: &Blob<'_>, region: &[[f64; 2]]) -> Result<[Held; 2], BlobError> {
    let mut random = Random::new(TESTED as u64, 0);
    let one = |&[low, high]: &[f64; 2]| (low, high);
    let q: Vec<Vec<f64>> = (0..TESTED)
        .map(|_| {
            let ranges = region.iter().map(one);
            ranges
                .map(|(low, high)| random.between(low, high))
                .collect()
        })
        .collect();
    let answers = outcomes(blob, blob.settings, &q)?;
    let rms = |pick: fn(&Held) -> f64, which: usize| {
        let squares = answers.iter().filter_map(|(_, errors)| errors.get(which));
        let sum: f64 = squares.map(|held| pick(held).powi(2)).sum();
        (sum / answers.len().max(1) as f64).sqrt()
    };
    Ok([0, 1].map(|which| Held {
        position: rms(|h| h.position, which),
        orientation: rms(|h| h.orientation, which),
    }))
}

/// The box of joint values that `rows` span, a little wider and inside the limits of `blob`;
/// without rows, the limits. `Err`: the joint (from 0) that has none.
pub fn region(blob: &Blob<'_>, rows: &[Vec<f64>]) -> Result<Vec<[f64; 2]>, usize> {
    let limits = blob.limits.iter().enumerate();
    limits
        .map(|(j, &[low, high])| {
            let column = || rows.iter().filter_map(|q| q.get(j));
            if rows.is_empty() {
                let limited = low > UNLIMITED[0] && high < UNLIMITED[1];
                return if limited { Ok([low, high]) } else { Err(j) };
            }
            let least = column().fold(f64::INFINITY, |a, &b| a.min(b));
            let most = column().fold(f64::NEG_INFINITY, |a, &b| a.max(b));
            // A joint that hardly moves still has a region.
            let wider = (0.05 * (most - least)).max(0.005);
            Ok([(least - wider).max(low), (most + wider).min(high)])
        })
        .collect()
}
