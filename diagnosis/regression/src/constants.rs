//! Every number that somebody chose, with its reason. Bounds of a law are in its record.

/// Error of the speed used for signs, as a part of the fast speed: its band is as wide as that
/// allows. Signs of a noisier speed left 11 to 22 times the true disturbance on nulls (prototype).
pub(crate) const SPEED_ERROR: f64 = 0.001;
/// Slowest speed that counts as motion, as a part of the fast speed: four times [`SPEED_ERROR`].
pub(crate) const REST: f64 = 0.004;
/// The same in standard errors of the speed, where the band cannot be narrow enough.
pub(crate) const REST_ERRORS: f64 = 3.0;
/// Longest time that is masked on either side of a reversal, s: longer hides a slow axis.
pub(crate) const MASK_S: f64 = 0.01;
/// Narrowest band of the speed, as a part of the sampling rate, and its least, Hz: a swing is seen.
pub(crate) const SPEED_BAND: f64 = 0.03;
pub(crate) const SPEED_BAND_HZ: f64 = 5.0;
/// Widest band of the speed as a part of the sampling rate: seven rows for a period.
pub(crate) const SPEED_WIDEST: f64 = 0.15;
/// The speed's band is never forced above this, Hz: no axis here turns round faster.
pub(crate) const SPEED_FORCED_HZ: f64 = 150.0;
/// The band in which forces are compared, as a part of the sampling rate: the band of the judge's
/// own comparison and of the plain rival; wider bands add degrees of freedom that are noise's.
pub(crate) const BAND: f64 = 0.032;
/// Its least and its largest, Hz, and its largest part of the sampling rate.
pub(crate) const BAND_HZ: (f64, f64) = (5.3, 100.0);
pub(crate) const BAND_WIDEST: f64 = 0.2;
/// Thinned rate over the band: the low-pass of order 4 has fallen to 1/40 at half of it.
pub(crate) const THINNED: f64 = 3.2;
/// Rate at which the laws are computed, over the band: a box of that length loses 2 % at the band.
pub(crate) const LAW_RATE: f64 = 8.0;
/// Frames of the transform in all fit recordings: enough for five folds and a standard error.
pub(crate) const FRAMES: f64 = 30.0;
/// Longest frame, s: beyond it, a bias that wanders is no longer one frame's.
pub(crate) const FRAME_S: f64 = 2.0;
/// Shortest frame in periods of the band.
pub(crate) const FRAME_PERIODS: f64 = 8.0;
/// Parts into which the fit is cut to leave one out, and stretches of a recording: the usual five.
pub(crate) const FOLDS: usize = 5;
pub(crate) const STRETCHES: usize = 20;
/// Spread of a nominal value, and of the gain, that the rig declares none for: the contract's
/// example.
pub(crate) const SPREAD: f64 = 0.5;
pub(crate) const GAIN_SPREAD: f64 = 0.1;
/// Factor by which the rig may have the inertia wrong, when a load's is bounded: the contract's
/// example declares a half.
pub(crate) const INERTIA_REACH: f64 = 1.0 + SPREAD;
/// Power of the drive's force over the inertial force's below which something else moves the axis:
/// a drive that does it alone supplies at least all of it.
pub(crate) const UNDRIVEN: f64 = 0.25;
/// Least agreement of a law's sizes in two halves of the fit: a factor of two, as the plain rival.
pub(crate) const SIZES_AGREE: f64 = 0.5;
/// Least share that keeps the search going: a tenth of what any decision so far has named.
pub(crate) const LEAST_SHARE: f64 = 0.01;
/// Rounds of the search: the contract has three effects at most, and one may be refused.
pub(crate) const ROUNDS: usize = 4;
/// Rivals of each round that are read on the holdout beside the chosen law: a class has three.
pub(crate) const RIVALS: usize = 3;
/// Waves of one law together, and what another must take: three orders carry a real motor's ripple.
pub(crate) const WAVES: usize = 3;
pub(crate) const NEXT_WAVE: f64 = 0.02;
/// Steps of a line search: a golden section narrows to 1/11 of the grid's width.
pub(crate) const LINE_STEPS: usize = 5;
/// A law is refined if its share is this part of the leader's: what a class may hold.
pub(crate) const REFINED: f64 = 0.6;
