//! `atvrec.toml`: never a panic, and an error tells where.
#![no_main]

use engine::Config;
use engine::config::ATTACHED_NAME;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let attached = [store::Attachment {
        name: ATTACHED_NAME.to_owned(),
        media_type: String::new(),
        data: data.to_vec(),
    }];
    if let Err(error) = Config::from_attachments(&attached) {
        assert!(!error.to_string().is_empty());
    }
});
