//! The number of pairs of every frame, and the earliest impact on the way to the next: found on a
//! thread of its own while the window is used.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use impinge::{CancelToken, Control};

use crate::find::quiet_detector;
use crate::options::Question;
use crate::stage::Stage;

/// What is known of a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Count {
    /// Nothing yet.
    #[default]
    Pending,
    /// The number of pairs.
    Pairs(u64),
    /// The frame cannot be read, or the library refuses it.
    Failed(String),
}

/// What a thread found.
enum News {
    Count(usize, Count),
    /// The time of the earliest impact in the step that begins with a frame, if there is one.
    Earliest(usize, Option<f64>),
}

/// What is known of all frames. Dropping it ends the thread.
pub(crate) struct Timeline {
    pub counts: Vec<Count>,
    /// For the step from each frame to the next: `None` while unknown, `Some(None)` if nothing
    /// touches.
    pub earliest: Vec<Option<Option<f64>>>,
    news: Receiver<News>,
    cancel: CancelToken,
    is_busy: Arc<AtomicBool>,
}

impl Drop for Timeline {
    fn drop(&mut self) {
        self.cancel.cancel();
    }
}

impl Timeline {
    /// Starts to count. With `with_impacts`, earliest impacts follow.
    pub fn start(
        stage: &Stage,
        question: Question,
        with_impacts: bool,
        wake: impl Fn() + Send + 'static,
    ) -> Self {
        let n_frames = stage.content.n_frames();
        let cancel = CancelToken::new();
        let (to, news) = channel();
        let is_busy = Arc::new(AtomicBool::new(false));
        let worker = Worker {
            is_busy: Arc::clone(&is_busy),
            stage: stage.clone(),
            question,
            cancel: cancel.clone(),
            to,
            wake: Box::new(wake),
        };
        // Without a thread, the timeline stays empty.
        let _ = thread::Builder::new()
            .name("timeline".to_owned())
            .spawn(move || worker.run(with_impacts));
        Timeline {
            counts: vec![Count::Pending; n_frames],
            earliest: vec![None; n_frames.saturating_sub(1)],
            news,
            cancel,
            is_busy,
        }
    }

    /// Tells whether the window is drawn all the time, as while frames play. Then the thread rests
    /// between frames, for as long as the last one took, so that it takes no more than half of a
    /// core.
    pub fn set_busy(&self, is_busy: bool) {
        self.is_busy.store(is_busy, Ordering::Relaxed);
    }

    /// Takes over what the thread has found since the last call.
    pub fn update(&mut self) {
        while let Ok(news) = self.news.try_recv() {
            match news {
                News::Count(frame_ix, count) => {
                    if let Some(held) = self.counts.get_mut(frame_ix) {
                        *held = count;
                    }
                }
                News::Earliest(frame_ix, earliest) => {
                    if let Some(held) = self.earliest.get_mut(frame_ix) {
                        *held = Some(earliest);
                    }
                }
            }
        }
    }

    /// Whether all frames are counted.
    pub fn is_counted(&self) -> bool {
        !self.counts.contains(&Count::Pending)
    }

    /// Whether a frame is known to have pairs.
    fn collides(&self, frame_ix: usize) -> bool {
        matches!(self.counts[frame_ix], Count::Pairs(n) if n > 0)
    }

    /// The first frame after this one that has pairs.
    pub fn next_collision(&self, frame_ix: usize) -> Option<usize> {
        (frame_ix + 1..self.counts.len()).find(|&frame_ix| self.collides(frame_ix))
    }

    /// The last frame before this one that has pairs.
    pub fn previous_collision(&self, frame_ix: usize) -> Option<usize> {
        let before = 0..frame_ix.min(self.counts.len());
        before.rev().find(|&frame_ix| self.collides(frame_ix))
    }

    /// The first frame that has pairs, once all frames before it are counted.
    pub fn first_collision_for_certain(&self) -> Option<usize> {
        let is_open = |count: &Count| !matches!(count, Count::Pairs(0) | Count::Failed(_));
        let frame_ix = self.counts.iter().position(is_open)?;
        self.collides(frame_ix).then_some(frame_ix)
    }

    /// The first frame that has pairs.
    pub fn first_collision(&self) -> Option<usize> {
        (0..self.counts.len()).find(|&frame_ix| self.collides(frame_ix))
    }
}

struct Worker {
    stage: Stage,
    question: Question,
    cancel: CancelToken,
    is_busy: Arc<AtomicBool>,
    to: Sender<News>,
    wake: Box<dyn Fn() + Send>,
}

impl Worker {
    fn run(mut self, with_impacts: bool) {
        let n_frames = self.stage.content.n_frames();
        let Ok(mut detector) = quiet_detector() else {
            return;
        };
        let query = self.question.query();
        let cancel = self.cancel.clone();
        detector.set_control(Control::new().cancel(&cancel));
        for frame_ix in 0..n_frames {
            if cancel.is_cancelled() {
                return;
            }
            let started = Instant::now();
            let posed = self.stage.pose(frame_ix);
            let count = posed.and_then(|()| {
                let scene = self.stage.scene();
                let n = detector.count(scene, &query);
                n.map_err(|error| error.to_string())
            });
            self.tell(News::Count(
                frame_ix,
                count.map_or_else(Count::Failed, Count::Pairs),
            ));
            self.rest(started);
        }
        if !with_impacts {
            return;
        }
        let mut scratch = self.stage.clone();
        for frame_ix in 0..n_frames.saturating_sub(1) {
            if cancel.is_cancelled() {
                return;
            }
            let started = Instant::now();
            let moves = self
                .stage
                .pose(frame_ix)
                .and_then(|()| self.stage.set_ends(&mut scratch));
            if moves != Ok(true) {
                continue;
            }
            // A step that is refused stays unknown: its frames show why.
            if let Ok(first) = detector.earliest(self.stage.scene(), &query) {
                self.tell(News::Earliest(frame_ix, first.map(|impact| impact.toi)));
            }
            self.rest(started);
        }
    }

    /// Rests after a frame that began then, if the window is busy.
    fn rest(&self, started: Instant) {
        if self.is_busy.load(Ordering::Relaxed) {
            thread::sleep(started.elapsed().min(REST));
        }
    }

    fn tell(&self, news: News) {
        if self.to.send(news).is_ok() {
            (self.wake)();
        }
    }
}

/// The longest rest between two frames.
const REST: Duration = Duration::from_millis(200);

/// How long a window may wait before it shows news of the timeline.
pub(crate) const NEWS: Duration = Duration::from_millis(60);
