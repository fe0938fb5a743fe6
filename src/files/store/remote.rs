//! Object stores over the network, by Apache Arrow's `object_store`: the only file that knows it, and its runtime.
//!
//! Credentials, regions and endpoints come from the environment alone, by the variables that the stores' own tools read, and no error
//! shows a query, where signatures stand.

use std::future::Future;
use std::io::Write as _;
use std::path::Path as FilePath;
use std::sync::Arc;

use futures::TryStreamExt as _;
use object_store::aws::AmazonS3Builder;
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::path::Path;
use object_store::{GetOptions, ObjectStore, ObjectStoreExt as _, PutMode, PutPayload};
use tokio::runtime::{Builder, Runtime};

use super::{Object, StoreError};

/// Threads that requests run on; who waits for one waits on a thread of its own.
const THREADS: usize = 2;

/// A bucket or container, below a prefix.
#[derive(Debug)]
pub(crate) struct Remote {
    address: String,
    prefix: String,
    store: Arc<dyn ObjectStore>,
    runtime: Runtime,
}

impl Remote {
    /// Opens a store by an address with `s3://`, `gs://` or `az://`; nothing is asked of it yet.
    pub fn open(address: &str) -> Result<Self, StoreError> {
        let address = address.trim_end_matches('/').to_owned();
        let wrong = |words: String| StoreError::Address { address: address.clone(), words: without_queries(&words) };
        let (scheme, rest) = address.split_once("://").unwrap_or_default();
        let (bucket, prefix) = rest.split_once('/').unwrap_or((rest, ""));
        if bucket.is_empty() {
            return Err(wrong("expected the name of a bucket behind ://".to_owned()));
        }
        let prefix = prefix.trim_matches('/').to_owned();
        let failed = |error: object_store::Error| wrong(error.to_string());
        let store: Arc<dyn ObjectStore> = match scheme {
            "s3" | "s3a" => Arc::new(AmazonS3Builder::from_env().with_bucket_name(bucket).build().map_err(failed)?),
            "gs" => Arc::new(GoogleCloudStorageBuilder::from_env().with_bucket_name(bucket).build().map_err(failed)?),
            _ => Arc::new(MicrosoftAzureBuilder::from_env().with_container_name(bucket).build().map_err(failed)?),
        };
        let runtime = Builder::new_multi_thread().worker_threads(THREADS).enable_all().build();
        let runtime = runtime.map_err(|error| wrong(error.to_string()))?;
        Ok(Self { address, prefix, store, runtime })
    }

    pub fn address(&self) -> String {
        self.address.clone()
    }

    fn path(&self, path: &str) -> Path {
        self.prefix.split('/').chain(path.split('/')).filter(|part| !part.is_empty()).collect()
    }

    fn run<T>(
        &self,
        path: &str,
        what: &'static str,
        work: impl Future<Output = Result<T, object_store::Error>>,
    ) -> Result<T, StoreError> {
        let object = format!("{}/{path}", self.address);
        self.runtime.block_on(work).map_err(|error| match error {
            object_store::Error::NotFound { .. } => StoreError::Absent { object },
            error => StoreError::Refused { object, what, reason: reason(&error) },
        })
    }

    pub fn list(&self, prefix: &str) -> Result<Vec<Object>, StoreError> {
        let top = self.path(prefix);
        let all = self.run(prefix, "list the objects", self.store.list(Some(&top)).try_collect::<Vec<_>>())?;
        let own = format!("{}/", self.path(""));
        let relative = |path: &str| {
            if self.prefix.is_empty() { path.to_owned() } else { path.strip_prefix(&own).unwrap_or(path).to_owned() }
        };
        let objects = all.into_iter().map(|meta| Object { path: relative(meta.location.as_ref()), bytes: meta.size });
        Ok(objects.filter(|object| object.path.split('/').all(|part| !part.starts_with('.'))).collect())
    }

