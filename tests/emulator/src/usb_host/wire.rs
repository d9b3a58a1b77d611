//! The whole transactions on a full-speed USB cable, and the device at its far end.

/// A device's answer to a token.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Handshake {
    /// It took the data.
    Ack,
    /// It has nothing to send, or no room: ask again.
    Nak,
    /// The endpoint is halted, or the request is refused.
    Stall,
    /// It said nothing: no such address or endpoint, or it is gone.
    Silence,
    /// It sent a packet, with its data toggle.
    Data(Vec<u8>, bool),
}

/// A device as the wire sees it.
pub trait Device {
    /// True if it pulls D+ up, which is how a host sees a full-speed device.
    fn pulls_up(&self) -> bool;
    /// The host drives single-ended zero.
    fn bus_reset(&mut self);
    /// The reset is over, and the speed is known.
    fn reset_over(&mut self);
    /// A start of frame, which also says that the bus is awake.
    fn start_of_frame(&mut self, frame: u16);
    /// Three milliseconds without a start of frame.
    fn bus_idle(&mut self);
    /// The host drives resume.
    fn resume(&mut self);
    /// SETUP and its eight bytes.
    fn setup(&mut self, address: u8, endpoint: u8, request: [u8; 8]) -> Handshake;
    /// OUT and its packet.
    fn out(&mut self, address: u8, endpoint: u8, packet: &[u8], toggle: bool) -> Handshake;
    /// IN.
    fn input(&mut self, address: u8, endpoint: u8) -> Handshake;
}
