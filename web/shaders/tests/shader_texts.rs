//! Writes every shader text to `target/tmp/shaders`, where the check in a browser reads them.

use std::path::Path;
use std::{fs, io};

#[test]
fn every_shader_text_is_written_for_the_browser() -> io::Result<()> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("shaders");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;
    let shaders = impinge_shaders::shaders();
    for owner in ["core-", "baseline-", "render-"] {
        let n = shaders
            .iter()
            .filter(|(name, _)| name.starts_with(owner))
            .count();
        assert!(n > 0, "no shader of {owner}");
    }
    for (name, text) in &shaders {
        assert!(text.contains("@group(0)"), "{name} binds nothing");
        fs::write(folder.join(format!("{name}.wgsl")), text)?;
    }
    Ok(())
}
