//! `orchestrator::decoders::ssp` under libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| orchestrator::decoders::ssp(bytes));
