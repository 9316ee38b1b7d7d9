//! Time under test: it stands still while anything is worked on, and passes while everything waits. So a machine that is
//! busy elsewhere changes nothing.

use core::future::Future;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use std::sync::{Mutex, PoisonError};

use embassy_time::{Duration, MockDriver};

/// Time that passes when everything waits.
const STEP: Duration = Duration::from_micros(50);

/// There is one time for all threads, so that one test has it at a time.
static ONE: Mutex<()> = Mutex::new(());

/// Runs a future to its end. Instants mean something within one run only.
pub fn block_on<T>(future: impl Future<Output = T>) -> T {
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut context) {
            return value;
        }
        MockDriver::get().advance(STEP);
    }
}
