//! From the residual to what the model lacks: is the input right, is something missing.

pub mod whiteness;
