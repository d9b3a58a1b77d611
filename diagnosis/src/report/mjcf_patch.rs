//! A patched rig in somebody's own MuJoCo model: the attributes of one joint and of what drives it
//! change, and no other byte.
//!
//! Their model is taken to be the nominal rig. Friction, damping and springs become those of the
//! patched rig; inertia and gain change as they do from the nominal rig to the patched one, because
//! the links have an inertia of their own, and their controls may have another unit.

use super::exports::{joint_of, note_motor, xml};
use super::passive_motor;
use super::xml::{Tag, changed, number, tags};
use crate::data::rig::{Kind, Rig};
use crate::data::schema::Named;
use crate::laws::joint_terms::{Gap, JointTerms};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;

/// A step of MuJoCo where a model gives none, s.
const DEFAULT_STEP_S: f64 = 0.002;
/// Friction that holds at rest.
const FRICTION_IMPEDANCE: &str = "0.9999 0.9999 0.001 0.5 2";
/// With so little impedance a flank is a spring and a damper.
const FLANK_IMPEDANCE: &str = "0.001 0.001 0.001 0.5 2";

/// Their model as it is read.
struct Model<'a> {
    text: &'a str,
    tags: Vec<Tag<'a>>,
    changes: Vec<(Range<usize>, String)>,
    notes: Vec<String>,
}

/// Returns the text of an MJCF file with the joint of this name as the patched rig has it; with
/// `dcmotor`, which MuJoCo 4.0 reads, also its bristles, Stribeck friction and cogging. An error is
/// a sentence without the file's name in front.
pub fn patch(text: &str, joint: &str, nominal: &Rig, patched: &Rig, dcmotor: bool) -> Result<String, String> {
    let tags = tags(text).map_err(|at| {
        let line = 1 + text[..at].matches('\n').count();
        format!("is not well-formed XML in line {line}; open it in MuJoCo first, which says what is wrong")
    })?;
    let mut model = Model { text, tags, changes: Vec::new(), notes: Vec::new() };
    let tag = model.joint(joint)?;
    let kind = model.inherited(tag, "joint", "type").unwrap_or("hinge");
    let wanted = if patched.kind == Kind::Rotary { "hinge" } else { "slide" };
    if kind != wanted {
        return Err(format!(
            "the joint \"{joint}\" is a {kind} and the rig's axis a {wanted}; choose another --joint"
        ));
    }
    let (before, mut after) = (joint_of(nominal), joint_of(patched));
    if !dcmotor {
        note_motor(&mut after, patched.kind);
    }
    if !after.waves.is_empty() && !patched.encoder.absolute {
        let unknown = "the phase of its cogging, which counts without a zero of their own do not tell";
        after.notes.push(unknown.into());
    }
    let lugre = passive_motor::lugre(&after, model.step_s());
    // What LuGre has of the dry friction, the joint has not.
    after.dry = (after.dry - lugre.map_or(0.0, |lugre| lugre[2])).max(0.0);
    model.notes.clone_from(&after.notes);
    let driven = after.gap.map_or_else(|| joint.to_owned(), |_| format!("{joint}_motor"));
    match after.gap {
        Some(gap) => model.two_joints(tag, &driven, &before, &after, gap),
        None => model.one_joint(tag, &before, &after),
    }
    model.drives(joint, &driven, &before, &after);
    model.add_actuators(&passive_motor::tags(&driven, lugre, &after.waves));
    let mut note = String::from("<!-- patched by host-sim");
    for text in &model.notes {
        let _ = write!(note, "; not in this joint: {}", xml(text));
    }
    model.changes.push((model.tags[tag].at.start..model.tags[tag].at.start, note + " -->"));
    Ok(changed(text, model.changes))
}

