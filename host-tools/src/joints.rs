//! From the number of joints in a file to the constant that the controller's code has.

/// Evaluates `$body` with the constant `$n` equal to `$joints`, up to the number that a blob
/// can hold; `None` beyond.
macro_rules! with_joints {
    ($joints:expr, $n:ident => $body:expr) => {
        $crate::joints::with_joints!(@ $joints, $n, $body, 1 2 3 4 5 6 7 8 9 10 11 12)
    };
    (@ $joints:expr, $n:ident, $body:expr, $($count:literal)+) => {
        match $joints {
            $($count => {
                const $n: usize = $count;
                Some($body)
            })+
            _ => None,
        }
    };
}
pub(crate) use with_joints;

/// The first N of `values`, 0 where there are fewer.
pub(crate) fn first<const N: usize>(values: &[f64]) -> [f64; N] {
    let mut array = [0.0; N];
    for (to, from) in array.iter_mut().zip(values) {
        *to = *from;
    }
    array
}
