//! `atvrec.toml`: never a panic, and an error tells where.
#![no_main]

use libfuzzer_sys::fuzz_target;

#[allow(dead_code, unused_imports)]
#[path = "../../bins/atvrec/src"]
mod atvrec {
    pub mod config;
    pub mod exit;
}

use atvrec::{config, exit};

fuzz_target!(|data: &[u8]| {
    let attached = [store::Attachment {
        name: config::ATTACHED_NAME.to_owned(),
        media_type: String::new(),
        data: data.to_vec(),
    }];
    if let Err(error) = config::Config::from_attachments(&attached) {
        assert!(!error.to_string().is_empty());
    }
});
