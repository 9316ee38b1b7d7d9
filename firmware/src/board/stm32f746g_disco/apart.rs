//! Futures polled by functions of their own.

use core::pin::Pin;
use core::task::{Context, Poll};

/// A pinned future whose temporaries are on the stack only while it is polled. Without, the compiler makes one function
/// of all that a task joins, with room for the temporaries of all at once; and a future that is handed on before it is
/// pinned is one of these temporaries as a whole.
pub struct Apart<'f, F>(pub Pin<&'f mut F>);

impl<F: Future> Future for Apart<'_, F> {
    type Output = F::Output;

    #[inline(never)]
    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<F::Output> {
        self.0.as_mut().poll(context)
    }
}
