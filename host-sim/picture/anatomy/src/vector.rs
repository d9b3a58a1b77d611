//! Places and directions of three numbers.

/// A place in mm or a direction.
pub type Vector = [f64; 3];

pub(crate) fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn scale(a: Vector, by: f64) -> Vector {
    [a[0] * by, a[1] * by, a[2] * by]
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a` with length 1; unchanged if it has none.
pub(crate) fn unit(a: Vector) -> Vector {
    let length = libm::sqrt(dot(a, a));
    if length > 0.0 { scale(a, 1.0 / length) } else { a }
}
