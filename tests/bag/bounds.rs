//! What a bag says of itself costs no more than what it holds, and leads nowhere else.

use std::fs;
use std::path::PathBuf;

use govtwin_bag::{self as bag, BagError, ReadOptions, Warning};
use mcap::WriteOptions;

use super::make::{All, BEGIN_NS, Bag, MS};

/// A folder with a bag and `metadata.yaml` that names these files.
fn folder(names: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.mcap"), Bag::standard(2).bytes(WriteOptions::new())).unwrap();
    let list: String = names.iter().map(|name| format!("    - {name}\n")).collect();
    let text = format!("rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths:\n{list}");
    fs::write(folder.path().join("metadata.yaml"), text).unwrap();
    folder
}

/// A folder of somebody else, with a bag and a secret.
fn strangers() -> (tempfile::TempDir, PathBuf, PathBuf) {
    let other = tempfile::tempdir().unwrap();
    let [outside, secret] = ["outside.mcap", "secret"].map(|name| other.path().join(name));
    fs::write(&outside, Bag::standard(5).bytes(WriteOptions::new())).unwrap();
    fs::write(&secret, "root:x:0:0:very secret\n").unwrap();
    (other, outside, secret)
}

#[test]
fn a_file_that_is_named_again_is_read_once() {
    let many = vec!["a.mcap"; 2000];
    for names in [&many[..], &["a.mcap", "./a.mcap", "sub/a.mcap"]] {
        let folder = folder(names);
        let survey = bag::survey(folder.path()).unwrap();
        assert_eq!((survey.files.len(), survey.messages), (1, 2 * 200 + 2 + 40), "{names:?}");
    }
}

#[test]
fn names_that_lead_out_of_the_folder_are_not_followed() {
    let (other, outside, secret) = strangers();
    for name in [outside.to_str().unwrap(), "../outside.mcap", "sub/../../outside.mcap", secret.to_str().unwrap()] {
        let folder = folder(&["a.mcap", name]);
        let loaded = bag::read(folder.path(), &ReadOptions::default()).unwrap();
        assert_eq!(loaded.health.files.len(), 1, "{name}");
        assert!(
            loaded
                .health
                .warnings
                .iter()
                .any(|warning| matches!(warning, Warning::Metadata { problem } if problem.contains("outside")))
        );
    }
    let alone = folder(&["../outside.mcap"]);
    fs::remove_file(alone.path().join("a.mcap")).unwrap();
    let error = bag::survey(alone.path()).unwrap_err().to_string();
    assert!(error.contains("outside of the bag's folder"), "{error}");
    // Linked folders are names as well.
    #[cfg(unix)]
    {
        let folder = folder(&["a.mcap", "linked/outside.mcap"]);
        std::os::unix::fs::symlink(other.path(), folder.path().join("linked")).unwrap();
        assert_eq!(bag::read(folder.path(), &ReadOptions::default()).unwrap().health.files.len(), 1);
    }
}

/// As archives of large files keep them; what is no bag is not quoted.
#[cfg(unix)]
#[test]
fn a_file_linked_into_the_folder_is_read() {
    let (_other, outside, secret) = strangers();
    for names in [&["link.mcap"][..], &[]] {
        let folder = if names.is_empty() { tempfile::tempdir().unwrap() } else { folder(names) };
        std::os::unix::fs::symlink(&outside, folder.path().join("link.mcap")).unwrap();
        assert_eq!(bag::read(folder.path(), &ReadOptions::default()).unwrap().health.files.len(), 1, "{names:?}");
    }
    let folder = folder(&["link.mcap"]);
    std::os::unix::fs::symlink(&secret, folder.path().join("link.mcap")).unwrap();
    for path in [folder.path().to_owned(), folder.path().join("link.mcap")] {
        let error = bag::read(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("not a bag") && !error.contains("root:") && !error.contains("72, 6f"), "{error}");
    }
}

#[test]
fn hours_between_rows_are_not_simulated() {
    for (rows, step_s, refused) in [(3000_i64, 590, true), (3000, 9, true), (3000, 3, false), (100, 60, false)] {
        let mut bag = Bag::default();
        for row in 0..rows {
            let time_ns = BEGIN_NS + row * step_s * 1000 * MS;
            bag.esv(time_ns, 1);
            bag.pressure(time_ns, 6.3e6);
            bag.command(time_ns, 0.3);
            bag.servo(time_ns, 0.0, 0.3);
        }
        let (_folder, path) = bag.file(WriteOptions::new());
        let mut all = All::default();
        let found = [
            bag::read(&path, &ReadOptions::default()).map(drop),
            bag::read_rows(&path, &ReadOptions::default(), &mut all).map(drop),
        ];
        for found in found {
            match found {
                Ok(()) => assert!(!refused, "{rows} rows, {step_s} s apart"),
                Err(error) => assert!(refused && matches!(error, BagError::TooManyRows { .. }), "{error}"),
            }
        }
    }
}

