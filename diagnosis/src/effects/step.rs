//! What depends on the length of a step alone.

/// A value kept while steps stay as long: exponentials are dear, and the steps of a clock differ in the last digits.
#[derive(Debug, Clone, Copy)]
pub struct PerStep<T>(Option<(f64, T)>);

/// Relative difference up to which steps are as long.
const SAME: f64 = 1e-6;

impl<T: Copy> PerStep<T> {
    /// Nothing known yet.
    pub fn new() -> Self {
        Self(None)
    }

    /// The value for a step of `dt` s, made anew where the last step was of another length.
    pub fn of(&mut self, dt: f64, make: impl FnOnce(f64) -> T) -> T {
        match self.0 {
            Some((known, value)) if (known - dt).abs() <= SAME * dt => value,
            _ => self.0.insert((dt, make(dt))).1,
        }
    }
}

impl<T: Copy> Default for PerStep<T> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_made_anew_where_the_step_is_of_another_length() {
        let (mut kept, mut made) = (PerStep::new(), 0);
        for dt in [1e-3, 1e-3 + 1e-12, 1.01e-3, 1.01e-3, 1e-3] {
            let value = kept.of(dt, |dt| {
                made += 1;
                dt
            });
            assert!((value - dt).abs() < 1e-11);
        }
        assert_eq!(made, 3);
    }
}
