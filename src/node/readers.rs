//! The tasks that read, over whatever middleware.

use std::borrow::Cow;

use tokio::sync::Mutex;
use tokio::task::JoinSet;

/// Tasks that read; each ends with the name of what it read.
pub(super) type Readers = JoinSet<Cow<'static, str>>;

/// Resolves, with a reason, when something that reads has ended.
pub(super) async fn ended(readers: &Mutex<Readers>) -> String {
    match readers.lock().await.join_next().await {
        Some(Ok(topic)) => format!("reading {topic} has ended"),
        Some(Err(failure)) => failure.to_string(),
        None => "nothing reads".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use std::panic::resume_unwind;

    use super::*;

    #[tokio::test]
    async fn what_has_ended_is_named() {
        let readers = Mutex::new(Readers::new());
        assert_eq!(ended(&readers).await, "nothing reads");
        readers.lock().await.spawn(async { "/tf".into() });
        assert_eq!(ended(&readers).await, "reading /tf has ended");
        readers.lock().await.spawn(async { resume_unwind(Box::new("died")) });
        assert!(ended(&readers).await.contains("panic"));
    }
}
