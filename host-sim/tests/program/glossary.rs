//! docs/guide/glossary.md has every verdict, fault and refusal, in the words that the program
//! prints.

use control_core::Refusal;
use control_core::event::Fault;
use control_core::excitation::SequenceRefusal;
use control_core::interlock::Interlock;
use control_core::plan::Field;
use diagnosis::Verdict;
use fixed::types::I16F16;
use link::frames::{CommandRefusal, GuardRefusal, SaveError};

const GLOSSARY: &str = include_str!("../../../docs/guide/glossary.md");

/// The rows of the table under a heading.
fn rows(heading: &str) -> Vec<&'static str> {
    let (_, section) =
        GLOSSARY.split_once(&format!("## {heading}\n")).unwrap_or_else(|| panic!("no section {heading}"));
    let lines = section.lines().take_while(|line| !line.starts_with("## "));
    lines.filter(|line| line.starts_with("| ") && !line.starts_with("| ---")).collect()
}

#[test]
fn the_glossary_quotes_every_fault_and_refusal_exactly() {
    let faults = rows("Faults");
    assert_eq!(faults.len(), 1 + Fault::ALL.len(), "a head and a row each");
    for fault in Fault::ALL {
        let wanted = format!("| {fault} |");
        assert!(faults.iter().any(|row| row.contains(&wanted)), "{fault:?}: {wanted}");
    }
    let own = [
        CommandRefusal::Powered,
        CommandRefusal::Version,
        CommandRefusal::Full,
        CommandRefusal::NoSession,
        // Any field.
        CommandRefusal::Commissioned(Field::TorqueLimit),
        CommandRefusal::NotShown,
        // Any fault.
        CommandRefusal::Faulted(Fault::EmergencyStop),
        CommandRefusal::NotStopped,
        CommandRefusal::Overtaken,
    ];
    let interlocked = Interlock::ALL.map(CommandRefusal::Interlocked);
    let sequence = [
        SequenceRefusal::TooLong { index: 1 },
        SequenceRefusal::TooMany,
        SequenceRefusal::OutOfOrder { index: 2, due: 1 },
        SequenceRefusal::Mixed { index: 1 },
        SequenceRefusal::Nothing,
        SequenceRefusal::Count { found: 2, wanted: 3 },
        SequenceRefusal::Damaged,
        SequenceRefusal::Late,
    ]
    .map(CommandRefusal::Sequence);
    let guard = [
        GuardRefusal::Off,
        GuardRefusal::Restart,
        GuardRefusal::Implausible(0xCFFF_FFFD),
        GuardRefusal::NotTaken,
        GuardRefusal::SupplyLow,
    ]
    .map(CommandRefusal::Guard);
    let kept = [SaveError::Flash, SaveError::Full, SaveError::TooLong];
    let sentences = own.iter().chain(&interlocked).chain(&sequence).chain(&guard).map(ToString::to_string);
    let sentences: Vec<String> = sentences.chain(kept.map(|error| error.to_string())).collect();
    let refusals = rows("Refusals of a command");
    // Two heads, and the two rows that point to the refusals.
    assert_eq!(refusals.len(), 4 + sentences.len());
    for sentence in sentences {
        assert!(refusals.iter().any(|row| row.ends_with(&format!("| {sentence} |"))), "{sentence}");
    }
}

/// Returns the glossary's name of a refusal. A new refusal needs one here.
fn called(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::OutOfRange { .. } => "out of range",
        Refusal::TooStiff { .. } => "too stiff",
        Refusal::TooStrong { .. } => "too strong",
        Refusal::Overlap { .. } => "overlap",
        Refusal::ContactStep { .. } => "contact step",
        Refusal::WrongWay { .. } => "wrong way",
        Refusal::ReliefAboveElastic { .. } => "relief above elastic",
        Refusal::BeyondTravel { .. } => "beyond travel",
        Refusal::NoVessel { .. } => "no vessel",
        Refusal::Count { .. } => "count",
        Refusal::Empty => "empty",
        Refusal::AboveCeiling { .. } => "above ceiling",
        Refusal::CompensationTooStrong { .. } => "compensation too strong",
        Refusal::CompensationUnstable { .. } => "compensation unstable",
        Refusal::WouldRing { .. } => "would ring",
    }
}

#[test]
fn the_glossary_has_every_refusal_and_verdict() {
    let (layer, x) = (0, I16F16::ONE);
    let refusals = [
        Refusal::OutOfRange { field: Field::Travel, value: x, low: x, high: x },
        Refusal::TooStiff { layer, slope: x, limit: x },
        Refusal::TooStrong { layer, force: x, limit: x },
        Refusal::Overlap { layer },
        Refusal::ContactStep { layer, force: x },
        Refusal::WrongWay { layer },
        Refusal::ReliefAboveElastic { layer },
        Refusal::BeyondTravel { layer },
        Refusal::NoVessel { layer },
        Refusal::Count { field: Field::Travel, found: 1, wanted: 2 },
        Refusal::Empty,
        Refusal::AboveCeiling { force: x, ceiling: x },
        Refusal::CompensationTooStrong { torque: x, limit: x },
        Refusal::CompensationUnstable { stiffness: x, limit: x },
        Refusal::WouldRing { stiffness: x, limit: x },
    ];
    let table = rows("Refusals of a configuration");
    assert_eq!(table.len(), 1 + refusals.len());
    for refusal in refusals {
        let row = table.iter().find(|row| row.starts_with(&format!("| {} |", called(refusal))));
        let row = row.unwrap_or_else(|| panic!("{refusal:?}"));
        // What to do comes last in the sentence, and is the same where it holds no figures.
        let said = refusal.to_string();
        if let Some((_, advice)) =
            said.rsplit_once("; ").filter(|(_, advice)| !advice.contains(|c: char| c.is_ascii_digit()))
        {
            assert!(row.contains(advice), "{row} does not say \"{advice}\"");
        }
    }
    let verdicts = rows("Verdicts of the diagnosis");
    let all = [
        Verdict::NoMismatch,
        Verdict::ParametersOnly,
        Verdict::MissingPhysics,
        Verdict::Unexplained,
        Verdict::RandomDisturbance,
        Verdict::InsufficientExcitation,
    ];
    for verdict in all {
        let name = serde_json::to_value(verdict).expect("it has a name");
        let name = name.as_str().expect("a word");
        assert!(verdicts.iter().any(|row| row.starts_with(&format!("| `{name}` |"))), "{name}");
    }
}