    pub fn has(&self, path: &str) -> Result<bool, StoreError> {
        match self.run(path, "look", self.store.head(&self.path(path))) {
            Ok(_) => Ok(true),
            Err(StoreError::Absent { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    pub fn get(&self, path: &str) -> Result<Vec<u8>, StoreError> {
        let at = self.path(path);
        let bytes = self.run(path, "read", async { self.store.get(&at).await?.bytes().await })?;
        Ok(bytes.to_vec())
    }

    pub fn part(&self, path: &str, at: u64, len: u64) -> Result<(Vec<u8>, u64), StoreError> {
        let place = self.path(path);
        let options = GetOptions::new().with_range(Some(at..at.saturating_add(len)));
        let read = async {
            let part = self.store.get_opts(&place, options).await?;
            let whole = part.meta.size;
            Ok((part.bytes().await?.to_vec(), whole))
        };
        self.run(path, "read", read)
    }

    pub fn fetch(&self, path: &str, to: &FilePath) -> Result<(), StoreError> {
        let refused = |error: std::io::Error| StoreError::Refused {
            object: to.display().to_string(),
            what: "write",
            reason: error.to_string(),
        };
        let folder = to.parent().unwrap_or(FilePath::new("."));
        let mut file = tempfile::NamedTempFile::new_in(folder).map_err(refused)?;
        let at = self.path(path);
        let pieces = async {
            let mut pieces = self.store.get(&at).await?.into_stream();
            let mut failed = None;
            while let Some(piece) = pieces.try_next().await? {
                failed = failed.or(file.write_all(&piece).err());
            }
            Ok(failed)
        };
        match self.run(path, "read", pieces)? {
            Some(error) => Err(refused(error)),
            None => file.persist(to).map(drop).map_err(|error| refused(error.error)),
        }
    }

    pub fn put(&self, path: &str, bytes: &[u8]) -> Result<(), StoreError> {
        let payload = PutPayload::from(bytes.to_vec());
        self.run(path, "write", self.store.put(&self.path(path), payload)).map(drop)
    }

    pub fn create(&self, path: &str, bytes: &[u8]) -> Result<bool, StoreError> {
        let at = self.path(path);
        let write = async {
            let payload = PutPayload::from(bytes.to_vec());
            match self.store.put_opts(&at, payload, PutMode::Create.into()).await {
                Ok(_) => Ok(true),
                Err(object_store::Error::AlreadyExists { .. } | object_store::Error::Precondition { .. }) => Ok(false),
                Err(error) => Err(error),
            }
        };
        self.run(path, "write where nothing stands", write)
    }

    pub fn remove(&self, path: &str) -> Result<(), StoreError> {
        match self.run(path, "remove", self.store.delete(&self.path(path))) {
            Ok(()) | Err(StoreError::Absent { .. }) => Ok(()),
            Err(error) => Err(error),
        }
    }
}

/// The store's own message. A refusal has little text, and none for the question whether an object exists.
fn reason(error: &object_store::Error) -> String {
    let words = without_queries(error.to_string().trim_end_matches([':', ' ', '\n']));
    match error {
        object_store::Error::PermissionDenied { .. } | object_store::Error::Unauthenticated { .. } => {
            format!("{words}; check the credentials of the environment, what they allow, and this machine's clock")
        }
        _ => words,
    }
}

/// A text whose addresses end before their queries.
fn without_queries(text: &str) -> String {
    let cut = |word: &str| match word.split_once('?') {
        Some((address, _)) if address.contains("://") => format!("{address}?…"),
        _ => word.to_owned(),
    };
    text.split(' ').map(cut).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_show_no_signature() {
        let text = "failed at https://box.example/x?sv=1&sig=hidden, twice? yes";
        assert_eq!(without_queries(text), "failed at https://box.example/x?… twice? yes");
    }

    #[test]
    fn a_refusal_names_what_can_be_checked() {
        let path = "x".to_owned();
        let refused = reason(&object_store::Error::PermissionDenied { path, source: "403 Forbidden: ".into() });
        assert!(refused.contains("403 Forbidden; check the credentials") && refused.contains("clock"), "{refused}");
        assert!(
            !reason(&object_store::Error::NotImplemented { operation: "x".into(), implementer: "y".into() })
                .contains("clock")
        );
    }

    #[test]
    fn an_address_without_a_bucket_is_refused() {
        assert!(Remote::open("s3:///x").unwrap_err().to_string().contains("expected the name of a bucket"));
    }
}
