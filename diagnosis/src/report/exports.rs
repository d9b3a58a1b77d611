//! A rig for other simulators. What a format cannot express is a note in the file; nothing is left
//! out in silence.

use crate::data::rig::{Kind, Rig};
use crate::laws::Effect;
use crate::laws::joint_terms::JointTerms;
use std::fmt::Write as _;

/// A format to export to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// MuJoCo's XML.
    Mjcf,
    /// The Unified Robot Description Format.
    Urdf,
    /// Settings of an actuator of Isaac Lab, in Python.
    IsaacLab,
    /// Everything, for a program of one's own.
    Json,
}

impl Format {
    /// By its name.
    pub fn find(name: &str) -> Option<Self> {
        match name {
            "mjcf" => Some(Self::Mjcf),
            "urdf" => Some(Self::Urdf),
            "isaaclab" => Some(Self::IsaacLab),
            "json" => Some(Self::Json),
            _ => None,
        }
    }

    /// The name of the file.
    pub fn file(self) -> &'static str {
        match self {
            Self::Mjcf => "patched-rig.xml",
            Self::Urdf => "patched-rig.urdf",
            Self::IsaacLab => "patched_rig_isaaclab.py",
            Self::Json => "patched-rig.json",
        }
    }
}

/// The text of a rig in a format.
pub fn export(rig: &Rig, format: Format) -> String {
    match format {
        Format::Mjcf => mjcf(rig),
        Format::Urdf => urdf(rig),
        Format::IsaacLab => isaac_lab(rig),
        Format::Json => json(rig),
    }
}

/// Numbers of an effect, for a note.
fn numbers(effect: &Effect) -> String {
    if let Some(formula) = effect.name.formula() {
        let values = effect.shape.iter().chain(&effect.coefficients);
        let values: Vec<String> = values.map(|(key, value)| format!("{key} {value:.6e}")).collect();
        return format!("{}, {}", formula.text.formula, values.join(", "));
    }
    let all = effect.shape.iter().chain(&effect.coefficients);
    all.map(|(key, value)| format!("{key} {value:.6e}")).collect::<Vec<_>>().join(", ")
}

/// A rig in the terms of a joint and its motor.
pub(super) fn joint_of(rig: &Rig) -> JointTerms {
    let model = &rig.model;
    let mut joint = JointTerms {
        inertia: model.inertia,
        viscous: model.viscous.unwrap_or(0.0),
        dry: model.coulomb.unwrap_or(0.0),
        bias: model.offset.unwrap_or(0.0),
        gain: rig.actuator.gain,
        limit: rig.actuator.limit,
        delay: rig.actuator.delay_s.unwrap_or(0.0),
        lag: rig.actuator.lag_s.unwrap_or(0.0),
        ..JointTerms::default()
    };
    if let Some(weight) = model.weight.filter(|w| *w != 0.0) {
        joint.notes.push(format!(
            "weight {weight:.6e} {} times the sine of the tilt: add it as an applied force, or tilt the joint under gravity",
            rig.kind.force()
        ));
    }
    if let Some(gravity) = model.gravity.filter(|g| *g != 0.0) {
        joint.notes.push(format!(
            "gravity {gravity:.6e} {} times the sine of the angle from {:.6e} rad: add it as an applied force, or hang a mass on the joint",
            rig.kind.force(),
            model.gravity_zero.unwrap_or(0.0)
        ));
    }
    if let Some(filter) = rig.encoder.filter_s.filter(|s| *s > 0.0) {
        joint.notes.push(format!("the position is read behind a first-order filter of {filter:.6e} s"));
    }
    for effect in &rig.effects {
        let name = effect.name;
        if !name.definition().add_to_joint(effect, &mut joint) {
            joint.notes.push(format!("{name} ({}): {}", name.in_words(), numbers(effect)));
        }
    }
    joint
}

/// A rig as one joint, which has no room for a gap, bristles or waves.
fn one_joint(rig: &Rig) -> JointTerms {
    let mut joint = joint_of(rig);
    if let Some(gap) = joint.gap.take() {
        joint.notes.push(format!(
            "a gap of {:.6e} {} between motor and load, with load inertia over motor inertia {:.6e}: --export mjcf --into has it",
            gap.width,
            rig.kind.length(),
            gap.ratio
        ));
    }
    note_motor(&mut joint, rig.kind);
    joint
}

