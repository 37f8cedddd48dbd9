//! Ctrl-C and SIGTERM as requests to end gracefully.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Resolves at the first SIGINT or SIGTERM. After this call neither kills the process any more.
#[cfg(unix)]
pub fn requested() -> io::Result<impl Future<Output = ()> + Send> {
    use tokio::signal::unix::{SignalKind, signal};
    let (mut interrupt, mut terminate) = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
    })
}

/// Resolves at the first Ctrl-C.
#[cfg(not(unix))]
pub fn requested() -> io::Result<impl Future<Output = ()> + Send> {
    Ok(async {
        // Without a console nobody can press the keys.
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    })
}

/// A flag that is set at the first request, for code without a runtime.
pub fn flag() -> io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = flag.clone();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let request = {
        let _guard = runtime.enter();
        requested()?
    };
    std::thread::spawn(move || {
        runtime.block_on(request);
        raised.store(true, Ordering::Relaxed);
    });
    Ok(flag)
}
