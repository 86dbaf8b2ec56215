//! A table of all methods from what the program `methods` printed on the emulated core, on
//! standard input, and the bytes of code that ran for each method, as arguments: `tools/methods`
//! runs both.

use std::error::Error;
use std::io::read_to_string;

use truepose::effects::Conditions;
use truepose::{Method, params};
use truepose_firmware::arm::JOINTS;
use truepose_firmware::methods::{REQUESTS, TAUGHT, methods, requests};

/// One answer of the core.
struct Answer {
    q: [f64; JOINTS],
    iterations: f64,
    instructions: f64,
}

fn answer(line: &str) -> Option<Answer> {
    let mut words = line.split_whitespace();
    let mut q = [0.0; JOINTS];
    for q in &mut q {
        let bits = u32::from_str_radix(words.next()?, 16).ok()?;
        *q = f64::from(f32::from_bits(bits));
    }
    let _status = words.next()?;
    Some(Answer {
        q,
        iterations: words.next()?.parse().ok()?,
        instructions: words.nth(1)?.parse().ok()?,
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let text = read_to_string(std::io::stdin())?;
    let model = params::decode::<f64, JOINTS>(TAUGHT)?;
    let conditions = Conditions::default();
    let taught = &model.taught;
    let (mut before, mut lines) = (0.0_f64, text.lines());
    println!(
        "| method | position left, um: rms, most | orientation left, urad: rms, most | \
         iterations | instructions: mean, most | code, bytes | tables, bytes |\n\
         | --- | --- | --- | --- | --- | --- | --- |"
    );
    let mut sizes = std::env::args().skip(1);
    for (method, through) in methods() {
        let code = sizes.next().ok_or("too few sizes")?;
        let mut left = [Vec::new(), Vec::new()];
        let (mut iterations, mut instructions) = (Vec::new(), Vec::new());
        for q in requests() {
            let line = lines.next().ok_or("too few answers")?;
            let answer = answer(line).ok_or_else(|| format!("not an answer: {line}"))?;
            let q = q.map(f64::from);
            let desired = model.nominal_pose(&q);
            let twist = model.predict(&answer.q, &conditions).twist_to(&desired);
            left[0].push(twist.linear.norm() * 1e6);
            left[1].push(twist.angular.norm() * 1e6);
            iterations.push(answer.iterations);
            instructions.push(answer.instructions);
            let nominal = model.predict(&q, &conditions).twist_to(&desired);
            before = before.max(nominal.linear.norm() * 1e3);
        }
        let most = |x: &[f64]| x.iter().copied().fold(0.0, f64::max);
        let mean = |x: &[f64]| x.iter().sum::<f64>() / REQUESTS as f64;
        let rms = |x: &[f64]| mean(&x.iter().map(|x| x * x).collect::<Vec<_>>()).sqrt();
        let tables = match method {
            Method::Polynomial => taught
                .polynomial
                .as_ref()
                .map_or(0, |p| 4 * p.coefficients()),
            Method::Cmac => taught.cmac.as_ref().map_or(0, |c| c.table.len()),
            Method::InverseJacobian | Method::Lqr | Method::TaskPoint => 0,
        };
        println!(
            "| {}{} | {:.2}, {:.2} | {:.2}, {:.2} | {:.1} | {:.0}, {:.0} | {code} | {tables} |",
            method.name(),
            if through {
                " through the analytic inverse"
            } else {
                ""
            },
            rms(&left[0]),
            most(&left[0]),
            rms(&left[1]),
            most(&left[1]),
            mean(&iterations),
            mean(&instructions),
            most(&instructions),
        );
    }
    println!("\n{REQUESTS} requests to each; nominal commands miss by up to {before:.2} mm.");
    Ok(())
}