#[cfg(feature = "sqlite")]
#[test]
fn views_and_computed_columns_are_refused() {
    let endless = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c)";
    let topics = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)";
    let messages = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)";
    for sql in [
        format!(
            "{topics}; CREATE VIEW messages AS {endless} SELECT x AS id, 1 AS topic_id, x AS timestamp, x'00' AS data FROM c"
        ),
        format!(
            "{messages}; CREATE VIEW topics AS {endless} SELECT x AS id, 'a' AS name, 'b' AS type, 'cdr' AS serialization_format FROM c"
        ),
        format!(
            "{topics}; CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB GENERATED ALWAYS AS (zeroblob(900000000)))"
        ),
        format!(
            "{topics}; CREATE VIEW Messages AS {endless} SELECT x AS id, 1 AS topic_id, x AS timestamp, x'00' AS data FROM c"
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.db3");
        rusqlite::Connection::open(&path).unwrap().execute_batch(&sql).unwrap();
        let error = bag::survey(&path).unwrap_err();
        assert!(matches!(error, BagError::Database { .. }) && error.to_string().contains("plain table"), "{error}");
    }
}

#[test]
fn recovering_keeps_attachments_and_metadata() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("a.mcap");
    let mut file = std::io::Cursor::new(vec![]);
    let mut writer = WriteOptions::new().profile("ros2").create(&mut file).unwrap();
    let attached: Vec<(&str, Vec<u8>)> =
        vec![("plate.pdf", vec![7; 5000]), ("empty", vec![]), ("notes.txt", b"valve changed".to_vec())];
    for (name, data) in &attached {
        let attachment = mcap::Attachment {
            log_time: 1,
            create_time: 2,
            name: (*name).to_owned(),
            media_type: "text/plain".to_owned(),
            data: data.as_slice().into(),
        };
        writer.attach(&attachment).unwrap();
    }
    let values = std::collections::BTreeMap::from([("operator".to_owned(), "night shift".to_owned())]);
    writer.write_metadata(&mcap::records::Metadata { name: "plant".to_owned(), metadata: values.clone() }).unwrap();
    let yaml = "rosbag2_bagfile_information:\n  relative_file_paths: [a.mcap]\n  custom_data: {rig: bench 2}\n";
    let custom = std::collections::BTreeMap::from([("serialized_metadata".to_owned(), yaml.to_owned())]);
    writer.write_metadata(&mcap::records::Metadata { name: "rosbag2".to_owned(), metadata: custom }).unwrap();
    writer.add_channel(0, "/camera", "json", &values).unwrap();
    writer.finish().unwrap();
    drop(writer);
    fs::write(&source, file.into_inner()).unwrap();
    // With `metadata.yaml` beside it, that counts.
    fs::write(folder.path().join("metadata.yaml"), yaml.replace("bench 2", "bench 3")).unwrap();
    let beside = bag::recover(folder.path(), &folder.path().join("beside")).unwrap();
    assert!(
        fs::read_to_string(beside.bag.join("metadata.yaml")).unwrap().contains("  custom_data:\n    rig: bench 3\n")
    );
    let recovered = bag::recover(&source, &folder.path().join("new")).unwrap();
    assert_eq!(recovered.attachments, ["plate.pdf", "empty", "notes.txt"]);
    assert_eq!((recovered.metadata, recovered.lost), (vec!["plant".to_owned()], vec![]));
    let yaml = fs::read_to_string(recovered.bag.join("metadata.yaml")).unwrap();
    assert!(yaml.contains("  custom_data:\n    rig: bench 2\n"), "{yaml}");
    let new = fs::read_dir(&recovered.bag).unwrap().map(|entry| entry.unwrap().path());
    let new = new.into_iter().find(|path| path.extension().is_some_and(|suffix| suffix == "mcap")).unwrap();
    let bytes = fs::read(new).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.attachment_indexes.len(), 3);
    let camera = summary.channels.values().find(|channel| channel.topic == "/camera").unwrap();
    assert!(values.iter().all(|(key, value)| camera.metadata.get(key) == Some(value)), "{camera:?}");
    for (index, (name, data)) in summary.attachment_indexes.iter().zip(&attached) {
        let found = mcap::read::attachment(&bytes, index).unwrap();
        assert_eq!((found.name.as_str(), found.data.as_ref()), (*name, data.as_slice()));
    }
    let plant = summary.metadata_indexes.iter().find(|index| index.name == "plant").unwrap();
    assert_eq!(mcap::read::metadata(&bytes, plant).unwrap().metadata, values);
}
