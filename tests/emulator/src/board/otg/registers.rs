//! Offsets and bits of the USB on-the-go full-speed core, RM0090 section 34.16.
//!
//! Only what a device uses. Host-mode registers are stored and do nothing. Offsets count from
//! 0x5000_0000; widths are 32 bits throughout.

/// `OTG_FS_GOTGINT`.
pub(super) const GOTGINT: u64 = 0x004;
/// `OTG_FS_GAHBCFG`.
pub(super) const GAHBCFG: u64 = 0x008;
/// `OTG_FS_GRSTCTL`.
pub(super) const GRSTCTL: u64 = 0x010;
/// `OTG_FS_GINTSTS`.
pub(super) const GINTSTS: u64 = 0x014;
/// `OTG_FS_GINTMSK`.
pub(super) const GINTMSK: u64 = 0x018;
/// `OTG_FS_GRXSTSR`: the status word on top of the receive FIFO, looked at.
pub(super) const GRXSTSR: u64 = 0x01C;
/// `OTG_FS_GRXSTSP`: the same word, taken.
pub(super) const GRXSTSP: u64 = 0x020;
/// `OTG_FS_GRXFSIZ`.
pub(super) const GRXFSIZ: u64 = 0x024;
/// `OTG_FS_DIEPTXF0`.
pub(super) const DIEPTXF0: u64 = 0x028;
/// `OTG_FS_GCCFG`.
pub(super) const GCCFG: u64 = 0x038;
/// `OTG_FS_CID`.
pub(super) const CID: u64 = 0x03C;
/// `OTG_FS_DIEPTXF1`; the others follow every four bytes.
pub(super) const DIEPTXF1: u64 = 0x104;
/// `OTG_FS_DCFG`.
pub(super) const DCFG: u64 = 0x800;
/// `OTG_FS_DCTL`.
pub(super) const DCTL: u64 = 0x804;
/// `OTG_FS_DSTS`.
pub(super) const DSTS: u64 = 0x808;
/// `OTG_FS_DIEPMSK`.
pub(super) const DIEPMSK: u64 = 0x810;
/// `OTG_FS_DOEPMSK`.
pub(super) const DOEPMSK: u64 = 0x814;
/// `OTG_FS_DAINT`.
pub(super) const DAINT: u64 = 0x818;
/// `OTG_FS_DAINTMSK`.
pub(super) const DAINTMSK: u64 = 0x81C;
/// `OTG_FS_DIEPEMPMSK`.
pub(super) const DIEPEMPMSK: u64 = 0x834;
/// `OTG_FS_DIEPCTL0`; endpoint `n` is `n * ENDPOINT_STRIDE` further on.
pub(super) const DIEPCTL0: u64 = 0x900;
/// `OTG_FS_DOEPCTL0`.
pub(super) const DOEPCTL0: u64 = 0xB00;
/// The distance between two endpoints' registers.
pub(super) const ENDPOINT_STRIDE: u64 = 0x20;
/// `OTG_FS_PCGCCTL`.
pub(super) const PCGCCTL: u64 = 0xE00;
/// The first FIFO window; FIFO `n` is `n * FIFO_STRIDE` further on.
pub(super) const FIFO0: u64 = 0x1000;
/// The distance between two FIFO windows.
pub(super) const FIFO_STRIDE: u64 = 0x1000;

/// Within one endpoint: the control register.
pub(super) const EP_CTL: u64 = 0x00;
/// Within one endpoint: its interrupts.
pub(super) const EP_INT: u64 = 0x08;
/// Within one endpoint: its transfer size.
pub(super) const EP_TSIZ: u64 = 0x10;
/// Within one IN endpoint: the free words of its FIFO.
pub(super) const EP_TXFSTS: u64 = 0x18;