/// Takes from a joint what a friction model of a motor would say, and notes it.
pub(super) fn note_motor(joint: &mut JointTerms, kind: Kind) {
    let (force, length) = (kind.force(), kind.length());
    let bristles = joint.bristles.take().map(|one| {
        format!(
            "bristles that bend over {:.6e} {length} before {:.6e} {force} of the dry friction slides, damped by {:.6e} {force}·s/{length}",
            one.deflection, one.dry, one.damping
        )
    });
    let drop = joint.drop.take().map(|one| {
        format!(
            "friction that is {:.6e} {force} larger at rest and falls over {:.6e} {length}/s",
            one.peak, one.speed
        )
    });
    let waves = std::mem::take(&mut joint.waves).into_iter().map(|one| {
        format!(
            "{:.6e} {force} times the sine of {:.6e} times the coordinate plus {:.6e} rad",
            one.amplitude, one.wave, one.phase
        )
    });
    let all = bristles.into_iter().chain(drop).chain(waves);
    joint.notes.extend(all.map(|text| format!("{text}: --export mjcf --into --dcmotor has it")));
}

/// Text that is valid in XML, and in its comments.
pub(super) fn xml(text: &str) -> String {
    html_report::safe(text).replace("--", "– ")
}

fn notes(out: &mut String, joint: &JointTerms) {
    for note in &joint.notes {
        let _ = writeln!(out, "  <!-- not in this file: {} -->", xml(note));
    }
}

/// Seconds of a step of MuJoCo.
const TIMESTEP_S: f64 = 2e-4;

fn mjcf(rig: &Rig) -> String {
    let joint = one_joint(rig);
    let mut out = String::new();
    let _ = writeln!(out, "<mujoco model=\"{}\">", xml(&rig.name));
    let _ = writeln!(
        out,
        "  <!-- Written by host-sim. ctrl is the command, in {}; qpos the coordinate, in {}. -->",
        xml(&rig.actuator.command_unit),
        rig.kind.length()
    );
    notes(&mut out, &joint);
    // Friction acts in steps: implicit ones hold it at rest.
    let _ =
        writeln!(out, "  <option timestep=\"{TIMESTEP_S}\" gravity=\"0 0 0\" integrator=\"implicitfast\"/>");
    let (kind, axis) = if rig.kind == Kind::Rotary { ("hinge", "0 0 1") } else { ("slide", "1 0 0") };
    // MuJoCo wants a body with some mass of its own; nearly all of the inertia is the joint's.
    let own = 1e-3 * joint.inertia;
    let inertial = match rig.kind {
        Kind::Rotary => format!("mass=\"{own:e}\" diaginertia=\"{own:e} {own:e} {own:e}\""),
        Kind::Linear => format!("mass=\"{own:e}\" diaginertia=\"{own:e} {own:e} {own:e}\""),
    };
    let _ = writeln!(out, "  <worldbody>\n    <body name=\"axis\">");
    let _ = writeln!(
        out,
        "      <joint name=\"axis\" type=\"{kind}\" axis=\"{axis}\" armature=\"{:e}\" damping=\"{:e}\" frictionloss=\"{:e}\" \
         stiffness=\"{:e}\" springref=\"{:e}\" solreffriction=\"{:e} 1\" solimpfriction=\"0.9999 0.9999 0.001 0.5 2\"/>",
        joint.inertia - own,
        joint.viscous,
        joint.dry,
        joint.stiffness,
        if rig.kind == Kind::Rotary { joint.slack.to_degrees() } else { joint.slack },
        2.0 * TIMESTEP_S
    );
    let _ = writeln!(
        out,
        "      <inertial pos=\"0 0 0\" {inertial}/>\n    </body>\n  </worldbody>\n  <actuator>"
    );
    let mut drive = format!(
        "    <general name=\"drive\" joint=\"axis\" gaintype=\"fixed\" gainprm=\"{:e}\" biastype=\"affine\" biasprm=\"{:e} 0 0\"",
        joint.gain, joint.bias
    );
    if let Some(limit) = joint.limit {
        let _ = write!(drive, " ctrllimited=\"true\" ctrlrange=\"{:e} {limit:e}\"", -limit);
    }
    if joint.lag > 0.0 {
        let _ = write!(drive, " dyntype=\"filterexact\" dynprm=\"{:e}\"", joint.lag);
    }
    if joint.delay > 0.0 {
        // MuJoCo 3.5 and newer: a buffer of past commands.
        let samples = (joint.delay / TIMESTEP_S).ceil() as usize + 2;
        let _ = write!(drive, " delay=\"{:e}\" nsample=\"{samples}\"", joint.delay);
    }
    let _ = writeln!(out, "{drive}/>\n  </actuator>\n</mujoco>");
    out
}

