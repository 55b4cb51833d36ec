//! Every shader text of the project, for compilers other than naga to check.
//!
//! The texts come from the same functions from which the crates compile their shaders, so the list
//! is always complete. A test writes them to a folder, which `web/test/shaders.mjs` gives to a
//! browser's compiler: it follows the WGSL grammar more strictly than naga.

/// The name (`crate-kernel`) and the text of each shader of the library, the baselines and the
/// renderer.
pub fn shaders() -> Vec<(String, String)> {
    let library = impinge_core::gpu::shaders().map(|shader| ("core", shader));
    let baseline = impinge_baseline::gpu::shaders().map(|shader| ("baseline", shader));
    let render = impinge_render::shaders().map(|shader| ("render", shader));
    let all = library.chain(baseline).chain(render);
    all.map(|(owner, (name, text))| (format!("{owner}-{name}"), text))
        .collect()
}