/// The bits of the global registers.
pub(super) mod global {
    pub(in crate::board::otg) const GAHBCFG_GINT: u32 = 1;
    pub(in crate::board::otg) const GRSTCTL_CSRST: u32 = 1;
    pub(in crate::board::otg) const GRSTCTL_RXFFLSH: u32 = 1 << 4;
    pub(in crate::board::otg) const GRSTCTL_TXFFLSH: u32 = 1 << 5;
    pub(in crate::board::otg) const GRSTCTL_AHBIDL: u32 = 1 << 31;
    /// The pseudo FIFO number that flushes every transmit FIFO.
    pub(in crate::board::otg) const TXFNUM_ALL: u32 = 0x10;
    pub(in crate::board::otg) const GCCFG_PWRDWN: u32 = 1 << 16;
    pub(in crate::board::otg) const GCCFG_NOVBUSSENS: u32 = 1 << 21;

    pub(in crate::board::otg) const SOF: u32 = 1 << 3;
    pub(in crate::board::otg) const RXFLVL: u32 = 1 << 4;
    pub(in crate::board::otg) const NPTXFE: u32 = 1 << 5;
    pub(in crate::board::otg) const ESUSP: u32 = 1 << 10;
    pub(in crate::board::otg) const USBSUSP: u32 = 1 << 11;
    pub(in crate::board::otg) const USBRST: u32 = 1 << 12;
    pub(in crate::board::otg) const ENUMDNE: u32 = 1 << 13;
    pub(in crate::board::otg) const IEPINT: u32 = 1 << 18;
    pub(in crate::board::otg) const OEPINT: u32 = 1 << 19;
    pub(in crate::board::otg) const WKUPINT: u32 = 1 << 31;
    /// The bits of `GINTSTS` that a written one clears; the others follow what they report.
    pub(in crate::board::otg) const GINTSTS_CLEARED_BY_ONE: u32 =
        SOF | ESUSP | USBSUSP | USBRST | ENUMDNE | WKUPINT | (0x3 << 14) | (0x3 << 20) | (0x7 << 28);
}

/// The bits of the device registers.
pub(super) mod device {
    pub(in crate::board::otg) const DCTL_SDIS: u32 = 1 << 1;
    /// Endpoint control: the endpoint takes part in the configuration.
    pub(in crate::board::otg) const USBAEP: u32 = 1 << 15;
    /// Endpoint control, read only: every token is answered with a NAK.
    pub(in crate::board::otg) const NAKSTS: u32 = 1 << 17;
    pub(in crate::board::otg) const STALL: u32 = 1 << 21;
    pub(in crate::board::otg) const CNAK: u32 = 1 << 26;
    pub(in crate::board::otg) const SNAK: u32 = 1 << 27;
    pub(in crate::board::otg) const SD0PID: u32 = 1 << 28;
    pub(in crate::board::otg) const SODDFRM: u32 = 1 << 29;
    pub(in crate::board::otg) const EPDIS: u32 = 1 << 30;
    pub(in crate::board::otg) const EPENA: u32 = 1 << 31;

    /// Endpoint interrupt: transfer completed.
    pub(in crate::board::otg) const XFRC: u32 = 1;
    /// Endpoint interrupt: endpoint disabled.
    pub(in crate::board::otg) const EPDISD: u32 = 1 << 1;
    /// OUT endpoint interrupt: SETUP phase done.
    pub(in crate::board::otg) const STUP: u32 = 1 << 3;
    /// IN endpoint interrupt: a token came while the FIFO was empty.
    pub(in crate::board::otg) const ITTXFE: u32 = 1 << 4;
    /// IN endpoint interrupt: the FIFO is empty. Read only.
    pub(in crate::board::otg) const TXFE: u32 = 1 << 7;
}

/// `PKTSTS` of a status word: an OUT packet.
pub(super) const PKTSTS_OUT_DATA: u32 = 0b0010;
/// `PKTSTS`: an OUT transfer is complete.
pub(super) const PKTSTS_OUT_COMPLETE: u32 = 0b0011;
/// `PKTSTS`: a SETUP transaction is complete.
pub(super) const PKTSTS_SETUP_COMPLETE: u32 = 0b0100;
/// `PKTSTS`: a SETUP packet.
pub(super) const PKTSTS_SETUP_DATA: u32 = 0b0110;
