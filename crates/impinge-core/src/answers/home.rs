//! Where the buffers of a dropped answer go: back to the detector that made it, so that a loop allocates nothing.

use std::sync::{Arc, Mutex, PoisonError};

/// The place for the buffers of one kind of answer. Clones share it.
pub(crate) struct Home<T>(Arc<Mutex<Option<T>>>);

impl<T> Clone for Home<T> {
    fn clone(&self) -> Self {
        Home(Arc::clone(&self.0))
    }
}

impl<T> Default for Home<T> {
    fn default() -> Self {
        Home(Arc::default())
    }
}

impl<T: Default> Home<T> {
    /// An answer with the buffers of one that was dropped, or an empty one.
    pub fn take(&self) -> T {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        held.take().unwrap_or_default()
    }

    /// Keeps the buffers of an answer for the next one.
    pub fn put(&self, answer: T) {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let former = held.replace(answer);
        drop(held);
        drop(former);
    }
}

/// Makes an answer give its buffers back when it is dropped. It has a field `home`, which its detector sets.
macro_rules! gives_back {
    ($answer:ty) => {
        impl Drop for $answer {
            fn drop(&mut self) {
                if let Some(home) = self.home.take() {
                    home.put(std::mem::take(self));
                }
            }
        }
    };
}
pub(crate) use gives_back;
