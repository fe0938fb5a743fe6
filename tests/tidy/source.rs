//! The project's own text files, and Rust code without what the rules must not see.

use std::path::Path;

/// A file of the project.
#[derive(Clone, Debug)]
pub struct Source {
    /// Path from the project's top, with `/`.
    pub path: String,
    /// Its text.
    pub text: String,
}

impl Source {
    /// A file that is not on disk, for trying a rule.
    pub fn new(path: &str, text: &str) -> Self {
        Self { path: path.to_owned(), text: text.to_owned() }
    }

    /// Lines of code with their numbers, without comments and without the unit tests that end a file.
    pub fn code(&self) -> impl Iterator<Item = (usize, &str)> {
        let begins =
            ["\n#[cfg(test)]\nmod ", "\n#[cfg(test)]\npub(super) mod ", "\n#[cfg(all(test, feature = \"lab\"))]\nmod "]
                .map(|head| self.text.find(head));
        let tests = begins.into_iter().flatten().min().unwrap_or(self.text.len());
        let own = self.text.get(..tests).unwrap_or_default();
        own.lines()
            .enumerate()
            .map(|(index, line)| (index + 1, line))
            .filter(|(_, line)| !line.trim_start().starts_with("//"))
            .map(|(number, line)| (number, line.split(" // ").next().unwrap_or(line)))
    }

    /// Whether the file stands at `place` or, where that ends in `/`, below it.
    pub fn is_at(&self, place: &str) -> bool {
        if place.ends_with('/') { self.path.starts_with(place) } else { self.path == place }
    }
}

/// Every text file of the project that people write; what is built, downloaded or recorded is left out.
pub fn tree() -> Vec<Source> {
    let top = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    walk(top, "", &mut files);
    assert!(files.iter().any(|file| file.path == "src/lib.rs"), "the walk found the sources");
    files
}

fn walk(folder: &Path, prefix: &str, files: &mut Vec<Source>) {
    const LEFT_OUT: [&str; 9] =
        [".git", "target", "out", "vendor", "Cargo.lock", "fuzz/target", "fuzz/corpus", "fuzz/artifacts", ".venv"];
    let mut entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(Result::unwrap).collect();
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if LEFT_OUT.contains(&name.as_str()) {
            continue;
        }
        if entry.file_type().unwrap().is_dir() {
            walk(&entry.path(), &format!("{name}/"), files);
        } else if let Ok(text) = std::fs::read_to_string(entry.path()) {
            files.push(Source { path: name, text });
        }
    }
}

#[test]
fn code_is_without_comments_and_tests() {
    let source = Source::new("src/a.rs", "//! Head.\nuse x; // why\n\n#[cfg(test)]\nmod tests {\n    use y;\n}\n");
    assert_eq!(source.code().collect::<Vec<_>>(), [(2, "use x;")]);
}
