//! Options that make no sense together.

use super::{assert_refused_as_bad, evtach, folder};

/// Nothing is written where the truth would lie upon the recording.
#[test]
fn a_truth_is_not_written_over_its_recording() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("sub")).expect("room on the disk");
    let out = folder.path().join("fan.raw");
    let names = [out.clone(), folder.path().join("sub").join("..").join("fan.raw")];
    for was in [None, Some(b"what was there")] {
        if let Some(bytes) = was {
            std::fs::write(&out, bytes).expect("room on the disk");
        }
        for truth in names.each_ref().map(|name| name.display().to_string()) {
            let out = out.display().to_string();
            let run = evtach(&["synth", &out, "--truth", &truth, "--duration-ms", "5"], b"");
            assert_refused_as_bad(&run, "is the same file as");
        }
        assert_eq!(std::fs::read(&out).ok(), was.map(|bytes| bytes.to_vec()));
    }
}