fn urdf(rig: &Rig) -> String {
    let mut joint = one_joint(rig);
    let unit = rig.kind.force();
    joint.notes.push(format!(
        "the drive gives {:.6e} {unit} for one {} of command",
        joint.gain, rig.actuator.command_unit
    ));
    for (value, what) in [
        (joint.bias, format!("a force of {:.6e} {unit} that is there all the time", joint.bias)),
        (joint.delay, format!("a delay of {:.6e} s between command and force", joint.delay)),
        (joint.lag, format!("a lag of {:.6e} s between command and force", joint.lag)),
        (joint.stiffness, format!("a spring of {:.6e} {unit}/{}", joint.stiffness, rig.kind.length())),
    ] {
        if value != 0.0 {
            joint.notes.push(what);
        }
    }
    let mut out = String::from("<?xml version=\"1.0\"?>\n");
    let _ = writeln!(out, "<robot name=\"{}\">\n  <!-- Written by host-sim. -->", xml(&rig.name));
    notes(&mut out, &joint);
    let (kind, axis) =
        if rig.kind == Kind::Rotary { ("continuous", "0 0 1") } else { ("prismatic", "1 0 0") };
    let j = joint.inertia;
    let effort = joint.limit.map_or(1e9, |limit| (limit * joint.gain).abs());
    let _ = writeln!(
        out,
        "  <link name=\"base\"/>\n  <link name=\"axis\">\n    <inertial>\n      <mass value=\"{j:e}\"/>\n      \
         <inertia ixx=\"{j:e}\" ixy=\"0\" ixz=\"0\" iyy=\"{j:e}\" iyz=\"0\" izz=\"{j:e}\"/>\n    </inertial>\n  </link>\n  \
         <joint name=\"axis\" type=\"{kind}\">\n    <parent link=\"base\"/>\n    <child link=\"axis\"/>\n    <axis xyz=\"{axis}\"/>\n    \
         <limit lower=\"-1e9\" upper=\"1e9\" effort=\"{effort:e}\" velocity=\"1e9\"/>\n    \
         <dynamics damping=\"{:e}\" friction=\"{:e}\"/>\n  </joint>\n</robot>",
        joint.viscous, joint.dry
    );
    out
}

/// A function that makes the settings: the links' inertia and the step are the user's.
fn isaac_lab(rig: &Rig) -> String {
    let joint = one_joint(rig);
    let (force, length) = (rig.kind.force(), rig.kind.length());
    let mut notes = joint.notes.clone();
    for (value, what) in [
        (joint.lag, "a lag, in s, of the force behind the command"),
        (joint.stiffness, "a spring, in force per travel"),
    ] {
        if value != 0.0 {
            notes.push(format!("{what}: {value:.6e}"));
        }
    }
    let notes: String = notes.iter().map(|note| format!("#   {}\n", note.replace('\n', " "))).collect();
    let limit = joint.limit.map_or("None".to_owned(), |limit| format!("{:e}", (limit * joint.gain).abs()));
    format!(
        "\"\"\"Settings of an Isaac Lab actuator, written by host-sim: a rig in {force} and {length}.\"\"\"\n\n\
         from isaaclab.actuators import DelayedPDActuatorCfg\n\n\
         # Not in these settings:\n{notes}\
         INERTIA = {:e}  # of everything that the joint moves\n\
         FORCE_PER_COMMAND = {:e}\nFORCE_THAT_IS_ALWAYS_THERE = {:e}  # add it to the effort target\n\
         EFFORT_LIMIT = {limit}\nDELAY_S = {:e}\n\n\n\
         def actuator(joint: str, dt: float, links_inertia: float = 0.0, stiffness: float = 0.0, damping: float = 0.0):\n    \
             \"\"\"`dt` is the physics step in s; stiffness and damping are your controller's.\"\"\"\n    \
             steps = round(DELAY_S / dt)\n    \
             return DelayedPDActuatorCfg(\n        \
                 joint_names_expr=[joint], stiffness=stiffness, damping=damping, effort_limit=EFFORT_LIMIT,\n        \
                 armature=max(INERTIA - links_inertia, 0.0), friction={:e}, dynamic_friction={:e}, viscous_friction={:e},\n        \
                 min_delay=steps, max_delay=steps,\n    )\n",
        joint.inertia, joint.gain, joint.bias, joint.delay, joint.dry, joint.dry, joint.viscous
    )
}

fn json(rig: &Rig) -> String {
    let joint = one_joint(rig);
    let value = serde_json::json!({
        "format": 1,
        "rig": rig,
        "joint": {
            "inertia": joint.inertia, "damping": joint.viscous, "frictionloss": joint.dry, "bias": joint.bias,
            "stiffness": joint.stiffness, "springref": joint.slack, "gain": joint.gain, "limit": joint.limit,
            "delay_s": joint.delay, "lag_s": joint.lag
        },
        "units": { "length": rig.kind.length(), "force": rig.kind.force(), "command": rig.actuator.command_unit },
        "not_in_joint": joint.notes
    });
    serde_json::to_string_pretty(&value).expect("a rig has nothing that JSON cannot say") + "\n"
}
