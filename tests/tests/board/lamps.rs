//! The boards' lamps show the state to a person who sees no page.

use control_core::event::Fault;
use emulator::board::{MILLISECOND, Wiring};
use link::Command;
use tests::rig::Rig;

#[test]
fn lamps_show_torque_and_fault_on_both_boards() {
    for wiring in [Wiring::default(), Wiring::nucleo_f429zi()] {
        let mut rig = Rig::pressed_on(wiring);
        let lamps = |rig: &mut Rig| rig.board.at_stop(|stopped| stopped.lamps());
        assert_eq!(lamps(&mut rig), [true, true, false], "torque is on");
        rig.pc.must(&mut rig.board, Command::Stop);
        rig.pc.run_ms(&mut rig.board, 5);
        assert_eq!(lamps(&mut rig), [true, false, false], "stopped");
        rig.pc.must(&mut rig.board, Command::Start);
        rig.pc.run_ms(&mut rig.board, 5);
        rig.board.at_stop(|stopped| stopped.set_emergency_stop(true));
        rig.time_to_safe(10 * MILLISECOND);
        rig.board.run_ms(5);
        assert_eq!(lamps(&mut rig), [true, false, true], "a fault has latched");
        rig.board.at_stop(|stopped| stopped.set_emergency_stop(false));
        rig.pc.run_ms(&mut rig.board, 20);
        rig.comes_back_after(Fault::EmergencyStop);
        assert_eq!(lamps(&mut rig), [true, true, false], "a person has started it");
    }
}
