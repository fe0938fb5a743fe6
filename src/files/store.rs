//! Where recordings are read and results are kept: a folder, or an object store.
//!
//! A store is flat: objects by paths with `/`, each appearing whole or not at all. [`Store::create`] writes an object if none exists,
//! in one step for all who write at once; all that several workers agree on rests on it. The object stores need the feature `cloud`, and
//! `store/remote.rs` alone knows their library.

mod folder;
#[cfg(feature = "cloud")]
mod remote;

use std::path::{Path, PathBuf};

use folder::Folder;
#[cfg(feature = "cloud")]
use remote::Remote;

/// Folders below a prefix that are looked through for what killed writers left: reports stand two below theirs.
const DEEPEST: usize = 4;

/// An object in a list.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Object {
    /// Its path in the store.
    pub path: String,
    /// Its size.
    pub bytes: u64,
}

/// Why a store did not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// No address of a store.
    #[error("{address}: {words}")]
    Address {
        /// What was given, without what may be a secret.
        address: String,
        /// What is wrong with it.
        words: String,
    },
    /// There is no such object.
    #[error("{object}: there is no such object")]
    Absent {
        /// Store and path.
        object: String,
    },
    /// The store, or the way to it, refuses.
    #[error("{object}: cannot {what}: {reason}")]
    Refused {
        /// Store and path.
        object: String,
        /// What was to be done.
        what: &'static str,
        /// The store's own words.
        reason: String,
    },
}

/// A folder or an object store.
#[derive(Debug)]
pub struct Store(StoreKind);

#[derive(Debug)]
enum StoreKind {
    Folder(Folder),
    #[cfg(feature = "cloud")]
    Remote(Remote),
}

/// Runs a method of whichever store it is.
macro_rules! either {
    ($self:expr, $store:ident => $call:expr) => {
        match &$self.0 {
            StoreKind::Folder($store) => $call,
            #[cfg(feature = "cloud")]
            StoreKind::Remote($store) => $call,
        }
    };
}

impl Store {
    /// Opens a folder by its path, or an object store by its address: `s3://BUCKET/PREFIX`, `gs://…`, `az://CONTAINER/…` or `file://`.
    /// Credentials and endpoints come from the environment, by the variables that the stores' own tools use.
    ///
    /// # Errors
    /// Where it is no address, holds credentials, or is of a store that this build does not know. A folder need not exist.
    pub fn open(address: &str) -> Result<Self, StoreError> {
        let Some((scheme, rest)) = address.split_once("://") else {
            return Ok(Self(StoreKind::Folder(Folder::new(PathBuf::from(address)))));
        };
        let host = rest.split('/').next().unwrap_or_default();
        let wrong = |words: String| StoreError::Address { address: format!("{scheme}://…"), words };
        if host.contains('@') || rest.contains('?') {
            let words = "an address holds no credentials and no query; set the variables of the environment that the store's own tools read";
            return Err(wrong(words.to_owned()));
        }
        match scheme {
            "file" => Ok(Self(StoreKind::Folder(Folder::new(PathBuf::from(rest))))),
            "s3" | "s3a" | "gs" | "az" => Self::remote(address),
            _ => Err(wrong("expected a folder, or an address with s3://, gs:// or az://".to_owned())),
        }
    }

    #[cfg(feature = "cloud")]
    fn remote(address: &str) -> Result<Self, StoreError> {
        Remote::open(address).map(|remote| Self(StoreKind::Remote(remote)))
    }

    #[cfg(not(feature = "cloud"))]
    fn remote(address: &str) -> Result<Self, StoreError> {
        let words = "object stores are not in this build, which was made without the cargo feature `cloud`; `cargo install --path . --features \
                     cloud` makes one that has them";
        Err(StoreError::Address { address: address.to_owned(), words: words.to_owned() })
    }

    /// The folder or address, for people and for plans.
    #[must_use]
    pub fn address(&self) -> String {
        either!(self, store => store.address())
    }

    /// Where an object is on this machine; none in an object store.
    #[must_use]
    pub fn local(&self, path: &str) -> Option<PathBuf> {
        match &self.0 {
            StoreKind::Folder(folder) => Some(folder.path(path)),
            #[cfg(feature = "cloud")]
            StoreKind::Remote(_) => None,
        }
    }

    /// All objects below a prefix, by path; none where nothing is there. Hidden files are not among them.
    ///
    /// # Errors
    /// Where the store refuses.
    pub fn list(&self, prefix: &str) -> Result<Vec<Object>, StoreError> {
        let mut all = either!(self, store => store.list(prefix))?;
        all.sort();
        Ok(all)
    }

    /// Whether there is an object.
    ///
    /// # Errors
    /// Where the store refuses.
    pub fn has(&self, path: &str) -> Result<bool, StoreError> {
        either!(self, store => store.has(path))
    }

    /// The bytes of an object.
    ///
    /// # Errors
    /// Where it is not there, or the store refuses.
    pub fn get(&self, path: &str) -> Result<Vec<u8>, StoreError> {
        either!(self, store => store.get(path))
    }

    /// Up to `len` bytes of an object from `at` on, and the size of the whole.
    ///
    /// # Errors
    /// Where it is not there, the store refuses, or the part begins behind the end: then a store may refuse or give nothing.
    pub fn part(&self, path: &str, at: u64, len: u64) -> Result<(Vec<u8>, u64), StoreError> {
        either!(self, store => store.part(path, at, len))
    }

    /// Copies an object into a file, piece by piece.
    ///
    /// # Errors
    /// Where it is not there, the store refuses, or the file cannot be written.
    pub fn fetch(&self, path: &str, to: &Path) -> Result<(), StoreError> {
        either!(self, store => store.fetch(path, to))
    }

    /// Writes an object, replacing an existing one.
    ///
    /// # Errors
    /// Where the store refuses; an existing object is then untouched.
    pub fn put(&self, path: &str, bytes: &[u8]) -> Result<(), StoreError> {
        either!(self, store => store.put(path, bytes))
    }

    /// Writes an object if none exists; returns whether it did. Of several who do so at once, one does.
    ///
    /// # Errors
    /// Where the store refuses, or does not know how.
    pub fn create(&self, path: &str, bytes: &[u8]) -> Result<bool, StoreError> {
        either!(self, store => store.create(path, bytes))
    }

    /// Removes an object; one that is not there is no error.
    ///
    /// # Errors
    /// Where the store refuses.
    pub fn remove(&self, path: &str) -> Result<(), StoreError> {
        either!(self, store => store.remove(path))
    }

    /// Removes what killed writers left under temporary names among the objects of a prefix, where that is a store's business.
    pub fn tidy(&self, prefix: &str) {
        if let Some(folder) = self.local(prefix) {
            crate::remove_stale(&folder);
            folder::tidy_below(&folder, DEEPEST);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_with_a_secret_is_refused_without_showing_it() {
        for address in ["s3://key:hidden@bucket/x", "az://box/x?sig=hidden"] {
            let error = Store::open(address).unwrap_err().to_string();
            assert!(error.contains("holds no credentials") && !error.contains("hidden"), "{error}");
        }
        assert!(Store::open("ftp://host/x").unwrap_err().to_string().contains("s3://"));
        assert_eq!(Store::open("file:///a/b").unwrap().address(), "/a/b");
    }

    #[cfg(not(feature = "cloud"))]
    #[test]
    fn a_build_without_object_stores_says_which_has_them() {
        let error = Store::open("s3://bucket/x").unwrap_err().to_string();
        assert!(error.contains("s3://bucket/x") && error.contains("--features cloud"), "{error}");
    }
}
