//! Every shader text of the project, for compilers other than naga to check.
//!
//! The texts come from the functions that the crates themselves compile from, so the list cannot differ
//! from what runs. A test writes them to a folder, which `web/test/shaders.mjs` gives to a browser's
//! compiler: it keeps to the WGSL grammar where naga does not.

/// `crate-kernel` and the text of each shader of the library, of its baselines and of its pictures.
pub fn shaders() -> Vec<(String, String)> {
    let library = impinge_core::gpu::shaders().map(|shader| ("core", shader));
    let baseline = impinge_baseline::gpu::shaders().map(|shader| ("baseline", shader));
    let render = impinge_render::shaders().map(|shader| ("render", shader));
    let all = library.chain(baseline).chain(render);
    all.map(|(owner, (name, text))| (format!("{owner}-{name}"), text))
        .collect()
}
