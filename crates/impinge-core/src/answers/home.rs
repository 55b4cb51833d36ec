//! Where the buffers of a dropped answer go: back to the detector that made it, so that a loop
//! allocates nothing.

use std::sync::{Arc, Mutex, PoisonError};

/// The place for the buffers of one kind of answer, or none where they are freed. Clones share it.
pub(crate) struct Home<T>(Option<Arc<Mutex<Option<T>>>>);

impl<T> Clone for Home<T> {
    fn clone(&self) -> Self {
        Home(self.0.clone())
    }
}

impl<T> Default for Home<T> {
    /// Buffers are freed.
    fn default() -> Self {
        Home(None)
    }
}

/// An answer that gives its buffers back when it is dropped.
pub(crate) trait GivesBack: Default {
    fn home(&mut self) -> &mut Home<Self>;
}

impl<T: GivesBack> Home<T> {
    /// A place that keeps buffers, or frees them.
    pub fn new(keeps: bool) -> Self {
        Home(keeps.then(Arc::default))
    }

    /// Whether buffers are kept.
    pub fn keeps(&self) -> bool {
        self.0.is_some()
    }

    /// An answer with the buffers of one that was dropped, or an empty one. Its buffers come back
    /// here.
    pub fn take(&self) -> T {
        let held = self.0.as_ref().and_then(|place| {
            let mut held = place.lock().unwrap_or_else(PoisonError::into_inner);
            held.take()
        });
        let mut answer = held.unwrap_or_default();
        *answer.home() = self.clone();
        answer
    }

    /// Keeps the buffers of an answer for the next one. What it leaves behind has no home.
    pub fn take_back(answer: &mut T) {
        let Home(Some(place)) = std::mem::take(answer.home()) else {
            return;
        };
        let mut held = place.lock().unwrap_or_else(PoisonError::into_inner);
        let former = held.replace(std::mem::take(answer));
        drop(held);
        drop(former);
    }
}

/// Makes an answer give its buffers back when it is dropped. It has a field `home`.
macro_rules! gives_back {
    ($answer:ty) => {
        impl crate::answers::home::GivesBack for $answer {
            fn home(&mut self) -> &mut Home<Self> {
                &mut self.home
            }
        }

        impl Drop for $answer {
            fn drop(&mut self) {
                Home::take_back(self);
            }
        }
    };
}
pub(crate) use gives_back;
