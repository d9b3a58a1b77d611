//! The rows of the performance table: their names, units and what is wanted of them.

/// The direction in which a value is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Better {
    /// Less is.
    Lower,
    /// More is.
    Higher,
}

/// A row, without its value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    /// Its name in `target/bench.json`.
    pub(crate) name: &'static str,
    pub(crate) unit: &'static str,
    /// The goal, where there is one.
    pub(crate) wanted: Option<f64>,
    pub(crate) better: Better,
    /// The peer to compare with; if it has not been measured, the table says so.
    pub(crate) peer: Option<&'static str>,
}

const fn row(name: &'static str, unit: &'static str, wanted: Option<f64>, better: Better) -> Row {
    Row { name, unit, wanted, better, peer: None }
}

/// A row with a peer to compare with.
const fn peered(row: Row, peer: &'static str) -> Row {
    Row { peer: Some(peer), ..row }
}

/// Every row that there is, in the table's order. A measuring program gives a value by printing
/// `name=value`.
pub(crate) const ROWS: [Row; 25] = [
    row("tick_instructions_longest", "instructions", Some(840.0), Better::Lower),
    row("tick_to_dac_spread_us", "us", Some(1.0), Better::Lower),
    peered(row("tick_host_ns", "ns", Some(60.0), Better::Lower), "the law in f64"),
    peered(row("plant_core_ticks_per_s", "ticks/s", None, Better::Higher), "MuJoCo"),
    row("plant_core_scaling", "times on two cores", None, Better::Higher),
    row("plant_growth", "times of linear", None, Better::Lower),
    row("diagnose_60s_s", "s", None, Better::Lower),
    row("diagnose_peak_mib", "MiB", None, Better::Lower),
    row("diagnose_growth", "times of linear", None, Better::Lower),
    peered(row("parameter_fit_s", "s", None, Better::Lower), "SciPy"),
    peered(row("frame_samples_per_s", "samples/s", Some(10_000_000.0), Better::Higher), "postcard"),
    row("stream_samples_per_s", "samples/s", Some(10_000_000.0), Better::Higher),
    row("hand_to_page_p50_ms", "ms", None, Better::Lower),
    row("hand_to_page_p99_ms", "ms", None, Better::Lower),
    peered(row("xpbd_step_ms", "ms", Some(2.0), Better::Lower), "SciPy"),
    row("xpbd_growth", "times of linear", None, Better::Lower),
    peered(row("ultrasound_frame_ms", "ms", Some(8.0), Better::Lower), "NumPy"),
    row("class_growth", "times of linear", None, Better::Lower),
    row("build_s", "s", None, Better::Lower),
    row("packages", "packages", None, Better::Lower),
    row("page_first_frame_s", "s", None, Better::Lower),
    row("page_mb", "MB", None, Better::Lower),
    row("firmware_flash_bytes", "bytes", Some(196_608.0), Better::Lower),
    row("stack_high_water_bytes", "bytes", None, Better::Lower),
    row("masked_longest_us", "us", None, Better::Lower),
];
