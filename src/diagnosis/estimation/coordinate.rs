//! What a fit moves and what it is judged by: coordinates with bounds and priors, subjects that they turn, and residuals.

use nalgebra::DVector;

/// Residuals of one subject, made independent and of unit size: one vector for each piece of the data.
pub type Residuals = Vec<DVector<f64>>;

/// Sum of squares of residuals.
pub fn square(residuals: &Residuals) -> f64 {
    residuals.iter().map(DVector::norm_squared).sum()
}

/// One direction in which a fit may move a subject, in units of what is known of it beforehand.
pub trait Coordinate: Sync {
    /// What is turned.
    type Subject: Clone + Send + Sync;

    /// The positions between which the subject makes sense.
    fn range(&self, base: &Self::Subject) -> (f64, f64);

    /// The position that is likeliest beforehand, with a standard deviation of 1; none where nothing is known.
    fn prior_centre(&self) -> Option<f64>;

    /// Turns a subject, made from `base`, to a position.
    fn turn(&self, base: &Self::Subject, subject: &mut Self::Subject, position: f64);
}

/// The subject with all coordinates at their positions.
pub fn subject_at<C: Coordinate>(base: &C::Subject, coordinates: &[C], positions: &[f64]) -> C::Subject {
    let mut subject = base.clone();
    for (coordinate, &position) in coordinates.iter().zip(positions) {
        coordinate.turn(base, &mut subject, position);
    }
    subject
}

/// Sum of squares of the distances from what is likeliest beforehand, in standard deviations.
pub(crate) fn prior_square<C: Coordinate>(coordinates: &[C], positions: &[f64]) -> f64 {
    let distance = |(coordinate, position): (&C, &f64)| Some(position - coordinate.prior_centre()?);
    coordinates.iter().zip(positions).filter_map(distance).map(|distance| distance * distance).sum()
}

/// Data that subjects are held against.
pub trait Judge<Subject> {
    /// Residuals of each subject; many at once cost less than one after the other.
    fn residuals_of(&self, subjects: &[Subject]) -> Vec<Residuals>;
}
