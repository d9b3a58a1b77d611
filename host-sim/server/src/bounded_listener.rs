//! A TCP listener for axum that takes a limited number of connections and lets go of silent ones: a
//! thousand of them must not use up the program's file handles, its memory or the time of whoever
//! publishes to each.

use axum::serve::Listener;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep};

/// A connection on which nothing moves either way for so long is closed. A page or a stream is sent
/// something far more often.
const LONGEST_SILENCE: Duration = Duration::from_secs(30);
/// After a connection that could not be accepted (no file handles left).
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Takes at most so many connections at a time; one more is closed at once.
#[derive(Debug)]
pub(crate) struct BoundedListener {
    listener: TcpListener,
    places: Arc<Semaphore>,
    silence: Duration,
}

impl BoundedListener {
    /// `most` connections from `listener`.
    pub(crate) fn new(listener: TcpListener, most: usize) -> Self {
        Self { listener, places: Arc::new(Semaphore::new(most)), silence: LONGEST_SILENCE }
    }
}

impl Listener for BoundedListener {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        loop {
            let Ok((stream, address)) = self.listener.accept().await else {
                sleep(ACCEPT_PAUSE).await;
                continue;
            };
            let Ok(place) = self.places.clone().try_acquire_owned() else { continue };
            // Many small messages: each is wanted at once. Without it they come late, and that is
            // all.
            let _ = stream.set_nodelay(true);
            let silence = self.silence;
            let over = Box::pin(sleep(silence));
            return (Connection { stream, over, silence, _place: place }, address);
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection that ends by itself when nothing has moved for too long.
#[derive(Debug)]
pub(crate) struct Connection {
    stream: TcpStream,
    /// The time at which it has been silent for too long.
    over: Pin<Box<Sleep>>,
    silence: Duration,
    _place: OwnedSemaphorePermit,
}

impl Connection {
    fn something_moved(&mut self) {
        let over = Instant::now() + self.silence;
        self.over.as_mut().reset(over);
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if let Poll::Ready(read) = Pin::new(&mut self.stream).poll_read(context, buffer) {
            self.something_moved();
            return Poll::Ready(read);
        }
        // Everybody who holds a connection reads from it: that is where its silence is noticed.
        ready!(self.over.as_mut().poll(context));
        Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = ready!(Pin::new(&mut self.stream).poll_write(context, bytes));
        self.something_moved();
        Poll::Ready(written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::Router;
    use std::io::{Read, Write};
    use std::net::TcpStream as Client;

    /// Serves nothing to two at a time that may be silent for 300 ms, until the test ends.
    fn serve() -> SocketAddr {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let listener = runtime.block_on(TcpListener::bind("127.0.0.1:0")).unwrap();
        let mut bounded = BoundedListener::new(listener, 2);
        bounded.silence = Duration::from_millis(300);
        let address = bounded.local_addr().unwrap();
        std::thread::spawn(move || runtime.block_on(async { axum::serve(bounded, Router::new()).await }));
        address
    }

    fn answer(client: &mut Client) -> io::Result<String> {
        client.set_read_timeout(Some(Duration::from_secs(10)))?;
        client.write_all(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")?;
        let mut head = [0; 12];
        client.read_exact(&mut head)?;
        Ok(String::from_utf8_lossy(&head).into_owned())
    }

    #[test]
    fn one_too_many_is_closed_and_silence_makes_room() {
        let address = serve();
        let mut silent: Vec<Client> = (0..2).map(|_| Client::connect(address).unwrap()).collect();
        std::thread::sleep(Duration::from_millis(50));
        let mut third = Client::connect(address).unwrap();
        assert!(answer(&mut third).is_err(), "no room");
        let mut byte = [0];
        for client in &mut silent {
            client.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
            assert_eq!(client.read(&mut byte).unwrap(), 0, "closed for its silence");
        }
        let mut later = Client::connect(address).unwrap();
        assert_eq!(answer(&mut later).unwrap(), "HTTP/1.1 404");
    }
}
