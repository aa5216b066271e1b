//! Writes `docs/filter-spec.md`: `cargo run -p atvrec-estimator --example filter_spec`, which is
//! part of `make bless`.

use atvrec_estimator::specification::{Sensitivity, markdown};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let docs = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs");
    let table = std::fs::read_to_string(format!("{docs}/filter-sensitivity.csv"))?;
    let page = markdown(&Sensitivity::from_csv(&table)?)?;
    std::fs::write(format!("{docs}/filter-spec.md"), page)?;
    Ok(())
}
