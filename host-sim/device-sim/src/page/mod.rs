//! The messages between a session and its page, over a socket or within a browser: [`messages`],
//! and [`condense`], which reduces 10 kHz to what a picture needs.

pub mod condense;
pub mod guide;
pub mod messages;
