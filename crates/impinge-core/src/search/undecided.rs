//! Pairs of a step that a device leaves to the host.

/// A pair of a step that a device has not dropped.
#[derive(Debug, Clone, Copy)]
pub(crate) struct UndecidedPair {
    /// The slots of its elements, those of all parts numbered consecutively.
    pub slots: [u32; 2],
    /// Until this time it certainly does not touch.
    pub free_until: f32,
    /// By this time it certainly touches, at one time only.
    pub touches_by: Option<f32>,
}

/// What a device says about a step, or about a part of it.
#[derive(Debug)]
pub(crate) struct Undecided<'a> {
    /// Pairs that may touch, in any order. Where the earliest contact is sought, those that touch
    /// later than `touches_by` may be missing; where any is sought, all may be missing if one
    /// certainly touches.
    pub pairs: &'a mut [UndecidedPair],
    /// The least time by which some pair certainly touches, after the start; none where all are
    /// sought.
    pub touches_by: Option<f32>,
}
