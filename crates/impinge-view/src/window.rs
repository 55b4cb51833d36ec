//! Opens a window.

use std::sync::Arc;

use eframe::egui;
use impinge_render::wgpu;

use crate::app::Viewer;
use crate::content::Content;
use crate::options::Options;

/// A window could not be opened, or ended with an error.
#[derive(Debug, thiserror::Error)]
#[error("no window: {what}")]
pub struct Error {
    what: String,
}

/// Opens a window and returns when it is closed. `load` runs on a thread of its own; its error is
/// shown in the window.
///
/// # Errors
/// There is no display, or no device that can draw on it.
pub fn show(
    load: impl FnOnce() -> Result<Content, String> + Send + 'static,
    options: Options,
) -> Result<(), Error> {
    let [width, height] = options.size.map(|x| x as f32);
    let mut wgpu_options = egui_wgpu::WgpuConfiguration::default();
    if let egui_wgpu::WgpuSetup::CreateNew(setup) = &mut wgpu_options.wgpu_setup {
        setup.device_descriptor = Arc::new(|adapter| device(&adapter.limits()));
    }
    if options.measure.is_some() {
        wgpu_options.surface.present_mode = wgpu::PresentMode::AutoNoVsync;
    }
    let native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("impinge view")
            .with_app_id("impinge")
            .with_inner_size([width, height]),
        renderer: eframe::Renderer::Wgpu,
        wgpu_options,
        // There are no gradients that need it.
        dithering: false,
        ..Default::default()
    };
    let create: eframe::AppCreator<'_> = Box::new(move |creation| {
        creation
            .egui_ctx
            .set_visuals(eframe::egui::Visuals::light());
        let render = creation.wgpu_render_state.clone();
        Ok(Box::new(Viewer::new(render, load, options)))
    });
    eframe::run_native("impinge view", native, create).map_err(|error| Error {
        what: without_source(&error.to_string()),
    })
}

/// A message of the window's libraries without the lines of their sources, ` at some/file.rs:12: `,
/// which tell a user nothing.
fn without_source(text: &str) -> String {
    let mut kept = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once(".rs:") {
        let number = after.trim_start_matches(|c: char| c.is_ascii_digit() || c == ':');
        match before.rfind(" at ") {
            Some(start) if number.len() < after.len() => {
                kept += &before[..start];
                rest = number;
                kept += if rest.is_empty() { "" } else { ":" };
            }
            _ => {
                kept += before;
                kept += ".rs:";
                rest = after;
            }
        }
    }
    kept + rest
}

/// A device whose buffers may be as large as the adapter allows, so that large meshes fit.
fn device(offered: &wgpu::Limits) -> wgpu::DeviceDescriptor<'static> {
    wgpu::DeviceDescriptor {
        label: Some("impinge view"),
        required_limits: wgpu::Limits {
            max_buffer_size: offered.max_buffer_size,
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_texture_dimension_2d: offered.max_texture_dimension_2d,
            ..wgpu::Limits::default()
        },
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::without_source;

    #[test]
    fn messages_name_no_source() {
        for (text, said) in [
            (
                "winit EventLoopError: os error at /home/a b/winit-0.30.13/src/linux/mod.rs:808: neither WAYLAND_DISPLAY nor DISPLAY is set",
                "winit EventLoopError: os error: neither WAYLAND_DISPLAY nor DISPLAY is set",
            ),
            ("lost at src/a.rs:3:14", "lost"),
            ("one at a.rs:1: two at b.rs:22: three", "one: two: three"),
            ("a file x.rs: gone", "a file x.rs: gone"),
            ("", ""),
        ] {
            assert_eq!(without_source(text), said);
        }
    }
}
