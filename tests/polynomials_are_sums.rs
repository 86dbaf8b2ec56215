//! What polynomials come to is the sum of their terms, however it is computed.

use crate::random::Random;
use truepose::taught::polynomial::{Block, MAX_DEGREE, exponents, terms};
use truepose::taught::{Polynomial, Region};

/// Term by term, and the sum of their magnitudes.
fn term_by_term(block: &Block<'_, f64>, x: &[f64], outputs: usize) -> Vec<[f64; 2]> {
    let mut sums = vec![[0.0, 0.0]; outputs];
    let rows = block.coefficients.chunks(4 * outputs);
    for (powers, row) in exponents(x.len(), usize::from(block.degree)).zip(rows) {
        let product: f64 = x
            .iter()
            .zip(powers)
            .map(|(x, p)| x.powi(p.into()))
            .product();
        for (sum, bytes) in sums.iter_mut().zip(row.as_chunks::<4>().0) {
            let term = product * f64::from(f32::from_le_bytes(*bytes));
            sum[0] += term;
            sum[1] += term.abs();
        }
    }
    sums
}

fn coefficients(random: &mut Random, inputs: usize, degree: u8, outputs: usize) -> Vec<u8> {
    (0..terms(inputs, usize::from(degree)) * outputs)
        .flat_map(|_| (random.within(1.0) as f32).to_le_bytes())
        .collect()
}

fn check<const N: usize>(random: &mut Random, inputs: usize, degree: u8, tool_degree: u8) {
    let region = |count| Region(core::iter::repeat_n([-1.0, 1.0], count).collect());
    let joints = coefficients(random, inputs, degree, N);
    let tool = coefficients(random, N - inputs, tool_degree, 3);
    let polynomial = Polynomial {
        joints: Block {
            region: region(inputs),
            degree,
            coefficients: &joints,
        },
        tool: (inputs < N).then(|| Block {
            region: region(N - inputs),
            degree: tool_degree,
            coefficients: &tool,
        }),
    };
    let q: [f64; N] = core::array::from_fn(|_| random.within(1.0));
    let (delta, miss) = polynomial.evaluate(&q).unwrap();
    let mut expected = term_by_term(&polynomial.joints, &q[..inputs], N);
    if let Some(tool) = &polynomial.tool {
        expected.extend(term_by_term(tool, &q[inputs..], 3));
    } else {
        expected.extend([[0.0, 0.0]; 3]);
    }
    for (found, [sum, size]) in delta.iter().chain(&miss).zip(expected) {
        // Each term is rounded some ten times on its way into the sum.
        let allowed = 64.0 * f64::EPSILON * size;
        assert!(
            (found - sum).abs() <= allowed,
            "{inputs} of {N} inputs, degree {degree}: {found} for {sum}"
        );
    }
}

#[test]
fn every_number_of_inputs_and_degree() {
    let mut random = Random(5);
    for degree in 0..=MAX_DEGREE {
        for inputs in 1..=4 {
            check::<4>(&mut random, inputs, degree, MAX_DEGREE - degree);
        }
        check::<6>(&mut random, 6, degree.min(7), 0);
    }
    for degree in 0..=4 {
        check::<12>(&mut random, 12, degree.min(3), 0);
        check::<12>(&mut random, 3, degree, 3);
        check::<7>(&mut random, 7, degree, 0);
    }
}
