//! The USB port of the board: a serial port (CDC ACM) on the full-speed core.
#![allow(unsafe_code, reason = "an interrupt is unmasked, and the driver is given its core")]

use core::fmt::Write;
use firmware::port::{SerialPort, WouldBlock};
use firmware::timing;
use heapless::String;
use stm32f4xx_hal::gpio::{PA11, PA12};
use stm32f4xx_hal::otg_fs::{USB, UsbBus};
use stm32f4xx_hal::pac::{Interrupt, NVIC, OTG_FS_DEVICE, OTG_FS_GLOBAL, OTG_FS_PWRCLK};
use stm32f4xx_hal::rcc::Rcc;
use synopsys_usb_otg::UsbPeripheral;
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid};
use usbd_serial::{CdcAcmClass, USB_CLASS_CDC};

/// The bus of this board.
type Bus = UsbBus<Core>;

/// The HAL's core, whose transceiver has power before the driver resets it: the reset ends some of
/// the transceiver's clocks later (RM0090 34.16.2, `CSRST` and `PWRDWN`).
pub(crate) struct Core {
    /// Nobody else has its peripherals.
    _owned: USB,
}

impl Core {
    /// On the pins that it has on every board.
    pub(super) fn new(
        core: (OTG_FS_GLOBAL, OTG_FS_DEVICE, OTG_FS_PWRCLK),
        pins: (PA11, PA12),
        rcc: &Rcc,
    ) -> Self {
        Self { _owned: USB::new(core, pins, &rcc.clocks) }
    }
}

// SAFETY: the HAL's own constants, and its core is switched on as it does.
unsafe impl UsbPeripheral for Core {
    const REGISTERS: *const () = USB::REGISTERS;
    const HIGH_SPEED: bool = USB::HIGH_SPEED;
    const FIFO_DEPTH_WORDS: usize = USB::FIFO_DEPTH_WORDS;
    const ENDPOINT_COUNT: usize = USB::ENDPOINT_COUNT;

    fn enable() {
        USB::enable();
        // SAFETY: the driver has the core, and calls this before anything else.
        unsafe { &*OTG_FS_GLOBAL::ptr() }.gccfg().modify(|_, w| w.pwrdwn().set_bit());
    }

    fn ahb_frequency_hz(&self) -> u32 {
        timing::CORE_HZ
    }
}

/// The test identity of pid.codes. Its rule: anybody's, for tests in their own house, and never on
/// a device that is handed on, sold or manufactured. Who does that asks pid.codes for a product
/// number, free for open hardware, and writes it here and into the udev rule of
/// `docs/guide/hardware.md`. V-USB's shared 16C0:27DD is no alternative: its serial number has to
/// begin with a domain or an address that its maker owns.
const VENDOR_AND_PRODUCT: UsbVidPid = UsbVidPid(0x1209, 0x0001);
const MANUFACTURER: &str = "Needle insertion simulator";
const PRODUCT: &str = "Needle device";
/// Largest packet of a bulk endpoint at full speed.
const PACKET_BYTES: u16 = firmware::tasks::queues::PACKET_BYTES as u16;
/// Words for the packets that wait to be read: the control endpoint's and the port's, with room to
/// spare.
const RECEIVE_WORDS: usize = 64;
const SERIAL_CHARACTERS: usize = 24;

/// The port.
pub(crate) struct Port {
    device: UsbDevice<'static, Bus>,
    class: CdcAcmClass<'static, Bus>,
}

/// Memory of the driver.
pub(crate) struct Statics {
    memory: [u32; RECEIVE_WORDS],
    bus: Option<UsbBusAllocator<Bus>>,
    serial: String<SERIAL_CHARACTERS>,
}

impl Statics {
    /// Empty.
    pub(crate) const fn new() -> Self {
        Self { memory: [0; RECEIVE_WORDS], bus: None, serial: String::new() }
    }
}

/// Connects to the bus as a serial port whose name ends in `serial`. Its driver waits for the core
/// without a bound.
pub(crate) fn init(core: Core, serial: [u8; 12], statics: &'static mut Statics) -> Port {
    for byte in serial {
        // Two characters a byte: as many as there is room for.
        let _ = write!(statics.serial, "{byte:02X}");
    }
    let bus: &'static _ = statics.bus.insert(UsbBus::new(core, &mut statics.memory));
    let class = CdcAcmClass::new(bus, PACKET_BYTES);
    let strings = StringDescriptors::default()
        .manufacturer(MANUFACTURER)
        .product(PRODUCT)
        .serial_number(&statics.serial);
    let Ok(builder) = UsbDeviceBuilder::new(bus, VENDOR_AND_PRODUCT).strings(&[strings]) else {
        panic!("one set of strings is allowed")
    };
    Port { device: builder.device_class(USB_CLASS_CDC).build(), class }
}

/// True if the core's interrupt may come: not while there is no room for what it brings.
pub(crate) fn allow_interrupt(allowed: bool) {
    if allowed {
        // SAFETY: no critical section is built on masking this interrupt.
        unsafe { NVIC::unmask(Interrupt::OTG_FS) };
    } else {
        NVIC::mask(Interrupt::OTG_FS);
    }
}

impl SerialPort for Port {
    fn poll(&mut self) {
        self.device.poll(&mut [&mut self.class]);
    }

    fn is_configured(&self) -> bool {
        self.device.state() == UsbDeviceState::Configured
    }

    fn is_open(&self) -> bool {
        self.class.dtr()
    }

    fn read(&mut self, packet: &mut [u8]) -> Result<usize, WouldBlock> {
        self.class.read_packet(packet).map_err(|_| WouldBlock)
    }

    fn write(&mut self, packet: &[u8]) -> Result<(), WouldBlock> {
        self.class.write_packet(packet).map(drop).map_err(|_| WouldBlock)
    }
}