impl<'a> Model<'a> {
    fn get(&self, tag: usize, key: &str) -> Option<&'a str> {
        self.tags[tag].get(self.text, key)
    }

    fn set(&mut self, tag: usize, key: &str, value: &str) {
        self.changes.push(self.tags[tag].set(key, value));
    }

    fn parent(&self, tag: usize) -> Option<usize> {
        self.tags[tag].parent
    }

    fn is_in(&self, tag: usize, name: &str) -> bool {
        std::iter::successors(self.parent(tag), |tag| self.parent(*tag))
            .any(|tag| self.tags[tag].name == name)
    }

    /// The joint of a name, in a body.
    fn joint(&self, name: &str) -> Result<usize, String> {
        let is_joint = |tag: &usize| self.tags[*tag].name == "joint" && self.is_in(*tag, "body");
        let joints: Vec<usize> = (0..self.tags.len()).filter(is_joint).collect();
        if let Some(tag) = joints.iter().find(|tag| self.get(**tag, "name") == Some(name)) {
            return Ok(*tag);
        }
        let names: Vec<&str> = joints.iter().filter_map(|tag| self.get(*tag, "name")).collect();
        let includes = if self.tags.iter().any(|tag| tag.name == "include") {
            " (files that it includes are not read: give the one with the joint)"
        } else {
            ""
        };
        if names.is_empty() {
            return Err(format!("has no joint \"{name}\", and none with a name{includes}"));
        }
        Err(format!("has no joint \"{name}\"; its joints are {}{includes}", names.join(", ")))
    }

    /// An attribute of a joint or an actuator, from itself or the defaults of its class.
    fn inherited(&self, tag: usize, kind: &str, key: &str) -> Option<&'a str> {
        if let Some(value) = self.get(tag, key) {
            return Some(value);
        }
        let above = std::iter::successors(self.parent(tag), |tag| self.parent(*tag));
        let class =
            self.get(tag, "class").or_else(|| above.into_iter().find_map(|tag| self.get(tag, "childclass")));
        let is_default = |tag: &usize| self.tags[*tag].name == "default";
        let has_class = |tag: &usize| match class {
            Some(class) => self.get(*tag, "class") == Some(class),
            None => !self.is_in(*tag, "default"),
        };
        let start = (0..self.tags.len()).filter(is_default).find(has_class)?;
        let is_kind = |name: &str| if kind == "joint" { name == "joint" } else { DRIVES.contains(&name) };
        std::iter::successors(Some(start), |tag| self.parent(*tag)).find_map(|class| {
            let children = (0..self.tags.len()).filter(|tag| self.parent(*tag) == Some(class));
            children.filter(|tag| is_kind(self.tags[*tag].name)).find_map(|tag| self.get(tag, key))
        })
    }

    /// The first number of an attribute.
    fn value(&self, tag: usize, kind: &str, key: &str, otherwise: f64) -> f64 {
        let text = self.inherited(tag, kind, key);
        text.and_then(|text| text.split_whitespace().next()?.parse().ok()).unwrap_or(otherwise)
    }

    fn step_s(&self) -> f64 {
        let option =
            self.tags.iter().find(|tag| tag.name == "option" && tag.get(self.text, "timestep").is_some());
        option.and_then(|tag| tag.get(self.text, "timestep")?.parse().ok()).unwrap_or(DEFAULT_STEP_S)
    }

    fn is_in_degrees(&self, tag: usize) -> bool {
        let compiler = self.tags.iter().filter(|tag| tag.name == "compiler");
        let angle = compiler.filter_map(|tag| tag.get(self.text, "angle")).next_back();
        angle != Some("radian") && self.inherited(tag, "joint", "type") != Some("slide")
    }

    fn one_joint(&mut self, tag: usize, before: &JointTerms, after: &JointTerms) {
        self.set_armature(tag, after.inertia - before.inertia);
        self.set_friction(tag, after.viscous, after.dry);
        self.set_spring(tag, after);
    }

    /// Sets the inertia of the joint alone, `more` than it is.
    fn set_armature(&mut self, tag: usize, more: f64) {
        let armature = self.value(tag, "joint", "armature", 0.0) + more;
        if armature < 0.0 {
            self.notes.push(format!(
                "the links' inertia is {:.6e} too large: take that from their masses",
                -armature
            ));
        }
        if more != 0.0 {
            self.set(tag, "armature", &number(armature.max(0.0)));
        }
    }

    fn set_friction(&mut self, tag: usize, damping: f64, dry: f64) {
        self.set(tag, "damping", &number(damping));
        self.set(tag, "frictionloss", &number(dry));
        if dry > 0.0 {
            self.set(tag, "solreffriction", &format!("{} 1", number(2.0 * self.step_s())));
            self.set(tag, "solimpfriction", FRICTION_IMPEDANCE);
        }
    }

    fn set_spring(&mut self, tag: usize, after: &JointTerms) {
        if after.stiffness != 0.0 {
            let slack = if self.is_in_degrees(tag) { after.slack.to_degrees() } else { after.slack };
            self.set(tag, "stiffness", &number(after.stiffness));
            self.set(tag, "springref", &number(slack));
        }
    }

    /// The joint carries the load, and a new one the motor; a tendon's limits are the flanks of the
    /// gap between them.
    fn two_joints(&mut self, tag: usize, motor: &str, before: &JointTerms, after: &JointTerms, gap: Gap) {
        let load = after.inertia * gap.ratio / (1.0 + gap.ratio);
        let name = self.get(tag, "name").unwrap_or_default();
        self.set_armature(tag, load - before.inertia);
        self.set_friction(tag, gap.load_damping, gap.load_dry);
        self.set_spring(tag, after);
        let kind = self.inherited(tag, "joint", "type").unwrap_or("hinge");
        let (inertia, step) = (number(after.inertia - load), number(2.0 * self.step_s()));
        let body = format!(
            "<body name=\"{motor}\"><inertial pos=\"0 0 0\" mass=\"1e-9\" diaginertia=\"1e-12 1e-12 1e-12\"/><joint name=\"{motor}\" \
             type=\"{kind}\" axis=\"1 0 0\" limited=\"false\" stiffness=\"0\" armature=\"{inertia}\" damping=\"{}\" frictionloss=\"{}\" \
             solreffriction=\"{step} 1\" solimpfriction=\"{FRICTION_IMPEDANCE}\"/></body>",
            number(after.viscous - gap.load_damping),
            number(after.dry - gap.load_dry)
        );
        let half = number(0.5 * gap.width);
        let contact = std::f64::consts::TAU * gap.contact_hz;
        let tendon = format!(
            "<tendon><fixed name=\"{motor}_gap\" limited=\"true\" range=\"-{half} {half}\" solreflimit=\"{} {}\" \
             solimplimit=\"{FLANK_IMPEDANCE}\"><joint joint=\"{motor}\" coef=\"1\"/><joint joint=\"{name}\" coef=\"-1\"/></fixed></tendon>",
            number(-contact * contact),
            number(-2.0 * gap.damping * contact)
        );
        for (section, text) in [("worldbody", body), ("mujoco", tendon)] {
            let mut closing =
                self.tags.iter().filter(|tag| tag.name == section).filter_map(|tag| tag.closing.clone());
            if let Some(at) = closing.next_back() {
                self.changes.push((at.start..at.start, text));
            }
        }
    }

    /// Changes the actuators of a joint: how they transmit, their limit, lag and delay.
    fn drives(&mut self, joint: &str, driven: &str, before: &JointTerms, after: &JointTerms) {
        let is_drive = |tag: &usize| {
            self.parent(*tag).is_some_and(|tag| self.tags[tag].name == "actuator")
                && self.get(*tag, "joint") == Some(joint)
        };
        let drives: Vec<usize> = (0..self.tags.len()).filter(is_drive).collect();
        if drives.is_empty() {
            self.notes.push(format!("the drive, because no actuator has joint=\"{joint}\""));
        }
        for tag in drives {
            if driven != joint {
                self.set(tag, "joint", driven);
            }
            let ratio = after.gain / before.gain;
            match self.tags[tag].name {
                "motor" | "general" => self.drive(tag, ratio, before, after),
                "position" | "velocity" => self.servo(tag, ratio),
                other => self.notes.push(format!("an actuator <{other}>: multiply its force by {ratio:.6e}")),
            }
        }
    }

    /// Adds actuators to those of the model.
    fn add_actuators(&mut self, text: &str) {
        let closing = |name: &str| {
            let all = self.tags.iter().filter(|tag| tag.name == name);
            all.filter_map(|tag| tag.closing.clone()).next_back()
        };
        let place = closing("actuator").map(|at| (at, text.to_owned()));
        let place = place.or_else(|| Some((closing("mujoco")?, format!("<actuator>{text}</actuator>"))));
        self.changes.extend(place.filter(|_| !text.is_empty()).map(|(at, text)| (at.start..at.start, text)));
    }

    /// A servo, whose gains make the force.
    fn servo(&mut self, tag: usize, ratio: f64) {
        for key in ["kp", "kv"] {
            if ratio != 1.0 && self.inherited(tag, "actuator", key).is_some() {
                let gain = self.value(tag, "actuator", key, 1.0);
                self.set(tag, key, &number(ratio * gain));
            }
        }
        self.notes.push("bias, limit, lag and delay of a servo's drive".into());
    }

    /// A drive whose control is a force.
    fn drive(&mut self, tag: usize, ratio: f64, before: &JointTerms, after: &JointTerms) {
        let is_motor = self.tags[tag].name == "motor";
        let gear = self.value(tag, "actuator", "gear", 1.0);
        let gain = if is_motor { 1.0 } else { self.value(tag, "actuator", "gainprm", 1.0) };
        let bias = after.bias / gear;
        let lag = after.lag - before.lag;
        let delay = after.delay - before.delay;
        if ratio != 1.0 {
            if is_motor {
                let rest = self
                    .inherited(tag, "actuator", "gear")
                    .map_or("", |all| all.trim_start().split_once(' ').map_or("", |x| x.1));
                let gear = format!("{} {rest}", number(ratio * gear));
                self.set(tag, "gear", gear.trim_end());
            } else {
                self.set(tag, "gainprm", &number(ratio * gain));
            }
        }
        let bias = if is_motor { bias / ratio } else { bias };
        if after.bias != before.bias || lag > 0.0 {
            if is_motor {
                self.rename(tag, "general");
                self.set(tag, "gaintype", "fixed");
                self.set(tag, "gainprm", "1");
            }
            self.set(tag, "biastype", "affine");
            self.set(tag, "biasprm", &format!("{} 0 0", number(bias)));
        }
        if lag > 0.0 {
            self.set(tag, "dyntype", "filterexact");
            self.set(tag, "dynprm", &number(after.lag));
        }
        if delay > 0.0 {
            let samples = (after.delay / self.step_s()).ceil() as usize + 2;
            self.set(tag, "delay", &number(after.delay));
            self.set(tag, "nsample", &samples.to_string());
        }
        if let Some(limit) = after.limit.filter(|limit| before.limit != Some(*limit)) {
            // Control is the command times this; the force of a motor is its control.
            let control = before.gain / (gear * gain);
            let most = (limit * control * if is_motor { 1.0 } else { ratio * gain }).abs();
            let bias = if after.bias != before.bias { bias } else { 0.0 };
            self.set(tag, "forcelimited", "true");
            self.set(tag, "forcerange", &format!("{} {}", number(bias - most), number(bias + most)));
        }
    }

    fn rename(&mut self, tag: usize, name: &str) {
        let Tag { name: old, at, closing, .. } = &self.tags[tag];
        let mut places = vec![at.start + 1];
        places.extend(closing.as_ref().map(|at| at.start + 2));
        let length = old.len();
        self.changes.extend(places.into_iter().map(|at| (at..at + length, name.to_owned())));
    }
}

