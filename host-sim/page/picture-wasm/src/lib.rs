//! The page's own computing in the browser: tissue and ultrasound, behind functions of plain
//! numbers.
//!
//! The page writes numbers to [`input`], calls [`build`], then [`step`] for each picture and
//! [`image`] for each ultrasound image; what it draws it reads from the memory that the pointers
//! show, anew after every call that may allocate. `host-sim/page/js/picture.js` is the other side.
//! Everything that thinks is in [`picture`].
//!
//! The names are exported as they stand, which the language counts as unsafe, and in the browser
//! only; there is no other unsafe code. The program itself takes [`picture`] for its streams.

pub mod drawn;
mod limb;
pub mod picture;
mod slab;
mod still;
mod table_1;

use drawn::SurfaceView;
use picture::Picture;
use std::cell::RefCell;
use tissue::PunctureState;

/// Numbers that the page can hand over at once.
const INPUT: usize = 256;

thread_local! {
    static INPUT_NUMBERS: RefCell<Vec<f32>> = RefCell::new(vec![0.0; INPUT]);
    static PICKED: RefCell<[f32; 5]> = const { RefCell::new([0.0; 5]) };
    static PICTURE: RefCell<Option<Picture>> = const { RefCell::new(None) };
}

/// Does something with the picture, where there is one.
fn with<T: Default>(work: impl FnOnce(&mut Picture) -> T) -> T {
    PICTURE.with_borrow_mut(|picture| picture.as_mut().map(work).unwrap_or_default())
}

fn surface<T: Default>(number: u32, work: impl FnOnce(&SurfaceView) -> T) -> T {
    with(|picture| picture.surfaces().get(number as usize).map(work).unwrap_or_default())
}

/// A number for a pointer: 32 bits in the browser.
fn address<T>(slice: &[T]) -> usize {
    slice.as_ptr() as usize
}

/// Returns the address at which the page writes the anatomy: 256 numbers.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn input() -> usize {
    INPUT_NUMBERS.with_borrow(|numbers| address(numbers))
}

/// Builds the tissue from the first `count` numbers of [`input`], as [`Picture::new`] reads them:
/// 1, or 0 where they are not usable.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn build(count: u32) -> u32 {
    let numbers =
        INPUT_NUMBERS.with_borrow(|numbers| numbers.iter().take(count as usize).copied().collect::<Vec<_>>());
    let built = Picture::new(&numbers).ok();
    let is_built = built.is_some();
    PICTURE.with_borrow_mut(|picture| *picture = built);
    u32::from(is_built)
}

/// The device says that the wall of a layer (by its number in the scene) gave way (1), or that the
/// needle has left it (0).
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn tell(layer: u32, given: u32) {
    let state = if given == 0 { PunctureState::Away } else { PunctureState::Inserted };
    with(|picture| picture.tell(layer as usize, state));
}

/// Moves time on by `seconds`; the tip is `depth_mm` along the needle, `angle` rad below the skin.
/// The needle's line has depth 0 at `ahead_mm` along the skin and `down_mm` below it.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn step(seconds: f32, depth_mm: f32, angle: f32, ahead_mm: f32, down_mm: f32) {
    with(|picture| picture.step(seconds, depth_mm, angle, [ahead_mm, down_mm]));
}

/// 0 away, 1 touching, 2 inserted: the wall of a layer by its number in the scene.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn wall_state(layer: u32) -> u32 {
    with(|picture| picture.wall_state(layer as usize) as u32)
}

/// Returns the number of particles.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn particles() -> u32 {
    with(|picture| picture.points().len() as u32)
}

/// Four numbers for each particle, of which the first three are its place in mm.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn points() -> usize {
    with(|picture| address(picture.points()))
}

/// Four numbers for each particle, of which the first three are its normal.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn normals() -> usize {
    with(|picture| address(picture.normals()))
}

/// Returns the number of surfaces to draw.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn surfaces() -> u32 {
    with(|picture| picture.surfaces().len() as u32)
}

/// Returns the kind of a surface: 0 skin behind the needle's plane, 1 skin before it, 2 section, 3
/// vessel behind, 4 vessel before, 5 and 6 a part inside the body behind and before.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn surface_kind(number: u32) -> u32 {
    surface(number, |surface| surface.kind as u32)
}

/// Number of its layer in the scene.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn surface_layer(number: u32) -> u32 {
    surface(number, |surface| surface.layer as u32)
}

/// Its tissue in a body, by the numbers of [`build`]; 9 is an artery.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn surface_tissue(number: u32) -> u32 {
    surface(number, |surface| surface.tissue)
}

/// Its triangles: three numbers of particles each.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn surface_triangles(number: u32) -> usize {
    surface(number, |surface| address(&surface.triangles))
}

/// Returns the number of its triangles.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn surface_triangle_count(number: u32) -> u32 {
    surface(number, |surface| surface.triangles.len() as u32)
}

/// Returns the address of the vessel's section by the needle's plane: [`picture::SLICES`] pairs of
/// numbers, upper and lower wall in mm.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn lumen() -> usize {
    with(|picture| address(picture.lumen()))
}

/// Holds the probe: its middle (mm along and across the insertion), its turn and its lean in rad.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn probe(along_mm: f32, across_mm: f32, azimuth: f32, lean: f32) {
    with(|picture| picture.hold_probe(along_mm, across_mm, azimuth, lean));
}

/// Returns the depth of the skin where the probe is, mm.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn skin(along_mm: f32, across_mm: f32) -> f32 {
    with(|picture| picture.on_skin([along_mm, across_mm], 0.0)[0])
}

/// Returns the lean that makes a probe stand upright on the skin, rad.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn upright(along_mm: f32, across_mm: f32, azimuth: f32) -> f32 {
    with(|picture| picture.on_skin([along_mm, across_mm], azimuth)[1])
}

/// Looks from the first three numbers of [`input`] in the direction of the next three: the address
/// of the place of the skin there, mm, and how far along (mm) and around (degrees) the limb that
/// is; 0 where there is no skin.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn pick() -> usize {
    let line = INPUT_NUMBERS.with_borrow(|n| [[n[0], n[1], n[2]], [n[3], n[4], n[5]]]);
    let Some(found) = with(|picture| picture.pick(line[0], line[1])) else { return 0 };
    PICKED.with_borrow_mut(|picked| {
        *picked = found;
        address(picked)
    })
}

/// Returns the depth of the ultrasound image, mm: as deep as the anatomy asks for.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn image_depth() -> f32 {
    with(|picture| picture.image_depth_mm())
}

/// Makes an ultrasound image, the last one being `seconds` ago: brightness, 256 lines of 1,024
/// samples.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn image(seconds: f32, gain_db: f32) -> usize {
    with(|picture| address(picture.image(seconds, gain_db)))
}

/// 0: share of the needle in the image's plane; 1: whether its tip is seen; 2: how far the tip lies
/// beside the plane, mm; 3: share of the time in the body that the tip was seen; 4: mean share of
/// the needle that was seen; 5: time in the body, s.
#[cfg_attr(target_arch = "wasm32", unsafe(no_mangle))]
pub extern "C" fn seen(what: u32) -> f32 {
    with(|picture| picture.seen(what))
}
