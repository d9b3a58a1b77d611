//! Vectors of three numbers; as few operations as the rest needs.

/// A place or a direction; mm where it is a place.
pub type Vector = [f32; 3];

/// Sum.
#[inline]
pub fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Difference.
#[inline]
pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A multiple.
#[inline]
pub fn scale(a: Vector, factor: f32) -> Vector {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

/// Scalar product.
#[inline]
pub fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
#[inline]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Length.
#[inline]
pub fn length(a: Vector) -> f32 {
    dot(a, a).sqrt()
}

/// The direction of `a`; `None` where it has none or is no number.
pub fn direction(a: Vector) -> Option<Vector> {
    let length = length(a);
    (length.is_finite() && length > 1e-9).then(|| scale(a, 1.0 / length))
}

/// True if every component is finite.
pub fn is_finite(a: Vector) -> bool {
    a.iter().all(|component| component.is_finite())
}