/// Tags whose defaults an actuator has.
const DRIVES: [&str; 4] = ["motor", "general", "position", "velocity"];

/// The ranges in which the joint's attributes may be drawn at random: 95 % intervals of the found
/// values where an attribute follows from one, and all intervals by their names.
pub fn ranges(patched: &Rig, found: &[Named]) -> serde_json::Value {
    let attributes = |rig: &Rig| {
        let joint = joint_of(rig);
        let gap = joint.gap.map_or(0.0, |gap| gap.width);
        [
            ("damping", joint.viscous),
            ("frictionloss", joint.dry),
            ("stiffness", joint.stiffness),
            ("gap", gap),
        ]
    };
    let base = attributes(patched);
    let mut ranges: BTreeMap<&str, [f64; 2]> = BTreeMap::new();
    for (named, key, end) in found.iter().flat_map(|named| {
        named.parameters.iter().flat_map(move |(key, p)| p.ci95.map(|end| (named, key, end)))
    }) {
        let mut rig = patched.clone();
        for effect in rig.effects.iter_mut().filter(|effect| effect.name == named.name) {
            for values in [&mut effect.shape, &mut effect.coefficients] {
                values.entry(key.clone()).and_modify(|value| *value = end);
            }
        }
        for ((attribute, value), (_, was)) in attributes(&rig).into_iter().zip(base) {
            if value != was {
                let range = ranges.entry(attribute).or_insert([was, was]);
                *range = [range[0].min(value), range[1].max(value)];
            }
        }
    }
    let all: BTreeMap<&str, _> = found.iter().map(|named| (named.name.as_str(), &named.parameters)).collect();
    serde_json::json!({ "attributes": ranges, "parameters": all })
}
