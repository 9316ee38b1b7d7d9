//! Who uses the processor: ticks by task, what interrupts it left out.

use core::pin::Pin;
use core::sync::atomic::{AtomicUsize, Ordering};
use core::task::{Context, Poll};

use core::cell::RefCell;

use critical_section::Mutex;
use evtach_firmware::cost::Clock as _;

use crate::timers::Ticks;

/// Who may use it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum User {
    /// Nobody: the processor sleeps.
    Sleep,
    /// Reading the sensor.
    Acquire,
    /// Measuring.
    Measure,
    /// Drawing.
    Show,
    /// Answering.
    Link,
    /// Keeping preferences.
    Save,
    /// Executors, timers and the port's interrupt.
    System,
}

/// Every user, with the name under which it is printed.
pub const USERS: [(User, &str); 7] = [
    (User::Sleep, "sleep"),
    (User::Acquire, "acquire"),
    (User::Measure, "measure"),
    (User::Show, "show"),
    (User::Link, "link"),
    (User::Save, "save"),
    (User::System, "system"),
];

struct Account {
    ticks: [u64; USERS.len()],
    since: u64,
}

static NOW: AtomicUsize = AtomicUsize::new(User::System as usize);
static ACCOUNT: Mutex<RefCell<Account>> =
    Mutex::new(RefCell::new(Account { ticks: [0; USERS.len()], since: 0 }));

/// The processor goes to another user; returns who had it.
fn switch(to: usize) -> usize {
    critical_section::with(|cs| {
        let mut account = ACCOUNT.borrow_ref_mut(cs);
        let now = Ticks.ticks();
        let before = NOW.swap(to, Ordering::Relaxed);
        let spent = now - account.since;
        account.ticks[before] += spent;
        account.since = now;
        before
    })
}

/// Runs something on a user's account, whoever had the processor before.
pub fn charge<T>(user: User, work: impl FnOnce() -> T) -> T {
    let before = switch(user as usize);
    let result = work();
    switch(before);
    result
}

/// Ticks of every user so far, in the order of [`USERS`].
pub fn ticks() -> [u64; USERS.len()] {
    switch(NOW.load(Ordering::Relaxed));
    critical_section::with(|cs| ACCOUNT.borrow_ref(cs).ticks)
}

/// A task on its user's account.
pub async fn counted<F: Future>(user: User, task: F) -> F::Output {
    let mut task = core::pin::pin!(task);
    core::future::poll_fn(move |context: &mut Context<'_>| -> Poll<F::Output> {
        let task: Pin<&mut F> = task.as_mut();
        charge(user, || task.poll(context))
    })
    .await
}
