//! Requests that the database answers together.

use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::oneshot;

use super::{JobStore, Result, StoreError};

/// Most requests that are answered together.
const MOST_AT_ONCE: usize = 256;

/// Requests that wait for the database: all that come while the ones before are being answered are the next to
/// be answered. Each is answered by what begins after it has come, so that it sees all that was written before.
#[derive(Debug)]
pub(super) struct Gathered<Q, A> {
    waiting: Arc<Mutex<Vec<Waiting<Q, A>>>>,
    /// Held by whoever answers.
    turn: Arc<tokio::sync::Mutex<()>>,
}

#[derive(Debug)]
struct Waiting<Q, A> {
    request: Q,
    answer: oneshot::Sender<Result<A>>,
}

impl<Q, A> Clone for Gathered<Q, A> {
    fn clone(&self) -> Self {
        Self { waiting: self.waiting.clone(), turn: self.turn.clone() }
    }
}

impl<Q, A> Default for Gathered<Q, A> {
    fn default() -> Self {
        Self { waiting: Arc::default(), turn: Arc::default() }
    }
}

impl<Q: Send + Sync + 'static, A: Send + 'static> Gathered<Q, A> {
    /// Has a request answered by `all`, which gets a batch of them in the order in which they came, and returns their
    /// answers in that order. If it fails it gets each alone, for the fault may be one request's.
    pub async fn answer<F, Answers>(&self, store: &JobStore, request: Q, all: F) -> Result<A>
    where
        F: Fn(JobStore, Arc<Vec<Q>>) -> Answers + Send + Sync + 'static,
        Answers: Future<Output = Result<Vec<A>>> + Send,
    {
        let (answer, answered) = oneshot::channel();
        let first = {
            let mut waiting = self.waiting();
            waiting.push(Waiting { request, answer });
            waiting.len() == 1
        };
        if first {
            // In a task of its own, which goes on for the others if this client leaves.
            let (gathered, store) = (self.clone(), store.clone());
            tokio::spawn(async move {
                let _turn = gathered.turn.lock().await;
                let _left = Left(&gathered);
                while gathered.answer_some(&store, &all).await {}
            });
        }
        answered.await.unwrap_or_else(|_| Err(StoreError::Database(sqlx::Error::WorkerCrashed)))
    }

    /// Answers those that wait, but for what is too much at once. Returns whether there were any.
    async fn answer_some<F, Answers>(&self, store: &JobStore, all: &F) -> bool
    where
        F: Fn(JobStore, Arc<Vec<Q>>) -> Answers,
        Answers: Future<Output = Result<Vec<A>>>,
    {
        let (requests, answers): (Vec<Q>, Vec<_>) = {
            let mut waiting = self.waiting();
            let most = waiting.len().min(MOST_AT_ONCE);
            waiting.drain(..most).map(|one| (one.request, one.answer)).unzip()
        };
        if requests.is_empty() {
            return false;
        }
        let requests = Arc::new(requests);
        // A client that has left needs no answer.
        match all(store.clone(), requests.clone()).await {
            Ok(found) => answers.into_iter().zip(found).for_each(|(answer, found)| drop(answer.send(Ok(found)))),
            Err(error) if answers.len() == 1 || JobStore::is_away(&error) => {
                // Alone each would wait for the database again, one after another.
                let same = std::iter::repeat_with(|| StoreError::Database(sqlx::Error::PoolTimedOut));
                for (answer, error) in answers.into_iter().zip(std::iter::once(error).chain(same)) {
                    let _ = answer.send(Err(error));
                }
            }
            Err(_) => {
                let requests = Arc::into_inner(requests).expect("the batch has ended");
                for (request, answer) in requests.into_iter().zip(answers) {
                    let alone = all(store.clone(), Arc::new(vec![request])).await;
                    let _ = answer.send(alone.map(|mut answers| answers.remove(0)));
                }
            }
        }
        true
    }

    fn waiting(&self) -> std::sync::MutexGuard<'_, Vec<Waiting<Q, A>>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Gives up those that wait when whoever answers panics: nobody else would, and none that comes later would be the
/// first.
struct Left<'a, Q, A>(&'a Gathered<Q, A>);

impl<Q, A> Drop for Left<'_, Q, A> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.waiting.lock().unwrap_or_else(PoisonError::into_inner).clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    async fn store() -> (tempfile::TempDir, JobStore) {
        let dir = tempfile::tempdir().unwrap();
        let store = JobStore::open(&dir.path().join("jobs.db")).await.unwrap();
        (dir, store)
    }

    /// Answers with the request and the size of its batch; fails with a batch that has a 13.
    async fn all(_: JobStore, batch: Arc<Vec<u32>>) -> Result<Vec<(u32, usize)>> {
        tokio::time::sleep(Duration::from_millis(20)).await;
        match batch.contains(&13) {
            true => Err(StoreError::Database(sqlx::Error::RowNotFound)),
            false if batch.contains(&666) => panic!("planted"),
            false => Ok(batch.iter().map(|&request| (request, batch.len())).collect()),
        }
    }

    #[tokio::test]
    async fn each_request_gets_its_answer_and_a_fault_is_one_requests_alone() {
        let (_dir, store) = store().await;
        let gathered = Gathered::default();
        let asked = (0..600).map(|request| {
            let (gathered, store) = (gathered.clone(), store.clone());
            tokio::spawn(async move { (request, gathered.answer(&store, request, all).await) })
        });
        let mut together = 0;
        for asked in asked.collect::<Vec<_>>() {
            match asked.await.unwrap() {
                (13, answer) => assert!(matches!(answer, Err(StoreError::Database(sqlx::Error::RowNotFound)))),
                (request, answer) => {
                    let (answered, batch) = answer.unwrap();
                    assert_eq!(answered, request);
                    together = together.max(batch);
                }
            }
        }
        assert!(together > 100 && together <= MOST_AT_ONCE, "{together} in one batch");
    }

    #[tokio::test]
    async fn a_client_that_leaves_takes_no_answer_from_others() {
        let (_dir, store) = store().await;
        let gathered = Gathered::default();
        let leaves = tokio::time::timeout(Duration::from_millis(1), gathered.answer(&store, 1, all));
        let (left, stays) = tokio::join!(leaves, gathered.answer(&store, 2, all));
        assert!(left.is_err());
        assert_eq!(stays.unwrap().0, 2);
    }

    #[tokio::test]
    async fn a_panic_is_an_error_for_those_that_wait_and_for_nobody_after() {
        let (_dir, store) = store().await;
        let gathered = Gathered::default();
        let waits = async {
            tokio::time::sleep(Duration::from_millis(10)).await;
            gathered.answer(&store, 2, all).await
        };
        let (panics, waits) = tokio::join!(gathered.answer(&store, 666, all), waits);
        assert!(panics.is_err() && waits.is_err());
        assert_eq!(gathered.answer(&store, 3, all).await.unwrap(), (3, 1));
    }
}
