//! Stats, as `impinge_stats`.

use std::ffi::{CString, c_char};
use std::sync::{Mutex, PoisonError};

use impinge::Stats;

use crate::status::Failure;
use crate::types::*;

/// Texts that were shown, which live as long as the handle that holds them.
#[derive(Default)]
pub struct Texts(Mutex<Vec<CString>>);

impl Texts {
    fn show(&self, text: &str) -> *const c_char {
        let mut shown = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(held) = shown.iter().find(|held| held.as_bytes() == text.as_bytes()) {
            return held.as_ptr();
        }
        let text = CString::new(text.replace('\0', "")).unwrap_or_default();
        let at = text.as_ptr();
        shown.push(text);
        at
    }
}

/// Writes statistics to a caller's structure, as much of them as it has room for.
///
/// # Safety
/// `to` is NULL or has as many bytes as its field `size` says.
pub unsafe fn fill(stats: &Stats, texts: &Texts, to: *mut impinge_stats) -> Result<(), Failure> {
    if to.is_null() {
        return Err(Failure::null("stats"));
    }
    // SAFETY: the first field is there.
    let size = unsafe { to.cast::<u32>().read_unaligned() };
    if size as usize <= size_of::<u32>() || size as usize > size_of::<impinge_stats>() {
        return Err(Failure::invalid(format!(
            "impinge_stats: its size is {size}, and this library knows {} bytes: set it to sizeof(impinge_stats)",
            size_of::<impinge_stats>()
        )));
    }
    let filled = impinge_stats {
        size,
        n_threads: stats.n_threads as u32,
        total_ms: stats.total_ms,
        n_candidates: stats.n_candidates,
        n_unsure: stats.n_unsure,
        n_work_items: stats.n_work_items,
        n_clusters: stats.n_clusters,
        n_culled: stats.n_culled,
        n_clustered: stats.n_clustered,
        n_batches: stats.n_batches,
        n_reruns: stats.n_reruns,
        bytes_held: stats.bytes_held,
        backend: texts.show(&stats.backend),
        method: texts.show(stats.method),
    };
    // SAFETY: both have `size` bytes.
    unsafe {
        std::ptr::copy_nonoverlapping(
            std::ptr::from_ref(&filled).cast::<u8>(),
            to.cast::<u8>(),
            size as usize,
        );
    }
    Ok(())
}
