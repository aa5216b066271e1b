//! Identification on drives whose truth is known: the four-wheel model's with the noise of the
//! thesis's sensors, and the independent simulator's.

mod rides;

mod cornering;
mod independent;
mod intervals;
mod others;
