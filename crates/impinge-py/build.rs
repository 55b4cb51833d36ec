//! On macOS an extension module must say that its undefined symbols come from the interpreter;
//! elsewhere this adds nothing.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
