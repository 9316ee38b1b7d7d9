//! Options that make no sense together.

use super::{assert_refused_as_bad, evtach, folder, rotor, write};

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

/// What was named is written over, by every subcommand; what was not is left as it is, but an older report is renewed.
#[test]
fn a_report_that_nobody_named_is_not_written_over() {
    let folder = folder();
    let file = write(&folder, "rotor.raw", &rotor()).display().to_string();
    let report = folder.path().join("rotor.html");
    let name = report.display().to_string();
    let run = evtach(&["plot", &file], b"");
    assert_eq!((run.code, run.stdout), (Some(0), format!("{name}\n")), "{}", run.stderr);
    assert_eq!(evtach(&["plot", &file], b"").code, Some(0));
    std::fs::write(&report, b"what was there").expect("room on the disk");
    assert_refused_as_bad(&evtach(&["plot", &file], b""), &format!("{name} is there already"));
    assert_eq!(std::fs::read(&report).ok().as_deref(), Some(&b"what was there"[..]));
    let run = evtach(&["plot", &file, "--out", &name], b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let written = std::fs::read_to_string(&report).expect("a report");
    assert!(written.contains("</html>"), "{written}");
}

#[test]
fn a_part_that_ends_before_it_starts_is_refused() {
    let folder = folder();
    let file = write(&folder, "rotor.raw", &rotor()).display().to_string();
    let out = folder.path().join("out.raw");
    let span = ["--start", "0.4", "--end", "0.25"];
    let told = "--start 0.4 does not lie before --end 0.25";
    for command in
        [&["measure", &file][..], &["plot", &file], &["convert", &file, &out.display().to_string()]]
    {
        assert_refused_as_bad(&evtach(&[command, &span].concat(), b""), told);
    }
    assert!(!out.exists());
}

/// What is said to be too narrow was stated.
#[test]
fn a_part_without_events_is_told_as_it_was_stated() {
    let folder = folder();
    let file = write(&folder, "rotor.raw", &rotor()[..20]).display().to_string();
    let (start, end) = (&["--start", "100"][..], &["--end", "200"][..]);
    // A single pixel far from all.
    let roi = &["--roi", "199,159,1,1"][..];
    for (options, told) in [
        (start, "no events from --start on; "),
        (&[start, end].concat(), "no events between --start and --end; "),
        (roi, "no events inside --roi; "),
        (&[end, roi].concat(), "no events before --end inside --roi; "),
    ] {
        let run = evtach(&[&["measure", &file], options].concat(), b"");
        assert_refused_as_bad(&run, told);
        let run = evtach(&[&["convert", &file, "-", "--to", "csv"], options].concat(), b"");
        assert!(run.code == Some(0) && run.stderr.contains(told), "{}", run.stderr);
    }
}
