//! Writes the JavaScript and the types beside a WebAssembly module:
//! `impinge-bindgen MODULE.wasm FOLDER`.
//!
//! The program `wasm-bindgen` does the same, but takes four times as long to build, for a test
//! runner that nothing here needs.

use std::error::Error;
use std::ffi::OsString;

use wasm_bindgen_cli_support::Bindgen;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let [module, folder] = &arguments[..] else {
        return Err("usage: impinge-bindgen MODULE.wasm FOLDER".into());
    };
    Bindgen::new()
        .input_path(module)
        .web(true)?
        .typescript(true)
        .out_name("impinge")
        .generate(folder)?;
    Ok(())
}
