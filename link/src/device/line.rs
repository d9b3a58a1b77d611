//! The line of the needle: the latest counts, and a flood of them holds nothing up.

use super::{Endpoint, Waiting};
use crate::frames::{Ack, CommandRefusal};
use control_core::NeedleLine;
use core::borrow::BorrowMut;

/// The number of [`crate::Command::Line`] on the wire.
const LINE: u32 = 17;

/// Reads the id and the line from the bytes of a frame; `None` if it is another command. A frame
/// of any command takes ten times as long to read.
pub(super) fn read(body: &[u8]) -> Option<(u32, NeedleLine)> {
    let ((id, command), line) = postcard::take_from_bytes::<(u32, u32)>(body).ok()?;
    if command != LINE {
        return None;
    }
    match postcard::take_from_bytes(line) {
        Ok((line, [])) => Some((id, line)),
        _ => None,
    }
}

impl<W: BorrowMut<Waiting>> Endpoint<W> {
    /// Returns the latest line once, if it is sound, and answers it; those that it has overtaken
    /// are not answered. It overtakes the orders too: whoever passes them on to the control law
    /// gives it this first. It is checked here, so that many of them hold nothing up.
    pub fn take_line(&mut self) -> Option<NeedleLine> {
        let (id, line) = self.line_due.take()?;
        let result = self.plan.check_line(&line).map_err(CommandRefusal::Config);
        self.line_ack = Some(Ack { id, result });
        result.is_ok().then_some(line)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::{Command, HostFrame};
    use control_core::units::Millimetres;
    use fixed::types::I16F16;
    use std::vec::Vec;

    #[test]
    fn a_line_is_read_as_any_command_is() {
        let depths = [1, -700_000].map(|bits| Millimetres(I16F16::from_bits(bits)));
        let line = NeedleLine { depths: depths.into_iter().collect() };
        let frame = HostFrame { id: 70_000, command: Command::Line(line.clone()) };
        let bytes = encoded(&frame);
        assert_eq!(read(&bytes), Some((70_000, line)));
        let cut = bytes.split_last().and_then(|(_, cut)| read(cut));
        assert_eq!(cut, None);
        assert_eq!(read(&[&bytes[..], &[0]].concat()), None, "longer than it says");
        let stop = encoded(&HostFrame { id: 70_000, command: Command::Stop });
        assert_eq!(read(&stop), None);
    }

    fn encoded(frame: &HostFrame) -> Vec<u8> {
        postcard::to_slice(frame, &mut [0; 64]).map(|bytes| bytes.to_vec()).unwrap_or_default()
    }
}
