//! Identify a robot arm's real geometry from measured poses, find what is left, and write it
//! as parameters for the controller.
